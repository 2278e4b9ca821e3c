//! Stretchable, twistable bones compared with linear blending and dual quaternions (thesis figures 6.7 and 6.8): a hand
//! given half a turn, and an arm that is stretched.
//!
//! `cargo run --release --example twisted_and_stretched [-- FOLDER]` binds the human's left arm and hand to three
//! bones by bounded biharmonic weights, whose ends are told apart by those of its joints (thesis eq. 6.7), and writes
//! two pictures. The ones in `host/assets` were made by it.

use std::error::Error;
use std::f32::consts::PI;
use std::ops::ControlFlow;
use std::path::PathBuf;

use armature::pictures::draw_scene;
use armature_character::Character;
use armature_character::handle_weights::{
    BiharmonicTier, HandlePlace, HandleShape, HandleWeightsSettings, Held, Partition, WeightMethod, WeightsOn,
    handle_weights,
};
use armature_character::own::human;
use armature_deform::skin::{
    BoneBlend, BoneSegment, DualQuaternionSkin, LinearBlendSkin, SkinError, StretchTwist, StretchTwistSkin,
};
use armature_geometry::Influences;
use armature_render::{Bounds, Camera, Ground, Material, MeshView, Picture, Scene, encode_png};
use armature_weights::WeightMatrix;
use armature_weights::endpoints::{endpoint_weights_from_joints, endpoint_weights_of_influences};
use armature_weights::finish::sparsify;
use armature_weights::handles::FREE_NEAR_JOINTS;
use glam::{Affine3A, Quat, Vec3};

const ARM: [&str; 3] = ["LeftUpperArm", "LeftLowerArm", "LeftHand"];
/// Pixels across and down, and how many times finer the picture is drawn.
const TILE: [u32; 2] = [360, 200];
const FINER: u32 = 2;

type Vectors = Vec<[f32; 3]>;
/// Writes posed positions and normals.
type Way<'a> = &'a mut dyn FnMut(&mut Vectors, &mut Vectors) -> Result<(), SkinError>;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("host/assets"), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    let rig = Rig::new(human()?)?;
    let shots = [("twisted-forearm.png", rig.twisted(), 0.35), ("stretched-arm.png", rig.stretched(), 1.05)];
    for (file, pose, pitch) in shots {
        let path = folder.join(file);
        std::fs::write(&path, encode_png(&rig.sheet(&pose, pitch)?)?)?;
        println!("{}", path.display());
    }
    Ok(())
}

/// A character whose bones are segments, with weights along and across them.
struct Rig {
    character: Character,
    segments: Vec<BoneSegment>,
    influences: Influences,
    ends: Vec<f32>,
    /// Where the arm's bones are among the segments.
    arm: [usize; 3],
}

impl Rig {
    fn new(character: Character) -> Result<Self, Box<dyn Error>> {
        let (mut names, mut segments) = (Vec::new(), Vec::new());
        let finger = |name: &str| ["Thumb", "Index", "Middle", "Ring", "Little"].iter().any(|f| name.contains(f));
        for (bone, (start, end)) in character.skeleton.bones().iter().zip(character.skeleton.rest_segments()) {
            if !(bone.name.starts_with("Left") && finger(&bone.name)) {
                names.push(bone.name.clone());
                segments.push(BoneSegment { start, end });
            }
        }
        let mut arm = [0; 3];
        for (place, wanted) in arm.iter_mut().zip(ARM) {
            *place = names.iter().position(|name| name == wanted).ok_or(wanted)?;
        }
        let wide = |p: Vec3| p.as_dvec3().to_array();
        let bones = segments.iter().map(|s| HandlePlace::Segments(vec![[wide(s.start), wide(s.end)]])).collect();
        let weights = weights(&character, bones, Partition::Normalised)?;
        let columns: Vec<u16> = (0..segments.len() as u16).collect();
        let (influences, _) = sparsify(&weights, 8, &columns, segments.len())?;
        let mut joints: Vec<Vec3> = Vec::new();
        let mut joint = |point: Vec3| {
            joints.iter().position(|known| known.distance(point) < 1e-4).unwrap_or_else(|| {
                joints.push(point);
                joints.len() - 1
            })
        };
        let joints_of: Vec<[usize; 2]> = segments.iter().map(|s| [joint(s.start), joint(s.end)]).collect();
        let points = joints.iter().map(|p| HandlePlace::Point(wide(*p))).collect();
        let of_joints = self::weights(&character, points, Partition::Left)?;
        let ends = endpoint_weights_from_joints(&of_joints, &joints_of).ok_or("a bone without joints")?;
        let ends = endpoint_weights_of_influences(&ends, &influences).ok_or("other bones")?;
        Ok(Self { character, segments, influences, ends, arm })
    }

    fn at_rest(&self) -> Vec<StretchTwist> {
        let still =
            |s: &BoneSegment| StretchTwist { start: s.start, turn: Quat::IDENTITY, stretch: 1.0, twist: [0.0; 2] };
        self.segments.iter().map(still).collect()
    }

    /// The hand given half a turn; the forearm follows gradually.
    fn twisted(&self) -> Vec<StretchTwist> {
        let [_, lower, hand] = self.arm;
        let forearm = (self.segments[lower].end - self.segments[lower].start).normalize();
        let mut pose = self.at_rest();
        pose[lower].twist = [0.0, PI];
        pose[hand].turn = Quat::from_axis_angle(forearm, PI);
        pose
    }

    /// Every bone of the arm lengthened, one after the other.
    fn stretched(&self) -> Vec<StretchTwist> {
        let mut pose = self.at_rest();
        let mut start = self.segments[self.arm[0]].start;
        for (bone, stretch) in self.arm.into_iter().zip([1.2, 1.6, 2.2]) {
            pose[bone].start = start;
            pose[bone].stretch = stretch;
            start += stretch * (self.segments[bone].end - self.segments[bone].start);
        }
        pose
    }

    /// Linear blending, dual quaternions, and bones that stretch and twist over dual quaternions.
    fn sheet(&self, pose: &[StretchTwist], pitch: f32) -> Result<Picture, Box<dyn Error>> {
        let (rest, normals) = (self.character.rest_positions(), &self.character.surface.normals);
        let rest_frames: Vec<Affine3A> = self.segments.iter().map(|s| Affine3A::from_translation(s.start)).collect();
        let frames: Vec<Affine3A> = pose.iter().zip(&self.segments).map(|(pose, bone)| frame(pose, bone)).collect();
        let mut linear = LinearBlendSkin::precompute(&rest, normals, &self.influences, &rest_frames)?;
        let mut dual = DualQuaternionSkin::precompute(&rest, normals, &self.influences, &rest_frames)?;
        let blend = BoneBlend::DualQuaternion;
        let mut twist =
            StretchTwistSkin::precompute(&rest, normals, &self.influences, &self.ends, &self.segments, blend)?;
        let ways: [Way; 3] = [
            &mut |positions, normals| linear.solve(&frames, positions, normals),
            &mut |positions, normals| dual.solve(&frames, positions, normals),
            &mut |positions, normals| twist.solve(pose, positions, normals),
        ];
        let mut tiles = Vec::new();
        for way in ways {
            let (mut positions, mut normals) = (rest.clone(), normals.clone());
            way(&mut positions, &mut normals)?;
            tiles.push(self.picture(&positions, &normals, pose, pitch)?);
        }
        Ok(one_above_the_other(&tiles))
    }

    fn picture(
        &self,
        positions: &[[f32; 3]],
        normals: &[[f32; 3]],
        pose: &[StretchTwist],
        pitch: f32,
    ) -> Result<Picture, Box<dyn Error>> {
        let ends: Vectors = self
            .arm
            .iter()
            .flat_map(|&bone| {
                let (pose, rest) = (&pose[bone], &self.segments[bone]);
                [pose.start, pose.start + pose.turn * (rest.end - rest.start) * pose.stretch]
            })
            .map(|p| p.to_array())
            .collect();
        let tight = Bounds::of(&ends).ok_or("no bones")?;
        let bounds = Bounds { min: tight.min, max: tight.max + 0.2 * (tight.max - tight.min) };
        let mut camera = Camera { yaw: 0.0, pitch, ..Camera::default() };
        camera.frame(&bounds, TILE[0] as f32 / TILE[1] as f32);
        let [red, green, blue, _] = self.character.materials[0].base_color.unwrap_or([1.0; 4]);
        let mesh = MeshView {
            positions,
            normals,
            triangles: &self.character.surface.mesh.triangles,
            materials: &[Material::of_color([red, green, blue].map(|c| c.powf(1.0 / 2.2)))],
            ..MeshView::default()
        };
        let whole = Bounds::of(positions).ok_or("no vertices")?;
        let scene = Scene { mesh, ground: Ground::under(&whole), ..Scene::default() };
        Ok(draw_scene(&scene, &camera, TILE.map(|side| side * FINER))?.0)
    }
}

/// What plain blending does with a stretched bone: scales all of it along itself (thesis eq. 6.3).
fn frame(pose: &StretchTwist, bone: &BoneSegment) -> Affine3A {
    let along = Quat::from_rotation_arc(Vec3::X, (bone.end - bone.start).normalize());
    let scale = Affine3A::from_quat(along)
        * Affine3A::from_scale(Vec3::new(pose.stretch, 1.0, 1.0))
        * Affine3A::from_quat(along.inverse());
    Affine3A::from_rotation_translation(pose.turn, pose.start) * scale
}

fn weights(
    character: &Character,
    places: Vec<HandlePlace>,
    partition: Partition,
) -> Result<WeightMatrix, Box<dyn Error>> {
    let named = |(number, place): (usize, HandlePlace)| HandleShape { name: number.to_string(), place };
    let shapes: Vec<HandleShape> = places.into_iter().enumerate().map(named).collect();
    let on = WeightsOn::Volume { vertices: 20_000 };
    let settings = HandleWeightsSettings {
        method: WeightMethod::BoundedBiharmonic,
        tier: BiharmonicTier::Interactive,
        on,
        partition,
        joint_release: FREE_NEAR_JOINTS,
    };
    let go_on = &mut |_, _| ControlFlow::Continue(());
    Ok(handle_weights(&character.surface.mesh, None, Held::Shapes { shapes: &shapes, cage: &[] }, &settings, go_on)?
        .weights)
}

fn one_above_the_other(tiles: &[Picture]) -> Picture {
    let rgba = tiles.iter().flat_map(|tile| halved(tile).rgba).collect();
    Picture { width: TILE[0], height: TILE[1] * tiles.len() as u32, rgba }
}

/// The mean of [`FINER`] by [`FINER`] pixels: smooth edges.
fn halved(fine: &Picture) -> Picture {
    let mut rgba = Vec::new();
    for y in 0..TILE[1] {
        for x in 0..TILE[0] {
            for channel in 0..4 {
                let part = |i: u32| {
                    let at = (y * FINER + i / FINER) * fine.width + x * FINER + i % FINER;
                    u32::from(fine.rgba[(4 * at + channel) as usize])
                };
                rgba.push(((0..FINER * FINER).map(part).sum::<u32>() / (FINER * FINER)) as u8);
            }
        }
    }
    Picture { width: TILE[0], height: TILE[1], rgba }
}
