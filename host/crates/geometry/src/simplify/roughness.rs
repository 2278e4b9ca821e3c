//! Roughness finer than the coarse surface will be: noise of a scanner, which no triangle of the coarse surface can
//! follow and which keeps edges from being collapsed.

use glam::DVec3;
use rayon::prelude::*;

use crate::TriangleMesh;
use crate::surface::{edges, triangle_areas, weld_vertices};

/// A surface that loses more than this share of its area when it is smoothed is rough. The armadillo, with its scales,
/// loses a twentieth, a sphere with noise of twice its edge lengths two thirds.
const ROUGH: f64 = 0.25;
/// Roughness shows after this many rounds of smoothing.
const FIRST_ROUNDS: usize = 2;
/// Most rounds of smoothing.
const MOST_ROUNDS: usize = 40;
/// Steps towards the mean of the neighbours, and back outwards, so that the surface as a whole does not shrink (Taubin
/// 1995, "A signal processing approach to fair surface design").
const STEPS: [f64; 2] = [0.5, -0.52];

/// A surface without its roughness.
#[derive(Clone, Debug)]
pub(crate) struct Smoothed {
    /// The same triangles.
    pub(crate) mesh: TriangleMesh,
    /// The largest distance between a vertex and its place in `mesh`.
    pub(crate) farthest: f64,
}

/// A valid mesh without roughness, if it is rough compared with a surface of this many `vertices`. Open and non-manifold
/// edges stay.
pub(crate) fn without_roughness(mesh: &TriangleMesh, vertices: usize) -> Option<Smoothed> {
    let rounds = (mesh.vertices.len() / vertices.max(1)).min(MOST_ROUNDS);
    if rounds == 0 {
        return None;
    }
    let weld = weld_vertices(&mesh.vertices, 0.0);
    let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|v| weld.welded_of[v as usize])).collect();
    let mut places: Vec<DVec3> = weld.representative.iter().map(|&v| DVec3::from(mesh.vertices[v as usize])).collect();
    let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); places.len()];
    let mut stays = vec![false; places.len()];
    for edge in edges(&triangles) {
        let [a, b] = edge.vertices;
        if edge.triangles == 2 {
            neighbours[a as usize].push(b);
            neighbours[b as usize].push(a);
        } else {
            [a, b].into_iter().for_each(|v| stays[v as usize] = true);
        }
    }
    let smoothed = |places: &[DVec3]| TriangleMesh {
        vertices: weld.welded_of.iter().map(|&welded| places[welded as usize].to_array()).collect(),
        triangles: mesh.triangles.clone(),
    };
    let area = |mesh: &TriangleMesh| triangle_areas(mesh).ok().map(|areas| areas.iter().sum::<f64>());
    let before = area(mesh)?;
    for round in 0..rounds {
        if round == FIRST_ROUNDS && area(&smoothed(&places))? > (1.0 - 0.5 * ROUGH) * before {
            return None;
        }
        for step in STEPS {
            let moved = |(v, &place): (usize, &DVec3)| {
                let around = &neighbours[v];
                if stays[v] || around.is_empty() {
                    return place;
                }
                let mean = around.iter().map(|&n| places[n as usize]).sum::<DVec3>() / around.len() as f64;
                place + step * (mean - place)
            };
            places = places.par_iter().enumerate().map(moved).collect();
        }
    }
    let smooth = smoothed(&places);
    let is_rough = area(&smooth)? < (1.0 - ROUGH) * before;
    let off = mesh.vertices.iter().zip(&smooth.vertices).map(|(&a, &b)| DVec3::from(a).distance(DVec3::from(b)));
    let farthest = off.fold(0.0, f64::max);
    (is_rough && farthest.is_finite()).then_some(Smoothed { mesh: smooth, farthest })
}
