//! Solving for a patch: rounds of refining its triangles and placing their vertices, the metric each time being that of the
//! surface found before (thesis 3.8.1: on the unknown surface itself, the linearised energy would be the true one).

use glam::DVec3;

use super::around::Around;
use super::bridge::first_triangles;
use super::refine::Patch;
use crate::mixed::{Conditions, Elements, Energy, Fairing, FairingError, Settings, Values};

/// How a patch meets the surface around it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Join {
    /// Tangents go on (C¹): biharmonic, with the triangles around the rim as a region.
    Tangent,
    /// Tangents and curvature go on (C²): triharmonic, with two rings of triangles as a region.
    #[default]
    Curvature,
    /// Tangents are given: biharmonic, with the rim as a curve.
    Angle {
        /// How far the patch is turned from going straight on, towards the outside.
        degrees: f64,
        /// How far the tangents reach in: 1 is as on the surface around.
        strength: f64,
    },
    /// Tangents and curvature are given: triharmonic, with the rim as a curve.
    Bent {
        /// As for [`Join::Angle`].
        degrees: f64,
        /// As for [`Join::Angle`].
        strength: f64,
        /// Curvature across the rim, 1 / mesh unit; positive bulges outwards as a sphere does.
        curvature: f64,
    },
}

/// How patches are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchSettings {
    /// How they meet what is around.
    pub join: Join,
    /// Most rounds of refining and solving.
    pub rounds: usize,
    /// Most vertices of one patch.
    pub most_vertices: usize,
    /// Wanted length of edges, in those of the rim.
    pub coarseness: f64,
}

impl Default for PatchSettings {
    fn default() -> Self {
        Self { join: Join::default(), rounds: 12, most_vertices: 100_000, coarseness: 1.0 }
    }
}

/// A finished patch.
#[derive(Clone, Debug)]
pub(crate) struct PatchOutcome {
    pub(crate) patch: Patch,
    pub(crate) rounds: usize,
    /// How far the last round moved a vertex across the surface, in wanted lengths of edges.
    pub(crate) last_move: f64,
    pub(crate) residual: f64,
    pub(crate) settled: bool,
    /// Why a later round could not be solved; the patch is that of the round before.
    pub(crate) failed: Option<FairingError>,
}

/// A round that moves no vertex further across the surface than this, in wanted lengths of edges, is the last, ...
const SETTLED: f64 = 0.05;
/// ... if it split no more than this part of the edges.
const FEW: usize = 50;
/// A vertex that ends up further from the rims than this, in their size, was not placed but thrown.
const FARTHEST: f64 = 25.0;

/// Why there is no patch.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum NoPatch {
    /// No triangles without an edge that the surface already has.
    NoTriangles,
    /// Vertices were placed far from the rims.
    Thrown,
    Fairing(FairingError),
}

pub(crate) fn make_patch(around: &Around, settings: &PatchSettings) -> Result<PatchOutcome, NoPatch> {
    let place = |v: u32| around.places[v as usize];
    let blocked = |a: u32, b: u32| around.chords.contains(&[a.min(b), a.max(b)]);
    let triangles = first_triangles(&around.rims, place, blocked)
        .or_else(|| first_triangles(&around.rims, place, |_, _| false))
        .ok_or(NoPatch::NoTriangles)?;
    let mut patch = Patch {
        places: around.places.clone(),
        triangles,
        held: around.places.len(),
        sizes: sizes(around, settings.coarseness),
        chords: around.chords.clone(),
    };
    let (low, high) = around
        .rims
        .iter()
        .flat_map(|rim| &rim.vertices)
        .map(|&v| place(v))
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let (centre, size) = (0.5 * (low + high), low.distance(high));
    let mut outcome =
        PatchOutcome { patch: patch.clone(), rounds: 0, last_move: 0.0, residual: 0.0, settled: false, failed: None };
    for round in 1..=settings.rounds.max(1) {
        let splits = patch.refine(settings.most_vertices);
        if patch.places.len() == patch.held {
            // Nothing to place: the rim alone is fine enough.
            return Ok(PatchOutcome { patch, rounds: round, settled: true, ..outcome });
        }
        let (places, residual) = match place_vertices(around, &patch, settings.join) {
            Ok(placed) => placed,
            Err(error) if round == 1 => return Err(NoPatch::Fairing(error)),
            Err(error) => return Ok(PatchOutcome { failed: Some(error), ..outcome }),
        };
        if places[patch.held..].iter().any(|p| p.distance(centre) > FARTHEST * size) {
            return Err(NoPatch::Thrown);
        }
        // What moves along the surface does not change it.
        let normals = patch.normals();
        let moved = |v: usize| (places[v] - patch.places[v]).dot(normals[v]).abs() / patch.sizes[v];
        let last_move = (patch.held..places.len()).map(moved).fold(0.0, f64::max);
        patch.places = places;
        let settled = last_move < SETTLED && (round == 1 || splits <= patch.places.len() / FEW);
        outcome = PatchOutcome { patch: patch.clone(), rounds: round, last_move, residual, settled, failed: None };
        if settled {
            break;
        }
    }
    Ok(outcome)
}

/// The wanted length of edges at every local vertex: that of the rim nearby.
fn sizes(around: &Around, coarseness: f64) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); around.places.len()];
    let mut all = (0.0, 0.0_f64);
    for rim in &around.rims {
        for (k, &v) in rim.vertices.iter().enumerate() {
            let next = rim.vertices[(k + 1) % rim.vertices.len()];
            let length = around.places[v as usize].distance(around.places[next as usize]);
            for end in [v, next] {
                sums[end as usize].0 += length;
                sums[end as usize].1 += 1.0;
            }
            all = (all.0 + length, all.1 + 1.0);
        }
    }
    let mean = all.0 / all.1.max(1.0);
    // Much shorter edges than usual would be taken up by ever more vertices.
    let size = |(sum, count): (f64, f64)| if count > 0.0 { (sum / count).max(0.2 * mean) } else { mean };
    sums.into_iter().map(|s| coarseness * size(s)).collect()
}

fn place_vertices(around: &Around, patch: &Patch, join: Join) -> Result<(Vec<DVec3>, f64), FairingError> {
    let (energy, region) = match join {
        Join::Tangent => (Energy::Laplacian, true),
        Join::Curvature => (Energy::LaplacianGradient, true),
        Join::Angle { .. } => (Energy::Laplacian, false),
        Join::Bent { .. } => (Energy::LaplacianGradient, false),
    };
    let mut triangles = patch.triangles.clone();
    if region {
        triangles.extend_from_slice(&around.triangles);
    }
    let elements = Elements::of_positions(&patch.places.iter().map(DVec3::to_array).collect::<Vec<_>>(), &triangles)?;
    let mut conditions = Conditions { fixed: (0..patch.held as u32).collect(), ..Conditions::default() };
    let fixed: Vec<[f64; 3]> = patch.places[..patch.held].iter().map(DVec3::to_array).collect();
    let mut tangents: Vec<[[f64; 3]; 2]> = Vec::new();
    let mut laplacians: Vec<[f64; 3]> = Vec::new();
    if region {
        for (edge, out) in Around::borders(&patch.places, &triangles) {
            conditions.borders.push(edge);
            tangents.push([out.to_array(); 2]);
        }
    } else {
        let (degrees, strength, curvature) = match join {
            Join::Bent { degrees, strength, curvature } => (degrees, strength, Some(curvature)),
            Join::Angle { degrees, strength } => (degrees, strength, None),
            _ => (0.0, 1.0, None),
        };
        let (sin, cos) = degrees.to_radians().sin_cos();
        let tangent = |v: u32| {
            let (out, normal) = around.frames[v as usize];
            strength * (cos * out - sin * normal)
        };
        for rim in &around.rims {
            for (k, &v) in rim.vertices.iter().enumerate() {
                let next = rim.vertices[(k + 1) % rim.vertices.len()];
                conditions.borders.push([v, next]);
                tangents.push([tangent(v).to_array(), tangent(next).to_array()]);
            }
        }
        if let Some(curvature) = curvature {
            let turns = turns(patch, around);
            for rim in &around.rims {
                for (k, &v) in rim.vertices.iter().enumerate() {
                    let count = rim.vertices.len();
                    let (before, after) = (rim.vertices[(k + count - 1) % count], rim.vertices[(k + 1) % count]);
                    let [p, q, r] = [before, v, after].map(|v| patch.places[v as usize]);
                    let (back, ahead) = (p.distance(q), q.distance(r));
                    let along = 2.0 * ((r - q) / ahead - (q - p) / back) / (back + ahead);
                    let (out, normal) = around.frames[v as usize];
                    let across = -curvature * strength * strength * (cos * normal + sin * out);
                    let turn = 2.0 * turns[v as usize] / (back + ahead);
                    conditions.bent.push(v);
                    laplacians.push((along + turn * tangent(v) + across).to_array());
                }
            }
        }
    }
    let fairing = Fairing::precompute(&elements, &conditions, &Settings::new(energy))?;
    let values = Values { fixed: &fixed, tangents: &tangents, laplacians: &laplacians, source: &[] };
    let solution = fairing.solve(&values)?;
    Ok((solution.values.into_iter().map(DVec3::from).collect(), solution.residual))
}

/// How much the patch's border turns at each rim vertex, inside the patch.
fn turns(patch: &Patch, around: &Around) -> Vec<f64> {
    let count: usize = around.rims.iter().map(|rim| rim.vertices.len()).sum();
    let mut turns = vec![std::f64::consts::PI; count];
    for t in &patch.triangles {
        let p = t.map(|v| patch.places[v as usize]);
        for k in (0..3).filter(|&k| (t[k] as usize) < count) {
            let (u, v) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            turns[t[k] as usize] -= u.cross(v).length().atan2(u.dot(v));
        }
    }
    turns
}
