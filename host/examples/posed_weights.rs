//! Draws characters in poses that are hard on weights, with bounded biharmonic weights beside bone heat:
//! `cargo run --release --example posed_weights -- [FOLDER] [elephant.obj elephant.tgf]`.
//! The pictures in `host/assets` were made by it.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use armature::failure::Failure;
use armature::pictures::draw_scene;
use armature::slice::text::{Hold, draw_text};
use armature::{files, inputs};
use armature_character::{BiharmonicTier, BindMethod, BindSettings, Character, bind, human};
use armature_formats::Model;
use armature_render::{Bounds, Camera, Ground, MeshView, Picture, Scene};
use armature_rig::Skeleton;
use glam::{Affine3A, Quat, Vec3};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use tiny_skia::{Paint, Pixmap, PremultipliedColorU8};

const SIDE: u32 = 360;

/// A pose, and where to look.
struct Shot {
    file: &'static str,
    /// Bones with what they turn by: an axis of the model and degrees.
    turns: &'static [(&'static str, Vec3, f32)],
    /// Bones around which the picture is framed, and how much wider than them it is.
    around: &'static [&'static str],
    wider: f32,
    yaw: f32,
    pitch: f32,
}

const HUMAN: [Shot; 3] = [
    Shot {
        file: "posed-elbow.png",
        turns: &[("LeftLowerArm", Vec3::Y, -115.0)],
        around: &["LeftUpperArm", "LeftLowerArm"],
        wider: 0.45,
        yaw: 0.35,
        pitch: 0.75,
    },
    Shot {
        file: "posed-arm.png",
        turns: &[("LeftShoulder", Vec3::Z, 20.0), ("LeftUpperArm", Vec3::Z, 55.0)],
        around: &["Chest", "Neck", "LeftUpperArm"],
        wider: 0.75,
        yaw: 0.25,
        pitch: 0.05,
    },
    Shot {
        file: "posed-head.png",
        turns: &[("Neck", Vec3::Y, 25.0), ("Head", Vec3::Y, 50.0)],
        around: &["Neck", "Head"],
        wider: 0.6,
        yaw: 0.15,
        pitch: 0.1,
    },
];

const ELEPHANT: [Shot; 2] = [
    Shot {
        file: "posed-elephant-leg.png",
        turns: &[("bone_16", Vec3::X, -75.0), ("bone_17", Vec3::X, 45.0)],
        around: &["bone_1", "bone_15", "bone_16", "bone_17"],
        wider: 1.2,
        yaw: 0.75,
        pitch: 0.1,
    },
    Shot {
        file: "posed-elephant-arm.png",
        turns: &[("bone_7", Vec3::Z, 15.0), ("bone_8", Vec3::Z, 60.0)],
        around: &["bone_3", "bone_7", "bone_8", "bone_10"],
        wider: 0.9,
        yaw: 0.3,
        pitch: 0.1,
    },
];

fn main() -> Result<(), Failure> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let folder = arguments.first().cloned().unwrap_or_else(|| "host/assets".into());
    let own = human().map_err(|e| Failure::not_converged(e.to_string(), ""))?;
    let model = Model {
        name: own.name.clone(),
        mesh: own.mesh.clone(),
        normals: Some(own.normals.clone()),
        base_color: Some(own.base_color),
        ..Model::default()
    };
    draw_all(&folder, &model, &own.skeleton, &HUMAN)?;
    if let [_, mesh, bones] = arguments.as_slice() {
        draw_all(&folder, &inputs::model(mesh)?, &inputs::skeleton(bones)?, &ELEPHANT)?;
    }
    Ok(())
}

fn draw_all(folder: &Path, model: &Model, skeleton: &Skeleton, shots: &[Shot]) -> Result<(), Failure> {
    let bound = |method| {
        let settings = BindSettings { method, ..BindSettings::default() };
        let go_on = &mut |_| ControlFlow::Continue(());
        bind(model.clone(), Some(skeleton.clone()), &settings, go_on)
            .map_err(|e| Failure::not_converged(format!("{}: {e}", model.name), ""))
    };
    let biharmonic = bound(BindMethod::Biharmonic(BiharmonicTier::Interactive))?;
    let heat = bound(BindMethod::BoneHeat)?;
    for shot in shots {
        let left = draw(&biharmonic, shot, "bounded biharmonic weights")?;
        let right = draw(&heat, shot, "bone heat")?;
        let path = folder.join(shot.file);
        files::write(&path, &small_png(&beside(&left, &right))?)?;
        println!("{}", path.display());
    }
    Ok(())
}

fn drawing_failed(error: &dyn std::fmt::Display) -> Failure {
    Failure::not_converged(format!("a picture failed: {error}"), "")
}

fn draw(character: &Character, shot: &Shot, words: &str) -> Result<Picture, Failure> {
    let skeleton = &character.skeleton;
    let bone = |name: &str| {
        skeleton.find(name).ok_or_else(|| Failure::input(format!("there is no bone {name}"), "give the elephant"))
    };
    let mut pose = skeleton.rest_pose();
    for &(name, axis, degrees) in shot.turns {
        // Bones of these skeletons rest without a rotation, so the model's axes are theirs.
        pose.parent_from_bone[bone(name)?].rotation = Quat::from_axis_angle(axis, degrees.to_radians());
    }
    let mut model_from_bone = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut model_from_bone);
    let mut skin = character.skin().map_err(|e| drawing_failed(&e))?;
    let (mut positions, mut normals) = (character.rest_positions(), character.normals.clone());
    let whole = Bounds::of(&positions).ok_or_else(|| drawing_failed(&"there are no vertices"))?;
    skin.solve(&model_from_bone, &mut positions, &mut normals).map_err(|e| drawing_failed(&e))?;
    let mut ends = Vec::new();
    for name in shot.around {
        let index = bone(name)?;
        let posed = model_from_bone[index];
        ends.push(posed.translation.into());
        ends.push(posed.transform_point3(skeleton.bones()[index].tail).to_array());
    }
    let tight = Bounds::of(&ends).ok_or_else(|| drawing_failed(&"there are no bones"))?;
    let margin = Vec3::splat(shot.wider * tight.radius());
    let bounds = Bounds { min: tight.min - margin, max: tight.max + margin };
    let mut camera = Camera { yaw: shot.yaw, pitch: shot.pitch, ..Camera::default() };
    camera.frame(&bounds, 1.0);
    let [red, green, blue, _] = character.base_color;
    let mesh = MeshView {
        positions: &positions,
        normals: &normals,
        triangles: &character.mesh.triangles,
        base_color: Some([red, green, blue].map(|c| c.powf(1.0 / 2.2))),
        ..MeshView::default()
    };
    let scene = Scene { mesh, ground: Ground::under(&whole), ..Scene::default() };
    let (mut picture, _) = draw_scene(&scene, &camera, [SIDE; 2]).map_err(|e| drawing_failed(&e))?;
    label(&mut picture, words);
    Ok(picture)
}

fn label(picture: &mut Picture, words: &str) {
    let Some(mut pixmap) = Pixmap::new(picture.width, picture.height) else { return };
    for (pixel, rgba) in pixmap.pixels_mut().iter_mut().zip(picture.rgba.chunks_exact(4)) {
        *pixel = PremultipliedColorU8::from_rgba(rgba[0], rgba[1], rgba[2], 255).unwrap_or(*pixel);
    }
    let mut ink = Paint::default();
    ink.set_color_rgba8(0xe9, 0xec, 0xf0, 255);
    draw_text(&mut pixmap.as_mut(), words, [12.0, 24.0], 15.0, Hold::Left, &ink);
    picture.rgba = pixmap.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue(), 255]).collect();
}

/// A PNG as small as can be, without the opacity.
fn small_png(picture: &Picture) -> Result<Vec<u8>, Failure> {
    let rgb: Vec<u8> = picture.rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::Adaptive)
        .write_image(&rgb, picture.width, picture.height, ExtendedColorType::Rgb8)
        .map_err(|e| drawing_failed(&e))?;
    Ok(png)
}

fn beside(left: &Picture, right: &Picture) -> Picture {
    let row = |picture: &Picture, y: usize| {
        let length = 4 * picture.width as usize;
        picture.rgba[y * length..(y + 1) * length].to_vec()
    };
    let rgba = (0..left.height as usize).flat_map(|y| [row(left, y), row(right, y)].concat()).collect();
    Picture { width: left.width + right.width, height: left.height, rgba }
}
