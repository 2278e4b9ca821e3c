//! A figure with awkward names, two materials, blend shapes and a shirt, and what its motion makes of it.

#![allow(dead_code, reason = "each file of tests uses its part")]

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use armature_formats::model::{AlphaMode, Material, MeshPart, Model, MorphTarget, Skin, Split, Texture};
use armature_geometry::{Influences, TriangleMesh};
use armature_rig::{Bone, Motion, Skeleton, Transform};
use glam::{Affine3A, EulerRot, Quat, Vec3};
use serde_json::{Value, json};

pub(crate) const NAMES: [&str; 8] =
    ["hips", "arm.L", "Bein: links", "größe ☃", "a \"quoted\" {name}", "hips::spine", "腕", "arm_L"];
pub(crate) const PIXEL: [u8; 67] = [
    0x89, 0x50, 0x4E, 0x47, 0x0D, 0x0A, 0x1A, 0x0A, 0, 0, 0, 0x0D, 0x49, 0x48, 0x44, 0x52, 0, 0, 0, 1, 0, 0, 0, 1, 8,
    0, 0, 0, 0, 0x3A, 0x7E, 0x9B, 0x55, 0, 0, 0, 0x0A, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9C, 0x63, 0xF8, 0x0F, 0, 1, 1,
    1, 0, 0xB1, 0x38, 0xF6, 0x14, 0, 0, 0, 0, 0x49, 0x45, 0x4E, 0x44, 0xAE, 0x42, 0x60, 0x82,
];
/// The rates of film and video: seconds of a frame.
pub(crate) const FRAME_SECONDS: [f64; 4] = [1.0 / 24.0, 1001.0 / 30_000.0, 1.0 / 60.0, 1.0 / 37.5];

/// A small deterministic stream of numbers in -1..1.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    pub(crate) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 8_388_608.0 - 1.0
    }

    pub(crate) fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }

    pub(crate) fn rotation(&mut self) -> Quat {
        Quat::from_euler(EulerRot::XYZ, 3.0 * self.next(), 1.5 * self.next(), 3.0 * self.next())
    }
}

/// Two chains below one root, with rests that are turned; `scaled`: and scaled, with a second root.
pub(crate) fn skeleton(noise: &mut Noise, scaled: bool) -> Skeleton {
    let bone = |(index, name): (usize, &&str)| Bone {
        name: (*name).to_owned(),
        parent: match index {
            0 => None,
            7 if scaled => None,
            _ => Some((index - 1) / 2),
        },
        rest: Transform {
            translation: 0.5 * noise.vector(),
            rotation: noise.rotation(),
            scale: if scaled { Vec3::splat(1.0 + 0.2 * noise.next()) } else { Vec3::ONE },
        },
        tail: Vec3::new(0.0, 0.3, 0.0),
    };
    Skeleton::new(NAMES.iter().enumerate().map(bone).collect()).unwrap()
}

/// Frames that turn on and on, through poles, and move and (if `scaled`) scale.
pub(crate) fn motion(noise: &mut Noise, skeleton: &Skeleton, frame_seconds: f64, scaled: bool) -> Motion {
    let axes: Vec<Vec3> = (0..skeleton.len()).map(|_| noise.vector().normalize()).collect();
    let frames = (0..40).map(|frame| {
        let mut pose = skeleton.rest_pose();
        for (bone, local) in pose.parent_from_bone.iter_mut().enumerate().filter(|(bone, _)| bone % 4 != 3) {
            let angle = 0.25 * frame as f32 * (1.0 + bone as f32 / 3.0);
            local.rotation = (local.rotation * Quat::from_axis_angle(axes[bone], angle)).normalize();
            if bone == 0 {
                local.translation += 0.02 * frame as f32 * axes[bone];
            }
            if scaled && bone == 2 {
                local.scale *= 1.0 + 0.01 * frame as f32;
            }
        }
        pose
    });
    Motion::new(skeleton.clone(), frame_seconds, frames.collect()).unwrap()
}

/// A body of two materials that share a seam, with a blend shape, and a shirt bound in another pose.
pub(crate) fn character(noise: &mut Noise, skeleton: &Skeleton) -> (Model, Influences, Vec<Skin>) {
    let vertices: Vec<[f64; 3]> = (0..30).map(|_| noise.vector().as_dvec3().to_array()).collect();
    let strip = |from: u32, to: u32| (from..to - 2).map(|i| [i, i + 1, i + 2]);
    // Vertices 8 and 9 are in both parts of the body.
    let mesh_vertex: Vec<u32> = (0..10).chain(8..20).chain(20..30).collect();
    let drawn: Vec<[u32; 3]> = strip(0, 10).chain(strip(10, 22)).chain(strip(22, 32)).collect();
    let triangles = drawn.iter().map(|t| t.map(|corner| mesh_vertex[corner as usize])).collect();
    let part = |name: &str, vertices: std::ops::Range<u32>, triangles: std::ops::Range<u32>, material, skin| MeshPart {
        name: name.to_owned(),
        vertices,
        triangles,
        material: Some(material),
        skin,
    };
    let offsets: Vec<[f32; 3]> = (0..30).map(|_| noise.vector().to_array()).collect();
    let target = |part: u32, own: std::ops::Range<usize>, default_weight| MorphTarget {
        name: "lächeln".into(),
        part,
        default_weight,
        positions: mesh_vertex[own.clone()].iter().map(|&v| offsets[v as usize]).collect(),
        normals: own.map(|_| [0.0, 0.1, 0.0]).collect(),
    };
    let pixel = Arc::new(Texture { mime: "image/png".to_owned(), bytes: PIXEL.to_vec(), ..Texture::default() });
    let material = |name: &str, blue: f32| Material {
        name: name.to_owned(),
        base_color: Some([0.25, 0.5, blue, 1.0]),
        ..Material::default()
    };
    let cloth = Material {
        base_color: Some([1.0, 1.0, 1.0, 1.0]),
        base_color_map: Some(Arc::clone(&pixel)),
        normal_map: Some(pixel),
        alpha: AlphaMode::Mask { cutoff: 0.5 },
        ..material("cloth", 1.0)
    };
    let model = Model {
        name: "figure".to_owned(),
        mesh: TriangleMesh { vertices, triangles },
        split: Some(Split { mesh_vertex: mesh_vertex.clone(), triangles: drawn }),
        normals: Some((0..32).map(|_| noise.vector().normalize().to_array()).collect()),
        texture_coordinates: Some((0..32).map(|_| [noise.next(), noise.next()]).collect()),
        vertex_colors: Some((0..32).map(|_| [noise.next().abs(), 0.5, 0.25, 1.0]).collect()),
        parts: vec![
            part("body", 0..10, 0..8, 0, None),
            part("body", 10..22, 8..18, 1, None),
            part("shirt", 22..32, 18..26, 2, Some(0)),
        ],
        morph_targets: vec![target(0, 0..10, 0.25), target(1, 10..22, 0.25)],
        materials: vec![material("skin", 0.75), material("nails", 0.1), cloth],
        ..Model::default()
    };
    let bones: Vec<u16> = (0..30 * 5).map(|k| (k % 7) as u16).collect();
    let weights: Vec<f32> = (0..30 * 5).map(|_| noise.next().abs() + 0.01).collect();
    let influences = Influences::new(5, bones, weights, skeleton.len()).unwrap();
    let elsewhere = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.5), Vec3::new(0.0, 0.1, 0.0));
    let bound_model_from_bone = skeleton.rest_model_from_bone().iter().map(|frame| elsewhere * *frame).collect();
    (model, influences, vec![Skin { name: "shirt".into(), bound_model_from_bone }])
}

pub(crate) fn bpy() -> Option<PathBuf> {
    let python = std::env::var_os("ARMATURE_BPY_PYTHON").filter(|value| !value.is_empty()).map(PathBuf::from);
    if python.is_none() {
        let in_ci = ["CI", "ARMATURE_REQUIRE_SHARED_DATA"].iter().all(|name| std::env::var_os(name).is_some());
        assert!(!in_ci, "ARMATURE_BPY_PYTHON must be set in CI: Blender was not run");
        println!("SKIPPED: ARMATURE_BPY_PYTHON is not set, so Blender was not run");
    }
    python
}

/// What `tests/blender_check.py` and `tests/usd_check.py` expect. `skins`: those of the shirt, if it has any.
pub(crate) fn expectation(motion: &Motion, model: &Model, influences: &Influences, skins: &[Skin]) -> Value {
    let bones = motion.skeleton.bones();
    let rest = motion.skeleton.rest_model_from_bone();
    let bound = skins.first().map_or(&rest, |skin| &skin.bound_model_from_bone);
    let mut frames = rest.clone();
    let skinned = |vertex: usize, bound: &[Affine3A], frames: &[Affine3A]| {
        let shown = Vec3::from(model.mesh.vertices[vertex].map(|c| c as f32));
        let moved = |(bone, weight): (u16, f32)| {
            let bone = usize::from(bone);
            weight * (frames[bone] * bound[bone].inverse()).transform_point3(shown)
        };
        influences.of_vertex(vertex).map(moved).sum::<Vec3>().to_array()
    };
    let sample = |frame: usize| {
        motion.frames[frame].forward_kinematics(&motion.skeleton, &mut frames);
        let of = |value: &dyn Fn(&Affine3A) -> Value| -> serde_json::Map<String, Value> {
            bones.iter().zip(&frames).map(|(bone, frame)| (bone.name.clone(), value(frame))).collect()
        };
        let heads = of(&|frame| json!(frame.translation.to_array()));
        let turns = of(&|frame| json!(frame.to_scale_rotation_translation().1.to_array()));
        let body: Vec<[f32; 3]> = (0..20).map(|vertex| skinned(vertex, &rest, &frames)).collect();
        let shirt: Vec<[f32; 3]> = (20..30).map(|vertex| skinned(vertex, bound, &frames)).collect();
        json!({"frame": frame, "heads": heads, "turns": turns, "skinned": {"body": body, "shirt": shirt}})
    };
    let samples: Vec<Value> = (0..motion.frames.len()).step_by(3).map(sample).collect();
    let weights = |vertex: usize| {
        let mut row: BTreeMap<&str, f64> = BTreeMap::new();
        for (bone, weight) in influences.of_vertex(vertex) {
            *row.entry(&bones[usize::from(bone)].name).or_default() += f64::from(weight);
        }
        row
    };
    let offset = |vertex: usize| {
        let [first, second] = [&model.morph_targets[0], &model.morph_targets[1]];
        if vertex < 10 { first.positions[vertex] } else { second.positions[vertex - 8] }
    };
    let base = |vertex: usize| {
        let (shown, offset) = (model.mesh.vertices[vertex], offset(vertex));
        std::array::from_fn::<f64, 3, _>(|k| shown[k] - 0.25 * f64::from(offset[k]))
    };
    let body = json!({
        "name": "body",
        "vertices": (0..20).map(base).collect::<Vec<_>>(),
        "weights": (0..20).map(weights).collect::<Vec<_>>(),
        "shapes": {"lächeln": (0..20).map(offset).collect::<Vec<_>>()},
    });
    let shirt = json!({
        "name": "shirt",
        "vertices": &model.mesh.vertices[20..],
        "weights": (20..30).map(weights).collect::<Vec<_>>(),
    });
    let names: Vec<&str> = bones.iter().map(|bone| bone.name.as_str()).collect();
    json!({"bones": names, "meshes": [body, shirt], "clips": [
        {"name": "take", "frames": motion.frames.len(), "frame_seconds": motion.frame_seconds, "samples": samples}
    ]})
}
