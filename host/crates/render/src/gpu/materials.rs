//! The materials of a mesh's parts on the adapter.

use std::ops::Range;
use std::sync::Arc;

use wgpu::util::DeviceExt as _;
use wgpu::{BufferUsages, TextureFormat, TextureUsages};

use super::buffers::GrowingBuffer;
use super::pipelines::Pipelines;
use crate::material::{MAP_IS_SRGB, MAPS, MaterialUniforms};
use crate::mip_levels::mip_levels;
use crate::scene::NO_MATERIAL;
use crate::{Camera, Look, Map, Material, MeshView, Picture, Wrap};

/// The materials of the mesh that was sent last, and what is drawn with each.
#[derive(Debug)]
pub(super) struct Materials {
    drawn: Vec<DrawnMaterial>,
    /// Runs of triangles that hide what is behind them.
    opaque: Vec<(Range<u32>, u32)>,
    /// Triangles that are blended, with their distances; sorted every frame.
    blended: Vec<(f32, u32)>,
    /// The material of every triangle.
    material_of: Vec<u32>,
    /// The corners of the blended triangles, in drawing order.
    blended_corners: Vec<[u32; 3]>,
    blended_indices: GrowingBuffer,
}

#[derive(Debug)]
struct DrawnMaterial {
    uniforms: wgpu::Buffer,
    group: wgpu::BindGroup,
}

/// Images and samplers that were sent already.
struct Sent<'d> {
    device: &'d wgpu::Device,
    queue: &'d wgpu::Queue,
    /// By address; white where there is no image.
    views: Vec<(Option<*const Picture>, bool, wgpu::TextureView)>,
    samplers: Vec<([Wrap; 2], wgpu::Sampler)>,
}

impl Materials {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        Self {
            drawn: Vec::new(),
            opaque: Vec::new(),
            blended: Vec::new(),
            material_of: Vec::new(),
            blended_corners: Vec::new(),
            blended_indices: GrowingBuffer::new(device, "blended triangles", BufferUsages::INDEX),
        }
    }

    /// Sends images, each once even if several materials share it.
    pub(super) fn upload(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        layout: &wgpu::BindGroupLayout,
        mesh: &MeshView,
    ) {
        let mut sent = Sent { device, queue, views: Vec::new(), samplers: Vec::new() };
        let has_maps = mesh.uv.is_some();
        self.drawn = mesh.drawn_materials().iter().map(|material| sent.material(layout, material, has_maps)).collect();
        self.material_of = mesh.material_of_triangles();
        self.opaque.clear();
        self.blended.clear();
        for (triangle, &material) in (0..).zip(&self.material_of) {
            if material == NO_MATERIAL {
                continue;
            }
            if mesh.is_blended(material) {
                self.blended.push((0.0, triangle));
                continue;
            }
            match self.opaque.last_mut() {
                Some((run, same)) if *same == material && run.end == triangle => run.end += 1,
                _ => self.opaque.push((triangle..triangle + 1, material)),
            }
        }
    }

    /// Sends what may change from frame to frame: colours, and the order of blended triangles.
    pub(super) fn prepare(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        mesh: &MeshView,
        camera: &Camera,
        look: &Look,
    ) {
        for (drawn, uniforms) in self.drawn.iter().zip(mesh.material_uniforms(look)) {
            queue.write_buffer(&drawn.uniforms, 0, bytemuck::bytes_of(&uniforms));
        }
        mesh.sort_farthest_first(camera, &mut self.blended);
        self.blended_corners.clear();
        self.blended_corners.extend(self.blended.iter().map(|(_, triangle)| mesh.triangles[*triangle as usize]));
        self.blended_indices.write(device, queue, bytemuck::cast_slice(&self.blended_corners));
    }

    /// Whether anything is drawn.
    pub(super) fn has_triangles(&self) -> bool {
        !self.opaque.is_empty() || !self.blended.is_empty()
    }

    /// Draws what hides what is behind it; the mesh's indices are set.
    pub(super) fn draw_opaque(&self, pass: &mut wgpu::RenderPass<'_>, pipelines: &Pipelines) {
        pass.set_pipeline(&pipelines.mesh);
        for (triangles, material) in &self.opaque {
            pass.set_bind_group(1, &self.drawn[*material as usize].group, &[]);
            pass.draw_indexed(3 * triangles.start..3 * triangles.end, 0, 0..1);
        }
    }

    /// Blends the rest over it.
    pub(super) fn draw_blended(&self, pass: &mut wgpu::RenderPass<'_>, pipelines: &Pipelines) {
        if self.blended.is_empty() {
            return;
        }
        pass.set_pipeline(&pipelines.blended_mesh);
        pass.set_index_buffer(self.blended_indices.slice(), wgpu::IndexFormat::Uint32);
        let material = |(_, triangle): &(f32, u32)| self.material_of[*triangle as usize];
        let mut first = 0;
        for run in self.blended.chunk_by(|a, b| material(a) == material(b)) {
            let end = first + 3 * run.len() as u32;
            pass.set_bind_group(1, &self.drawn[material(&run[0]) as usize].group, &[]);
            pass.draw_indexed(first..end, 0, 0..1);
            first = end;
        }
    }
}

impl Sent<'_> {
    fn material(&mut self, layout: &wgpu::BindGroupLayout, material: &Material, has_maps: bool) -> DrawnMaterial {
        let uniforms = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("material"),
            size: size_of::<MaterialUniforms>() as u64,
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let maps = material.maps().map(|map| map.filter(|_| has_maps));
        for (map, is_srgb) in maps.into_iter().zip(MAP_IS_SRGB) {
            self.send(map, is_srgb);
        }
        let mut entries = Vec::with_capacity(2 * MAPS + 1);
        for (binding, (map, is_srgb)) in (0..).zip(maps.into_iter().zip(MAP_IS_SRGB)) {
            let key = map.map(|map| Arc::as_ptr(&map.picture));
            let view = self.views.iter().find(|(known, srgb, _)| (*known, *srgb) == (key, is_srgb));
            let wrap = map.map_or_else(Default::default, |map| map.wrap);
            let sampler = self.samplers.iter().find(|(known, _)| *known == wrap);
            // Both were sent above.
            if let (Some((_, _, view)), Some((_, sampler))) = (view, sampler) {
                let resource = wgpu::BindingResource::TextureView(view);
                entries.push(wgpu::BindGroupEntry { binding, resource });
                let (binding, resource) = (binding + MAPS as u32, wgpu::BindingResource::Sampler(sampler));
                entries.push(wgpu::BindGroupEntry { binding, resource });
            }
        }
        entries.push(wgpu::BindGroupEntry { binding: 2 * MAPS as u32, resource: uniforms.as_entire_binding() });
        let descriptor = wgpu::BindGroupDescriptor { label: Some("material"), layout, entries: &entries };
        let group = self.device.create_bind_group(&descriptor);
        DrawnMaterial { uniforms, group }
    }

    /// Sends an image and the sampler for it, unless they were sent before.
    fn send(&mut self, map: Option<&Map>, is_srgb: bool) {
        let key = map.map(|map| Arc::as_ptr(&map.picture));
        if !self.views.iter().any(|(known, srgb, _)| (*known, *srgb) == (key, is_srgb)) {
            let texture = match map {
                Some(map) => self.texture(&map.picture, is_srgb),
                None => self.texture(&Picture { width: 1, height: 1, rgba: vec![255; 4] }, is_srgb),
            };
            self.views.push((key, is_srgb, texture.create_view(&wgpu::TextureViewDescriptor::default())));
        }
        let wrap = map.map_or_else(Default::default, |map| map.wrap);
        if !self.samplers.iter().any(|(known, _)| *known == wrap) {
            let [address_mode_u, address_mode_v] = wrap.map(|wrap| match wrap {
                Wrap::Repeat => wgpu::AddressMode::Repeat,
                Wrap::Mirror => wgpu::AddressMode::MirrorRepeat,
                Wrap::Clamp => wgpu::AddressMode::ClampToEdge,
            });
            let sampler = self.device.create_sampler(&wgpu::SamplerDescriptor {
                address_mode_u,
                address_mode_v,
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                ..wgpu::SamplerDescriptor::default()
            });
            self.samplers.push((wrap, sampler));
        }
    }

    /// An image with its mip levels.
    fn texture(&self, picture: &Picture, is_srgb: bool) -> wgpu::Texture {
        let smaller = mip_levels(picture, is_srgb);
        let &Picture { width, height, .. } = picture;
        let all = std::iter::once(picture).chain(&smaller);
        let rgba: Vec<u8> = all.flat_map(|level| &level.rgba).copied().collect();
        let descriptor = wgpu::TextureDescriptor {
            label: Some("map"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1 + smaller.len() as u32,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: if is_srgb { TextureFormat::Rgba8UnormSrgb } else { TextureFormat::Rgba8Unorm },
            usage: TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        };
        self.device.create_texture_with_data(self.queue, &descriptor, wgpu::util::TextureDataOrder::LayerMajor, &rgba)
    }
}
