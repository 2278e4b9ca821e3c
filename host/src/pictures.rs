//! Pictures of a character in a pose, without a window.

use std::path::Path;

use armature_render::{Bounds, Camera, Gpu, Ground, MeshView, Picture, RenderError, Samples, Scene, TextureView};

use armature_rig::Pose;
use glam::Affine3A;

use crate::engine::actor::{Actor, Shape};
use crate::failure::Failure;
use crate::files;

/// From where a character is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Radians about +Y; 0 looks into the character's face, a quarter turn onto its left side.
    pub yaw: f32,
    /// Radians above the horizon.
    pub pitch: f32,
    /// Part of the distance that has room to turn the character round.
    pub closer: f32,
    /// Height of the floor (mesh units); `None`: under the character.
    pub floor: Option<f32>,
}

impl Default for View {
    fn default() -> Self {
        // The fit leaves room to turn a character round; a picture does not need it.
        Self { size: [1280, 960], yaw: 0.55, pitch: 0.13, closer: 0.8, floor: None }
    }
}

/// How the picture came about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DrawnBy {
    /// On this graphics adapter.
    Adapter(String),
    /// By the CPU, because there is no adapter; with what wgpu says and what to install.
    Cpu(String),
}

impl std::fmt::Display for DrawnBy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Adapter(name) => write!(f, "drawn by {name}"),
            Self::Cpu(reason) => write!(f, "drawn by the CPU: {reason}"),
        }
    }
}

/// Draws a character with these skinned positions and normals and writes a PNG.
pub fn write_picture(
    path: &Path,
    actor: &Actor,
    positions: &[[f32; 3]],
    normals: &[[f32; 3]],
) -> Result<DrawnBy, Failure> {
    let Some(shape) = &actor.shape else {
        let what = format!("{} has no mesh, so there is nothing to draw", actor.name);
        return Err(Failure::usage(what, "choose a character with a mesh, such as human"));
    };
    let failed = |error: RenderError| Failure::not_converged(format!("{}: {error}", path.display()), "");
    let (picture, by) = draw(shape, positions, normals, &View::default()).map_err(failed)?;
    files::write(path, &armature_render::encode_png(&picture).map_err(failed)?)?;
    Ok(by)
}

/// Positions and unit normals, n×3 each.
pub type Skinned = (Vec<[f32; 3]>, Vec<[f32; 3]>);

/// Skins a character in one pose.
pub fn skin_once(actor: &Actor, pose: &Pose) -> Result<Skinned, Failure> {
    let (Some(shape), Some(mut skin)) = (&actor.shape, actor.precompute_skin()?) else { return Ok(Skinned::default()) };
    let mut model_from_bone = vec![Affine3A::IDENTITY; actor.skeleton.len()];
    pose.forward_kinematics(&actor.skeleton, &mut model_from_bone);
    let (mut positions, mut normals) = (shape.positions.clone(), shape.normals.clone());
    skin.solve(&model_from_bone, &mut positions, &mut normals)
        .map_err(|e| Failure::input(e.to_string(), "choose another moment of the take"))?;
    Ok((positions, normals))
}

/// Draws a mesh with these positions and normals.
pub fn draw(
    shape: &Shape,
    positions: &[[f32; 3]],
    normals: &[[f32; 3]],
    view: &View,
) -> Result<(Picture, DrawnBy), RenderError> {
    let texture = shape.texture.as_ref();
    let mesh = MeshView {
        positions,
        normals,
        triangles: &shape.triangles,
        uv: Some(shape.uv.as_slice()).filter(|uv| !uv.is_empty()),
        texture: texture.map(|t| TextureView { width: t.width, height: t.height, rgba: &t.rgba }),
        base_color: shape.base_color,
        ..MeshView::default()
    };
    draw_mesh(&mesh, view)
}

/// Draws a mesh on its floor.
pub fn draw_mesh(mesh: &MeshView, view: &View) -> Result<(Picture, DrawnBy), RenderError> {
    let bounds = Bounds::of(mesh.positions).unwrap_or(Bounds { min: glam::Vec3::ZERO, max: glam::Vec3::ONE });
    let ground = Ground { height: view.floor.unwrap_or(bounds.min.y), ..Ground::under(&bounds) };
    let scene = Scene { mesh: *mesh, ground, ..Scene::default() };
    let mut camera = Camera::fit(&bounds, view.size[0] as f32 / view.size[1] as f32);
    camera.yaw = view.yaw;
    camera.pitch = view.pitch;
    camera.distance *= view.closer;
    draw_scene(&scene, &camera, view.size)
}

/// Draws a scene on a graphics adapter, or on the CPU where there is none.
pub fn draw_scene(scene: &Scene, camera: &Camera, size: [u32; 2]) -> Result<(Picture, DrawnBy), RenderError> {
    match Gpu::request() {
        Ok(gpu) => {
            let picture = armature_render::render_to_image_gpu(&gpu, scene, camera, size, Samples::Four)?;
            Ok((picture, DrawnBy::Adapter(gpu.label())))
        }
        Err(error @ (RenderError::NoAdapter { .. } | RenderError::NoDevice { .. })) => {
            let picture = armature_render::render_to_image_cpu(scene, camera, size, Samples::Four)?;
            Ok((picture, DrawnBy::Cpu(error.to_string())))
        }
        Err(error) => Err(error),
    }
}
