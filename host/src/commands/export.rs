//! `armature export`

use armature_formats::motion::KeyInterpolation;
use armature_take::{KeySettings, Take, Timecode};

use crate::characters::{self, Found};
use crate::cli::take_args::ExportArgs;
use crate::failure::Failure;
use crate::takes::exports::{self, Options, Target};
use crate::takes::{edits, receipt};
use crate::terminal::{Bar, Talk, aside, out};
use crate::{files, takes};

/// Writes a take as BVH, GLB or FBX.
pub fn export(args: &ExportArgs, talk: Talk) -> Result<(), Failure> {
    let extension = files::extension_of(&args.to);
    let target = Target::of_extension(&extension).ok_or_else(|| {
        let what = format!("takes are not exported as {extension:?}");
        Failure::usage(what, "give --to a name that ends in .bvh, .glb or .fbx")
    })?;
    args.overwrite.check(&args.to)?;
    args.receipt.as_deref().map_or(Ok(()), |path| args.overwrite.check(path))?;
    let options = options(args, target)?;
    let bar = Bar::new(talk, "exporting");
    let (take, edited) = if edits::is_list(&args.take) {
        let list = edits::read(&args.take)?;
        let applied = edits::apply(&args.take, &list, args.character.as_deref(), &mut bar.stages())?;
        (applied.take, Some(applied.edited))
    } else {
        (takes::read_and_tell(&args.take)?, None)
    };
    let character = if target.holds_mesh() {
        let found = character_of(&take, args, &bar).map_err(|failure| {
            let remedy = "name the character the take was recorded with by --character FILE";
            Failure { remedy: remedy.into(), ..failure }
        })?;
        Some(found.character)
    } else {
        None
    };
    let take = if args.ground.ground.is_some() { on_ground(args, &take, &bar)? } else { take };
    let exported = exports::export(&take, edited.as_ref(), character.as_ref(), target, &options, &mut bar.stages())
        .map_err(|f| Failure { what: format!("{}: {}", args.take.display(), f.what), ..f })?;
    args.overwrite.write(&args.to, &exported.bytes)?;
    bar.finish();
    let receipt = armature_take::receipt(&take);
    if let Some(path) = &args.receipt {
        let mut json = receipt::to_json(&receipt);
        json["export"] = exported.to_json();
        args.overwrite.write(path, format!("{json:#}\n").as_bytes())?;
    }
    if !talk.quiet {
        out!("{}: {exported}", args.to.display());
        out!("receipt: {receipt}");
        exported.notes.iter().for_each(|note| aside!("note: {note}"));
    }
    Ok(())
}

/// The samples solved again with the roots following the feet as chosen.
fn on_ground(args: &ExportArgs, take: &Take, bar: &Bar) -> Result<Take, Failure> {
    if edits::is_list(&args.take) {
        let what = format!("{} is an edit list, and --ground solves the samples of a take again", args.take.display());
        return Err(Failure::usage(what, "record the take with --ground, or export the take itself"));
    }
    let found = character_of(take, args, bar)?;
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
    options.shapes.clone_from(&args.shapes.shapes);
    if target == Target::Bvh && !options.shapes.is_empty() {
        return Err(Failure::usage(
            "BVH has no mesh that could have a shape",
            "export a .glb or .fbx, or leave out --shape",
        ));
    }
    if let Some(degrees) = args.reduce_keys {
        let why = match target {
            Target::Glb => None,
            Target::Bvh => Some("BVH has a value for every frame, so its keys cannot be reduced"),
            Target::Fbx => Some("FBX turns bones by three angles, between which the bound on few keys does not hold"),
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
fn character_of(take: &Take, args: &ExportArgs, bar: &Bar) -> Result<Found, Failure> {
    match &args.character {
        Some(source) => characters::find(source, &mut bar.stages()),
        None => characters::find_for_take(&args.take, &take.header().character_name, &mut bar.stages()),
    }
}
