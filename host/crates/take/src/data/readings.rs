//! What every joint of a take said in each sample.

use armature_rig::{JointAxis, PartUid, SensorCalibration, SensorState, StreamSolver};

use crate::file::{Record, Sample, Take};
use crate::replay::settle;
use crate::time::DeviceClock;

/// A sensor of the puppet, at whatever time it was plugged in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadJoint {
    /// The part.
    pub part: PartUid,
    /// Zero-based sensor of the part, from its inlet.
    pub sensor: usize,
    /// What it measures.
    pub axis: JointAxis,
    /// The bone that the part drives, by the first mapping that says so.
    pub bone: Option<String>,
}

/// One reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointReading {
    /// As measured.
    pub count: u16,
    /// What the sensor says of it.
    pub state: SensorState,
    /// By the calibration in force, before any filter, radians; `None` if it is not zeroed or the count means nothing.
    pub angle: Option<f64>,
}

/// One sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Row<'t> {
    /// Microseconds after the take's first sample, by the device's clock, mended where it was wrong.
    pub micros: i64,
    /// The sample.
    pub sample: &'t Sample,
    /// One for each joint; `None` while it is not plugged in.
    pub readings: Vec<Option<JointReading>>,
}

/// The samples of a take as rows, and the joints as columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Readings<'t> {
    /// In the order of the first topology that has each.
    pub joints: Vec<ReadJoint>,
    /// In the order of the file.
    pub rows: Vec<Row<'t>>,
}

impl ReadJoint {
    /// `PART.SENSOR.bend` or `PART.SENSOR.twist`.
    pub fn name(&self) -> String {
        let axis = match self.axis {
            JointAxis::Bend => "bend",
            JointAxis::Twist => "twist",
        };
        format!("{}.{}.{axis}", self.part, self.sensor)
    }
}

/// A sensor of the topology in force.
struct Slot {
    joint: usize,
    counts_per_turn: u32,
    calibration: Option<SensorCalibration>,
}

/// What every joint of a take said.
pub fn readings(take: &Take) -> Readings<'_> {
    let mut out = Readings::default();
    let mut solver = StreamSolver::new(take.skeleton().cloned().unwrap_or_default());
    let mut slots: Vec<Slot> = Vec::new();
    let mut clock = DeviceClock::new(take);
    for record in take.records() {
        // A ground that does not fit moves the roots only, and they have no joints.
        let _ = settle(&mut solver, record);
        match record {
            Record::Topology(_) | Record::Calibration(_) => slots = slots_of(&solver, &mut out.joints),
            Record::Mapping(mapping) => {
                for joint in out.joints.iter_mut().filter(|joint| joint.bone.is_none()) {
                    let entry = mapping.entries.iter().find(|entry| entry.part == joint.part);
                    joint.bone = entry.map(|entry| entry.bone.clone());
                }
            }
            Record::Sample(sample) => {
                let micros = clock.next_sample();
                let mut readings = vec![None; out.joints.len()];
                let raw = &sample.raw;
                if raw.counts.len() == slots.len() && raw.states.len() == slots.len() {
                    for (slot, (&count, &state)) in slots.iter().zip(raw.counts.iter().zip(&raw.states)) {
                        let is_good = matches!(state, SensorState::Ok | SensorState::MagnetWeak);
                        let calibration = slot.calibration.filter(|_| is_good);
                        let angle = calibration.and_then(|own| own.angle(count, slot.counts_per_turn));
                        readings[slot.joint] = Some(JointReading { count, state, angle });
                    }
                }
                out.rows.push(Row { micros, sample, readings });
            }
            _ => {}
        }
    }
    // Rows from before a part was plugged in are shorter.
    let width = out.joints.len();
    out.rows.iter_mut().for_each(|row| row.readings.resize(width, None));
    out
}

fn slots_of(solver: &StreamSolver, joints: &mut Vec<ReadJoint>) -> Vec<Slot> {
    let Some((_, tree)) = solver.topology() else { return Vec::new() };
    let mut slots = Vec::with_capacity(tree.sensor_count());
    for part in tree.parts() {
        let known = solver.calibration().part(part.uid).unwrap_or_default();
        for (sensor, &axis) in part.kind.axes().iter().enumerate() {
            let found = joints.iter().position(|joint| joint.part == part.uid && joint.sensor == sensor);
            let joint = found.unwrap_or_else(|| {
                joints.push(ReadJoint { part: part.uid, sensor, axis, bone: None });
                joints.len() - 1
            });
            slots.push(Slot { joint, counts_per_turn: part.counts_per_turn, calibration: known.get(sensor).copied() });
        }
    }
    slots
}
