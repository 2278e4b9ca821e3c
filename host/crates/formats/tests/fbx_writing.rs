//! FBX files that we write, read by `ufbx` itself, by our reader and by Blender.
//!
//! `ARMATURE_BPY_PYTHON` names a Python that has Blender's module. Without it a check prints that it is skipped; in CI
//! it fails.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]

mod figure;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use armature_formats::fbx::{FbxNotes, write_fbx};
use armature_formats::gltf::{GlbClip, GlbMesh, GlbScene, GlbTimes};
use armature_formats::model::{AlphaMode, MeshPart, Model};
use armature_formats::read_model;
use armature_geometry::Influences;
use armature_rig::{Motion, Skeleton};
use figure::{FRAME_SECONDS, Noise, bpy, character, expectation, motion, skeleton};
use glam::{DQuat, DVec3};

/// The format's numbers of the rates of the figure.
const MODES: [i32; 4] = [11, 9, 3, 14];

fn none(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name} does not exist"))
}

fn open(bytes: &[u8]) -> ufbx::SceneRoot {
    let options = ufbx::LoadOpts {
        target_axes: ufbx::CoordinateAxes {
            right: ufbx::CoordinateAxis::PositiveX,
            up: ufbx::CoordinateAxis::PositiveY,
            front: ufbx::CoordinateAxis::PositiveZ,
        },
        target_unit_meters: 1.0,
        ..ufbx::LoadOpts::default()
    };
    ufbx::load_memory(bytes, options).unwrap_or_else(|error| panic!("{}", error.description))
}

fn translation(m: &ufbx::Matrix) -> DVec3 {
    DVec3::new(m.m03, m.m13, m.m23)
}

#[test]
fn ufbx_finds_bones_weights_shapes_and_curves() {
    for (k, (frame_seconds, mode)) in FRAME_SECONDS.into_iter().zip(MODES).enumerate() {
        let mut noise = Noise(k as u64 + 3);
        let skeleton = skeleton(&mut noise, true);
        let (model, influences, skins) = character(&mut noise, &skeleton);
        let motion = motion(&mut noise, &skeleton, frame_seconds, true);
        let mesh = GlbMesh { influences: Some(&influences), skins: &skins, ..GlbMesh::of_model(&model) };
        let row = |frame: usize| vec![0.25 + 0.01 * frame as f32; model.morph_targets.len()];
        let weights: Vec<Vec<f32>> = (0..motion.frames.len()).map(row).collect();
        let clips = vec![GlbClip { weights: &weights, ..GlbClip::of_motion("take", &motion) }];
        let scene = GlbScene { name: "figure", skeleton: &skeleton, mesh: Some(mesh), clips };
        let file = write_fbx(&scene, &FbxNotes::default()).unwrap();
        assert_eq!(file.left_out.len(), 1, "{:?}", file.left_out);
        assert!(file.left_out[0].contains("cloth") && file.left_out[0].contains("cutoff"), "{:?}", file.left_out);
        let found = open(&file.bytes);
        assert!(found.metadata.warnings.is_empty(), "{}", found.metadata.warnings[0].description);
        assert_eq!((found.metadata.version, found.metadata.ascii), (7400, false));
        assert!((found.settings.original_unit_meters - 1.0).abs() < 1e-12);
        assert_eq!(found.settings.original_axis_up, ufbx::CoordinateAxis::PositiveY);
        assert_eq!(found.settings.time_mode as i32, mode);
        let stack = &found.anim_stacks[0];
        assert_eq!(stack.element.name.as_ref(), "take");
        let seconds = stack.time_end - stack.time_begin;
        assert!((seconds - motion.duration_seconds()).abs() < 1e-10, "{seconds} and {}", motion.duration_seconds());
        check_bones(&found, &motion);
        assert!(!found.blend_channels.is_empty());
        for channel in &found.blend_channels {
            for (frame, row) in weights.iter().enumerate() {
                let seconds = frame as f64 * motion.frame_seconds;
                let shown = ufbx::evaluate_blend_weight(&stack.anim, channel, seconds);
                assert!((shown - f64::from(row[0])).abs() < 1e-4, "{}: {shown} and {}", channel.element.name, row[0]);
            }
        }
        check_meshes(&found, &model, &influences, &skeleton);
    }
}

fn check_bones(found: &ufbx::Scene, motion: &Motion) {
    let bones = motion.skeleton.bones();
    let nodes: Vec<&ufbx::Node> = bones
        .iter()
        .map(|bone| {
            let named: Vec<_> = found.nodes.iter().filter(|n| n.element.name.as_ref() == bone.name).collect();
            assert_eq!(named.len(), 1, "{:?}", bone.name);
            assert!(named[0].bone.is_some(), "{:?} is no limb", bone.name);
            &**named[0]
        })
        .collect();
    assert_eq!(found.bones.len(), bones.len());
    let mut frames = motion.skeleton.rest_model_from_bone();
    for (bone, node) in bones.iter().zip(&nodes) {
        let parent = node.parent.as_ref().map(|parent| parent.element.name.to_string());
        let ours = bone.parent.map_or("figure_skeleton", |parent| &bones[parent].name);
        assert_eq!(parent.as_deref(), Some(ours));
        let there = translation(&node.node_to_world);
        let here = frames[motion.skeleton.find(&bone.name).unwrap()].translation.as_dvec3();
        assert!(there.distance(here) < 1e-5, "{}: {there} and {here}", bone.name);
    }
    let anim = &found.anim_stacks[0].anim;
    for (number, pose) in motion.frames.iter().enumerate() {
        pose.forward_kinematics(&motion.skeleton, &mut frames);
        for ((local, node), bone) in pose.parent_from_bone.iter().zip(&nodes).zip(bones) {
            let there = ufbx::evaluate_transform(anim, node, number as f64 * motion.frame_seconds);
            let turn = DQuat::from_xyzw(there.rotation.x, there.rotation.y, there.rotation.z, there.rotation.w);
            let off = (turn.inverse() * local.rotation.as_dquat().normalize()).normalize();
            let degrees = (2.0 * off.xyz().length().asin()).to_degrees();
            assert!(degrees < 0.01, "frame {number}, {}: {degrees}", bone.name);
            let place = DVec3::new(there.translation.x, there.translation.y, there.translation.z);
            assert!(place.distance(local.translation.as_dvec3()) < 1e-4, "frame {number}, {}", bone.name);
            let scale = DVec3::new(there.scale.x, there.scale.y, there.scale.z);
            assert!(scale.distance(local.scale.as_dvec3()) < 1e-4, "frame {number}, {}: {scale}", bone.name);
        }
    }
}

fn check_meshes(found: &ufbx::Scene, model: &Model, influences: &Influences, skeleton: &Skeleton) {
    let mesh = |name: &str| {
        let named = found.nodes.iter().find(|node| node.mesh.is_some() && node.element.name.as_ref() == name);
        named.and_then(|node| node.mesh.as_ref()).unwrap_or_else(|| panic!("there is no {name}"))
    };
    let (body, shirt) = (mesh("body"), mesh("shirt"));
    assert_eq!((body.num_vertices, body.num_triangles), (20, 18));
    assert_eq!((shirt.num_vertices, shirt.num_triangles), (10, 8));
    assert_eq!((body.materials.len(), shirt.materials.len()), (2, 1));
    let per_face: Vec<u32> = body.face_material.iter().copied().collect();
    assert_eq!(per_face, [[0].repeat(8), [1].repeat(10)].concat());
    for (mesh, first) in [(body, 0), (shirt, 20)] {
        let skin = &mesh.skin_deformers[0];
        for vertex in 0..mesh.num_vertices {
            let mut ours: BTreeMap<&str, f32> = BTreeMap::new();
            for (bone, weight) in influences.of_vertex(first + vertex) {
                *ours.entry(&skeleton.bones()[usize::from(bone)].name).or_default() += weight;
            }
            let row = &skin.vertices[vertex];
            for weight in skin.weights.iter().skip(row.weight_begin as usize).take(row.num_weights as usize) {
                let node = skin.clusters[weight.cluster_index as usize].bone_node.as_ref().unwrap();
                let own = ours.remove(node.element.name.as_ref()).unwrap();
                assert!((f64::from(own) - weight.weight).abs() < 1e-6);
            }
            assert!(ours.is_empty(), "{ours:?}");
        }
    }
    let channel = &body.blend_deformers[0].channels[0];
    assert_eq!(channel.element.name.as_ref(), "lächeln");
    assert!((channel.weight - 0.25).abs() < 1e-6);
    let shape = channel.target_shape.as_ref().unwrap();
    let target = |vertex: usize| {
        if vertex < 10 {
            model.morph_targets[0].positions[vertex]
        } else {
            model.morph_targets[1].positions[vertex - 8]
        }
    };
    for vertex in 0..20 {
        let offset = target(vertex);
        let at = shape.offset_vertices.iter().position(|&v| v as usize == vertex).unwrap();
        let theirs = &shape.position_offsets[at];
        let shown = model.mesh.vertices[vertex];
        let there = &body.vertices[vertex];
        for ((theirs, ours), (there, shown)) in
            [theirs.x, theirs.y, theirs.z].iter().zip(offset).zip([there.x, there.y, there.z].iter().zip(shown))
        {
            assert!((theirs - f64::from(ours)).abs() < 1e-6);
            assert!((there - (shown - 0.25 * f64::from(ours))).abs() < 1e-6);
        }
    }
}

#[test]
fn our_own_reader_gives_the_character_back() {
    let mut noise = Noise(17);
    let skeleton = skeleton(&mut noise, false);
    let (model, influences, _) = character(&mut noise, &skeleton);
    let (model, parts) = (Model { parts: Vec::new(), ..model.clone() }, model.parts);
    let parts: Vec<MeshPart> = parts.into_iter().map(|part| MeshPart { skin: None, ..part }).collect();
    let motion = motion(&mut noise, &skeleton, 1001.0 / 30_000.0, false);
    let mesh = GlbMesh { influences: Some(&influences), parts: &parts, ..GlbMesh::of_model(&model) };
    let clips = vec![GlbClip::of_motion("take", &motion)];
    let scene = GlbScene { name: "figure", skeleton: &skeleton, mesh: Some(mesh), clips };
    let file = write_fbx(&scene, &FbxNotes::default()).unwrap();
    let again = read_model("figure.fbx", &file.bytes, &none).unwrap();
    assert_eq!(again.mesh.triangles.len(), model.mesh.triangles.len());
    let names: Vec<&str> = again.parts.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(names, ["body", "body", "shirt"]);
    assert_eq!(again.morph_targets.len(), 2);
    assert_eq!(again.materials.len(), 3);
    assert_eq!(again.materials[2].base_color_map, model.materials[2].base_color_map);
    assert_eq!(again.materials[2].normal_map, model.materials[2].normal_map);
    assert_eq!(again.materials[2].alpha, AlphaMode::Blend);
    for (ours, theirs) in model.materials.iter().zip(&again.materials) {
        assert_eq!(ours.name, theirs.name);
        assert!((ours.roughness - theirs.roughness).abs() < 1e-5, "{ours:?} {theirs:?}");
    }
    let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
    let corner = |model: &Model, triangle: usize, c: usize| model.drawn_triangles()[triangle][c] as usize;
    for triangle in 0..model.mesh.triangles.len() {
        for c in 0..3 {
            let (ours, theirs) = (corner(&model, triangle, c), corner(&again, triangle, c));
            let of = |model: &Model, drawn: usize| {
                let vertex = model.mesh_vertex_of_drawn()[drawn] as usize;
                let position = model.mesh.vertices[vertex].map(|c| c as f32);
                let normal = model.normals.as_ref().unwrap()[drawn];
                let texture = model.texture_coordinates.as_ref().unwrap()[drawn];
                let color = model.vertex_colors.as_ref().unwrap()[drawn];
                (position, normal, texture, color)
            };
            let (a, b) = (of(&model, ours), of(&again, theirs));
            assert!(near(&a.0, &b.0) && near(&a.2, &b.2) && near(&a.3, &b.3), "{a:?} {b:?}");
        }
    }
    let rig = again.rig.unwrap();
    for bone in skeleton.bones() {
        let theirs = &rig.skeleton.bones()[rig.skeleton.find(&bone.name).unwrap()];
        assert!(theirs.rest.translation.distance(bone.rest.translation) < 1e-5);
        assert!(theirs.rest.rotation.angle_between(bone.rest.rotation) < 1e-3);
    }
    let (name, theirs) = &again.motions[0];
    assert_eq!((name.as_str(), theirs.frames.len()), ("take", motion.frames.len()));
    assert!((theirs.frame_seconds / motion.frame_seconds - 1.0).abs() < 1e-10);
}

#[test]
fn blender_finds_bones_weights_shapes_and_curves() {
    let Some(python) = bpy() else { return };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fbx");
    std::fs::create_dir_all(&folder).unwrap();
    for (k, frame_seconds) in FRAME_SECONDS.into_iter().enumerate() {
        let mut noise = Noise(k as u64 + 3);
        let skeleton = skeleton(&mut noise, false);
        let (model, influences, _) = character(&mut noise, &skeleton);
        let parts: Vec<MeshPart> = model.parts.iter().map(|part| MeshPart { skin: None, ..part.clone() }).collect();
        let motion = motion(&mut noise, &skeleton, frame_seconds, false);
        let mesh = GlbMesh { influences: Some(&influences), parts: &parts, ..GlbMesh::of_model(&model) };
        let clips = vec![GlbClip::of_motion("take", &motion)];
        let scene = GlbScene { name: "figure", skeleton: &skeleton, mesh: Some(mesh), clips };
        let file = write_fbx(&scene, &FbxNotes::default()).unwrap();
        let (fbx, expected) = (folder.join(format!("{k}.fbx")), folder.join(format!("{k}.json")));
        std::fs::write(&fbx, file.bytes).unwrap();
        std::fs::write(&expected, expectation(&motion, &model, &influences, &[]).to_string()).unwrap();
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests/blender_check.py");
        let output = Command::new(&python).arg(script).args([&fbx, &expected]).output().unwrap();
        let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        println!("{said}");
        assert!(output.status.success(), "{said}");
    }
}

#[test]
fn bones_alone_a_mesh_alone_and_nonsense() {
    let mut noise = Noise(5);
    let skeleton = skeleton(&mut noise, false);
    let rest = vec![skeleton.rest_pose()];
    let clips = vec![GlbClip { name: "rest", times: GlbTimes::EverySeconds(0.5), poses: &rest, weights: &[] }];
    let notes = FbxNotes { properties: vec![("start_timecode".into(), "01:00:00;00".into())], drops_numbers: true };
    let bones = GlbScene { name: "nul\0name", skeleton: &skeleton, mesh: None, clips: clips.clone() };
    let file = write_fbx(&bones, &notes).unwrap();
    let found = open(&file.bytes);
    assert_eq!(found.bones.len(), skeleton.len());
    let armature = found.nodes.iter().find(|node| node.element.name.as_ref() == "nul_name_skeleton").unwrap();
    let said = armature.element.props.props.iter().find(|prop| prop.name.as_ref() == "start_timecode").unwrap();
    assert_eq!(said.value_str.as_ref(), "01:00:00;00");

    let empty = Skeleton::default();
    let (model, ..) = character(&mut noise, &skeleton);
    let model = Model { parts: Vec::new(), morph_targets: Vec::new(), ..model };
    let still = GlbScene { name: "still", skeleton: &empty, mesh: Some(GlbMesh::of_model(&model)), clips: Vec::new() };
    let again = read_model("still.fbx", &write_fbx(&still, &FbxNotes::default()).unwrap().bytes, &none).unwrap();
    assert_eq!(again.mesh.triangles.len(), model.mesh.triangles.len());

    let fails = |scene: &GlbScene| write_fbx(scene, &FbxNotes::default()).unwrap_err().to_string();
    let nothing = GlbScene { name: "x", skeleton: &empty, mesh: None, clips: Vec::new() };
    assert!(fails(&nothing).starts_with("FBX: there is neither"), "{}", fails(&nothing));
    let unbound = GlbScene { skeleton: &skeleton, ..still.clone() };
    assert!(fails(&unbound).contains("follows no bones"));
    let mut wild = rest.clone();
    wild[0].parent_from_bone[1].translation.x = f32::NAN;
    let times = |times, poses| vec![GlbClip { name: "c", times, poses, weights: &[] }];
    for clips in [
        times(GlbTimes::EverySeconds(f64::NAN), &rest[..]),
        times(GlbTimes::EverySeconds(0.5), &wild[..]),
        times(GlbTimes::EverySeconds(0.5), &[][..]),
        times(GlbTimes::At(&[1e30]), &rest[..]),
    ] {
        assert!(fails(&GlbScene { clips, ..bones.clone() }).starts_with("FBX: "));
    }
}
