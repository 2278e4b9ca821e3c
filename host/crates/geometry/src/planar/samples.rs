//! Where vertices are needed along bones.

use glam::DVec2;

/// Most samples of one bone.
const MOST: f64 = 5000.0;
/// Distance between samples, relative to the local size of the mesh: a little less, so that no element spans two of
/// them.
const SPACING: f64 = 0.7;

/// Points along a bone from end to end. Their spacing is that of the surrounding mesh of an outline with triangles of
/// size `largest`: up to the distance to the nearest segment of the outline, or that segment's length.
pub(super) fn samples(
    bone: [[f64; 2]; 2],
    vertices: &[[f64; 2]],
    segments: &[[u32; 2]],
    largest: f64,
) -> Vec<[f64; 2]> {
    let [from, to] = bone.map(DVec2::from);
    let length = from.distance(to);
    let mut samples = vec![bone[0]];
    if length <= 0.0 {
        return samples;
    }
    let step_at = |along: f64| {
        let size = size_at(from.lerp(to, along / length), vertices, segments).min(largest);
        (SPACING * size).max(length / MOST)
    };
    let mut along = 0.0;
    let mut step = step_at(along);
    while along + 1.5 * step < length {
        along += step;
        step = step_at(along);
        samples.push(from.lerp(to, along / length).to_array());
    }
    samples.push(bone[1]);
    samples
}

fn size_at(p: DVec2, vertices: &[[f64; 2]], segments: &[[u32; 2]]) -> f64 {
    let mut nearest = (f64::INFINITY, f64::INFINITY);
    for ends in segments {
        let [a, b] = ends.map(|v| DVec2::from(vertices[v as usize]));
        let (ab, ap) = (b - a, p - a);
        let squared = ab.length_squared();
        if squared > 0.0 {
            let t = (ap.dot(ab) / squared).clamp(0.0, 1.0);
            let distance = ap.distance_squared(t * ab);
            if distance < nearest.0 {
                nearest = (distance, squared);
            }
        }
    }
    nearest.0.max(nearest.1).sqrt()
}
