//! What the window draws, filled from the stage.

use std::collections::VecDeque;
use std::io::Write;
use std::time::{Duration, Instant};

use armature_device::{DeviceInfo, SessionCounters};
use armature_rig::JointTree;

use super::actor::Actor;
use super::latency::Latencies;
use super::performance::Performance;
use super::stage::Stage;
use crate::app::engine::{CharacterView, Frame, Stats, Texture};

/// Rates and latencies are over about this time.
const WINDOW: Duration = Duration::from_secs(1);

/// Rates and latencies of the last second.
#[derive(Debug, Default)]
pub struct FrameClock {
    arrivals: VecDeque<(Instant, Duration)>,
}

impl FrameClock {
    /// A sample that arrived, and how long after its last byte the character was posed.
    pub fn sample(&mut self, latency: Duration, now: Instant) {
        self.arrivals.push_back((now, latency));
        while self.arrivals.front().is_some_and(|(at, _)| now.duration_since(*at) > WINDOW) {
            self.arrivals.pop_front();
        }
    }

    fn stats(&self, counters: &SessionCounters) -> Stats {
        let span = match (self.arrivals.front(), self.arrivals.back()) {
            (Some((first, _)), Some((last, _))) => last.duration_since(*first).as_secs_f32(),
            _ => 0.0,
        };
        let mut latencies = Latencies::default();
        self.arrivals.iter().for_each(|(_, latency)| latencies.add(*latency));
        let summary = latencies.summary();
        Stats {
            samples_per_second: if span > 0.0 { (self.arrivals.len() - 1) as f32 / span } else { 0.0 },
            samples: counters.samples,
            lost_samples: counters.lost_samples,
            crc_errors: counters.checksum_errors,
            resyncs: counters.framing_errors,
            latency_p50_micros: summary.p50 as f32,
            latency_p99_micros: summary.p99 as f32,
        }
    }
}

/// Fills a frame from the latest pose.
pub fn fill<W: Write>(frame: &mut Frame, stage: &Stage<W>, clock: &FrameClock, counters: &SessionCounters) {
    let performance = stage.performance();
    let (positions, normals) = performance.skinned();
    frame.positions.clear();
    frame.positions.extend_from_slice(positions);
    frame.normals.clear();
    frame.normals.extend_from_slice(normals);
    frame.bones.clear();
    let bones = performance.actor().skeleton.bones();
    frame.bones.extend(performance.model_from_bone().iter().zip(bones).map(|(model_from_bone, bone)| {
        (model_from_bone.translation.into(), model_from_bone.transform_point3(bone.tail).into())
    }));
    fill_sensors(frame, stage);
    frame.stats = clock.stats(counters);
}

fn fill_sensors<W: Write>(frame: &mut Frame, stage: &Stage<W>) {
    frame.angles.clear();
    frame.states.clear();
    let (Some(tree), Some(sample)) = (stage.tree(), stage.latest_sample()) else { return };
    frame.states.extend_from_slice(&sample.states);
    for (index, part) in tree.parts().iter().enumerate() {
        let calibration = stage.performance().calibration().part(part.uid).unwrap_or_default();
        for (sensor, slot) in tree.sensors(index).enumerate() {
            let counts = sample.counts.get(slot).copied().unwrap_or_default();
            let angle = calibration.get(sensor).and_then(|c| c.angle(counts, part.counts_per_turn));
            frame.angles.push(angle.unwrap_or(0.0) as f32);
        }
    }
}

/// For each part the bone it drives.
pub fn bone_of_part(tree: &JointTree, performance: &Performance) -> Vec<Option<usize>> {
    let skeleton = &performance.actor().skeleton;
    let bone_of = |part: &armature_rig::Part| {
        let entry = performance.mapping()?.entries.iter().find(|e| e.part == part.uid)?;
        skeleton.find(&entry.bone)
    };
    tree.parts().iter().map(bone_of).collect()
}

/// For each bone whether inverse kinematics turns it; empty where it is off.
pub fn solved_bones(performance: &Performance) -> Vec<bool> {
    let roles = performance.bone_roles().unwrap_or_default();
    roles.iter().map(|role| *role == armature_character::BoneRole::Solved).collect()
}

/// One line about a device, for people.
pub fn device_line(info: &DeviceInfo) -> String {
    let [major, minor] = info.protocol;
    let [firmware_major, firmware_minor, patch] = info.firmware;
    format!("{} · firmware {firmware_major}.{firmware_minor}.{patch} · protocol {major}.{minor}", info.name)
}

/// A character as the window draws it.
pub fn view_of(actor: &Actor) -> CharacterView {
    let mut view =
        CharacterView { name: actor.name.clone(), skeleton: actor.skeleton.clone(), ..CharacterView::default() };
    if let Some(shape) = &actor.shape {
        view.positions.clone_from(&shape.positions);
        view.normals.clone_from(&shape.normals);
        view.triangles.clone_from(&shape.triangles);
        view.uv.clone_from(&shape.uv);
        view.base_color = shape.base_color;
        view.texture =
            shape.texture.as_ref().map(|t| Texture { width: t.width, height: t.height, rgba: t.rgba.clone() });
    }
    view.influences = actor.character.as_ref().map(|c| c.influences.clone());
    view
}
