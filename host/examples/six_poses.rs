//! A puppet with eight joints poses a human of over fifty bones: six pictures on one sheet.
//!
//! `cargo run --release --example six_poses [-- SHEET.png]` performs each pose on a simulated puppet, all the way
//! through (wire, session, mapping proposed by shape, inverse kinematics, skinning), and draws the result.

use std::error::Error;
use std::f64::consts::FRAC_PI_2;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

use armature::characters::inverse_kinematics::{IkArgs, IkMode};
use armature::characters::{self, LoadedCharacter};
use armature::engine::command::RunPlan;
use armature::engine::drive::drive_run;
use armature::engine::machine::{Engine, EngineSettings};
use armature::engine::puppeteer::ZeroPolicy;
use armature::engine::sources::VirtualSource;
use armature::pictures::{View, draw};
use armature_render::{Picture, encode_png};
use armature_sim::rotation::{IDENTITY, about, product};
use armature_sim::{Body, JointTrack, Motion, Puppet, PuppetSettings, Rotation, TrackEnd};

const SAMPLES_PER_SECOND: f64 = 200.0;
/// The puppet is held at rest, moved into the pose, and held there.
const REST_SECONDS: f64 = 0.1;
const MOVE_SECONDS: f64 = 0.8;
const HOLD_SECONDS: f64 = 0.6;
const TILE: [u32; 2] = [300, 360];

/// A pose of the puppet: a few of its joints turned, each in its own frame.
struct PuppetPose {
    name: &'static str,
    pins: &'static [&'static str],
    turns: Vec<(&'static str, Rotation)>,
    yaw: f32,
    floor: Option<f32>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let sheet = std::env::args().nth(1).map_or_else(|| PathBuf::from("host/assets/six-poses.png"), PathBuf::from);
    let found = characters::find("human", &mut |_, _| ControlFlow::Continue(())).map_err(|f| f.what)?;
    let human = Arc::new(found.character);
    let mut tiles = Vec::new();
    for pose in poses() {
        let tile = picture(&human, &pose)?;
        tiles.push(tile);
    }
    if let Some(folder) = sheet.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::write(&sheet, encode_png(&on_one_sheet(&tiles, 3))?)?;
    println!("{}", sheet.display());
    Ok(())
}

fn picture(human: &Arc<LoadedCharacter>, pose: &PuppetPose) -> Result<Picture, Box<dyn Error>> {
    let ik = IkArgs { ik: IkMode::On, pin: pose.pins.iter().map(ToString::to_string).collect(), ..IkArgs::default() };
    let mut engine = Engine::new(EngineSettings {
        samples_per_second: SAMPLES_PER_SECOND,
        zero_policy: ZeroPolicy::AtStart,
        ik,
        ..EngineSettings::default()
    });
    let puppet = Puppet::new(settings(pose)?).map_err(|e| e.to_string())?;
    let mut source = VirtualSource::of(puppet, SAMPLES_PER_SECOND);
    let plan = RunPlan { seconds: Some(REST_SECONDS + MOVE_SECONDS + HOLD_SECONDS), ..RunPlan::default() };
    let summary = drive_run(&mut engine, &mut source, human.clone(), "sim:human8", plan, None, &mut |_| ());
    println!("{:<8} {}", pose.name, summary.map_err(|f| f.what)?.roles.unwrap_or_default());
    let shape = human.shape.as_ref().ok_or("the human has a mesh")?;
    let (positions, normals) = engine.puppeteer().ok_or("the human was loaded")?.skinned();
    let view = View { size: TILE, yaw: pose.yaw, pitch: 0.1, closer: 0.92, floor: pose.floor };
    Ok(draw(shape, positions, normals, &view)?.0)
}

fn settings(pose: &PuppetPose) -> Result<PuppetSettings, Box<dyn Error>> {
    let body = Body::preset("human8", 1).map_err(|e| e.to_string())?;
    let mut parts = Vec::new();
    for (label, _) in &pose.turns {
        parts.push(body.find(label).ok_or_else(|| format!("the puppet has no {label}"))?);
    }
    let rest = pose.turns.iter().map(|_| IDENTITY);
    let rotations = rest.chain(pose.turns.iter().map(|(_, turn)| *turn)).collect();
    let track = JointTrack { frame_seconds: MOVE_SECONDS, parts, rotations, end: TrackEnd::Hold };
    let rest_micros = (REST_SECONDS * 1e6) as u64;
    Ok(PuppetSettings { motion: Motion::Track(track), rest_micros, ..PuppetSettings::new(body) })
}

/// The joints' frames: a limb bends about x (a leg or arm forwards by negative angles), twists about y, and moves
/// sideways about z (a left arm down by positive angles, a right one by negative ones). See `armature_sim`'s procedural
/// motions.
fn poses() -> Vec<PuppetPose> {
    let bend = |angle| about(0, angle);
    let arm = |side: f64, forward: f64, down: f64| product(about(1, -side * forward), about(2, side * down));
    let leg = |side: f64, forward: f64, out: f64| product(about(0, -forward), about(2, -side * out));
    let (left, right) = (1.0, -1.0);
    vec![
        PuppetPose {
            name: "at ease",
            pins: &[],
            turns: vec![
                ("left_shoulder", arm(left, 0.1, 1.28)),
                ("right_shoulder", arm(right, 0.1, 1.28)),
                ("left_elbow", bend(-0.3)),
                ("right_elbow", bend(-0.3)),
                ("head", product(about(1, 0.45), about(0, 0.1))),
                ("spine", about(1, 0.12)),
            ],
            yaw: 0.5,
            floor: Some(0.0),
        },
        PuppetPose {
            name: "wave",
            pins: &[],
            turns: vec![
                ("right_shoulder", product(about(2, 0.45), about(1, FRAC_PI_2))),
                ("right_elbow", bend(-1.3)),
                ("left_shoulder", arm(left, 0.1, 1.25)),
                ("left_elbow", bend(-0.5)),
                ("head", product(about(1, -0.4), about(2, 0.12))),
                ("spine", about(2, 0.12)),
            ],
            yaw: 0.2,
            floor: Some(0.0),
        },
        PuppetPose {
            name: "stride",
            pins: &[],
            turns: vec![
                ("left_hip", leg(left, 0.45, 0.0)),
                ("right_hip", leg(right, -0.4, 0.0)),
                ("left_shoulder", arm(left, -0.5, 1.3)),
                ("right_shoulder", arm(right, 0.6, 1.3)),
                ("left_elbow", bend(-0.35)),
                ("right_elbow", bend(-0.6)),
                ("spine", product(about(1, 0.25), about(0, -0.12))),
                ("head", about(1, -0.2)),
            ],
            yaw: 1.1,
            floor: None,
        },
        PuppetPose {
            name: "bow",
            pins: &[],
            turns: vec![
                ("spine", bend(-1.0)),
                ("head", bend(-0.35)),
                ("left_shoulder", arm(left, 0.9, 1.3)),
                ("right_shoulder", arm(right, 0.9, 1.3)),
                ("left_elbow", bend(-0.3)),
                ("right_elbow", bend(-0.3)),
            ],
            yaw: 1.0,
            floor: Some(0.0),
        },
        PuppetPose {
            name: "squat",
            pins: &["LeftFoot", "RightFoot", "Hips:upright"],
            turns: vec![
                ("left_hip", leg(left, 0.85, 0.2)),
                ("right_hip", leg(right, 0.85, 0.2)),
                ("spine", bend(-0.4)),
                ("head", bend(0.3)),
                ("left_shoulder", product(about(0, -1.35), about(2, 0.1))),
                ("right_shoulder", product(about(0, -1.35), about(2, -0.1))),
            ],
            yaw: 0.9,
            floor: Some(0.0),
        },
        PuppetPose {
            name: "hang",
            pins: &["LeftHand:turning"],
            turns: vec![
                ("left_shoulder", about(2, -1.25)),
                ("left_elbow", bend(-0.15)),
                ("right_shoulder", arm(right, 0.2, 1.2)),
                ("right_elbow", bend(-0.4)),
                ("left_hip", leg(left, 0.5, 0.1)),
                ("right_hip", leg(right, 0.15, 0.15)),
                ("head", product(about(1, 0.3), about(0, 0.3))),
                ("spine", about(2, -0.15)),
            ],
            yaw: 0.4,
            floor: Some(-0.75),
        },
    ]
}

/// Pictures of one size side by side, in rows.
fn on_one_sheet(tiles: &[Picture], columns: usize) -> Picture {
    let Some(first) = tiles.first() else { return Picture { width: 0, height: 0, rgba: Vec::new() } };
    let (width, height) = (first.width as usize, first.height as usize);
    let rows = tiles.len().div_ceil(columns);
    let mut rgba = vec![255; 4 * width * columns * height * rows];
    for (index, tile) in tiles.iter().enumerate() {
        for (row, pixels) in tile.rgba.chunks_exact(4 * width).enumerate() {
            let start = 4 * width * ((index / columns * height + row) * columns + index % columns);
            rgba[start..start + 4 * width].copy_from_slice(pixels);
        }
    }
    Picture { width: (width * columns) as u32, height: (height * rows) as u32, rgba }
}
