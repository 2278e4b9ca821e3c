//! `armature export`

use std::path::{Path, PathBuf};
use std::sync::Arc;

use armature_formats::motion::{BvhSettings, KeyInterpolation};
use armature_take::{Dress, KeySettings, Take, Timecode};

use crate::characters::{self, Found};
use crate::cli::take_args::{ExportArgs, LengthUnit, RotationOrder};
use crate::engine::recast::{self, Recast};
use crate::failure::Failure;
use crate::takes::exports::{self, Options, Target};
use crate::takes::{edits, receipt};
use crate::terminal::{Bar, Talk, aside, out};
use crate::{files, settings, takes};

/// Writes takes for other programs.
pub fn export(args: &ExportArgs, talk: Talk) -> Result<(), Failure> {
    let work = orders(args)?;
    for (_, to, _) in &work {
        args.overwrite.check(to)?;
    }
    args.receipt.as_deref().map_or(Ok(()), |path| args.overwrite.check(path))?;
    let mut failed = Vec::new();
    for (take, to, target) in &work {
        match one(args, take, to, *target, talk) {
            Err(failure) if work.len() > 1 => {
                aside!("error: {failure}");
                failed.push(failure);
            }
            done => done?,
        }
    }
    match failed.into_iter().next() {
        Some(first) => Err(Failure { what: format!("not every take was exported: {}", first.what), ..first }),
        None => Ok(()),
    }
}

/// Takes, the files they become, and their formats.
fn orders(args: &ExportArgs) -> Result<Vec<(PathBuf, PathBuf, Target)>, Failure> {
    let list = || Target::ALL.map(|(extension, _)| extension).join(", ");
    let of = |extension: &str| {
        Target::of_extension(extension).ok_or_else(|| {
            let what = format!("takes are not exported as {extension:?}");
            Failure::usage(what, format!("the formats are {}", list()))
        })
    };
    if let ([take], false) = (args.take.as_slice(), args.to.is_dir()) {
        let extension = files::extension_of(&args.to);
        let target = of(&extension)?;
        if args.format.as_ref().is_some_and(|format| *format != extension) {
            let what = format!("--format says something else than {}", args.to.display());
            return Err(Failure::usage(what, "leave out --format, or name a folder with --to"));
        }
        return Ok(vec![(take.clone(), args.to.clone(), target)]);
    }
    if !args.to.is_dir() {
        let what = format!("several takes cannot become one file, {}", args.to.display());
        return Err(Failure::usage(what, "name a folder that is there with --to, and say --format"));
    }
    if args.receipt.is_some() && args.take.len() > 1 {
        return Err(Failure::usage("--receipt is for one take", "export the takes one by one, or leave it out"));
    }
    let Some(format) = &args.format else {
        let what = format!("{} is a folder", args.to.display());
        return Err(Failure::usage(what, format!("say --format, one of {}", list())));
    };
    let target = of(format)?;
    let mut work: Vec<(PathBuf, PathBuf, Target)> = Vec::new();
    for take in &args.take {
        let to = args.to.join(take.file_stem().unwrap_or_default()).with_extension(format);
        if let Some((other, ..)) = work.iter().find(|(_, known, _)| *known == to) {
            let what = format!("{} and {} would both become {}", other.display(), take.display(), to.display());
            return Err(Failure::usage(what, "export one of them apart"));
        }
        work.push((take.clone(), to, target));
    }
    Ok(work)
}

fn one(args: &ExportArgs, path: &Path, to: &Path, target: Target, talk: Talk) -> Result<(), Failure> {
    let options = options(args, target)?;
    let bar = Bar::new(talk, "exporting");
    let (take, edited) = if edits::is_list(path) {
        let list = edits::read(path)?;
        let applied = edits::apply(path, &list, args.character.as_deref(), &args.ground, &mut bar.stages())?;
        (applied.take, Some(applied.edited))
    } else {
        (takes::read_and_tell(path)?, None)
    };
    let anew = recast(args, path, &take, &bar)?;
    let is_anew = anew.is_some();
    let (take, anew_notes) = anew.unwrap_or((take, Vec::new()));
    let character = if target.holds_mesh() {
        let found = character_of(&take, path, args, &bar).map_err(|failure| {
            let remedy = "name the character the take was recorded with by --character FILE";
            Failure { remedy: remedy.into(), ..failure }
        })?;
        Some(found.character)
    } else {
        None
    };
    let again = args.ground.ground.is_some() && !is_anew && edited.is_none();
    let take = if again { on_ground(args, path, &take, &bar)? } else { take };
    let exported = exports::export(&take, edited.as_ref(), character.as_ref(), target, &options, &mut bar.stages())
        .map_err(|f| Failure { what: format!("{}: {}", path.display(), f.what), ..f })?;
    args.overwrite.write(to, &exported.bytes)?;
    bar.finish();
    let receipt = armature_take::receipt(&take);
    if let Some(path) = &args.receipt {
        let mut json = receipt::to_json(&receipt);
        json["export"] = exported.to_json();
        args.overwrite.write(path, format!("{json:#}\n").as_bytes())?;
    }
    if !talk.quiet {
        out!("{}: {exported}", to.display());
        if take.samples().next().is_some() {
            out!("receipt: {receipt}");
        }
        anew_notes.iter().for_each(|note| aside!("note: {note}"));
        exported.notes.iter().for_each(|note| aside!("note: {note}"));
    }
    Ok(())
}

/// The take performed anew, if its character or mapping is another one: and what of it could not be kept.
fn recast(args: &ExportArgs, path: &Path, take: &Take, bar: &Bar) -> Result<Option<(Take, Vec<String>)>, Failure> {
    let has_samples = take.samples().next().is_some();
    if args.mapping.is_none() && (args.character.is_none() || !has_samples) {
        return Ok(None);
    }
    let found = character_of(take, path, args, bar)?;
    if args.mapping.is_none() && take.skeleton() == Some(&found.character.skeleton) {
        return Ok(None);
    }
    if edits::is_list(path) {
        let what = format!("{} is an edit list, and its poses are those of its take's own character", path.display());
        return Err(Failure::usage(what, "export the take itself for another character or mapping"));
    }
    let mapping = args.mapping.as_deref().map(settings::read_mapping).transpose()?;
    let cast = Recast { character: Arc::new(found.character), mapping, ground: args.ground.clone() };
    recast::recast(take, &cast, &mut bar.stages()).map(Some)
}

/// The samples solved again with the roots following the feet as chosen.
fn on_ground(args: &ExportArgs, path: &Path, take: &Take, bar: &Bar) -> Result<Take, Failure> {
    let found = character_of(take, path, args, bar)?;
    takes::on_ground(take, &args.ground, &found.character, &mut bar.stages())
}

fn options(args: &ExportArgs, target: Target) -> Result<Options, Failure> {
    let mut options = Options::at(args.fps);
    options.settings.resample.low_pass = args.low_pass;
    if let Some(text) = &args.start_timecode {
        let remedy = "write --start-timecode HH:MM:SS:FF at a rate of film or video, such as --fps 25 or --fps 29.97df";
        let start = Timecode::parse(text, args.fps).map_err(|error| Failure::usage(error.to_string(), remedy))?;
        options.start = Some(start);
    }
    options.dress = Dress { rest: args.rest, rest_first: args.rest_first, names: args.names };
    if target.holds_samples() && options.dress != Dress::default() {
        let what = format!("{} holds the take as it is", target.name());
        return Err(Failure::usage(what, "leave out --rest, --rest-first and --names"));
    }
    if target == Target::Bvh {
        options.bvh = BvhSettings { order: args.rotation_order.axes(), scale: args.unit.of_metre() };
    } else if args.rotation_order != RotationOrder::default() || args.unit != LengthUnit::default() {
        let what = format!("--rotation-order and --unit are for BVH; {} says its own", target.name());
        return Err(Failure::usage(what, "leave them out"));
    }
    options.shapes.clone_from(&args.shapes.shapes);
    if !target.holds_mesh() && !options.shapes.is_empty() {
        let what = format!("{} has no mesh that could have a shape", target.name());
        return Err(Failure::usage(what, "export a .glb, .fbx or .usdz, or leave out --shape"));
    }
    if let Some(degrees) = args.reduce_keys {
        let why = match target {
            Target::Glb => None,
            Target::Bvh => Some("BVH has a value for every frame, so its keys cannot be reduced"),
            Target::Fbx => Some("FBX turns bones by three angles, between which the bound on few keys does not hold"),
            Target::Usda | Target::Usdz => {
                Some("USD has one list of keys for all bones, so its keys cannot be reduced")
            }
            Target::Vrma | Target::Csv | Target::Npz | Target::Mcap => Some("keys are reduced in a GLB alone"),
        };
        if let Some(what) = why {
            return Err(Failure::usage(what, "export a .glb, or leave out --reduce-keys"));
        }
        let interpolation = if args.splines { KeyInterpolation::Cubic } else { KeyInterpolation::Linear };
        let rotation = degrees.to_radians();
        options.settings.keys = Some(KeySettings { interpolation, rotation, feet: args.feet });
    }
    Ok(options)
}

/// The named character, otherwise the one the take was recorded with.
fn character_of(take: &Take, path: &Path, args: &ExportArgs, bar: &Bar) -> Result<Found, Failure> {
    match &args.character {
        Some(source) => characters::find(source, &mut bar.stages()),
        None => characters::find_for_take(path, &take.header().character_name, &mut bar.stages()),
    }
}
