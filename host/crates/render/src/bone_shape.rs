//! Bones as slim octahedra with a bead at the head.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::BoneMark;
use crate::srgb::linear_from_srgb;

/// One corner of the overlay's triangles.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct OverlayVertex {
    pub(crate) position: [f32; 3],
    pub(crate) normal: [f32; 3],
    /// Linear, with opacity.
    pub(crate) color: [f32; 4],
}

/// Appends the triangles of all bones, counter-clockwise from outside, three vertices each.
///
/// `radius`: size of the character, world units; no bone gets thicker than a fortieth of it.
pub(crate) fn bone_triangles(bones: &[BoneMark], radius: f32, out: &mut Vec<OverlayVertex>) {
    for bone in bones {
        let (head, tail) = (Vec3::from(bone.head), Vec3::from(bone.tail));
        if !(head.is_finite() && tail.is_finite()) {
            continue;
        }
        let [r, g, b, alpha] = bone.color;
        let color = [linear_from_srgb(r), linear_from_srgb(g), linear_from_srgb(b), alpha];
        let along = tail - head;
        let thickness = (along.length() * 0.085).min(radius * 0.016);
        if let Some(direction) = along.try_normalize() {
            octahedron(head, direction, along.length(), thickness, color, out);
        }
        bead(head, (thickness * 0.75).max(radius * 0.007), color, out);
    }
}

fn octahedron(head: Vec3, direction: Vec3, length: f32, thickness: f32, color: [f32; 4], out: &mut Vec<OverlayVertex>) {
    let (x, z) = direction.any_orthonormal_pair();
    let waist = head + direction * (length * 0.16).min(thickness * 2.0);
    let tail = head + direction * length;
    let ring = [x, z, -x, -z].map(|side| waist + side * thickness);
    for corner in 0..4 {
        let (a, b) = (ring[corner], ring[(corner + 1) % 4]);
        triangle([tail, a, b], waist, color, out);
        triangle([head, b, a], waist, color, out);
    }
}

fn bead(middle: Vec3, radius: f32, color: [f32; 4], out: &mut Vec<OverlayVertex>) {
    const RINGS: usize = 4;
    const SECTORS: usize = 8;
    let point = |ring: usize, sector: usize| {
        let (sin_ring, cos_ring) = (std::f32::consts::PI * ring as f32 / RINGS as f32).sin_cos();
        let (sin, cos) = (std::f32::consts::TAU * sector as f32 / SECTORS as f32).sin_cos();
        middle + Vec3::new(sin_ring * cos, cos_ring, sin_ring * sin) * radius
    };
    for ring in 0..RINGS {
        for sector in 0..SECTORS {
            let [a, b, c, d] =
                [point(ring, sector), point(ring + 1, sector), point(ring + 1, sector + 1), point(ring, sector + 1)];
            if ring + 1 < RINGS {
                triangle([a, b, c], middle, color, out);
            }
            if ring > 0 {
                triangle([a, c, d], middle, color, out);
            }
        }
    }
}

/// Turns the triangle so that it faces away from `inside`.
fn triangle([a, b, c]: [Vec3; 3], inside: Vec3, color: [f32; 4], out: &mut Vec<OverlayVertex>) {
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let (b, c, normal) = if normal.dot(a - inside) < 0.0 { (c, b, -normal) } else { (b, c, normal) };
    out.extend([a, b, c].map(|p| OverlayVertex { position: p.to_array(), normal: normal.to_array(), color }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_closed_and_face_outwards() {
        let mut out = Vec::new();
        let mark = BoneMark { head: [1.0, 2.0, 3.0], tail: [1.5, 4.0, 2.0], color: [1.0; 4] };
        bone_triangles(&[mark], 10.0, &mut out);
        // The signed volume of closed, outward-facing shapes does not depend on the origin and is positive.
        let volume = |origin: Vec3| -> f32 {
            out.chunks_exact(3)
                .map(|t| {
                    let [a, b, c] = [0, 1, 2].map(|i| Vec3::from(t[i].position) - origin);
                    a.dot(b.cross(c)) / 6.0
                })
                .sum()
        };
        let (here, there) = (volume(Vec3::ZERO), volume(Vec3::splat(2.5)));
        assert!(here > 1e-4 && (here - there).abs() < 1e-3, "{here} {there}");
    }

    #[test]
    fn bones_without_length_or_sense_are_survived() {
        let mut out = Vec::new();
        let hub = BoneMark { head: [1.0; 3], tail: [1.0; 3], color: [1.0; 4] };
        bone_triangles(&[hub, BoneMark { tail: [f32::NAN; 3], ..hub }], 1.0, &mut out);
        assert!(!out.is_empty() && out.iter().all(|v| Vec3::from(v.position).is_finite()));
    }
}
