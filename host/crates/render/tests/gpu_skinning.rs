//! Many poses skinned by the shaders: what every evaluator promises, and agreement with the CPU kernels.
//!
//! Without a graphics adapter these tests say so and pass; with `ARMATURE_REQUIRE_GPU` set they fail.

#[path = "../../deform/tests/skin_suite/mod.rs"]
#[macro_use]
mod skin_suite;

use armature_deform::skin::{LinearBlendSkin, MorphOffsets, Morphs, SkinError, StretchTwist};
use armature_render::{Gpu, GpuSkin, RenderError, RestShape, SkinMethod, SkinPoses};
use skin_suite::{
    Character, Cpu, Dice, Evaluator, METHODS, Method, Poses, Rest, Skinned, sheared_frames, stretched_pose,
};

/// For a shape of size about one.
const AGREE: f64 = 1e-4;

struct Shaders(Gpu);

impl Evaluator for Shaders {
    fn bound(&self, of_cpu: f64) -> f64 {
        of_cpu.max(AGREE)
    }

    fn skin(&mut self, rest: Rest<'_>, method: Method, poses: &Poses) -> Result<Vec<Skinned>, SkinError> {
        let Rest { positions, normals, influences, ends, frames, segments } = rest;
        let shape = RestShape { positions, normals, influences };
        let (method, bones) = match method {
            Method::LinearBlend => (SkinMethod::LinearBlend(frames), frames.len()),
            Method::DualQuaternion => (SkinMethod::DualQuaternion(frames), frames.len()),
            Method::StretchTwist(blend) => {
                (SkinMethod::StretchTwist { rest: segments, end_weights: ends, blend }, segments.len())
            }
        };
        let (poses, given) = match poses {
            Poses::Frames(frames) => (SkinPoses::Frames(frames), frames.len()),
            Poses::Stretched(poses) => (SkinPoses::StretchTwist(poses), poses.len()),
        };
        let mut skin = skin_error(GpuSkin::precompute(&self.0, &shape, &method, given.div_ceil(bones)))?;
        skin_error(skin.solve(&self.0, &poses))?;
        let all = skin_error(skin.read(&self.0))?;
        let rows = positions.len().max(1);
        Ok(all.positions.chunks(rows).zip(all.normals.chunks(rows)).map(|(p, n)| (p.to_vec(), n.to_vec())).collect())
    }
}

fn skin_error<T>(outcome: Result<T, RenderError>) -> Result<T, SkinError> {
    outcome.map_err(|error| match error {
        RenderError::Skin(error) => error,
        other => panic!("{other}"),
    })
}

fn adapter() -> Option<Shaders> {
    match Gpu::request() {
        Ok(gpu) => Some(Shaders(gpu)),
        Err(error) => {
            assert!(std::env::var_os("ARMATURE_REQUIRE_GPU").is_none(), "ARMATURE_REQUIRE_GPU is set, but {error}");
            eprintln!("SKIPPED: the skinning shaders are not compared with their twins: {error}");
            None
        }
    }
}

skin_suite!(adapter());

const VERTICES: usize = 1001;
const BONES: usize = 11;
const POSES: usize = 5;

#[test]
fn many_poses_at_once_agree_with_the_kernels_on_the_cpu() {
    let Some(mut gpu) = adapter() else { return };
    let dice = &mut Dice(1);
    for method in METHODS {
        for per_vertex in [1, 4, 8] {
            let mut character = Character::new(VERTICES, BONES, per_vertex, dice);
            // One in a hundred has no face and so no normal; one bone has no length; some are beyond their ends.
            character.normals.iter_mut().skip(99).step_by(100).for_each(|normal| *normal = [0.0; 3]);
            character.segments[BONES - 1].end = character.segments[BONES - 1].start;
            character.ends.iter_mut().for_each(|end| *end = 1.4 * *end - 0.1);
            let poses = match method {
                Method::StretchTwist(_) => Poses::Stretched(some_plain(stretched_pose(BONES * POSES, 9.0, 0.8, dice))),
                _ => Poses::Frames(sheared_frames(BONES, POSES, dice)),
            };
            let ours = gpu.skin(character.rest(), method, &poses).expect("poses");
            let theirs = Cpu.skin(character.rest(), method, &poses).expect("poses");
            assert_eq!((ours.len(), theirs.len()), (POSES, POSES));
            let mut worst = [0.0_f64; 2];
            for (ours, theirs) in ours.iter().zip(&theirs) {
                for (kind, (a, b)) in [(&ours.0, &theirs.0), (&ours.1, &theirs.1)].into_iter().enumerate() {
                    assert_eq!(a.len(), b.len());
                    for (a, b) in a.as_flattened().iter().zip(b.as_flattened()) {
                        assert!(a.is_finite());
                        worst[kind] = worst[kind].max(f64::from((a - b).abs()));
                    }
                }
            }
            let label = gpu.0.label();
            eprintln!("{method:?}, {label}: positions apart by {:.1e}, normals by {:.1e}", worst[0], worst[1]);
            assert!(worst.iter().all(|apart| *apart < AGREE), "{method:?}: {worst:?}");
        }
    }
}

/// Every third bone neither stretches nor twists.
fn some_plain(mut poses: Vec<StretchTwist>) -> Vec<StretchTwist> {
    poses.iter_mut().step_by(3).for_each(|bone| (bone.stretch, bone.twist) = (1.0, [0.0; 2]));
    poses
}

#[test]
fn morph_targets_are_blended_before() {
    let Some(Shaders(gpu)) = adapter() else { return };
    let character = Character::new(VERTICES, BONES, 4, &mut Dice(5));
    let Character { positions, normals, influences, frames: rest, .. } = &character;
    let offsets: Vec<[f32; 3]> = (0..50).map(|k| [0.01 * k as f32, 0.5, -0.25]).collect();
    let target = MorphOffsets { first_vertex: 100, positions: &offsets, normals: &offsets, rest_weight: 0.0 };
    let mut morphs = Morphs::precompute(positions, normals, &[target]).expect("offsets");
    let (shape, method) = (RestShape { positions, normals, influences }, SkinMethod::LinearBlend(rest));
    let mut skin = GpuSkin::precompute(&gpu, &shape, &method, 1).expect("a skin");
    let mut twin = LinearBlendSkin::precompute(positions, normals, influences, rest).expect("a skin");
    let poses = sheared_frames(BONES, 1, &mut Dice(6));
    for weight in [0.75, 0.0] {
        assert!(morphs.solve(&[weight]).expect("a weight"));
        skin.set_rest(&gpu, &morphs).expect("the same vertices");
        twin.set_rest(&morphs).expect("the same vertices");
        skin.solve(&gpu, &SkinPoses::Frames(&poses)).expect("a pose");
        let got = skin.read(&gpu).expect("a pose");
        let mut expected = (positions.clone(), normals.clone());
        twin.solve(&poses, &mut expected.0, &mut expected.1).expect("a pose");
        let pairs = got.positions.iter().zip(&expected.0).chain(got.normals.iter().zip(&expected.1));
        let apart = pairs.flat_map(|(a, b)| a.iter().zip(b)).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max);
        assert!(apart < AGREE, "weight {weight}: {apart:.1e}");
    }
}

#[test]
fn what_does_not_fit_is_named() {
    let Some(Shaders(gpu)) = adapter() else { return };
    let character = Character::new(VERTICES, BONES, 4, &mut Dice(4));
    let Character { positions, normals, influences, frames: rest, .. } = &character;
    let (shape, method) = (RestShape { positions, normals, influences }, SkinMethod::LinearBlend(rest));
    let mut skin = GpuSkin::precompute(&gpu, &shape, &method, 2).expect("a skin");
    assert_eq!((skin.vertex_count(), skin.bone_count()), (VERTICES, BONES));
    let bad = |skin: &mut GpuSkin, poses: &SkinPoses| skin.solve(&gpu, poses).expect_err("it is wrong");
    let many = bad(&mut skin, &SkinPoses::Frames(&rest.repeat(3)));
    assert!(matches!(many, RenderError::Skin(SkinError::Length { .. })), "{many}");
    let other = bad(&mut skin, &SkinPoses::StretchTwist(&[]));
    assert!(matches!(other, RenderError::OtherPoses), "{other}");
    skin.solve(&gpu, &SkinPoses::Frames(&[])).expect("no pose is fine");
    assert!(skin.read(&gpu).expect("nothing").positions.is_empty());
    let huge = GpuSkin::precompute(&gpu, &shape, &method, 1 << 24).expect_err("too much");
    assert!(matches!(huge, RenderError::TooMuchToSkin { .. }), "{huge}");
}
