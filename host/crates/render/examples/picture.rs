//! Draws a figure of capsules with both renderers: `cargo run -p armature-render --example picture -- FOLDER`.

use std::path::PathBuf;

use armature_render::{
    BoneMark, Bounds, Camera, Gpu, Ground, MeshView, RenderError, Samples, Scene, encode_png, render_to_image_cpu,
    render_to_image_gpu,
};

#[path = "../tests/shapes/mod.rs"]
mod shapes;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| ".".into()));
    let (shape, bones) = shapes::figure();
    let bones: Vec<BoneMark> = bones
        .iter()
        .map(|[head, tail]| BoneMark { head: head.to_array(), tail: tail.to_array(), color: [0.98, 0.72, 0.25, 0.75] })
        .collect();
    let mesh = MeshView {
        positions: &shape.positions,
        normals: &shape.normals,
        triangles: &shape.triangles,
        ..MeshView::default()
    };
    let bounds = Bounds::of(&shape.positions).ok_or("the figure has no vertices")?;
    let scene = Scene { mesh, bones: &bones, ground: Ground::under(&bounds), ..Scene::default() };
    let size = [960, 640];
    let camera = Camera::fit(&bounds, size[0] as f32 / size[1] as f32);

    let start = std::time::Instant::now();
    let picture = render_to_image_cpu(&scene, &camera, size, Samples::Four)?;
    println!("CPU: {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
    std::fs::write(folder.join("picture-cpu.png"), encode_png(&picture)?)?;
    match Gpu::request() {
        Ok(gpu) => {
            let start = std::time::Instant::now();
            let picture = render_to_image_gpu(&gpu, &scene, &camera, size, gpu.best_samples())?;
            println!("{}: {:.1} ms", gpu.label(), start.elapsed().as_secs_f64() * 1e3);
            std::fs::write(folder.join("picture-gpu.png"), encode_png(&picture)?)?;
        }
        Err(error @ RenderError::NoAdapter { .. }) => println!("{error}"),
        Err(error) => return Err(error.into()),
    }
    Ok(())
}
