//! What a skeleton is (a human, a quadruped, a hand), and which of its bones is which: [`recognise`].
//!
//! Rigs of other programs name their bones in many ways, or not at all. Names come first, as far as they say something;
//! the tree decides what one name means in different rigs (a `Leg` is a shin below an `UpLeg`, a `Shoulder` a collarbone
//! above an `Arm`); the shape decides where names say nothing.

pub(crate) mod body_plan;
mod conventions;
mod figure;
mod fingers;
mod humanoid;
mod limbs;
mod names;
mod trunk;
pub(crate) mod vocabulary;
pub(crate) mod words;

pub use conventions::BoneNames;
pub(crate) use figure::recognise_by;
pub use figure::{Figure, RecognisedBone, Recognition, recognise};
pub use humanoid::{Evidence, Finger, HumanoidBone, HumanoidPart, Side};
