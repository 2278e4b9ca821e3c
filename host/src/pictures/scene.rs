//! Pictures of a scene: on a graphics adapter, or on the CPU if there is none.

use armature_render::{Bounds, Camera, Ground, MeshView, Picture, RenderError, Samples, Scene};

/// Where a character is viewed from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Radians about +Y; 0 looks into the character's face, a quarter turn onto its left side.
    pub yaw: f32,
    /// Radians above the horizon.
    pub pitch: f32,
    /// Fraction of the fitted distance, which leaves space for turning the character; never so close that any of it is cut
    /// off.
    pub closer: f32,
    /// Height of the floor (mesh units); `None`: under the character.
    pub floor: Option<f32>,
}

impl Default for View {
    fn default() -> Self {
        // The fit leaves space for turning a character; a picture does not need it.
        Self { size: [1280, 960], yaw: 0.55, pitch: 0.13, closer: 0.8, floor: None }
    }
}

/// How the picture was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DrawnBy {
    /// On this graphics adapter.
    Adapter(String),
    /// By the CPU, because there is no adapter or the program was built without graphics; with what to do about it.
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

/// Draws a mesh on its floor.
pub fn draw_mesh(mesh: &MeshView, view: &View) -> Result<(Picture, DrawnBy), RenderError> {
    let bounds = Bounds::of(mesh.positions).unwrap_or(Bounds { min: glam::Vec3::ZERO, max: glam::Vec3::ONE });
    let ground = Ground { height: view.floor.unwrap_or(bounds.min.y), ..Ground::under(&bounds) };
    let scene = Scene { mesh: *mesh, ground, ..Scene::default() };
    draw_scene(&scene, &camera_of(mesh.positions, view), view.size)
}

/// The camera of [`draw_mesh`].
pub(super) fn camera_of(positions: &[[f32; 3]], view: &View) -> Camera {
    let bounds = Bounds::of(positions).unwrap_or(Bounds { min: glam::Vec3::ZERO, max: glam::Vec3::ONE });
    let mut camera = Camera::fit(&bounds, view.size[0] as f32 / view.size[1] as f32);
    camera.yaw = view.yaw;
    camera.pitch = view.pitch;
    camera.distance = (camera.distance * view.closer).max(MARGIN * closest(positions, &camera, view.size));
    camera
}

/// Space around what is drawn.
const MARGIN: f32 = 1.04;

/// From how far away a camera that looks like this sees everything.
fn closest(positions: &[[f32; 3]], camera: &Camera, size: [u32; 2]) -> f32 {
    let half_y = (0.5 * camera.fov_y).tan();
    let half_x = half_y * size[0] as f32 / size[1] as f32;
    let (right, up, forward) = camera.basis();
    let needed = positions.iter().map(|&place| {
        let off = glam::Vec3::from(place) - camera.target;
        (off.dot(right).abs() / half_x).max(off.dot(up).abs() / half_y) - off.dot(forward)
    });
    needed.filter(|needed| needed.is_finite()).fold(0.0, f32::max)
}

/// Draws a scene on a graphics adapter, or on the CPU if there is none.
#[cfg(feature = "window")]
pub fn draw_scene(scene: &Scene, camera: &Camera, size: [u32; 2]) -> Result<(Picture, DrawnBy), RenderError> {
    match armature_render::Gpu::request() {
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

/// Draws a scene on the CPU: this program was built without graphics.
#[cfg(not(feature = "window"))]
pub fn draw_scene(scene: &Scene, camera: &Camera, size: [u32; 2]) -> Result<(Picture, DrawnBy), RenderError> {
    let picture = armature_render::render_to_image_cpu(scene, camera, size, Samples::Four)?;
    Ok((picture, DrawnBy::Cpu("this program was built without graphics".into())))
}
