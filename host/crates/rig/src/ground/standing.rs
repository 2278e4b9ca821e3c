//! Feet that give way to a hand on the root, and take over again.

use glam::Vec3;

use super::contact::GroundContact;
use super::settings::{Ground, GroundError};
use crate::skeleton::{Pose, Skeleton};

/// How long the floor takes to give way, and to take over again, microseconds.
const GIVES_WAY_MICROS: u32 = 250_000;

/// [`GroundContact`], except while a root is held by something else: then the floor lets go of the character, and stands it
/// up again afterwards, both without a jump.
#[derive(Clone, Debug)]
pub struct Standing {
    contact: GroundContact,
    /// 0 to 1: how far the feet have given way.
    given_way: f64,
    micros: Option<u64>,
    offset: Vec3,
    /// The pose as it was before the feet.
    before: Pose,
}

impl Standing {
    /// Prepares for a skeleton.
    pub fn new(skeleton: &Skeleton, ground: Ground) -> Result<Self, GroundError> {
        let contact = GroundContact::new(skeleton, ground)?;
        Ok(Self { contact, given_way: 0.0, micros: None, offset: Vec3::ZERO, before: Pose::default() })
    }

    /// How the roots follow the feet.
    pub fn contact(&self) -> &GroundContact {
        &self.contact
    }

    /// By how much the roots of the latest pose were moved, mesh units.
    pub fn offset(&self) -> Vec3 {
        self.offset
    }

    /// Forgets where it is: the next pose is the first.
    pub fn restart(&mut self) {
        self.contact.restart();
        (self.given_way, self.micros, self.offset) = (0.0, None, Vec3::ZERO);
    }

    /// Moves the roots of the next pose. `micros`: the device's clock; `is_held`: something else says where a root is;
    /// `driven`: for each bone, whether a joint turns it. Allocates nothing.
    pub fn stand(&mut self, micros: u64, is_held: bool, skeleton: &Skeleton, driven: &[bool], pose: &mut Pose) {
        let share = self.share(micros, is_held);
        if share <= 0.0 {
            self.contact.restart();
            self.offset = Vec3::ZERO;
            return;
        }
        let root = skeleton.bones().iter().position(|bone| bone.parent.is_none());
        let place = |pose: &Pose| root.map_or(Vec3::ZERO, |root| pose.parent_from_bone[root].translation);
        let before = place(pose);
        self.before.parent_from_bone.clone_from(&pose.parent_from_bone);
        self.contact.follow(micros, skeleton, driven, pose);
        self.offset = place(pose) - before;
        if share < 1.0 {
            let back = self.offset * (share - 1.0) as f32;
            let roots = skeleton.bones().iter().zip(&mut pose.parent_from_bone);
            roots.filter(|(bone, _)| bone.parent.is_none()).for_each(|(_, local)| local.translation += back);
            self.offset += back;
            // Where the roots face, and legs that were bent.
            for (local, before) in pose.parent_from_bone.iter_mut().zip(&self.before.parent_from_bone) {
                if local.rotation != before.rotation {
                    local.rotation = before.rotation.slerp(local.rotation, share as f32).normalize();
                }
            }
        }
    }

    /// How much the feet have to say; exactly 1 where nothing has held a root.
    fn share(&mut self, micros: u64, is_held: bool) -> f64 {
        let passed = self.micros.map_or(0, |before| micros.saturating_sub(before));
        self.micros = Some(micros);
        let step = passed as f64 / f64::from(GIVES_WAY_MICROS);
        self.given_way = (self.given_way + if is_held { step } else { -step }).clamp(0.0, 1.0);
        1.0 - self.given_way * self.given_way * (3.0 - 2.0 * self.given_way)
    }
}
