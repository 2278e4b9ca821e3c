//! The soft dark patch where a character touches the floor, as a small map rendered from below.
//!
//! It is computed on the CPU for both renderers: the mesh is drawn into a small square from directly below, once for
//! what is close to the floor and once for everything, and both are blurred.

use crate::{Bounds, Ground, MeshView};

/// Texels along a side.
pub(crate) const SHADOW_SIDE: usize = 160;

/// The map and its position; buffers are kept from frame to frame.
#[derive(Clone, Debug)]
pub(crate) struct ContactShadow {
    /// x, z of the middle, world.
    pub(crate) center: [f32; 2],
    /// Half the side, world units.
    pub(crate) half_side: f32,
    /// `SHADOW_SIDE²` values, 255 darkest; rows along +z.
    pub(crate) texels: Vec<u8>,
    near: Vec<f32>,
    far: Vec<f32>,
    scratch: Vec<f32>,
}

impl Default for ContactShadow {
    fn default() -> Self {
        let blank = || vec![0.0; SHADOW_SIDE * SHADOW_SIDE];
        Self {
            center: [0.0; 2],
            half_side: 1.0,
            texels: vec![0; SHADOW_SIDE * SHADOW_SIDE],
            near: blank(),
            far: blank(),
            scratch: blank(),
        }
    }
}

impl ContactShadow {
    /// Draws the mesh in its current pose.
    pub(crate) fn update(&mut self, mesh: &MeshView, ground: &Ground) {
        self.near.fill(0.0);
        self.far.fill(0.0);
        let radius = ground.radius.max(1e-6);
        if let Some(bounds) = Bounds::of(mesh.positions) {
            let (center, size) = (bounds.center(), bounds.size());
            self.center = [center.x, center.z];
            self.half_side = size.x.max(size.z) * 0.5 + radius * 0.45;
            self.splat(mesh, ground.height, radius);
        }
        let texels_per_radius = radius / (2.0 * self.half_side) * SHADOW_SIDE as f32;
        blur(&mut self.near, &mut self.scratch, (texels_per_radius * 0.022).round() as usize);
        blur(&mut self.far, &mut self.scratch, (texels_per_radius * 0.11).round() as usize);
        for ((texel, near), far) in self.texels.iter_mut().zip(&self.near).zip(&self.far) {
            let light = (1.0 - 0.75 * near.min(1.0)) * (1.0 - 0.8 * far.min(1.0));
            *texel = ((1.0 - light) * 255.0 + 0.5) as u8;
        }
    }

    fn splat(&mut self, mesh: &MeshView, floor: f32, radius: f32) {
        let scale = SHADOW_SIDE as f32 / (2.0 * self.half_side);
        let origin = [self.center[0] - self.half_side, self.center[1] - self.half_side];
        for corners in mesh.triangles {
            let points = corners.map(|c| mesh.positions[c as usize]);
            let height = (points[0][1] + points[1][1] + points[2][1]) / 3.0 - floor;
            let near = 1.0 - height.max(0.0) / (0.10 * radius);
            let far = 1.0 - height.max(0.0) / (1.1 * radius);
            // Also false for a height that is NaN.
            if far > 0.0 {
                let texel = points.map(|p| [(p[0] - origin[0]) * scale, (p[2] - origin[1]) * scale]);
                self.splat_triangle(texel, near.max(0.0), far * far);
            }
        }
    }

    /// Every texel whose centre is inside, and the one under the triangle's centre (small triangles miss all texel
    /// centres).
    fn splat_triangle(&mut self, [a, b, c]: [[f32; 2]; 3], near: f32, far: f32) {
        let middle = [(a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0];
        self.splat_texel(middle[0] as usize, middle[1] as usize, near, far);
        let last = (SHADOW_SIDE - 1) as f32;
        let low = |axis: usize| (a[axis].min(b[axis]).min(c[axis]) - 0.5).ceil().clamp(0.0, last) as usize;
        let high = |axis: usize| (a[axis].max(b[axis]).max(c[axis]) - 0.5).floor().clamp(0.0, last) as usize;
        let side = |p: [f32; 2], q: [f32; 2], x: f32, y: f32| (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]);
        for row in low(1)..=high(1) {
            for column in low(0)..=high(0) {
                let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
                let sides = [side(a, b, x, y), side(b, c, x, y), side(c, a, x, y)];
                if sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0) {
                    self.splat_texel(column, row, near, far);
                }
            }
        }
    }

    fn splat_texel(&mut self, column: usize, row: usize, near: f32, far: f32) {
        if column < SHADOW_SIDE && row < SHADOW_SIDE {
            let index = row * SHADOW_SIDE + column;
            self.near[index] = self.near[index].max(near);
            self.far[index] = self.far[index].max(far);
        }
    }
}

/// Two rounds of box blur in each direction.
fn blur(map: &mut Vec<f32>, scratch: &mut Vec<f32>, reach: usize) {
    if reach == 0 {
        return;
    }
    // Each pass also transposes, so four passes blur both directions twice and restore the orientation.
    for _ in 0..4 {
        blur_rows_transposed(map, scratch, reach);
        std::mem::swap(map, scratch);
    }
}

fn blur_rows_transposed(map: &[f32], out: &mut [f32], reach: usize) {
    let scale = 1.0 / (2 * reach + 1) as f32;
    for (row, values) in map.chunks_exact(SHADOW_SIDE).enumerate() {
        let mut sum: f32 = values.iter().take(reach).sum();
        for column in 0..SHADOW_SIDE {
            sum += values.get(column + reach).copied().unwrap_or(0.0);
            if let Some(left) = column.checked_sub(reach + 1) {
                sum -= values[left];
            }
            out[column * SHADOW_SIDE + row] = (sum * scale).max(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn shadow_of(positions: &[[f32; 3]]) -> ContactShadow {
        let triangles: Vec<[u32; 3]> = (0..positions.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let mesh = MeshView { positions, normals: positions, triangles: &triangles, ..MeshView::default() };
        let mut shadow = ContactShadow::default();
        shadow.update(&mesh, &Ground { height: 0.0, center: Vec3::ZERO, radius: 1.0 });
        shadow
    }

    #[test]
    fn what_is_low_is_darker_than_what_is_high() {
        let middle = SHADOW_SIDE * SHADOW_SIDE / 2 + SHADOW_SIDE / 2;
        let at = |y: f32| shadow_of(&[[-0.5, y, -0.5], [0.5, y, -0.5], [0.0, y, 0.5]]).texels[middle];
        let darkness = [0.0, 0.05, 0.3, 0.8, 2.0].map(at);
        assert!(darkness.windows(2).all(|pair| pair[0] > pair[1]), "{darkness:?}");
        assert_eq!(darkness[4], 0);
    }

    #[test]
    fn the_edge_of_the_map_is_bright() {
        let shadow = shadow_of(&[[-0.5, 0.0, -0.5], [0.5, 0.0, -0.5], [0.0, 0.0, 0.5]]);
        let edge = (0..SHADOW_SIDE).flat_map(|i| [i, (SHADOW_SIDE - 1) * SHADOW_SIDE + i, i * SHADOW_SIDE]);
        assert!(edge.map(|i| shadow.texels[i]).max().unwrap() < 3);
    }

    #[test]
    fn blur_keeps_the_sum_and_the_place() {
        let mut map = vec![0.0; SHADOW_SIDE * SHADOW_SIDE];
        map[50 * SHADOW_SIDE + 70] = 1.0;
        blur(&mut map, &mut vec![0.0; SHADOW_SIDE * SHADOW_SIDE], 3);
        assert!((map.iter().sum::<f32>() - 1.0).abs() < 1e-4);
        let peak = (0..map.len()).max_by(|&a, &b| map[a].total_cmp(&map[b])).unwrap();
        assert_eq!((peak / SHADOW_SIDE, peak % SHADOW_SIDE), (50, 70));
    }

    #[test]
    fn nonsense_positions_are_survived() {
        shadow_of(&[[f32::NAN; 3], [1e30, 0.0, f32::INFINITY], [0.0; 3]]);
        shadow_of(&[[-1e38, 0.0, 0.0], [1e38, 0.0, 0.0], [0.0, 0.0, 3e38]]);
    }
}
