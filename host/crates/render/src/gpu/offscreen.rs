//! A picture without a window.

use std::sync::mpsc;

use wgpu::{TextureFormat, TextureUsages};

use super::renderer::texture_2d;
use super::{Gpu, Renderer};
use crate::picture::check_size;
use crate::{Camera, Picture, RenderError, Samples, Scene};

/// Draws a picture on the graphics adapter.
pub fn render_to_image_gpu(
    gpu: &Gpu,
    scene: &Scene,
    camera: &Camera,
    size: [u32; 2],
    samples: Samples,
) -> Result<Picture, RenderError> {
    check_size(size, gpu.device.limits().max_texture_dimension_2d)?;
    let (buffer, row_bytes) = gpu.checked(|| draw(gpu, scene, camera, size, samples))??;
    read_buffer(gpu, &buffer, |mapped| {
        let mut rgba = Vec::with_capacity(size[0] as usize * size[1] as usize * 4);
        for row in mapped.chunks_exact(row_bytes as usize) {
            rgba.extend_from_slice(&row[..size[0] as usize * 4]);
        }
        Picture { width: size[0], height: size[1], rgba }
    })
}

fn draw(
    gpu: &Gpu,
    scene: &Scene,
    camera: &Camera,
    size: [u32; 2],
    samples: Samples,
) -> Result<(wgpu::Buffer, u32), RenderError> {
    let Gpu { device, queue, .. } = gpu;
    let format = TextureFormat::Rgba8Unorm;
    let mut renderer = Renderer::new(device, format, samples);
    let target =
        texture_2d(device, "picture", size, 1, format, TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC);
    let view = target.create_view(&wgpu::TextureViewDescriptor::default());
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    renderer.prepare(device, queue, &mut encoder, scene, camera, size)?;
    {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("present"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations::default(),
            })],
            ..wgpu::RenderPassDescriptor::default()
        });
        renderer.paint(&mut pass);
    }
    let row_bytes = (size[0] * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("picture"),
        size: u64::from(row_bytes) * u64::from(size[1]),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row_bytes), rows_per_image: None };
    encoder.copy_texture_to_buffer(
        target.as_image_copy(),
        wgpu::TexelCopyBufferInfo { buffer: &buffer, layout },
        target.size(),
    );
    queue.submit([encoder.finish()]);
    Ok((buffer, row_bytes))
}

/// Waits for the content of a buffer.
pub(super) fn read_buffer<T>(
    gpu: &Gpu,
    buffer: &wgpu::Buffer,
    take: impl FnOnce(&[u8]) -> T,
) -> Result<T, RenderError> {
    let failed = |detail: String| RenderError::Device { detail };
    let (sender, receiver) = mpsc::channel();
    buffer.map_async(wgpu::MapMode::Read, .., move |result| {
        // The receiver is gone only if this function has already given up.
        let _ = sender.send(result);
    });
    gpu.wait()?;
    receiver
        .try_recv()
        .map_err(|_| failed("its computation never finished".into()))?
        .map_err(|error| failed(error.to_string()))?;
    let mapped = buffer.get_mapped_range(..).map_err(|error| failed(error.to_string()))?;
    Ok(take(&mapped))
}
