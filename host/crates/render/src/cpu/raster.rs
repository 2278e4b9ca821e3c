//! From triangles in the world to triangles on the screen.

use glam::{DVec2, Vec3, Vec4};

use crate::MeshView;
use crate::bone_shape::OverlayVertex;
use crate::uniforms::Uniforms;

/// A triangle on the screen, ready for coverage queries.
#[derive(Clone, Debug)]
pub(crate) struct ScreenTriangle {
    /// Index of the triangle it was cut from.
    pub(crate) source: u32,
    /// Whether its front side is visible.
    pub(crate) front: bool,
    /// `edges[i]`·(x, y, 1) is the barycentric coordinate of corner i, in pixels from the upper left.
    edges: [[f64; 3]; 3],
    /// Whether a sample exactly on edge i belongs to the triangle (top-left rule).
    owns_edge: [bool; 3],
    /// Smallest and largest corner, pixels.
    pub(crate) bounds: [DVec2; 2],
    depth: [f32; 3],
    inverse_w: [f32; 3],
    /// Barycentric coordinates of the corners in the source triangle.
    weights: [Vec3; 3],
}

impl ScreenTriangle {
    /// Barycentric coordinates of a point, if the triangle covers it.
    pub(crate) fn covers(&self, x: f64, y: f64) -> Option<[f64; 3]> {
        let at = self.coordinates(x, y);
        let inside = |i: usize| at[i] > 0.0 || (at[i] == 0.0 && self.owns_edge[i]);
        (inside(0) && inside(1) && inside(2)).then_some(at)
    }

    /// Barycentric coordinates of any point, inside or outside.
    pub(crate) fn coordinates(&self, x: f64, y: f64) -> [f64; 3] {
        self.edges.map(|[a, b, c]| a * x + b * y + c)
    }

    /// Depth at a point, 0 near to 1 far.
    pub(crate) fn depth(&self, at: [f64; 3]) -> f32 {
        at[0] as f32 * self.depth[0] + at[1] as f32 * self.depth[1] + at[2] as f32 * self.depth[2]
    }

    /// Perspective-correct weights of the source triangle's corners.
    pub(crate) fn source_weights(&self, at: [f64; 3]) -> Vec3 {
        let share = [0, 1, 2].map(|i| at[i] as f32 * self.inverse_w[i]);
        let sum = share[0] + share[1] + share[2];
        (self.weights[0] * share[0] + self.weights[1] * share[1] + self.weights[2] * share[2]) / sum
    }
}

#[derive(Clone, Copy)]
struct Corner {
    clip: Vec4,
    weights: Vec3,
}

/// Both sides of the mesh's triangles with these numbers, in this order.
pub(crate) fn project_mesh(
    mesh: &MeshView,
    triangles: &[u32],
    uniforms: &Uniforms,
    size: [u32; 2],
) -> Vec<ScreenTriangle> {
    if triangles.is_empty() {
        return Vec::new();
    }
    let clip: Vec<Vec4> =
        mesh.positions.iter().map(|&p| uniforms.clip_from_world * Vec3::from(p).extend(1.0)).collect();
    let mut out = Vec::with_capacity(triangles.len());
    for &source in triangles {
        let corners = mesh.triangles[source as usize];
        project(source, corners.map(|c| clip[c as usize]), size, false, &mut out);
    }
    out
}

/// The front sides of the overlay's triangles.
pub(crate) fn project_overlay(vertices: &[OverlayVertex], uniforms: &Uniforms, size: [u32; 2]) -> Vec<ScreenTriangle> {
    let mut out = Vec::with_capacity(vertices.len() / 3);
    for (source, corners) in vertices.chunks_exact(3).enumerate() {
        let clip = [0, 1, 2].map(|i| uniforms.clip_from_world * Vec3::from(corners[i].position).extend(1.0));
        project(source as u32, clip, size, true, &mut out);
    }
    out
}

fn project(source: u32, clip: [Vec4; 3], size: [u32; 2], front_only: bool, out: &mut Vec<ScreenTriangle>) {
    if !clip.iter().all(|c| c.is_finite()) {
        return;
    }
    let units = [Vec3::X, Vec3::Y, Vec3::Z];
    let corners = [0, 1, 2].map(|i| Corner { clip: clip[i], weights: units[i] });
    let (polygon, count) = clip_near(corners);
    for last in 2..count {
        out.extend(screen_triangle(source, [polygon[0], polygon[last - 1], polygon[last]], size, front_only));
    }
}

/// Clips what is in front of the near plane (z < 0 in clip space); 0, 3 or 4 corners remain.
fn clip_near(corners: [Corner; 3]) -> ([Corner; 4], usize) {
    let mut polygon = [corners[0]; 4];
    let mut count = 0;
    let mut push = |corner| {
        polygon[count] = corner;
        count += 1;
    };
    for index in 0..3 {
        let (from, to) = (corners[index], corners[(index + 1) % 3]);
        let (inside, next_inside) = (from.clip.z >= 0.0, to.clip.z >= 0.0);
        if inside {
            push(from);
        }
        if inside != next_inside {
            let t = from.clip.z / (from.clip.z - to.clip.z);
            push(Corner { clip: from.clip.lerp(to.clip, t), weights: from.weights.lerp(to.weights, t) });
        }
    }
    (polygon, count)
}

fn screen_triangle(source: u32, corners: [Corner; 3], size: [u32; 2], front_only: bool) -> Option<ScreenTriangle> {
    let mut corners = corners;
    if corners.iter().any(|c| c.clip.w <= 0.0) {
        return None;
    }
    let place = |c: &Corner| {
        let x = f64::from(c.clip.x) / f64::from(c.clip.w) * 0.5 + 0.5;
        let y = 0.5 - f64::from(c.clip.y) / f64::from(c.clip.w) * 0.5;
        // Graphics hardware rounds corners to 1/256 of a pixel; so does this, to cover the same samples.
        (DVec2::new(x * f64::from(size[0]), y * f64::from(size[1])) * 256.0).round() / 256.0
    };
    let twice_area = |[a, b, c]: [DVec2; 3]| (b - a).perp_dot(c - a);
    let mut points = [place(&corners[0]), place(&corners[1]), place(&corners[2])];
    // Counter-clockwise in the world is clockwise here, since y runs down: a negative area.
    let mut area = twice_area(points);
    let front = area < 0.0;
    if front {
        points.swap(1, 2);
        corners.swap(1, 2);
        area = -area;
    } else if front_only {
        return None;
    }
    if !area.is_finite() || area == 0.0 {
        return None;
    }
    let edge = |i: usize| {
        let (p, q) = (points[(i + 1) % 3], points[(i + 2) % 3]);
        [(p.y - q.y) / area, (q.x - p.x) / area, (p.x * q.y - p.y * q.x) / area]
    };
    let owns = |i: usize| {
        let (p, q) = (points[(i + 1) % 3], points[(i + 2) % 3]);
        q.y < p.y || (q.y <= p.y && q.x > p.x)
    };
    Some(ScreenTriangle {
        source,
        front,
        edges: [edge(0), edge(1), edge(2)],
        owns_edge: [owns(0), owns(1), owns(2)],
        bounds: [points[0].min(points[1]).min(points[2]), points[0].max(points[1]).max(points[2])],
        depth: [0, 1, 2].map(|i| corners[i].clip.z / corners[i].clip.w),
        inverse_w: [0, 1, 2].map(|i| 1.0 / corners[i].clip.w),
        weights: [0, 1, 2].map(|i| corners[i].weights),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(x: f32, y: f32, z: f32, w: f32) -> Corner {
        Corner { clip: Vec4::new(x, y, z, w), weights: Vec3::X }
    }

    #[test]
    fn two_triangles_of_a_square_cover_each_pixel_once() {
        let square = [corner(-0.5, -0.5, 0.5, 1.0), corner(0.5, -0.5, 0.5, 1.0), corner(0.5, 0.5, 0.5, 1.0)];
        let other = [square[0], square[2], corner(-0.5, 0.5, 0.5, 1.0)];
        // Corners fall on pixel centres, so every edge and the diagonal hit sample points exactly.
        let size = [21, 21];
        let triangles = [square, other].map(|t| screen_triangle(0, t, size, false).unwrap());
        let mut covered = 0;
        for y in 0..21 {
            for x in 0..21 {
                let (x, y) = (f64::from(x) + 0.25, f64::from(y) + 0.25);
                let count = triangles.iter().filter(|t| t.covers(x, y).is_some()).count();
                assert!(count <= 1, "({x}, {y}) is covered twice");
                covered += count;
            }
        }
        assert!((100..=121).contains(&covered), "{covered}");
    }

    #[test]
    fn near_plane_cuts_and_keeps_weights() {
        let mut corners = [corner(0.0, 0.0, -1.0, 0.5), corner(1.0, 0.0, 1.0, 2.0), corner(0.0, 1.0, 1.0, 2.0)];
        corners[1].weights = Vec3::Y;
        corners[2].weights = Vec3::Z;
        let (polygon, count) = clip_near(corners);
        assert_eq!(count, 4);
        for corner in &polygon[..count] {
            assert!(corner.clip.z >= 0.0 && (corner.weights.element_sum() - 1.0).abs() < 1e-6);
        }
        assert_eq!(clip_near([corners[0]; 3]).1, 0);
    }

    #[test]
    fn only_fronts_where_asked() {
        let front = [corner(-1.0, -1.0, 0.5, 1.0), corner(1.0, -1.0, 0.5, 1.0), corner(0.0, 1.0, 0.5, 1.0)];
        let back = [front[0], front[2], front[1]];
        assert!(screen_triangle(0, front, [9, 9], true).is_some());
        assert!(screen_triangle(0, back, [9, 9], true).is_none());
        assert!(screen_triangle(0, back, [9, 9], false).is_some());
    }
}
