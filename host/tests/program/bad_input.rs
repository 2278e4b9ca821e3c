//! Damaged files of every kind: an error that names the file and says what to do, never a panic, never a wrong code.

use crate::common::{Place, SMALL_BVH, TUBE_TGF, tube_obj};

const OFF: &str = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                   element face 4\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n\
                   3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
const STL: &str = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n\
                   endfacet\nendsolid s\n";
const MESH: &str = "MeshVersionFormatted 1\nDimension 3\nVertices 4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n\
                    Triangles 4\n1 3 2 0\n1 2 4 0\n1 4 3 0\n2 3 4 0\nTetrahedra 1\n1 2 3 4 0\nEnd\n";

/// A binary STL that announces so many triangles and has one.
fn binary_stl(announced: u32) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(announced.to_le_bytes());
    for value in [0.0_f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend([0, 0]);
    bytes
}

/// A skinned GLB, a take and a character, made by the program itself.
fn make_files(place: &Place) {
    place.write("good.obj", tube_obj());
    place.write("good.tgf", TUBE_TGF);
    place.write("good.bvh", SMALL_BVH);
    place.write("good.off", OFF);
    place.write("good.ply", PLY);
    place.write("good.stl", STL);
    place.write("good-binary.stl", binary_stl(1));
    place.write("good.mesh", MESH);
    place.done(&["bind", "good.obj", "--skeleton", "good.tgf", "--output", "good.armature"]);
    let run = ["run", "--device", "sim:good.bvh", "--character", "good.bvh", "--virtual-clock", "--seconds", "1.5"];
    place.done(&[&run[..], &["--rate", "20", "--record", "good.take"]].concat());
    let run =
        ["run", "--device", "sim:good.bvh", "--character", "good.armature", "--virtual-clock", "--seconds", "1.5"];
    place.done(&[&run[..], &["--rate", "20", "--record", "tube.take"]].concat());
    place.done(&["export", "tube.take", "--to", "good.glb"]);
}

const GOOD: [&str; 11] = [
    "good.obj",
    "good.tgf",
    "good.bvh",
    "good.off",
    "good.ply",
    "good.stl",
    "good-binary.stl",
    "good.mesh",
    "good.armature",
    "good.take",
    "good.glb",
];

/// The file with this text in place of that.
fn with(text: &str, old: &str, new: &str) -> Vec<u8> {
    assert!(text.contains(old), "{old:?} is not there");
    text.replacen(old, new, 1).into_bytes()
}

fn with_bytes(mut bytes: Vec<u8>, at: usize, new: &[u8]) -> Vec<u8> {
    bytes[at..at + new.len()].copy_from_slice(new);
    bytes
}

/// The GLB with no number in place of its first vertex's x.
fn glb_with_nan(good: &[u8]) -> Vec<u8> {
    let json_length = u32::from_le_bytes(good[12..16].try_into().unwrap()) as usize;
    let binary = 20 + json_length + 8;
    let document: serde_json::Value = serde_json::from_slice(&good[20..20 + json_length]).unwrap();
    let position = document["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize;
    let accessor = &document["accessors"][position];
    let view = &document["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let offset = |value: &serde_json::Value| value["byteOffset"].as_u64().unwrap_or(0) as usize;
    with_bytes(good.to_vec(), binary + offset(view) + offset(accessor), &f32::NAN.to_le_bytes())
}

#[test]
fn damaged_files_are_3_with_the_file_and_a_remedy() {
    let place = Place::new("bad-input");
    make_files(&place);
    for name in GOOD {
        place.done(&["inspect", name]);
    }
    let huge = "4000000000";
    let obj = tube_obj();
    let good = |name: &str| place.read(name);
    let half = |name: &str| {
        let bytes = place.read(name);
        bytes[..bytes.len() / 2].to_vec()
    };
    let mut bad: Vec<(&str, Vec<u8>)> = vec![
        ("nan.obj", with(&obj, "v 0 2 0", "v 0 nan 0")),
        ("infinite.obj", with(&obj, "v 0 2 0", "v 0 1e999 0")),
        ("oversized.obj", with(&obj, "f 205 ", "f 4000000000 ")),
        ("truncated.obj", obj.as_bytes()[..obj.find("f 1 2").unwrap() + 4].to_vec()),
        ("nan.tgf", with(TUBE_TGF, "0 1.95 0", "0 nan 0")),
        ("oversized.tgf", with(TUBE_TGF, "2 3", &format!("2 {huge}"))),
        ("truncated.tgf", TUBE_TGF.as_bytes()[..14].to_vec()),
        ("nan.bvh", with(SMALL_BVH, "5 0 0 10", "5 0 nan 10")),
        ("oversized.bvh", with(SMALL_BVH, "Frames: 3", &format!("Frames: {huge}"))),
        ("truncated.bvh", half("good.bvh")),
        ("cut-line.bvh", SMALL_BVH.as_bytes()[..SMALL_BVH.len() - 8].to_vec()),
        ("nan.off", with(OFF, "1 0 0", "1 nan 0")),
        ("oversized.off", with(OFF, "4 4 0", &format!("{huge} 4 0"))),
        ("truncated.off", half("good.off")),
        ("nan.ply", with(PLY, "1 0 0", "1 nan 0")),
        ("oversized.ply", with(PLY, "vertex 4", &format!("vertex {huge}"))),
        ("truncated.ply", half("good.ply")),
        ("nan.stl", with(STL, "vertex 1 0 0", "vertex 1 nan 0")),
        ("truncated.stl", half("good.stl")),
        ("oversized-binary.stl", binary_stl(u32::MAX)),
        ("truncated-binary.stl", half("good-binary.stl")),
        ("nan-binary.stl", with_bytes(binary_stl(1), 96, &f32::NAN.to_le_bytes())),
        ("nan.mesh", with(MESH, "1 0 0 0", "1 nan 0 0")),
        ("oversized.mesh", with(MESH, "Vertices 4", &format!("Vertices {huge}"))),
        ("truncated.mesh", half("good.mesh")),
        ("nan.glb", glb_with_nan(&good("good.glb"))),
        ("oversized.glb", with_bytes(good("good.glb"), 12, &u32::MAX.to_le_bytes())),
        ("truncated.glb", half("good.glb")),
        ("damaged.armature", with_bytes(good("good.armature"), 300, &f64::NAN.to_le_bytes())),
        ("oversized.armature", with_bytes(good("good.armature"), 12, &u64::MAX.to_le_bytes())),
        ("truncated.armature", half("good.armature")),
        ("truncated.take", good("good.take")[..40].to_vec()),
        ("oversized.take", with_bytes(good("good.take"), 18, &u32::MAX.to_le_bytes())),
        ("damaged.take", with_bytes(good("good.take"), 30, &f64::NAN.to_le_bytes())),
    ];
    let extensions = ["obj", "tgf", "bvh", "off", "ply", "stl", "mesh", "glb", "gltf", "armature", "take"];
    let empty: Vec<String> = extensions.iter().map(|extension| format!("empty.{extension}")).collect();
    bad.extend(empty.iter().map(|name| (name.as_str(), Vec::new())));
    for (name, bytes) in &bad {
        place.write(name, bytes);
        let ran = place.fails(3, name, &["inspect", name]);
        assert_eq!(ran.out, "", "{name}: nothing is said of what was not read");
        // The same file where it is used.
        let device = format!("sim:{name}");
        let virtually = ["--virtual-clock", "--seconds", "1"];
        let arguments = match name.rsplit('.').next().unwrap() {
            "tgf" => vec!["bind", "good.obj", "--skeleton", name],
            "bvh" => [&["run", "--device", &device][..], &virtually].concat(),
            "take" => vec!["export", name, "--to", "out.bvh"],
            "armature" => [&["run", "--character", name][..], &virtually].concat(),
            _ => vec!["bind", name, "--skeleton", "good.tgf"],
        };
        place.fails(3, name, &arguments);
    }
    println!("{} damaged files", bad.len());
    assert!(!place.path("character.armature").exists() && !place.path("out.bvh").exists());
}

#[test]
fn missing_files_and_folders_are_3() {
    let place = Place::new("missing");
    std::fs::create_dir(place.path("folder.obj")).unwrap();
    for extension in ["obj", "tgf", "bvh", "glb", "take", "armature"] {
        let name = format!("missing.{extension}");
        place.fails(3, &name, &["inspect", &name]);
    }
    place.fails(3, "folder.obj", &["inspect", "folder.obj"]);
    place.fails(3, "missing.take", &["replay", "missing.take"]);
    place.fails(3, "missing.take", &["export", "missing.take", "--to", "out.glb"]);
    let run = ["run", "--virtual-clock", "--seconds", "0.1", "--character", "hand", "--device", "sim:hand"];
    for (option, name) in [("--mapping", "missing.toml"), ("--motion", "missing.bvh"), ("--character", "missing.glb")] {
        let arguments =
            if option == "--character" { [&run[..4], &[option, name]] } else { [&run[..], &[option, name]] };
        place.fails(3, name, &arguments.concat());
    }
    place.write("wrong.toml", "this is = not a mapping [");
    place.fails(3, "wrong.toml", &[&run[..], &["--mapping", "wrong.toml"]].concat());
    place.fails(3, "wrong.toml", &[&run[..], &["--calibration", "wrong.toml"]].concat());
    assert_eq!(place.read("wrong.toml"), b"this is = not a mapping [", "a file that was not understood is left alone");
}

/// A crash in the middle of recording loses what was not written, and no more.
#[test]
fn a_cut_take_is_read_as_far_as_it_goes_and_says_so() {
    let place = Place::new("cut-take");
    make_files(&place);
    let bytes = place.read("good.take");
    place.write("cut.take", &bytes[..bytes.len() * 2 / 3]);
    let inspected = place.fails(3, "cut.take", &["inspect", "cut.take"]);
    assert!(inspected.out.contains("not whole") && inspected.out.contains("problem"), "{inspected:?}");
    let replayed = place.done(&["replay", "cut.take"]);
    assert!(replayed.err.contains("note: cut.take"), "{replayed:?}");
    place.done(&["export", "cut.take", "--to", "cut.bvh"]);
    // A flipped bit in the middle costs one record.
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 0x10;
    place.write("flipped.take", flipped);
    let value: serde_json::Value =
        serde_json::from_str(&place.fails(3, "flipped.take", &["inspect", "flipped.take", "--json"]).out).unwrap();
    assert_eq!(value["whole"], false);
    let whole: serde_json::Value = serde_json::from_str(&place.done(&["inspect", "good.take", "--json"]).out).unwrap();
    let lost = |what: &str| whole[what].as_u64().unwrap() - value[what].as_u64().unwrap();
    assert!(lost("samples") + lost("poses") <= 1, "{value}");
}

/// Whatever bytes are changed: an answer, or an error that helps.
#[test]
fn changed_bytes_never_cause_a_panic() {
    let place = Place::new("changed-bytes");
    make_files(&place);
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let mut codes = std::collections::BTreeMap::new();
    for name in GOOD {
        let bytes = place.read(name);
        for _ in 0..6 {
            let mut changed = bytes.clone();
            for _ in 0..4 {
                let at = random() as usize % changed.len();
                changed[at] = random() as u8;
            }
            let file = format!("changed-{name}");
            place.write(&file, &changed);
            let ran = place.run(&["inspect", &file]);
            assert!([0, 3].contains(&ran.code), "{ran:?}");
            if ran.code == 3 {
                ran.assert_explains(&file);
            }
            *codes.entry(ran.code).or_insert(0) += 1;
        }
    }
    println!("exit codes and how often: {codes:?}");
    assert!(codes[&0] > 0 && codes[&3] > 0);
}

/// A frame count that is off by one and a frame time of 0 are repaired, and every command that reads the file says so.
#[test]
fn small_mistakes_of_a_motion_file_are_noted() {
    let place = Place::new("motion-notes");
    place.write("good.bvh", SMALL_BVH);
    place.write("odd.bvh", SMALL_BVH.replace("Frames: 3", "Frames: 4").replace("Frame Time: 0.05", "Frame Time: 0"));
    let count = "4 frames are announced, but there are 3";
    let time = "The frame time is 0";
    let inspected = place.done(&["inspect", "odd.bvh"]);
    assert!(inspected.out.contains(&format!("note: {count}")) && inspected.out.contains(time), "{inspected:?}");
    let run = ["run", "--virtual-clock", "--seconds", "0.5", "--rate", "20", "--device"];
    for [device, character] in [["sim:odd.bvh", "good.bvh"], ["sim:good.bvh", "odd.bvh"]] {
        let ran = place.done(&[&run[..], &[device, "--character", character]].concat());
        assert_eq!(ran.err.matches(count).count(), 1, "{device} {character}: {ran:?}");
        assert!(ran.err.contains(time), "{device} {character}: {ran:?}");
    }
}

/// A glTF of two animated nodes; the name of the second would clear the screen and reverse the writing direction.
fn moved_nodes() -> String {
    let numbers: Vec<u8> =
        [0.0_f32, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0].iter().flat_map(|n| n.to_le_bytes()).collect();
    let base64 = base64(&numbers);
    serde_json::json!({
        "asset": { "version": "2.0" },
        "nodes": [{ "name": "hips", "children": [1] }, { "name": "\u{1b}[2Jspine\u{202e}", "translation": [0, 1, 0] }],
        "buffers": [{ "byteLength": numbers.len(), "uri": format!("data:;base64,{base64}") }],
        "bufferViews": [{ "buffer": 0, "byteLength": numbers.len() }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "type": "SCALAR", "count": 2 },
            { "bufferView": 0, "byteOffset": 8, "componentType": 5126, "type": "VEC4", "count": 2 }
        ],
        "animations": [{ "name": "nod\u{7}", "samplers": [{ "input": 0, "output": 1 }],
            "channels": [{ "sampler": 0, "target": { "node": 1, "path": "rotation" } }] }]
    })
    .to_string()
}

fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let sextets = |group: &[u8]| {
        let bits = group.iter().fold(0_u32, |bits, byte| bits << 8 | u32::from(*byte)) << (8 * (3 - group.len()));
        (0..=group.len()).map(|k| LETTERS[(bits >> (18 - 6 * k) & 63) as usize] as char).collect::<String>()
    };
    bytes.chunks(3).map(sextets).collect()
}

/// Bones without a mesh can be inspected, be the skeleton of a mesh, and be a character. Control characters in their
/// names are escaped.
#[test]
fn bones_without_a_mesh_are_usable_and_their_names_are_harmless() {
    let place = Place::new("bones-alone");
    place.write("bones.gltf", moved_nodes());
    place.write("good.obj", tube_obj());
    place.write("good.bvh", SMALL_BVH);
    let inspected = place.done(&["inspect", "bones.gltf"]);
    for expected in [r#"clip "nod\u{7}""#, r"hips, \u{1b}[2Jspine\u{202e}"] {
        assert!(inspected.out.contains(expected), "{expected}: {inspected:?}");
    }
    let bound = place.done(&["bind", "good.obj", "--skeleton", "bones.gltf", "--output", "tube.armature"]);
    let shown = place.done(&["inspect", "tube.armature"]);
    let run = ["run", "--device", "sim:good.bvh", "--character", "bones.gltf", "--virtual-clock", "--seconds", "1"];
    let performed = place.done(&[&run[..], &["--rate", "20", "--record", "bones.take"]].concat());
    for ran in [inspected, bound, shown, performed] {
        let harmful = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
        assert!(!ran.out.contains(harmful) && !ran.err.contains(harmful), "{ran:?}");
    }
}

#[test]
fn a_simulated_puppet_that_does_not_exist_is_one_error() {
    let place = Place::new("bad-sim");
    for arguments in [
        &["run", "--device", "sim:nothing", "--seconds", "1"][..],
        &["run", "--device", "sim:nothing", "--seconds", "1", "--virtual-clock"],
        &["calibrate", "--device", "sim:nothing", "-o", "new.toml"],
        &["devices", "--decode", "sim:nothing"],
        &["sim", "nothing"],
    ] {
        let ran = place.fails(2, "nothing", arguments);
        assert_eq!(ran.err.matches("error").count(), 1, "{ran:?}");
    }
}

/// An image that lies elsewhere on the machine is named and not opened, although it is there.
#[test]
fn images_outside_the_folder_are_never_followed() {
    let place = Place::new("images-outside");
    let secret = place.write("secret.png", b"not to be read");
    std::fs::create_dir(place.path("inner")).unwrap();
    let triangle = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    for name in
        ["../secret.png", secret.to_str().unwrap(), "a/../../secret.png", "..%2fsecret.png", "%2e%2e/secret.png"]
    {
        let gltf = serde_json::json!({
            "asset": { "version": "2.0" },
            "buffers": [{ "byteLength": 36, "uri": format!("data:application/octet-stream;base64,{triangle}") }],
            "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
            "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
            "images": [{ "uri": name }],
            "textures": [{ "source": 0 }],
            "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
            "nodes": [{ "mesh": 0 }],
            "scenes": [{ "nodes": [0] }],
        });
        place.write("inner/model.gltf", gltf.to_string());
        let ran = place.done(&["inspect", "inner/model.gltf"]);
        let said = format!("{}{}", ran.out, ran.err);
        // Neither read, which would say that it is no picture, nor silently left out.
        assert!(said.contains("secret.png") && !said.contains("neither PNG nor JPEG"), "{name}: {said}");
    }
    place.write("inner/model.obj", "mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    place.write("inner/m.mtl", "newmtl a\nmap_Kd ../secret.png\n");
    let ran = place.done(&["inspect", "inner/model.obj"]);
    assert!(format!("{}{}", ran.out, ran.err).contains("outside the model's folder"), "{ran:?}");
}
