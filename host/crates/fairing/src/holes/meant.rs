//! Openings that an artist may have meant: eyes, sleeves, the edge of a cape. A guess, which is why it gives its reason.

use armature_geometry::surface::Components;
use glam::DVec3;

use super::hole::{Hole, Meant};
use super::welded::Welded;

/// A sheet has at most so many times the area of a disc with its rim: a hemisphere has twice that.
const SHEET: f64 = 2.2;
/// A hole with a rim longer than this times the diagonal of its part's box is large.
const LARGE: f64 = 1.0;
/// Twins differ at most by this in length, and in place by this part of the box's diagonal.
const ALIKE: f64 = 0.02;

/// An island may stand out of the box of its hole's rim by this part of the box's diagonal.
const ROOM: f64 = 0.3;

/// What is known about a connected part.
#[derive(Clone, Copy)]
struct Part {
    area: f64,
    low: DVec3,
    high: DVec3,
    rims: usize,
}

pub(super) fn decide(welded: &Welded, components: &Components, holes: &[Hole], part_of: &[u32]) -> Vec<Option<Meant>> {
    let nothing = Part { area: 0.0, low: DVec3::INFINITY, high: DVec3::NEG_INFINITY, rims: 0 };
    let mut parts = vec![nothing; components.count];
    for corners in &welded.triangles {
        let [a, b, c] = corners.map(|v| welded.positions[v as usize]);
        let part = &mut parts[components.of_vertex[corners[0] as usize] as usize];
        part.area += 0.5 * (b - a).cross(c - a).length();
        part.low = part.low.min(a).min(b).min(c);
        part.high = part.high.max(a).max(b).max(c);
    }
    part_of.iter().for_each(|&part| parts[part as usize].rims += 1);
    let (low, high) =
        parts.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p.low), h.max(p.high)));
    let size = low.distance(high);
    let reasons = |(index, hole): (usize, &Hole)| {
        let part = &parts[part_of[index] as usize];
        let disc = hole.length * hole.length / (4.0 * std::f64::consts::PI);
        if part.rims == 1 && part.area < SHEET * disc {
            let around = (0..holes.len())
                .find(|&other| part_of[other] != part_of[index] && holds(welded, &holes[other], part, hole));
            return Some(around.map_or(Meant::Sheet, |inside| Meant::Island { inside }));
        }
        let centre = DVec3::from(hole.centre);
        let mirror = DVec3::new(low.x + high.x - centre.x, centre.y, centre.z);
        let twin = (0..holes.len()).find(|&other| {
            let near = DVec3::from(holes[other].centre).distance(mirror) < ALIKE * size;
            other != index && near && (holes[other].length / hole.length - 1.0).abs() < ALIKE
        });
        if let Some(twin) = twin {
            return Some(Meant::Mirrored { twin });
        }
        (hole.length > LARGE * part.low.distance(part.high)).then_some(Meant::Large)
    };
    holes.iter().enumerate().map(reasons).collect()
}

/// Whether a small sheet lies within the rim of a hole: in its box, with a shorter rim.
fn holds(welded: &Welded, hole: &Hole, sheet: &Part, rim: &Hole) -> bool {
    let places = hole.rim.iter().map(|&v| welded.positions[welded.joined[v as usize] as usize]);
    let (low, high) = places.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let slack = DVec3::splat(ROOM * low.distance(high));
    rim.length < hole.length && sheet.low.cmpge(low - slack).all() && sheet.high.cmple(high + slack).all()
}
