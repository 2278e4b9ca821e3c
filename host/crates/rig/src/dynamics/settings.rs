//! Which bones swing, and how.

use glam::Vec3;

use crate::skeleton::Skeleton;

/// Numbers of a setting are no larger than this.
const MOST: f64 = 1e6;

/// Bones that swing, and the wind.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dynamics {
    /// The chains; a bone swings in at most one.
    pub chains: Vec<SpringChain>,
    /// How fast the air moves, model units a second in model space. It takes bones along as much as their drag says.
    pub wind: Vec3,
}

/// Bones that swing together, and what they do not pass through.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpringChain {
    /// The bones; each once.
    pub bones: Vec<SpringBone>,
    /// What they must not pass through.
    pub colliders: Vec<SpringCollider>,
}

/// A bone that swings about its head. Strengths are those of VRM: 1 draws or pulls the tip by 60 model units/s².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpringBone {
    /// Zero-based bone of the skeleton.
    pub bone: usize,
    /// The point that swings, in the bone's frame; not its origin.
    pub tail: Vec3,
    /// How strongly it returns to where the pose has it; 0 or more.
    pub stiffness: f64,
    /// The share of its speed against the air that it loses in a 60th of a second, 0 to 1.
    pub drag: f64,
    /// How strongly it is pulled along `gravity_direction`.
    pub gravity: f64,
    /// Model space, a unit vector; its length counts.
    pub gravity_direction: Vec3,
    /// Its thickness against colliders, model units.
    pub radius: f64,
}

/// A sphere, or a capsule where there is a tail.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpringCollider {
    /// Zero-based bone that carries it.
    pub bone: usize,
    /// Its centre, or the centre of its first end, in the bone's frame.
    pub offset: Vec3,
    /// The centre of its other end.
    pub tail: Option<Vec3>,
    /// Model units.
    pub radius: f64,
}

/// Why bones cannot swing like this.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DynamicsError {
    /// The skeleton has fewer bones.
    #[error("bone {bone} is to swing or carries a collider, but the skeleton has {bones}")]
    NoBone {
        /// Zero-based.
        bone: usize,
        /// How many there are.
        bones: usize,
    },
    /// A bone swings twice.
    #[error("the bone {bone:?} is to swing in two chains; name it once")]
    Twice {
        /// Its name.
        bone: String,
    },
    /// A number cannot be.
    #[error("the {what} of the bone {bone:?} cannot be used; {remedy}")]
    BadNumber {
        /// Which number.
        what: &'static str,
        /// The bone's name.
        bone: String,
        /// What to give.
        remedy: &'static str,
    },
    /// The wind is not finite.
    #[error("the wind is no finite number of model units a second; give three numbers from -1e6 to 1e6")]
    BadWind,
}

impl Dynamics {
    /// Whether every bone is there once and every number can be used.
    pub fn check(&self, skeleton: &Skeleton) -> Result<(), DynamicsError> {
        let within = |number: f64, low: f64, high: f64| (low..=high).contains(&number);
        let near = |point: Vec3| point.to_array().into_iter().all(|number| within(f64::from(number), -MOST, MOST));
        if !near(self.wind) {
            return Err(DynamicsError::BadWind);
        }
        let mut swings = vec![false; skeleton.len()];
        let known = |bone: usize| {
            if bone < skeleton.len() { Ok(()) } else { Err(DynamicsError::NoBone { bone, bones: skeleton.len() }) }
        };
        for chain in &self.chains {
            for own in &chain.bones {
                known(own.bone)?;
                let name = || skeleton.bones()[own.bone].name.clone();
                if std::mem::replace(&mut swings[own.bone], true) {
                    return Err(DynamicsError::Twice { bone: name() });
                }
                let checks = [
                    ("tail", near(own.tail) && own.tail.length() > 0.0, "it must not be the bone's head"),
                    ("stiffness", within(own.stiffness, 0.0, MOST), "give a number from 0 to 1e6"),
                    ("drag", within(own.drag, 0.0, 1.0), "give a number from 0 to 1"),
                    ("gravity", within(own.gravity, -MOST, MOST), "give a number from -1e6 to 1e6"),
                    ("direction of gravity", near(own.gravity_direction), "give three finite numbers"),
                    ("radius", within(own.radius, 0.0, MOST), "give a number from 0 to 1e6"),
                ];
                if let Some((what, _, remedy)) = checks.into_iter().find(|(_, fits, _)| !fits) {
                    return Err(DynamicsError::BadNumber { what, bone: name(), remedy });
                }
            }
            for collider in &chain.colliders {
                known(collider.bone)?;
                let fits = near(collider.offset)
                    && near(collider.tail.unwrap_or(collider.offset))
                    && within(collider.radius, 0.0, MOST);
                if !fits {
                    let bone = skeleton.bones()[collider.bone].name.clone();
                    return Err(DynamicsError::BadNumber { what: "collider", bone, remedy: "give finite numbers" });
                }
            }
        }
        Ok(())
    }

    /// Whether nothing swings.
    pub fn is_empty(&self) -> bool {
        self.chains.iter().all(|chain| chain.bones.is_empty())
    }
}
