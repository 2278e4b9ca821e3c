//! What a window draws, filled from the pipeline.

use std::collections::VecDeque;
use std::io::Write;
use std::time::Duration;

use armature_device::{DeviceInfo, SessionCounters};
use armature_rig::JointTree;

use super::event::{Frame, Stats};
use super::latency::percentile;
use super::pipeline::Pipeline;
use super::puppeteer::Puppeteer;

/// Rates and latencies are taken over about this time.
const WINDOW_SECONDS: f64 = 1.0;

/// Rates and latencies of the last second.
#[derive(Debug, Default)]
pub struct FrameClock {
    arrivals: VecDeque<(f64, Duration)>,
}

impl FrameClock {
    /// A sample that arrived at this time (seconds), and how long after its last byte the character was posed.
    pub fn sample(&mut self, latency: Duration, now: f64) {
        self.arrivals.push_back((now, latency));
        while self.arrivals.front().is_some_and(|(at, _)| now - *at > WINDOW_SECONDS) {
            self.arrivals.pop_front();
        }
    }

    /// Rates and latencies, with the session's counters.
    pub fn stats(&self, counters: &SessionCounters) -> Stats {
        let span = match (self.arrivals.front(), self.arrivals.back()) {
            (Some((first, _)), Some((last, _))) => (last - first) as f32,
            _ => 0.0,
        };
        let mut micros: Vec<f64> = self.arrivals.iter().map(|(_, latency)| latency.as_secs_f64() * 1e6).collect();
        micros.sort_by(f64::total_cmp);
        let at = |fraction| if micros.is_empty() { 0.0 } else { percentile(&micros, fraction) as f32 };
        Stats {
            samples_per_second: if span > 0.0 { (self.arrivals.len() - 1) as f32 / span } else { 0.0 },
            samples: counters.samples,
            lost_samples: counters.lost_samples,
            crc_errors: counters.checksum_errors,
            resyncs: counters.framing_errors,
            latency_p50_micros: at(0.5),
            latency_p99_micros: at(0.99),
        }
    }
}

/// Fills a frame from the latest pose.
pub fn fill<W: Write>(frame: &mut Frame, pipeline: &Pipeline<W>, stats: Stats) {
    fill_character(frame, pipeline.puppeteer());
    fill_sensors(frame, pipeline);
    frame.stats = stats;
}

/// Fills a frame with a character in its latest pose.
pub fn fill_character(frame: &mut Frame, puppeteer: &Puppeteer) {
    let (positions, normals) = puppeteer.skinned();
    frame.positions.clear();
    frame.positions.extend_from_slice(positions);
    frame.normals.clear();
    frame.normals.extend_from_slice(normals);
    frame.bones.clear();
    let bones = puppeteer.character().skeleton.bones();
    frame.bones.extend(puppeteer.model_from_bone().iter().zip(bones).map(|(model_from_bone, bone)| {
        (model_from_bone.translation.into(), model_from_bone.transform_point3(bone.tail).into())
    }));
}

fn fill_sensors<W: Write>(frame: &mut Frame, pipeline: &Pipeline<W>) {
    frame.angles.clear();
    frame.states.clear();
    let (Some(tree), Some(sample)) = (pipeline.tree(), pipeline.latest_sample()) else { return };
    frame.states.extend_from_slice(&sample.states);
    for (index, part) in tree.parts().iter().enumerate() {
        let calibration = pipeline.puppeteer().calibration().part(part.uid).unwrap_or_default();
        for (sensor, slot) in tree.sensors(index).enumerate() {
            let counts = sample.counts.get(slot).copied().unwrap_or_default();
            let angle = calibration.get(sensor).and_then(|c| c.angle(counts, part.counts_per_turn));
            frame.angles.push(angle.unwrap_or(0.0) as f32);
        }
    }
}

/// For each part the bone it drives.
pub fn bone_of_part(tree: &JointTree, puppeteer: &Puppeteer) -> Vec<Option<usize>> {
    let skeleton = &puppeteer.character().skeleton;
    let bone_of = |part: &armature_rig::Part| {
        let entry = puppeteer.mapping()?.entries.iter().find(|e| e.part == part.uid)?;
        skeleton.find(&entry.bone)
    };
    tree.parts().iter().map(bone_of).collect()
}

/// For each bone, whether inverse kinematics turns it; empty if it is off.
pub fn solved_bones(puppeteer: &Puppeteer) -> Vec<bool> {
    let roles = puppeteer.bone_roles().unwrap_or_default();
    roles.iter().map(|role| *role == armature_character::inverse_kinematics::BoneRole::Solved).collect()
}

/// One line about a device, for display.
pub fn device_line(info: &DeviceInfo) -> String {
    let [major, minor] = info.protocol;
    let [firmware_major, firmware_minor, patch] = info.firmware;
    format!("{} · firmware {firmware_major}.{firmware_minor}.{patch} · protocol {major}.{minor}", info.name)
}
