//! A real rigged character against a second reading of its file, done here on the raw JSON.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use armature_formats::model::Model;
use armature_formats::read_model;
use armature_rig::Pose;
use armature_test_support::shared_bytes;
use glam::{Affine3A, Mat4, Quat, Vec3, Vec4};
use serde_json::Value;

fn none(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name} does not exist"))
}

/// The file's JSON and binary chunk, trusted.
struct Raw {
    json: Value,
    binary: Vec<u8>,
}

impl Raw {
    fn new(glb: &[u8]) -> Self {
        let length = |at: usize| u32::from_le_bytes(*glb[at..].first_chunk().unwrap()) as usize;
        let json = length(12);
        Self { json: serde_json::from_slice(&glb[20..20 + json]).unwrap(), binary: glb[20 + json + 8..].to_vec() }
    }

    /// Components of an accessor, integers as floats.
    fn read(&self, accessor: &Value, width: usize) -> Vec<Vec<f32>> {
        let accessor = &self.json["accessors"][usize_of(accessor)];
        let view = &self.json["bufferViews"][usize_of(&accessor["bufferView"])];
        let start = usize_of(&view["byteOffset"]) + usize_of(&accessor["byteOffset"]);
        let size = if accessor["componentType"] == 5123 { 2 } else { 4 };
        let stride = view["byteStride"].as_u64().map_or(size * width, |s| s as usize);
        let component = |at: usize| {
            let bytes = &self.binary[at..at + size];
            if size == 2 {
                f32::from(u16::from_le_bytes([bytes[0], bytes[1]]))
            } else {
                f32::from_le_bytes(*bytes.first_chunk().unwrap())
            }
        };
        let element = |i: usize| (0..width).map(|k| component(start + i * stride + k * size)).collect();
        (0..usize_of(&accessor["count"])).map(element).collect()
    }

    /// Node matrices in the scene at a time of an animation (linear keys), or as the file poses them.
    fn world(&self, animation: Option<(usize, f32)>) -> Vec<Mat4> {
        let nodes = self.json["nodes"].as_array().unwrap();
        let floats = |v: &Value, default: &[f32]| -> Vec<f32> {
            v.as_array().map_or(default.to_vec(), |a| a.iter().map(|x| x.as_f64().unwrap() as f32).collect())
        };
        let mut parts: Vec<[Vec<f32>; 3]> = nodes
            .iter()
            .map(|n| {
                [
                    floats(&n["translation"], &[0.0; 3]),
                    floats(&n["rotation"], &[0.0, 0.0, 0.0, 1.0]),
                    floats(&n["scale"], &[1.0; 3]),
                ]
            })
            .collect();
        if let Some((animation, time)) = animation {
            let animation = &self.json["animations"][animation];
            for channel in animation["channels"].as_array().unwrap() {
                let sampler = &animation["samplers"][usize_of(&channel["sampler"])];
                let slot =
                    ["translation", "rotation", "scale"].iter().position(|p| channel["target"]["path"] == **p).unwrap();
                let times = self.read(&sampler["input"], 1);
                let values = self.read(&sampler["output"], if slot == 1 { 4 } else { 3 });
                let next = times.iter().position(|t| t[0] >= time).unwrap_or(times.len() - 1).max(1);
                let s = ((time - times[next - 1][0]) / (times[next][0] - times[next - 1][0])).clamp(0.0, 1.0);
                let (a, b) = (&values[next - 1], &values[next]);
                parts[usize_of(&channel["target"]["node"])][slot] = if slot == 1 {
                    let (a, b) = (Quat::from_slice(a), Quat::from_slice(b));
                    a.slerp(b, s).to_array().to_vec()
                } else {
                    a.iter().zip(b).map(|(a, b)| a + (b - a) * s).collect()
                };
            }
        }
        let mut parent = vec![None; nodes.len()];
        for (index, node) in nodes.iter().enumerate() {
            for child in node["children"].as_array().into_iter().flatten() {
                parent[usize_of(child)] = Some(index);
            }
        }
        let local = |n: usize| {
            let [t, r, s] = &parts[n];
            Mat4::from_scale_rotation_translation(
                Vec3::from_slice(s),
                Quat::from_slice(r).normalize(),
                Vec3::from_slice(t),
            )
        };
        (0..nodes.len())
            .map(|n| {
                let mut matrix = local(n);
                let mut above = parent[n];
                while let Some(p) = above {
                    matrix = local(p) * matrix;
                    above = parent[p];
                }
                matrix
            })
            .collect()
    }

    /// Skinned positions of every vertex of the file, by its own matrices.
    fn skinned(&self, animation: Option<(usize, f32)>) -> Vec<Vec3> {
        let attributes = &self.json["meshes"][0]["primitives"][0]["attributes"];
        let world = self.world(animation);
        let skin = &self.json["skins"][0];
        let binds = self.read(&skin["inverseBindMatrices"], 16);
        let joints: Vec<Mat4> = skin["joints"]
            .as_array()
            .unwrap()
            .iter()
            .zip(&binds)
            .map(|(node, bind)| world[usize_of(node)] * Mat4::from_cols_slice(bind))
            .collect();
        let positions = self.read(&attributes["POSITION"], 3);
        let bones = self.read(&attributes["JOINTS_0"], 4);
        let weights = self.read(&attributes["WEIGHTS_0"], 4);
        positions
            .iter()
            .zip(bones.iter().zip(&weights))
            .map(|(p, (bones, weights))| {
                let p = Vec4::new(p[0], p[1], p[2], 1.0);
                let total: f32 = weights.iter().sum();
                let sum: Vec4 = bones.iter().zip(weights).map(|(b, w)| joints[*b as usize] * p * (*w / total)).sum();
                sum.truncate()
            })
            .collect()
    }
}

fn usize_of(v: &Value) -> usize {
    v.as_u64().unwrap_or(0) as usize
}

/// Our mesh under a pose.
fn posed(model: &Model, pose: &Pose) -> Vec<Vec3> {
    let rig = model.rig.as_ref().unwrap();
    let mut world = vec![Affine3A::IDENTITY; rig.skeleton.len()];
    pose.forward_kinematics(&rig.skeleton, &mut world);
    let rest = rig.skeleton.rest_model_from_bone();
    let skin: Vec<Affine3A> = world.iter().zip(&rest).map(|(w, r)| *w * r.inverse()).collect();
    model
        .mesh
        .vertices
        .iter()
        .enumerate()
        .map(|(v, p)| {
            let p = glam::DVec3::from(*p).as_vec3();
            rig.influences.of_vertex(v).map(|(b, w)| skin[usize::from(b)].transform_point3(p) * w).sum()
        })
        .collect()
}

#[test]
fn fox_keeps_its_rig() {
    let Some(bytes) = shared_bytes("Fox.glb") else { return };
    let model = read_model("Fox.glb", &bytes, &none).unwrap();
    let raw = Raw::new(&bytes);
    let rig = model.rig.as_ref().unwrap();
    println!(
        "{} vertices, {} drawn, {} triangles, warnings {:?}",
        model.mesh.vertices.len(),
        model.drawn_vertex_count(),
        model.mesh.triangles.len(),
        model.warnings
    );
    for bone in rig.skeleton.bones() {
        println!("{:?} {} {:?} {:?}", bone.parent, bone.name, bone.rest.translation, bone.tail);
    }
    assert_eq!((rig.skeleton.len(), model.drawn_vertex_count(), model.mesh.triangles.len()), (24, 1_728, 576));
    assert_eq!(model.materials[0].base_color_map.as_ref().unwrap().mime, "image/png");
    assert_eq!(model.texture_coordinates.as_ref().unwrap().len(), 1_728);
    assert!(model.warnings.is_empty(), "{:?}", model.warnings);
    assert_eq!(rig.influences.vertex_count(), model.mesh.vertices.len());

    let file = raw.skinned(None);
    let drawn = model.mesh_vertex_of_drawn();
    let still = posed(&model, &rig.skeleton.rest_pose());
    let mut worst = (0.0_f32, 0.0_f32);
    // Drawn vertices come in the order triangles name them; the Fox has no indices, so that is the file's.
    for (file, &v) in file.iter().zip(&drawn) {
        let ours = glam::DVec3::from(model.mesh.vertices[v as usize]).as_vec3();
        worst = (worst.0.max(ours.distance(*file)), worst.1.max(still[v as usize].distance(ours)));
    }
    println!("shown pose off by {}, rest skinning by {} of 155", worst.0, worst.1);
    assert!(worst.1 < 1e-4);
}

/// The Fox with its nodes changed, packed again.
fn changed_fox(bytes: &[u8], change: impl Fn(&mut Value)) -> Vec<u8> {
    let mut raw = Raw::new(bytes);
    change(&mut raw.json);
    let mut json = serde_json::to_vec(&raw.json).unwrap();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend((12 + 8 + json.len() as u32 + 8 + raw.binary.len() as u32).to_le_bytes());
    out.extend((json.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(&json);
    out.extend((raw.binary.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(&raw.binary);
    out
}

/// Every clip at a few frames, and the mesh at rest, against the second reading; all off by at most a share of `size`.
fn compare_motions(bytes: &[u8], size: f32) -> Model {
    let model = read_model("Fox.glb", bytes, &none).unwrap();
    let raw = Raw::new(bytes);
    let drawn = model.mesh_vertex_of_drawn();
    let still = posed(&model, &model.rig.as_ref().unwrap().skeleton.rest_pose());
    for (at_rest, vertex) in still.iter().zip(&model.mesh.vertices) {
        assert!(at_rest.distance(glam::DVec3::from(*vertex).as_vec3()) < 1e-5 * size);
    }
    for (animation, (name, motion)) in model.motions.iter().enumerate() {
        for frame in [0, motion.frames.len() / 2, motion.frames.len() - 1] {
            let file = raw.skinned(Some((animation, (frame as f64 * motion.frame_seconds) as f32)));
            let ours = posed(&model, &motion.frames[frame]);
            let worst = file.iter().zip(&drawn).fold(0.0_f32, |w, (f, &v)| w.max(f.distance(ours[v as usize])));
            assert!(worst < 1e-4 * size, "{name}, frame {frame}: {worst} of {size}");
        }
    }
    model
}

#[test]
fn fox_in_another_frame() {
    let Some(bytes) = shared_bytes("Fox.glb") else { return };
    // As exporters with other axes and units write it: everything hangs below a scaled and turned node.
    let moved = changed_fox(&bytes, |json| {
        let nodes = json["nodes"].as_array_mut().unwrap();
        let top = nodes.len();
        nodes.push(serde_json::json!({
            "children": [0], "translation": [1, 2, 3], "rotation": [0.5, 0.5, 0.5, 0.5], "scale": [0.01, 0.01, 0.01]
        }));
        json["scenes"][0]["nodes"] = serde_json::json!([1, top]);
    });
    let model = compare_motions(&moved, 1.55);
    let shown = Raw::new(&moved).skinned(None);
    for (file, &v) in shown.iter().zip(&model.mesh_vertex_of_drawn()) {
        assert!(file.distance(glam::DVec3::from(model.mesh.vertices[v as usize]).as_vec3()) < 1e-5);
    }
}

#[test]
fn fox_that_does_not_show_its_bind_pose() {
    let Some(bytes) = shared_bytes("Fox.glb") else { return };
    let posed = changed_fox(&bytes, |json| {
        json["nodes"][4]["rotation"] = serde_json::json!([0.0, 0.0, 0.6, 0.8]);
        json["nodes"][7]["rotation"] = serde_json::json!([0.6, 0.0, 0.0, 0.8]);
    });
    let model = compare_motions(&posed, 155.0);
    let bind = read_model("Fox.glb", &bytes, &none).unwrap();
    for (a, b) in model.mesh.vertices.iter().zip(&bind.mesh.vertices) {
        assert!(glam::DVec3::from(*a).distance(glam::DVec3::from(*b)) < 1e-3, "{a:?} {b:?}");
    }
}

#[test]
fn fox_moves_as_its_file_says() {
    let Some(bytes) = shared_bytes("Fox.glb") else { return };
    let model = read_model("Fox.glb", &bytes, &none).unwrap();
    let raw = Raw::new(&bytes);
    let drawn = model.mesh_vertex_of_drawn();
    let names: Vec<&str> = model.motions.iter().map(|(n, _)| n.as_str()).collect();
    assert_eq!(names, ["Survey", "Walk", "Run"]);
    for (animation, (name, motion)) in model.motions.iter().enumerate() {
        println!("{name}: {} frames of {} s", motion.frames.len(), motion.frame_seconds);
        let mut worst = 0.0_f32;
        for frame in [0, motion.frames.len() / 3, motion.frames.len() - 1] {
            let time = frame as f64 * motion.frame_seconds;
            let file = raw.skinned(Some((animation, time as f32)));
            let ours = posed(&model, &motion.frames[frame]);
            worst = file.iter().zip(&drawn).fold(worst, |w, (f, &v)| w.max(f.distance(ours[v as usize])));
        }
        println!("{name}: off by {worst} of 155");
        assert!(worst < 1e-2, "{name}: {worst}");
    }
}
