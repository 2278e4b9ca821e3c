//! The poses of one take against those of another: did a change of program, mapping or firmware change the performance?

use std::collections::{BTreeMap, VecDeque};

use armature_rig::{Pose, Skeleton, Transform};

use crate::file::{PackedPose, Record, Take, same_bits};
use crate::time::Timeline;

/// How far poses may differ and still count as equal. The default is not at all: bit for bit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tolerance {
    /// Angle between two rotations, radians.
    pub angle: f64,
    /// Distance between two translations, and between two scales.
    pub distance: f64,
}

impl Tolerance {
    fn is_exact(self) -> bool {
        self.angle <= 0.0 && self.distance <= 0.0
    }
}

/// Why the poses of two takes cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CompareError {
    /// One of them has no skeleton.
    #[error("the {which} take holds no skeleton, so there is nothing to compare; record it with a character")]
    NoSkeleton {
        /// Which one.
        which: &'static str,
    },
    /// The skeletons have other bones.
    #[error("the takes have different skeletons: {difference}; record both with the same character")]
    OtherSkeleton {
        /// The first difference.
        difference: String,
    },
}

/// The first bone that differs.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseDifference {
    /// Its sample's time, seconds since the expected take's first sample.
    pub seconds: f64,
    /// Its sample's number.
    pub sequence: u32,
    /// The bone's name.
    pub bone: String,
    /// The part that drives the bone, by the mapping in force; `None` if none does.
    pub joint: Option<String>,
    /// Angle between the two rotations, radians.
    pub angle: f64,
    /// Distance between the two translations.
    pub distance: f64,
}

/// How the poses of two takes compare.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Poses of the same sample that are equal.
    pub equal: u64,
    /// Poses of the same sample that differ.
    pub different: u64,
    /// Expected poses for whose sample there is none.
    pub missing: u64,
    /// Poses of samples that are not expected.
    pub unexpected: u64,
    /// The first difference in the order of samples.
    pub first: Option<PoseDifference>,
    /// The largest angle between two rotations of a bone, radians, whether tolerated or not.
    pub largest_angle: f64,
}

impl Comparison {
    /// Whether every expected pose is there and equal, no other is, and there was at least one.
    pub fn agrees(&self) -> bool {
        self.equal > 0 && self.different == 0 && self.missing == 0 && self.unexpected == 0
    }
}

/// Compares poses, as [`crate::solve_again`] returned them for `take`, with those recorded in `expected`, sample by
/// sample: by number and device time, and by order where a device restarted and counts again.
pub fn compare(
    take: &Take,
    poses: &[PackedPose],
    expected: &Take,
    tolerance: Tolerance,
) -> Result<Comparison, CompareError> {
    let skeleton = expected.skeleton().ok_or(CompareError::NoSkeleton { which: "expected" })?;
    let own = take.skeleton().ok_or(CompareError::NoSkeleton { which: "replayed" })?;
    if let Some(difference) = other_bones(skeleton, own) {
        return Err(CompareError::OtherSkeleton { difference });
    }
    let mut by_sample: BTreeMap<(u32, u64), VecDeque<&PackedPose>> = BTreeMap::new();
    for pose in poses {
        by_sample.entry((pose.sequence, pose.device_micros)).or_default().push_back(pose);
    }
    let times = Timeline::recorded(expected);
    let mut comparison = Comparison::default();
    let (mut wanted, mut got) = (Pose::default(), Pose::default());
    let mut drivers: BTreeMap<String, String> = BTreeMap::new();
    for record in expected.records() {
        match record {
            Record::Mapping(mapping) => {
                let pairs = mapping.entries.iter().map(|entry| (entry.bone.clone(), entry.part.to_string()));
                drivers = pairs.collect();
            }
            Record::Pose(packed) => {
                let found = by_sample.get_mut(&(packed.sequence, packed.device_micros)).and_then(VecDeque::pop_front);
                let Some(found) = found else {
                    comparison.missing += 1;
                    continue;
                };
                packed.unpack(skeleton, &mut wanted);
                found.unpack(own, &mut got);
                let seconds = || seconds_of(times.as_ref(), packed);
                comparison.add(&wanted, &got, tolerance, |bone, angle, distance| PoseDifference {
                    seconds: seconds(),
                    sequence: packed.sequence,
                    bone: skeleton.bones()[bone].name.clone(),
                    joint: drivers.get(&skeleton.bones()[bone].name).cloned(),
                    angle,
                    distance,
                });
            }
            _ => {}
        }
    }
    comparison.unexpected = by_sample.values().map(|left| left.len() as u64).sum();
    Ok(comparison)
}

fn seconds_of(times: Option<&Timeline<'_>>, packed: &PackedPose) -> f64 {
    let all = (0..).map_while(|index| times?.get(index));
    let mut same = all.filter(|(_, pose)| std::ptr::eq(*pose, packed) || *pose == packed);
    same.next().map_or(0.0, |(seconds, _)| seconds)
}

impl Comparison {
    fn add(
        &mut self,
        wanted: &Pose,
        got: &Pose,
        tolerance: Tolerance,
        difference: impl FnOnce(usize, f64, f64) -> PoseDifference,
    ) {
        let mut differs = None;
        for (bone, (a, b)) in wanted.parent_from_bone.iter().zip(&got.parent_from_bone).enumerate() {
            if same_bits(a, b) {
                continue;
            }
            let (angle, distance) = apart(a, b);
            self.largest_angle = self.largest_angle.max(angle);
            // NaN is no tolerated distance.
            let tolerated = !tolerance.is_exact() && angle <= tolerance.angle && distance <= tolerance.distance;
            if !tolerated && differs.is_none() {
                differs = Some((bone, angle, distance));
            }
        }
        match differs {
            None => self.equal += 1,
            Some((bone, angle, distance)) => {
                self.different += 1;
                if self.first.is_none() {
                    self.first = Some(difference(bone, angle, distance));
                }
            }
        }
    }
}

/// Angle between rotations, and the larger distance of translations and scales.
fn apart(a: &Transform, b: &Transform) -> (f64, f64) {
    let turn = a.rotation.as_dquat().normalize() * b.rotation.as_dquat().normalize().conjugate();
    let angle = 2.0 * libm::atan2(turn.xyz().length(), turn.w.abs());
    let shift = a.translation.as_dvec3().distance(b.translation.as_dvec3());
    (angle, shift.max(a.scale.as_dvec3().distance(b.scale.as_dvec3())))
}

fn other_bones(expected: &Skeleton, own: &Skeleton) -> Option<String> {
    if expected.len() != own.len() {
        return Some(format!("{} bones are expected, there are {}", expected.len(), own.len()));
    }
    let mut pairs = expected.bones().iter().zip(own.bones());
    pairs.find(|(a, b)| a.name != b.name || a.parent != b.parent).map(|(a, b)| {
        if a.name == b.name {
            format!("the bone {:?} hangs from another one", a.name)
        } else {
            format!("where {:?} is expected, there is {:?}", a.name, b.name)
        }
    })
}
