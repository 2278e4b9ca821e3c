//! Many poses skinned by the shaders and by their twins.
//!
//! Without a graphics adapter these tests say so and pass; with `ARMATURE_REQUIRE_GPU` set they fail.

use armature_deform::{
    BoneBlend, BoneSegment, DualQuaternionSkin, LinearBlendSkin, SkinError, StretchTwist, StretchTwistSkin,
};
use armature_geometry::Influences;
use armature_render::{Gpu, GpuSkin, RenderError, RestShape, SkinMethod, SkinPoses, SkinnedPoses};
use glam::{Affine3A, Mat3, Quat, Vec3};

const VERTICES: usize = 1001;
const BONES: usize = 11;
const POSES: usize = 5;
/// Of a shape whose size is about one.
const AGREE: f32 = 1e-4;

fn adapter() -> Option<Gpu> {
    match Gpu::request() {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            assert!(std::env::var_os("ARMATURE_REQUIRE_GPU").is_none(), "ARMATURE_REQUIRE_GPU is set, but {error}");
            eprintln!("SKIPPED: the skinning shaders are not compared with their twins: {error}");
            None
        }
    }
}

/// A linear congruential generator (Knuth's constants); the upper bits count.
struct Random(u64);

impl Random {
    /// -1 to 1.
    fn signed(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 40) as f32 / (1_u64 << 23) as f32) - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }

    fn turn(&mut self) -> Quat {
        Quat::from_scaled_axis(3.0 * self.vector())
    }
}

struct Character {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    influences: Influences,
    ends: Vec<f32>,
    frames: Vec<Affine3A>,
    segments: Vec<BoneSegment>,
}

impl Character {
    fn new(random: &mut Random, per_vertex: usize) -> Self {
        let positions = (0..VERTICES).map(|_| random.vector().to_array()).collect();
        // One in a hundred has no face, and so no normal.
        let normals =
            (0..VERTICES).map(|v| if v % 100 == 99 { [0.0; 3] } else { random.vector().to_array() }).collect();
        let slots = VERTICES * per_vertex;
        let bones = (0..slots).map(|slot| ((slot / per_vertex + 3 * (slot % per_vertex)) % BONES) as u16).collect();
        let weights = (0..slots).map(|_| random.signed().max(0.0) + 1e-3).collect();
        let influences = Influences::new(per_vertex, bones, weights, BONES).expect("influences");
        let frames = (0..BONES).map(|_| Affine3A::from_rotation_translation(random.turn(), random.vector())).collect();
        // The last one has no length, and so no axis to twist about.
        let segment = |bone: usize, random: &mut Random| {
            let start = random.vector();
            BoneSegment { start, end: if bone + 1 == BONES { start } else { start + random.vector() } }
        };
        let segments = (0..BONES).map(|bone| segment(bone, random)).collect();
        let ends = (0..slots).map(|_| 0.6 + 0.7 * random.signed()).collect();
        Self { positions, normals, influences, ends, frames, segments }
    }

    fn shape(&self) -> RestShape<'_> {
        RestShape { positions: &self.positions, normals: &self.normals, influences: &self.influences }
    }
}

type Skinned = (Vec<[f32; 3]>, Vec<[f32; 3]>);

fn room() -> Skinned {
    (vec![[0.0; 3]; VERTICES], vec![[0.0; 3]; VERTICES])
}

fn compare(
    name: &str,
    gpu: &Gpu,
    SkinnedPoses { positions, normals }: SkinnedPoses,
    twin: impl Iterator<Item = Skinned>,
) {
    let mut worst = [0.0_f32; 2];
    let mut poses = 0;
    for (pose, expected) in twin.enumerate() {
        let rows = pose * VERTICES..(pose + 1) * VERTICES;
        let of_gpu = [&positions[rows.clone()], &normals[rows]];
        for (kind, (ours, theirs)) in of_gpu.into_iter().zip([&expected.0, &expected.1]).enumerate() {
            assert_eq!(ours.len(), theirs.len());
            for (a, b) in ours.as_flattened().iter().zip(theirs.as_flattened()) {
                assert!(a.is_finite());
                worst[kind] = worst[kind].max((a - b).abs());
            }
        }
        poses += 1;
    }
    assert_eq!((poses, positions.len(), normals.len()), (POSES, POSES * VERTICES, POSES * VERTICES));
    eprintln!("{name}, {}: positions apart by {:.1e}, normals by {:.1e}", gpu.label(), worst[0], worst[1]);
    assert!(worst.iter().all(|apart| *apart < AGREE), "{name}: {worst:?}");
}

/// Rigid in the first poses; then scaled, sheared and reflected.
fn frames(random: &mut Random) -> Vec<Affine3A> {
    let frame = |number: usize, random: &mut Random| {
        let rigid = Affine3A::from_rotation_translation(random.turn(), random.vector());
        let odd = Mat3::from_cols(
            1.3 * Vec3::X,
            Vec3::new(0.2, 0.8, 0.0),
            if number.is_multiple_of(7) { -Vec3::Z } else { Vec3::Z },
        );
        if number < 3 * BONES { rigid } else { rigid * Affine3A::from_mat3(odd) }
    };
    (0..POSES * BONES).map(|number| frame(number, random)).collect()
}

#[test]
fn linear_blending_agrees_with_its_twin() {
    let Some(gpu) = adapter() else { return };
    let mut random = Random(1);
    for per_vertex in [1, 4, 8] {
        let character = Character::new(&mut random, per_vertex);
        let frames = frames(&mut random);
        let method = SkinMethod::LinearBlend(&character.frames);
        let mut skin = GpuSkin::precompute(&gpu, &character.shape(), &method, POSES).expect("a skin");
        skin.solve(&gpu, &SkinPoses::Frames(&frames)).expect("poses");
        let Character { positions, normals, influences, .. } = &character;
        let mut twin = LinearBlendSkin::precompute(positions, normals, influences, &character.frames).expect("twin");
        let twins = frames.chunks(BONES).map(|pose| {
            let mut out = room();
            twin.solve(pose, &mut out.0, &mut out.1).expect("pose");
            out
        });
        compare("linear blending", &gpu, skin.read(&gpu).expect("result"), twins);
    }
}

#[test]
fn dual_quaternions_agree_with_their_twin() {
    let Some(gpu) = adapter() else { return };
    let mut random = Random(2);
    for per_vertex in [1, 4, 8] {
        let character = Character::new(&mut random, per_vertex);
        let frames = frames(&mut random);
        let method = SkinMethod::DualQuaternion(&character.frames);
        let mut skin = GpuSkin::precompute(&gpu, &character.shape(), &method, POSES).expect("a skin");
        skin.solve(&gpu, &SkinPoses::Frames(&frames)).expect("poses");
        let Character { positions, normals, influences, .. } = &character;
        let mut twin = DualQuaternionSkin::precompute(positions, normals, influences, &character.frames).expect("twin");
        let twins = frames.chunks(BONES).map(|pose| {
            let mut out = room();
            twin.solve(pose, &mut out.0, &mut out.1).expect("pose");
            out
        });
        compare("dual quaternions", &gpu, skin.read(&gpu).expect("result"), twins);
    }
}

#[test]
fn stretched_and_twisted_bones_agree_with_their_twin() {
    let Some(gpu) = adapter() else { return };
    let mut random = Random(3);
    for (per_vertex, blend) in
        [1, 4, 8].into_iter().flat_map(|k| [(k, BoneBlend::Linear), (k, BoneBlend::DualQuaternion)])
    {
        let character = Character::new(&mut random, per_vertex);
        let pose = |number: usize, random: &mut Random| StretchTwist {
            start: random.vector(),
            turn: random.turn(),
            // Bones that neither stretch nor twist are among them.
            stretch: if number.is_multiple_of(3) { 1.0 } else { 1.0 + 0.8 * random.signed() },
            twist: if number.is_multiple_of(3) { [0.0; 2] } else { [4.0 * random.signed(), 9.0 * random.signed()] },
        };
        let poses: Vec<StretchTwist> = (0..POSES * BONES).map(|number| pose(number, &mut random)).collect();
        let Character { positions, normals, influences, ends, segments, .. } = &character;
        let method = SkinMethod::StretchTwist { rest: segments, end_weights: ends, blend };
        let mut skin = GpuSkin::precompute(&gpu, &character.shape(), &method, POSES).expect("a skin");
        skin.solve(&gpu, &SkinPoses::StretchTwist(&poses)).expect("poses");
        let mut twin =
            StretchTwistSkin::precompute(positions, normals, influences, ends, segments, blend).expect("twin");
        let twins = poses.chunks(BONES).map(|pose| {
            let mut out = room();
            twin.solve(pose, &mut out.0, &mut out.1).expect("pose");
            out
        });
        compare(&format!("stretched, {blend:?}"), &gpu, skin.read(&gpu).expect("result"), twins);
    }
}

#[test]
fn what_cannot_be_skinned_is_named() {
    let Some(gpu) = adapter() else { return };
    let character = Character::new(&mut Random(4), 4);
    let rest = &character.frames;
    let method = SkinMethod::LinearBlend(rest);
    let mut skin = GpuSkin::precompute(&gpu, &character.shape(), &method, 2).expect("a skin");
    assert_eq!((skin.vertex_count(), skin.bone_count()), (VERTICES, BONES));
    let bad = |skin: &mut GpuSkin, poses: &SkinPoses| skin.solve(&gpu, poses).expect_err("it is wrong");
    let short = bad(&mut skin, &SkinPoses::Frames(&rest[..BONES - 1]));
    assert!(matches!(short, RenderError::Skin(SkinError::Length { expected: BONES, .. })), "{short}");
    let many = bad(&mut skin, &SkinPoses::Frames(&rest.repeat(3)));
    assert!(matches!(many, RenderError::Skin(SkinError::Length { .. })), "{many}");
    let mut holed = rest.repeat(2);
    holed[BONES + 3].translation.y = f32::NAN;
    let holed = bad(&mut skin, &SkinPoses::Frames(&holed));
    assert!(matches!(holed, RenderError::Skin(SkinError::PoseNotFinite { bone: 3 })), "{holed}");
    let other = bad(&mut skin, &SkinPoses::StretchTwist(&[]));
    assert!(matches!(other, RenderError::OtherPoses), "{other}");
    skin.solve(&gpu, &SkinPoses::Frames(&[])).expect("no pose is fine");
    assert!(skin.read(&gpu).expect("nothing").positions.is_empty());
    let huge = GpuSkin::precompute(&gpu, &character.shape(), &method, 1 << 24).expect_err("too much");
    assert!(matches!(huge, RenderError::TooMuchToSkin { .. }), "{huge}");
    let unbent = SkinMethod::LinearBlend(&rest[..1]);
    let missing = GpuSkin::precompute(&gpu, &character.shape(), &unbent, 1).expect_err("bones are missing");
    assert!(matches!(missing, RenderError::Skin(SkinError::BoneOutOfRange { .. })), "{missing}");
}
