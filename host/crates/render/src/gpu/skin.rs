//! Skinning of many poses at once on the graphics adapter. Every kernel has its twin in `deform`.

use std::ops::Range;

use armature_deform::skin::bones::{PosedBone, RestFrames, RestSegments, unit_normal};
use armature_deform::skin::{BoneBlend, BoneSegment, Morphs, SkinError, StretchTwist};
use armature_geometry::Influences;
use bytemuck::{Pod, Zeroable, cast_slice};
use glam::Affine3A;
use wgpu::BufferUsages;

use super::Gpu;
use super::offscreen::read_buffer;
use crate::RenderError;

const COMMON: &str = include_str!("../../shader/skinning.wgsl");
const GROUP_SIZE: u32 = 64;
/// The most groups in a row of the grid, and the most rows: every adapter supports this many.
const MOST_GROUPS: u32 = 65_535;

/// A character at rest.
#[derive(Clone, Copy, Debug)]
pub struct RestShape<'a> {
    /// n×3 (model space).
    pub positions: &'a [[f32; 3]],
    /// n×3; they need not be of unit length, and a zero normal stays zero.
    pub normals: &'a [[f32; 3]],
    /// n rows.
    pub influences: &'a Influences,
}

/// How its bones move it.
#[derive(Clone, Copy, Debug)]
pub enum SkinMethod<'a> {
    /// As in [`LinearBlendSkin`](armature_deform::skin::LinearBlendSkin); one `rest_model_from_bone` per bone.
    LinearBlend(&'a [Affine3A]),
    /// As in [`DualQuaternionSkin`](armature_deform::skin::DualQuaternionSkin); one `rest_model_from_bone` per bone.
    DualQuaternion(&'a [Affine3A]),
    /// As in [`StretchTwistSkin`](armature_deform::skin::StretchTwistSkin).
    StretchTwist {
        /// One per bone.
        rest: &'a [BoneSegment],
        /// As long as `influences.bones()`: how far towards its bone's end each influence is, 0 to 1.
        end_weights: &'a [f32],
        /// How stretched and twisted bones are blended.
        blend: BoneBlend,
    },
}

/// Poses of one character, one after the other, each with all its bones.
#[derive(Clone, Copy, Debug)]
pub enum SkinPoses<'a> {
    /// `model_from_bone`, for linear blending and dual quaternions.
    Frames(&'a [Affine3A]),
    /// For bones that stretch and twist.
    StretchTwist(&'a [StretchTwist]),
}

/// Skinned poses, one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SkinnedPoses {
    /// n×3 per pose (model space).
    pub positions: Vec<[f32; 3]>,
    /// n×3 per pose, of unit length.
    pub normals: Vec<[f32; 3]>,
}

/// A character on the graphics adapter, to be skinned in many poses at once.
///
/// ```no_run
/// use armature_geometry::Influences;
/// use armature_render::{Gpu, GpuSkin, RestShape, SkinMethod, SkinPoses};
/// use glam::{Affine3A, Vec3};
///
/// let (positions, normals) = ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]; 2]);
/// let influences = Influences::new(1, vec![0, 0], vec![1.0, 1.0], 1)?;
/// let shape = RestShape { positions: &positions, normals: &normals, influences: &influences };
/// let gpu = Gpu::request()?;
/// let mut skin = GpuSkin::precompute(&gpu, &shape, &SkinMethod::LinearBlend(&[Affine3A::IDENTITY]), 2)?;
/// let poses = [Affine3A::IDENTITY, Affine3A::from_translation(Vec3::Y)];
/// skin.solve(&gpu, &SkinPoses::Frames(&poses))?;
/// assert_eq!(skin.read(&gpu)?.positions[2], [0.0, 1.0, 0.0], "the first vertex of the second pose");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct GpuSkin {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    sizes: wgpu::Buffer,
    bones: wgpu::Buffer,
    posed: wgpu::Buffer,
    rest_vertices: Vec<RestVertex>,
    rest_buffer: wgpu::Buffer,
    most_poses: usize,
    poses: usize,
    rest: RestBones,
    scratch: Vec<[f32; 4]>,
}

#[derive(Debug)]
enum RestBones {
    Linear(RestFrames),
    Dual(RestFrames),
    StretchTwist(RestSegments),
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Sizes {
    vertices: u32,
    bones: u32,
    per_vertex: u32,
    poses: u32,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct RestVertex {
    position: [f32; 3],
    pad: f32,
    normal: [f32; 3],
    pad_too: f32,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Influence {
    bone: u32,
    weight: f32,
    end: f32,
}

impl GpuSkin {
    /// Puts a character on the adapter, with space for `most_poses` poses at once. The checks are those of the CPU
    /// twin.
    pub fn precompute(
        gpu: &Gpu,
        shape: &RestShape,
        method: &SkinMethod,
        most_poses: usize,
    ) -> Result<Self, RenderError> {
        let RestShape { positions, normals, influences } = *shape;
        let (source, entry, vectors_per_bone, rest) = match *method {
            SkinMethod::LinearBlend(frames) => {
                let rest = RestBones::Linear(RestFrames::new(positions, normals, influences, frames)?);
                (include_str!("../../shader/linear_blend_skinning.wgsl"), "skin", 3, rest)
            }
            SkinMethod::DualQuaternion(frames) => {
                let rest = RestBones::Dual(RestFrames::new(positions, normals, influences, frames)?);
                (include_str!("../../shader/dual_quaternion_skinning.wgsl"), "skin", 2, rest)
            }
            SkinMethod::StretchTwist { rest, end_weights, blend } => {
                let rest = RestSegments::new(positions, normals, influences, end_weights, rest)?;
                let entry = if blend == BoneBlend::Linear { "skin_linear" } else { "skin_dual" };
                (include_str!("../../shader/stretch_twist_skinning.wgsl"), entry, 5, RestBones::StretchTwist(rest))
            }
        };
        let ends = if let SkinMethod::StretchTwist { end_weights, .. } = *method { end_weights } else { &[] };
        let bone_count = rest.len();
        let bytes = [positions.len() * 6, bone_count * vectors_per_bone * 4].map(|floats| floats * most_poses * 4);
        let groups = positions.len().div_ceil(GROUP_SIZE as usize).max(most_poses);
        let limit = gpu.device.limits().max_storage_buffer_binding_size;
        let largest = bytes[0].max(bytes[1]).max(positions.len() * 32).max(influences.bones().len() * 12) as u64;
        if groups > MOST_GROUPS as usize || largest > limit {
            return Err(RenderError::TooMuchToSkin { vertices: positions.len(), poses: most_poses });
        }
        let on_gpu = |label, content: &[u8]| {
            let buffer = storage(&gpu.device, label, content.len());
            gpu.queue.write_buffer(&buffer, 0, content);
            buffer
        };
        gpu.checked(|| {
            let rest_vertices = rest_vertices(shape);
            let rest_buffer = on_gpu("rest", cast_slice(&rest_vertices));
            let influence_buffer = on_gpu("influences", cast_slice(&packed(influences, ends)));
            let sizes = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("sizes"),
                size: size_of::<Sizes>() as u64,
                usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            let bones = storage(&gpu.device, "bones", bytes[1]);
            let posed = storage(&gpu.device, "posed", bytes[0]);
            let pipeline = pipeline(&gpu.device, source, entry);
            let buffers = [&sizes, &rest_buffer, &influence_buffer, &bones, &posed];
            let entries: Vec<wgpu::BindGroupEntry> = (0..)
                .zip(buffers)
                .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
                .collect();
            let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("skinning"),
                layout: &pipeline.get_bind_group_layout(0),
                entries: &entries,
            });
            let per_vertex = influences.per_vertex() as u32;
            let size = Sizes {
                vertices: positions.len() as u32,
                bones: bone_count as u32,
                per_vertex,
                poses: most_poses as u32,
            };
            gpu.queue.write_buffer(&sizes, 0, cast_slice(&[size]));
            Self {
                pipeline,
                group,
                sizes,
                bones,
                posed,
                rest_vertices,
                rest_buffer,
                most_poses,
                poses: 0,
                rest,
                scratch: Vec::new(),
            }
        })
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.rest_vertices.len()
    }

    /// Moves the rest shape to where morph targets have it.
    pub fn set_rest(&mut self, gpu: &Gpu, morphs: &Morphs) -> Result<(), RenderError> {
        let (got, expected) = (morphs.vertex_count(), self.vertex_count());
        if got != expected {
            return Err(SkinError::Length { what: "vertices of the morph targets", got, expected }.into());
        }
        let mut changed: Option<Range<usize>> = None;
        for (vertex, position, normal) in morphs.moved() {
            let rest = &mut self.rest_vertices[vertex];
            (rest.position, rest.normal) = (position, normal);
            changed = Some(changed.map_or(vertex, |range| range.start)..vertex + 1);
        }
        let Some(changed) = changed else { return Ok(()) };
        let first_byte = (changed.start * size_of::<RestVertex>()) as u64;
        gpu.checked(|| gpu.queue.write_buffer(&self.rest_buffer, first_byte, cast_slice(&self.rest_vertices[changed])))
    }

    /// Number of bones.
    pub fn bone_count(&self) -> usize {
        self.rest.len()
    }

    /// Skins all poses; the result stays on the adapter until [`read`](Self::read).
    pub fn solve(&mut self, gpu: &Gpu, poses: &SkinPoses) -> Result<(), RenderError> {
        let bones = self.rest.len();
        let given = match poses {
            SkinPoses::Frames(frames) => frames.len(),
            SkinPoses::StretchTwist(poses) => poses.len(),
        };
        let count = given.checked_div(bones).unwrap_or(0);
        if count * bones != given || count > self.most_poses {
            let expected = count.clamp(1, self.most_poses.max(1)) * bones;
            return Err(SkinError::Length { what: "posed bones", got: given, expected }.into());
        }
        self.rest.prepare(poses, &mut self.scratch)?;
        self.poses = count;
        if self.poses == 0 || self.vertex_count() == 0 {
            return Ok(());
        }
        gpu.checked(|| {
            let poses = self.poses as u32;
            gpu.queue.write_buffer(&self.sizes, 12, cast_slice(&[poses]));
            gpu.queue.write_buffer(&self.bones, 0, cast_slice(&self.scratch));
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                pass.set_pipeline(&self.pipeline);
                pass.set_bind_group(0, &self.group, &[]);
                pass.dispatch_workgroups((self.vertex_count() as u32).div_ceil(GROUP_SIZE), poses, 1);
            }
            gpu.queue.submit([encoder.finish()]);
        })
    }

    /// The result of the last [`solve`](Self::solve); waits for it.
    pub fn read(&self, gpu: &Gpu) -> Result<SkinnedPoses, RenderError> {
        let count = self.poses * self.vertex_count();
        if count == 0 {
            return Ok(SkinnedPoses::default());
        }
        let bytes = (count * 24) as u64;
        let copy = gpu.checked(|| {
            let copy = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("skinned"),
                size: bytes,
                usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
                mapped_at_creation: false,
            });
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(&self.posed, 0, &copy, 0, bytes);
            gpu.queue.submit([encoder.finish()]);
            copy
        })?;
        read_buffer(gpu, &copy, |content| {
            let (positions, normals) = content.split_at(count * 12);
            SkinnedPoses {
                positions: bytemuck::pod_collect_to_vec(positions),
                normals: bytemuck::pod_collect_to_vec(normals),
            }
        })
    }
}

impl RestBones {
    fn len(&self) -> usize {
        match self {
            Self::Linear(bones) | Self::Dual(bones) => bones.bone_count(),
            Self::StretchTwist(bones) => bones.bone_count(),
        }
    }

    /// Every pose's bones as its kernel reads them.
    fn prepare(&self, poses: &SkinPoses, out: &mut Vec<[f32; 4]>) -> Result<(), RenderError> {
        out.clear();
        let bones = self.len().max(1);
        match (self, poses) {
            (Self::Linear(rest), SkinPoses::Frames(frames)) => {
                frames.chunks(bones).try_for_each(|pose| rest.rows(pose, |_, rows| out.extend(rows)))?;
            }
            (Self::Dual(rest), SkinPoses::Frames(frames)) => {
                frames.chunks(bones).try_for_each(|pose| {
                    // The shaders' quaternions are (x, y, z, w).
                    rest.motions(pose, |_, [w, x, y, z, dw, dx, dy, dz]| out.extend([[x, y, z, w], [dx, dy, dz, dw]]))
                })?;
            }
            (Self::StretchTwist(rest), SkinPoses::StretchTwist(poses)) => {
                poses.chunks(bones).try_for_each(|pose| {
                    rest.posed(pose, |_, posed| {
                        out.extend(stretched(posed));
                        Ok(())
                    })
                })?;
            }
            _ => return Err(RenderError::OtherPoses),
        }
        Ok(())
    }
}

fn stretched(bone: &PosedBone) -> [[f32; 4]; 5] {
    let [first, growth] = bone.half_twist;
    [
        bone.turn.as_quat().to_array(),
        bone.axis.as_vec3().extend(first).to_array(),
        bone.rest_start.as_vec3().extend(growth).to_array(),
        bone.start.as_vec3().extend(0.0).to_array(),
        bone.longer.as_vec3().extend(0.0).to_array(),
    ]
}

fn storage(device: &wgpu::Device, label: &str, bytes: usize) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        // A binding cannot be empty.
        size: bytes.max(48) as u64,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

fn pipeline(device: &wgpu::Device, source: &str, entry: &str) -> wgpu::ComputePipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("skinning"),
        source: wgpu::ShaderSource::Wgsl(format!("{COMMON}\n{source}").into()),
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("skinning"),
        layout: None,
        module: &module,
        entry_point: Some(entry),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

fn rest_vertices(shape: &RestShape) -> Vec<RestVertex> {
    let vertex = |(&position, &normal)| RestVertex { position, pad: 0.0, normal: unit_normal(normal), pad_too: 0.0 };
    shape.positions.iter().zip(shape.normals).map(vertex).collect()
}

fn packed(influences: &Influences, ends: &[f32]) -> Vec<Influence> {
    let ends = ends.iter().copied().chain(std::iter::repeat(0.0));
    let influence = |((&bone, &weight), end): ((&u16, &f32), f32)| Influence {
        bone: bone.into(),
        weight,
        end: end.clamp(0.0, 1.0),
    };
    influences.bones().iter().zip(influences.weights()).zip(ends).map(influence).collect()
}
