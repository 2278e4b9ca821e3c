//! Characters that Blender made, against how Blender itself poses them; and compressed files against plain ones.
//!
//! `ARMATURE_BPY_PYTHON` names a Python that has the package `bpy`. Without it the check prints that it is skipped; in
//! CI it fails.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::Command;

use armature_formats::model::{GreyMaps, Model, check_parts};
use armature_formats::read_model;
use armature_rig::Pose;
use glam::{Affine3A, DVec3, Vec3};
use serde_json::Value;

/// Largest distance from where Blender has a vertex, as a share of the character's size.
const TOLERANCE: f64 = 1e-3;
/// The same of files from gltfpack, which keeps weights in eight bits.
const PACKED_TOLERANCE: f64 = 3e-3;

fn bpy() -> Option<PathBuf> {
    let python = std::env::var_os("ARMATURE_BPY_PYTHON").filter(|value| !value.is_empty()).map(PathBuf::from);
    if python.is_none() {
        let in_ci = ["CI", "ARMATURE_REQUIRE_SHARED_DATA"].iter().all(|name| std::env::var_os(name).is_some());
        assert!(!in_ci, "ARMATURE_BPY_PYTHON must be set in CI: Blender was not run");
        println!("SKIPPED: ARMATURE_BPY_PYTHON is not set, so Blender was not run");
    }
    python
}

/// The folder `node_modules` with the package gltfpack.
fn gltfpack() -> Option<PathBuf> {
    let given = std::env::var_os("ARMATURE_GLTF_VALIDATOR").filter(|value| !value.is_empty()).map(PathBuf::from);
    let around = given.as_ref().and_then(|given| given.ancestors().find(|folder| folder.ends_with("node_modules")));
    let modules = around.map(Path::to_path_buf).or_else(|| given.map(|given| given.join("node_modules")));
    let modules = modules.filter(|modules| modules.join("gltfpack").exists());
    if modules.is_none() {
        let in_ci = ["CI", "ARMATURE_REQUIRE_SHARED_DATA"].iter().all(|name| std::env::var_os(name).is_some());
        assert!(!in_ci, "ARMATURE_GLTF_VALIDATOR must name a folder that has gltfpack in CI");
        println!("SKIPPED: gltfpack is not beside ARMATURE_GLTF_VALIDATOR, so its files were not checked");
    }
    modules
}

fn read(file: &Path) -> Model {
    let beside = |name: &str| std::fs::read(file.with_file_name(name)).map_err(|error| format!("{name}: {error}"));
    read_model(&file.display().to_string(), &std::fs::read(file).unwrap(), &beside).unwrap()
}

/// The drawn vertices under a pose.
fn posed(model: &Model, pose: Option<&Pose>) -> Vec<DVec3> {
    let rig = model.rig.as_ref().unwrap();
    let rest_pose = rig.skeleton.rest_pose();
    let mut world = vec![Affine3A::IDENTITY; rig.skeleton.len()];
    pose.unwrap_or(&rest_pose).forward_kinematics(&rig.skeleton, &mut world);
    let rest = rig.skeleton.rest_model_from_bone();
    let skin: Vec<Affine3A> = world.iter().zip(&rest).map(|(w, r)| *w * r.inverse()).collect();
    let place = |&vertex: &u32| {
        let p = DVec3::from(model.mesh.vertices[vertex as usize]).as_vec3();
        let of_bone = |(bone, weight): (u16, f32)| skin[usize::from(bone)].transform_point3(p) * weight;
        rig.influences.of_vertex(vertex as usize).map(of_bone).sum::<Vec3>().as_dvec3()
    };
    model.mesh_vertex_of_drawn().iter().map(place).collect()
}

fn points(value: &Value) -> Vec<DVec3> {
    let point = |p: &Value| DVec3::from_array(std::array::from_fn(|k| p[k].as_f64().unwrap()));
    value.as_array().unwrap().iter().map(point).collect()
}

/// The number of the nearest point.
fn nearest(points: &[DVec3], to: DVec3) -> usize {
    let distance = |k: &usize| points[*k].distance_squared(to);
    (0..points.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap()
}

/// The largest share of the size by which our vertices are off at rest and at each of the frames.
fn compare(file: &Path, model: &Model, expected: &Value) -> f64 {
    let meshes = expected["meshes"].as_array().unwrap();
    let rest: Vec<DVec3> = meshes.iter().flat_map(|mesh| points(&mesh["rest"])).collect();
    let bounds = rest.iter().fold((rest[0], rest[0]), |(low, high), p| (low.min(*p), high.max(*p)));
    let size = (bounds.1 - bounds.0).max_element();
    let ours = posed(model, None);
    let same: Vec<usize> = ours.iter().map(|&p| nearest(&rest, p)).collect();
    let is_packed = ["quantised.glb", "meshopt.glb"].iter().any(|name| file.ends_with(name));
    let tolerance = if is_packed { PACKED_TOLERANCE } else { TOLERANCE };
    let worst = |ours: &[DVec3], theirs: &[DVec3]| {
        ours.iter().zip(&same).fold(0.0_f64, |worst, (p, &k)| worst.max(p.distance(theirs[k]) / size))
    };
    let mut off = worst(&ours, &rest);
    assert!(off < TOLERANCE, "{}: off by {off} at rest", file.display());
    // No vertex of theirs may be missing.
    let missing = rest.iter().filter(|p| ours[nearest(&ours, **p)].distance(**p) > TOLERANCE * size).count();
    assert_eq!(missing, 0, "{}: vertices missing of {}", file.display(), rest.len());
    let (_, motion) = model.motions.first().unwrap();
    for frame in meshes[0]["posed"].as_object().unwrap().keys() {
        let theirs: Vec<DVec3> = meshes.iter().flat_map(|mesh| points(&mesh["posed"][frame])).collect();
        let seconds = (frame.parse::<f64>().unwrap() - 1.0) / expected["frames_per_second"].as_f64().unwrap();
        let number = (seconds / motion.frame_seconds).round() as usize;
        let at_frame = worst(&posed(model, Some(&motion.frames[number])), &theirs);
        assert!(at_frame < tolerance, "{}: off by {at_frame} at frame {frame}", file.display());
        off = off.max(at_frame);
    }
    off
}

fn check(file: &Path) {
    let told = PathBuf::from(format!("{}.json", file.display()));
    let expected: Value = serde_json::from_slice(&std::fs::read(told).unwrap()).unwrap();
    let model = read(file);
    let off = compare(file, &model, &expected);
    let rig = model.rig.as_ref().unwrap();
    for name in expected["bones"].as_array().unwrap() {
        assert!(rig.skeleton.find(name.as_str().unwrap()).is_some(), "{}: no bone {name}", file.display());
    }
    let mut materials: Vec<&str> = model.materials.iter().map(|material| material.name.as_str()).collect();
    materials.sort_unstable();
    assert_eq!(Value::from(materials), expected["materials"], "{}", file.display());
    let skin = model.materials.iter().find(|material| material.name == "skin").unwrap();
    assert!(skin.base_color_map.is_some() && skin.normal_map.is_some(), "{}: {:?}", file.display(), model.warnings);
    // FBX has both images apart.
    let apart = |grey: &GreyMaps| {
        grey.roughness.is_some() && grey.metallic.is_some() && model.materials[grey.material as usize].name == "skin"
    };
    assert!(skin.metallic_roughness_map.is_some() || model.grey_maps.iter().any(apart), "{}", file.display());
    let mut targets: Vec<&str> = model.morph_targets.iter().map(|target| target.name.as_str()).collect();
    targets.sort_unstable();
    targets.dedup();
    assert_eq!(targets, ["Frown", "Smile"], "{}", file.display());
    let smile = model.morph_targets.iter().find(|target| target.name == "Smile").unwrap();
    assert!((smile.default_weight - 0.5).abs() < 1e-6);
    check_parts(
        &model.parts,
        &model.morph_targets,
        model.drawn_vertex_count(),
        model.drawn_triangles(),
        [model.materials.len(), rig.skins.len()],
    )
    .unwrap();
    if file.file_stem().is_some_and(|stem| stem == "colors") {
        assert_colors(&model);
    }
    println!("{}: off by {off:.2e}; {:?}", file.file_name().unwrap().to_string_lossy(), model.warnings);
}

/// The body's colours, as the script paints them.
fn assert_colors(model: &Model) {
    let colors = model.vertex_colors.as_ref().unwrap();
    let body = model.parts.iter().find(|part| part.name == "body").unwrap();
    let vertices = model.mesh_vertex_of_drawn();
    for drawn in body.vertices.clone() {
        let height = model.mesh.vertices[vertices[drawn as usize] as usize][1];
        let wanted = [0.5 + 0.5 * (9.0 * height).sin() as f32, 0.25, 0.75, 1.0];
        let color = colors[drawn as usize];
        assert!((0..4).all(|k| (color[k] - wanted[k]).abs() < 0.01), "{color:?} instead of {wanted:?}");
    }
}

#[test]
fn blender_poses_its_characters_as_we_do() {
    let Some(python) = bpy() else { return };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("blender_models");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests/blender_models.py");
    let modules = gltfpack();
    let output = Command::new(&python).arg(script).arg(&folder).args(&modules).output().expect("Python can be run");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}\n{}", String::from_utf8_lossy(&output.stderr));
    let mut files: Vec<PathBuf> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|e| e == "glb" || e == "gltf" || e == "fbx"));
    files.sort();
    assert_eq!(files.len(), if modules.is_some() { 20 } else { 18 }, "{files:?}");
    for file in files {
        check(&file);
    }
}

/// `compressed/plain.glb` and `draco.glb` are Blender's; `meshopt.glb` is the first as `gltfpack -c -kn -km -ke` has it.
#[test]
fn compressed_files_hold_what_the_plain_one_does() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/compressed");
    let plain = read(&folder.join("plain.glb"));
    for (name, tolerance) in [("draco.glb", 1e-4), ("meshopt.glb", 1e-3)] {
        let model = read(&folder.join(name));
        assert!(model.warnings.is_empty(), "{name}: {:?}", model.warnings);
        assert_eq!(model.mesh.triangles.len(), plain.mesh.triangles.len(), "{name}");
        assert_eq!(model.morph_targets[0].name, plain.morph_targets[0].name);
        let [theirs, ours] = [&plain, &model].map(|model| posed(model, None));
        let (rig, plain_rig) = (model.rig.as_ref().unwrap(), plain.rig.as_ref().unwrap());
        let names = |rig: &armature_formats::model::ModelRig| {
            rig.skeleton.bones().iter().map(|bone| bone.name.clone()).collect::<Vec<_>>()
        };
        assert_eq!(names(rig), names(plain_rig));
        // In a pose, so that weights count as well.
        let mut pose = plain_rig.skeleton.rest_pose();
        for (index, local) in pose.parent_from_bone.iter_mut().enumerate() {
            local.rotation *= glam::Quat::from_rotation_x(0.3 * index as f32);
        }
        let [their_pose, our_pose] = [&plain, &model].map(|model| posed(model, Some(&pose)));
        for (k, at) in ours.iter().enumerate() {
            let same = nearest(&theirs, *at);
            let off = at.distance(theirs[same]).max(our_pose[k].distance(their_pose[same]));
            assert!(off < tolerance * 3.0, "{name}: vertex {k} is off by {off}");
        }
    }
}
