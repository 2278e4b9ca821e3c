//! The shaders in Rust, and a rasteriser around them: pictures on machines without a graphics adapter.

mod background;
mod mesh;
mod overlay;
mod present;
mod raster;
mod sampling;
mod tile;

use rayon::prelude::*;

use crate::bone_shape::bone_triangles;
use crate::contact_shadow::ContactShadow;
use crate::picture::{CPU_SIDE_LIMIT, check_size};
use crate::uniforms::Uniforms;
use crate::{Camera, MeshView, Picture, RenderError, Samples, Scene};

/// Draws a picture on the CPU. Equal input gives equal bytes on one machine, with any number of threads.
pub fn render_to_image_cpu(
    scene: &Scene,
    camera: &Camera,
    size: [u32; 2],
    samples: Samples,
) -> Result<Picture, RenderError> {
    check_size(size, CPU_SIDE_LIMIT)?;
    scene.validate(CPU_SIDE_LIMIT)?;
    let mut shadow = ContactShadow::default();
    shadow.update(&scene.mesh, &scene.ground);
    let uniforms = Uniforms::new(scene, camera, &shadow, size);
    let mut overlay = Vec::new();
    bone_triangles(scene.bones, scene.ground.radius, &mut overlay);

    let linear = sampling::LinearBytes::new();
    let paint = |material| {
        let texture = scene.mesh.texture_of(material).map(AsRef::as_ref);
        let base_color = scene.mesh.color_of(material, &scene.look);
        mesh::Paint { base_color, texture: sampling::TextureSampler { texture, linear: &linear } }
    };
    let paints: Vec<mesh::Paint> = scene.mesh.drawn_materials().iter().map(paint).collect();
    let paint_of = paint_of_triangles(&scene.mesh);
    let frame = tile::Frame {
        paint_of: &paint_of,
        paints: &paints,
        uniforms: &uniforms,
        shadow: &shadow,
        mesh: scene.mesh,
        skin: raster::project_mesh(&scene.mesh, &paint_of, &uniforms, size),
        bones: raster::project_overlay(&overlay, &uniforms, size),
        overlay: &overlay,
        samples,
        size,
    };
    let bins = tile::bin(&frame);
    let tiles: Vec<Vec<[u8; 4]>> =
        bins.par_iter().enumerate().map(|(index, bin)| frame.draw_tile(index, bin)).collect();
    Ok(Picture { width: size[0], height: size[1], rgba: tile::assemble(&tiles, size) })
}

/// The material of each triangle. Where parts overlap, the first one counts.
fn paint_of_triangles(mesh: &MeshView) -> Vec<u32> {
    let mut paint_of = vec![raster::UNPAINTED; mesh.triangles.len()];
    for (triangles, material) in mesh.drawn_parts() {
        let own = &mut paint_of[triangles.start as usize..triangles.end as usize];
        own.iter_mut().filter(|paint| **paint == raster::UNPAINTED).for_each(|paint| *paint = material as u32);
    }
    paint_of
}
