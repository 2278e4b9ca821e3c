//! `armature run`

use std::path::{Path, PathBuf};
use std::sync::Arc;

use armature_device::servo::{EepromConsent, ServoSettings};
use armature_rig::{Calibration, Mapping, RestTurn};
use armature_take::Header;

use super::mapping_words::{dynamics_words, mapping_words};
use crate::characters::{self, LoadedCharacter};
use crate::cli::args::RunArgs;
use crate::engine::command::RunPlan;
use crate::engine::drive::drive_run;
use crate::engine::event::EngineEvent;
use crate::engine::inbox::Inbox;
use crate::engine::machine::{Engine, EngineSettings};
use crate::engine::puppeteer::{Puppeteer, ZeroPolicy};
use crate::engine::run_summary::RunSummary;
use crate::engine::sources::address::{is_simulated, name_device, named, with_preset};
use crate::engine::sources::{LiveSettings, LiveSource, VirtualSource};
use crate::engine::take_recorder::take_header;
use crate::failure::Failure;
use crate::settings;
use crate::streams::Streams;
use crate::terminal::{Bar, Talk, aside, counted, out};

/// Drives a character with a puppet, and records.
pub fn run(args: &RunArgs, talk: Talk) -> Result<(), Failure> {
    for path in args.record.iter().chain(&args.save_mapping) {
        args.overwrite.check(path)?;
    }
    if let Some(path) = args.calibration.as_deref().filter(|path| !path.exists()) {
        let what = format!("there is no calibration {}", path.display());
        return Err(Failure::usage(what, format!("`armature calibrate -o {}` makes one", path.display())));
    }
    let character = args.character.as_deref().unwrap_or_else(|| characters::default_for(&args.device));
    let bar = Bar::new(talk, "loading the character");
    let found = args.skin.apply(characters::find(character, &mut bar.stages())?, &mut bar.stages())?;
    bar.finish();
    tell(talk, found.warnings.iter().map(|w| format!("note: {w}")));
    let character = Arc::new(found.character);
    let is_simulated = is_simulated(&args.device)?;
    let calibration_path = match &args.calibration {
        Some(path) => Some(path.clone()),
        None if is_simulated => None,
        None => settings::calibration_file(),
    };
    let mut calibration = calibration_path.as_deref().map(settings::read_calibration).transpose()?.unwrap_or_default();
    let kept_filter = calibration.filter;
    calibration.filter = args.filter.unwrap_or(kept_filter);
    let mut engine = Engine::new(EngineSettings {
        samples_per_second: args.rate,
        zero_policy: if args.zero { ZeroPolicy::AtStart } else { ZeroPolicy::WhenUnknown },
        mapping: args.mapping.as_deref().map(settings::read_mapping).transpose()?,
        puppet_rest: args.puppet_rest.unwrap_or_default(),
        calibration,
        ik: args.ik.clone(),
        ground: args.ground.clone(),
        dynamics: args.dynamics.clone(),
        shapes: args.shapes.shapes.clone(),
        targets: args.targets.clone(),
        draws: false,
        ..EngineSettings::default()
    });
    let plan = plan(args, &character, is_simulated);
    let streams = args.streams.open(&character.name, &character.skeleton)?;
    tell(talk, streams.iter().flat_map(Streams::addresses).map(|address| format!("streaming to {address}")));
    let summary = if args.virtual_clock {
        run_virtually(args, &mut engine, character, plan, is_simulated)?
    } else {
        run_live(args, &mut engine, character, plan, streams.as_ref(), talk)?
    };
    let streamed = streams.map(Streams::finish).unwrap_or_default();
    if let Some(puppeteer) = engine.puppeteer() {
        let mut calibration = puppeteer.calibration().clone();
        if !args.save_filter {
            calibration.filter = kept_filter;
        }
        keep(args, calibration_path.as_deref(), &calibration, puppeteer.mapping(), talk)?;
    }
    if !talk.quiet {
        out!("{summary}");
        streamed.iter().for_each(|report| out!("streamed   {report}"));
        let doubts = engine.puppeteer().map_or(&[][..], |puppeteer| puppeteer.mapping_doubts());
        if !doubts.is_empty() {
            out!("{}", mapping_line(doubts));
        }
        let mapping = engine.puppeteer().and_then(|puppeteer| puppeteer.mapping());
        if let Some(dynamics) = engine.puppeteer().and_then(Puppeteer::dynamics) {
            out!("dynamics   {}", dynamics_words(dynamics));
        }
        mapping.map(mapping_words).unwrap_or_default().iter().for_each(|words| out!("mapping    {words}"));
        if let Some(line) = engine.puppeteer().and_then(rest_line) {
            out!("{line}");
        }
    }
    summary.trouble.map_or(Ok(()), Err)
}

/// One line about a proposed mapping; the doubts themselves are for those who ask.
fn mapping_line(doubts: &[String]) -> String {
    doubts.iter().for_each(|doubt| tracing::info!("mapping: {doubt}"));
    let choices = doubts.len();
    let plural = if choices == 1 { "" } else { "s" };
    format!(
        "mapping    proposed by shape, {choices} choice{plural} uncertain (-v lists them; to correct: --save-mapping FILE, edit it, --mapping FILE)"
    )
}

/// One line about how the character's rest pose was turned to the puppet's; each bone is for those who ask.
fn rest_line(puppeteer: &Puppeteer) -> Option<String> {
    let turns = puppeteer.mapping().map_or(&[][..], |mapping| mapping.rest.as_slice());
    if turns.is_empty() {
        return puppeteer.rest_note().map(|note| format!("rest pose  {note}"));
    }
    for RestTurn { bone, degrees } in turns {
        tracing::info!("rest pose: {bone} turned by {:.1}° ({degrees})", degrees.length());
    }
    let most = turns.iter().map(RestTurn::angle).fold(0.0, f32::max);
    let bones = counted(turns.len(), "bone", "bones");
    Some(format!(
        "rest pose  {bones} of the character turned to the puppet's, by up to {most:.0}° (-v lists them; to correct: --save-mapping FILE, edit it, --mapping FILE; not at all: --puppet-rest character)"
    ))
}

fn tell(talk: Talk, lines: impl Iterator<Item = String>) {
    if !talk.quiet {
        lines.for_each(|line| aside!("{line}"));
    }
}

fn plan(args: &RunArgs, character: &LoadedCharacter, is_simulated: bool) -> RunPlan {
    RunPlan {
        seconds: args.seconds,
        record: args.record.clone(),
        overwrite: args.overwrite,
        header: Header {
            seed: is_simulated.then_some(args.simulated.seed),
            virtual_clock: args.virtual_clock,
            unix_micros: (!args.virtual_clock).then(settings::unix_micros).flatten(),
            ..take_header(character, args.rate)
        },
    }
}

fn run_virtually(
    args: &RunArgs,
    engine: &mut Engine,
    character: Arc<LoadedCharacter>,
    plan: RunPlan,
    is_simulated: bool,
) -> Result<RunSummary, Failure> {
    let Some(name) = args.device.strip_prefix("sim:").filter(|_| is_simulated) else {
        return Err(Failure::usage("--virtual-clock needs a simulated puppet", "choose a --device sim:…"));
    };
    if plan.seconds.is_none() {
        return Err(Failure::usage("--virtual-clock needs an end", "add --seconds N"));
    }
    let mut source = VirtualSource::new(name, &args.simulated, args.rate)?;
    drive_run(engine, &mut source, character, &args.device, plan, None, &mut |event| log_problem("", &event))
}

fn run_live(
    args: &RunArgs,
    engine: &mut Engine,
    character: Arc<LoadedCharacter>,
    plan: RunPlan,
    streams: Option<&Streams>,
    talk: Talk,
) -> Result<RunSummary, Failure> {
    let device = with_preset(&args.device, args.preset.as_deref())?;
    let eeprom = if args.servo_return_delay_zero { EepromConsent::ReturnDelayZero } else { EepromConsent::Never };
    let settings = LiveSettings {
        simulated: args.simulated.clone(),
        servos: ServoSettings { eeprom, ..ServoSettings::default() },
        catches_interrupt: true,
        ..LiveSettings::default()
    };
    let mut source = LiveSource::new(Inbox::default(), settings)?;
    let mut bar = None;
    let summary = drive_run(engine, &mut source, character, &device, plan, streams, &mut |event| {
        match &event {
            EngineEvent::LineOpened { line, .. } => {
                tell(talk, std::iter::once(format!("connected to {line} (Ctrl-C ends)")));
                bar = Some(Bar::new(talk, "waiting for the puppet"));
            }
            EngineEvent::RestPoseAwaited => tell(talk, std::iter::once("hold the rest pose".into())),
            _ => {}
        }
        show_progress(&device, &event, bar.as_ref());
    });
    let mut summary = summary.map_err(|failure| name_device(&device, failure))?;
    summary.trouble = summary.trouble.map(|failure| name_device(&device, failure));
    Ok(summary)
}

/// What a run says while it goes on.
pub(super) fn show_progress(device: &str, event: &EngineEvent, bar: Option<&Bar>) {
    if let (EngineEvent::Busy { task, fraction }, Some(bar)) = (event, bar) {
        bar.show(task, f64::from(fraction.unwrap_or(0.0)));
    }
    log_problem(device, event);
}

/// Trouble that a run or a calibration survives.
pub(super) fn log_problem(device: &str, event: &EngineEvent) {
    if let EngineEvent::Problem(problem) | EngineEvent::Waiting(problem) = event {
        tracing::warn!("{}", named(device, &problem.what));
    }
}

/// Saves the calibration and, if asked, the mapping. A calibration file that nobody named may be impossible to write:
/// the run went well without it.
fn keep(
    args: &RunArgs,
    calibration_path: Option<&Path>,
    calibration: &Calibration,
    mapping: Option<&Mapping>,
    talk: Talk,
) -> Result<(), Failure> {
    match calibration_path.map_or(Ok(()), |path| settings::write_calibration(path, calibration)) {
        Err(failure) if args.calibration.is_none() => {
            let what = failure.what;
            let note =
                format!("note: the calibration is not saved: {what}\n  → name another file with --calibration FILE");
            tell(talk, std::iter::once(note));
        }
        kept => kept?,
    }
    let save: Option<(&PathBuf, &Mapping)> = args.save_mapping.as_ref().zip(mapping);
    save.map_or(Ok(()), |(path, mapping)| {
        args.overwrite.write(path, armature_formats::settings::write_mapping(mapping).as_bytes())
    })
}
