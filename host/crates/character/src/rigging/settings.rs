//! How to fit.

/// How to fit a skeleton.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigSettings {
    /// Which way is up in the mesh; `None` to find out.
    pub up: Option<[f64; 3]>,
    /// Which way the figure looks; `None` to find out.
    pub front: Option<[f64; 3]>,
    /// Make both sides alike where the mesh is nearly symmetric.
    pub symmetric: bool,
}

impl Default for RigSettings {
    fn default() -> Self {
        Self { up: None, front: None, symmetric: true }
    }
}
