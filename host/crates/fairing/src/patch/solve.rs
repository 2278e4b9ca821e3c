//! Solving for a patch: rounds of refining its triangles and placing their vertices, the metric each time being that of the
//! surface found before (thesis 3.8.1: on the unknown surface itself, the linearised energy would be the true one).

use glam::DVec3;

use super::around::Around;
use super::bridge::first_triangles;
use super::refine::Patch;
use super::rims::{GivenAlongRims, RimShape, along_rims};
use crate::mixed::{Elements, Energy, FairingError};

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
        if is_thrown(around, &places[patch.held..]) {
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

/// Whether a vertex is far from the rims.
pub(super) fn is_thrown(around: &Around, places: &[DVec3]) -> bool {
    let rims = around.rims.iter().flat_map(|rim| &rim.vertices).map(|&v| around.places[v as usize]);
    let (low, high) = rims.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let (centre, size) = (0.5 * (low + high), low.distance(high));
    places.iter().any(|p| p.distance(centre) > FARTHEST * size)
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
    let (region, shape) = match join {
        Join::Tangent => (Some(Energy::Laplacian), RimShape::default()),
        Join::Curvature => (Some(Energy::LaplacianGradient), RimShape::default()),
        Join::Angle { degrees, strength } => (None, RimShape { degrees, strength, curvature: None }),
        Join::Bent { degrees, strength, curvature } => {
            (None, RimShape { degrees, strength, curvature: Some(curvature) })
        }
    };
    let mut triangles = patch.triangles.clone();
    if region.is_some() {
        triangles.extend_from_slice(&around.triangles);
    }
    let elements = Elements::of_positions(&patch.places.iter().map(DVec3::to_array).collect::<Vec<_>>(), &triangles)?;
    let given = if let Some(energy) = region {
        GivenAlongRims { energy, ..on_region(patch, &triangles) }
    } else {
        along_rims(around, &elements, &[shape])
    };
    given.solve(&elements, patch.held, &patch.places)
}

/// What is around the rims is held too, and goes on beyond as it ends.
fn on_region(patch: &Patch, triangles: &[[u32; 3]]) -> GivenAlongRims {
    let mut given = GivenAlongRims::default();
    for (edge, out) in Around::borders(&patch.places, triangles) {
        given.borders.push(edge);
        given.tangents.push([out.to_array(); 2]);
    }
    given
}
