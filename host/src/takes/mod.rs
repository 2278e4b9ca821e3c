//! Takes on disk, and as files for other programs.

pub mod edits;
pub mod exports;
pub mod library;
pub mod motions;
pub mod opened;
pub mod orders;
pub mod receipt;

use std::io::BufWriter;
use std::path::{Path, PathBuf};

use armature_character::Progress;
use armature_character::inverse_kinematics::{IkSettings, InverseKinematics};
use armature_rig::PoseCompletion;
use armature_take::{ReadReport, Take, solve_on_ground};

use crate::characters::LoadedCharacter;
use crate::characters::ground::GroundArgs;
use crate::characters::inverse_kinematics::{IkArgs, IkMode};
use crate::failure::Failure;
use crate::files::{self, GrowingFile, Overwrite};
use crate::terminal::aside;

/// Reads a take; damaged and missing parts are in the report.
pub fn read(path: &Path) -> Result<(Take, ReadReport), Failure> {
    Take::read(&files::read(path)?).map_err(|e| Failure::input(format!("{}: {e}", path.display()), ""))
}

/// Reads a take, or a motion file as one, and reports what is missing from it.
pub fn read_and_tell(path: &Path) -> Result<Take, Failure> {
    if motions::is_motion(path) {
        return motions::read_as_take(path);
    }
    let (take, report) = read(path)?;
    for problem in &report.problems {
        aside!("note: {}: {problem}", path.display());
    }
    Ok(take)
}

/// What turned bones without a joint while a take was recorded, rebuilt from its character; `None` if nothing did.
pub fn completion(take: &Take, character: &LoadedCharacter) -> Result<Option<InverseKinematics>, Failure> {
    let Some(header) = take.inverse_kinematics() else { return Ok(None) };
    if take.header().character_hash != character.content_hash() {
        let what = format!(
            "the take was recorded with inverse kinematics on another {} than this one, so its poses cannot be solved again",
            character.name
        );
        return Err(Failure::usage(what, "give the exact character it was recorded with by --character"));
    }
    // The limits are those of the take, whatever a human has today.
    let limit = std::iter::once("off".to_owned()).chain(header.limits.iter().cloned()).collect();
    let (pin, prefer) = (header.pins.clone(), header.preferences.clone());
    let recorded = IkSettings::from_words(&header.settings).map_err(|e| {
        Failure::input(format!("the take was recorded with what a newer program can do: {e}"), "use that program")
    })?;
    IkArgs { ik: IkMode::On, pin, prefer, limit, recorded: Some(recorded), ..IkArgs::default() }
        .for_character(character)
}

/// Whether a take was recorded on this character's skeleton.
fn check_skeleton(take: &Take, character: &LoadedCharacter) -> Result<(), Failure> {
    if take.skeleton() == Some(&character.skeleton) {
        return Ok(());
    }
    let what = format!("the take was recorded on another skeleton than that of {}", character.name);
    Err(Failure::usage(what, "name the character it was recorded with by --character"))
}

/// The take solved again with its roots following the feet as chosen.
pub fn on_ground(
    take: &Take,
    choice: &GroundArgs,
    character: &LoadedCharacter,
    progress: Progress<'_>,
) -> Result<Take, Failure> {
    check_skeleton(take, character)?;
    let mut completion = completion(take, character)?;
    let ground = choice.for_character(character, completion.as_ref())?;
    let completion = completion.as_mut().map(|ik| ik as &mut dyn PoseCompletion);
    solve_on_ground(take, ground.as_ref(), completion, progress).map_err(|e| Failure::input(e.to_string(), ""))
}

/// Opens a file for a new take. One that is to be replaced stays until the new one is complete.
pub fn create(path: &Path, overwrite: Overwrite) -> Result<BufWriter<GrowingFile>, Failure> {
    overwrite.create(path).map(BufWriter::new)
}

/// The first of `NAME.take`, `NAME-2.take`, … that does not exist yet.
pub fn free_name(folder: &Path, name: &str) -> PathBuf {
    let candidate = |n: u32| folder.join(if n < 2 { format!("{name}.take") } else { format!("{name}-{n}.take") });
    (1..u32::MAX).map(candidate).find(|path| !path.exists()).unwrap_or_else(|| candidate(0))
}
