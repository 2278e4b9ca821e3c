//! `armature calibrate`

use std::path::PathBuf;
use std::sync::Arc;

use armature_device::servo::ServoSettings;
use armature_rig::{CalibrationStep, JointAxis, JointTree, PartUid, Progress, StepReport, StepTimes};

use crate::characters;
use crate::cli::args::CalibrateArgs;
use crate::engine::actor::Actor;
use crate::engine::calibrating::{Calibrated, calibrate as do_steps};
use crate::engine::live::{Live, parse_address, with_preset};
use crate::engine::performance::{Performance, ZeroPolicy};
use crate::engine::simulated::SimulatedArgs;
use crate::engine::virtual_clock::VirtualPuppet;
use crate::failure::Failure;
use crate::settings;
use crate::talk::{Bar, Talk};

const SAMPLES_PER_SECOND: f64 = 100.0;
/// Between the steps and before the first one some time goes by.
const SLACK_SECONDS: f64 = 1.0;

/// Calibrates a puppet step by step and keeps what was found.
pub fn calibrate(args: &CalibrateArgs, talk: Talk) -> Result<(), Failure> {
    let is_simulated = matches!(parse_address(&args.device)?, armature_device::DeviceAddress::Sim { .. });
    let path = calibration_path(args, is_simulated)?;
    let steps: &[CalibrationStep] = if args.step.is_empty() { &[CalibrationStep::Zero] } else { &args.step };
    let times = StepTimes { countdown: args.countdown, hold: args.hold, sweep: args.sweep_seconds };
    // Bones are all that a heading needs of a character.
    let character = args.character.as_deref().unwrap_or_else(|| characters::default_for(&args.device));
    let bar = Bar::new(talk, "loading the character");
    let found = characters::find(character, &mut bar.binding())?;
    let actor = Arc::new(Actor::bare(character, character, found.actor.skeleton.clone()));
    let mapping = args.mapping.as_deref().map(settings::read_mapping).transpose()?;
    let known = settings::read_calibration(&path)?;
    let performance = Performance::new(actor, mapping, known, ZeroPolicy::OnRequest)?;
    let simulated = simulated(args, steps, times);
    let mut told = None;
    let mut tell = |step: CalibrationStep, progress: Progress| show(talk, &bar, step, progress, &mut told);
    let calibrated = match args.device.strip_prefix("sim:").filter(|_| args.virtual_clock) {
        Some(name) => {
            do_steps(VirtualPuppet::new(name, &simulated, SAMPLES_PER_SECOND)?, performance, steps, times, &mut tell)?
        }
        None if args.virtual_clock => {
            return Err(Failure::usage("--virtual-clock needs a simulated puppet", "choose a --device sim:…"));
        }
        None => {
            let device = with_preset(&args.device, args.preset.as_deref())?;
            let live = Live::connect_with(&device, &simulated, ServoSettings::default())?;
            live.start(SAMPLES_PER_SECOND);
            live.catch_interrupt();
            do_steps(live, performance, steps, times, &mut tell)?
        }
    };
    bar.finish();
    settings::write_calibration(&path, calibrated.performance.calibration())?;
    report(talk, &calibrated)?;
    if !talk.quiet {
        println!("kept in {}", path.display());
    }
    Ok(())
}

fn calibration_path(args: &CalibrateArgs, is_simulated: bool) -> Result<PathBuf, Failure> {
    let kept = settings::calibration_file().filter(|_| !is_simulated);
    args.output.clone().or(kept).ok_or_else(|| {
        Failure::usage("a simulated puppet's calibration is not kept for this user", "name a file: -o FILE.toml")
    })
}

/// A simulated puppet rests and sweeps its joints at the right time, unless it is told to do something else.
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
            eprintln!("{step}: {instruction} (in {:.0} s)", seconds_left.ceil());
        }
    }
    bar.show(&format!("{step}: {words}, {:.0} s", seconds_left.ceil()), 0.0);
}

/// Prints what each step found. Steps that found nothing at all are device trouble.
fn report(talk: Talk, calibrated: &Calibrated) -> Result<(), Failure> {
    let tree = calibrated.performance.topology().map(|(_, tree)| tree.clone()).unwrap_or_default();
    for StepReport { step, findings, .. } in &calibrated.reports {
        let good = findings.iter().filter(|found| !found.finding.is_bad()).count();
        if !talk.quiet {
            println!("{step}: {good} of {} measured", findings.len());
            for found in findings {
                let name = found.part.map_or_else(String::new, |part| name_of(calibrated, &tree, part, found.sensor));
                println!("  {name:34} {}", found.finding);
            }
        }
        if good == 0 && !findings.is_empty() {
            let what = format!("the {step} step measured nothing: {}", findings[0].finding);
            return Err(Failure::device(what, "do it again; what was known before is kept"));
        }
    }
    Ok(())
}

/// A part by the bone it drives, where it drives one, and by its number; its sensor by its axis.
fn name_of(calibrated: &Calibrated, tree: &JointTree, part: PartUid, sensor: Option<usize>) -> String {
    let entries = calibrated.performance.mapping().map_or(&[][..], |mapping| mapping.entries.as_slice());
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
