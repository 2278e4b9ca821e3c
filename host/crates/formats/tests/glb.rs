//! What is written as GLB is read again, for characters that are awkward in every way.
//!
//! Where `ARMATURE_KEEP_EXPORTS` names a folder, the files stay there for `tests/validate_gltf.mjs`.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::float_cmp, reason = "texture coordinates are copied, not computed")]

use std::sync::Arc;

use armature_formats::gltf::{GlbClip, GlbMesh, GlbScene, GlbTimes, write_glb};
use armature_formats::model::{AlphaMode, Material, MeshPart, Model, MorphTarget, Skin, Split, Texture};
use armature_formats::read_model;
use armature_geometry::{Influences, TriangleMesh};
use armature_rig::{Bone, Pose, Skeleton, Transform};
use glam::{EulerRot, Quat, Vec3};

fn none(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name} does not exist"))
}

/// The smallest PNG there is: one white pixel.
const PIXEL: [u8; 67] = [
    0x89, 0x50, 0x4E, 0x47, 0x0D, 0x0A, 0x1A, 0x0A, 0, 0, 0, 0x0D, 0x49, 0x48, 0x44, 0x52, 0, 0, 0, 1, 0, 0, 0, 1, 8,
    0, 0, 0, 0, 0x3A, 0x7E, 0x9B, 0x55, 0, 0, 0, 0x0A, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9C, 0x63, 0xF8, 0x0F, 0, 1, 1,
    1, 0, 0xB1, 0x38, 0xF6, 0x14, 0, 0, 0, 0, 0x49, 0x45, 0x4E, 0x44, 0xAE, 0x42, 0x60, 0x82,
];

/// A small deterministic stream of numbers in -1..1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 8_388_608.0 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }

    fn rotation(&mut self) -> Quat {
        Quat::from_euler(EulerRot::XYZ, 3.0 * self.next(), 3.0 * self.next(), 3.0 * self.next())
    }
}

/// Bones with rest rotations and uniform scales, several roots, hubs, more than 256 of them if asked.
fn skeleton(noise: &mut Noise, bones: usize) -> Skeleton {
    let bones = (0..bones)
        .map(|index| Bone {
            name: format!("bone {index}"),
            parent: if index % 40 == 0 { None } else { Some(index - 1 - index % 3 % index.min(2)) },
            rest: Transform {
                translation: if index % 7 == 3 { Vec3::ZERO } else { noise.vector() },
                rotation: noise.rotation(),
                scale: Vec3::splat(1.0 + 0.2 * noise.next()),
            },
            tail: noise.vector(),
        })
        .collect();
    Skeleton::new(bones).unwrap()
}

/// A strip of triangles with a seam along its middle.
fn surface(noise: &mut Noise, skeleton: &Skeleton, per_vertex: usize) -> (Model, Influences) {
    let mesh = TriangleMesh {
        vertices: (0..50).map(|_| noise.vector().as_dvec3().to_array()).collect(),
        triangles: (0..48).map(|i| [i, i + 1, i + 2]).collect(),
    };
    let mut mesh_vertex: Vec<u32> = (0..50).collect();
    mesh_vertex.extend(20..30);
    let moved = |v: u32, t: usize| if t >= 24 && (20..30).contains(&v) { v + 30 } else { v };
    let triangles: Vec<[u32; 3]> = mesh.triangles.iter().enumerate().map(|(t, c)| c.map(|v| moved(v, t))).collect();
    // Corners that only one side uses would be dropped by a reader.
    let used: Vec<u32> = (0..60).filter(|v| triangles.iter().flatten().any(|c| c == v)).collect();
    let number = |v: u32| used.iter().position(|u| *u == v).unwrap() as u32;
    let split = Split {
        mesh_vertex: used.iter().map(|&v| mesh_vertex[v as usize]).collect(),
        triangles: triangles.iter().map(|t| t.map(number)).collect(),
    };
    let drawn = split.mesh_vertex.len();
    let bones: Vec<u16> = (0..50 * per_vertex).map(|k| (k * 7 % skeleton.len()) as u16).collect();
    let weights: Vec<f32> = (0..50 * per_vertex).map(|_| noise.next().abs() + 0.01).collect();
    let model = Model {
        name: "awkward".to_owned(),
        mesh,
        split: Some(split),
        normals: Some((0..drawn).map(|_| noise.vector().normalize().to_array()).collect()),
        texture_coordinates: Some((0..drawn).map(|_| [noise.next(), noise.next()]).collect()),
        materials: vec![Material {
            name: "skin".into(),
            base_color: Some([0.25, 0.5, 0.75, 1.0]),
            base_color_map: Some(Arc::new(Texture {
                mime: "image/png".to_owned(),
                bytes: PIXEL.to_vec(),
                ..Texture::default()
            })),
            ..Material::default()
        }],
        ..Model::default()
    };
    (model, Influences::new(per_vertex, bones, weights, skeleton.len()).unwrap())
}

fn keep(name: &str, bytes: &[u8]) {
    if let Some(folder) = std::env::var_os("ARMATURE_KEEP_EXPORTS") {
        std::fs::write(std::path::Path::new(&folder).join(name), bytes).unwrap();
    }
}

#[test]
fn awkward_characters_come_back() {
    for (bones, per_vertex) in [(1, 1), (9, 4), (100, 8), (300, 5)] {
        let mut noise = Noise(bones as u64);
        let skeleton = skeleton(&mut noise, bones);
        let (model, influences) = surface(&mut noise, &skeleton, per_vertex);
        let poses: Vec<Pose> = (0..5)
            .map(|_| {
                let mut pose = skeleton.rest_pose();
                for local in pose.parent_from_bone.iter_mut().step_by(2) {
                    local.rotation = (local.rotation * noise.rotation()).normalize();
                    local.translation += noise.vector();
                }
                pose
            })
            .collect();
        // Seconds that are all multiples of an eightieth, so that a reader's even frames meet every key.
        let times = [0.0, 0.0125, 0.05, 0.0875, 0.1];
        let clips = vec![
            GlbClip { name: "uneven", times: GlbTimes::At(&times), poses: &poses, weights: &[] },
            GlbClip { name: "even", times: GlbTimes::EverySeconds(0.04), poses: &poses, weights: &[] },
            GlbClip { name: "one", times: GlbTimes::EverySeconds(0.04), poses: &poses[..1], weights: &[] },
        ];
        let mesh = GlbMesh { influences: Some(&influences), ..GlbMesh::of_model(&model) };
        let scene = GlbScene { name: "awkward", skeleton: &skeleton, mesh: Some(mesh), clips };
        let bytes = write_glb(&scene).unwrap();
        keep(&format!("awkward-{bones}.glb"), &bytes);

        let again = read_model("awkward.glb", &bytes, &none).unwrap();
        assert!(again.warnings.is_empty(), "{:?}", again.warnings);
        assert_eq!(again.name, "awkward");
        compare_surface(&model, &again);
        compare_rig(&skeleton, &influences, &model, &again);
        let names: Vec<&str> = again.motions.iter().map(|(n, _)| n.as_str()).collect();
        assert_eq!(names, ["uneven", "even", "one"]);
        let keys = [vec![0, 1, 4, 7, 8], vec![0, 1, 2, 3, 4], vec![0]];
        for ((_, motion), keys) in again.motions.iter().zip(keys) {
            assert_eq!(motion.frames.len(), keys.last().unwrap() + 1);
            for (pose, key) in poses.iter().zip(keys) {
                compare_pose(&skeleton, &motion.skeleton, pose, &motion.frames[key]);
            }
        }
    }
}

fn compare_surface(model: &Model, again: &Model) {
    assert_eq!(again.materials, model.materials);
    let (a, b) = (model.split_at_seams(), again.split_at_seams());
    assert_eq!(a.mesh.triangles.len(), b.mesh.triangles.len());
    for (s, t) in a.mesh.triangles.iter().flatten().zip(b.mesh.triangles.iter().flatten()) {
        let (s, t) = (*s as usize, *t as usize);
        let (p, q) = (glam::DVec3::from(a.mesh.vertices[s]), glam::DVec3::from(b.mesh.vertices[t]));
        assert!(p.distance(q) < 1e-4, "{p} {q}");
        let normal = |m: &Model, v: usize| Vec3::from(m.normals.as_ref().unwrap()[v]);
        assert!(normal(&a, s).distance(normal(&b, t)) < 1e-4);
        assert_eq!(a.texture_coordinates.as_ref().unwrap()[s], b.texture_coordinates.as_ref().unwrap()[t]);
    }
}

fn compare_rig(skeleton: &Skeleton, influences: &Influences, model: &Model, again: &Model) {
    let rig = again.rig.as_ref().unwrap();
    assert_eq!(rig.skeleton.len(), skeleton.len());
    let worlds = (skeleton.rest_model_from_bone(), rig.skeleton.rest_model_from_bone());
    for (index, bone) in skeleton.bones().iter().enumerate() {
        let theirs = rig.skeleton.find(&bone.name).unwrap();
        assert!(worlds.0[index].abs_diff_eq(worlds.1[theirs], 1e-3), "{}", bone.name);
    }
    let (s, t) = (model.mesh.triangles[0][0] as usize, again.mesh.triangles[0][0] as usize);
    let row = |skeleton: &Skeleton, influences: &Influences, v: usize| -> Vec<(String, f32)> {
        influences.of_vertex(v).map(|(b, w)| (skeleton.bones()[usize::from(b)].name.clone(), w)).collect()
    };
    for ((a, w), (b, x)) in row(skeleton, influences, s).into_iter().zip(row(&rig.skeleton, &rig.influences, t)) {
        assert!(a == b && (w - x).abs() < 1e-6, "{a} {w} {b} {x}");
    }
}

fn compare_pose(ours: &Skeleton, theirs: &Skeleton, a: &Pose, b: &Pose) {
    for (index, bone) in ours.bones().iter().enumerate() {
        let other = theirs.find(&bone.name).unwrap();
        let (a, b) = (a.parent_from_bone[index], b.parent_from_bone[other]);
        assert!(a.translation.distance(b.translation) < 1e-4, "{}", bone.name);
        assert!(a.rotation.dot(b.rotation).abs() > 1.0 - 1e-5, "{}: {} {}", bone.name, a.rotation, b.rotation);
        assert!(a.scale.distance(b.scale) < 1e-4);
    }
}

#[test]
fn a_mesh_without_bones_and_bones_without_a_mesh() {
    let mut noise = Noise(3);
    let bones = skeleton(&mut noise, 4);
    let (model, _) = surface(&mut noise, &bones, 1);
    let empty = Skeleton::default();
    let scene = GlbScene { name: "still", skeleton: &empty, mesh: Some(GlbMesh::of_model(&model)), clips: Vec::new() };
    let bytes = write_glb(&scene).unwrap();
    keep("still.glb", &bytes);
    let again = read_model("still.glb", &bytes, &none).unwrap();
    compare_surface(&model, &again);
    assert!(again.rig.is_none());

    let poses = [bones.rest_pose(), bones.rest_pose()];
    let clips = vec![GlbClip { name: "rest", times: GlbTimes::EverySeconds(0.5), poses: &poses, weights: &[] }];
    let bytes = write_glb(&GlbScene { name: "bones", skeleton: &bones, mesh: None, clips }).unwrap();
    keep("bones.glb", &bytes);
    assert!(read_model("bones.glb", &bytes, &none).is_err());
    // A skin, though there is no mesh: programs make an armature of it.
    let length = u32::from_le_bytes(*bytes[12..].first_chunk().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    assert_eq!(json["skins"][0]["joints"].as_array().unwrap().len(), bones.len());
    let again = armature_formats::gltf::read_gltf_skeleton("bones.glb", &bytes, &none).unwrap();
    assert!(again.warnings.is_empty() && !again.has_mesh, "{again:?}");
    assert!((again.motions[0].1.duration_seconds() - 0.5).abs() < 1e-6);
    compare_pose(&bones, &again.skeleton, &bones.rest_pose(), &again.skeleton.rest_pose());
}

#[test]
fn nonsense_is_named() {
    let mut noise = Noise(5);
    let bones = skeleton(&mut noise, 4);
    let (model, influences) = surface(&mut noise, &bones, 1);
    let mesh = GlbMesh { influences: Some(&influences), ..GlbMesh::of_model(&model) };
    let write = |mesh, clips| write_glb(&GlbScene { name: "x", skeleton: &bones, mesh: Some(mesh), clips });
    assert!(write(mesh, Vec::new()).is_ok());
    assert!(write(GlbMesh { influences: None, ..mesh }, Vec::new()).is_err());
    assert!(write(GlbMesh { split: None, ..mesh }, Vec::new()).is_err());
    assert!(write(GlbMesh { normals: Some(&[[0.0; 3]]), ..mesh }, Vec::new()).is_err());
    let mut bad = model.mesh.clone();
    bad.vertices[0][0] = 1e300;
    assert!(write(GlbMesh { mesh: &bad, ..mesh }, Vec::new()).is_err());
    let short = [Pose::default()];
    assert!(
        write(mesh, vec![GlbClip { name: "c", times: GlbTimes::EverySeconds(0.1), poses: &short, weights: &[] }])
            .is_err()
    );
    assert!(
        write(mesh, vec![GlbClip { name: "c", times: GlbTimes::EverySeconds(0.1), poses: &[], weights: &[] }]).is_err()
    );
    let mut nan = [bones.rest_pose()];
    nan[0].parent_from_bone[0].translation.x = f32::NAN;
    assert!(
        write(mesh, vec![GlbClip { name: "c", times: GlbTimes::EverySeconds(0.1), poses: &nan, weights: &[] }])
            .is_err()
    );
    let scene = GlbScene { name: "x", skeleton: &Skeleton::default(), mesh: None, clips: Vec::new() };
    assert!(write_glb(&scene).is_err());
}

#[test]
fn parts_become_primitives_with_their_materials_and_share_images() {
    let mut noise = Noise(7);
    let (mut model, _) = surface(&mut noise, &skeleton(&mut Noise(1), 1), 1);
    let skeleton = Skeleton::default();
    model = model.split_at_seams();
    // Two parts of one triangle each.
    model.mesh.vertices.truncate(6);
    model.mesh.triangles = vec![[0, 1, 2], [3, 4, 5]];
    model.normals.as_mut().unwrap().truncate(6);
    model.texture_coordinates.as_mut().unwrap().truncate(6);
    let image = model.materials[0].base_color_map.clone();
    model.materials[0].emissive_map.clone_from(&image);
    model.materials.push(Material {
        name: "glass".into(),
        base_color: Some([1.0, 1.0, 1.0, 0.25]),
        normal_map: image,
        normal_scale: 0.5,
        metallic: 0.25,
        alpha: AlphaMode::Mask { cutoff: 0.75 },
        double_sided: true,
        ..Material::default()
    });
    let part = |vertices, triangles, material| MeshPart { vertices, triangles, material, ..MeshPart::default() };
    model.parts = vec![part(0..3, 0..1, Some(1)), part(3..6, 1..2, None)];
    let written = |model: &Model| {
        let mesh = Some(GlbMesh::of_model(model));
        write_glb(&GlbScene { name: "two", skeleton: &skeleton, mesh, clips: Vec::new() })
    };
    let bytes = written(&model).unwrap();
    let length = u32::from_le_bytes(*bytes[12..].first_chunk().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let primitives = json["meshes"][0]["primitives"].as_array().unwrap();
    assert_eq!(primitives.len(), 2);
    for primitive in primitives {
        let count = |accessor: &serde_json::Value| &json["accessors"][accessor.as_u64().unwrap() as usize]["count"];
        assert_eq!((count(&primitive["attributes"]["POSITION"]), count(&primitive["indices"])), (&3.into(), &3.into()));
    }
    assert_eq!((primitives[0]["material"].as_u64(), primitives[1].get("material")), (Some(1), None));
    let glass = &json["materials"][1];
    assert_eq!((glass["name"].as_str(), glass["alphaMode"].as_str()), (Some("glass"), Some("MASK")));
    assert_eq!((glass["alphaCutoff"].as_f64(), glass["doubleSided"].as_bool()), (Some(0.75), Some(true)));
    assert_eq!((&glass["normalTexture"]["index"], &glass["normalTexture"]["scale"]), (&0.into(), &0.5.into()));
    assert_eq!(json["images"].as_array().unwrap().len(), 1, "one image for three maps");

    model.parts[1].skin = Some(0);
    assert!(written(&model).is_err(), "a bind pose that does not exist");
    model.parts[1] = part(3..6, 0..2, None);
    assert!(written(&model).is_err(), "parts that do not fit the surface");
}

/// Two meshes with morph targets and colours, one of them bound in another pose.
fn rich(skeleton: &Skeleton) -> (Model, Influences) {
    let mut noise = Noise(11);
    let (model, _) = surface(&mut noise, skeleton, 1);
    let mut model = model.split_at_seams();
    model.mesh.vertices = (0..6).map(|_| noise.vector().as_dvec3().to_array()).collect();
    model.mesh.triangles = vec![[0, 1, 2], [3, 4, 5]];
    model.normals.as_mut().unwrap().truncate(6);
    model.texture_coordinates.as_mut().unwrap().truncate(6);
    model.vertex_colors = Some((0..6).map(|k| [0.125 * k as f32, 0.5, 1.0, 0.75]).collect());
    model.materials.push(Material {
        name: "lamp".into(),
        base_color: Some([1.0; 4]),
        emissive: [0.5, 4.0, 1.0],
        alpha: AlphaMode::Blend,
        ..Material::default()
    });
    model.materials[0].unlit = true;
    let part = |name: &str, vertices, triangles, material, skin| MeshPart {
        name: name.to_owned(),
        vertices,
        triangles,
        material: Some(material),
        skin,
    };
    model.parts = vec![part("body", 0..3, 0..1, 0, None), part("flag", 3..6, 1..2, 1, Some(0))];
    let target = |name: &str, part, default_weight, offsets: [f32; 3]| MorphTarget {
        name: name.to_owned(),
        part,
        default_weight,
        positions: offsets.iter().map(|&x| [x, 0.0, -x]).collect(),
        normals: Vec::new(),
    };
    model.morph_targets = vec![
        target("Smile", 0, 0.0, [0.25, 0.0, 0.0]),
        target("Frown", 0, 0.0, [0.0; 3]),
        target("Wave", 1, 0.5, [0.25, -0.5, 1.0]),
    ];
    let influences = Influences::new(2, vec![0, 1, 1, 2, 2, 0, 0, 1, 1, 2, 2, 0], vec![0.5; 12], skeleton.len());
    (model, influences.unwrap())
}

#[test]
fn meshes_with_morph_targets_colours_and_bind_poses_come_back() {
    let skeleton = skeleton(&mut Noise(5), 5);
    let (model, influences) = rich(&skeleton);
    // The flag was bound where everything was turned and moved.
    let turn = glam::Affine3A::from_rotation_translation(Quat::from_rotation_y(0.5), Vec3::new(1.0, 2.0, 3.0));
    let bound = skeleton.rest_model_from_bone().iter().map(|bone| turn * *bone).collect();
    let skins = [Skin { name: "flag".into(), bound_model_from_bone: bound }];
    let mesh = GlbMesh { influences: Some(&influences), skins: &skins, ..GlbMesh::of_model(&model) };
    let bytes =
        write_glb(&GlbScene { name: "rich", skeleton: &skeleton, mesh: Some(mesh), clips: Vec::new() }).unwrap();
    keep("rich.glb", &bytes);
    let again = read_model("rich.glb", &bytes, &none).unwrap();
    assert!(again.warnings.is_empty(), "{:?}", again.warnings);
    assert_eq!(again.materials, model.materials);
    let names = |model: &Model| model.parts.iter().map(|part| part.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&again), names(&model));
    assert_eq!(again.vertex_colors, model.vertex_colors);
    for (ours, theirs) in model.morph_targets.iter().zip(&again.morph_targets) {
        assert_eq!((&ours.name, ours.part), (&theirs.name, theirs.part));
        assert!((ours.default_weight - theirs.default_weight).abs() < 1e-6);
        // In the rest pose, to which the flag is brought.
        let frame = if ours.part == 1 { turn.inverse() } else { glam::Affine3A::IDENTITY };
        for (a, b) in ours.positions.iter().zip(&theirs.positions) {
            assert!(frame.transform_vector3(Vec3::from(*a)).distance(Vec3::from(*b)) < 1e-5, "{a:?} {b:?}");
        }
    }
    let drawn = again.mesh_vertex_of_drawn();
    for (k, &vertex) in drawn.iter().enumerate() {
        let [ours, theirs] = [model.mesh.vertices[k], again.mesh.vertices[vertex as usize]].map(glam::DVec3::from);
        let ours = ours.as_vec3();
        let expected = if k < 3 { ours } else { turn.inverse().transform_point3(ours) };
        assert!(expected.as_dvec3().distance(theirs) < 1e-5, "{k}: {expected} {theirs}");
    }
}

/// The numbers of a GLB's animation, by what it moves: `weights` or another path, and the node's name.
fn channels(bytes: &[u8]) -> Vec<(String, String, Vec<f32>)> {
    let glb = gltf::Gltf::from_slice(bytes).unwrap();
    let data = glb.blob.as_deref().unwrap();
    let channel = |channel: gltf::animation::Channel<'_>| {
        let reader = channel.reader(|_| Some(data));
        let values = match reader.read_outputs().unwrap() {
            gltf::animation::util::ReadOutputs::MorphTargetWeights(weights) => weights.into_f32().collect(),
            _ => Vec::new(),
        };
        let path = format!("{:?}", channel.target().property());
        (path, channel.target().node().name().unwrap().to_owned(), values)
    };
    glb.animations().next().map(|clip| clip.channels().map(channel).collect()).unwrap_or_default()
}

#[test]
fn weights_of_morph_targets_are_animated_where_they_change_and_beside_reduced_keys() {
    let skeleton = skeleton(&mut Noise(5), 5);
    let (model, influences) = rich(&skeleton);
    let mesh = || GlbMesh { influences: Some(&influences), ..GlbMesh::of_model(&model) };
    let mut flat = model.clone();
    flat.parts[1].skin = None;
    let mesh = || GlbMesh { parts: &flat.parts, ..mesh() };
    let poses = vec![skeleton.rest_pose(); 3];
    // Smile and frown of the body, wave of the flag, which stays at its own weight.
    let weights = vec![vec![0.0, 0.25, 0.5], vec![0.5, 0.25, 0.5], vec![1.0, 0.25, 0.5]];
    let clip = GlbClip { name: "take", times: GlbTimes::EverySeconds(0.5), poses: &poses, weights: &weights };
    let write =
        |clip| write_glb(&GlbScene { name: "rich", skeleton: &skeleton, mesh: Some(mesh()), clips: vec![clip] });
    let expected = ("MorphTargetWeights".to_owned(), "body".to_owned(), vec![0.0, 0.25, 0.5, 0.25, 1.0, 0.25]);
    let bytes = write(clip).unwrap();
    keep("weights.glb", &bytes);
    let all = channels(&bytes);
    let moved: Vec<_> = all.iter().filter(|(path, ..)| path == "MorphTargetWeights").collect();
    assert_eq!(moved, [&expected]);
    // Weights alone, and bones added to the same clip afterwards.
    let alone = write(GlbClip { poses: &[], ..clip }).unwrap();
    assert_eq!(channels(&alone), std::slice::from_ref(&expected));
    let track = armature_formats::motion::KeyTrack {
        bone: 1,
        part: armature_formats::motion::KeyedPart::Rotation,
        interpolation: armature_formats::motion::KeyInterpolation::Linear,
        times: vec![0.0, 1.0],
        values: vec![[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]],
    };
    let both = armature_formats::motion::add_clip(&alone, "take", &[track]).unwrap();
    keep("weights_and_keys.glb", &both);
    let paths: Vec<String> = channels(&both).into_iter().map(|(path, ..)| path).collect();
    assert_eq!(paths, ["MorphTargetWeights", "Rotation"]);
    // Rows that do not fit.
    let refused = |weights: &[Vec<f32>]| {
        let clips = vec![GlbClip { weights, ..clip }];
        let scene = GlbScene { name: "rich", skeleton: &skeleton, mesh: Some(mesh()), clips };
        write_glb(&scene).unwrap_err().to_string()
    };
    assert!(refused(&weights[..2]).contains("3 poses and weights for 2"));
    assert!(refused(&[vec![0.0; 2], vec![0.0; 2], vec![0.0; 2]]).contains("3 morph targets"));
    assert!(refused(&[vec![0.0; 3], vec![f32::NAN; 3], vec![0.0; 3]]).contains("not finite"));
}
