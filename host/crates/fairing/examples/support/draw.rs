//! A small renderer: shaded triangles with smooth normals, from one side, into a PNG.

use std::error::Error;
use std::path::Path;

use armature_geometry::TriangleMesh;
use armature_geometry::surface::{NormalWeighting, vertex_normals};
use glam::DVec3;

/// What the surface looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Paint {
    /// Matt.
    Clay,
    /// Reflection lines of stripes around the surface.
    Lines,
}

/// One picture of a row. Triangles from `patch_from` on have another colour.
#[derive(Debug)]
pub(crate) struct View {
    pub(crate) mesh: TriangleMesh,
    pub(crate) patch_from: usize,
    pub(crate) paint: Paint,
    pub(crate) yaw: f64,
    pub(crate) pitch: f64,
}

const SIDE: usize = 420;
/// Samples along a pixel's side.
const FINE: usize = 2;

/// Draws views side by side.
pub(crate) fn write_row(path: &Path, views: &[View]) -> Result<(), Box<dyn Error>> {
    let width = SIDE * views.len();
    let mut pixels = vec![0_u8; 3 * width * SIDE];
    for (index, view) in views.iter().enumerate() {
        let picture = draw(view)?;
        for (row, line) in picture.chunks(3 * SIDE).enumerate() {
            let start = 3 * (row * width + index * SIDE);
            pixels[start..start + 3 * SIDE].copy_from_slice(line);
        }
    }
    let file = std::io::BufWriter::new(std::fs::File::create(path)?);
    let mut encoder = png::Encoder::new(file, width as u32, SIDE as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header()?.write_image_data(&pixels)?;
    println!("{}", path.display());
    Ok(())
}

fn draw(view: &View) -> Result<Vec<u8>, Box<dyn Error>> {
    let turn = |p: DVec3| {
        let (s, c) = view.yaw.sin_cos();
        let q = DVec3::new(c * p.x - s * p.z, p.y, s * p.x + c * p.z);
        let (s, c) = view.pitch.sin_cos();
        DVec3::new(q.x, c * q.y - s * q.z, s * q.y + c * q.z)
    };
    let places: Vec<DVec3> = view.mesh.vertices.iter().map(|&p| turn(p.into())).collect();
    let normals = vertex_normals(&view.mesh, NormalWeighting::Angle)?;
    let normals: Vec<DVec3> = normals.into_iter().map(|n| turn(n.into())).collect();
    let used = || view.mesh.triangles.iter().flatten().map(|&v| places[v as usize]);
    let (low, high) = used().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let side = SIDE * FINE;
    let scale = 0.92 * side as f64 / (high.x - low.x).max(high.y - low.y);
    let centre = 0.5 * (low + high);
    let on_screen = |p: DVec3| {
        let half = 0.5 * side as f64;
        DVec3::new(half + scale * (p.x - centre.x), half - scale * (p.y - centre.y), p.z)
    };
    let mut depth = vec![f64::NEG_INFINITY; side * side];
    let mut colours = vec![DVec3::splat(1.0); side * side];
    for (index, t) in view.mesh.triangles.iter().enumerate() {
        let [a, b, c] = t.map(|v| on_screen(places[v as usize]));
        let area = (b - a).truncate().perp_dot((c - a).truncate());
        if area.abs() < 1e-12 {
            continue;
        }
        let range = |x: [f64; 3]| {
            let (l, h) = (x[0].min(x[1]).min(x[2]), x[0].max(x[1]).max(x[2]));
            l.floor().max(0.0) as usize..(h.ceil().max(0.0) as usize).min(side)
        };
        for y in range([a.y, b.y, c.y]) {
            for x in range([a.x, b.x, c.x]) {
                let p = glam::DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let weight = |q: DVec3, r: DVec3| (q.truncate() - p).perp_dot(r.truncate() - p) / area;
                let w = [weight(b, c), weight(c, a), weight(a, b)];
                let z = w[0] * a.z + w[1] * b.z + w[2] * c.z;
                if w.iter().all(|&w| w >= -1e-9) && z > depth[y * side + x] {
                    depth[y * side + x] = z;
                    let normal = (0..3).map(|k| normals[t[k] as usize] * w[k]).sum::<DVec3>().normalize_or_zero();
                    colours[y * side + x] = colour(normal, index >= view.patch_from && view.patch_from > 0, view.paint);
                }
            }
        }
    }
    let mut pixels = Vec::with_capacity(3 * SIDE * SIDE);
    for y in 0..SIDE {
        for x in 0..SIDE {
            let block = (0..FINE).flat_map(|j| (0..FINE).map(move |i| (FINE * y + j) * side + FINE * x + i));
            let mean = block.map(|k| colours[k]).sum::<DVec3>() / (FINE * FINE) as f64;
            pixels.extend(mean.to_array().map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8));
        }
    }
    Ok(pixels)
}

fn colour(normal: DVec3, patch: bool, paint: Paint) -> DVec3 {
    let base = if patch { DVec3::new(0.95, 0.78, 0.35) } else { DVec3::new(0.62, 0.70, 0.80) };
    let facing = if normal.z < 0.0 { -normal } else { normal };
    let inside = if normal.z < 0.0 { 0.55 } else { 1.0 };
    if paint == Paint::Lines {
        // The direction of sight, reflected, meets stripes along x.
        let reflected = 2.0 * facing.z * facing - DVec3::Z;
        let stripe = (14.0 * reflected.y.atan2(reflected.z.abs() + 0.3)).sin();
        return if stripe > 0.0 { DVec3::splat(0.97) } else { DVec3::splat(0.12) }
            * if patch { base } else { DVec3::ONE };
    }
    let light = DVec3::new(-0.4, 0.6, 0.7).normalize();
    base * inside * (0.35 + 0.65 * facing.dot(light).max(0.0))
}
