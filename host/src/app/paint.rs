//! The picture of the character inside egui's: drawn before egui, and put beneath it by a paint callback.

use armature_render::{Camera, RenderError, Renderer, Scene, adapter_label, preferred_samples};
use eframe::egui::{PaintCallback, PaintCallbackInfo, Rect};
use eframe::egui_wgpu::{self, CallbackResources, RenderState, wgpu};

/// Compiles the shaders. Returns the adapter's name.
pub(super) fn install(graphics: &RenderState) -> String {
    let samples = preferred_samples(&graphics.adapter);
    let renderer = Renderer::new(&graphics.device, graphics.target_format, samples);
    graphics.renderer.write().callback_resources.insert(renderer);
    adapter_label(&graphics.adapter.get_info())
}

/// Pixels that egui gives a callback in this rectangle.
pub(super) fn pixels(rect: Rect, pixels_per_point: f32) -> [u32; 2] {
    let edge = |points: f32| (points * pixels_per_point).round();
    [edge(rect.max.x) - edge(rect.min.x), edge(rect.max.y) - edge(rect.min.y)].map(|side| side.max(1.0) as u32)
}

/// Draws the scene into the renderer's own texture.
pub(super) fn prepare(
    graphics: &RenderState,
    scene: &Scene,
    camera: &Camera,
    size: [u32; 2],
) -> Result<(), RenderError> {
    let mut egui_renderer = graphics.renderer.write();
    let Some(renderer) = egui_renderer.callback_resources.get_mut::<Renderer>() else {
        return Err(RenderError::Device { detail: "the renderer was never made".into() });
    };
    let mut encoder =
        graphics.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("character") });
    renderer.prepare(&graphics.device, &graphics.queue, &mut encoder, scene, camera, size)?;
    graphics.queue.submit([encoder.finish()]);
    Ok(())
}

/// Puts that texture beneath what egui draws.
pub(super) fn callback(rect: Rect) -> PaintCallback {
    egui_wgpu::Callback::new_paint_callback(rect, Blit)
}

struct Blit;

impl egui_wgpu::CallbackTrait for Blit {
    fn paint(&self, _: PaintCallbackInfo, pass: &mut wgpu::RenderPass<'static>, resources: &CallbackResources) {
        if let Some(renderer) = resources.get::<Renderer>() {
            renderer.paint(pass);
        }
    }
}
