//! Conditions along rims whose tangents, and perhaps curvature, are given (thesis 3.3): the rims are curves.

use std::collections::HashMap;

use glam::DVec3;

use super::around::Around;
use crate::mixed::{Conditions, Elements, Energy, Fairing, FairingError, Settings, Values};

/// How a surface leaves a rim.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RimShape {
    /// How far it is turned from going straight on, towards the outside.
    pub degrees: f64,
    /// How far its tangents reach in: 1 is as on the surface around.
    pub strength: f64,
    /// Curvature across the rim, 1 / mesh unit; positive bulges outwards as a sphere does. The surface is triharmonic if all
    /// its rims have one, and otherwise biharmonic.
    pub curvature: Option<f64>,
}

impl Default for RimShape {
    fn default() -> Self {
        Self { degrees: 0.0, strength: 1.0, curvature: None }
    }
}

/// Conditions with their values.
#[derive(Clone, Debug, Default)]
pub(super) struct GivenAlongRims {
    pub(super) energy: Energy,
    pub(super) borders: Vec<[u32; 2]>,
    pub(super) tangents: Vec<[[f64; 3]; 2]>,
    pub(super) bent: Vec<u32>,
    pub(super) laplacians: Vec<[f64; 3]>,
}

impl GivenAlongRims {
    /// Places of all vertices, the first `held` of which stay, and the residual.
    pub(super) fn solve(
        self,
        elements: &Elements,
        held: usize,
        places: &[DVec3],
    ) -> Result<(Vec<DVec3>, f64), FairingError> {
        let fixed: Vec<[f64; 3]> = places[..held].iter().map(DVec3::to_array).collect();
        let conditions = Conditions { fixed: (0..held as u32).collect(), borders: self.borders, bent: self.bent };
        let fairing = Fairing::precompute(elements, &conditions, &Settings::new(self.energy))?;
        let values = Values { fixed: &fixed, tangents: &self.tangents, laplacians: &self.laplacians, source: &[] };
        let solution = fairing.solve(&values)?;
        Ok((solution.values.into_iter().map(DVec3::from).collect(), solution.residual))
    }
}

/// Tangents, and Laplacians where all shapes have a curvature, along the rims of a domain. The last of `shapes` holds for
/// all further rims.
pub(super) fn along_rims(around: &Around, elements: &Elements, shapes: &[RimShape]) -> GivenAlongRims {
    let is_bent = shapes.iter().all(|shape| shape.curvature.is_some());
    let energy = if is_bent { Energy::LaplacianGradient } else { Energy::Laplacian };
    let mut given = GivenAlongRims { energy, ..GivenAlongRims::default() };
    let border = is_bent.then(|| Border::of(around, elements));
    for (index, rim) in around.rims.iter().enumerate() {
        let Some(shape) = shapes.get(index).or(shapes.last()) else { break };
        let (sin, cos) = shape.degrees.to_radians().sin_cos();
        let tangent = |v: u32| {
            let (out, normal) = around.frames[v as usize];
            shape.strength * (cos * out - sin * normal)
        };
        let count = rim.vertices.len();
        for (k, &v) in rim.vertices.iter().enumerate() {
            let (before, after) = (rim.vertices[(k + count - 1) % count], rim.vertices[(k + 1) % count]);
            given.borders.push([v, after]);
            given.tangents.push([tangent(v).to_array(), tangent(after).to_array()]);
            let Some((curvature, border)) = shape.curvature.zip(border.as_ref()) else { continue };
            let [p, q, r] = [before, v, after].map(|v| around.places[v as usize]);
            let (back, ahead) = (border.length(before, v), border.length(v, after));
            let along = 2.0 * ((r - q) / ahead - (q - p) / back) / (back + ahead);
            let (out, normal) = around.frames[v as usize];
            let across = -curvature * shape.strength.powi(2) * (cos * normal + sin * out);
            let turn = 2.0 * border.turns[v as usize] / (back + ahead);
            given.bent.push(v);
            given.laplacians.push((along + turn * tangent(v) + across).to_array());
        }
    }
    given
}

/// The rims as the border of the domain.
struct Border {
    lengths: HashMap<[u32; 2], f64>,
    /// How much the border turns towards the domain at each rim vertex.
    turns: Vec<f64>,
}

impl Border {
    fn of(around: &Around, elements: &Elements) -> Self {
        let count: usize = around.rims.iter().map(|rim| rim.vertices.len()).sum();
        let mut border = Self { lengths: HashMap::new(), turns: vec![std::f64::consts::PI; count] };
        for (t, lengths) in elements.triangles().iter().zip(elements.lengths()) {
            for k in 0..3 {
                let (next, last) = ((k + 1) % 3, (k + 2) % 3);
                border.lengths.insert([t[next], t[last]], lengths[k]);
                if let Some(turn) = border.turns.get_mut(t[k] as usize) {
                    let (a, b, c) = (lengths[k], lengths[next], lengths[last]);
                    *turn -= ((b * b + c * c - a * a) / (2.0 * b * c)).clamp(-1.0, 1.0).acos();
                }
            }
        }
        border
    }

    fn length(&self, from: u32, to: u32) -> f64 {
        self.lengths.get(&[from, to]).copied().unwrap_or(f64::NAN)
    }
}
