//! From the device's words to the rig's: the one place where wire types and skeletons meet.

use std::collections::BTreeMap;

use armature_device as device;
use armature_rig as rig;
use armature_take::{ClockFault, EventKind};

use crate::failure::Failure;

/// A puppet as the rig sees it, and how to lay its samples out.
#[derive(Clone, Debug)]
pub struct Bridge {
    epoch: u16,
    tree: rig::JointTree,
    /// The columns of a device's sample that the tree's sensors read, in the tree's order.
    columns: Vec<usize>,
    /// Parts of a kind this version does not know: they hold the tree together but move nothing.
    unknown_parts: usize,
    sample: rig::RawSample,
}

impl Bridge {
    /// Reads the device's description of itself.
    pub fn new(topology: &device::Topology) -> Result<Self, Failure> {
        let mut columns = Vec::with_capacity(topology.sensor_count);
        let mut column = 0;
        let mut parts = Vec::with_capacity(topology.parts.len());
        for part in &topology.parts {
            let kind = rig_kind(part);
            columns.extend(column..column + kind.axes().len());
            column += usize::from(part.sensor_count);
            parts.push(rig::Part {
                uid: rig::PartUid(part.uid.0),
                kind,
                parent: part.parent.map(usize::from),
                outlet: part.outlet,
                counts_per_turn: part.counts_per_turn,
            });
        }
        let tree = rig::JointTree::new(parts).map_err(|e| {
            Failure::device(e.to_string(), "unplug and replug that part, or update the device's firmware")
        })?;
        let unknown_parts = topology.parts.iter().filter(|p| matches!(p.kind, device::PartKind::Other(_))).count();
        Ok(Self { epoch: topology.epoch, tree, columns, unknown_parts, sample: rig::RawSample::default() })
    }

    /// Number of this state of the tree.
    pub fn epoch(&self) -> u16 {
        self.epoch
    }

    /// The puppet.
    pub fn tree(&self) -> &rig::JointTree {
        &self.tree
    }

    /// How many parts are of a kind this version does not know.
    pub fn unknown_parts(&self) -> usize {
        self.unknown_parts
    }

    /// The sample that [`sample`](Self::sample) gave last; `None` before the first.
    pub fn latest(&self) -> Option<&rig::RawSample> {
        Some(&self.sample).filter(|s| s.counts.len() == self.columns.len() && !s.counts.is_empty())
    }

    /// A device's sample in the tree's order; `None` if it belongs to another topology. Reuses one buffer.
    pub fn sample(&mut self, sample: &device::Sample) -> Option<&rig::RawSample> {
        if sample.epoch != self.epoch || self.columns.last().is_some_and(|&last| last >= sample.counts.len()) {
            return None;
        }
        let raw = &mut self.sample;
        (raw.device_micros, raw.sequence, raw.epoch) = (sample.device_micros, sample.sequence, sample.epoch);
        raw.counts.clear();
        raw.counts.extend(self.columns.iter().map(|&c| sample.counts[c]));
        raw.states.clear();
        raw.states.extend(self.columns.iter().map(|&c| rig_state(sample.states[c])));
        Some(raw)
    }
}

fn rig_kind(part: &device::Part) -> rig::PartKind {
    match part.kind {
        device::PartKind::Bend => rig::PartKind::Bend,
        device::PartKind::Twist => rig::PartKind::Twist,
        device::PartKind::TwistBendTwist => rig::PartKind::TwistBendTwist,
        device::PartKind::Splitter | device::PartKind::Other(_) => {
            rig::PartKind::Splitter { outlets: part.outlet_count }
        }
    }
}

fn rig_state(state: device::SensorState) -> rig::SensorState {
    match state {
        device::SensorState::Ok => rig::SensorState::Ok,
        device::SensorState::NoData => rig::SensorState::NoData,
        device::SensorState::MagnetWeak => rig::SensorState::MagnetWeak,
        device::SensorState::Outlier => rig::SensorState::Outlier,
    }
}

/// What a take says of an event of the stream; nothing of what it does not record.
pub fn take_events(event: &device::Event) -> impl Iterator<Item = EventKind> {
    let (first, second) = match *event {
        device::Event::Lost { count, next_sequence } => {
            let after_sequence = next_sequence.wrapping_sub(count).wrapping_sub(1);
            (Some(EventKind::LostSamples { count: u64::from(count), after_sequence }), None)
        }
        device::Event::Noise { checksum_errors, framing_errors, bytes } => (
            Some(EventKind::Noise { crc_errors: checksum_errors, discarded_bytes: bytes }),
            (framing_errors > 0).then_some(EventKind::Resync { count: framing_errors }),
        ),
        device::Event::Restarted => (Some(EventKind::Restart), None),
        device::Event::Notice(device::DeviceNotice::LineBack { .. }) => (Some(EventKind::Reconnect), None),
        device::Event::Notice(ref notice) => (clock_fault(notice), None),
        _ => (None, None),
    };
    first.into_iter().chain(second)
}

/// What a take says of a clock that the session mends.
fn clock_fault(notice: &device::DeviceNotice) -> Option<EventKind> {
    let (fault, seconds) = match *notice {
        device::DeviceNotice::ClockLeaps { seconds, .. } => (ClockFault::Leapt, seconds),
        device::DeviceNotice::ClockStands { seconds, .. } => (ClockFault::Stood, seconds),
        device::DeviceNotice::ClockStepsBack { seconds } => (ClockFault::WentBack, seconds),
        _ => return None,
    };
    Some(EventKind::ClockFault { fault, micros: (seconds * 1e6) as u64 })
}

/// What is known of a puppet all of whose parts are servos of one arm: that it is an arm, and what its joints are called.
pub fn hints_of_servos(topology: &device::Topology) -> Option<rig::PuppetHints> {
    let name =
        |part: &device::Part| Some((rig::PartUid(part.uid.0), device::servo::ServoArm::joint_of(part.uid)?.name));
    let names: Option<BTreeMap<rig::PartUid, String>> = topology.parts.iter().map(name).collect();
    let names = names.filter(|names| !names.is_empty())?;
    Some(rig::PuppetHints { kind: Some(rig::PuppetKind::Arm), names, ..rig::PuppetHints::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(number: u8, kind: device::PartKind, sensors: u8, outlets: u8, parent: Option<u16>) -> device::Part {
        device::Part {
            kind,
            sensor_count: sensors,
            outlet: 0,
            outlet_count: outlets,
            parent,
            uid: device::PartUid([number; 12]),
            counts_per_turn: 4096,
        }
    }

    /// A bend, then a part of a later version with two sensors, then a twist.
    fn bridge() -> Bridge {
        let parts = vec![
            part(1, device::PartKind::Bend, 1, 1, None),
            part(2, device::PartKind::Other(77), 2, 1, Some(0)),
            part(3, device::PartKind::Twist, 1, 1, Some(1)),
        ];
        Bridge::new(&device::Topology::new(5, parts).unwrap()).unwrap()
    }

    fn sample(epoch: u16) -> device::Sample {
        device::Sample {
            device_micros: 7,
            sequence: 8,
            epoch,
            counts: vec![10, 20, 30, 40],
            states: vec![device::SensorState::Outlier; 4],
            ..device::Sample::default()
        }
    }

    #[test]
    fn an_arm_of_servos_is_known_by_its_part_numbers() {
        for arm in device::servo::ServoArm::presets() {
            let hints = hints_of_servos(&arm.topology(0xBEEF).unwrap()).unwrap();
            assert_eq!(hints.kind, Some(rig::PuppetKind::Arm));
            for joint in &arm.joints {
                assert_eq!(hints.names[&rig::PartUid(arm.part_uid(0xBEEF, joint.id).0)], joint.name, "{}", arm.name);
            }
        }
        let parts = vec![part(1, device::PartKind::Bend, 1, 1, None)];
        assert_eq!(hints_of_servos(&device::Topology::new(5, parts).unwrap()), None);
    }

    #[test]
    fn parts_of_a_later_version_hold_the_tree_together_and_move_nothing() {
        let mut bridge = bridge();
        assert_eq!(bridge.unknown_parts(), 1);
        assert_eq!(bridge.tree().sensor_count(), 2);
        assert_eq!(bridge.tree().parts()[2].parent, Some(1));
        let raw = bridge.sample(&sample(5)).unwrap();
        assert_eq!((raw.counts.as_slice(), raw.sequence, raw.device_micros), ([10, 40].as_slice(), 8, 7));
        assert_eq!(raw.states, [rig::SensorState::Outlier; 2]);
    }

    #[test]
    fn samples_of_another_topology_are_left_out() {
        let mut bridge = bridge();
        assert!(bridge.latest().is_none());
        assert!(bridge.sample(&sample(4)).is_none());
        let short = device::Sample { counts: vec![1, 2, 3], states: vec![device::SensorState::Ok; 3], ..sample(5) };
        assert!(bridge.sample(&short).is_none());
    }

    #[test]
    fn losses_name_the_last_sample_before_them() {
        let lost: Vec<EventKind> = take_events(&device::Event::Lost { count: 3, next_sequence: 10 }).collect();
        assert_eq!(lost, [EventKind::LostSamples { count: 3, after_sequence: 6 }]);
        assert_eq!(take_events(&device::Event::Started).count(), 0);
    }

    #[test]
    fn pieces_that_were_no_frame_are_told_apart_from_wrong_checksums() {
        let noise = device::Event::Noise { checksum_errors: 2, framing_errors: 3, bytes: 90 };
        let told: Vec<EventKind> = take_events(&noise).collect();
        assert_eq!(told, [EventKind::Noise { crc_errors: 2, discarded_bytes: 90 }, EventKind::Resync { count: 3 }]);
    }
}
