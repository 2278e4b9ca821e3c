//! `armature retarget`

use std::path::Path;

use armature_rig::{Motion, RetargetError, RetargetReport, RetargetSettings};
use armature_take::{ExportSettings, FrameRate, Header, edited_motion, motion_take, take_motion};

use crate::characters::ground::GroundArgs;
use crate::cli::take_args::RetargetArgs;
use crate::failure::Failure;
use crate::takes::exports::{self, Options, Target};
use crate::takes::{self, edits, motions};
use crate::terminal::{Bar, Talk, aside, counted, out};
use crate::{characters, files};

/// Frames a second of a take that is retargeted, which has no rate of its own, unless --fps says another.
const TAKE_RATE: u32 = 60;
/// Most names in a list that is printed.
const NAMES: usize = 12;

/// Moves a character as a motion moves.
pub fn retarget(args: &RetargetArgs, talk: Talk) -> Result<(), Failure> {
    let extension = files::extension_of(&args.output);
    let target = Target::of_extension(&extension);
    if target.is_none() && extension != "take" {
        let list = Target::ALL.map(|(extension, _)| extension).join(", ");
        let what = format!("motions are not written as {extension:?}");
        return Err(Failure::usage(what, format!("the formats are take, {list}")));
    }
    args.overwrite.check(&args.output)?;
    let bar = Bar::new(talk, "retargeting");
    let source = source(args, &bar)?;
    let found = characters::find(&args.character, &mut bar.stages())?;
    let settings = RetargetSettings { contacts: !args.no_contacts, scale: args.scale };
    let moved = armature_rig::retarget(&source, &found.character.skeleton, &settings, &mut bar.stages())
        .map_err(|error| failure(&args.motion, &error))?;
    let header = Header {
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        character_name: characters::name_in_takes(&found.character.source),
        character_hash: found.character.content_hash(),
        ..Header::default()
    };
    let take = motion_take(&moved.motion, &header).map_err(|e| Failure::input(e.to_string(), ""))?;
    let mut notes = Vec::new();
    let written = if let Some(target) = target {
        let rate = args.fps.or_else(|| motions::rate_of(moved.motion.frame_seconds)).ok_or_else(|| {
            let what = format!("a frame of {} lasts {} s", args.motion.display(), moved.motion.frame_seconds);
            Failure::usage(what, "say the rate of the file that is written by --fps")
        })?;
        let character = Some(&found.character);
        let exported = exports::export(&take, None, character, target, &Options::at(rate), &mut bar.stages())?;
        args.overwrite.write(&args.output, &exported.bytes)?;
        notes.extend(exported.notes.iter().cloned());
        exported.to_string()
    } else {
        let mut bytes = Vec::new();
        take.write(&mut bytes).map_err(|e| Failure::input(e.to_string(), ""))?;
        args.overwrite.write(&args.output, &bytes)?;
        counted(moved.motion.frames.len(), "pose", "poses")
    };
    bar.finish();
    if !talk.quiet {
        out!("{}: {written}", args.output.display());
        tell(&moved.report, moved.motion.skeleton.len());
        notes.iter().for_each(|note| aside!("note: {note}"));
    }
    Ok(())
}

/// What moves, at the rate that was asked for.
fn source(args: &RetargetArgs, bar: &Bar) -> Result<Motion, Failure> {
    let path = &args.motion;
    if motions::is_motion(path) {
        return motions::read(path, args.clip.as_deref());
    }
    if args.clip.is_some() {
        return Err(Failure::usage("a take has no clips", "leave out --clip"));
    }
    let rate = args.fps.or_else(|| FrameRate::whole(TAKE_RATE));
    let mut settings = ExportSettings::default();
    settings.resample.frames_per_second = rate.map_or(f64::from(TAKE_RATE), FrameRate::frames_per_second);
    let motion = if edits::is_list(path) {
        let applied = edits::apply(path, &edits::read(path)?, None, &GroundArgs::default(), &mut bar.stages())?;
        edited_motion(&applied.edited, &settings.resample, &mut bar.stages())
    } else {
        take_motion(&takes::read_and_tell(path)?, &settings, &mut bar.stages())
    };
    let motion = motion.map_err(|e| Failure::input(format!("{}: {e}", path.display()), "choose a take with poses"))?;
    Ok(motion.resampled.motion)
}

fn failure(path: &Path, error: &RetargetError) -> Failure {
    let what = format!("{}: {error}", path.display());
    match error {
        RetargetError::TooFewPairs { .. } | RetargetError::OtherFigure { .. } => {
            Failure::input(what, "`armature inspect` says of a skeleton which bones were recognised")
        }
        RetargetError::BadScale(_) => Failure::usage(what, ""),
        _ => Failure::input(what, ""),
    }
}

/// What was done, for people.
fn tell(report: &RetargetReport, bones: usize) {
    let moved = bones - report.following.len();
    out!(
        "{moved} of {} moved, the way scaled by {:.3}, {}",
        counted(bones, "bone", "bones"),
        report.scale,
        match report.contacts {
            0 => "no foot kept in place".to_owned(),
            contacts => format!("feet kept in place {}", counted(contacts, "time", "times")),
        }
    );
    if report.missed > 0.0 && report.contacts > 0 {
        out!("feet that stand are off their places by {:.2e} at most", report.missed);
    }
    let listed = |names: &[String]| {
        let more = names.len().saturating_sub(NAMES);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        format!("{}{more}", names.iter().take(NAMES).cloned().collect::<Vec<_>>().join(", "))
    };
    if !report.following.is_empty() {
        aside!("note: nothing in the motion moves {}: they follow the bones above", listed(&report.following));
    }
    if !report.unused.is_empty() {
        aside!("note: bones of the motion that move nothing of the character: {}", listed(&report.unused));
    }
    report.notes.iter().for_each(|note| aside!("note: {note}"));
}
