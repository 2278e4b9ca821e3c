//! `armature demo`: everything once.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use armature_rig::{Pose, PoseCompletion};
use armature_take::{FrameRate, Header, Take, Timeline, verify_completed};

use glam::Affine3A;

use super::run::show_progress;
use crate::characters::LoadedCharacter;
use crate::characters::skin::SkinArgs;
use crate::cli::args::DemoArgs;
use crate::engine::command::RunPlan;
use crate::engine::drive::drive_run;
use crate::engine::event::EngineEvent;
use crate::engine::inbox::Inbox;
use crate::engine::machine::{Engine, EngineSettings};
use crate::engine::puppeteer::ZeroPolicy;
use crate::engine::run_summary::RunSummary;
use crate::engine::sources::simulated::SimulatedArgs;
use crate::engine::sources::{LiveSettings, LiveSource};
use crate::engine::take_recorder::take_header;
use crate::failure::Failure;
use crate::files::Overwrite;
use crate::takes::exports::{self, Options, Target};
use crate::terminal::{Bar, Talk, out};
use crate::{characters, pictures, settings, takes};

const FRAMES_PER_SECOND: u32 = 60;

/// The files of a demo.
struct Outputs {
    take: PathBuf,
    glb: PathBuf,
    bvh: PathBuf,
    picture: PathBuf,
    overwrite: Overwrite,
}

impl Outputs {
    /// Makes the folder: the first free one of its kind, unless one was named.
    fn prepare(named: Option<&Path>, overwrite: Overwrite) -> Result<Self, Failure> {
        let numbered =
            |n: u32| if n < 2 { "armature-demo".into() } else { PathBuf::from(format!("armature-demo-{n}")) };
        let free = || (1..u32::MAX).map(numbered).find(|folder| !folder.exists());
        let folder = named.map(Path::to_path_buf).or_else(free).unwrap_or_else(|| numbered(1));
        // Only the last folder of the path: the others are more likely misspelt than wanted.
        let made = if folder.is_dir() { Ok(()) } else { std::fs::create_dir(&folder) };
        made.map_err(|e| {
            let what = format!("the folder {} cannot be made: {e}", folder.display());
            Failure::input(what, "choose another --output folder")
        })?;
        let file = |name: &str| folder.join(name);
        let outputs = Self {
            take: file("demo.take"),
            glb: file("demo.glb"),
            bvh: file("demo.bvh"),
            picture: file("demo.png"),
            overwrite,
        };
        for path in [&outputs.take, &outputs.glb, &outputs.bvh, &outputs.picture] {
            overwrite.check(path)?;
        }
        Ok(outputs)
    }
}

/// A simulated human in a second process, on a real serial line, moves a character; the take is exported.
pub fn demo(args: &DemoArgs, talk: Talk) -> Result<(), Failure> {
    let outputs = Outputs::prepare(args.output.as_deref(), args.overwrite)?;
    let say = |line: String| {
        if !talk.quiet {
            out!("{line}");
        }
    };
    let device = format!("sim:{}", args.puppet);
    let character = make_character(characters::default_for(&device), args.skin, talk, &say)?;
    let (line, summary) = perform_and_record(args, &device, character.clone(), &outputs.take, talk)?;
    say(summary.to_string());
    if let Some(trouble) = summary.trouble {
        return Err(trouble);
    }
    let take = takes::read_and_tell(&outputs.take)?;
    check_replay(&take, &character, talk, &say)?;
    write_exports(&take, &character, &outputs, talk, &say)?;
    write_picture(&take, &character, &outputs, &say)?;
    say(format!("done       a puppet on {line} moved {}; open {} in Blender", character.name, outputs.glb.display()));
    Ok(())
}

fn make_character(
    name: &str,
    skin: SkinArgs,
    talk: Talk,
    say: &dyn Fn(String),
) -> Result<Arc<LoadedCharacter>, Failure> {
    let start = std::time::Instant::now();
    let bar = Bar::new(talk, "shaping the character");
    let found = skin.apply(characters::find(name, &mut bar.stages())?, &mut bar.stages())?;
    bar.finish();
    let triangles = found.character.shape.as_ref().map_or(0, |s| s.triangles().len());
    let bones = found.character.skeleton.len();
    let seconds = start.elapsed().as_secs_f64();
    say(format!(
        "character  {} of our own: {triangles} triangles, {bones} bones, made in {seconds:.2} s",
        found.character.name
    ));
    Ok(Arc::new(found.character))
}

/// The line that the puppet was on, and how it went.
fn perform_and_record(
    args: &DemoArgs,
    device: &str,
    character: Arc<LoadedCharacter>,
    take: &Path,
    talk: Talk,
) -> Result<(String, RunSummary), Failure> {
    let plan = RunPlan {
        seconds: Some(args.seconds),
        record: Some(take.to_path_buf()),
        overwrite: args.overwrite,
        header: Header {
            seed: Some(args.seed),
            unix_micros: settings::unix_micros(),
            ..take_header(&character, args.rate)
        },
    };
    let mut engine = Engine::new(EngineSettings {
        samples_per_second: args.rate,
        zero_policy: ZeroPolicy::AtStart,
        ik: args.ik.clone(),
        draws: false,
        ..EngineSettings::default()
    });
    let simulated = SimulatedArgs { seed: args.seed, motion: args.motion.clone(), ..SimulatedArgs::default() };
    let live = LiveSettings { simulated, catches_interrupt: true, ..LiveSettings::default() };
    let mut source = LiveSource::new(Inbox::default(), live)?;
    let (mut address, mut bar) = (String::new(), None);
    let summary = drive_run(&mut engine, &mut source, character, device, plan, None, &mut |event| {
        if let EngineEvent::LineOpened { line, process } = &event {
            let process = process.map_or_else(String::new, |id| format!(" in process {id}"));
            if !talk.quiet {
                out!("puppet     simulated {}{process} at {line}", args.puppet);
            }
            address.clone_from(line);
            bar = Some(Bar::new(talk, "waiting for the puppet"));
        }
        show_progress("", &event, bar.as_ref());
    })?;
    Ok((address, summary))
}

fn check_replay(take: &Take, character: &LoadedCharacter, talk: Talk, say: &dyn Fn(String)) -> Result<(), Failure> {
    let bar = Bar::new(talk, "solving again");
    let mut completion = takes::completion(take, character)?;
    let completion = completion.as_mut().map(|ik| ik as &mut dyn PoseCompletion);
    let verification = verify_completed(take, completion, &mut bar.stages())
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
    character: &LoadedCharacter,
    outputs: &Outputs,
    talk: Talk,
    say: &dyn Fn(String),
) -> Result<(), Failure> {
    let rate = FrameRate::whole(FRAMES_PER_SECOND).ok_or_else(|| Failure::usage("the demo has no frame rate", ""))?;
    let options = Options::at(rate);
    for (path, target) in [(&outputs.glb, Target::Glb), (&outputs.bvh, Target::Bvh)] {
        let bar = Bar::new(talk, "exporting");
        let exported = exports::export(take, None, Some(character), target, &options, &mut bar.stages())?;
        bar.finish();
        outputs.overwrite.write(path, &exported.bytes)?;
        say(format!("export     {}: {exported}", path.display()));
        exported.notes.iter().for_each(|note| say(format!("           note: {note}")));
    }
    Ok(())
}

/// Draws the longest stride in the middle half of the take, where the motion is in full swing.
fn write_picture(
    take: &Take,
    character: &LoadedCharacter,
    outputs: &Outputs,
    say: &dyn Fn(String),
) -> Result<(), Failure> {
    let no_pose = || Failure::input("the take holds no pose", "run the demo for more seconds");
    let timeline = Timeline::recorded(take).ok_or_else(no_pose)?;
    let middle = timeline.len() / 4..(timeline.len() * 3).div_ceil(4);
    let poses = middle.filter_map(|index| Some(take.unpack(timeline.get(index)?.1)));
    let pose = poses.max_by(|a, b| stride(character, a).total_cmp(&stride(character, b))).ok_or_else(no_pose)?;
    let (positions, normals) = pictures::skin_once(character, &pose, &[])?;
    let by = pictures::write_picture(outputs.overwrite, &outputs.picture, character, &positions, &normals)?;
    say(format!("picture    {}: {by}", outputs.picture.display()));
    Ok(())
}

/// How far the bones reach from front to back.
fn stride(character: &LoadedCharacter, pose: &Pose) -> f32 {
    let mut frames = vec![Affine3A::IDENTITY; character.skeleton.len()];
    pose.forward_kinematics(&character.skeleton, &mut frames);
    let reach = frames.iter().map(|f| f.translation.z).fold((f32::MAX, f32::MIN), |(lo, hi), z| (lo.min(z), hi.max(z)));
    reach.1 - reach.0
}
