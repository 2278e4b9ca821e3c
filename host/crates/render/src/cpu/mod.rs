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
use crate::material::MAP_IS_SRGB;
use crate::picture::{CPU_SIDE_LIMIT, check_size};
use crate::scene::NO_MATERIAL;
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

    let bytes = sampling::Bytes::new();
    let has_maps = scene.mesh.uv.is_some();
    let mut levels = sampling::Levels::default();
    for (map, is_srgb) in
        scene.mesh.drawn_materials().iter().flat_map(|material| material.maps().into_iter().zip(MAP_IS_SRGB))
    {
        map.filter(|_| has_maps).into_iter().for_each(|map| levels.make(map, is_srgb));
    }
    let materials = scene.mesh.drawn_materials().iter().zip(scene.mesh.material_uniforms(&scene.look));
    let paints: Vec<mesh::Paint> = materials
        .map(|(material, uniforms)| {
            let maps = material.maps().map(|map| map.filter(|_| has_maps));
            let maps = std::array::from_fn(|map| bytes.sampler(maps[map], &levels, MAP_IS_SRGB[map]));
            mesh::Paint { material: uniforms, maps }
        })
        .collect();
    let paint_of = scene.mesh.material_of_triangles();
    let (opaque, blended) = drawing_order(&scene.mesh, camera, &paint_of);
    let frame = tile::Frame {
        paint_of: &paint_of,
        paints: &paints,
        uniforms: &uniforms,
        shadow: &shadow,
        mesh: scene.mesh,
        skin: raster::project_mesh(&scene.mesh, &opaque, &uniforms, size),
        blended: raster::project_mesh(&scene.mesh, &blended, &uniforms, size),
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

/// The triangles that hide what is behind them, and those that are blended over it, the farthest first.
fn drawing_order(mesh: &MeshView, camera: &Camera, material_of: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let drawn = (0..).zip(material_of).filter(|(_, material)| **material != NO_MATERIAL);
    let (blended, opaque): (Vec<_>, Vec<_>) = drawn.partition(|(_, material)| mesh.is_blended(**material));
    let mut by_distance: Vec<(f32, u32)> = blended.into_iter().map(|(triangle, _)| (0.0, triangle)).collect();
    mesh.sort_farthest_first(camera, &mut by_distance);
    let opaque = opaque.into_iter().map(|(triangle, _)| triangle).collect();
    (opaque, by_distance.into_iter().map(|(_, triangle)| triangle).collect())
}
