//! Shaders, bind group layouts and pipelines; created once.

use wgpu::{
    BindGroupLayout, BindingType, BlendState, BufferBindingType, CompareFunction, RenderPipeline, ShaderStages,
    TextureFormat, VertexBufferLayout, VertexStepMode, vertex_attr_array,
};

use crate::material::MAPS;

/// Linear light between the passes.
pub(crate) const LIGHT_FORMAT: TextureFormat = TextureFormat::Rgba16Float;
/// Nearest first, 0 to 1.
pub(crate) const DEPTH_FORMAT: TextureFormat = TextureFormat::Depth32Float;

const COMMON: &str = include_str!("../../shader/common.wgsl");

/// Everything independent of scene and size.
#[derive(Debug)]
pub(crate) struct Pipelines {
    pub(crate) frame_layout: BindGroupLayout,
    pub(crate) texture_layout: BindGroupLayout,
    pub(crate) material_layout: BindGroupLayout,
    pub(crate) background: RenderPipeline,
    pub(crate) mesh: RenderPipeline,
    pub(crate) blended_mesh: RenderPipeline,
    pub(crate) overlay: RenderPipeline,
    pub(crate) present: RenderPipeline,
}

impl Pipelines {
    pub(crate) fn new(device: &wgpu::Device, present_format: TextureFormat, samples: u32) -> Self {
        let frame_layout = layout(device, "frame", &[uniform_entry(0), texture_entry(1), sampler_entry(2)]);
        let texture_layout = layout(device, "texture", &[texture_entry(0), sampler_entry(1)]);
        let maps = 0..MAPS as u32;
        let samplers = maps.clone().map(|map| sampler_entry(map + MAPS as u32));
        let material_entries: Vec<_> =
            maps.map(texture_entry).chain(samplers).chain([uniform_entry(2 * MAPS as u32)]).collect();
        let material_layout = layout(device, "material", &material_entries);
        let scene_stage = |label, source: &str, buffers, layouts: &[&BindGroupLayout], depth, blend, cull_mode| {
            let source = format!("{COMMON}\n{source}");
            let format = LIGHT_FORMAT;
            Stage { label, source, entry: "fragment", buffers, format, depth, blend, cull_mode, samples }
                .build(device, layouts)
        };
        let background = scene_stage(
            "background",
            include_str!("../../shader/background.wgsl"),
            &[],
            &[&frame_layout],
            Some((false, CompareFunction::LessEqual)),
            None,
            None,
        );
        let mesh_stage = |label, writes_depth, blend| {
            scene_stage(
                label,
                include_str!("../../shader/mesh.wgsl"),
                &MESH_BUFFERS,
                &[&frame_layout, &material_layout],
                Some((writes_depth, CompareFunction::Less)),
                blend,
                None,
            )
        };
        let mesh = mesh_stage("mesh", true, None);
        let blended_mesh = mesh_stage("blended mesh", false, Some(BlendState::ALPHA_BLENDING));
        let overlay = scene_stage(
            "overlay",
            include_str!("../../shader/overlay.wgsl"),
            &OVERLAY_BUFFERS,
            &[&frame_layout],
            Some((false, CompareFunction::Always)),
            Some(BlendState::ALPHA_BLENDING),
            Some(wgpu::Face::Back),
        );
        let present = Stage {
            label: "present",
            source: include_str!("../../shader/present.wgsl").into(),
            entry: if present_format.is_srgb() { "fragment_for_srgb_target" } else { "fragment" },
            buffers: &[],
            format: present_format,
            depth: None,
            blend: None,
            cull_mode: None,
            samples: 1,
        }
        .build(device, &[&texture_layout]);
        Self { frame_layout, texture_layout, material_layout, background, mesh, blended_mesh, overlay, present }
    }
}

const fn column(array_stride: u64, attributes: &[wgpu::VertexAttribute]) -> VertexBufferLayout<'_> {
    VertexBufferLayout { array_stride, step_mode: VertexStepMode::Vertex, attributes }
}

static MESH_BUFFERS: [Option<VertexBufferLayout<'static>>; 5] = [
    Some(column(12, &vertex_attr_array![0 => Float32x3])),
    Some(column(12, &vertex_attr_array![1 => Float32x3])),
    Some(column(8, &vertex_attr_array![2 => Float32x2])),
    Some(column(4, &vertex_attr_array![3 => Float32])),
    Some(column(16, &vertex_attr_array![4 => Float32x4])),
];

static OVERLAY_BUFFERS: [Option<VertexBufferLayout<'static>>; 1] =
    [Some(column(40, &vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x4]))];

struct Stage<'a> {
    label: &'static str,
    source: String,
    entry: &'static str,
    buffers: &'a [Option<VertexBufferLayout<'a>>],
    format: TextureFormat,
    /// Whether depth is written, and when a sample passes.
    depth: Option<(bool, CompareFunction)>,
    blend: Option<BlendState>,
    cull_mode: Option<wgpu::Face>,
    samples: u32,
}

impl Stage<'_> {
    fn build(self, device: &wgpu::Device, layouts: &[&BindGroupLayout]) -> RenderPipeline {
        let label = Some(self.label);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl(self.source.into()),
        });
        let bind_group_layouts: Vec<_> = layouts.iter().copied().map(Some).collect();
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &bind_group_layouts,
            immediate_size: 0,
        });
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label,
            layout: Some(&pipeline_layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: self.buffers,
            },
            primitive: wgpu::PrimitiveState { cull_mode: self.cull_mode, ..wgpu::PrimitiveState::default() },
            depth_stencil: self.depth.map(|(write, compare)| wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(write),
                depth_compare: Some(compare),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState { count: self.samples, ..wgpu::MultisampleState::default() },
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(self.entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(wgpu::ColorTargetState {
                    format: self.format,
                    blend: self.blend,
                    write_mask: wgpu::ColorWrites::ALL,
                })],
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}

fn layout(device: &wgpu::Device, label: &str, entries: &[wgpu::BindGroupLayoutEntry]) -> BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
}

fn uniform_entry(binding: u32) -> wgpu::BindGroupLayoutEntry {
    let ty = BindingType::Buffer { ty: BufferBindingType::Uniform, has_dynamic_offset: false, min_binding_size: None };
    wgpu::BindGroupLayoutEntry { binding, visibility: ShaderStages::VERTEX_FRAGMENT, ty, count: None }
}

fn texture_entry(binding: u32) -> wgpu::BindGroupLayoutEntry {
    let ty = BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: true },
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    wgpu::BindGroupLayoutEntry { binding, visibility: ShaderStages::FRAGMENT, ty, count: None }
}

fn sampler_entry(binding: u32) -> wgpu::BindGroupLayoutEntry {
    let ty = BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
    wgpu::BindGroupLayoutEntry { binding, visibility: ShaderStages::FRAGMENT, ty, count: None }
}
