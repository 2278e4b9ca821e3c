//! `armature demo`: the whole way once.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use armature_rig::{Calibration, Pose, PoseCompletion};
use armature_take::{ExportSettings, Header, ResampleSettings, Take, Timeline, verify_completed};

use glam::Affine3A;

use crate::cli::args::DemoArgs;
use crate::engine::actor::Actor;
use crate::engine::live::Live;
use crate::engine::perform::{self, Plan, Summary};
use crate::engine::performance::{Performance, ZeroPolicy};
use crate::engine::simulated::SimulatedArgs;
use crate::exports::{self, Target};
use crate::failure::Failure;
use crate::talk::{Bar, Talk};
use crate::{characters, files, pictures, settings, takes};

const FRAMES_PER_SECOND: f64 = 60.0;

/// The files of a demo.
struct Outputs {
    take: PathBuf,
    glb: PathBuf,
    bvh: PathBuf,
    picture: PathBuf,
}

impl Outputs {
    fn in_folder(folder: &Path) -> Self {
        let file = |name: &str| folder.join(name);
        Self { take: file("demo.take"), glb: file("demo.glb"), bvh: file("demo.bvh"), picture: file("demo.png") }
    }
}

/// A simulated human in a second process, on a real serial line, moves a character; the take is exported.
pub fn demo(args: &DemoArgs, talk: Talk) -> Result<(), Failure> {
    let outputs = Outputs::in_folder(&args.output);
    let say = |line: String| {
        if !talk.quiet {
            println!("{line}");
        }
    };
    let device = format!("sim:{}", args.puppet);
    let actor = make_character(characters::default_for(&device), talk, &say)?;
    let (live, summary) = {
        let simulated = SimulatedArgs { seed: args.seed, motion: args.motion.clone(), ..SimulatedArgs::default() };
        let live = Live::connect(&device, &simulated)?;
        let process = live.simulated_process().map_or_else(String::new, |id| format!(" in process {id}"));
        say(format!("puppet     simulated {}{process} at {}", args.puppet, live.address()));
        let address = live.address().to_string();
        (address, perform_and_record(args, live, actor.clone(), &outputs.take, talk)?)
    };
    say(summary.to_string());
    if let Some(trouble) = summary.trouble {
        return Err(trouble);
    }
    let take = takes::read_and_tell(&outputs.take)?;
    check_replay(&take, &actor, talk, &say)?;
    write_exports(&take, &actor, &outputs, talk, &say)?;
    write_picture(&take, &actor, &outputs.picture, &say)?;
    say(format!("done       a puppet on {live} moved {}; open {} in Blender", actor.name, outputs.glb.display()));
    Ok(())
}

fn make_character(name: &str, talk: Talk, say: &dyn Fn(String)) -> Result<Arc<Actor>, Failure> {
    let start = std::time::Instant::now();
    let bar = Bar::new(talk, "shaping the character");
    let found = characters::find(name, &mut bar.binding())?;
    bar.finish();
    let triangles = found.actor.shape.as_ref().map_or(0, |s| s.triangles.len());
    let bones = found.actor.skeleton.len();
    let seconds = start.elapsed().as_secs_f64();
    say(format!(
        "character  {} of our own: {triangles} triangles, {bones} bones, made in {seconds:.2} s",
        found.actor.name
    ));
    Ok(Arc::new(found.actor))
}

fn perform_and_record(
    args: &DemoArgs,
    mut live: Live,
    actor: Arc<Actor>,
    take: &Path,
    talk: Talk,
) -> Result<Summary, Failure> {
    live.start_when_ready(args.rate);
    live.catch_interrupt();
    // The demo's own take of an earlier run.
    if take.exists() {
        std::fs::remove_file(take)
            .map_err(|e| Failure::input(format!("{}: {e}", take.display()), "choose another --output folder"))?;
    }
    let plan = Plan {
        seconds: Some(args.seconds),
        record: Some(take.to_path_buf()),
        header: Header {
            program_version: env!("CARGO_PKG_VERSION").into(),
            character_name: actor.source.clone(),
            character_hash: actor.content_hash(),
            nominal_samples_per_second: Some(args.rate),
            seed: Some(args.seed),
            unix_micros: settings::unix_micros(),
            ..Header::default()
        },
    };
    let performance = Performance::new(actor, None, Calibration::default(), ZeroPolicy::AtStart)?
        .with_inverse_kinematics(&args.ik)?;
    let bar = Bar::new(talk, "waiting for the puppet");
    let (_, summary) = perform::perform(live, performance, &plan, &mut |line, done| bar.show(line, done))?;
    Ok(summary)
}

fn check_replay(take: &Take, actor: &Actor, talk: Talk, say: &dyn Fn(String)) -> Result<(), Failure> {
    let bar = Bar::new(talk, "solving again");
    let mut completion = takes::completion(take, actor)?;
    let completion = completion.as_mut().map(|ik| ik as &mut dyn PoseCompletion);
    let verification = verify_completed(take, completion, &mut bar.fraction("solving again"))
        .map_err(|e| Failure::input(e.to_string(), "this is a defect; please report it"))?;
    bar.finish();
    if !verification.is_exact() {
        let what = format!("{} of the recorded poses differ when solved again", verification.different);
        return Err(Failure::not_converged(what, "this is a defect; please report it with the take"));
    }
    say(format!(
        "replay     {} poses solved again from raw samples, all the same to the last bit",
        verification.identical
    ));
    Ok(())
}

fn write_exports(
    take: &Take,
    actor: &Actor,
    outputs: &Outputs,
    talk: Talk,
    say: &dyn Fn(String),
) -> Result<(), Failure> {
    let resample = ResampleSettings { frames_per_second: FRAMES_PER_SECOND, ..ResampleSettings::default() };
    let settings = ExportSettings { resample, ..ExportSettings::default() };
    for (path, target) in [(&outputs.glb, Target::Glb), (&outputs.bvh, Target::Bvh)] {
        let bar = Bar::new(talk, "exporting");
        let exported = exports::export(take, Some(actor), target, &settings, &mut bar.fraction("exporting"))?;
        bar.finish();
        files::write(path, &exported.bytes)?;
        say(format!("export     {}: {exported}", path.display()));
        exported.notes.iter().for_each(|note| say(format!("           note: {note}")));
    }
    Ok(())
}

/// Draws the longest stride of the take's middle half, where the motion is in full swing.
fn write_picture(take: &Take, actor: &Actor, path: &Path, say: &dyn Fn(String)) -> Result<(), Failure> {
    let no_pose = || Failure::input("the take holds no pose", "run the demo for more seconds");
    let timeline = Timeline::recorded(take).ok_or_else(no_pose)?;
    let middle = timeline.len() / 4..(timeline.len() * 3).div_ceil(4);
    let poses = middle.filter_map(|index| Some(take.unpack(timeline.get(index)?.1)));
    let pose = poses.max_by(|a, b| stride(actor, a).total_cmp(&stride(actor, b))).ok_or_else(no_pose)?;
    let (positions, normals) = pictures::skin_once(actor, &pose)?;
    let by = pictures::write_picture(path, actor, &positions, &normals)?;
    say(format!("picture    {}: {by}", path.display()));
    Ok(())
}

/// How far the bones reach from front to back.
fn stride(actor: &Actor, pose: &Pose) -> f32 {
    let mut frames = vec![Affine3A::IDENTITY; actor.skeleton.len()];
    pose.forward_kinematics(&actor.skeleton, &mut frames);
    let reach = frames.iter().map(|f| f.translation.z).fold((f32::MAX, f32::MIN), |(lo, hi), z| (lo.min(z), hi.max(z)));
    reach.1 - reach.0
}
