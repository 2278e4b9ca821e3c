//! `armature export`

use armature_take::{ExportSettings, ResampleSettings};

use crate::characters;
use crate::cli::args::ExportArgs;
use crate::exports::{self, Target};
use crate::failure::Failure;
use crate::talk::{Bar, Talk};
use crate::{files, takes};

/// Writes a take as BVH or GLB.
pub fn export(args: &ExportArgs, talk: Talk) -> Result<(), Failure> {
    let target = match files::extension_of(&args.to).as_str() {
        "bvh" => Target::Bvh,
        "glb" => Target::Glb,
        other => {
            let what = format!("takes are not exported as {other:?}");
            return Err(Failure::usage(what, "end the name after --to in .bvh or .glb"));
        }
    };
    let take = takes::read_and_tell(&args.take)?;
    let resample = ResampleSettings { frames_per_second: args.fps, ..ResampleSettings::default() };
    let settings = ExportSettings { resample, ..ExportSettings::default() };
    let bar = Bar::new(talk, "exporting");
    let source = args.character.clone().unwrap_or_else(|| take.header().character_name.clone());
    let actor = match target {
        Target::Bvh => None,
        Target::Glb => match characters::find(&source, &mut bar.binding()) {
            Ok(found) => Some(found.actor),
            Err(failure) => {
                let remedy = "name the character the take was recorded with by --character FILE";
                return Err(Failure { remedy: remedy.into(), ..failure });
            }
        },
    };
    let exported = exports::export(&take, actor.as_ref(), target, &settings, &mut bar.fraction("exporting"))
        .map_err(|f| Failure { what: format!("{}: {}", args.take.display(), f.what), ..f })?;
    files::write(&args.to, &exported.bytes)?;
    bar.finish();
    if !talk.quiet {
        println!("{}: {exported}", args.to.display());
        exported.notes.iter().for_each(|note| eprintln!("note: {note}"));
    }
    Ok(())
}
