//! Inverse kinematics of rigs with hundreds of bones: preparing it, and a frame.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use armature_character::inverse_kinematics::{BoneRole, InverseKinematics};
use armature_character::{Character, Provenance, SkinKind, Surface};
use armature_geometry::{Influences, TriangleMesh};
use armature_rig::{Bone, BoneQuality, BoneStatus, PoseCompletion, PoseMoment, Skeleton, Transform};
use glam::{Quat, Vec3};

use super::deform::defect;
use super::volume_growth::exponent;
use super::{Measurement, median, time_runs};
use crate::cli::args::BenchArgs;
use crate::failure::Failure;

pub(super) const NAMES: &[&str] = &[
    "rig/large-100",
    "rig/large-200",
    "rig/large-300",
    "rig/large-600",
    "rig/large-power",
    "rig/large-growth",
    "rig/large-frame-100",
    "rig/large-frame-600",
    "rig/large-frame-power",
];

const BONES: [usize; 4] = [100, 200, 300, 600];
/// Each chain's last bone is driven.
const CHAIN: usize = 10;
const RINGS: usize = 4;
const CORNERS: usize = 8;
const RUNS: usize = 3;
const FRAMES: usize = 51;

pub(super) fn run(_: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let (mut preparing, mut frames) = (Vec::new(), Vec::new());
    for bones in BONES {
        let (prepared, frame) = measure(bones)?;
        preparing.push((bones as f64, prepared));
        frames.push((bones as f64, frame));
    }
    let seconds = |at: usize| Measurement::new(NAMES[at], preparing[at].1, "s", RUNS);
    let micros = |name, at: usize| Measurement::new(name, 1e6 * frames[at].1, "µs", FRAMES);
    Ok(vec![
        seconds(0),
        seconds(1),
        seconds(2),
        seconds(3).at_most(1.0, "at most 1 s"),
        Measurement::new(NAMES[4], exponent(&preparing), "power", RUNS).at_most(1.3, "at most 1.3"),
        Measurement::new(NAMES[5], preparing[3].1 / preparing[0].1, "times", RUNS).at_most(8.0, "at most 8 times"),
        micros(NAMES[6], 0),
        micros(NAMES[7], 3),
        Measurement::new(NAMES[8], exponent(&frames), "power", FRAMES).at_most(1.3, "at most 1.3"),
    ])
}

/// Seconds to prepare inverse kinematics of this many bones, all of them solved or driven, and for a frame.
fn measure(bones: usize) -> Result<(f64, f64), Failure> {
    let character = chains(bones)?;
    let mut ik = InverseKinematics::new(&character, &[]).map_err(|e| defect(e.to_string()))?;
    let driven: Vec<bool> = (0..bones).map(|bone| bone % CHAIN == CHAIN - 1).collect();
    let mut outcome = Ok(());
    let seconds = time_runs(RUNS, || outcome = ik.drive(&driven, &mut |_, _| ControlFlow::Continue(())));
    outcome.map_err(|e| defect(e.to_string()))?;
    if ik.roles().contains(&BoneRole::Follows) {
        return Err(defect("a bone is not solved".into()));
    }
    let quality = |driven: &bool| if *driven { BoneQuality::Live } else { BoneQuality::Unmapped };
    let status: Vec<BoneStatus> =
        driven.iter().map(|driven| BoneStatus { quality: quality(driven), held_samples: 0 }).collect();
    let mut times = Vec::new();
    for frame in 0..=FRAMES {
        let mut pose = character.skeleton.rest_pose();
        for bone in (0..bones).filter(|bone| driven[*bone]) {
            let angle = 0.5 * (0.05 * frame as f32 + bone as f32).sin();
            pose.parent_from_bone[bone].rotation *= Quat::from_rotation_x(angle);
        }
        let began = Instant::now();
        ik.complete(PoseMoment { device_micros: 5_000 * frame as u64, ..PoseMoment::default() }, &status, &mut pose);
        // The first starts from the rest pose, which takes many more steps.
        if frame > 0 {
            times.push(began.elapsed().as_secs_f64());
        }
    }
    times.sort_by(f64::total_cmp);
    Ok((median(&seconds), median(&times)))
}

/// Chains of bones, upright in a row, each a tube; the first bones of all chains are a chain themselves.
fn chains(bones: usize) -> Result<Character, Failure> {
    let head = |bone: usize| Vec3::new(2.0 * (bone / CHAIN) as f32, (bone % CHAIN) as f32, ((bone / CHAIN) % 7) as f32);
    let parent = |bone: usize| if bone.is_multiple_of(CHAIN) { bone.checked_sub(CHAIN) } else { Some(bone - 1) };
    let skeleton = (0..bones).map(|bone| {
        let above = parent(bone).map_or(Vec3::ZERO, head);
        let rest = Transform { translation: head(bone) - above, ..Transform::IDENTITY };
        Bone { name: format!("bone {bone}"), parent: parent(bone), rest, tail: Vec3::Y }
    });
    let skeleton = Skeleton::new(skeleton.collect()).map_err(|e| defect(e.to_string()))?;
    let (mut vertices, mut triangles, mut followed, mut weights) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for bone in 0..bones {
        let first = vertices.len() as u32;
        for ring in 0..RINGS {
            let share = ring as f32 / (2 * RINGS - 2) as f32;
            for corner in 0..CORNERS {
                let turn = Quat::from_rotation_y(std::f32::consts::TAU * corner as f32 / CORNERS as f32);
                let along = ring as f32 / (RINGS - 1) as f32;
                vertices.push((head(bone) + Vec3::Y * along + turn * (0.3 * Vec3::X)).as_dvec3().to_array());
                followed.extend([bone as u16, parent(bone).unwrap_or(bone) as u16]);
                weights.extend([0.5 + share, 0.5 - share]);
                if ring > 0 {
                    let at = |ring: usize, corner: usize| first + (ring * CORNERS + corner % CORNERS) as u32;
                    let [a, b, c, d] =
                        [at(ring - 1, corner), at(ring, corner), at(ring, corner + 1), at(ring - 1, corner + 1)];
                    triangles.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
    }
    let mesh = TriangleMesh { vertices, triangles };
    let influences = Influences::new(2, followed, weights, bones).map_err(|e| defect(e.to_string()))?;
    let surface = Surface {
        normals: vec![[0.0, 0.0, 1.0]; mesh.vertices.len()],
        texture_coordinates: None,
        vertex_colors: None,
        influences,
        endpoints: None,
        parts: vec![Surface::one_part(&mesh)],
        morph_targets: Vec::new(),
        mesh,
    };
    Ok(Character {
        name: "chains".into(),
        surface: Arc::new(surface),
        materials: Vec::new(),
        skeleton,
        skins: Vec::new(),
        skin: SkinKind::Linear,
        avatar: None,
        provenance: Provenance::Artist,
        warnings: Vec::new(),
    })
}
