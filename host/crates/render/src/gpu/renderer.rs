//! The renderer that lives as long as a window: precompute, prepare, paint.

use bytemuck::cast_slice;
use wgpu::{BufferUsages, TextureFormat, TextureUsages};

use super::buffers::GrowingBuffer;
use super::materials::Materials;
use super::pipelines::{DEPTH_FORMAT, LIGHT_FORMAT, Pipelines};
use crate::bone_shape::{OverlayVertex, bone_triangles};
use crate::contact_shadow::{ContactShadow, SHADOW_SIDE};
use crate::picture::check_size;
use crate::uniforms::Uniforms;
use crate::{Camera, MeshView, RenderError, Samples, Scene};

/// Draws scenes into its own texture ([`Renderer::prepare`]) and that onto the screen ([`Renderer::paint`]).
///
/// Buffers grow with the largest scene seen; a frame of the same size allocates nothing on the GPU.
#[derive(Debug)]
pub struct Renderer {
    pipelines: Pipelines,
    samples: u32,
    uniforms: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
    shadow_texture: wgpu::Texture,
    smooth_sampler: wgpu::Sampler,
    materials: Materials,
    positions: GrowingBuffer,
    normals: GrowingBuffer,
    uv: GrowingBuffer,
    colors: GrowingBuffer,
    highlight: GrowingBuffer,
    highlight_is_zero: bool,
    indices: GrowingBuffer,
    overlay: GrowingBuffer,
    overlay_count: u32,
    overlay_scratch: Vec<OverlayVertex>,
    shadow: ContactShadow,
    /// Revision, vertices, triangles, parts and materials of the mesh whose topology is on the GPU.
    uploaded: Option<(u64, [usize; 4])>,
    targets: Option<Targets>,
}

/// Everything that depends on the size of the picture.
#[derive(Debug)]
struct Targets {
    size: [u32; 2],
    /// The texture that is drawn into, if that is not `resolved` itself.
    multisampled: Option<wgpu::TextureView>,
    resolved: wgpu::TextureView,
    depth: wgpu::TextureView,
    present_group: wgpu::BindGroup,
}

impl Renderer {
    /// Compiles the shaders; `present_format` is that of the pass given to [`Renderer::paint`].
    pub fn new(device: &wgpu::Device, present_format: TextureFormat, samples: Samples) -> Self {
        let pipelines = Pipelines::new(device, present_format, samples.count());
        let uniforms = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("uniforms"),
            size: size_of::<Uniforms>() as u64,
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let side = SHADOW_SIDE as u32;
        let shadow_texture = texture_2d(
            device,
            "contact shadow",
            [side; 2],
            1,
            TextureFormat::R8Unorm,
            TextureUsages::COPY_DST | TextureUsages::TEXTURE_BINDING,
        );
        let smooth_sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        let shadow_view = shadow_texture.create_view(&wgpu::TextureViewDescriptor::default());
        let frame_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &pipelines.frame_layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: uniforms.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::TextureView(&shadow_view) },
                wgpu::BindGroupEntry { binding: 2, resource: wgpu::BindingResource::Sampler(&smooth_sampler) },
            ],
        });
        let vertex = |label| GrowingBuffer::new(device, label, BufferUsages::VERTEX);
        Self {
            samples: samples.count(),
            uniforms,
            frame_group,
            shadow_texture,
            smooth_sampler,
            materials: Materials::new(device),
            positions: vertex("positions"),
            normals: vertex("normals"),
            uv: vertex("texture coordinates"),
            colors: vertex("colours"),
            highlight: vertex("highlight"),
            highlight_is_zero: true,
            indices: GrowingBuffer::new(device, "indices", BufferUsages::INDEX),
            overlay: vertex("overlay"),
            overlay_count: 0,
            overlay_scratch: Vec::new(),
            shadow: ContactShadow::default(),
            uploaded: None,
            targets: None,
            pipelines,
        }
    }

    /// Sends the scene to the GPU and records its passes; the picture has `size` pixels.
    pub fn prepare(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        scene: &Scene,
        camera: &Camera,
        size: [u32; 2],
    ) -> Result<(), RenderError> {
        let limit = device.limits().max_texture_dimension_2d;
        check_size(size, limit)?;
        self.upload_mesh(device, queue, &scene.mesh, limit)?;
        self.materials.prepare(device, queue, &scene.mesh, camera, &scene.look);
        self.shadow.update(&scene.mesh, &scene.ground);
        write_texture(queue, &self.shadow_texture, [SHADOW_SIDE as u32; 2], 1, &self.shadow.texels);
        let uniforms = Uniforms::new(scene, camera, &self.shadow, size);
        queue.write_buffer(&self.uniforms, 0, bytemuck::bytes_of(&uniforms));
        self.overlay_scratch.clear();
        bone_triangles(scene.bones, scene.ground.radius, &mut self.overlay_scratch);
        self.overlay_count = self.overlay_scratch.len() as u32;
        self.overlay.write(device, queue, cast_slice(&self.overlay_scratch));
        let targets = match self.targets.take() {
            Some(targets) if targets.size == size => targets,
            _ => self.make_targets(device, size),
        };
        self.encode(encoder, &targets);
        self.targets = Some(targets);
        Ok(())
    }

    /// Draws the prepared picture over the pass's viewport. Does nothing before the first [`Renderer::prepare`].
    pub fn paint(&self, pass: &mut wgpu::RenderPass<'_>) {
        if let Some(targets) = &self.targets {
            pass.set_pipeline(&self.pipelines.present);
            pass.set_bind_group(0, &targets.present_group, &[]);
            pass.draw(0..3, 0..1);
        }
    }

    fn upload_mesh(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        mesh: &MeshView,
        limit: u32,
    ) -> Result<(), RenderError> {
        mesh.validate_lengths()?;
        let MeshView { positions, triangles, parts, materials, .. } = mesh;
        let version = (mesh.revision, [positions.len(), triangles.len(), parts.len(), materials.len()]);
        if self.uploaded != Some(version) {
            mesh.validate_topology(limit)?;
            self.upload_topology(device, queue, mesh);
            self.uploaded = Some(version);
        }
        self.positions.write(device, queue, cast_slice(mesh.positions));
        self.normals.write(device, queue, cast_slice(mesh.normals));
        match mesh.highlight {
            Some(highlight) => self.highlight.write(device, queue, cast_slice(highlight)),
            None if self.highlight_is_zero => {}
            None => self.highlight.write(device, queue, &vec![0; mesh.positions.len() * 4]),
        }
        self.highlight_is_zero = mesh.highlight.is_none();
        Ok(())
    }

    fn upload_topology(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, mesh: &MeshView) {
        self.indices.write(device, queue, cast_slice(mesh.triangles));
        match mesh.uv {
            Some(uv) => self.uv.write(device, queue, cast_slice(uv)),
            None => self.uv.reserve(device, mesh.positions.len() as u64 * 8),
        }
        match mesh.colors {
            Some(colors) => self.colors.write(device, queue, cast_slice(colors)),
            None => self.colors.write(device, queue, cast_slice(&vec![[1.0_f32; 4]; mesh.positions.len()])),
        }
        self.highlight.write(device, queue, &vec![0; mesh.positions.len() * 4]);
        self.highlight_is_zero = true;
        let layout = &self.pipelines.material_layout;
        self.materials.upload(device, queue, layout, mesh);
    }

    fn make_targets(&self, device: &wgpu::Device, size: [u32; 2]) -> Targets {
        let view = |label, samples, format, usage| {
            texture_2d(device, label, size, samples, format, usage | TextureUsages::RENDER_ATTACHMENT)
                .create_view(&wgpu::TextureViewDescriptor::default())
        };
        let resolved = view("linear light", 1, LIGHT_FORMAT, TextureUsages::TEXTURE_BINDING);
        let multisampled =
            (self.samples > 1).then(|| view("samples", self.samples, LIGHT_FORMAT, TextureUsages::empty()));
        let depth = view("depth", self.samples, DEPTH_FORMAT, TextureUsages::empty());
        let present_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("present"),
            layout: &self.pipelines.texture_layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&resolved) },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&self.smooth_sampler) },
            ],
        });
        Targets { size, multisampled, resolved, depth, present_group }
    }

    fn encode(&self, encoder: &mut wgpu::CommandEncoder, targets: &Targets) {
        let (view, resolve_target, store) = match &targets.multisampled {
            Some(samples) => (samples, Some(&targets.resolved), wgpu::StoreOp::Discard),
            None => (&targets.resolved, None, wgpu::StoreOp::Store),
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("scene"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &targets.depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_bind_group(0, &self.frame_group, &[]);
        if self.materials.has_triangles() {
            let columns = [&self.positions, &self.normals, &self.uv, &self.highlight, &self.colors];
            for (slot, buffer) in columns.into_iter().enumerate() {
                pass.set_vertex_buffer(slot as u32, buffer.slice());
            }
            pass.set_index_buffer(self.indices.slice(), wgpu::IndexFormat::Uint32);
            self.materials.draw_opaque(&mut pass, &self.pipelines);
        }
        // After the character, so that only its visible part is computed.
        pass.set_pipeline(&self.pipelines.background);
        pass.draw(0..3, 0..1);
        self.materials.draw_blended(&mut pass, &self.pipelines);
        if self.overlay_count > 0 {
            pass.set_pipeline(&self.pipelines.overlay);
            pass.set_vertex_buffer(0, self.overlay.slice());
            pass.draw(0..self.overlay_count, 0..1);
        }
    }
}

pub(crate) fn texture_2d(
    device: &wgpu::Device,
    label: &str,
    [width, height]: [u32; 2],
    sample_count: u32,
    format: TextureFormat,
    usage: TextureUsages,
) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

fn write_texture(
    queue: &wgpu::Queue,
    texture: &wgpu::Texture,
    [width, height]: [u32; 2],
    texel_bytes: u32,
    bytes: &[u8],
) {
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(width * texel_bytes), rows_per_image: None };
    let extent = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
    queue.write_texture(texture.as_image_copy(), bytes, layout, extent);
}
