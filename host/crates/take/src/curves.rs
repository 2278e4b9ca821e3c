//! What the joints of a take said over time, as it is drawn: the lowest and highest angle in each of so many steps.

use std::ops::ControlFlow;

use armature_rig::{JointAxis, PartUid, RawSample, SensorCalibration, SensorState, StreamSolver};

use crate::file::{Record, Take};
use crate::replay::settle;
use crate::time::DeviceClock;

/// Lowest and highest angle within a step, radians.
pub type Span = [f32; 2];

/// The curves of a take.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curves {
    /// From the first sample to the last, seconds of the device's clock as in a [`crate::Timeline`].
    pub seconds: f64,
    /// One for each axis of each part, in the order of the first topology that has it.
    pub joints: Vec<JointCurve>,
}

/// One axis of a part over time.
#[derive(Clone, Debug, PartialEq)]
pub struct JointCurve {
    /// The part.
    pub part: PartUid,
    /// The axis.
    pub axis: JointAxis,
    /// Zero-based sensor of the part.
    pub sensor: usize,
    /// For each step what was measured; `None` without a good reading, or before zero.
    pub raw: Vec<Option<Span>>,
    /// For each step what moved the bone, after the filter; `None` where the part moves none.
    pub filtered: Vec<Option<Span>>,
}

/// A sensor of the topology in force.
struct Slot {
    curve: usize,
    counts_per_turn: u32,
    calibration: Option<SensorCalibration>,
}

/// The curves of a take in this many steps of equal length; 0 counts as 1.
///
/// `progress` is called with the current stage and the fraction done, 0 to 1; [`ControlFlow::Break`] gives `None`.
pub fn curves(
    take: &Take,
    steps: usize,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Option<Curves> {
    let steps = steps.max(1);
    let last = last_micros(take);
    let step_of = |micros: i64| {
        let part = micros.max(0) as f64 / (last.max(1)) as f64;
        ((part * steps as f64) as usize).min(steps - 1)
    };
    let mut out = Curves { seconds: last.max(0) as f64 * 1e-6, joints: Vec::new() };
    let mut solver = StreamSolver::new(take.skeleton().cloned().unwrap_or_default());
    let mut slots: Vec<Slot> = Vec::new();
    let mut clock = DeviceClock::new(take);
    for (index, record) in take.records().iter().enumerate() {
        // A ground that does not fit moves the roots only, and they have no joints.
        let _ = settle(&mut solver, record);
        match record {
            Record::Topology(_) | Record::Calibration(_) => slots = slots_of(&solver, steps, &mut out.joints),
            Record::Sample(sample) => {
                let step = step_of(clock.next_sample());
                out.measured(&slots, &sample.raw, step);
                // A sample that cannot be solved moves nothing.
                let solved = solver.solve(&sample.raw).is_ok();
                for (slot, angle) in solver.solver().filter(|_| solved).iter().flat_map(|s| s.filtered_angles()) {
                    let curve = slots.get(slot).and_then(|slot| out.joints.get_mut(slot.curve));
                    curve.into_iter().for_each(|curve| widen(&mut curve.filtered[step], angle));
                }
            }
            _ => {}
        }
        let is_due = index.is_multiple_of(1024);
        if is_due && progress("reading the joints", index as f64 / take.records().len() as f64).is_break() {
            return None;
        }
    }
    Some(out)
}

impl Curves {
    fn measured(&mut self, slots: &[Slot], raw: &RawSample, step: usize) {
        if raw.counts.len() != slots.len() || raw.states.len() != slots.len() {
            return;
        }
        for ((slot, counts), state) in slots.iter().zip(&raw.counts).zip(&raw.states) {
            let is_good = matches!(state, SensorState::Ok | SensorState::MagnetWeak);
            let angle = slot.calibration.filter(|_| is_good).and_then(|c| c.angle(*counts, slot.counts_per_turn));
            if let Some(angle) = angle {
                widen(&mut self.joints[slot.curve].raw[step], angle);
            }
        }
    }
}

/// The sensors of the topology in force, and the curves they go into; new ones are added.
fn slots_of(solver: &StreamSolver, steps: usize, joints: &mut Vec<JointCurve>) -> Vec<Slot> {
    let Some((_, tree)) = solver.topology() else { return Vec::new() };
    let mut slots = Vec::with_capacity(tree.sensor_count());
    for part in tree.parts() {
        let known = solver.calibration().part(part.uid).unwrap_or_default();
        for (sensor, &axis) in part.kind.axes().iter().enumerate() {
            let found = joints.iter().position(|joint| joint.part == part.uid && joint.sensor == sensor);
            let curve = found.unwrap_or_else(|| {
                let empty = || vec![None; steps];
                joints.push(JointCurve { part: part.uid, axis, sensor, raw: empty(), filtered: empty() });
                joints.len() - 1
            });
            let calibration = known.get(sensor).copied();
            slots.push(Slot { curve, counts_per_turn: part.counts_per_turn, calibration });
        }
    }
    slots
}

fn widen(span: &mut Option<Span>, angle: f64) {
    let angle = angle as f32;
    if angle.is_finite() {
        *span = Some(span.map_or([angle; 2], |[low, high]| [low.min(angle), high.max(angle)]));
    }
}

fn last_micros(take: &Take) -> i64 {
    let mut clock = DeviceClock::new(take);
    take.samples().map(|_| clock.next_sample()).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use armature_rig::{Bone, Calibration, Skeleton, Transform, propose, skeleton_puppet};

    use super::*;
    use crate::file::{Header, TakeWriter};

    fn never(_: &'static str, _: f64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// An arm whose bend goes up by a count per sample, and has no data in the second half.
    fn take() -> Take {
        let arm = Bone { name: "arm".into(), parent: None, rest: Transform::IDENTITY, tail: [0.0, 1.0, 0.0].into() };
        let skeleton = Skeleton::new(vec![arm]).unwrap();
        let (tree, _) = skeleton_puppet(&skeleton, 4096, |part| PartUid([part as u8 + 1; 12])).unwrap();
        let mut calibration = Calibration::for_tree(&tree);
        let sample = |step: u16, state| RawSample {
            device_micros: 1_000 * u64::from(step),
            sequence: step.into(),
            epoch: 0,
            counts: vec![0, step, 0],
            states: vec![SensorState::Ok, state, SensorState::Ok],
        };
        calibration.zero(&tree, &sample(0, SensorState::Ok)).unwrap();
        let mut writer = TakeWriter::new(Vec::new(), &Header::default()).unwrap();
        writer.skeleton(&skeleton).unwrap();
        writer.topology(0, &tree).unwrap();
        writer.calibration(&calibration).unwrap();
        writer.mapping(&propose(&tree, &skeleton).mapping).unwrap();
        for step in 0..=1000 {
            let state = if step < 500 { SensorState::Ok } else { SensorState::NoData };
            writer.sample(&sample(step, state), None).unwrap();
        }
        Take::read(&writer.finish().unwrap()).unwrap().0
    }

    #[test]
    fn steps_hold_the_lowest_and_highest_angle() {
        let curves = curves(&take(), 10, &mut never).unwrap();
        assert!((curves.seconds - 1.0).abs() < 1e-9 && curves.joints.len() == 3);
        let bend = &curves.joints[1];
        let count = std::f64::consts::TAU / 4096.0;
        let [low, high] = bend.raw[2].unwrap();
        assert!((f64::from(low) - 200.0 * count).abs() < 1e-6 && (f64::from(high) - 299.0 * count).abs() < 1e-6);
        assert_eq!((bend.raw[7], bend.raw.len()), (None, 10), "no data is no angle");
        let held = bend.filtered[7].unwrap();
        assert!(
            (f64::from(held[0]) - 499.0 * count).abs() < 1e-6 && (held[0] - held[1]).abs() < 1e-9,
            "the bone stays: {held:?}"
        );
    }

    #[test]
    fn it_can_be_cancelled_and_takes_nothing() {
        assert_eq!(curves(&take(), 10, &mut |_, _| ControlFlow::Break(())), None);
        let empty = TakeWriter::new(Vec::new(), &Header::default()).unwrap().finish().unwrap();
        let empty = curves(&Take::read(&empty).unwrap().0, 0, &mut never).unwrap();
        assert!(empty.joints.is_empty() && empty.seconds == 0.0);
    }
}
