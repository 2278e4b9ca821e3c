//! Skins of every kind on a real character: a turned hand twists the forearm evenly, bones out of reach stretch, blend
//! shapes work, and old characters get endpoint weights by projection.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use std::ops::ControlFlow;
use std::sync::{Arc, OnceLock};

use armature_character::bind::{BindMethod, BindSettings, TwistCurve, bind, endpoint_weights};
use armature_character::skin::CharacterSkin;
use armature_character::{Character, EndpointMethod, SkinKind};
use armature_formats::model::{Model, MorphTarget};
use armature_rig::{Bone, Pose, Skeleton, Transform};
use armature_weights::endpoints::SplineFilter;
use glam::{Quat, Vec3};

/// A tube of this many rings along +X from 0 to 6 with closed ends, on an upper arm, a forearm from 2 to 4 and a hand.
const RINGS: usize = 61;
const AROUND: usize = 12;

fn arm(settings: &BindSettings) -> Character {
    let mut model = Model { name: "arm".into(), ..Model::default() };
    for ring in 0..RINGS {
        let x = 6.0 * ring as f64 / (RINGS - 1) as f64;
        for corner in 0..AROUND {
            let angle = std::f64::consts::TAU * corner as f64 / AROUND as f64;
            model.mesh.vertices.push([x, 0.4 * angle.cos(), 0.4 * angle.sin()]);
        }
    }
    let at = |ring: usize, corner: usize| (ring * AROUND + corner % AROUND) as u32;
    for ring in 0..RINGS - 1 {
        for corner in 0..AROUND {
            let [a, b] = [at(ring, corner), at(ring, corner + 1)];
            let [c, d] = [at(ring + 1, corner), at(ring + 1, corner + 1)];
            model.mesh.triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    for (ring, x) in [(0, 0.0), (RINGS - 1, 6.0)] {
        let middle = model.mesh.vertices.len() as u32;
        model.mesh.vertices.push([x, 0.0, 0.0]);
        for corner in 0..AROUND {
            let [a, b] = [at(ring, corner), at(ring, corner + 1)];
            model.mesh.triangles.push(if ring == 0 { [middle, b, a] } else { [middle, a, b] });
        }
    }
    // Outwards: counter-clockwise from outside.
    model.mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let bone = |name: &str, parent, x: f32| Bone {
        name: name.into(),
        parent,
        rest: Transform { translation: x * Vec3::X, ..Transform::IDENTITY },
        tail: 2.0 * Vec3::X,
    };
    let bones = vec![bone("upper", None, 0.0), bone("lower", Some(0), 2.0), bone("hand", Some(1), 2.0)];
    let go_on = &mut |_: &'static str, _: f64| ControlFlow::Continue(());
    bind(model, Some(Skeleton::new(bones).unwrap()), settings, go_on).unwrap()
}

fn bound() -> &'static Character {
    static BOUND: OnceLock<Character> = OnceLock::new();
    BOUND.get_or_init(|| arm(&BindSettings { skin: SkinKind::StretchTwist, ..BindSettings::default() }))
}

fn posed(character: &Character, pose: &Pose) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let mut frames = character.skeleton.rest_model_from_bone();
    pose.forward_kinematics(&character.skeleton, &mut frames);
    let (mut positions, mut normals) = (character.rest_positions(), character.surface.normals.clone());
    CharacterSkin::precompute(character).unwrap().solve(&frames, &mut positions, &mut normals).unwrap();
    (positions, normals)
}

/// For each ring, how far it is turned about +X (radians) and how far it is from the axis on average.
fn rings(positions: &[[f32; 3]]) -> Vec<(f32, f32)> {
    let ring = |ring: usize| {
        let (mut across, mut radius) = (glam::Vec2::ZERO, 0.0);
        for corner in 0..AROUND {
            let [_, y, z] = positions[ring * AROUND + corner];
            let angle = std::f32::consts::TAU * corner as f32 / AROUND as f32;
            across += glam::Vec2::from_angle(-angle).rotate(glam::Vec2::new(y, z));
            radius += glam::Vec2::new(y, z).length() / AROUND as f32;
        }
        (across.to_angle(), radius)
    };
    (0..RINGS).map(ring).collect()
}

fn turned_hand(character: &Character, angle: f32) -> Pose {
    let mut pose = character.skeleton.rest_pose();
    pose.parent_from_bone[2].rotation = Quat::from_rotation_x(angle);
    pose
}

#[test]
fn a_turned_hand_twists_the_whole_forearm() {
    let character = bound();
    assert_eq!(character.skin, SkinKind::StretchTwist);
    assert_eq!(character.surface.endpoints.as_ref().unwrap().method, EndpointMethod::Biharmonic);
    let angle = 2.0;
    for kind in SkinKind::ALL {
        let character = Character { skin: kind, ..character.clone() };
        let rings = rings(&posed(&character, &turned_hand(&character, angle)).0);
        let steepest = rings.windows(2).map(|pair| pair[1].0 - pair[0].0).fold(0.0, f32::max) / 0.1;
        let thinnest = rings.iter().map(|ring| ring.1).fold(f32::INFINITY, f32::min) / 0.4;
        println!("{kind}: steepest {steepest:.2} rad per unit, thinnest {thinnest:.3}");
        let (elbow, wrist) = (rings[20].0, rings[40].0);
        if kind.stretches() {
            // Evenly would be 1 radian per unit over the forearm's two units.
            assert!(steepest < 1.9, "{kind}: {steepest}");
            assert!(elbow < 0.25 * angle && wrist > 0.75 * angle, "{kind}: {elbow} {wrist}");
            assert!(thinnest > 0.93, "{kind}: {thinnest}");
        } else {
            assert!(steepest > 1.9, "{kind}: {steepest}");
        }
        if kind == SkinKind::Linear {
            assert!(thinnest < 0.75, "candy paper: {thinnest}");
        }
        assert!(rings[5].0.abs() < 0.05 && (rings[57].0 - angle).abs() < 0.05, "{kind}");
    }
}

#[test]
fn a_hand_out_of_reach_stretches_the_forearm_and_keeps_its_own_shape() {
    for kind in [SkinKind::StretchTwist, SkinKind::StretchTwistDualQuaternion] {
        let character = Character { skin: kind, ..bound().clone() };
        let mut pose = character.skeleton.rest_pose();
        pose.parent_from_bone[2].translation.x = 3.0;
        let (positions, _) = posed(&character, &pose);
        let x = |ring: usize| positions[ring * AROUND][0];
        assert!((x(60) - 7.0).abs() < 0.05 && x(2) < 0.25, "{kind}: the hand is one unit on");
        // The hand and the upper arm are as long as before, the forearm is a unit longer.
        assert!(((x(58) - x(50)) - 0.8).abs() < 0.08, "{kind}: {}", x(58) - x(50));
        assert!(((x(40) - x(20)) - 3.0).abs() < 0.6, "{kind}: {}", x(40) - x(20));
        assert!(positions.windows(2).all(|pair| pair[0][0].is_finite()));
    }
}

#[test]
fn a_pose_without_twist_is_that_of_the_underlying_method() {
    let mut pose = bound().skeleton.rest_pose();
    pose.parent_from_bone[1].rotation = Quat::from_rotation_z(1.2);
    pose.parent_from_bone[2].rotation = Quat::from_rotation_y(-0.7);
    for [stretching, plain] in
        [[SkinKind::StretchTwist, SkinKind::Linear], [SkinKind::StretchTwistDualQuaternion, SkinKind::DualQuaternion]]
    {
        let [a, b] = [stretching, plain].map(|kind| posed(&Character { skin: kind, ..bound().clone() }, &pose).0);
        let apart = |(a, b): (&[f32; 3], &[f32; 3])| Vec3::from(*a).distance(Vec3::from(*b));
        let worst = a.iter().zip(&b).map(apart).fold(0.0, f32::max);
        assert!(worst < 2e-5, "{stretching}: {worst}");
    }
}

#[test]
fn endpoint_weights_of_every_method_rise_along_the_bone() {
    let character = bound();
    for method in EndpointMethod::ALL {
        let settings = BindSettings { endpoints: Some(method), ..BindSettings::default() };
        let go_on = &mut |_: &'static str, _: f64| ControlFlow::Continue(());
        let (endpoints, warnings) = endpoint_weights(character, &settings, go_on).unwrap();
        assert!(warnings.is_empty(), "{method}: {warnings:?}");
        let influences = &character.surface.influences;
        let along = |ring: usize| {
            let vertex = ring * AROUND;
            let slot = influences.of_vertex(vertex).position(|(bone, _)| bone == 1).unwrap();
            endpoints.weights[vertex * influences.per_vertex() + slot]
        };
        let rising: Vec<f32> = (22..=38).map(along).collect();
        assert!(rising.is_sorted(), "{method}: {rising:?}");
        assert!(rising[0] < 0.35 && rising[16] > 0.65, "{method}: {rising:?}");
        assert!((along(30) - 0.5).abs() < 0.02, "{method}: {}", along(30));
    }
}

#[test]
fn a_curve_moves_the_twist_and_unknown_bones_are_named() {
    let curve = |bone: &str| TwistCurve { bone: bone.into(), curve: SplineFilter::through(&[[0.5, 0.05]]).unwrap() };
    let settings = |bone: &str| BindSettings {
        method: BindMethod::BoneHeat,
        skin: SkinKind::StretchTwist,
        twist_curves: vec![curve(bone)],
        ..BindSettings::default()
    };
    let character = arm(&settings("lower"));
    assert_eq!(character.surface.endpoints.as_ref().unwrap().method, EndpointMethod::BoneHeat);
    let rings = rings(&posed(&character, &turned_hand(&character, 2.0)).0);
    assert!(rings[30].0 < 0.4, "little of it in the first half: {}", rings[30].0);
    let go_on = &mut |_: &'static str, _: f64| ControlFlow::Continue(());
    let error = endpoint_weights(bound(), &settings("knee"), go_on).unwrap_err().to_string();
    assert_eq!(error, "the skeleton has no bone \"knee\"; it has upper, lower, hand");
}

#[test]
fn blend_shapes_move_skins_of_every_kind() {
    let mut character = bound().clone();
    let surface = Arc::make_mut(&mut character.surface);
    let positions = vec![[0.0, 0.0, 0.25]; surface.mesh.vertices.len()];
    surface.morph_targets = vec![MorphTarget { name: "up".into(), positions, ..MorphTarget::default() }];
    let frames = character.skeleton.rest_model_from_bone();
    for kind in SkinKind::ALL {
        character.skin = kind;
        let mut skin = CharacterSkin::precompute(&character).unwrap();
        let mut morphs = character.morphs().unwrap().unwrap();
        morphs.solve(&[1.0]).unwrap();
        skin.set_rest(&morphs).unwrap();
        let (mut positions, mut normals) = (character.rest_positions(), character.surface.normals.clone());
        skin.solve(&frames, &mut positions, &mut normals).unwrap();
        for (at, rest) in positions.iter().zip(character.rest_positions()) {
            assert!((at[2] - rest[2] - 0.25).abs() < 1e-5, "{kind}");
        }
    }
}

#[test]
fn parts_bound_in_another_pose_and_characters_without_endpoint_weights_work() {
    let mut character = bound().clone();
    let frames = character.skeleton.rest_model_from_bone();
    let lifted = glam::Affine3A::from_rotation_translation(Quat::from_rotation_z(0.5), 3.0 * Vec3::Y);
    let bound_model_from_bone = frames.iter().map(|frame| lifted * *frame).collect();
    character.skins = vec![armature_formats::model::Skin { name: "lifted".into(), bound_model_from_bone }];
    let surface = Arc::make_mut(&mut character.surface);
    surface.parts[0].skin = Some(0);
    surface.mesh.vertices.iter_mut().for_each(|p| {
        *p = lifted.transform_point3(Vec3::from(p.map(|c| c as f32))).as_dvec3().to_array();
    });
    let pose = turned_hand(&character, 1.5);
    for endpoints in [true, false] {
        if !endpoints {
            Arc::make_mut(&mut character.surface).endpoints = None;
        }
        for kind in SkinKind::ALL {
            character.skin = kind;
            let rings = rings(&posed(&character, &pose).0);
            assert!((rings[57].0 - 1.5).abs() < 0.05 && rings[3].0.abs() < 0.05, "{kind}: {:?}", rings[57]);
            assert!(!kind.stretches() || (rings[30].0 - 0.75).abs() < 0.25, "{kind}: {:?}", rings[30]);
        }
    }
}
