//! `armature run`

use std::path::{Path, PathBuf};
use std::sync::Arc;

use armature_device::servo::{EepromConsent, ServoSettings};
use armature_rig::{Calibration, Mapping};
use armature_take::Header;

use crate::characters;
use crate::cli::args::RunArgs;
use crate::engine::actor::Actor;
use crate::engine::live::{Live, parse_address, with_preset};
use crate::engine::perform::{self, Plan, Summary};
use crate::engine::performance::{Performance, ZeroPolicy};
use crate::engine::recorder::check_take_name;
use crate::engine::virtual_clock::VirtualPuppet;
use crate::failure::Failure;
use crate::files;
use crate::settings;
use crate::talk::{Bar, Talk};

/// Drives a character with a puppet, and records.
pub fn run(args: &RunArgs, talk: Talk) -> Result<(), Failure> {
    args.record.as_deref().map_or(Ok(()), check_take_name)?;
    let character = args.character.as_deref().unwrap_or_else(|| characters::default_for(&args.device));
    let bar = Bar::new(talk, "loading the character");
    let found = characters::find(character, &mut bar.binding())?;
    bar.finish();
    tell(talk, found.warnings.iter().map(|w| format!("note: {w}")));
    let actor = Arc::new(found.actor);
    let is_simulated = matches!(parse_address(&args.device)?, armature_device::DeviceAddress::Sim { .. });
    let calibration_path = match &args.calibration {
        Some(path) => Some(path.clone()),
        None if is_simulated => None,
        None => settings::calibration_file(),
    };
    let mut calibration = calibration_path.as_deref().map(settings::read_calibration).transpose()?.unwrap_or_default();
    calibration.filter = args.filter.unwrap_or(calibration.filter);
    let performance = Performance::new(
        actor.clone(),
        args.mapping.as_deref().map(settings::read_mapping).transpose()?,
        calibration,
        if args.zero { ZeroPolicy::AtStart } else { ZeroPolicy::WhenUnknown },
    )?
    .with_inverse_kinematics(&args.ik)?;
    let plan = plan(args, &actor);
    let (performance, summary) = if args.virtual_clock {
        run_virtually(args, performance, &plan, is_simulated)?
    } else {
        run_live(args, performance, &plan, talk)?
    };
    keep(args, calibration_path.as_deref(), performance.calibration(), performance.mapping())?;
    if !talk.quiet {
        println!("{summary}");
        if !performance.mapping_doubts().is_empty() {
            println!("{}", mapping_line(performance.mapping_doubts()));
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
        "mapping    proposed by shape, {choices} choice{plural} worth a look (-v tells; --save-mapping FILE, correct it, --mapping FILE)"
    )
}

fn tell(talk: Talk, lines: impl Iterator<Item = String>) {
    if !talk.quiet {
        lines.for_each(|line| eprintln!("{line}"));
    }
}

fn plan(args: &RunArgs, actor: &Actor) -> Plan {
    let is_simulated = args.device.starts_with("sim:");
    Plan {
        seconds: args.seconds,
        record: args.record.clone(),
        header: Header {
            program_version: env!("CARGO_PKG_VERSION").into(),
            character_name: actor.source.clone(),
            character_hash: actor.content_hash(),
            nominal_samples_per_second: Some(args.rate),
            seed: is_simulated.then_some(args.simulated.seed),
            virtual_clock: args.virtual_clock,
            unix_micros: (!args.virtual_clock).then(settings::unix_micros).flatten(),
            inverse_kinematics: None,
        },
    }
}

fn run_virtually(
    args: &RunArgs,
    performance: Performance,
    plan: &Plan,
    is_simulated: bool,
) -> Result<(Performance, Summary), Failure> {
    let Some(name) = args.device.strip_prefix("sim:").filter(|_| is_simulated) else {
        return Err(Failure::usage("--virtual-clock needs a simulated puppet", "choose a --device sim:…"));
    };
    if plan.seconds.is_none() {
        return Err(Failure::usage("--virtual-clock has no end of its own", "add --seconds N"));
    }
    perform::perform(VirtualPuppet::new(name, &args.simulated, args.rate)?, performance, plan, &mut |_, _| ())
}

fn run_live(
    args: &RunArgs,
    performance: Performance,
    plan: &Plan,
    talk: Talk,
) -> Result<(Performance, Summary), Failure> {
    let device = with_preset(&args.device, args.preset.as_deref())?;
    let eeprom = if args.servo_return_delay_zero { EepromConsent::ReturnDelayZero } else { EepromConsent::Never };
    let mut live = Live::connect_with(&device, &args.simulated, ServoSettings { eeprom, ..ServoSettings::default() })?;
    live.start_when_ready(args.rate);
    live.catch_interrupt();
    tell(talk, std::iter::once(format!("connected to {}; hold the rest pose (Ctrl-C ends)", live.address())));
    let bar = Bar::new(talk, "waiting for the puppet");
    perform::perform(live, performance, plan, &mut |line, done| bar.show(line, done))
}

/// Saves the calibration and, if asked, the mapping.
fn keep(
    args: &RunArgs,
    calibration_path: Option<&Path>,
    calibration: &Calibration,
    mapping: Option<&Mapping>,
) -> Result<(), Failure> {
    if let Some(path) = calibration_path {
        settings::write_calibration(path, calibration)?;
    }
    let save: Option<(&PathBuf, &Mapping)> = args.save_mapping.as_ref().zip(mapping);
    save.map_or(Ok(()), |(path, mapping)| files::write(path, armature_formats::write_mapping(mapping).as_bytes()))
}
