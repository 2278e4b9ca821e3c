//! Blends of two rims as functions on a parameter domain (thesis 3.5, figure 3.17; 3.8.1): the rims are laid on the two
//! borders of a cylinder or an annulus, by their length, and the surface is solved for once, with the domain's metric. No
//! surface between the rims is guessed.

use std::f64::consts::TAU;

use glam::DVec3;

use super::around::Around;
use super::refine::Patch;
use super::rims::{RimShape, along_rims};
use super::solve::{NoPatch, PatchOutcome, is_thrown};
use crate::mixed::Elements;

/// Points along both rims that decide which places are joined.
const SAMPLES: usize = 64;
/// Ways to join them that are tried.
const TURNS: usize = 512;

/// A domain with two borders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Domain {
    /// Flat, as long around as the rims are on average, and as high as they are apart.
    #[default]
    Cylinder,
    /// Between two circles, the inner one as long as the shorter rim, as far apart as the rims are.
    Annulus,
}

/// How two rims are blended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DomainSettings {
    /// The parameter domain.
    pub domain: Domain,
    /// How the surface leaves each rim.
    pub shapes: [RimShape; 2],
    /// Wanted length of edges, in those of the rims.
    pub coarseness: f64,
    /// Most vertices of the blend.
    pub most_vertices: usize,
}

impl Default for DomainSettings {
    fn default() -> Self {
        let shapes = [RimShape::default(); 2];
        Self { domain: Domain::default(), shapes, coarseness: 1.0, most_vertices: 100_000 }
    }
}

/// A vertex of a row around the domain, and its place around, from 0 to 1. Rows ascend from 0.
type Stop = (u32, f64);

pub(crate) fn make_blend(around: &Around, settings: &DomainSettings) -> Result<PatchOutcome, NoPatch> {
    let [first, second] = around.rims.as_slice() else { return Err(NoPatch::NoTriangles) };
    let (one, one_length) = by_length(around, &first.vertices);
    // The second rim runs the other way around.
    let turned: Vec<u32> = second.vertices.iter().rev().copied().collect();
    let (other, other_length, apart) = matched(around, &one, turned);
    let measure = match settings.domain {
        Domain::Cylinder => Measure::Cylinder { around: 0.5 * (one_length + other_length), height: apart },
        Domain::Annulus if one_length <= other_length => {
            Measure::Annulus { from: one_length / TAU, to: one_length / TAU + apart }
        }
        Domain::Annulus => Measure::Annulus { from: other_length / TAU + apart, to: other_length / TAU },
    };
    let held = around.places.len();
    let mean = (one_length + other_length) / (one.len() + other.len()) as f64;
    let across = ((apart / (settings.coarseness * mean)).round() as usize).max(2);
    let rows = rows(one, other, across, held, settings);
    let mut triangles = Vec::new();
    rows.windows(2).for_each(|pair| ladder(&pair[0], &pair[1], &mut triangles));
    let mut places = around.places.clone();
    let mut at = vec![(0.0, 0.0); held];
    for (j, row) in rows.iter().enumerate() {
        for &(v, s) in row {
            let place = (s, j as f64 / (rows.len() - 1) as f64);
            if v as usize >= places.len() {
                places.push(DVec3::ZERO);
                at.push(place);
            } else {
                at[v as usize] = place;
            }
        }
    }
    let length = |a: u32, b: u32| measure.distance(at[a as usize], at[b as usize]);
    let lengths = triangles.iter().map(|&[a, b, c]| [length(b, c), length(c, a), length(a, b)]).collect();
    let solved = Elements::of_lengths(places.len(), triangles.clone(), lengths)
        .and_then(|elements| along_rims(around, &elements, &settings.shapes).solve(&elements, held, &places));
    let (places, residual) = solved.map_err(NoPatch::Fairing)?;
    if is_thrown(around, &places[held..]) {
        return Err(NoPatch::Thrown);
    }
    let patch = Patch { places, triangles, held, sizes: Vec::new(), chords: around.chords.clone() };
    Ok(PatchOutcome { patch, rounds: 1, last_move: 0.0, residual, settled: true, failed: None })
}

/// Lengths in the domain.
#[derive(Clone, Copy, Debug)]
enum Measure {
    Cylinder { around: f64, height: f64 },
    Annulus { from: f64, to: f64 },
}

impl Measure {
    /// Between two places, given by how far around and how far across they are.
    fn distance(self, (s, t): (f64, f64), (u, w): (f64, f64)) -> f64 {
        let turn = s - u - (s - u).round();
        match self {
            Self::Cylinder { around, height } => (around * turn).hypot(height * (t - w)),
            Self::Annulus { from, to } => {
                let (p, q) = (from + t * (to - from), from + w * (to - from));
                // By the half angle: no cancellation.
                (p - q).hypot(2.0 * (p * q).sqrt() * (0.5 * TAU * turn).sin())
            }
        }
    }
}

/// A closed rim by its length, and that.
fn by_length(around: &Around, rim: &[u32]) -> (Vec<Stop>, f64) {
    let place = |k: usize| around.places[rim[k % rim.len()] as usize];
    let mut ends = vec![0.0];
    for k in 0..rim.len() {
        ends.push(ends[k] + place(k).distance(place(k + 1)));
    }
    let total = ends[rim.len()];
    (rim.iter().zip(&ends).map(|(&v, end)| (v, end / total.max(f64::MIN_POSITIVE))).collect(), total)
}

/// The second rim, started where it is nearest to the first on average; its length; and how far the two are apart.
fn matched(around: &Around, one: &[Stop], mut rim: Vec<u32>) -> (Vec<Stop>, f64, f64) {
    let here: Vec<DVec3> = (0..SAMPLES).map(|k| along(around, one, k as f64 / SAMPLES as f64)).collect();
    let mut best = (f64::INFINITY, Vec::new(), 0.0);
    let step = rim.len().div_ceil(TURNS);
    for _ in 0..rim.len().div_ceil(step) {
        let (row, total) = by_length(around, &rim);
        let there = (0..SAMPLES).map(|k| along(around, &row, k as f64 / SAMPLES as f64));
        let apart = here.iter().zip(there).map(|(p, q)| p.distance(q)).sum::<f64>() / SAMPLES as f64;
        if apart < best.0 {
            best = (apart, row, total);
        }
        rim.rotate_left(step);
    }
    (best.1, best.2, best.0)
}

/// The place on a rim.
fn along(around: &Around, rim: &[Stop], s: f64) -> DVec3 {
    let next = rim.partition_point(|&(_, start)| start <= s);
    let ((a, from), (b, to)) = (rim[next - 1], if next < rim.len() { rim[next] } else { (rim[0].0, 1.0) });
    let (p, q) = (around.places[a as usize], around.places[b as usize]);
    p.lerp(q, (s - from) / (to - from).max(f64::MIN_POSITIVE))
}

/// The rims, and rows of new vertices between them. Their numbers and spacing go over from one rim's to the other's.
fn rows(one: Vec<Stop>, other: Vec<Stop>, across: usize, held: usize, settings: &DomainSettings) -> Vec<Vec<Stop>> {
    let widest = (one.len().max(other.len()) as f64 / settings.coarseness).ceil().max(3.0) as usize;
    let across = across.min((settings.most_vertices / widest).max(2));
    let mut next = held as u32;
    let mut between = Vec::new();
    for j in 1..across {
        let t = j as f64 / across as f64;
        let count = (1.0 - t) * one.len() as f64 + t * other.len() as f64;
        let count = ((count / settings.coarseness).round() as usize).max(3);
        let place = |k: usize| {
            let q = k as f64 / count as f64;
            (1.0 - t) * spaced(&one, q) + t * spaced(&other, q)
        };
        between.push((0..count).map(|k| (next + k as u32, place(k))).collect());
        next += count as u32;
    }
    [vec![one], between, vec![other]].concat()
}

/// Where the part `q` of a rim's vertices is passed.
fn spaced(rim: &[Stop], q: f64) -> f64 {
    let at = q * rim.len() as f64;
    let k = (at.floor() as usize).min(rim.len() - 1);
    let to = rim.get(k + 1).map_or(1.0, |next| next.1);
    rim[k].1 + (at - k as f64) * (to - rim[k].1)
}

/// Triangles between two rows, to the left of the first.
fn ladder(below: &[Stop], above: &[Stop], triangles: &mut Vec<[u32; 3]>) {
    let at = |row: &[Stop], k: usize| {
        let (v, s) = row[k % row.len()];
        (v, s + (k / row.len()) as f64)
    };
    let (mut i, mut j) = (0, 0);
    while i < below.len() || j < above.len() {
        let ((a, s), (b, t)) = (at(below, i), at(above, j));
        let ((a_next, s_next), (b_next, t_next)) = (at(below, i + 1), at(above, j + 1));
        // The shorter of the two diagonals.
        let go_below = j == above.len() || (i < below.len() && (s_next - t).abs() <= (t_next - s).abs());
        if go_below {
            triangles.push([a, a_next, b]);
            i += 1;
        } else {
            triangles.push([a, b_next, b]);
            j += 1;
        }
    }
}
