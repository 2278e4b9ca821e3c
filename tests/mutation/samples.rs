//! Small, valid files of every kind that the program reads.

use std::collections::BTreeMap;

use armature_formats::gltf::{GlbClip, GlbMesh, GlbScene, write_glb};
use armature_formats::tables::{NumberTable, write_dmat, write_npy};
use armature_geometry::Influences;
use armature_rig::{Bone, Motion, Skeleton, Transform};
use serde_json::json;

use crate::common::{Place, SMALL_BVH, TUBE_TGF, tube_obj};

/// A valid file.
pub(crate) struct Sample {
    pub(crate) name: String,
    pub(crate) bytes: Vec<u8>,
}

impl Sample {
    /// What a puppet sends over its line; a session reads it, not a reader of files.
    pub(crate) fn is_wire(&self) -> bool {
        std::path::Path::new(&self.name).extension().is_some_and(|extension| extension == "bin")
    }
}

const OFF: &str = "STNOFF\n4 4 0\n0 0 0 0 0 1 0 0\n1 0 0 0 0 1 1 0\n0 1 0 0 0 1 0 1\n0 0 1 0 0 1 1 1\n\
    3 0 2 1\n3 0 1 3 255 0 0\n3 0 3 2\n3 1 2 3\n";
const PLY: &str = "ply\nformat ascii 1.0\ncomment c\nelement vertex 4\nproperty float x\nproperty float y\nproperty double z\n\
    property float u\nproperty float v\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 1 0 1\n4 0 1 2 3\n3 0 1 2\n";
const STRIPS: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 1\n\
    7 0 1 2 3 -1 0 2\n";
const STL: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\nendfacet\n\
    facet normal 0 0 1\ncolor 1 1 1\nouter loop\nvertex 0 0 0\nvertex 1 1 0\nvertex 0 0 1\nendloop\nendfacet\nendsolid a\n";
const MESH: &str = "MeshVersionFormatted 1\nDimension 3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\nTriangles\n4\n\
    1 3 2 0\n1 2 4 0\n1 4 3 0\n2 3 4 0\nTetrahedra\n1\n1 2 3 4 0\nEnd\n";
const OBJ: &str = "mtllib good.mtl\no x\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nvt 0 0\nvt 1 1\nvn 0 0 1\nusemtl m\n\
    f 1/1/1 2/2/1 3/1/1 4/2/1\nf -1 -2 -3\nf 1 2\n";
const MTL: &str = "newmtl m\nKd 0.5 0.25 1\nd 1\nmap_Kd -clamp on good.png\n";
const CALIBRATION: &str = "version = 2\nfilter = \"hold:100\"\n\n[[part]]\nuid = \"00112233445566778899aabb\"\n\
    filter = \"one-euro:2,1,1\"\nmounting = [0.0, 0.7071068, 0.0, 0.7071068]\nheading = 0.25\nsensors = [\n\
    { axis = \"twist\", zero_counts = 8121 },\n\
    { axis = \"bend\", zero_counts = 77, reversed = true, range = { first_counts = 15000, span_counts = 5200 } },\n]\n";
const EDITS: &str = "\
version = 1
take = \"good.take\"
[[edit]]
do = \"overdub\"
take = \"good.take\"
bones = [\"knee\"]
at = 0.1
blend = 0.1
[[edit]]
do = \"filter\"
filter = \"one-euro:2,1\"
[[edit]]
do = \"trim\"
from = 0.1
to = 1.0
[[edit]]
do = \"smooth\"
cutoff = 5.0
[[edit]]
do = \"hold\"
pose = 0.2
from = 0.4
to = 0.5
blend = 0.1
[[edit]]
do = \"retime\"
speed = 0.5
[[edit]]
do = \"loop\"
times = 2
blend = 0.2
[[edit]]
do = \"marker\"
at = 0.5
text = \"here\"
";
const MAPPING: &str = "version = 1\n\n[[joint]]\npart = \"00112233445566778899aabb\"\nbone = \"knee\"\n\
    mounting = [0.0, 0.7071068, 0.0, 0.7071068]\n";

/// Files that samples refer to, by name.
pub(crate) type Companions = BTreeMap<String, Vec<u8>>;

/// Files of the shared data that are small enough.
const SHARED: [&str; 9] = [
    "cases/stl/s_trail.stl",
    "cases/stl/t_colorline.stl",
    "cases/obj/o_badvt.obj",
    "cases/bvh/base.bvh",
    "cases/glb/ibmzero.glb",
    "cases/glb/a_bighead.glb",
    "cases/glb/morph.glb",
    "cases/glb/webp_req.glb",
    "cases/glb/animnoskin.glb",
];

/// All samples, and the files that they refer to; some are made by the program itself. All are written to the place.
pub(crate) fn all(place: &Place) -> (Vec<Sample>, Companions) {
    let glb = glb();
    let length = u32::from_le_bytes(*glb[12..].first_chunk().unwrap()) as usize;
    let mut json: serde_json::Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    json["buffers"][0]["uri"] = "good.bin".into();
    let companions = [("good.bin", &glb[20 + length + 8..]), ("good.mtl", MTL.as_bytes()), ("good.png", PNG)];
    let companions = companions.map(|(name, bytes)| (name.to_owned(), bytes.to_vec()));
    for (name, bytes) in &companions {
        place.write(name, bytes);
    }
    let table = NumberTable { rows: 3, columns: 2, values: vec![1.0, 0.5, 0.0, 0.0, 0.5, 1.0] };
    let mut files: Vec<(&str, Vec<u8>)> = [
        ("seams.obj", OBJ),
        ("good.off", OFF),
        ("good.ply", PLY),
        ("strips.ply", STRIPS),
        ("good.stl", STL),
        ("good.mesh", MESH),
        ("good.tgf", TUBE_TGF),
        ("good.bvh", SMALL_BVH),
        ("good-calibration.toml", CALIBRATION),
        ("good-mapping.toml", MAPPING),
        ("good.edit", EDITS),
    ]
    .map(|(name, text)| (name, text.as_bytes().to_vec()))
    .to_vec();
    files.extend([
        ("good.obj", tube_obj().into_bytes()),
        ("binary.ply", binary_ply()),
        ("binary.stl", binary_stl()),
        ("binary.off", binary_off()),
        ("wire.bin", wire()),
        ("good.npy", write_npy(&table)),
        ("good.dmat", write_dmat(&table).into_bytes()),
        ("text.fbx", include_bytes!("../../host/crates/formats/tests/fbx/text.fbx").to_vec()),
        ("blender.fbx", include_bytes!("../../host/crates/formats/tests/fbx/blender.fbx").to_vec()),
        ("draco.glb", include_bytes!("../../host/crates/formats/tests/compressed/draco.glb").to_vec()),
        ("meshopt.glb", include_bytes!("../../host/crates/formats/tests/compressed/meshopt.glb").to_vec()),
        ("good.vrm", avatar(&json, false)),
        ("old.vrm", avatar(&json, true)),
        ("good.gltf", serde_json::to_vec(&json).unwrap()),
        ("good.glb", glb),
    ]);
    let mut samples: Vec<Sample> =
        files.into_iter().map(|(name, bytes)| Sample { name: name.to_owned(), bytes }).collect();
    for sample in &samples {
        place.write(&sample.name, &sample.bytes);
    }
    place.done(&["bind", "good.obj", "--skeleton", "good.tgf", "--output", "good.armature"]);
    let run = ["run", "--device", "sim:good.bvh", "--virtual-clock", "--seconds", "1.5", "--rate", "20"];
    place.done(&[&run[..], &["--character", "good.bvh", "--record", "good.take"]].concat());
    for made in ["good.armature", "good.take"] {
        samples.push(Sample { name: made.to_owned(), bytes: place.read(made) });
    }
    for name in SHARED {
        if let Some(bytes) = armature_test_support::shared_bytes(name) {
            samples.push(Sample { name: name.rsplit('/').next().unwrap_or(name).to_owned(), bytes });
        }
    }
    (samples, companions.into_iter().collect())
}

/// One white pixel.
const PNG: &[u8] =
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\0\0\0\0:~\x9bU\0\0\0\nIDATx\x9cc\xf8\x0f\0\x01\
    \x01\x01\0\x1b\xb6\xeeV\0\0\0\0IEND\xaeB`\x82";

fn little(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Every message of the protocol, one after the other.
fn wire() -> Vec<u8> {
    let golden = include_str!("../../firmware-protocol/golden.txt");
    let frames = golden.lines().filter(|line| !line.starts_with('#')).filter_map(|line| line.split_once(" = "));
    let digits: Vec<u8> = frames.flat_map(|(_, digits)| digits.trim().bytes()).collect();
    let value = |digit: u8| char::from(digit).to_digit(16).unwrap() as u8;
    digits.chunks_exact(2).map(|pair| value(pair[0]) << 4 | value(pair[1])).collect()
}

fn binary_ply() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n"
        .to_vec();
    bytes.extend(little(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]));
    for corners in [[0_i32, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
        bytes.push(3);
        bytes.extend(corners.iter().flat_map(|v| v.to_le_bytes()));
    }
    bytes
}

fn binary_stl() -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(2_u32.to_le_bytes());
    for tip in [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
        bytes.extend(little(&[0.0; 3]));
        bytes.extend(little(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]));
        bytes.extend(little(&tip));
        bytes.extend([0, 0]);
    }
    bytes
}

fn binary_off() -> Vec<u8> {
    let mut bytes = b"OFF BINARY\n".to_vec();
    bytes.extend([4_u32, 2, 0].iter().flat_map(|v| v.to_be_bytes()));
    let positions = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    bytes.extend(positions.iter().flat_map(|v| v.to_be_bytes()));
    bytes.extend([3_u32, 0, 1, 2, 0, 3, 0, 1, 3, 0].iter().flat_map(|v| v.to_be_bytes()));
    bytes
}

/// The character as an avatar, in text, and with a second mesh that follows no bone.
fn avatar(json: &serde_json::Value, old: bool) -> Vec<u8> {
    let mut avatar = json.clone();
    let nodes = avatar["nodes"].as_array_mut().unwrap();
    let of_mesh = nodes.iter().find(|node| node.get("mesh").is_some()).unwrap()["mesh"].clone();
    nodes.push(json!({ "name": "loose", "mesh": of_mesh }));
    let loose = nodes.len() - 1;
    avatar["scenes"][0]["nodes"].as_array_mut().unwrap().push(loose.into());
    let joint = avatar["skins"][0]["joints"][0].clone();
    let [bind, collider] = [json!({ "node": loose, "index": 0, "weight": 1 }), json!({ "colliders": [0] })];
    let extensions = if old {
        json!({ "VRM": {
            "humanoid": { "humanBones": [{ "bone": "hips", "node": joint }] },
            "blendShapeMaster": { "blendShapeGroups": [
                { "name": "Joy", "presetName": "joy", "binds": [{ "mesh": of_mesh, "index": 0, "weight": 75 }] }] },
            "secondaryAnimation": {
                "boneGroups": [{ "stiffiness": 2, "gravityDir": { "x": 0, "y": 0, "z": 1 }, "bones": [joint],
                    "colliderGroups": [0] }],
                "colliderGroups": [{ "node": joint, "colliders": [{ "offset": { "x": 0, "y": 1, "z": 0 }, "radius": 1 }] }]
            }
        } })
    } else {
        json!({
            "VRMC_vrm": {
                "specVersion": "1.0",
                "humanoid": { "humanBones": { "hips": { "node": joint } } },
                "expressions": { "preset": { "happy": { "morphTargetBinds": [bind] } } }
            },
            "VRMC_springBone": {
                "colliders": [{ "node": joint, "shape": { "sphere": { "offset": [0, 1, 0], "radius": 1 } } }],
                "colliderGroups": [collider],
                "springs": [{ "joints": [{ "node": joint }, { "node": joint }], "colliderGroups": [0] }]
            }
        })
    };
    avatar["extensions"] = extensions;
    serde_json::to_vec(&avatar).unwrap()
}

/// A small rigged, animated, textured character.
fn glb() -> Vec<u8> {
    let bone = |name: &str, parent| Bone {
        name: name.to_owned(),
        parent,
        rest: Transform { translation: glam::Vec3::Y, ..Transform::IDENTITY },
        tail: glam::Vec3::Y,
    };
    let skeleton = Skeleton::new(vec![bone("a", None), bone("b", Some(0))]).unwrap();
    let mut pose = skeleton.rest_pose();
    pose.parent_from_bone[1].rotation = glam::Quat::from_rotation_x(1.0);
    let motion = Motion::new(skeleton.clone(), 0.1, vec![skeleton.rest_pose(), pose]).unwrap();
    let beside = |name: &str| match name {
        "good.mtl" => Ok(MTL.as_bytes().to_vec()),
        "good.png" => Ok(PNG.to_vec()),
        _ => Err(format!("there is no {name}")),
    };
    let model = armature_formats::read_model("seams.obj", OBJ.as_bytes(), &beside).unwrap();
    assert!(model.warnings.iter().all(|warning| warning.contains("corners")), "{:?}", model.warnings);
    let influences = Influences::new(1, vec![0, 1, 1, 0], vec![1.0; 4], 2).unwrap();
    let mesh = GlbMesh { influences: Some(&influences), ..GlbMesh::of_model(&model) };
    let clips = vec![GlbClip::of_motion("nod", &motion)];
    write_glb(&GlbScene { name: "x", skeleton: &skeleton, mesh: Some(mesh), clips }).unwrap()
}
