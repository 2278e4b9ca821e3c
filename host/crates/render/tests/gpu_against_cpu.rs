//! The same scene drawn by the shaders and by their twins.
//!
//! Without a graphics adapter these tests say so and pass; with `ARMATURE_REQUIRE_GPU` set they fail.

mod shapes;

use std::sync::Arc;

use armature_render::{
    BoneMark, Bounds, Camera, Gpu, Ground, Material, MeshPart, MeshView, Picture, RenderError, Samples, Scene,
    render_to_image_cpu, render_to_image_gpu,
};
use glam::Vec3;

const SIZE: [u32; 2] = [320, 240];

fn adapter() -> Option<Gpu> {
    match Gpu::request() {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            assert!(std::env::var_os("ARMATURE_REQUIRE_GPU").is_none(), "ARMATURE_REQUIRE_GPU is set, but {error}");
            eprintln!("SKIPPED: the shaders are not compared with their twins: {error}");
            None
        }
    }
}

/// How far two pictures are apart, in steps of 255.
#[derive(Debug)]
struct Difference {
    mean: f64,
    /// Share of pixels that differ by more than 3 in some channel.
    visible: f64,
}

fn difference(a: &Picture, b: &Picture) -> Difference {
    assert_eq!((a.width, a.height, a.rgba.len()), (b.width, b.height, b.rgba.len()));
    let steps: Vec<u8> = a.rgba.iter().zip(&b.rgba).map(|(a, b)| a.abs_diff(*b)).collect();
    let mean = steps.iter().map(|&s| f64::from(s)).sum::<f64>() / steps.len() as f64;
    let visible = steps.chunks_exact(4).filter(|pixel| pixel.iter().any(|&s| s > 3)).count();
    Difference { mean, visible: visible as f64 / (steps.len() / 4) as f64 }
}

fn compare(name: &str, scene: &Scene, camera: &Camera) {
    let Some(gpu) = adapter() else { return };
    for samples in [Samples::One, gpu.best_samples()] {
        let by_gpu = render_to_image_gpu(&gpu, scene, camera, SIZE, samples).expect("a picture");
        let by_cpu = render_to_image_cpu(scene, camera, SIZE, samples).expect("a picture");
        let apart = difference(&by_gpu, &by_cpu);
        eprintln!("{name}, {samples:?}, {}: {apart:?}", gpu.label());
        // Within areas both agree to rounding; a few edge pixels fall to the other side.
        assert!(apart.mean < 0.25 && apart.visible < 0.004, "{name}, {samples:?}: {apart:?}");
    }
}

fn mesh_of(shape: &shapes::Shape) -> MeshView<'_> {
    MeshView {
        positions: &shape.positions,
        normals: &shape.normals,
        triangles: &shape.triangles,
        ..MeshView::default()
    }
}

fn standing(shape: &shapes::Shape) -> (Ground, Camera) {
    let bounds = Bounds::of(&shape.positions).expect("vertices");
    (Ground::under(&bounds), Camera::fit(&bounds, SIZE[0] as f32 / SIZE[1] as f32))
}

#[test]
fn an_empty_stage() {
    compare("level", &Scene::default(), &Camera::default());
    compare("from above", &Scene::default(), &Camera { pitch: 1.2, ..Camera::default() });
    compare("from below", &Scene::default(), &Camera { pitch: -0.7, ..Camera::default() });
}

#[test]
fn a_figure_from_all_sides() {
    let (shape, _) = shapes::figure();
    let (ground, camera) = standing(&shape);
    let scene = Scene { mesh: mesh_of(&shape), ground, ..Scene::default() };
    for step in 0_u8..4 {
        compare("figure", &scene, &Camera { yaw: 0.3 + f32::from(step) * 1.5, ..camera });
    }
}

#[test]
fn bones_through_the_skin() {
    let (shape, bones) = shapes::figure();
    let (ground, camera) = standing(&shape);
    let bones: Vec<BoneMark> = bones
        .iter()
        .map(|[head, tail]| BoneMark { head: head.to_array(), tail: tail.to_array(), color: [1.0, 0.7, 0.2, 0.6] })
        .collect();
    compare("bones", &Scene { mesh: mesh_of(&shape), bones: &bones, ground, ..Scene::default() }, &camera);
}

#[test]
fn texture_and_highlight() {
    let (shape, _) = shapes::figure();
    let (ground, camera) = standing(&shape);
    // Smooth, because some adapters filter between texels with fewer bits.
    let rgba: Vec<u8> = (0..64_u32 * 32).flat_map(|i| [(i % 64 * 4) as u8, (i / 64 * 8) as u8, 120, 255]).collect();
    let highlight: Vec<f32> = shape.positions.iter().map(|p| (p[1] - 0.8).clamp(0.0, 1.0)).collect();
    let materials = [Material { texture: Some(Arc::new(Picture { width: 64, height: 32, rgba })), base_color: None }];
    let mesh = MeshView { uv: Some(&shape.uv), materials: &materials, highlight: Some(&highlight), ..mesh_of(&shape) };
    compare("texture", &Scene { mesh, ground, ..Scene::default() }, &camera);
}

#[test]
fn parts_with_materials_of_their_own() {
    let (shape, _) = shapes::figure();
    let (ground, camera) = standing(&shape);
    let rgba = (0..64_u32 * 32).flat_map(|i| [(i % 64 * 4) as u8, (i / 64 * 8) as u8, 120, 255]).collect();
    let texture = Some(Arc::new(Picture { width: 64, height: 32, rgba }));
    let materials = [
        Material { base_color: Some([0.9, 0.2, 0.1]), texture: None },
        Material { base_color: None, texture: texture.clone() },
        Material { base_color: Some([0.3, 0.9, 0.4]), texture },
    ];
    let count = shape.triangles.len() as u32;
    let part = |first, end, material| MeshPart { triangles: first..end, material };
    let parts = [part(0, count / 4, 2), part(count / 4, count / 2, 0), part(count / 2, count, 1)];
    let mesh = MeshView { uv: Some(&shape.uv), materials: &materials, parts: &parts, ..mesh_of(&shape) };
    let scene = Scene { mesh, ground, ..Scene::default() };
    compare("parts", &scene, &camera);
    let draw = |parts: &[MeshPart]| {
        let scene = Scene { mesh: MeshView { parts, ..mesh }, ..scene };
        render_to_image_cpu(&scene, &camera, SIZE, Samples::One).unwrap()
    };
    let all = draw(&parts);
    // Each part shows its own material, the first one counts where they overlap, and omitted parts are gone.
    for k in 0..3 {
        let mut other = parts.clone();
        other[k].material = (other[k].material + 1) % 3;
        assert!(difference(&all, &draw(&other)).visible > 0.005, "part {k}");
    }
    let twice = [&parts[..], &[part(0, count, 0)]].concat();
    assert_eq!(draw(&twice), all);
    compare("overlapping parts", &Scene { mesh: MeshView { parts: &twice, ..mesh }, ..scene }, &camera);
    assert!(difference(&all, &draw(&parts[..2])).visible > 0.02);
    compare("some parts", &Scene { mesh: MeshView { parts: &parts[..2], ..mesh }, ..scene }, &camera);
    // One part with everything is the same as no parts.
    assert_eq!(draw(&[part(0, count, 0)]), draw(&[]));
}

#[test]
fn colours_of_vertices() {
    let (shape, _) = shapes::figure();
    let (ground, camera) = standing(&shape);
    let colors: Vec<[f32; 3]> =
        shape.positions.iter().map(|p| [p[1].clamp(0.0, 1.0), 0.5 - 0.5 * p[0].clamp(-1.0, 1.0), 0.2]).collect();
    let scene = Scene { mesh: MeshView { colors: Some(&colors), ..mesh_of(&shape) }, ground, ..Scene::default() };
    compare("colours", &scene, &camera);
    let plain = Scene { mesh: mesh_of(&shape), ..scene };
    let draw = |scene| render_to_image_cpu(scene, &camera, SIZE, Samples::One).unwrap();
    assert!(difference(&draw(&scene), &draw(&plain)).visible > 0.02, "colours must be visible");
}

#[test]
fn an_eye_inside_the_figure() {
    let (shape, _) = shapes::figure();
    let (ground, camera) = standing(&shape);
    let scene = Scene { mesh: mesh_of(&shape), ground, ..Scene::default() };
    compare("inside", &scene, &Camera { target: Vec3::new(0.0, 1.2, 0.0), distance: 0.05, ..camera });
}

#[test]
fn hostile_numbers_are_survived_by_both() {
    let (mut shape, _) = shapes::figure();
    let (ground, camera) = standing(&shape);
    for (index, position) in shape.positions.iter_mut().enumerate().step_by(37) {
        *position = [[f32::NAN; 3], [f32::INFINITY, 0.0, 0.0], [1e38, -1e38, 1e38], [0.0; 3]][index % 4];
    }
    let scene = Scene { mesh: mesh_of(&shape), ground, ..Scene::default() };
    let picture = render_to_image_cpu(&scene, &camera, SIZE, Samples::Four).unwrap();
    assert_eq!(picture.rgba.len(), 4 * 320 * 240);
    let nowhere = Camera { target: Vec3::NAN, distance: f32::INFINITY, ..camera };
    render_to_image_cpu(&scene, &nowhere, SIZE, Samples::Four).unwrap();
    if let Some(gpu) = adapter() {
        render_to_image_gpu(&gpu, &scene, &camera, SIZE, gpu.best_samples()).unwrap();
        render_to_image_gpu(&gpu, &scene, &nowhere, SIZE, gpu.best_samples()).unwrap();
    }
}

#[test]
fn impossible_sizes_are_errors() {
    for size in [[0, 10], [10, 0], [u32::MAX, 10]] {
        let result = render_to_image_cpu(&Scene::default(), &Camera::default(), size, Samples::One);
        assert!(matches!(result, Err(RenderError::BadSize { .. })));
        if let Some(gpu) = adapter() {
            let result = render_to_image_gpu(&gpu, &Scene::default(), &Camera::default(), size, Samples::One);
            assert!(matches!(result, Err(RenderError::BadSize { .. })));
        }
    }
}

#[test]
fn the_twin_draws_the_same_picture_every_time() {
    let (shape, _) = shapes::figure();
    let (ground, camera) = standing(&shape);
    let scene = Scene { mesh: mesh_of(&shape), ground, ..Scene::default() };
    let draw = || render_to_image_cpu(&scene, &camera, [200, 150], Samples::Four).unwrap();
    assert_eq!(draw(), draw());
}

#[test]
fn a_triangle_looks_the_same_however_it_is_wound() {
    let (shape, _) = shapes::figure();
    let (ground, camera) = standing(&shape);
    let turned: Vec<[u32; 3]> = shape.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    let scene = Scene { mesh: mesh_of(&shape), ground, ..Scene::default() };
    let inside_out = Scene { mesh: MeshView { triangles: &turned, ..scene.mesh }, ..scene };
    let draw = |scene| render_to_image_cpu(scene, &camera, SIZE, Samples::One).unwrap();
    let apart = difference(&draw(&scene), &draw(&inside_out));
    assert!(apart.mean < 0.01, "{apart:?}");
    compare("inside out", &inside_out, &camera);
}
