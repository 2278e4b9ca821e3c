//! A pose as stored in the file: only what differs from the rest pose, bit for bit.

use armature_rig::{Pose, Skeleton, Transform};

use super::bytes::{Fields, Put};
use super::error::PayloadError;

const TRANSLATION: u8 = 1;
const ROTATION: u8 = 2;
const SCALE: u8 = 4;

/// One solved pose. It keeps the packed bytes, about 17 per rotating bone and 1 per resting one, so that a long take
/// fits in memory; [`PackedPose::unpack`] returns the exact bits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PackedPose {
    /// Sequence number of the sample it was solved from.
    pub sequence: u32,
    /// Device clock of that sample, microseconds.
    pub device_micros: u64,
    bone_count: u16,
    /// One flag byte per bone, then the numbers that the flags announce.
    packed: Box<[u8]>,
}

impl PackedPose {
    /// Packs a pose; `None` if it has a different number of bones than the skeleton.
    pub fn pack(sequence: u32, device_micros: u64, pose: &Pose, skeleton: &Skeleton) -> Option<Self> {
        if pose.parent_from_bone.len() != skeleton.len() {
            return None;
        }
        let mut packed = Vec::with_capacity(skeleton.len() * 17);
        pack(pose, skeleton, &mut packed);
        let bone_count = u16::try_from(skeleton.len()).ok()?;
        Some(Self { sequence, device_micros, bone_count, packed: packed.into_boxed_slice() })
    }

    /// Number of bones.
    pub fn bone_count(&self) -> usize {
        usize::from(self.bone_count)
    }

    /// Writes the pose into `pose`, whose storage is reused.
    ///
    /// A take checks its poses against its skeleton when it is read. For a skeleton with a different number of bones,
    /// this gives that skeleton's rest pose.
    pub fn unpack(&self, skeleton: &Skeleton, pose: &mut Pose) {
        pose.parent_from_bone.clear();
        pose.parent_from_bone.extend(skeleton.bones().iter().map(|bone| bone.rest));
        if skeleton.len() != self.bone_count() {
            return;
        }
        let (flags, numbers) = self.packed.split_at(self.bone_count().min(self.packed.len()));
        let mut numbers = Fields::new(numbers);
        for (transform, &flag) in pose.parent_from_bone.iter_mut().zip(flags) {
            match changed(&mut numbers, flag, *transform) {
                Ok(read) => *transform = read,
                Err(_) => return,
            }
        }
    }

    /// Reads the packed pose of a skeleton with `bone_count` bones.
    pub(super) fn read(
        sequence: u32,
        device_micros: u64,
        bone_count: u16,
        fields: &mut Fields<'_>,
    ) -> Result<Self, PayloadError> {
        let mut rest = *fields;
        let flags = rest.bytes(bone_count.into(), "bone flags")?;
        let mut numbers = 0;
        for &flag in flags {
            if flag & !(TRANSLATION | ROTATION | SCALE) != 0 {
                return Err(PayloadError::UnknownCode { field: "bone flags", value: flag.into() });
            }
            numbers += number_bytes(flag);
        }
        let packed = fields.bytes(usize::from(bone_count) + numbers, "changed bones")?;
        Ok(Self { sequence, device_micros, bone_count, packed: packed.into() })
    }

    pub(super) fn packed(&self) -> &[u8] {
        &self.packed
    }
}

/// Appends flags and numbers of a pose with as many bones as the skeleton.
pub(super) fn pack(pose: &Pose, skeleton: &Skeleton, out: &mut Vec<u8>) {
    let bones = || pose.parent_from_bone.iter().zip(skeleton.bones().iter().map(|bone| bone.rest));
    out.extend(bones().map(|(now, rest)| flag(now, &rest)));
    for (now, rest) in bones() {
        let flag = flag(now, &rest);
        if flag & TRANSLATION != 0 {
            out.put_vec3(now.translation);
        }
        if flag & ROTATION != 0 {
            out.put_quat(now.rotation);
        }
        if flag & SCALE != 0 {
            out.put_vec3(now.scale);
        }
    }
}

fn flag(now: &Transform, rest: &Transform) -> u8 {
    let translation = now.translation.to_array().map(f32::to_bits) != rest.translation.to_array().map(f32::to_bits);
    let rotation = now.rotation.to_array().map(f32::to_bits) != rest.rotation.to_array().map(f32::to_bits);
    let scale = now.scale.to_array().map(f32::to_bits) != rest.scale.to_array().map(f32::to_bits);
    (u8::from(translation) * TRANSLATION) | (u8::from(rotation) * ROTATION) | (u8::from(scale) * SCALE)
}

/// Whether two transforms are the same to the last bit (so -0 differs from 0, and a NaN equals itself).
pub(crate) fn same_bits(a: &Transform, b: &Transform) -> bool {
    flag(a, b) == 0
}

fn number_bytes(flag: u8) -> usize {
    [(TRANSLATION, 12), (ROTATION, 16), (SCALE, 12)].iter().filter(|(bit, _)| flag & bit != 0).map(|(_, n)| n).sum()
}

fn changed(numbers: &mut Fields<'_>, flag: u8, rest: Transform) -> Result<Transform, PayloadError> {
    let mut transform = rest;
    if flag & TRANSLATION != 0 {
        transform.translation = numbers.vec3("translation")?;
    }
    if flag & ROTATION != 0 {
        transform.rotation = numbers.quat("rotation")?;
    }
    if flag & SCALE != 0 {
        transform.scale = numbers.vec3("scale")?;
    }
    Ok(transform)
}
