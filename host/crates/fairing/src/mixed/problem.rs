//! What a problem asks for, and the parts of its systems.

use armature_geometry::operators::{Lumping, SparseMatrix};

use super::conditions::Role;
use super::elements::Elements;

/// What is to be as small as possible.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Energy {
    /// `½∫(Δu)²`, thesis eq. 3.1: biharmonic surfaces, which can meet their conditions with continuous tangents.
    #[default]
    Laplacian,
    /// `½∫‖∇Δu‖²`, thesis eq. 3.2: triharmonic surfaces, which can meet them with continuous curvature.
    LaplacianGradient,
}

/// The mass matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mass {
    /// `⟨φ_i, φ_j⟩`.
    Full,
    /// A diagonal instead.
    Lumped(Lumping),
}

/// The unknowns that a system keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// u alone: symmetric positive definite, by Cholesky. Needs a lumped mass matrix.
    Reduced(Lumping),
    /// u and the auxiliary variables: indefinite and sparser, by LU with pivoting.
    Mixed(Mass),
}

/// What becomes of borders whose vertices have a given value, tangent and Laplacian, where a triharmonic system may have
/// more equations than unknowns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BentCurves {
    /// System (3.18) with stabilised multipliers: the tangents are met up to a small multiple of `Δ²u`, which falls with the
    /// square of the edges' length. Always solvable, and converges on irregular meshes too.
    #[default]
    Stabilised,
    /// The thesis's reduction: tangents place the vertices beside the border first. Always solvable, but errors hardly fall
    /// on irregular meshes.
    TwoRows,
    /// System (3.18), with an error where it is over-determined. Only in mixed form.
    Retained,
}

/// How a problem is discretised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// What is to be small.
    pub energy: Energy,
    /// The unknowns.
    pub form: Form,
    /// What becomes of curves with a given curvature.
    pub bent_curves: BentCurves,
}

impl Settings {
    /// The reduced form with Voronoi areas, which has the smallest errors (thesis 3.5).
    pub fn new(energy: Energy) -> Self {
        Self { energy, form: Form::Reduced(Lumping::VoronoiHybrid), bent_curves: BentCurves::Stabilised }
    }
}

/// What a system is made of.
pub(super) struct Parts<'a> {
    pub(super) elements: &'a Elements,
    pub(super) laplacian: &'a SparseMatrix,
    pub(super) energy: Energy,
    pub(super) roles: &'a [Role],
    pub(super) free: &'a [u32],
    /// Whether a vertex has a given Laplacian.
    pub(super) bent: &'a [bool],
    /// How far the multipliers of bent vertices' tangents are from constraints; 0 where there is no tangent.
    pub(super) slack: &'a [f64],
}

/// The known numbers of one component of u.
pub(super) struct Known {
    /// u at every vertex; at free ones a first guess, replaced by the solution.
    pub(super) u: Vec<f64>,
    /// `N b₁`: the derivative along borders, tested with every hat function.
    pub(super) flux: Vec<f64>,
    /// Δu at bent vertices.
    pub(super) v: Vec<f64>,
    /// `⟨g, φ⟩`: the right-hand side, tested with every hat function.
    pub(super) source: Vec<f64>,
}
