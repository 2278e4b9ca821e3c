//! Curves in the plane for tests: made by formula, closed and open, and scattered segments.
#![allow(dead_code, reason = "each test file uses its own part of this module")]

use std::f64::consts::TAU;

pub(crate) type Outline = (Vec<[f64; 2]>, Vec<[u32; 2]>);

/// Random numbers in -1..1, the same every time.
fn noise() -> impl FnMut() -> f64 {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// One segment from every vertex to the next, and from the last to the first.
pub(crate) fn closed(vertices: Vec<[f64; 2]>) -> Outline {
    let count = vertices.len() as u32;
    (vertices, (0..count).map(|k| [k, (k + 1) % count]).collect())
}

/// A closed curve around the origin with lobes, counter-clockwise.
pub(crate) fn flower(count: u32) -> Outline {
    let at = |k: u32| {
        let angle = TAU * f64::from(k) / f64::from(count);
        let radius = 1.0 + 0.4 * (7.0 * angle).sin() + 0.02 * (301.0 * angle).sin();
        [radius * angle.cos(), radius * angle.sin()]
    };
    closed((0..count).map(at).collect())
}

/// A closed curve with every vertex moved by noise, so that it is rough and may cross itself.
pub(crate) fn rough(count: u32) -> Outline {
    let (mut vertices, segments) = flower(count);
    let mut noise = noise();
    vertices.iter_mut().flatten().for_each(|c| *c += 0.01 * noise());
    (vertices, segments)
}

/// The flower with every third segment missing.
pub(crate) fn gaps(count: u32) -> Outline {
    let (vertices, mut segments) = flower(count);
    let mut index = 0;
    segments.retain(|_| {
        index += 1;
        index % 3 != 0
    });
    (vertices, segments)
}

/// Short segments at random places, in random directions.
pub(crate) fn strewn(count: u32) -> Outline {
    let mut noise = noise();
    let length = 1.0 / f64::from(count).sqrt();
    let mut vertices = Vec::new();
    for _ in 0..count {
        let (x, y) = (noise(), noise());
        vertices.extend([[x, y], [x + length * noise(), y + length * noise()]]);
    }
    (vertices, (0..count).map(|k| [2 * k, 2 * k + 1]).collect())
}

/// Each of the above with its name.
pub(crate) fn all(count: u32) -> Vec<(&'static str, Outline)> {
    vec![
        ("smooth, closed", flower(count)),
        ("rough, closed", rough(count)),
        ("with gaps", gaps(count)),
        ("strewn", strewn(count)),
    ]
}

/// Points throughout the box from -2 to 2, and as many within a hundredth of the curve.
pub(crate) fn points_around(vertices: &[[f64; 2]], segments: &[[u32; 2]], count: usize) -> Vec<[f64; 2]> {
    let mut noise = noise();
    let mut points: Vec<[f64; 2]> = (0..count / 2).map(|_| [2.0 * noise(), 2.0 * noise()]).collect();
    for _ in count / 2..count {
        let segment = segments[((0.5 + 0.5 * noise()) * segments.len() as f64) as usize];
        let [a, b] = segment.map(|v| vertices[v as usize]);
        points.push([0, 1].map(|k| f64::midpoint(a[k], b[k]) + 0.01 * noise()));
    }
    points
}
