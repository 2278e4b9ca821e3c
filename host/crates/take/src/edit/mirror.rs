//! Left and right change places.

use armature_rig::{Pose, Skeleton, Transform};
use glam::{DAffine3, DQuat, DVec3};

/// How far a bone may be from the mirror image of its counterpart, as a share of the skeleton's size.
const TOLERANCE: f64 = 0.05;

/// Each bone's counterpart on the other side, and the rest pose in model space.
#[derive(Clone, Debug)]
pub(super) struct Mirror {
    counterpart: Vec<usize>,
    rest: Vec<DQuat>,
}

impl Mirror {
    /// Finds the counterparts by where bones rest: children of counterparts are counterparts, and the plane is X = 0 of
    /// the model. The name of the first bone without one is returned otherwise.
    pub(super) fn of(skeleton: &Skeleton) -> Result<Self, String> {
        let (rest, places) = model(skeleton, &skeleton.rest_pose());
        let ends: Vec<[DVec3; 2]> = skeleton
            .bones()
            .iter()
            .zip(&places)
            .map(|(bone, frame)| [frame.translation, frame.transform_point3(bone.tail.as_dvec3())])
            .collect();
        let size = ends.iter().flatten().map(|end| end.distance(ends[0][0])).fold(0.0, f64::max);
        let image = |point: DVec3| DVec3::new(-point.x, point.y, point.z);
        let off = |a: usize, b: usize| (0..2).map(|end| image(ends[a][end]).distance(ends[b][end])).fold(0.0, f64::max);
        let mut counterpart: Vec<Option<usize>> = vec![None; skeleton.len()];
        for bone in 0..skeleton.len() {
            if counterpart[bone].is_some() {
                continue;
            }
            let parent = skeleton.bones()[bone].parent.map(|parent| counterpart[parent]);
            let candidates = (0..skeleton.len())
                .filter(|&other| counterpart[other].is_none() && skeleton.bones()[other].parent.map(Some) == parent);
            let nearest = candidates.min_by(|&a, &b| off(bone, a).total_cmp(&off(bone, b)));
            match nearest.filter(|&other| off(bone, other) <= TOLERANCE * size) {
                Some(other) => {
                    counterpart[bone] = Some(other);
                    counterpart[other] = Some(bone);
                }
                None => return Err(skeleton.bones()[bone].name.clone()),
            }
        }
        Ok(Self { counterpart: counterpart.into_iter().flatten().collect(), rest })
    }

    /// The mirror image of a pose: each bone turns away from rest as its counterpart's image does.
    pub(super) fn pose(&self, skeleton: &Skeleton, pose: &Pose) -> Pose {
        let (turned, _) = model(skeleton, pose);
        let flip = |turn: DQuat| DQuat::from_xyzw(turn.x, -turn.y, -turn.z, turn.w);
        let model_from_bone: Vec<DQuat> = self
            .counterpart
            .iter()
            .zip(&self.rest)
            .map(|(&other, rest)| (flip(turned[other] * self.rest[other].conjugate()) * *rest).normalize())
            .collect();
        let bone = |(bone, own): (usize, &armature_rig::Bone)| {
            let other = self.counterpart[bone];
            let parent = own.parent.map_or(DQuat::IDENTITY, |parent| model_from_bone[parent]);
            let rotation = (parent.conjugate() * model_from_bone[bone]).normalize().as_quat();
            Transform {
                translation: self.translation(skeleton, pose, bone, other),
                rotation,
                scale: pose.parent_from_bone[other].scale,
            }
        };
        Pose { parent_from_bone: skeleton.bones().iter().enumerate().map(bone).collect() }
    }

    /// Away from rest as the counterpart is, in the frames of the parents at rest.
    fn translation(&self, skeleton: &Skeleton, pose: &Pose, bone: usize, other: usize) -> glam::Vec3 {
        let (own, from) = (&skeleton.bones()[bone], &skeleton.bones()[other]);
        let moved = (pose.parent_from_bone[other].translation - from.rest.translation).as_dvec3();
        let frame = |parent: Option<usize>| parent.map_or(DQuat::IDENTITY, |parent| self.rest[parent]);
        let model = frame(from.parent) * moved;
        let image = DVec3::new(-model.x, model.y, model.z);
        own.rest.translation + (frame(own.parent).conjugate() * image).as_vec3()
    }
}

/// Rotation and frame of each bone in model space.
fn model(skeleton: &Skeleton, pose: &Pose) -> (Vec<DQuat>, Vec<DAffine3>) {
    let mut turns: Vec<DQuat> = Vec::with_capacity(skeleton.len());
    let mut frames: Vec<DAffine3> = Vec::with_capacity(skeleton.len());
    for (bone, local) in skeleton.bones().iter().zip(&pose.parent_from_bone) {
        let turn = local.rotation.as_dquat().normalize();
        let frame =
            DAffine3::from_scale_rotation_translation(local.scale.as_dvec3(), turn, local.translation.as_dvec3());
        turns.push(bone.parent.map_or(turn, |parent| turns[parent] * turn));
        frames.push(bone.parent.map_or(frame, |parent| frames[parent] * frame));
    }
    (turns, frames)
}
