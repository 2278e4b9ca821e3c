//! Skinning of many poses at once on the graphics adapter. Every kernel has its twin in `deform`.

use armature_deform::{
    BoneBlend, BoneSegment, DualQuaternionSkin, LANES, LinearBlendSkin, SkinError, StretchTwist, StretchTwistSkin,
    nearest_rotations,
};
use armature_geometry::Influences;
use bytemuck::{Pod, Zeroable, cast_slice};
use glam::{Affine3A, DAffine3, DMat3, DQuat, DVec3};
use wgpu::BufferUsages;

use super::Gpu;
use super::offscreen::read_buffer;
use crate::RenderError;

const COMMON: &str = include_str!("../../shader/skinning.wgsl");
const GROUP_SIZE: u32 = 64;
/// Groups in a row of the grid, and rows, at most: what every adapter can.
const MOST_GROUPS: u32 = 65_535;

/// A character at rest.
#[derive(Clone, Copy, Debug)]
pub struct RestShape<'a> {
    /// n×3 (model space).
    pub positions: &'a [[f32; 3]],
    /// n×3; they need no unit length, and a zero normal stays zero.
    pub normals: &'a [[f32; 3]],
    /// n rows.
    pub influences: &'a Influences,
}

/// How its bones move it.
#[derive(Clone, Copy, Debug)]
pub enum SkinMethod<'a> {
    /// As [`LinearBlendSkin`] does; one `rest_model_from_bone` a bone.
    LinearBlend(&'a [Affine3A]),
    /// As [`DualQuaternionSkin`] does; one `rest_model_from_bone` a bone.
    DualQuaternion(&'a [Affine3A]),
    /// As [`StretchTwistSkin`] does.
    StretchTwist {
        /// One a bone.
        rest: &'a [BoneSegment],
        /// As long as `influences.bones()`: how far towards its bone's end each influence sits, 0 to 1.
        end_weights: &'a [f32],
        /// What stretched and twisted bones are blended as.
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
    /// n×3 a pose (model space).
    pub positions: Vec<[f32; 3]>,
    /// n×3 a pose, unit.
    pub normals: Vec<[f32; 3]>,
}

/// A character on the graphics adapter, to be skinned in up to so many poses at once.
#[derive(Debug)]
pub struct GpuSkin {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    sizes: wgpu::Buffer,
    bones: wgpu::Buffer,
    posed: wgpu::Buffer,
    vertex_count: usize,
    most_poses: usize,
    poses: usize,
    rest: RestBones,
    scratch: Vec<[f32; 4]>,
}

#[derive(Debug)]
enum RestBones {
    Linear(Vec<DAffine3>),
    Dual { bone_from_rest: Vec<DAffine3>, origins: Vec<DVec3> },
    StretchTwist(Vec<BoneSegment>),
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Sizes {
    vertices: u32,
    bones: u32,
    per_vertex: u32,
    poses: u32,
}

#[derive(Clone, Copy, Pod, Zeroable)]
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
    /// Puts a character on the adapter, with room for `most_poses` poses at once. It is checked as the twin checks it.
    pub fn precompute(
        gpu: &Gpu,
        shape: &RestShape,
        method: &SkinMethod,
        most_poses: usize,
    ) -> Result<Self, RenderError> {
        let RestShape { positions, normals, influences } = *shape;
        let (source, entry, vectors_per_bone, rest) = match *method {
            SkinMethod::LinearBlend(frames) => {
                LinearBlendSkin::precompute(positions, normals, influences, frames)?;
                let source = include_str!("../../shader/linear_blend_skinning.wgsl");
                (source, "skin", 3, RestBones::Linear(inverses(frames)))
            }
            SkinMethod::DualQuaternion(frames) => {
                DualQuaternionSkin::precompute(positions, normals, influences, frames)?;
                let origins = frames.iter().map(|frame| frame.translation.as_dvec3()).collect();
                let source = include_str!("../../shader/dual_quaternion_skinning.wgsl");
                (source, "skin", 2, RestBones::Dual { bone_from_rest: inverses(frames), origins })
            }
            SkinMethod::StretchTwist { rest, end_weights, blend } => {
                StretchTwistSkin::precompute(positions, normals, influences, end_weights, rest, blend)?;
                let source = include_str!("../../shader/stretch_twist_skinning.wgsl");
                let entry = if blend == BoneBlend::Linear { "skin_linear" } else { "skin_dual" };
                (source, entry, 5, RestBones::StretchTwist(rest.to_vec()))
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
            let vertices = on_gpu("rest", cast_slice(&rest_vertices(shape)));
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
            let buffers = [&sizes, &vertices, &influence_buffer, &bones, &posed];
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
            let vertex_count = positions.len();
            Self { pipeline, group, sizes, bones, posed, vertex_count, most_poses, poses: 0, rest, scratch: Vec::new() }
        })
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
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
        self.poses = given.checked_div(bones).unwrap_or(0);
        if self.poses * bones != given || self.poses > self.most_poses {
            let expected = self.poses.clamp(1, self.most_poses.max(1)) * bones;
            return Err(SkinError::Length { what: "posed bones", got: given, expected }.into());
        }
        self.scratch.clear();
        match (&self.rest, poses) {
            (RestBones::Linear(rest), SkinPoses::Frames(frames)) => add_rows(frames, rest, &mut self.scratch),
            (RestBones::Dual { bone_from_rest, origins }, SkinPoses::Frames(frames)) => {
                add_dual_quaternions(frames, bone_from_rest, origins, &mut self.scratch);
            }
            (RestBones::StretchTwist(rest), SkinPoses::StretchTwist(poses)) => {
                add_stretched(poses, rest, &mut self.scratch);
            }
            _ => return Err(RenderError::OtherPoses),
        }
        if let Some(at) = self.scratch.iter().position(|v| !v.iter().all(|c| c.is_finite())) {
            let vectors_per_bone = self.scratch.len() / given;
            return Err(SkinError::PoseNotFinite { bone: at / vectors_per_bone % bones }.into());
        }
        if self.poses == 0 || self.vertex_count == 0 {
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
                pass.dispatch_workgroups((self.vertex_count as u32).div_ceil(GROUP_SIZE), poses, 1);
            }
            gpu.queue.submit([encoder.finish()]);
        })
    }

    /// What the last [`solve`](Self::solve) gave; waits for it.
    pub fn read(&self, gpu: &Gpu) -> Result<SkinnedPoses, RenderError> {
        let count = self.poses * self.vertex_count;
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
            Self::Linear(bones) | Self::Dual { bone_from_rest: bones, .. } => bones.len(),
            Self::StretchTwist(bones) => bones.len(),
        }
    }
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
    let unit = |n: &[f32; 3]| DVec3::from_array(n.map(f64::from)).normalize_or_zero().as_vec3().to_array();
    let vertex = |(&position, normal)| RestVertex { position, pad: 0.0, normal: unit(normal), pad_too: 0.0 };
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

fn widened(frame: &Affine3A) -> DAffine3 {
    DAffine3 { matrix3: frame.matrix3.as_dmat3(), translation: frame.translation.as_dvec3() }
}

fn inverses(frames: &[Affine3A]) -> Vec<DAffine3> {
    frames.iter().map(|frame| widened(frame).inverse()).collect()
}

fn add_rows(frames: &[Affine3A], bone_from_rest: &[DAffine3], to: &mut Vec<[f32; 4]>) {
    for (frame, rest) in frames.iter().zip(bone_from_rest.iter().cycle()) {
        let moved = widened(frame) * *rest;
        let rows = moved.matrix3.transpose();
        for (row, shift) in [rows.x_axis, rows.y_axis, rows.z_axis].into_iter().zip(moved.translation.to_array()) {
            to.push(row.extend(shift).as_vec4().to_array());
        }
    }
}

/// The nearest rotation of each bone's motion since rest, and where it takes the bone's origin.
fn add_dual_quaternions(frames: &[Affine3A], bone_from_rest: &[DAffine3], origins: &[DVec3], to: &mut Vec<[f32; 4]>) {
    let mut rest = bone_from_rest.iter().zip(origins).cycle();
    for eight in frames.chunks(LANES) {
        let rest: Vec<_> = rest.by_ref().take(eight.len()).collect();
        let mut linear = [[[0.0; LANES]; 3]; 3];
        for (lane, (frame, (bone_from_rest, _))) in eight.iter().zip(&rest).enumerate() {
            let moved = frame.matrix3.as_dmat3() * bone_from_rest.matrix3;
            for row in 0..3 {
                (0..3).for_each(|column| linear[row][column][lane] = moved.col(column)[row] as f32);
            }
            if !moved.is_finite() {
                // What is not finite has no nearest rotation; it is to be seen in the result.
                linear[0][0][lane] = f32::NAN;
            }
        }
        let turned = nearest_rotations(&linear);
        for (lane, (frame, (_, origin))) in eight.iter().zip(&rest).enumerate() {
            let column = |c: usize| DVec3::from_array([0, 1, 2].map(|r| f64::from(turned[r][c][lane])));
            let turn = DQuat::from_mat3(&DMat3::from_cols(column(0), column(1), column(2))).normalize();
            let turn = if linear[0][0][lane].is_finite() { turn } else { DQuat::NAN };
            let shift = frame.translation.as_dvec3() - turn * **origin;
            let dual = DQuat::from_xyzw(shift.x, shift.y, shift.z, 0.0) * turn * 0.5;
            to.extend([turn, dual].map(|q| q.to_array().map(|c| c as f32)));
        }
    }
}

fn add_stretched(poses: &[StretchTwist], rest: &[BoneSegment], to: &mut Vec<[f32; 4]>) {
    for (pose, rest) in poses.iter().zip(rest.iter().cycle()) {
        let turn = DQuat::from_array(pose.turn.to_array().map(f64::from));
        let turn = if turn.length() > 1e-12 { turn.normalize() } else { DQuat::NAN };
        let along = (rest.end - rest.start).as_dvec3();
        let axis = along.normalize_or_zero();
        let [first, last] = if axis == DVec3::ZERO { [0.0; 2] } else { pose.twist };
        let longer = turn * (along * (f64::from(pose.stretch) - 1.0));
        to.push(turn.to_array().map(|c| c as f32));
        to.push(axis.as_vec3().extend(0.5 * first).to_array());
        to.push(rest.start.extend(0.5 * (last - first)).to_array());
        to.push(pose.start.extend(0.0).to_array());
        to.push(longer.as_vec3().extend(0.0).to_array());
    }
}
