//! Which parts of a puppet that streams have no data, and for how long.

use std::time::Duration;

use firmware_protocol::SensorState;

use crate::events::{DeviceNotice, DeviceProblem, Event, Sample};
use crate::topology::Topology;

/// A joint without data for this long is reported.
const SILENT: Duration = Duration::from_secs(1);
/// A puppet of which no sensor has data is reported after this; sensors take a moment to start.
const ALL_SILENT: Duration = Duration::from_millis(100);

#[derive(Clone, Copy, Debug, Default)]
struct Quiet {
    /// When the first of the samples in a row came that had no data of it.
    since: Option<Duration>,
    told: bool,
}

/// What is known of the parts' sensors.
#[derive(Clone, Debug, Default)]
pub(super) struct Silence {
    /// In the order of the topology.
    parts: Vec<Quiet>,
    all: Quiet,
}

impl Silence {
    /// The parts are these from now on.
    pub(super) fn begin(&mut self, topology: &Topology) {
        *self = Self { parts: vec![Quiet::default(); topology.parts.len()], all: Quiet::default() };
    }

    /// Takes the states of a sample that fits the topology.
    pub(super) fn observe(&mut self, topology: &Topology, sample: &Sample, events: &mut Vec<Event>) {
        let now = sample.received;
        let is_silent = |states: &[SensorState]| states.contains(&SensorState::NoData);
        let all = !sample.states.is_empty() && sample.states.iter().all(|&state| state == SensorState::NoData);
        if !all && self.all.told {
            // What was said of all was said of each.
            self.parts.iter_mut().for_each(|part| part.told = part.since.is_some());
        }
        if self.all.passes(all, now, ALL_SILENT) {
            let sensors = sample.states.len();
            events.push(Event::Problem(DeviceProblem::NoSensorAnswers { sensors }));
        }
        let mut first = 0;
        for (index, (part, quiet)) in topology.parts.iter().zip(&mut self.parts).enumerate() {
            let sensors = first..first + usize::from(part.sensor_count);
            first = sensors.end;
            let silent = is_silent(&sample.states[sensors]);
            let (was_told, since) = (quiet.told, quiet.since);
            if quiet.passes(silent, now, SILENT) && !self.all.told {
                let uid = part.uid;
                events.push(Event::Notice(DeviceNotice::JointSilent { part: index, uid }));
            } else if let (false, true, Some(since)) = (silent, was_told, since) {
                let (uid, seconds) = (part.uid, now.saturating_sub(since).as_secs_f64());
                events.push(Event::Notice(DeviceNotice::JointBack { part: index, uid, seconds }));
            }
        }
    }
}

impl Quiet {
    /// Notes whether it is silent now; whether it has just been so for this long.
    fn passes(&mut self, silent: bool, now: Duration, patience: Duration) -> bool {
        if !silent {
            *self = Self::default();
            return false;
        }
        let since = *self.since.get_or_insert(now);
        now.saturating_sub(since) >= patience && !std::mem::replace(&mut self.told, true)
    }
}
