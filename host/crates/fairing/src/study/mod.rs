//! The convergence study of thesis 3.5: a function is chosen, the conditions and the right-hand side that it solves are
//! derived, and the solution on finer and finer meshes is compared with it.

mod families;
mod wave;

pub use families::{Family, Flat};
pub use wave::Wave;

use crate::mixed::{Conditions, Elements, Energy, Fairing, FairingError, Settings, Values};
use armature_geometry::operators::{Lumping, lumped_mass_of_triangles};
use armature_geometry::surface::edges;

/// Which conditions the unit square has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// The mesh goes on outside, and is held there.
    Region,
    /// The mesh ends at the border, where value, normal derivative and (for the triharmonic equation) Laplacian are given.
    Curve,
}

/// One mesh of a study.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Average length of an edge.
    pub edge: f64,
    /// L² norm of the error over the unit square.
    pub error: f64,
    /// Of the linear system.
    pub residual: f64,
    /// Vertices solved for.
    pub unknowns: usize,
}

/// Solves `Δᵏu = g` on the unit square, where `wave` is the solution.
pub fn sample(
    family: Family,
    cells: usize,
    condition: Condition,
    settings: &Settings,
    wave: &Wave,
) -> Result<Sample, FairingError> {
    let flat = family.mesh(cells, if condition == Condition::Region { 4 } else { 0 });
    let (conditions, held) = held(&flat, condition, settings.energy, wave);
    let elements = Elements::of_positions(&flat.vertices, &flat.triangles)?;
    let fairing = Fairing::precompute(&elements, &conditions, settings)?;
    let power = if settings.energy == Energy::Laplacian { 2 } else { 3 };
    let source: Vec<[f64; 1]> = flat.vertices.iter().map(|&p| [wave.laplacian_power(p, power)]).collect();
    let values = Values { fixed: &held.0, tangents: &held.1, laplacians: &held.2, source: &source };
    let solution = fairing.solve(&values)?;
    let mass = lumped_mass_of_triangles(&flat.vertices, &flat.triangles, Lumping::Barycentric);
    let square = |v: &u32| {
        let v = *v as usize;
        mass[v] * (solution.values[v][0] - wave.value(flat.vertices[v])).powi(2)
    };
    let error = fairing.free().iter().map(square).sum::<f64>().sqrt();
    Ok(Sample { edge: mean_edge(&flat), error, residual: solution.residual, unknowns: fairing.free().len() })
}

/// Values of fixed vertices, tangents, Laplacians.
type Held = (Vec<[f64; 1]>, Vec<[[f64; 1]; 2]>, Vec<[f64; 1]>);

/// Everything outside the open unit square is held at the values of `wave`.
pub fn held(flat: &Flat, condition: Condition, energy: Energy, wave: &Wave) -> (Conditions, Held) {
    let inside = |p: [f64; 2]| p.iter().all(|&x| x > 0.0 && x < 1.0);
    let fixed: Vec<u32> = (0..flat.vertices.len() as u32).filter(|&v| !inside(flat.vertices[v as usize])).collect();
    let mut conditions = Conditions { fixed, ..Conditions::default() };
    let mut tangents = Vec::new();
    // Where a region is cut off, its own derivative is given.
    for [a, b] in outer_edges(&flat.triangles) {
        let [p, q] = [a, b].map(|v| flat.vertices[v as usize]);
        let length = (q[0] - p[0]).hypot(q[1] - p[1]);
        // Triangles run counter-clockwise: outside is to the right.
        let normal = [(q[1] - p[1]) / length, (p[0] - q[0]) / length];
        let along = |at: [f64; 2]| {
            let gradient = wave.gradient(at);
            [gradient[0] * normal[0] + gradient[1] * normal[1]]
        };
        conditions.borders.push([a, b]);
        tangents.push([along(p), along(q)]);
    }
    if condition == Condition::Curve && energy == Energy::LaplacianGradient {
        conditions.bent.clone_from(&conditions.fixed);
    }
    let at = |list: &[u32], f: &dyn Fn([f64; 2]) -> f64| list.iter().map(|&v| [f(flat.vertices[v as usize])]).collect();
    let values = at(&conditions.fixed, &|p| wave.value(p));
    let laplacians = at(&conditions.bent, &|p| wave.laplacian_power(p, 1));
    (conditions, (values, tangents, laplacians))
}

/// Edges with one triangle, as it runs along them.
fn outer_edges(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut sides: Vec<[u32; 2]> = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    sides.sort_unstable();
    sides.iter().copied().filter(|&[a, b]| sides.binary_search(&[b, a]).is_err()).collect()
}

fn mean_edge(flat: &Flat) -> f64 {
    let edges = edges(&flat.triangles);
    let length = |&[a, b]: &[u32; 2]| {
        let (p, q) = (flat.vertices[a as usize], flat.vertices[b as usize]);
        (q[0] - p[0]).hypot(q[1] - p[1])
    };
    edges.iter().map(|e| length(&e.vertices)).sum::<f64>() / edges.len() as f64
}

/// The power of the edge length with which the error falls: least squares over the logarithms of the last `last` samples.
pub fn slope(samples: &[Sample], last: usize) -> f64 {
    let logs: Vec<(f64, f64)> =
        samples[samples.len().saturating_sub(last)..].iter().map(|s| (s.edge.ln(), s.error.ln())).collect();
    let count = logs.len() as f64;
    let (mx, my) = (logs.iter().map(|p| p.0).sum::<f64>() / count, logs.iter().map(|p| p.1).sum::<f64>() / count);
    let covariance: f64 = logs.iter().map(|(x, y)| (x - mx) * (y - my)).sum();
    covariance / logs.iter().map(|(x, _)| (x - mx).powi(2)).sum::<f64>()
}
