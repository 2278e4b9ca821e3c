//! Drawing and skinning with wgpu: the adapter, the renderer, pictures without a window, and skinned poses.

mod buffers;
mod materials;
mod offscreen;
mod pipelines;
mod renderer;
mod skin;

pub use offscreen::render_to_image_gpu;
pub use renderer::Renderer;
pub use skin::{GpuSkin, RestShape, SkinMethod, SkinPoses, SkinnedPoses};

use std::time::Duration;

use crate::{RenderError, Samples};

/// A software adapter under load may take a while for a large picture; a hung driver never answers.
const PATIENCE: Duration = Duration::from_mins(1);

/// An adapter, opened for drawing without a window.
#[derive(Debug)]
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    samples: Samples,
}

impl Gpu {
    /// Opens this machine's best adapter; a software one counts. Never panics if there is none.
    pub fn request() -> Result<Self, RenderError> {
        pollster::block_on(async {
            let adapter = request_adapter().await?;
            let info = adapter.get_info();
            let samples = if supports_four(&adapter) { Samples::Four } else { Samples::One };
            let descriptor = wgpu::DeviceDescriptor {
                label: Some("armature"),
                required_limits: wgpu::Limits::downlevel_defaults().using_resolution(adapter.limits()),
                ..wgpu::DeviceDescriptor::default()
            };
            let (device, queue) = adapter
                .request_device(&descriptor)
                .await
                .map_err(|error| RenderError::NoDevice { adapter: adapter_label(&info), detail: error.to_string() })?;
            Ok(Self { device, queue, info, samples })
        })
    }

    /// For display: "AMD Radeon 780M (Vulkan)", "llvmpipe (LLVM 15.0.6, 256 bits) (Vulkan, software)".
    pub fn label(&self) -> String {
        adapter_label(&self.info)
    }

    /// Whether the adapter computes on the CPU.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Runs something on the device; anything the device reports against it is an error.
    fn checked<T>(&self, work: impl FnOnce() -> T) -> Result<T, RenderError> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let done = work();
        for scope in [validation, memory] {
            if let Some(error) = pollster::block_on(scope.pop()) {
                return Err(RenderError::Device { detail: error.to_string() });
            }
        }
        Ok(done)
    }

    /// Waits until everything submitted is done.
    pub fn wait(&self) -> Result<(), RenderError> {
        let all = wgpu::PollType::Wait { submission_index: None, timeout: Some(PATIENCE) };
        self.device.poll(all).map(|_| ()).map_err(|error| RenderError::Device { detail: error.to_string() })
    }

    /// The best antialiasing this adapter supports.
    pub fn best_samples(&self) -> Samples {
        self.samples
    }
}

/// OpenGL is tried only if there is nothing else: its libraries connect to displays, and complain on standard error if
/// there is none.
async fn request_adapter() -> Result<wgpu::Adapter, RenderError> {
    let chosen = wgpu::Backends::from_env();
    let attempts = chosen.map_or(vec![wgpu::Backends::PRIMARY, wgpu::Backends::GL], |backends| vec![backends]);
    let mut detail = String::new();
    for backends in attempts {
        let descriptor =
            wgpu::InstanceDescriptor { backends, ..wgpu::InstanceDescriptor::new_without_display_handle_from_env() };
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..wgpu::RequestAdapterOptions::default()
        };
        match wgpu::Instance::new(descriptor).request_adapter(&options).await {
            Ok(adapter) => return Ok(adapter),
            Err(error) => detail = error.to_string(),
        }
    }
    Err(RenderError::NoAdapter { detail })
}

/// Name of an adapter, for display.
pub fn adapter_label(info: &wgpu::AdapterInfo) -> String {
    let backend = match info.backend {
        wgpu::Backend::Noop => "no backend",
        wgpu::Backend::Vulkan => "Vulkan",
        wgpu::Backend::Metal => "Metal",
        wgpu::Backend::Dx12 => "DirectX 12",
        wgpu::Backend::Gl => "OpenGL",
        wgpu::Backend::BrowserWebGpu => "WebGPU",
    };
    let software = if info.device_type == wgpu::DeviceType::Cpu { ", software" } else { "" };
    format!("{} ({backend}{software})", info.name)
}

/// Samples for drawing at display rate: four, but one on an adapter that computes on the CPU or cannot do better.
pub fn preferred_samples(adapter: &wgpu::Adapter) -> Samples {
    if adapter.get_info().device_type != wgpu::DeviceType::Cpu && supports_four(adapter) {
        Samples::Four
    } else {
        Samples::One
    }
}

fn supports_four(adapter: &wgpu::Adapter) -> bool {
    [pipelines::LIGHT_FORMAT, pipelines::DEPTH_FORMAT]
        .iter()
        .all(|&format| adapter.get_texture_format_features(format).flags.sample_count_supported(4))
        && adapter
            .get_texture_format_features(pipelines::LIGHT_FORMAT)
            .flags
            .contains(wgpu::TextureFormatFeatureFlags::MULTISAMPLE_RESOLVE)
}
