//! How a run went, in numbers and in words.

use std::fmt::{self, Write as _};
use std::path::PathBuf;

use armature_character::inverse_kinematics::Missed;
use armature_device::{DeviceInfo, SessionCounters};
use armature_rig::Filter;

use super::latency::LatencySummary;
use super::puppeteer::Puppeteer;
use super::take_recorder::RecordedTake;
use crate::characters::inverse_kinematics::RoleCounts;
use crate::failure::Failure;
use crate::terminal::counted;

/// Speeds at which the lag of a filter is reported, radians a second.
const CALM: f64 = 0.5;
const QUICK: f64 = 3.0;

/// How it went.
#[derive(Clone, Debug)]
pub struct RunSummary {
    /// Who the puppet was.
    pub device: Option<DeviceInfo>,
    /// How many joints and bones, and how many bones are driven.
    pub joints_bones_driven: (usize, usize, usize),
    /// What turned the bones; `None` where bones without a joint stayed at rest.
    pub roles: Option<RoleCounts>,
    /// The targets that were missed, and by how much at most.
    pub missed_targets: Vec<Missed>,
    /// Which pinned bones were away from their places, and how far, mesh units.
    pub missed_pins: Vec<(String, f32)>,
    /// How far the puppet's legs dragged a foot that stood beside the other, mesh units, where they did.
    pub dragged_foot: Option<f32>,
    /// Poses after zeroing.
    pub poses: u64,
    /// How long they went on, seconds.
    pub seconds: f64,
    /// Last byte of a sample → posed and skinned; `None` on a virtual clock.
    pub latency: Option<LatencySummary>,
    /// What the filters of the joints do, if they do anything, in words.
    pub filter: Option<String>,
    /// What the session counted.
    pub counters: SessionCounters,
    /// The take.
    pub take: Option<(PathBuf, RecordedTake)>,
    /// What ended the run early, although everything until then is safe.
    pub trouble: Option<Failure>,
}

/// What the filters cost, for a calm and for a quick motion.
pub(super) fn filter_line(puppeteer: &Puppeteer, period: f64) -> Option<String> {
    let calibration = puppeteer.calibration();
    let own = calibration.set_parts().filter(|(_, settings)| settings.filter.is_some()).count();
    if calibration.filter == Filter::None && own == 0 {
        return None;
    }
    let lag = |speed: f64| calibration.filter.lag_seconds(speed, period) * 1e3;
    let mut line = calibration.filter.to_string();
    if lag(CALM) > 0.0 {
        let _ = write!(
            line,
            ": the character is {:.0} ms behind at {CALM} rad/s and {:.0} ms at {QUICK} rad/s",
            lag(CALM),
            lag(QUICK)
        );
    }
    if own > 0 {
        let parts = counted(own, "part has its own filter", "parts have their own filters");
        let _ = write!(line, "; {parts}");
    }
    let (least, most) = puppeteer.lag_seconds();
    if most > 0.0 {
        let _ = write!(line, "; at the end {:.0} to {:.0} ms", least * 1e3, most * 1e3);
    }
    Some(line)
}

impl fmt::Display for RunSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (joints, bones, driven) = self.joints_bones_driven;
        let rate = self.poses as f64 / self.seconds.max(1e-9);
        if let Some(device) = &self.device {
            let [major, minor] = device.protocol;
            writeln!(
                f,
                "puppet     {} (protocol {major}.{minor}), {} {driven} of {}",
                device.name,
                counted(joints, "joint drives", "joints drive"),
                counted(bones, "bone", "bones")
            )?;
        }
        if let Some(roles) = &self.roles {
            writeln!(f, "bones      {roles}")?;
        }
        if !self.missed_targets.is_empty() {
            let each = |missed: &Missed| format!("{} by up to {:.4}", missed.name, missed.distance);
            let all: Vec<String> = self.missed_targets.iter().map(each).collect();
            writeln!(
                f,
                "targets    missed: {}; they are out of reach, or the puppet turns what would have to move",
                all.join(", ")
            )?;
        }
        if !self.missed_pins.is_empty() {
            let missed = self.missed_pins.iter().map(|(bone, by)| format!("{bone} by up to {by:.4}"));
            let missed = missed.collect::<Vec<_>>().join(", ");
            writeln!(f, "pins       out of reach: {missed}; joints do not turn further (--limit changes how far)")?;
        }
        if let Some(dragged) = self.dragged_foot {
            writeln!(
                f,
                "ground     the puppet's legs dragged a standing foot by up to {dragged:.4}; the other one stayed in place"
            )?;
        }
        writeln!(f, "stream     {} poses in {:.2} s, {rate:.1} a second", self.poses, self.seconds)?;
        let counters = &self.counters;
        write!(
            f,
            "losses     {} lost, {} with a wrong checksum, {}, {} discarded, {}",
            counted(counters.lost_samples as usize, "sample", "samples"),
            counted(counters.checksum_errors as usize, "frame", "frames"),
            counted(counters.framing_errors as usize, "unreadable piece", "unreadable pieces"),
            counted(counters.discarded_bytes as usize, "byte", "bytes"),
            counted(counters.restarts as usize, "restart", "restarts")
        )?;
        if counters.clock_faults > 0 {
            let samples = counted(counters.clock_faults as usize, "sample", "samples");
            write!(
                f,
                "\nclock      {samples} whose device time could not be believed: rejected, or rebuilt from numbers and the \
                 host's clock"
            )?;
        }
        if let Some(filter) = &self.filter {
            write!(f, "\nfilter     {filter}")?;
        }
        if let Some(latency) = &self.latency {
            write!(f, "\nlatency    last byte of a sample → posed and skinned: {latency}")?;
        }
        if let Some((path, take)) = &self.take {
            let seconds = take.micros as f64 * 1e-6;
            write!(
                f,
                "\ntake       {}: {}, {seconds:.2} s of device time, {} lost",
                path.display(),
                counted(take.samples as usize, "sample", "samples"),
                take.lost
            )?;
        }
        Ok(())
    }
}
