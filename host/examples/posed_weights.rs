//! Draws characters in poses that are hard on weights, comparing bounded biharmonic weights with bone heat:
//! `cargo run --release --example posed_weights -- [FOLDER] [elephant.obj elephant.tgf]`.
//! The pictures in `host/assets` were made by it.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use armature::failure::Failure;
use armature::files::{self, inputs};
use armature::pictures::draw_scene;
use armature::pictures::text::{Hold, draw_text};
use armature_character::Character;
use armature_character::bind::{BindError, BindMethod, BindSettings, bind};
use armature_character::handle_weights::BiharmonicTier;
use armature_character::own::{hand, human, spider};
use armature_formats::model::Model;
use armature_render::{Bounds, Camera, Ground, Material, MeshView, Picture, Scene};
use armature_rig::Skeleton;
use glam::{Affine3A, Quat, Vec3};
use tiny_skia::{Color, Paint, Pixmap};

const SIDE: u32 = 360;
/// Height of the caption.
const STRIP: u32 = 32;

/// A pose, and where to look.
struct Shot {
    file: &'static str,
    /// Bones and their rotations: an axis of the model, and degrees.
    turns: &'static [(&'static str, Vec3, f32)],
    /// Bones that the picture is framed around, and how much wider than them it is.
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
        wider: 0.95,
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

const SPIDER: [Shot; 1] = [Shot {
    file: "posed-spider.png",
    turns: &[
        ("LeftLeg1Femur", Vec3::Z, 50.0),
        ("LeftLeg1Tibia", Vec3::Z, -75.0),
        ("LeftLeg2Femur", Vec3::Z, -35.0),
        ("Abdomen", Vec3::X, 35.0),
    ],
    around: &["Body", "Abdomen", "LeftLeg1Tibia", "LeftLeg2Tibia"],
    wider: 0.1,
    yaw: 0.5,
    pitch: 0.45,
}];

const HAND: [Shot; 1] = [Shot {
    file: "posed-hand.png",
    turns: &[
        ("LeftIndexProximal", Vec3::X, 80.0),
        ("LeftIndexIntermediate", Vec3::X, 80.0),
        ("LeftMiddleProximal", Vec3::X, 60.0),
        ("LeftMiddleIntermediate", Vec3::X, 40.0),
        ("LeftLittleProximal", Vec3::X, -20.0),
        ("LeftHand", Vec3::X, 35.0),
    ],
    around: &["LeftLowerArm", "LeftHand", "LeftIndexProximal", "LeftLittleProximal"],
    wider: 0.2,
    yaw: -0.9,
    pitch: 0.15,
}];

const ELEPHANT: [Shot; 2] = [
    Shot {
        file: "posed-elephant-leg.png",
        turns: &[("bone_16", Vec3::X, -75.0), ("bone_17", Vec3::X, 45.0)],
        around: &["bone_1", "bone_15", "bone_16", "bone_17"],
        wider: 1.3,
        yaw: 0.75,
        pitch: 0.1,
    },
    Shot {
        file: "posed-elephant-arm.png",
        turns: &[("bone_7", Vec3::Z, 15.0), ("bone_8", Vec3::Z, 60.0)],
        around: &["bone_3", "bone_7", "bone_8", "bone_10"],
        wider: 1.3,
        yaw: 0.3,
        pitch: 0.1,
    },
];

type MakesCharacter = fn() -> Result<Character, BindError>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let folder = arguments.first().cloned().unwrap_or_else(|| "host/assets".into());
    let made: [(MakesCharacter, &[Shot]); 3] = [(human, &HUMAN), (spider, &SPIDER), (hand, &HAND)];
    for (make, shots) in made {
        let start = std::time::Instant::now();
        let own = make().map_err(|e| Failure::not_converged(e.to_string(), ""))?;
        let seconds = start.elapsed().as_secs_f64();
        println!("{}: shaped, and bound by bone heat, in {seconds:.2} s", own.name);
        let model = Model {
            name: own.name.clone(),
            mesh: own.surface.mesh.clone(),
            normals: Some(own.surface.normals.clone()),
            materials: own.materials.clone(),
            ..Model::default()
        };
        let start = std::time::Instant::now();
        let biharmonic = bound(&model, &own.skeleton, BindMethod::Biharmonic(BiharmonicTier::Interactive))?;
        println!("{}: bounded biharmonic weights in {:.2} s", own.name, start.elapsed().as_secs_f64());
        draw_all(&folder, &biharmonic, &own, shots)?;
    }
    if let [_, mesh, bones] = arguments.as_slice() {
        let (model, skeleton) = (inputs::model(mesh)?, inputs::skeleton(bones)?);
        let biharmonic = bound(&model, &skeleton, BindMethod::Biharmonic(BiharmonicTier::Interactive))?;
        let heat = bound(&model, &skeleton, BindMethod::BoneHeat)?;
        draw_all(&folder, &biharmonic, &heat, &ELEPHANT)?;
    }
    Ok(())
}

fn bound(model: &Model, skeleton: &Skeleton, method: BindMethod) -> Result<Character, Failure> {
    let settings = BindSettings { method, ..BindSettings::default() };
    bind(model.clone(), Some(skeleton.clone()), &settings, &mut |_, _| ControlFlow::Continue(()))
        .map_err(|e| Failure::not_converged(format!("{}: {e}", model.name), ""))
}

fn draw_all(folder: &Path, biharmonic: &Character, heat: &Character, shots: &[Shot]) -> Result<(), Failure> {
    for shot in shots {
        let left = draw(biharmonic, shot, "bounded biharmonic weights")?;
        let right = draw(heat, shot, "bone heat")?;
        let path = folder.join(shot.file);
        files::replace(&path, &small_png(&beside(&left, &right))?)?;
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
        // Bones of these skeletons have no rest rotation, so the model's axes are theirs.
        pose.parent_from_bone[bone(name)?].rotation = Quat::from_axis_angle(axis, degrees.to_radians());
    }
    let mut model_from_bone = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut model_from_bone);
    let mut skin = character.linear_skin().map_err(|e| drawing_failed(&e))?;
    let (mut positions, mut normals) = (character.rest_positions(), character.surface.normals.clone());
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
    let [red, green, blue, _] = character.materials[0].base_color.unwrap_or([1.0; 4]);
    let mesh = MeshView {
        positions: &positions,
        normals: &normals,
        triangles: &character.surface.mesh.triangles,
        materials: &[Material::of_color([red, green, blue].map(|c| c.powf(1.0 / 2.2)))],
        ..MeshView::default()
    };
    let scene = Scene { mesh, ground: Ground::under(&whole), ..Scene::default() };
    let (mut picture, _) = draw_scene(&scene, &camera, [SIDE; 2]).map_err(|e| drawing_failed(&e))?;
    label(&mut picture, words);
    Ok(picture)
}

/// Puts a strip with a caption above a picture.
fn label(picture: &mut Picture, words: &str) {
    let Some(mut strip) = Pixmap::new(picture.width, STRIP) else { return };
    strip.fill(Color::from_rgba8(0x16, 0x19, 0x1f, 255));
    let mut ink = Paint::default();
    ink.set_color_rgba8(0xe9, 0xec, 0xf0, 255);
    draw_text(&mut strip.as_mut(), words, [12.0, 22.0], 15.0, Hold::Left, &ink);
    let above = strip.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue(), 255]);
    picture.rgba = above.chain(picture.rgba.iter().copied()).collect();
    picture.height += STRIP;
}

/// A PNG as small as possible, without opacity.
fn small_png(picture: &Picture) -> Result<Vec<u8>, Failure> {
    let rgb: Vec<u8> = picture.rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.width, picture.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::Adaptive);
    let mut writer = encoder.write_header().map_err(|e| drawing_failed(&e))?;
    writer.write_image_data(&rgb).map_err(|e| drawing_failed(&e))?;
    writer.finish().map_err(|e| drawing_failed(&e))?;
    Ok(bytes)
}

fn beside(left: &Picture, right: &Picture) -> Picture {
    let row = |picture: &Picture, y: usize| {
        let length = 4 * picture.width as usize;
        picture.rgba[y * length..(y + 1) * length].to_vec()
    };
    let rgba = (0..left.height as usize).flat_map(|y| [row(left, y), row(right, y)].concat()).collect();
    Picture { width: left.width + right.width, height: left.height, rgba }
}
