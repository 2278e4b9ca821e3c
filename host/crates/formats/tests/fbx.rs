//! FBX as text, whose numbers are known, and as Blender writes it; `blender_models.rs` compares more of the latter.

use armature_formats::fbx::read_fbx_skeleton;
use armature_formats::model::{AlphaMode, Model};
use armature_formats::{FormatError, read_model};
use glam::{DVec3, Vec3};

const TEXT: &[u8] = include_bytes!("fbx/text.fbx");
const BINARY: &[u8] = include_bytes!("fbx/blender.fbx");

fn none(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name} does not exist"))
}

fn read(bytes: &[u8]) -> Result<Model, FormatError> {
    read_model("strip.fbx", bytes, &none)
}

fn near(a: Vec3, b: [f32; 3]) -> bool {
    a.distance(Vec3::from(b)) < 1e-5
}

#[test]
fn text_is_brought_to_our_axes_and_metres() {
    let model = read(TEXT).unwrap();
    let place = |vertex: u32| DVec3::from(model.mesh.vertices[vertex as usize]).as_vec3();
    let drawn: Vec<Vec3> = model.mesh_vertex_of_drawn().into_iter().map(place).collect();
    // The last row is lifted by half of the smile.
    for expected in
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 2.25, 0.0], [1.0, 2.25, 0.0]]
    {
        assert!(drawn.iter().any(|p| near(*p, expected)), "{expected:?} of {drawn:?}");
    }
    assert_eq!((model.mesh.vertices.len(), model.mesh.triangles.len()), (6, 4));
    let rig = model.rig.as_ref().unwrap();
    let names: Vec<&str> = rig.skeleton.bones().iter().map(|bone| bone.name.as_str()).collect();
    assert_eq!(names, ["hips", "rig:spine ü"]);
    let heads: Vec<Vec3> = rig.skeleton.rest_segments().iter().map(|(head, _)| *head).collect();
    assert!(near(heads[0], [0.0; 3]) && near(heads[1], [0.0, 1.0, 0.0]), "{heads:?}");
    // Both halves belong to what is between the bones.
    let middle = model.mesh.vertices.iter().position(|v| (v[1] - 1.0).abs() < 1e-6).unwrap();
    let shares: Vec<f32> = rig.influences.of_vertex(middle).map(|(_, weight)| weight).collect();
    assert!(shares.iter().all(|share| (share - 0.5).abs() < 1e-6) && shares.len() == 2, "{shares:?}");
    // The file's lower left corner is the image's.
    let uv = model.texture_coordinates.as_ref().unwrap();
    let corner = drawn.iter().position(|p| near(*p, [0.0; 3])).unwrap();
    assert_eq!(uv[corner].map(f32::to_bits), [0.0, 1.0].map(f32::to_bits));

    assert_eq!(model.parts.len(), 2, "one part for each material");
    let skin = &model.materials[0];
    assert_eq!((skin.name.as_str(), skin.alpha), ("skin", AlphaMode::Opaque));
    assert_eq!(model.materials[1].name, "cloth");
    let smile = model.morph_targets.iter().find(|target| target.part == 1).unwrap();
    assert_eq!((smile.name.as_str(), smile.default_weight.to_bits()), ("Smile", 0.5_f32.to_bits()));
    let lifted = smile.positions.iter().filter(|offset| near(Vec3::from(**offset), [0.0, 0.5, 0.0])).count();
    assert_eq!(lifted, 2, "{:?}", smile.positions);
}

#[test]
fn rotations_are_composed_as_the_file_says() {
    let model = read(TEXT).unwrap();
    let (name, motion) = &model.motions[0];
    assert_eq!((name.as_str(), motion.frames.len()), ("Bend", 31));
    let rest = motion.skeleton.rest_pose().parent_from_bone[1].rotation;
    let first = motion.frames[0].parent_from_bone[1].rotation;
    assert!(first.angle_between(rest) < 1e-4, "{first} {rest}");
    let last = motion.frames[30].parent_from_bone[1].rotation;
    let (axis, angle) = (last * first.inverse()).to_axis_angle();
    assert!((angle - std::f32::consts::FRAC_PI_2).abs() < 1e-4, "{angle}");
    // A quarter turn about X inside the pre-rotation about Z, which takes X to the file's Y: our −Z.
    let in_model = motion.skeleton.rest_pose().parent_from_bone[0].rotation * axis;
    assert!(in_model.distance(Vec3::NEG_Z) < 1e-3, "{in_model}");
}

#[test]
fn textures_are_never_looked_for_outside_the_folder() {
    let asked = std::cell::RefCell::new(Vec::new());
    let resolver = |name: &str| {
        asked.borrow_mut().push(name.to_owned());
        Err(format!("there is no {name}"))
    };
    let model = read_model("strip.fbx", TEXT, &resolver).unwrap();
    assert_eq!(asked.into_inner(), ["skin.png"]);
    let warning = model.warnings.iter().find(|warning| warning.contains("skin.png")).unwrap();
    assert!(warning.contains("not followed"), "{warning}");
}

#[test]
fn a_skeleton_alone_has_the_same_rest() {
    let alone = read_fbx_skeleton("strip.fbx", TEXT).unwrap();
    let model = read(TEXT).unwrap();
    assert!(alone.has_mesh);
    assert_eq!(alone.skeleton, model.rig.unwrap().skeleton);
    assert_eq!(alone.motions, model.motions);
    let mut bare = String::from_utf8(TEXT.to_vec()).unwrap();
    bare = bare.replace("C: \"OO\",201,0\n", "").replace("C: \"OO\",101,201\n", "");
    assert_eq!(read_fbx_skeleton("bare.fbx", bare.as_bytes()).unwrap().skeleton.len(), 2);
}

#[test]
fn damaged_files_are_errors_or_models() {
    let mut seed = 9_u64;
    let mut random = move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize
    };
    for sample in [TEXT, BINARY] {
        for length in (0..sample.len()).step_by(sample.len() / 150) {
            let _ = read(&sample[..length]);
        }
        for _ in 0..600 {
            let mut bytes = sample.to_vec();
            for _ in 0..=random() % 4 {
                let at = random() % bytes.len();
                bytes[at] = match random() % 3 {
                    0 => b"0123456789-,\"{}*"[random() % 16],
                    1 => bytes[at] ^ (1 << (random() % 8)),
                    _ => 0xFF,
                };
            }
            if let Ok(model) = read(&bytes) {
                model.mesh.validate().unwrap();
            }
            let _ = read_fbx_skeleton("a.fbx", &bytes);
        }
    }
    let error = read(&BINARY[..1000]).unwrap_err();
    assert!(error.what.contains("FBX") && error.remedy.contains("export it again"), "{error}");
}
