//! Corners of glTF that the Fox does not cover, in documents made here.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::float_cmp, reason = "numbers from a file are kept unchanged")]

use armature_formats::model::{AlphaMode, Model};
use armature_formats::{FormatError, read_model};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};

/// A document under construction: accessors with their bytes in one buffer.
#[derive(Default)]
struct Made {
    views: Vec<Value>,
    accessors: Vec<Value>,
    bytes: Vec<u8>,
}

impl Made {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() }));
        self.bytes.extend(bytes);
        self.views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], kind: u32, shape: &str, count: usize, normalized: bool) -> usize {
        let view = self.view(bytes);
        self.accessors.push(json!({
            "bufferView": view, "componentType": kind, "type": shape, "count": count, "normalized": normalized
        }));
        self.accessors.len() - 1
    }

    fn floats(&mut self, values: &[f32], shape: &str) -> usize {
        let width = match shape {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, 5126, shape, values.len() / width, false)
    }

    fn read(&self, rest: &Value) -> Model {
        self.try_read(rest).unwrap_or_else(|error| panic!("{error}"))
    }

    fn try_read(&self, rest: &Value) -> Result<Model, FormatError> {
        let mut document = json!({
            "asset": { "version": "2.0" },
            "buffers": [{ "uri": "some%20bytes.bin", "byteLength": self.bytes.len() }],
            "bufferViews": self.views,
            "accessors": self.accessors
        });
        document.as_object_mut().unwrap().extend(rest.as_object().unwrap().clone());
        let resolver =
            |name: &str| if name == "some bytes.bin" { Ok(self.bytes.clone()) } else { Err(name.to_owned()) };
        read_model("made.gltf", &serde_json::to_vec(&document).unwrap(), &resolver)
    }
}

const SQUARE: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];

fn areas_face_forward(model: &Model) {
    let v = |i: u32| DVec3::from(model.mesh.vertices[i as usize]);
    for t in &model.mesh.triangles {
        assert!((v(t[1]) - v(t[0])).cross(v(t[2]) - v(t[0])).z > 0.0, "{t:?}");
    }
}

#[test]
fn strips_fans_and_index_types() {
    for (kind, size) in [(5121, 1), (5123, 2), (5125, 4)] {
        for (mode, order) in [(4, vec![0_u32, 1, 3, 0, 3, 2]), (5, vec![0, 1, 2, 3]), (6, vec![0, 1, 3, 2])] {
            let mut made = Made::default();
            let positions = made.floats(&SQUARE, "VEC3");
            let bytes: Vec<u8> = order.iter().flat_map(|i| i.to_le_bytes().into_iter().take(size)).collect();
            let indices = made.accessor(&bytes, kind, "SCALAR", order.len(), false);
            let model = made.read(&json!({
                "nodes": [{ "mesh": 0 }],
                "meshes": [{ "name": "m", "primitives": [
                    { "attributes": { "POSITION": positions }, "indices": indices, "mode": mode },
                    { "attributes": { "POSITION": positions }, "mode": 0 }
                ] }]
            }));
            assert_eq!((model.mesh.vertices.len(), model.mesh.triangles.len()), (4, 2));
            areas_face_forward(&model);
            assert_eq!((model.name.as_str(), model.warnings.len()), ("m", 1));
        }
    }
}

#[test]
fn sparse_and_quantized_positions() {
    let mut made = Made::default();
    // Without bytes of its own, an accessor is zero where nothing overrides it.
    let indices = made.view(&[1, 2, 3]);
    let values: Vec<u8> = SQUARE[3..].iter().flat_map(|v| v.to_le_bytes()).collect();
    let values = made.view(&values);
    made.accessors.push(json!({
        "componentType": 5126, "type": "VEC3", "count": 4,
        "sparse": { "count": 3, "indices": { "bufferView": indices, "componentType": 5121 },
                    "values": { "bufferView": values } }
    }));
    let sparse = made.accessors.len() - 1;
    // Signed shorts, four per vertex by stride, scaled by their node.
    let short = |v: f32| (v * 100.0) as i16;
    let bytes: Vec<u8> =
        SQUARE.chunks(3).flat_map(|p| [short(p[0]), short(p[1]), short(p[2]), 0]).flat_map(i16::to_le_bytes).collect();
    let quantized = made.accessor(&bytes, 5122, "VEC3", 4, false);
    let view = made.views.len() - 1;
    made.views[view]["byteStride"] = json!(8);
    let model = made.read(&json!({
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scenes": [{ "nodes": [0] }],
        "nodes": [
            { "children": [1], "translation": [0, 0, 5] },
            { "mesh": 0, "children": [2] },
            { "mesh": 1, "matrix": [0.01, 0, 0, 0, 0, 0.01, 0, 0, 0, 0, 0.01, 0, 10, 0, 0, 1] },
            { "mesh": 0, "translation": [9, 9, 9] }
        ],
        "meshes": [
            { "primitives": [{ "attributes": { "POSITION": sparse }, "mode": 5 }] },
            { "primitives": [{ "attributes": { "POSITION": quantized }, "mode": 5 }] }
        ]
    }));
    // The last node is not in the scene.
    assert_eq!(model.mesh.vertices.len(), 8);
    for (ours, square) in model.mesh.vertices.iter().zip(SQUARE.chunks(3).cycle()) {
        let shift = if ours[0] > 5.0 { 10.0 } else { 0.0 };
        let expected = DVec3::new(f64::from(square[0]) + shift, f64::from(square[1]), 5.0);
        assert!(DVec3::from(*ours).distance(expected) < 1e-6, "{ours:?} {expected}");
    }
    areas_face_forward(&model);
}

/// A chain hips (node 1) → spine (node 0), listed child first, below a non-joint; a hat hangs on the spine.
fn skinned(made: &mut Made, skins: &Value, meshes: &[usize]) -> Model {
    let positions = made.floats(&SQUARE, "VEC3");
    let joints = made.accessor(&[0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1], 5121, "VEC4", 4, false);
    let weights = made.accessor(&[255, 0, 0, 0, 153, 0, 0, 0, 128, 127, 0, 0, 255, 0, 0, 0], 5121, "VEC4", 4, true);
    let more_joints = made.accessor(&[1, 0, 0, 0].repeat(4), 5121, "VEC4", 4, false);
    let more_weights = made.accessor(&[0, 0, 0, 0, 102, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], 5121, "VEC4", 4, true);
    let times = made.floats(&[0.5, 1.5], "SCALAR");
    let s = std::f32::consts::FRAC_1_SQRT_2;
    let turns = made.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, s, s], "VEC4");
    let mut nodes = vec![
        json!({ "name": "spine", "translation": [0, 1, 0], "children": [3] }),
        json!({ "name": "hips", "translation": [0, 2, 0], "children": [0] }),
        json!({ "name": "armature", "translation": [0, 0, 7], "children": [1] }),
        json!({ "name": "hat", "translation": [0, 1, 0], "mesh": 1 }),
    ];
    nodes.extend(meshes.iter().map(|skin| json!({ "mesh": 0, "skin": skin, "translation": [50, 50, 50] })));
    made.read(&json!({
        "nodes": nodes,
        "meshes": [
            { "primitives": [{ "mode": 5, "attributes": {
                "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights,
                "JOINTS_1": more_joints, "WEIGHTS_1": more_weights } }] },
            { "primitives": [{ "mode": 5, "attributes": { "POSITION": positions } }] }
        ],
        "skins": skins,
        "animations": [{
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "rotation" } }],
            "samplers": [{ "input": times, "output": turns }]
        }]
    }))
}

/// Inverse bind matrices of (spine, hips) whose own frame is `below` the hips' parent.
fn binds(made: &mut Made, below: f32) -> usize {
    let mut values = Vec::new();
    for height in [3.0, 2.0] {
        values.extend([1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -height - below, 0.0, 1.0]);
    }
    made.floats(&values, "MAT4")
}

#[test]
fn joints_are_sorted_and_parts_follow() {
    let mut made = Made::default();
    let binds = binds(&mut made, 0.0);
    let model = skinned(&mut made, &json!([{ "joints": [0, 1], "inverseBindMatrices": binds }]), &[0]);
    let rig = model.rig.as_ref().unwrap();
    let names: Vec<&str> = rig.skeleton.bones().iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["hips", "spine"]);
    assert_eq!(rig.skeleton.bones()[0].rest.translation, Vec3::new(0.0, 2.0, 7.0));
    assert_eq!(rig.skeleton.bones()[0].tail, Vec3::new(0.0, 1.0, 0.0));
    assert!(model.warnings.is_empty(), "{:?}", model.warnings);
    // The hat first (nodes are visited from the roots down), rigidly on the spine; then the skinned square.
    assert_eq!(model.mesh.vertices[0], [0.0, 4.0, 7.0]);
    assert_eq!(rig.influences.of_vertex(0).collect::<Vec<_>>(), [(1, 1.0)]);
    assert_eq!(model.mesh.vertices[4], [0.0, 0.0, 7.0]);
    let row = |v| rig.influences.of_vertex(v).map(|(b, w)| (b, (w * 255.0).round())).collect::<Vec<_>>();
    assert_eq!(row(4), [(1, 255.0)]);
    assert_eq!(row(5), [(0, 255.0)]);
    assert_eq!(row(6), [(1, 255.0)]);
    assert_eq!(row(7), [(0, 255.0)]);

    let (name, motion) = &model.motions[0];
    assert_eq!((name.as_str(), motion.frames.len()), ("animation_1", 25));
    let turn = motion.frames[12].parent_from_bone[1].rotation;
    assert!(turn.angle_between(glam::Quat::from_rotation_z(std::f32::consts::FRAC_PI_4)) < 1e-3);
}

#[test]
fn skins_that_disagree_share_one_rest() {
    let mut made = Made::default();
    let (first, second) = (binds(&mut made, 0.0), binds(&mut made, 10.0));
    let skins = json!([
        { "joints": [0, 1], "inverseBindMatrices": first },
        { "joints": [0, 1], "inverseBindMatrices": second }
    ]);
    let model = skinned(&mut made, &skins, &[0, 1]);
    assert_eq!(model.rig.as_ref().unwrap().skeleton.len(), 2);
    // The second mesh is bound ten below, and shown where the joints are.
    let heights: Vec<f64> = model.mesh.vertices.iter().map(|v| v[1]).collect();
    assert_eq!(heights, [4.0, 4.0, 5.0, 5.0, 0.0, 0.0, 1.0, 1.0, -10.0, -10.0, -9.0, -9.0]);
}

#[test]
fn a_skin_without_matrices_is_bound_where_it_stands() {
    let mut made = Made::default();
    let model = skinned(&mut made, &json!([{ "joints": [0, 1] }]), &[0]);
    let rig = model.rig.as_ref().unwrap();
    assert_eq!(rig.skeleton.rest_segments()[1].0, Vec3::new(0.0, 3.0, 7.0));
    // Its first vertex follows the spine, in whose frame it is given.
    assert_eq!(model.mesh.vertices[4], [0.0, 3.0, 7.0]);
}

#[test]
fn embedded_buffers_and_what_cannot_be_read() {
    let base64 = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    let document = |uri: &str, extra: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"uri":"{uri}","byteLength":36}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],"nodes":[{{"mesh":0}}]{extra}}}"#
        )
    };
    let read = |text: &str| read_model("a.gltf", text.as_bytes(), &|name| Err(format!("no {name}")));
    let uri = format!("data:application/octet-stream;base64,{base64}");
    assert_eq!(read(&document(&uri, "")).unwrap().mesh.vertices[1], [1.0, 0.0, 0.0]);
    let fails = |text: String| read(&text).unwrap_err().to_string();
    assert!(fails(document("gone.bin", "")).contains("gone.bin"));
    assert!(fails(document(&uri, r#","extensionsRequired":["KHR_gaussian_splatting"]"#)).contains("splatting"));
    assert!(fails(document(&uri, "").replace("2.0", "1.0")).contains("glTF"));
    assert!(fails(document(&uri, "").replace("\"count\":3", "\"count\":4")).contains("accessor 0"));
    let circle = document(&uri, "").replace(r#"[{"mesh":0}]"#, r#"[{"children":[1]},{"mesh":0,"children":[0]}]"#);
    assert!(fails(circle).contains("cycle"));
}

/// Columns of a translation's matrix.
fn translation([x, y, z]: [f32; 3]) -> [f32; 16] {
    [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0]
}

/// Hips at the origin, spine one above, tip one above that by the bind matrices (except the tip's own, `last`); each
/// corner of the square follows the joint in `follows`. The nodes are as given.
fn chain(nodes: [Value; 3], last: [f32; 16], follows: [u8; 4]) -> Model {
    let mut made = Made::default();
    let positions = made.floats(&SQUARE, "VEC3");
    let joints: Vec<u8> = follows.iter().flat_map(|&joint| [joint, 0, 0, 0]).collect();
    let joints = made.accessor(&joints, 5121, "VEC4", 4, false);
    let weights = made.accessor(&[255, 0, 0, 0].repeat(4), 5121, "VEC4", 4, true);
    let binds = [translation([0.0; 3]), translation([0.0, -1.0, 0.0]), last].concat();
    let binds = made.floats(&binds, "MAT4");
    let [hips, spine, tip] = nodes;
    made.read(&json!({
        "nodes": [hips, spine, tip, { "mesh": 0, "skin": 0 }],
        "meshes": [{ "primitives": [{ "mode": 5, "attributes": {
            "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights } }] }],
        "skins": [{ "joints": [0, 1, 2], "inverseBindMatrices": binds }]
    }))
}

/// The nodes as they were bound.
fn bound_nodes() -> [Value; 3] {
    [
        json!({ "name": "hips", "children": [1] }),
        json!({ "name": "spine", "translation": [0, 1, 0], "children": [2] }),
        json!({ "name": "tip", "translation": [0, 1, 0] }),
    ]
}

fn heads(model: &Model) -> Vec<Vec3> {
    model.rig.as_ref().unwrap().skeleton.rest_segments().iter().map(|(head, _)| *head).collect()
}

#[test]
fn joints_that_nothing_follows_rest_where_their_nodes_lie() {
    let own = chain(bound_nodes(), translation([0.0, -2.0, 0.0]), [0, 1, 0, 1]);
    assert!(own.warnings.is_empty(), "{:?}", own.warnings);
    for (what, bind) in [
        ("zeros", [0.0; 16]),
        ("the identity", translation([0.0; 3])),
        ("another place", translation([5.0, -3.0, 0.0])),
        ("no numbers", [f32::NAN; 16]),
    ] {
        let model = chain(bound_nodes(), bind, [0, 1, 0, 1]);
        assert_eq!(heads(&model), heads(&own), "{what}");
        assert_eq!(model.mesh, own.mesh, "{what}");
        assert!(model.warnings[0].ends_with("placed where the node is (tip)."), "{what}: {:?}", model.warnings);
    }
    // The body in a pose: a joint that nothing follows moves with its parent.
    let mut posed = bound_nodes();
    posed[1]["rotation"] = json!([0, 0, std::f32::consts::FRAC_1_SQRT_2, std::f32::consts::FRAC_1_SQRT_2]);
    let model = chain(posed, [0.0; 16], [0, 1, 0, 1]);
    assert!(heads(&model)[2].distance(Vec3::new(0.0, 2.0, 0.0)) < 1e-6, "{:?}", heads(&model));
}

#[test]
fn bones_have_the_length_and_size_that_the_file_shows() {
    let own = translation([0.0, -2.0, 0.0]);
    let mut nodes = bound_nodes();
    nodes[2]["translation"] = json!([0, 3, 0]);
    nodes[2]["scale"] = json!([2, 2, 2]);
    // A turn is a pose: the character rests as it was bound.
    nodes[2]["rotation"] = json!([1, 0, 0, 0]);
    let model = chain(nodes, own, [0, 0, 2, 2]);
    assert_eq!(heads(&model)[2], Vec3::new(0.0, 4.0, 0.0));
    // What follows the tip was one below it at x = 0 and x = 1: now it is two below and twice as wide.
    assert_eq!(model.mesh.vertices, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [2.0, 2.0, 0.0]]);
    assert!(model.warnings[0].starts_with("1 bone has another length or scale"), "{:?}", model.warnings);

    let mut nothing = bound_nodes();
    nothing[2]["scale"] = json!([0, 0, 0]);
    let model = chain(nothing, own, [0, 0, 2, 2]);
    let skeleton = &model.rig.as_ref().unwrap().skeleton;
    assert_eq!((heads(&model)[2], skeleton.bones()[2].rest.scale), (Vec3::new(0.0, 2.0, 0.0), Vec3::ONE));
    assert_eq!(model.mesh.vertices, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);

    // Where the whole body is does not count as a proportion.
    let mut lowered = bound_nodes();
    lowered[1]["translation"] = json!([0, 0.25, 0]);
    let model = chain(lowered, own, [1, 1, 2, 2]);
    assert_eq!(heads(&model), [Vec3::Y * -0.75, Vec3::Y * 0.25, Vec3::Y * 1.25]);
    assert_eq!(model.mesh.vertices[0], [0.0, -0.75, 0.0]);
    assert!(model.warnings.is_empty(), "{:?}", model.warnings);
}

#[test]
fn morph_targets_have_the_weights_of_the_node_or_else_of_the_mesh() {
    let mut made = Made::default();
    let positions = made.floats(&SQUARE, "VEC3");
    let up = made.floats(&[0.0, 0.0, 1.0].repeat(4), "VEC3");
    let right = made.floats(&[2.0, 0.0, 0.0].repeat(4), "VEC3");
    let read = |node: &Value, weights: &Value| {
        made.read(&json!({
            "nodes": [node],
            "meshes": [{ "weights": weights, "primitives": [{ "mode": 5, "attributes": { "POSITION": positions },
                "targets": [{ "POSITION": up }, { "POSITION": right }] }] }]
        }))
    };
    let by_mesh = read(&json!({ "mesh": 0 }), &json!([0.5, 0.25]));
    assert_eq!(by_mesh.mesh.vertices[0], [0.5, 0.0, 0.5]);
    let by_node = read(&json!({ "mesh": 0, "weights": [1, 0] }), &json!([0.5, 0.25]));
    assert_eq!(by_node.mesh.vertices[0], [0.0, 0.0, 1.0]);
    assert!(by_node.warnings.is_empty(), "{:?}", by_node.warnings);
    let weights: Vec<f32> = by_node.morph_targets.iter().map(|target| target.default_weight).collect();
    assert_eq!(weights, [1.0, 0.0]);
    let still = read(&json!({ "mesh": 0 }), &json!([0, 0]));
    assert_eq!(still.mesh.vertices[0], [0.0; 3]);
    let names: Vec<&str> = still.morph_targets.iter().map(|target| target.name.as_str()).collect();
    assert_eq!(names, ["mesh_1.1", "mesh_1.2"]);
    assert_eq!(still.morph_targets[1].positions, [[2.0, 0.0, 0.0]; 4]);
}

#[test]
fn only_extensions_of_the_shape_are_refused() {
    let mut made = Made::default();
    let positions = made.floats(&SQUARE, "VEC3");
    let normals = made.floats(&[f32::NAN; 12], "VEC3");
    let document = |extension: &str| {
        json!({
            "extensionsRequired": [extension], "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "mode": 5, "attributes": { "POSITION": positions, "NORMAL": normals } }] }]
        })
    };
    for extension in ["KHR_materials_clearcoat", "EXT_texture_webp", "VENDOR_materials_velvet"] {
        let model = made.read(&document(extension));
        assert_eq!(model.mesh.triangles.len(), 2);
        assert!(model.warnings[0].contains(extension), "{:?}", model.warnings);
        assert!(model.normals.unwrap().iter().flatten().all(|c| c.is_finite()));
    }
    assert!(made.read(&document("KHR_mesh_quantization")).warnings.is_empty());
    for extension in ["VENDOR_whatever", "EXT_mesh_gpu_instancing"] {
        let error = made.try_read(&document(extension)).unwrap_err();
        assert!(error.what.contains(extension) && error.remedy.contains("without"), "{error}");
    }
    let empty = json!({ "asset": { "version": "2.0" }, "nodes": [{ "mesh": 0 }],
        "accessors": [{ "componentType": 5126, "type": "VEC3", "count": 3 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "extensions": { "VENDOR_packed": {} } }] }] });
    let none = |name: &str| Err(name.to_owned());
    let error = read_model("a.gltf", &serde_json::to_vec(&empty).unwrap(), &none).unwrap_err();
    assert!(error.what.contains("have no data"), "{error}");
    for old in [r#"{"asset": {"version": 1.0}, "meshes": {}}"#, r#"{"asset": {"version": "1.0"}, "nodes": {}}"#] {
        assert!(read_model("a.gltf", old.as_bytes(), &none).unwrap_err().what.contains("glTF 1.0"), "{old}");
    }
}

#[test]
fn matrices_with_shear_and_mirrors_are_taken_as_they_are() {
    let mut made = Made::default();
    let positions = made.floats(&SQUARE, "VEC3");
    let normals = made.floats(&[0.0, 0.0, 1.0].repeat(4), "VEC3");
    let read = |node: Value| {
        made.read(&json!({
            "nodes": [node],
            "meshes": [{ "primitives": [{ "mode": 5, "attributes": { "POSITION": positions, "NORMAL": normals } }] }]
        }))
    };
    let sheared = read(json!({ "mesh": 0, "matrix": [1, 0, 0, 0, 0.5, 2, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1] }));
    assert_eq!(sheared.mesh.vertices, [[10.0, 0.0, 0.0], [11.0, 0.0, 0.0], [10.5, 2.0, 0.0], [11.5, 2.0, 0.0]]);
    areas_face_forward(&sheared);
    let mirrored = read(json!({ "mesh": 0, "scale": [-1, 1, 1] }));
    assert_eq!(mirrored.mesh.vertices[1], [-1.0, 0.0, 0.0]);
    areas_face_forward(&mirrored);
    assert!(mirrored.normals.unwrap().iter().all(|n| *n == [0.0, 0.0, 1.0]));
}

#[test]
fn each_primitive_is_a_part_with_its_material_and_colours() {
    let mut made = Made::default();
    let positions = made.floats(&SQUARE, "VEC3");
    let uv = made.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0], "VEC2");
    let colors = made.accessor(&[255, 0, 51].repeat(4), 5121, "VEC3", 4, true);
    let png: &[u8] = b"\x89PNG\r\n\x1a\n and so on";
    let image = made.view(png);
    let place = json!({ "KHR_texture_transform": { "scale": [2, 2], "offset": [0.5, 0] } });
    let primitive =
        |attributes: Value, material: Value| json!({ "mode": 5, "attributes": attributes, "material": material });
    let model = made.read(&json!({
        "extensionsRequired": ["KHR_texture_transform"],
        "nodes": [{ "mesh": 0 }, { "mesh": 1, "translation": [5, 0, 0] }],
        "meshes": [
            { "name": "face", "primitives": [
                primitive(json!({ "POSITION": positions, "TEXCOORD_0": uv }), json!(1)),
                primitive(json!({ "POSITION": positions, "COLOR_0": colors }), json!(0)) ] },
            { "name": "hat", "primitives": [primitive(json!({ "POSITION": positions }), json!(1))] }
        ],
        "materials": [
            { "name": "glow", "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
              "emissiveFactor": [1, 0.5, 0], "extensions": {
                "KHR_materials_unlit": {}, "KHR_materials_emissive_strength": { "emissiveStrength": 3 } } },
            { "name": "skin", "alphaMode": "BLEND",
              "pbrMetallicRoughness": { "metallicFactor": 0.25, "roughnessFactor": 0.5,
                "baseColorTexture": { "index": 0, "extensions": place },
                "metallicRoughnessTexture": { "index": 0, "extensions": place } },
              "normalTexture": { "index": 0, "scale": 0.5 }, "occlusionTexture": { "index": 0 } }
        ],
        "textures": [{ "source": 0 }],
        "images": [{ "bufferView": image, "mimeType": "image/png" }]
    }));
    let parts: Vec<_> = model.parts.iter().map(|part| (part.name.as_str(), part.material)).collect();
    assert_eq!(parts, [("face", Some(0)), ("face", Some(1)), ("hat", Some(0))]);
    let [skin, glow] = model.materials.as_slice() else { panic!("{:?}", model.materials) };
    assert_eq!((skin.name.as_str(), skin.metallic, skin.roughness, skin.alpha), ("skin", 0.25, 0.5, AlphaMode::Blend));
    let maps = [&skin.base_color_map, &skin.metallic_roughness_map].map(|map| map.as_ref().unwrap());
    assert!(std::sync::Arc::ptr_eq(maps[0], maps[1]), "one image for both");
    // The normal map lies elsewhere, and is named.
    assert!(skin.normal_map.is_none() && model.warnings[0].contains("normal map"), "{:?}", model.warnings);
    assert!(model.warnings[1].contains("occlusion") && model.warnings.len() == 2, "{:?}", model.warnings);
    assert_eq!((glow.unlit, glow.double_sided, glow.emissive), (true, true, [3.0, 1.5, 0.0]));
    assert_eq!(glow.alpha, AlphaMode::Mask { cutoff: 0.25 });
    assert_eq!(model.texture_coordinates.as_ref().unwrap()[..4], [[0.5, 0.0], [2.5, 0.0], [0.5, 2.0], [2.5, 2.0]]);
    let colors = model.vertex_colors.as_ref().unwrap();
    assert_eq!((colors[0], colors[4]), ([1.0; 4], [1.0, 0.0, 0.2, 1.0]));
    // The parts share places, and no vertices that are drawn.
    assert_eq!((model.mesh.vertices.len(), model.drawn_vertex_count()), (8, 12));
    model.mesh.validate().unwrap();
}

#[test]
fn a_joint_named_twice_counts_once_with_both_weights() {
    let mut made = Made::default();
    let model = skinned(&mut made, &json!([{ "joints": [0, 1, 0, 1] }]), &[0]);
    let rig = model.rig.as_ref().unwrap();
    assert_eq!(rig.skeleton.len(), 2);
    for vertex in 0..rig.influences.vertex_count() {
        let sum: f32 = rig.influences.of_vertex(vertex).map(|(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-6);
    }
}
