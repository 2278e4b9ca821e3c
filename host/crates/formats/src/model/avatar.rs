//! What a VRM avatar says of itself beyond its meshes. All of it is data: nothing here is applied.

/// Which bone is which part of a person, which morph targets make an expression, and what swings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Avatar {
    /// The version of VRM in the file: `0.x` or `1.0`.
    pub version: String,
    /// The bones of a person that the file names.
    pub humanoid: Vec<HumanoidBone>,
    /// Its expressions.
    pub expressions: Vec<Expression>,
    /// Chains of bones that hang and swing: hair, skirts, ears.
    pub springs: Vec<SpringChain>,
}

/// A part of a person.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HumanoidBone {
    /// As VRM 1.0 has it, also for files of VRM 0.x: `hips`, `leftUpperArm`, `rightThumbMetacarpal`, …
    pub name: String,
    /// Zero-based bone of the rig's skeleton.
    pub bone: u32,
}

/// Morph targets that together make an expression.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Expression {
    /// As VRM 1.0 has it where it is a preset (`happy`, `aa`, `blinkLeft`), otherwise the file's own.
    pub name: String,
    /// Zero-based morph targets of the model, and the weight of each when the expression is fully there.
    pub targets: Vec<(u32, f32)>,
}

/// A chain of bones that swings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpringChain {
    /// Its name in the file; may be empty.
    pub name: String,
    /// From its root to its tip.
    pub joints: Vec<SpringJoint>,
    /// What it must not pass through.
    pub colliders: Vec<SpringCollider>,
}

/// A bone of a [`SpringChain`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpringJoint {
    /// Zero-based bone of the rig's skeleton.
    pub bone: u32,
    /// How strongly it returns to its rest pose.
    pub stiffness: f32,
    /// How strongly it is pulled along `gravity_direction`.
    pub gravity: f32,
    /// Model space; a unit vector in most files.
    pub gravity_direction: [f32; 3],
    /// How much it is slowed down, 0 to 1.
    pub drag: f32,
    /// Its thickness against colliders (model units).
    pub radius: f32,
}

/// A sphere, or a capsule where there is a tail.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpringCollider {
    /// Zero-based bone that carries it.
    pub bone: u32,
    /// Its centre, or the centre of its first end, in the bone's frame.
    pub offset: [f32; 3],
    /// The centre of its other end.
    pub tail: Option<[f32; 3]>,
    /// Model units.
    pub radius: f32,
}
