//! Simple shapes to draw.

use glam::Vec3;

/// A mesh under construction.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shape {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
    pub(crate) uv: Vec<[f32; 2]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// A tube of varying radius around a segment, closed by half spheres.
    pub(crate) fn capsule(&mut self, from: Vec3, to: Vec3, radii: [f32; 2], sectors: usize) {
        let axis = (to - from).normalize_or(Vec3::Y);
        let (z, x) = axis.any_orthonormal_pair();
        let rings = 16;
        self.grid(rings, sectors, |ring, sector| {
            let angle = std::f32::consts::PI * (ring / rings as f32 - 0.5);
            let (end, radius) = if ring * 2.0 < rings as f32 { (from, radii[0]) } else { (to, radii[1]) };
            let around = std::f32::consts::TAU * sector / sectors as f32;
            let normal = axis * angle.sin() + (x * around.cos() + z * around.sin()) * angle.cos();
            (end + normal * radius, normal)
        });
    }

    /// A ring around +Y.
    pub(crate) fn torus(&mut self, middle: Vec3, radii: [f32; 2], steps: usize) {
        self.grid(steps, steps, |ring, sector| {
            let (sin, cos) = (std::f32::consts::TAU * sector / steps as f32).sin_cos();
            let (rise, reach) = (std::f32::consts::TAU * ring / steps as f32).sin_cos();
            let normal = Vec3::new(cos * reach, rise, sin * reach);
            (middle + Vec3::new(cos, 0.0, sin) * radii[0] + normal * radii[1], normal)
        });
    }

    fn grid(&mut self, rings: usize, sectors: usize, point: impl Fn(f32, f32) -> (Vec3, Vec3)) {
        let first = self.positions.len() as u32;
        for ring in 0..=rings {
            for sector in 0..=sectors {
                let (position, normal) = point(ring as f32, sector as f32);
                self.positions.push(position.to_array());
                self.normals.push(normal.to_array());
                self.uv.push([sector as f32 / sectors as f32, ring as f32 / rings as f32]);
            }
        }
        let across = sectors as u32 + 1;
        for ring in 0..rings as u32 {
            for sector in 0..sectors as u32 {
                let a = first + ring * across + sector;
                self.triangles.push([a, a + across, a + 1]);
                self.triangles.push([a + 1, a + across, a + across + 1]);
            }
        }
    }
}

/// A figure of capsules on a ring, and its bones.
pub(crate) fn figure() -> (Shape, Vec<[Vec3; 2]>) {
    let limbs: [([f32; 3], [f32; 3], [f32; 2]); 12] = [
        ([0.0, 0.98, 0.0], [0.0, 1.38, 0.01], [0.135, 0.16]),
        ([0.0, 1.38, 0.01], [0.0, 1.55, 0.02], [0.06, 0.055]),
        ([0.0, 1.66, 0.03], [0.0, 1.72, 0.03], [0.105, 0.11]),
        ([0.17, 1.40, 0.0], [0.42, 1.22, 0.05], [0.062, 0.05]),
        ([0.42, 1.22, 0.05], [0.60, 1.40, 0.18], [0.048, 0.036]),
        ([-0.17, 1.40, 0.0], [-0.38, 1.16, -0.04], [0.062, 0.05]),
        ([-0.38, 1.16, -0.04], [-0.46, 0.90, 0.06], [0.048, 0.036]),
        ([0.09, 0.95, 0.0], [0.14, 0.52, 0.10], [0.088, 0.066]),
        ([0.14, 0.52, 0.10], [0.15, 0.09, -0.02], [0.062, 0.045]),
        ([0.15, 0.055, -0.03], [0.17, 0.045, 0.14], [0.05, 0.042]),
        ([-0.09, 0.95, 0.0], [-0.16, 0.50, 0.02], [0.088, 0.066]),
        ([-0.16, 0.50, 0.02], [-0.19, 0.09, -0.10], [0.062, 0.045]),
    ];
    let mut shape = Shape::default();
    let mut bones = Vec::new();
    for (from, to, radii) in limbs {
        shape.capsule(from.into(), to.into(), radii, 24);
        bones.push([from.into(), to.into()]);
    }
    shape.torus(Vec3::new(-0.55, 0.06, 0.35), [0.16, 0.06], 36);
    (shape, bones)
}
