//! Points of a character that are dragged: what a hand, a mouse or a script asks of it, besides the puppet.

use glam::{Quat, Vec3};

use crate::skeleton::Skeleton;

/// Which point is dragged. The bone is a zero-based index into the skeleton.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TargetPoint {
    /// Where a bone begins: the joint that it turns about.
    Head(usize),
    /// Where a bone ends.
    Tail(usize),
    /// A point of the skin: three zero-based vertices of the character's mesh and their barycentric coordinates.
    Skin {
        /// Zero-based vertices.
        vertices: [u32; 3],
        /// How much each counts; they sum to one.
        barycentric: [f32; 3],
    },
}

/// Where a point of the character is to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// The point.
    pub point: TargetPoint,
    /// Its place in the world (model space; mesh units).
    pub position: Option<Vec3>,
    /// The orientation of its bone, `model_from_bone`.
    pub orientation: Option<Quat>,
    /// 1: it goes there as exactly as the skeleton allows. Below, it is pulled, and what else there is counts too; above 0.
    pub strength: f32,
}

/// What is asked of a target from the next sample on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TargetChange {
    /// The point goes there; where it has a target already, this one replaces it.
    Set {
        /// Where to.
        target: Target,
        /// Over how long it goes there from where it is, microseconds of the device's clock.
        over_micros: u32,
    },
    /// The point is let go.
    Release {
        /// Which.
        point: TargetPoint,
        /// Over how long the character goes back to where it would be, microseconds of the device's clock.
        over_micros: u32,
    },
}

/// Why a target cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TargetError {
    /// There is no such bone.
    #[error("there is no bone {bone}; the skeleton has {bones}")]
    NoSuchBone {
        /// The index given.
        bone: usize,
        /// How many there are.
        bones: usize,
    },
    /// A number is NaN, infinite, or a place beyond a million.
    #[error("a target needs a place within a million of the origin, and an orientation whose length is one")]
    NotFinite,
    /// The strength is not above 0 and at most 1.
    #[error("the strength of a target is above 0 and at most 1")]
    Strength,
    /// It asks for nothing.
    #[error("a target needs a place, an orientation or both")]
    Nothing,
    /// There is no such point on the skin.
    #[error("the skin has no such point: {vertices} vertices are numbered from 0, and their shares sum to one")]
    NoSuchPoint {
        /// How many vertices there are.
        vertices: usize,
    },
    /// Part of the skin that follows no bone.
    #[error("no bone moves this point")]
    NothingMovesIt,
    /// Points of the skin have no orientation of their own.
    #[error("a point of the skin has no orientation; turn the bone below it")]
    SkinHasNoOrientation,
    /// There are more than [`Target::MOST`].
    #[error("there are {} targets already; release one first", Target::MOST)]
    TooMany,
    /// Whatever poses the other bones cannot be dragged.
    #[error("the bones of this character cannot be dragged")]
    NotSupported,
}

impl Target {
    /// So many points can be dragged at once.
    pub const MOST: usize = 32;

    /// Checks everything that the skeleton alone can tell.
    pub fn check(&self, skeleton: &Skeleton) -> Result<(), TargetError> {
        let is_near = |place: Vec3| place.is_finite() && place.abs().max_element() <= 1e6;
        let is_rotation = |turn: Quat| turn.is_finite() && (turn.length() - 1.0).abs() < 1e-3;
        if self.position.is_none() && self.orientation.is_none() {
            return Err(TargetError::Nothing);
        }
        if !self.position.is_none_or(is_near) || !self.orientation.is_none_or(is_rotation) {
            return Err(TargetError::NotFinite);
        }
        if !(self.strength > 0.0 && self.strength <= 1.0) {
            return Err(TargetError::Strength);
        }
        self.point.check(skeleton)?;
        match self.point {
            TargetPoint::Skin { .. } if self.orientation.is_some() => Err(TargetError::SkinHasNoOrientation),
            _ => Ok(()),
        }
    }
}

impl TargetPoint {
    /// Checks the bone, or the shares of a point of the skin.
    pub fn check(&self, skeleton: &Skeleton) -> Result<(), TargetError> {
        match *self {
            Self::Head(bone) | Self::Tail(bone) if bone >= skeleton.len() => {
                Err(TargetError::NoSuchBone { bone, bones: skeleton.len() })
            }
            Self::Head(_) | Self::Tail(_) => Ok(()),
            Self::Skin { barycentric, .. } => {
                let sum: f32 = barycentric.iter().sum();
                let sound = barycentric.iter().all(|share| share.abs() <= 10.0) && (sum - 1.0).abs() < 1e-3;
                if sound { Ok(()) } else { Err(TargetError::NoSuchPoint { vertices: 0 }) }
            }
        }
    }

    /// Whether both are the same point, to the last bit.
    pub fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (
                Self::Skin { vertices, barycentric },
                Self::Skin { vertices: other_vertices, barycentric: other_barycentric },
            ) => vertices == other_vertices && barycentric.map(f32::to_bits) == other_barycentric.map(f32::to_bits),
            _ => self == other,
        }
    }

    /// What people call it.
    pub fn name(&self, skeleton: &Skeleton) -> String {
        let bone = |bone: usize| skeleton.bones().get(bone).map_or_else(|| bone.to_string(), |bone| bone.name.clone());
        match *self {
            Self::Head(index) => bone(index),
            Self::Tail(index) => format!("{}:tail", bone(index)),
            Self::Skin { vertices: [a, b, c], .. } if a == b && b == c => format!("vertex:{a}"),
            Self::Skin { vertices: [a, b, c], .. } => format!("triangle:{a},{b},{c}"),
        }
    }
}

impl TargetChange {
    /// The point it is about.
    pub fn point(&self) -> TargetPoint {
        match self {
            Self::Set { target, .. } => target.point,
            Self::Release { point, .. } => *point,
        }
    }

    /// Checks everything that the skeleton alone can tell.
    pub fn check(&self, skeleton: &Skeleton) -> Result<(), TargetError> {
        match self {
            Self::Set { target, .. } => target.check(skeleton),
            Self::Release { point, .. } => point.check(skeleton),
        }
    }
}
