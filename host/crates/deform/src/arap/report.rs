//! When a solve ends, and its report.

/// When a solve ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArapStop {
    /// Maximum number of local and global steps. The thesis uses 15 per frame, warm started.
    pub iterations: usize,
    /// Ends earlier once no entry of a rotation changes by more than this in a step; 0 never does.
    pub tolerance: f32,
}

impl Default for ArapStop {
    fn default() -> Self {
        Self { iterations: 15, tolerance: 1e-5 }
    }
}

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ArapOutcome {
    /// The rotations have converged; the largest change of an entry in the last step.
    Converged {
        /// Largest change of an entry of a rotation in the last step.
        change: f32,
    },
    /// The step limit was reached; the next frame continues from here.
    IterationLimit {
        /// Largest change of an entry of a rotation in the last step.
        change: f32,
    },
}

/// Anything unusual about a solve; its result is finite all the same.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ArapWarnings {
    /// How many targets were ignored because they were NaN, infinite or more than a million model sizes away: the last
    /// good target of each was used instead.
    pub unusable_targets: usize,
    /// The largest distance by which a target or joint was missed because targets contradict each other (mesh units).
    pub contradiction: Option<f64>,
    /// Degrees of freedom that no constraint and no stiffness determines, such as 3 for a shape whose position is not
    /// given anywhere and 12 for a handle without weight. They are kept as close to the rest pose as the others allow.
    pub undetermined: usize,
}

/// The report of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArapReport {
    /// How it ended.
    pub outcome: ArapOutcome,
    /// Steps taken.
    pub iterations: usize,
    /// The energy of eq. 7.4 with clustered rotations, in the rest shape's own units: length² for surfaces and planar
    /// shapes, length³ for volumes. Never rises from step to step of a solve.
    pub energy: f64,
    /// Anything unusual.
    pub warnings: ArapWarnings,
}
