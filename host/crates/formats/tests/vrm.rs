//! VRM avatars of both versions, in documents made here.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use armature_formats::model::{Avatar, Model};
use armature_formats::read_model;
use base64::Engine;
use serde_json::{Value, json};

/// Hips (node 0) with a chain of hair (1, 2), and a face (3) with two morph targets; the extensions as given.
fn model(extensions: &Value) -> Model {
    let triangle: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let lifted = triangle.map(|c| 0.5 * c);
    let mut bytes: Vec<u8> = [triangle, lifted].iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend([0, 0, 0, 0].repeat(3));
    bytes.extend([255, 0, 0, 0].repeat(3));
    let uri = format!("data:;base64,{}", base64::engine::general_purpose::STANDARD.encode(&bytes));
    let view = |offset: usize, length: usize| json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
    let accessor = |view: usize, kind: u32, shape: &str| json!({ "bufferView": view, "componentType": kind, "type": shape, "count": 3, "normalized": view == 3 });
    let mut document = json!({
        "asset": { "version": "2.0" },
        "nodes": [
            { "name": "Hips", "children": [1] },
            { "name": "hair", "translation": [0, 1, 0], "children": [2] },
            { "name": "hair end", "translation": [0, 1, 0] },
            { "name": "Face", "mesh": 0, "skin": 0 }
        ],
        "skins": [{ "joints": [0, 1, 2] }],
        "meshes": [{
            "extras": { "targetNames": ["Fcl_A", "Fcl_Joy"] },
            "primitives": [{ "targets": [{ "POSITION": 1 }, { "POSITION": 1 }],
                "attributes": { "POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3 } }]
        }],
        "buffers": [{ "uri": uri, "byteLength": bytes.len() }],
        "bufferViews": [view(0, 36), view(36, 36), view(72, 12), view(84, 12)],
        "accessors": [accessor(0, 5126, "VEC3"), accessor(1, 5126, "VEC3"), accessor(2, 5121, "VEC4"), accessor(3, 5121, "VEC4")]
    });
    document["extensions"] = extensions.clone();
    let none = |name: &str| Err(format!("{name} does not exist"));
    read_model("avatar.vrm", &serde_json::to_vec(&document).unwrap(), &none).unwrap_or_else(|error| panic!("{error}"))
}

fn new() -> Value {
    json!({
        "VRMC_vrm": {
            "specVersion": "1.0",
            "humanoid": { "humanBones": { "hips": { "node": 0 }, "head": { "node": 77 }, "neck": {} } },
            "expressions": {
                "preset": { "happy": { "morphTargetBinds": [{ "node": 3, "index": 1, "weight": 0.75 }] } },
                "custom": { "wink": { "morphTargetBinds": [{ "node": 3, "index": 9 }, { "node": 0, "index": 0 }] } }
            }
        },
        "VRMC_springBone": {
            "colliders": [{ "node": 0, "shape": { "capsule": { "offset": [0, 1, -0.5], "radius": 0.25, "tail": [0, 2, 0] } } },
                          { "node": 99, "shape": { "sphere": {} } }],
            "colliderGroups": [{ "colliders": [0, 1, 5] }],
            "springs": [{ "name": "tail", "joints": [
                { "node": 1, "stiffness": 2, "gravityPower": 0.5, "gravityDir": [0, 0, -1], "dragForce": 0.25, "hitRadius": 0.125 },
                { "node": 2 } ], "colliderGroups": [0, 8] }]
        }
    })
}

fn old() -> Value {
    json!({ "VRM": {
        "humanoid": { "humanBones": [{ "bone": "hips", "node": 0 }, { "bone": "leftThumbProximal", "node": 1 }, { "bone": 5 }] },
        "blendShapeMaster": { "blendShapeGroups": [
            { "name": "Joy", "presetName": "joy", "binds": [{ "mesh": 0, "index": 1, "weight": 75 }] },
            { "name": "Surprised", "presetName": "unknown", "binds": [{ "mesh": 0, "index": 0, "weight": 100 }] }
        ] },
        "secondaryAnimation": {
            "boneGroups": [{ "comment": "tail", "stiffiness": 2, "gravityPower": 0.5, "gravityDir": { "x": 0, "y": 0, "z": 1 },
                "dragForce": 0.25, "hitRadius": 0.125, "bones": [1, 1234], "colliderGroups": [0] }],
            "colliderGroups": [{ "node": 0, "colliders": [{ "offset": { "x": 0, "y": 1, "z": 0.5 }, "radius": 0.25 }] }]
        }
    } })
}

#[test]
fn both_versions_say_the_same_of_an_avatar() {
    for (extensions, version, tail) in [(new(), "1.0", Some([0.0, 2.0, 0.0])), (old(), "0.x", None)] {
        let model = model(&extensions);
        let bones = model.rig.as_ref().unwrap().skeleton.bones();
        let Avatar { version: found, humanoid, expressions, springs } = model.avatar.as_ref().unwrap();
        assert_eq!(found, version);
        assert_eq!((humanoid[0].name.as_str(), bones[humanoid[0].bone as usize].name.as_str()), ("hips", "Hips"));
        let happy = expressions.iter().find(|expression| expression.name == "happy").unwrap();
        let [(target, weight)] = happy.targets[..] else { panic!("{happy:?}") };
        assert_eq!(model.morph_targets[target as usize].name, "Fcl_Joy");
        assert!((weight - 0.75).abs() < 1e-6);
        let [spring] = springs.as_slice() else { panic!("{springs:?}") };
        let names: Vec<&str> = spring.joints.iter().map(|joint| bones[joint.bone as usize].name.as_str()).collect();
        assert_eq!((spring.name.as_str(), names.as_slice()), ("tail", ["hair", "hair end"].as_slice()));
        let first = spring.joints[0];
        let numbers = [first.stiffness, first.gravity, first.drag, first.radius];
        assert_eq!(numbers.map(f32::to_bits), [2.0, 0.5, 0.25, 0.125].map(f32::to_bits));
        assert_eq!(first.gravity_direction.map(f32::to_bits), [0.0, 0.0, -1.0].map(f32::to_bits));
        assert_eq!(spring.colliders.len(), 1);
        assert_eq!(spring.colliders[0].tail, tail);
        // The old version has z the other way round here.
        assert_eq!(spring.colliders[0].offset.map(f32::to_bits), [0.0, 1.0, -0.5].map(f32::to_bits));
    }
}

#[test]
fn avatars_of_the_old_version_are_turned_to_look_the_same_way() {
    let (new, old) = (model(&new()), model(&old()));
    let turned = |[x, y, z]: [f64; 3]| [-x, y, -z];
    let vertices: Vec<[f64; 3]> = new.mesh.vertices.iter().map(|&v| turned(v)).collect();
    assert_eq!(old.mesh.vertices, vertices);
    let heads = |model: &Model| model.rig.as_ref().unwrap().skeleton.rest_segments();
    for ((new_head, new_tail), (old_head, old_tail)) in heads(&new).into_iter().zip(heads(&old)) {
        let half_round = glam::Quat::from_rotation_y(std::f32::consts::PI);
        assert!(
            (half_round * new_head - old_head).length() < 1e-6 && (half_round * new_tail - old_tail).length() < 1e-6
        );
    }
    let [was, is] = [&new, &old].map(|model| model.morph_targets[0].positions[1]);
    assert_eq!(is.map(f32::to_bits), was.map(|c| (0.0 - c).to_bits()));
}

#[test]
fn names_of_the_old_version_become_those_of_the_new() {
    let avatar = model(&old()).avatar.unwrap();
    assert_eq!(avatar.humanoid[1].name, "leftThumbMetacarpal");
    let names: Vec<&str> = avatar.expressions.iter().map(|expression| expression.name.as_str()).collect();
    assert_eq!(names, ["happy", "Surprised"]);
}

#[test]
fn what_names_nothing_is_left_out() {
    let avatar = model(&new()).avatar.unwrap();
    assert_eq!(avatar.humanoid.len(), 1);
    let wink = avatar.expressions.iter().find(|expression| expression.name == "wink").unwrap();
    assert!(wink.targets.is_empty());
    assert!(model(&json!({})).avatar.is_none());
    for odd in
        [json!({ "VRM": 5 }), json!({ "VRMC_vrm": [], "VRMC_springBone": "x" }), json!({ "VRM": { "humanoid": [] } })]
    {
        assert_eq!(model(&odd).avatar.unwrap().humanoid, []);
    }
}
