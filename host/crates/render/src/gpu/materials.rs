//! The materials of a mesh's parts on the adapter.

use std::ops::Range;
use std::sync::Arc;

use wgpu::util::DeviceExt as _;
use wgpu::{BufferUsages, TextureFormat, TextureUsages};

use crate::{Look, MeshView, Picture};

/// The materials of the mesh that was sent last, and the indices drawn with each.
#[derive(Debug, Default)]
pub(super) struct Materials {
    drawn: Vec<DrawnMaterial>,
    parts: Vec<(Range<u32>, usize)>,
}

#[derive(Debug)]
struct DrawnMaterial {
    /// Linear red, green, blue.
    color: wgpu::Buffer,
    group: wgpu::BindGroup,
}

impl Materials {
    /// Sends textures, each once even if several materials share it.
    pub(super) fn upload(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        layout: &wgpu::BindGroupLayout,
        sampler: &wgpu::Sampler,
        mesh: &MeshView,
    ) {
        let mut sent: Vec<(Option<*const Picture>, wgpu::TextureView)> = Vec::new();
        let drawn = mesh.drawn_materials().iter().map(|material| {
            let texture = mesh.texture_of(material);
            let key = texture.map(Arc::as_ptr);
            if !sent.iter().any(|(known, _)| *known == key) {
                let texture = match texture {
                    Some(texture) => upload_texture(device, queue, [texture.width, texture.height], &texture.rgba),
                    None => upload_texture(device, queue, [1; 2], &[255; 4]),
                };
                sent.push((key, texture.create_view(&wgpu::TextureViewDescriptor::default())));
            }
            let view = sent.iter().find(|(known, _)| *known == key).map(|(_, view)| view);
            view.map(|view| DrawnMaterial::new(device, layout, view, sampler))
        });
        self.drawn = drawn.flatten().collect();
        self.parts = mesh.drawn_parts();
    }

    /// Sends the colours, which may change from frame to frame.
    pub(super) fn write_colors(&self, queue: &wgpu::Queue, mesh: &MeshView, look: &Look) {
        for (drawn, material) in self.drawn.iter().zip(mesh.drawn_materials()) {
            let color = mesh.color_of(material, look).extend(0.0);
            queue.write_buffer(&drawn.color, 0, bytemuck::bytes_of(&color));
        }
    }

    /// Whether anything is drawn.
    pub(super) fn has_triangles(&self) -> bool {
        self.parts.iter().any(|(triangles, _)| !triangles.is_empty())
    }

    /// Draws each part with its material (bind group 1).
    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        for (triangles, material) in self.parts.iter().filter(|(triangles, _)| !triangles.is_empty()) {
            pass.set_bind_group(1, &self.drawn[*material].group, &[]);
            pass.draw_indexed(3 * triangles.start..3 * triangles.end, 0, 0..1);
        }
    }
}

impl DrawnMaterial {
    fn new(
        device: &wgpu::Device,
        layout: &wgpu::BindGroupLayout,
        view: &wgpu::TextureView,
        sampler: &wgpu::Sampler,
    ) -> Self {
        let color = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("base colour"),
            size: 16,
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("material"),
            layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(view) },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(sampler) },
                wgpu::BindGroupEntry { binding: 2, resource: color.as_entire_binding() },
            ],
        });
        Self { color, group }
    }
}

fn upload_texture(device: &wgpu::Device, queue: &wgpu::Queue, [width, height]: [u32; 2], rgba: &[u8]) -> wgpu::Texture {
    let descriptor = wgpu::TextureDescriptor {
        label: Some("base colour"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: TextureFormat::Rgba8UnormSrgb,
        usage: TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    };
    device.create_texture_with_data(queue, &descriptor, wgpu::util::TextureDataOrder::LayerMajor, rgba)
}
