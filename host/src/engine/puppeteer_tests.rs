//! A puppeteer, sample by sample.

use armature_character::{Character, Provenance, Surface};
use armature_formats::model::MorphTarget;
use armature_geometry::{Influences, TriangleMesh};
use armature_rig::{Bone, DriveAxis, Part, PartKind, ShapeDrive, Skeleton, Transform};
use armature_take::Take;
use glam::Vec3;

use crate::engine::take_recorder::{TakeRecorder, take_header};

use super::*;

const UID: PartUid = PartUid([3; 12]);

fn puppeteer(policy: ZeroPolicy, calibration: Calibration) -> Puppeteer {
    let bone = Bone { name: "arm".into(), parent: None, rest: Transform::IDENTITY, tail: Vec3::Y };
    let character = LoadedCharacter::bare("arm", "arm", Skeleton::new(vec![bone]).unwrap());
    let mut puppeteer = Puppeteer::new(Arc::new(character), None, calibration, policy).unwrap();
    let part = Part { uid: UID, kind: PartKind::Bend, parent: None, outlet: 0, counts_per_turn: 4096 };
    puppeteer.set_topology(1, JointTree::new(vec![part]).unwrap(), &mut unheard);
    puppeteer
}

fn sample(counts: u16, state: SensorState) -> RawSample {
    RawSample { epoch: 1, counts: vec![counts], states: vec![state], ..RawSample::default() }
}

fn angle(puppeteer: &Puppeteer) -> f32 {
    puppeteer.pose().parent_from_bone[0].rotation.to_axis_angle().1
}

#[test]
fn the_first_good_sample_is_the_rest_pose() {
    let mut puppeteer = puppeteer(ZeroPolicy::WhenUnknown, Calibration::default());
    let early = puppeteer.follow(&sample(9, SensorState::NoData)).unwrap();
    assert_eq!(early, Step::Posed { zeroed: None, told: Vec::new() });
    assert!(puppeteer.waits_for_zero());
    let Step::Posed { zeroed: Some(report), .. } = puppeteer.follow(&sample(1000, SensorState::Ok)).unwrap() else {
        panic!("the first good sample is taken as zero")
    };
    assert_eq!(report.zeroed, 1);
    assert!(angle(&puppeteer).abs() < 1e-6);
    puppeteer.follow(&sample(1000 + 1024, SensorState::Ok)).unwrap();
    assert!((angle(&puppeteer) - std::f32::consts::FRAC_PI_2).abs() < 1e-5);
}

#[test]
fn a_calibrated_joint_is_not_zeroed_again_unless_asked() {
    let mut first = puppeteer(ZeroPolicy::WhenUnknown, Calibration::default());
    first.follow(&sample(1000, SensorState::Ok)).unwrap();
    let known = first.calibration().clone();
    let mut second = puppeteer(ZeroPolicy::WhenUnknown, known.clone());
    assert!(!second.waits_for_zero());
    second.follow(&sample(2024, SensorState::Ok)).unwrap();
    assert!(angle(&second) > 1.5);
    second.request_zero();
    second.follow(&sample(2024, SensorState::Ok)).unwrap();
    assert!(angle(&second).abs() < 1e-6);
    assert!(puppeteer(ZeroPolicy::AtStart, known).waits_for_zero());
}

#[test]
fn a_sensor_that_never_answers_does_not_hold_up_the_others_for_ever() {
    let mut puppeteer = puppeteer(ZeroPolicy::AtStart, Calibration::default());
    for _ in 0..=PATIENCE_SAMPLES {
        puppeteer.follow(&sample(0, SensorState::NoData)).unwrap();
    }
    assert!(!puppeteer.waits_for_zero());
}

#[test]
fn samples_of_another_topology_are_ignored() {
    let mut puppeteer = puppeteer(ZeroPolicy::OnRequest, Calibration::default());
    let other = RawSample { epoch: 2, ..sample(0, SensorState::Ok) };
    assert_eq!(puppeteer.follow(&other).unwrap(), Step::Ignored);
}

/// An arm that the joint turns, and a tail on it; a triangle on the arm that a shape moves.
fn dancer(mapping: Option<Mapping>) -> Puppeteer {
    let bone = |name: &str, parent, at: Vec3| Bone {
        name: name.into(),
        parent,
        rest: Transform { translation: at, ..Transform::IDENTITY },
        tail: Vec3::Y * 0.1,
    };
    let bones =
        vec![bone("arm", None, Vec3::ZERO), bone("tail", Some(0), Vec3::Y), bone("tip", Some(1), Vec3::Y * 0.1)];
    let mesh = TriangleMesh { vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], triangles: vec![[0, 1, 2]] };
    let surface = Surface {
        normals: vec![[0.0, 0.0, 1.0]; 3],
        texture_coordinates: None,
        vertex_colors: None,
        endpoints: None,
        influences: Influences::new(1, vec![0; 3], vec![1.0; 3], 3).unwrap(),
        parts: vec![Surface::one_part(&mesh)],
        morph_targets: vec![MorphTarget {
            name: "jaw".into(),
            part: 0,
            default_weight: 0.0,
            positions: vec![[0.0, 0.0, -1.0]; 3],
            normals: Vec::new(),
        }],
        mesh,
    };
    let character = Character {
        name: "dancer".into(),
        surface: Arc::new(surface),
        materials: Vec::new(),
        skeleton: Skeleton::new(bones).unwrap(),
        skins: Vec::new(),
        avatar: None,
        skin: armature_character::SkinKind::Linear,
        provenance: Provenance::Artist,
        warnings: Vec::new(),
    };
    let (character, _) = LoadedCharacter::bound("dancer", character);
    let dynamics = DynamicsArgs { dynamics: vec!["tail".into()], ..DynamicsArgs::default() };
    let puppeteer = Puppeteer::new(Arc::new(character), mapping, Calibration::default(), ZeroPolicy::AtStart).unwrap();
    let mut puppeteer = puppeteer.with_dynamics(&dynamics).unwrap();
    let part = Part { uid: UID, kind: PartKind::Bend, parent: None, outlet: 0, counts_per_turn: 4096 };
    puppeteer.set_topology(1, JointTree::new(vec![part]).unwrap(), &mut unheard);
    puppeteer
}

fn jaw() -> Mapping {
    let drive =
        ShapeDrive { shape: "jaw".into(), part: UID, axis: DriveAxis::Bend, degrees: [0.0, 90.0], weights: [0.0, 1.0] };
    Mapping { entries: vec![MappingEntry::new(UID, "arm")], shapes: vec![drive], ..Mapping::default() }
}

#[test]
fn a_take_with_bones_that_swing_and_shapes_replays_bit_for_bit() {
    let mut puppeteer = dancer(Some(jaw()));
    puppeteer.follow(&sample(1000, SensorState::Ok)).unwrap();
    puppeteer.set_shape(&ShapeWeight { name: "jaw".into(), weight: 0.5 }).unwrap();
    let header = take_header(puppeteer.character(), 200.0);
    let mut recorder = TakeRecorder::begin(Vec::new(), "dance", &header, &mut puppeteer).unwrap();
    let (mut swung, mut weights) = (0.0_f32, Vec::new());
    for step in 0..400_u32 {
        let counts = (1000.0 + 500.0 * (f64::from(step) * 0.05).sin()) as u16;
        let device_micros = 7_000_000 + 5_000 * u64::from(step);
        let sample = RawSample { device_micros, sequence: step, ..sample(counts, SensorState::Ok) };
        let posed = puppeteer.follow(&sample).unwrap();
        recorder.step(&sample, &posed, &puppeteer, None).unwrap();
        swung = swung.max(puppeteer.pose().parent_from_bone[1].rotation.to_axis_angle().1);
        weights.push(puppeteer.shapes().get("jaw").unwrap());
    }
    assert!(swung > 0.1, "the tail swings: {swung}");
    assert!(weights.iter().any(|weight| *weight > 0.4) && weights.contains(&0.0));
    let (take, report) = Take::read(&recorder.finish().unwrap().0).unwrap();
    assert!(report.is_whole() && take.dynamics().is_some());
    assert!(armature_take::verify(&take, &mut unheard).unwrap().is_exact());
    let track = armature_take::ShapeTrack::of(&take).unwrap();
    for (step, weight) in weights.iter().enumerate() {
        let replayed = track.at(step as f64 * 0.005).next().unwrap();
        assert_eq!((replayed.0, replayed.1.to_bits()), ("jaw", weight.to_bits()), "step {step}");
    }
}

#[test]
fn shapes_set_by_hand_blend_the_skin_and_unknown_ones_are_named() {
    let mut puppeteer = dancer(None);
    puppeteer.set_shape(&ShapeWeight { name: "jaw".into(), weight: 0.25 }).unwrap();
    assert!((puppeteer.skinned().0[0][2] + 0.25).abs() < 1e-6);
    let wrong = puppeteer.set_shape(&ShapeWeight { name: "tusk".into(), weight: 0.5 }).unwrap_err();
    assert!(wrong.what.contains("tusk") && wrong.remedy.contains("jaw"), "{wrong:?}");
    let wrong = puppeteer.set_shape(&ShapeWeight { name: "jaw".into(), weight: f32::NAN }).unwrap_err();
    assert!(wrong.what.contains("jaw"), "{wrong:?}");
    assert!((puppeteer.skinned().0[0][2] + 0.25).abs() < 1e-6, "it stays");
    puppeteer.expect_puppet(Calibration::default(), PuppetHints::default());
    assert_eq!(puppeteer.shapes().get("jaw"), Some(0.25), "another puppet leaves what a hand has set");
}
