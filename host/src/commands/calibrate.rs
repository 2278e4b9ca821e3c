//! `armature calibrate`

use std::path::PathBuf;
use std::sync::Arc;

use armature_rig::{CalibrationStep, JointAxis, JointTree, PartUid, Progress, StepReport, StepTimes};

use super::run::log_problem;
use crate::characters::{self, LoadedCharacter};
use crate::cli::args::CalibrateArgs;
use crate::engine::drive::drive_calibration;
use crate::engine::event::EngineEvent;
use crate::engine::inbox::Inbox;
use crate::engine::machine::{Engine, EngineSettings};
use crate::engine::puppeteer::{Puppeteer, ZeroPolicy};
use crate::engine::sources::address::{is_simulated, name_device, with_preset};
use crate::engine::sources::simulated::SimulatedArgs;
use crate::engine::sources::{LiveSettings, LiveSource, VirtualSource};
use crate::failure::Failure;
use crate::files::Overwrite;
use crate::settings;
use crate::terminal::{Bar, Talk, aside, out};

const SAMPLES_PER_SECOND: f64 = 100.0;
/// Some time passes before the first step and between steps.
const SLACK_SECONDS: f64 = 1.0;

/// Calibrates a puppet step by step and saves the result.
pub fn calibrate(args: &CalibrateArgs, talk: Talk) -> Result<(), Failure> {
    let path = calibration_path(args, is_simulated(&args.device)?)?;
    let steps: &[CalibrationStep] = if args.step.is_empty() { &[CalibrationStep::Zero] } else { &args.step };
    let times = StepTimes { countdown: args.countdown, hold: args.hold, sweep: args.sweep_seconds };
    // A heading only needs a character's bones.
    let character = args.character.as_deref().unwrap_or_else(|| characters::default_for(&args.device));
    let bar = Bar::new(talk, "loading the character");
    let found = characters::find(character, &mut bar.stages())?;
    let character = Arc::new(LoadedCharacter::bare(character, character, found.character.skeleton));
    let mut engine = Engine::new(EngineSettings {
        samples_per_second: SAMPLES_PER_SECOND,
        zero_policy: ZeroPolicy::OnRequest,
        mapping: args.mapping.as_deref().map(settings::read_mapping).transpose()?,
        calibration: settings::read_calibration(&path)?,
        step_times: times,
        draws: false,
        ..EngineSettings::default()
    });
    let simulated = simulated(args, steps, times);
    let mut told = None;
    let mut heard = |event: EngineEvent| {
        if let EngineEvent::Calibrating { step, progress } = event {
            show(talk, &bar, step, progress, &mut told);
        }
        log_problem(if args.virtual_clock { "" } else { &args.device }, &event);
    };
    let reports = match args.device.strip_prefix("sim:").filter(|_| args.virtual_clock) {
        Some(name) => {
            let mut source = VirtualSource::new(name, &simulated, SAMPLES_PER_SECOND)?;
            drive_calibration(&mut engine, &mut source, character, &args.device, steps, &mut heard)?
        }
        None if args.virtual_clock => {
            return Err(Failure::usage("--virtual-clock needs a simulated puppet", "choose a --device sim:…"));
        }
        None => {
            let device = with_preset(&args.device, args.preset.as_deref())?;
            let live = LiveSettings { simulated, catches_interrupt: true, ..LiveSettings::default() };
            let mut source = LiveSource::new(Inbox::default(), live)?;
            drive_calibration(&mut engine, &mut source, character, &device, steps, &mut heard)
                .map_err(|failure| name_device(&device, failure))?
        }
    };
    let Some(puppeteer) = engine.puppeteer() else { return Ok(()) };
    bar.finish();
    settings::write_calibration(&path, puppeteer.calibration())?;
    report(talk, puppeteer, &reports)?;
    if !talk.quiet {
        out!("kept in {}", path.display());
    }
    Ok(())
}

fn calibration_path(args: &CalibrateArgs, is_simulated: bool) -> Result<PathBuf, Failure> {
    // A file that is there is added to; only its folder has to be.
    args.output.as_deref().map_or(Ok(()), |path| Overwrite { force: true }.check(path))?;
    let kept = settings::calibration_file().filter(|_| !is_simulated);
    args.output.clone().or(kept).ok_or_else(|| {
        Failure::usage("a simulated puppet's calibration is not kept for this user", "name a file: -o FILE.toml")
    })
}

/// A simulated puppet rests and sweeps its joints at the right time, unless another motion is requested.
fn simulated(args: &CalibrateArgs, steps: &[CalibrationStep], times: StepTimes) -> SimulatedArgs {
    let mut simulated = args.simulated.clone();
    if simulated.motion.is_none() {
        simulated.motion = Some("sweep".into());
        let until_sweep = steps.iter().take_while(|step| **step != CalibrationStep::Sweep);
        let held: f64 = until_sweep.map(|step| step.instructions().len() as f64 * (times.countdown + times.hold)).sum();
        let sweeps = steps.contains(&CalibrationStep::Sweep);
        let rest = held + if sweeps { times.countdown } else { times.hold } + SLACK_SECONDS;
        simulated.rest = simulated.rest.max(rest);
    }
    simulated
}

/// Each instruction once as a line, and the seconds on the bar.
fn show(
    talk: Talk,
    bar: &Bar,
    step: CalibrationStep,
    progress: Progress,
    told: &mut Option<(CalibrationStep, &'static str)>,
) {
    let (words, seconds_left, instruction) = match progress {
        Progress::Countdown { seconds_left, instruction } => ("get ready", seconds_left, instruction),
        Progress::Measuring { seconds_left, instruction } => ("measuring", seconds_left, instruction),
        Progress::Over => return,
    };
    if *told != Some((step, instruction)) {
        *told = Some((step, instruction));
        if !talk.quiet {
            aside!("{step}: {instruction} (in {:.0} s)", seconds_left.ceil());
        }
    }
    bar.show(&format!("{step}: {words}, {:.0} s", seconds_left.ceil()), 0.0);
}

/// Prints what each step found. A step that found nothing is device trouble.
fn report(talk: Talk, puppeteer: &Puppeteer, reports: &[StepReport]) -> Result<(), Failure> {
    let tree = puppeteer.topology().map(|(_, tree)| tree.clone()).unwrap_or_default();
    for StepReport { step, findings, .. } in reports {
        let good = findings.iter().filter(|found| !found.finding.is_bad()).count();
        if !talk.quiet {
            out!("{step}: {good} of {} measured", findings.len());
            for found in findings {
                let name = found.part.map_or_else(String::new, |part| name_of(puppeteer, &tree, part, found.sensor));
                out!("  {name:34} {}", found.finding);
            }
        }
        if good == 0 && !findings.is_empty() {
            let what = format!("the {step} step measured nothing: {}", findings[0].finding);
            return Err(Failure::device(what, "do it again; what was known before is kept"));
        }
    }
    Ok(())
}

/// A part by the bone it drives, if any, and by its number; its sensor by its axis.
fn name_of(puppeteer: &Puppeteer, tree: &JointTree, part: PartUid, sensor: Option<usize>) -> String {
    let entries = puppeteer.mapping().map_or(&[][..], |mapping| mapping.entries.as_slice());
    let bone = entries.iter().find(|entry| entry.part == part).map(|entry| entry.bone.clone());
    let number = part.to_string();
    let name = bone.unwrap_or_else(|| format!("part {}", number.get(..8).unwrap_or(&number)));
    let axes = tree.find(part).map_or(&[][..], |index| tree.parts()[index].kind.axes());
    match sensor.and_then(|sensor| Some((sensor, axes.get(sensor)?))) {
        Some((sensor, axis)) => {
            let axis = match axis {
                JointAxis::Bend => "bend",
                JointAxis::Twist if axes.len() > 1 && sensor == 0 => "inner twist",
                JointAxis::Twist if axes.len() > 1 => "outer twist",
                JointAxis::Twist => "twist",
            };
            format!("{name}, {axis}")
        }
        None => name,
    }
}
