//! A problem, factorised once and solved for many values.

use armature_geometry::operators::SparseMatrix;
use armature_geometry::surface::connected_components;

use super::conditions::{Checked, Conditions, Role, Values, check, check_values};
use super::elements::Elements;
use super::error::FairingError;
use super::mixed_system::MixedSystem;
use super::problem::{BentCurves, Energy, Form, Known, Parts, Settings};
use super::reduced_system::ReducedSystem;
use super::two_rows::{AlongBorder, TwoRows};

/// Of the stabilised multipliers. Tuned on the study's meshes: larger ones make errors larger on all of them, smaller ones
/// let the Laplacian converge more slowly on irregular ones.
const STABILISATION: f64 = 0.01;

/// A factorised problem.
#[derive(Debug)]
pub struct Fairing {
    elements: Elements,
    conditions: Conditions,
    checked: Checked,
    /// Lengths are multiplied by this, so that edges are about 1.
    scale: f64,
    energy: Energy,
    rows: Option<TwoRows>,
    laplacian: SparseMatrix,
    system: System,
    free: Vec<u32>,
}

#[derive(Debug)]
enum System {
    Reduced(Box<ReducedSystem>),
    Mixed(Box<MixedSystem>),
}

/// A function that solves a problem.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution<const C: usize> {
    /// u at every vertex.
    pub values: Vec<[f64; C]>,
    /// What is left of the equations, as a fraction of the terms that make them up: about 1e-16 where all went well.
    pub residual: f64,
}

impl Fairing {
    /// Checks the conditions and factorises the system.
    pub fn precompute(elements: &Elements, conditions: &Conditions, settings: &Settings) -> Result<Self, FairingError> {
        let mean = elements.mean_edge();
        if elements.triangles().is_empty() || !(mean > 0.0 && mean.is_finite() && (1.0 / mean).is_finite()) {
            return Err(FairingError::NothingFree);
        }
        let scale = 1.0 / mean;
        let elements = elements.scaled(scale);
        let checked = check(&elements, conditions)?;
        let mut fixed = checked.fixed.clone();
        check_connected(&elements, &fixed)?;
        let laplacian = elements.laplacian();
        let gradient = settings.energy == Energy::LaplacianGradient;
        let retained = settings.bent_curves == BentCurves::Retained && matches!(settings.form, Form::Mixed(_));
        let stabilised = gradient && settings.bent_curves == BentCurves::Stabilised;
        let slack = if stabilised { slack(&elements, &checked) } else { vec![0.0; fixed.len()] };
        let rows = (gradient && !retained && !stabilised && !conditions.bent.is_empty())
            .then(|| TwoRows::find(&elements, &laplacian, &checked, &fixed))
            .transpose()?;
        let placed = rows.iter().flat_map(|rows| &rows.placed);
        placed.clone().for_each(|placed| fixed[placed.vertex as usize] = true);
        let free: Vec<u32> = (0..fixed.len() as u32).filter(|&v| !fixed[v as usize]).collect();
        if free.is_empty() {
            return Err(match placed.count() {
                0 => FairingError::NothingFree,
                inferred => FairingError::OnlyRows { inferred },
            });
        }
        let mut roles = vec![Role::Held; fixed.len()];
        free.iter().enumerate().for_each(|(k, &v)| roles[v as usize] = Role::Free(k as u32));
        let parts = Parts {
            elements: &elements,
            laplacian: &laplacian,
            energy: settings.energy,
            roles: &roles,
            free: &free,
            bent: &checked.bent,
            slack: &slack,
        };
        let system = match settings.form {
            Form::Reduced(lumping) => System::Reduced(Box::new(ReducedSystem::factorise(&parts, lumping)?)),
            Form::Mixed(mass) => System::Mixed(Box::new(MixedSystem::factorise(&parts, mass, gradient && retained)?)),
        };
        Ok(Self {
            conditions: conditions.clone(),
            energy: settings.energy,
            elements,
            checked,
            scale,
            rows,
            laplacian,
            system,
            free,
        })
    }

    /// Vertices of the domain.
    pub fn vertex_count(&self) -> usize {
        self.elements.vertex_count()
    }

    /// Vertices that are solved for.
    pub fn free(&self) -> &[u32] {
        &self.free
    }

    /// Vertices beside a border that tangents placed (thesis 3.4.2).
    pub fn placed_by_tangents(&self) -> usize {
        self.rows.as_ref().map_or(0, |rows| rows.placed.len())
    }

    /// Triangles so thin that their area was raised.
    pub fn slivers(&self) -> usize {
        self.elements.slivers()
    }

    /// Solves for values of the conditions.
    pub fn solve<const C: usize>(&self, values: &Values<'_, C>) -> Result<Solution<C>, FairingError> {
        check_values(&self.elements, &self.conditions, values)?;
        let mut known: Vec<Known> = (0..C).map(|component| self.known(values, component)).collect();
        let residual = match &self.system {
            System::Reduced(system) => system.solve(&self.laplacian, &mut known),
            System::Mixed(system) => system.solve(&self.laplacian, &mut known),
        };
        let residual = residual.map_err(|_| FairingError::OutOfMemory { unknowns: self.free.len() })?;
        if !residual.is_finite() || known.iter().flat_map(|one| &one.u).any(|x| !x.is_finite()) {
            return Err(FairingError::Breakdown { slivers: self.slivers() });
        }
        let value = |vertex: usize| std::array::from_fn(|component| known[component].u[vertex]);
        Ok(Solution { values: (0..self.elements.vertex_count()).map(value).collect(), residual })
    }

    /// One component of the values, in the scale of the system.
    fn known<const C: usize>(&self, values: &Values<'_, C>, component: usize) -> Known {
        let count = self.elements.vertex_count();
        let mean = values.fixed.iter().map(|value| value[component] / values.fixed.len() as f64).sum();
        let mut u = vec![mean; count];
        for (&vertex, value) in self.conditions.fixed.iter().zip(values.fixed) {
            u[vertex as usize] = value[component];
        }
        let mut v = vec![0.0; count];
        for (&vertex, value) in self.conditions.bent.iter().zip(values.laplacians) {
            v[vertex as usize] = value[component] / self.scale.powi(2);
        }
        let tangents: Vec<[f64; 2]> = self
            .checked
            .borders
            .iter()
            .zip(values.tangents)
            .map(|(border, ends)| {
                let [from, to] = ends.map(|value| value[component] / self.scale);
                if border.turned { [to, from] } else { [from, to] }
            })
            .collect();
        let mut flux = vec![0.0; count];
        for (border, [from, to]) in self.checked.borders.iter().zip(&tangents) {
            let [a, b] = border.ends.map(|v| v as usize);
            flux[a] += border.length * (2.0 * from + to) / 6.0;
            flux[b] += border.length * (from + 2.0 * to) / 6.0;
        }
        if let Some(rows) = &self.rows {
            let along = AlongBorder { u: &u, laplacian: &v, tangents: &tangents };
            let placed = rows.values(&self.checked.borders, &along);
            rows.placed.iter().zip(&placed).for_each(|(row, &value)| u[row.vertex as usize] = value);
        }
        let order = if self.energy == Energy::Laplacian { 4 } else { 6 };
        let source = if values.source.is_empty() {
            vec![0.0; count]
        } else {
            let source: Vec<f64> =
                values.source.iter().map(|value| value[component] / self.scale.powi(order)).collect();
            // Lumping would spread it unevenly.
            self.elements.full_mass().multiply(&source)
        };
        Known { u, flux, v, source }
    }
}

/// How far the multiplier λ at a bent vertex is from enforcing its tangent: the term `-½∫cλ²` along the border, with
/// `c = 0.01 ℓ² √A` for edges of length ℓ and an area A.
///
/// On irregular meshes `⟨∇u, ∇φ⟩` is off by a rough error of the first order at the border. Enforced, it makes λ grow
/// without bound as the mesh is refined. The term takes away waves along the border that are shorter than about `ℓ^⅔`, and
/// adds an error of the second order.
fn slack(elements: &Elements, checked: &Checked) -> Vec<f64> {
    let mut length = vec![0.0; checked.bent.len()];
    for border in &checked.borders {
        border.ends.iter().for_each(|&v| length[v as usize] += 0.5 * border.length);
    }
    let reach = STABILISATION * elements.area().sqrt();
    length.iter().zip(&checked.bent).map(|(l, &bent)| if bent { reach * l.powi(3) } else { 0.0 }).collect()
}

/// Every part of the domain has a held vertex, and every free vertex a triangle.
fn check_connected(elements: &Elements, fixed: &[bool]) -> Result<(), FairingError> {
    let mut used = vec![false; fixed.len()];
    elements.triangles().iter().flatten().for_each(|&v| used[v as usize] = true);
    if let Some(vertex) = (0..fixed.len()).find(|&v| !fixed[v] && !used[v]) {
        return Err(FairingError::NoArea { vertex: vertex as u32 });
    }
    let components = connected_components(fixed.len(), elements.triangles());
    let mut held = vec![false; components.count];
    for (vertex, _) in fixed.iter().enumerate().filter(|(_, fixed)| **fixed) {
        held[components.of_vertex[vertex] as usize] = true;
    }
    match components.of_vertex.iter().position(|&part| !held[part as usize]) {
        Some(vertex) => Err(FairingError::Adrift { vertex: vertex as u32 }),
        None => Ok(()),
    }
}
