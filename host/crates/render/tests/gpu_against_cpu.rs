//! The same scene drawn by the shaders and by their twins.
//!
//! Without a graphics adapter these tests say so and pass; with `ARMATURE_REQUIRE_GPU` set they fail.

mod shapes;

use std::sync::Arc;

use armature_render::{
    Alpha, BoneMark, Bounds, Camera, Gpu, Ground, Map, Material, MeshPart, MeshView, Picture, RenderError, Samples,
    Scene, Wrap, render_to_image_cpu, render_to_image_gpu,
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

/// An image of 64×32 pixels; smooth, because some adapters filter between texels with fewer bits.
fn map(texel: impl Fn(u8, u8) -> [u8; 4]) -> Map {
    let rgba = (0..32).flat_map(|y| (0..64).map(move |x| [x, y])).flat_map(|[x, y]| texel(x, y)).collect();
    Map::repeating(Arc::new(Picture { width: 64, height: 32, rgba }))
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
    let highlight: Vec<f32> = shape.positions.iter().map(|p| (p[1] - 0.8).clamp(0.0, 1.0)).collect();
    let base_color_map = Some(map(|x, y| [x * 4, y * 8, 120, 255]));
    let materials = [Material { base_color_map, ..Material::default() }];
    let mesh = MeshView { uv: Some(&shape.uv), materials: &materials, highlight: Some(&highlight), ..mesh_of(&shape) };
    compare("texture", &Scene { mesh, ground, ..Scene::default() }, &camera);
}

#[test]
fn parts_with_materials_of_their_own() {
    let (shape, _) = shapes::figure();
    let (ground, camera) = standing(&shape);
    let base_color_map = Some(map(|x, y| [x * 4, y * 8, 120, 255]));
    let materials = [
        Material::of_color([0.9, 0.2, 0.1]),
        Material { base_color_map: base_color_map.clone(), ..Material::default() },
        Material { base_color_map, ..Material::of_color([0.3, 0.9, 0.4]) },
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
    let colors: Vec<[f32; 4]> =
        shape.positions.iter().map(|p| [p[1].clamp(0.0, 1.0), 0.5 - 0.5 * p[0].clamp(-1.0, 1.0), 0.2, 1.0]).collect();
    let scene = Scene { mesh: MeshView { colors: Some(&colors), ..mesh_of(&shape) }, ground, ..Scene::default() };
    compare("colours", &scene, &camera);
    let plain = Scene { mesh: mesh_of(&shape), ..scene };
    let draw = |scene| render_to_image_cpu(scene, &camera, SIZE, Samples::One).unwrap();
    assert!(difference(&draw(&scene), &draw(&plain)).visible > 0.02, "colours must be visible");
}

/// A wave of normals: x and y as the slope of the surface.
fn bumps(x: u8, y: u8) -> [u8; 4] {
    let slope = |at: u8, period: f32| 127.5 + 50.0 * (std::f32::consts::TAU * f32::from(at) / period).sin();
    [slope(x, 32.0) as u8, slope(y, 16.0) as u8, 220, 255]
}

#[test]
fn metals_bumps_and_lamps() {
    let (shape, _) = shapes::figure();
    let (ground, camera) = standing(&shape);
    let draw = |material: &Material| {
        let materials = std::slice::from_ref(material);
        let mesh = MeshView { uv: Some(&shape.uv), materials, ..mesh_of(&shape) };
        let scene = Scene { mesh, ground, ..Scene::default() };
        compare("material", &scene, &camera);
        render_to_image_cpu(&scene, &camera, SIZE, Samples::One).unwrap()
    };
    let gold = Material { metallic: 1.0, roughness: 0.3, ..Material::of_color([1.0, 0.8, 0.35]) };
    let plain = draw(&Material { metallic: 0.0, ..gold.clone() });
    let changed = |what: &str, material: Material| {
        let picture = draw(&material);
        assert!(difference(&picture, &plain).visible > 0.02, "{what} must be visible");
        picture
    };
    changed("metal", gold.clone());
    changed("mirror", Material { roughness: 0.0, ..gold.clone() });
    let metallic_roughness_map = Some(map(|x, y| [0, 40 + y * 6, x * 4, 255]));
    changed("metal in places", Material { roughness: 1.0, metallic_roughness_map, ..gold.clone() });
    let bumpy = Material { normal_map: Some(map(bumps)), ..gold.clone() };
    let bumpy = Material { metallic: 0.0, ..bumpy };
    changed("bumps", bumpy.clone());
    changed("shallow bumps", Material { normal_scale: 0.4, ..bumpy });
    changed("light", Material { emissive: [0.0, 0.4, 1.2], metallic: 0.0, ..gold.clone() });
    let emissive_map = Some(map(|x, y| [x * 4, 0, y * 8, 255]));
    changed("light in places", Material { emissive: [1.0; 3], emissive_map, metallic: 0.0, ..gold.clone() });
    let paper = changed("unlit", Material { unlit: true, base_color: Some([0.25, 0.25, 0.25, 1.0]), ..gold });
    let middle = (SIZE[1] / 2 * SIZE[0] + SIZE[0] / 2) as usize * 4;
    assert!(paper.rgba[middle].abs_diff(137) <= 1, "0.25 is 137 in sRGB, not {}", paper.rgba[middle]);
}

/// A normal map that says the same everywhere turns the light as a tilted surface does, wherever texture coordinates
/// run.
#[test]
fn a_normal_map_tilts_the_surface() {
    let positions = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    let triangles = [[0, 1, 2], [0, 2, 3]];
    // Upright, mirrored, and lying on its side.
    let upright = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
    let mirrored = upright.map(|[u, v]| [1.0 - u, v]);
    let on_its_side = upright.map(|[u, v]| [v, 1.0 - u]);
    let camera = Camera { target: Vec3::ZERO, yaw: 0.0, pitch: 0.0, distance: 4.0, ..Camera::default() };
    let color = |uv: &[[f32; 2]; 4], normal: [f32; 3], map: Option<Map>| {
        let materials = [Material { normal_map: map, roughness: 1.0, ..Material::of_color([0.7; 3]) }];
        let normals = [normal; 4];
        let mesh = MeshView { positions: &positions, normals: &normals, triangles: &triangles, ..MeshView::default() };
        let mesh = MeshView { uv: Some(uv), materials: &materials, ..mesh };
        let scene = Scene { mesh, ..Scene::default() };
        if materials[0].normal_map.is_some() {
            compare("tilt", &scene, &camera);
        }
        let picture = render_to_image_cpu(&scene, &camera, [64, 64], Samples::One).unwrap();
        <[u8; 3]>::try_from(&picture.rgba[(32 * 64 + 32) * 4..][..3]).unwrap()
    };
    // Bytes for a slope of a third to the image's right, and one upwards.
    let length = (1.0_f32 + 1.0 / 9.0).sqrt();
    let byte = |c: f32| (127.5 + 127.5 * c / length).round() as u8;
    let [right, up] = [[byte(1.0 / 3.0), 128, byte(1.0), 255], [128, byte(1.0 / 3.0), byte(1.0), 255]];
    let [to_right, to_left] = [[1.0 / 3.0, 0.0, 1.0], [-1.0 / 3.0, 0.0, 1.0]].map(|n: [f32; 3]| n.map(|c| c / length));
    let upwards = [0.0, 1.0 / 3.0, 1.0].map(|c: f32| c / length);
    for (uv, texel, normal) in [
        (&upright, right, to_right),
        (&upright, up, upwards),
        (&mirrored, right, to_left),
        (&mirrored, up, upwards),
        // Its right is down on the surface, and its up is right.
        (&on_its_side, up, to_right),
    ] {
        let mapped = color(uv, [0.0, 0.0, 1.0], Some(map(|_, _| texel)));
        let tilted = color(uv, normal, None);
        assert!(mapped.iter().zip(tilted).all(|(a, b)| a.abs_diff(b) <= 2), "{texel:?}: {mapped:?}, not {tilted:?}");
    }
}

#[test]
fn glass_holes_and_backs() {
    let (shape, _) = shapes::figure();
    let (ground, camera) = standing(&shape);
    let draw = |material: &Material| {
        let materials = [material.clone(), Material::of_color([0.2, 0.3, 0.9])];
        let count = shape.triangles.len() as u32;
        let part = |first, end, material| MeshPart { triangles: first..end, material };
        let parts = [part(0, count / 2, 0), part(count / 2, count * 3 / 4, 1), part(count * 3 / 4, count, 0)];
        let mesh = MeshView { uv: Some(&shape.uv), materials: &materials, parts: &parts, ..mesh_of(&shape) };
        let scene = Scene { mesh, ground, ..Scene::default() };
        compare("opacity", &scene, &Camera { yaw: 2.2, ..camera });
        render_to_image_cpu(&scene, &camera, SIZE, Samples::One).unwrap()
    };
    let red = Material::of_color([0.9, 0.3, 0.2]);
    let solid = draw(&red);
    let half = Material { base_color: Some([0.8, 0.1, 0.05, 0.5]), ..red.clone() };
    let glass = draw(&Material { alpha: Alpha::Blend, ..half.clone() });
    assert!(difference(&glass, &solid).visible > 0.02, "glass must be visible");
    let opaque = draw(&half);
    let masked = draw(&Material { alpha: Alpha::Mask { cutoff: 0.5 }, ..half.clone() });
    assert_eq!(masked, opaque, "what reaches the cutoff is opaque");
    let nothing = draw(&Material { alpha: Alpha::Mask { cutoff: 0.51 }, ..half.clone() });
    assert!(difference(&nothing, &opaque).visible > 0.02);
    let clear = draw(&Material { alpha: Alpha::Blend, base_color: Some([0.8, 0.1, 0.05, 0.0]), ..red.clone() });
    assert!(difference(&clear, &nothing).visible < 1e-3, "what is clear and what is cut away look the same");
    // Waves of opacity, so that the edge of the holes is a curve.
    let base_color_map = Some(map(|x, _| [255, 255, 255, bumps(x, 0)[0]]));
    let holes = Material { alpha: Alpha::Mask { cutoff: 0.5 }, base_color_map, ..red.clone() };
    assert!(difference(&draw(&holes), &solid).visible > 0.02);
    draw(&Material { alpha: Alpha::Blend, double_sided: false, ..holes.clone() });
    // Through the holes, the far side is seen from within.
    assert!(difference(&draw(&Material { double_sided: false, ..holes.clone() }), &draw(&holes)).visible > 0.005);
    assert_eq!(draw(&Material { double_sided: false, ..red }), solid, "backs of closed surfaces are never seen");
}

#[test]
fn maps_wrap_alike() {
    let (shape, _) = shapes::figure();
    let (ground, camera) = standing(&shape);
    let uv: Vec<[f32; 2]> = shape.uv.iter().map(|[u, v]| [3.0 * u - 1.2, 2.0 * v - 0.6]).collect();
    for wrap in [[Wrap::Repeat, Wrap::Mirror], [Wrap::Mirror, Wrap::Clamp], [Wrap::Clamp, Wrap::Repeat]] {
        // Without a jump where it repeats.
        let smooth = map(|x, y| [bumps(x, y)[0], bumps(x, y)[1], 120, 255]);
        let base_color_map = Some(Map { wrap, ..smooth });
        let materials = [Material { base_color_map, ..Material::default() }];
        let mesh = MeshView { uv: Some(&uv), materials: &materials, ..mesh_of(&shape) };
        compare("wrap", &Scene { mesh, ground, ..Scene::default() }, &camera);
    }
}

/// An image with many more texels than the picture has pixels.
#[test]
fn fine_maps_are_averaged_alike() {
    let (shape, _) = shapes::figure();
    let (ground, camera) = standing(&shape);
    let uv: Vec<[f32; 2]> = shape.uv.iter().map(|[u, v]| [2.0 * u, 2.0 * v]).collect();
    let side = 1024;
    let squares = (0..side).flat_map(|y| (0..side).map(move |x| (x + y) % 2 == 0));
    let rgba = squares.flat_map(|white| if white { [255, 255, 255, 255] } else { [0, 0, 0, 255] }).collect();
    let picture = Arc::new(Picture { width: side, height: side, rgba });
    let drawn = |base_color_map: Option<Map>, base_color| {
        let materials = [Material { base_color, base_color_map, unlit: true, ..Material::default() }];
        let mesh = MeshView { uv: Some(&uv), materials: &materials, ..mesh_of(&shape) };
        let scene = Scene { mesh, ground, ..Scene::default() };
        compare("fine map", &scene, &camera);
        render_to_image_cpu(&scene, &camera, SIZE, Samples::One).expect("a picture")
    };
    let fine = drawn(Some(Map::repeating(picture)), Some([1.0; 4]));
    let even = drawn(None, Some([0.5, 0.5, 0.5, 1.0]));
    let apart = difference(&fine, &even);
    assert!(apart.mean < 0.5, "the squares are seen, not their mean: {apart:?}");
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
