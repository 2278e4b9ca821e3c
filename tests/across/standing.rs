//! Feet on the ground: what a table of motions slides, sinks and jumps, from a puppet's bytes to the take and back.

use std::f32::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;

use armature::characters::LoadedCharacter;
use armature::characters::ground::{GroundArgs, GroundChoice};
use armature_rig::{Motion, Pose, Skeleton, StreamSolver};
use armature_sim::serve::Options;
use armature_take::{Record, Take, verify};
use armature_tests::{Run, Setup, character, keep_going, perform};
use glam::{Affine3A, Quat, Vec3};

const RATE: f64 = 100.0;
const SECONDS: f32 = 2.0;
/// Of the human's 1.75 units, a millimetre of a person.
const MILLIMETRE: f32 = 1e-3;

/// A pose of the human by what turns each bone against the bone above, in the model's axes.
fn posed(skeleton: &Skeleton, turns: &[(&str, Quat)]) -> Pose {
    let frames = skeleton.rest_model_from_bone();
    let rotation = |bone: usize| frames[bone].to_scale_rotation_translation().1;
    let mut pose = skeleton.rest_pose();
    for (name, turn) in turns {
        let bone = skeleton.find(name).unwrap();
        let above = skeleton.bones()[bone].parent.map_or(Quat::IDENTITY, rotation);
        pose.parent_from_bone[bone].rotation = (above.inverse() * *turn * rotation(bone)).normalize();
    }
    pose
}

/// A leg with a thigh this far forward and a knee bent so much, its sole level.
fn leg(side: &'static str, forward: f32, bend: f32) -> [(String, Quat); 3] {
    let turn = |name: &str, angle: f32| (format!("{side}{name}"), Quat::from_rotation_x(angle));
    [turn("UpperLeg", -forward), turn("LowerLeg", bend), turn("Foot", forward - bend)]
}

/// From 0 to 1 and back, smoothly, once in the time of a motion.
fn once(at: f32) -> f32 {
    0.5 - 0.5 * (TAU * at).cos()
}

type Leg = (f32, f32);

/// Both legs, the trunk forward and the hips' own turn at a share of a motion.
fn moved(name: &str, at: f32) -> (Leg, Leg, f32, Quat) {
    let walk = |phase: f32| (0.4 * phase.sin(), 0.9 * phase.cos().max(0.0).powi(2));
    let s = once(at);
    match name {
        "walk" => (walk(2.0 * TAU * at), walk(2.0 * TAU * at + 0.5 * TAU), 0.0, Quat::IDENTITY),
        "squat" => ((1.1 * s, 2.0 * s), (1.1 * s, 2.0 * s), 0.6 * s, Quat::IDENTITY),
        "sit" => ((FRAC_PI_2 * s, FRAC_PI_2 * s), (FRAC_PI_2 * s, FRAC_PI_2 * s), 0.2 * s, Quat::IDENTITY),
        "kick" => ((1.2 * s, 0.6 * once(2.0 * at)), (0.0, 0.0), -0.2 * s, Quat::IDENTITY),
        "hips only" => {
            let sway = |turns: f32, by: f32| by * (turns * TAU * at).sin();
            ((0.0, 0.0), (0.0, 0.0), 0.0, Quat::from_rotation_x(sway(1.0, 0.2)) * Quat::from_rotation_z(sway(2.0, 0.1)))
        }
        other => panic!("{other}"),
    }
}

/// The motion as a puppet performs it that has a joint for every bone.
fn performed(human: &Arc<LoadedCharacter>, name: &str, ground: GroundChoice) -> Run {
    let skeleton = &human.skeleton;
    let frames = (0..=(SECONDS * 60.0) as u16).map(|frame| {
        let (left, right, lean, hips) = moved(name, f32::from(frame) / (SECONDS * 60.0));
        let legs: Vec<_> =
            [leg("Left", left.0, left.1), leg("Right", right.0, right.1)].into_iter().flatten().collect();
        let mut turns: Vec<(&str, Quat)> = legs.iter().map(|(bone, turn)| (bone.as_str(), *turn)).collect();
        turns.extend([("Spine", Quat::from_rotation_x(lean)), ("Hips", hips)]);
        posed(skeleton, &turns)
    });
    let motion = Motion::new(skeleton.clone(), 1.0 / 60.0, frames.collect()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("motion.bvh");
    std::fs::write(&file, armature_formats::motion::write_bvh(&motion).unwrap()).unwrap();
    let options = Options { puppet: file.to_str().unwrap().into(), seed: 3, rest: 0.1, ..Options::default() };
    let puppet = options.puppet().unwrap();
    let seconds = puppet.lead_in_seconds() + f64::from(SECONDS);
    let ground = GroundArgs { ground: Some(ground), contacts: Vec::new() };
    perform(puppet, human, &Setup { ground, ..Setup::samples((seconds * RATE) as u32, RATE) })
}

/// What a take does on the floor.
#[derive(Debug, Default)]
struct Measured {
    /// Of the point that carries, while it does; with still roots, for comparison.
    slide: f32,
    slide_with_still_roots: f32,
    /// How far the skin comes below the floor, and how far the lowest of it is ever above.
    sunk: f32,
    hovers: f32,
    /// The furthest the root comes in a sample, over the furthest that a foot does.
    jump: f32,
    /// Where the roots are in the end.
    travel: Vec3,
    /// The lowest the hips come.
    lowest: f32,
    changes: usize,
}

fn measured(take: &Take, human: &LoadedCharacter) -> Measured {
    let skeleton = take.skeleton().unwrap();
    let mut solver = StreamSolver::new(skeleton.clone());
    let mut skin = human.precompute_skin().unwrap().unwrap();
    let shape = human.shape.as_ref().unwrap();
    let (mut positions, mut normals) = (shape.positions.clone(), shape.normals().to_vec());
    let mut frames = vec![Affine3A::IDENTITY; skeleton.len()];
    let mut found = Measured { lowest: f32::INFINITY, ..Measured::default() };
    let mut held: Option<(usize, Vec3, Vec3)> = None;
    let mut before: Option<(Vec3, Vec<Vec3>)> = None;
    let (mut furthest_root, mut furthest_foot) = (0.0_f32, 0.0_f32);
    for (number, record) in take.records().iter().enumerate() {
        match record {
            Record::Topology(t) => solver.set_topology(t.epoch, t.tree.clone()),
            Record::Calibration(c) => solver.set_calibration(c.clone()),
            Record::Mapping(m) => solver.set_mapping(m.clone()),
            Record::Ground(ground) => solver.set_ground(ground.clone()).unwrap(),
            Record::Sample(sample) => {
                solver.solve_completed(&sample.raw, None).unwrap().forward_kinematics(skeleton, &mut frames);
                let contact = solver.ground().unwrap();
                let (offset, points) = (contact.offset(), &contact.ground().points);
                let place = |point: usize| frames[points[point].bone].transform_point3(points[point].at);
                let point = contact.standing().next().expect("a foot carries");
                match held {
                    Some((same, there, still)) if same == point => {
                        let flat = |v: Vec3| v.with_y(0.0).length();
                        found.slide = found.slide.max(flat(place(point) - there));
                        let moved = flat(place(point) - offset - still);
                        found.slide_with_still_roots = found.slide_with_still_roots.max(moved);
                    }
                    _ => {
                        found.changes += 1;
                        held = Some((point, place(point), place(point) - offset));
                    }
                }
                let still: Vec<Vec3> = contact
                    .ground()
                    .contacts
                    .iter()
                    .map(|&bone| Vec3::from(frames[bone].translation) - offset)
                    .collect();
                if let Some((root, feet)) = before.replace((offset, still.clone())) {
                    furthest_root = furthest_root.max(offset.distance(root));
                    furthest_foot = still.iter().zip(feet).fold(furthest_foot, |far, (a, b)| far.max(a.distance(b)));
                }
                found.travel = offset;
                found.lowest = found.lowest.min(frames[0].translation.y);
                if number % 7 == 0 {
                    skin.solve(&frames, &mut positions, &mut normals).unwrap();
                    let low = positions.iter().fold(f32::INFINITY, |low, position| low.min(position[1]));
                    let height = low - contact.ground().floor;
                    (found.sunk, found.hovers) = (found.sunk.max(-height), found.hovers.max(height));
                }
            }
            _ => {}
        }
    }
    found.jump = furthest_root / furthest_foot.max(1e-6);
    found
}

#[test]
fn a_table_of_motions_on_the_floor() {
    let human = character("human");
    for (name, mode) in [
        ("walk", GroundChoice::Walk),
        ("squat", GroundChoice::Stand),
        ("sit", GroundChoice::Stand),
        ("kick", GroundChoice::Stand),
        ("hips only", GroundChoice::Stand),
    ] {
        let run = performed(&human, name, mode);
        let verification = verify(&run.take, &mut keep_going).unwrap();
        assert!(verification.is_exact(), "{name}: {verification:?}");
        let found = measured(&run.take, &human);
        println!("{name}: {found:?}");
        assert!(found.slide < MILLIMETRE, "{name}: the foot on the floor slides by {}", found.slide);
        assert!(found.sunk < 5.0 * MILLIMETRE, "{name}: the skin sinks in by {}", found.sunk);
        assert!(found.hovers < 5.0 * MILLIMETRE, "{name}: nothing touches the floor, by {}", found.hovers);
        assert!(found.jump < 1.5, "{name}: the root moves {} times as far in a sample as any foot", found.jump);
        let rest = human.skeleton.rest_model_from_bone()[0].translation.y;
        match name {
            "walk" => assert!(found.travel.z > 1.0 && found.travel.x.abs() < 0.1, "{}", found.travel),
            "squat" | "sit" => assert!(found.lowest < rest - 0.3, "the hips sink to {}", found.lowest),
            _ => {}
        }
    }
}

#[test]
fn a_take_says_how_its_character_stands_and_without_a_floor_all_is_as_before() {
    let human = character("human");
    let [off, walk] = [GroundChoice::Off, GroundChoice::Walk].map(|choice| performed(&human, "walk", choice));
    assert!(off.take.ground().is_none());
    let read = Take::read(&walk.bytes).unwrap().0;
    assert_eq!(read.ground().unwrap().contacts.len(), 2);
    let floating = armature_take::solve_on_ground(&walk.take, None, None, &mut keep_going).unwrap();
    let poses = |take: &Take| take.poses().cloned().collect::<Vec<_>>();
    assert!(poses(&floating) == poses(&off.take), "without the floor the take is the one without it");
    let again = armature_take::solve_on_ground(&off.take, walk.take.ground(), None, &mut keep_going).unwrap();
    assert!(poses(&again) == poses(&walk.take), "with the floor the other is this one");
}
