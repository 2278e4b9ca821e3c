//! Edit lists on disk: a text file beside the takes it speaks of.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use armature_character::inverse_kinematics::InverseKinematics;
use armature_rig::PoseCompletion;
use armature_take::{EditError, EditList, Edited, Take, apply_edits, with_ground};

use crate::characters;
use crate::characters::ground::GroundArgs;
use crate::failure::Failure;
use crate::files;
use crate::takes::{check_skeleton, completion};
use crate::terminal::aside;

/// The extension of an edit list.
pub const EXTENSION: &str = "edit";

const TOGETHER: &str = "an edit list lies in the folder of its takes; put them there";

/// A take and what its edits make of it.
#[derive(Debug)]
pub struct EditedTake {
    /// The take as it was recorded.
    pub take: Take,
    /// The take after its edits.
    pub edited: Edited,
}

/// Whether a file is an edit list by its name.
pub fn is_list(path: &Path) -> bool {
    files::extension_of(path) == EXTENSION
}

/// Reads an edit list.
pub fn read(path: &Path) -> Result<EditList, Failure> {
    let bytes = files::read(path)?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        Failure::input(format!("{}, byte {at}: this is not UTF-8 text", path.display()), "choose an edit list")
    })?;
    EditList::read(&text).map_err(|error| Failure::input(format!("{}, {error}", path.display()), ""))
}

/// Applies a list that lies at this path. `character`: which one, if the take's own is not to be looked for; `ground`: how
/// the roots follow the feet, if not as they do in the take.
pub fn apply(
    path: &Path,
    list: &EditList,
    character: Option<&str>,
    ground: &GroundArgs,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<EditedTake, Failure> {
    let beside = path.with_file_name(&list.take);
    let mut take = neighbour(path, &list.take).map_err(|why| {
        let what = format!("{}: its take {:?}: {why}", path.display(), list.take);
        Failure::input(what, TOGETHER)
    })?;
    let completion = if take.inverse_kinematics().is_some() || ground.ground.is_some() {
        let found = match character {
            Some(source) => characters::find(source, progress)?,
            None => characters::find_for_take(&beside, &take.header().character_name, progress)?,
        };
        let completion = completion(&take, &found.character)?;
        if ground.ground.is_some() {
            check_skeleton(&take, &found.character)?;
            take = with_ground(&take, ground.for_character(&found.character, completion.as_ref())?.as_ref());
        }
        completion
    } else {
        None
    };
    let edited = apply_to(path, list, &take, completion, progress)?;
    Ok(EditedTake { take, edited })
}

/// Applies a list that lies at this path to its take, with what turned bones without a joint.
pub fn apply_to(
    path: &Path,
    list: &EditList,
    take: &Take,
    mut completion: Option<InverseKinematics>,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Edited, Failure> {
    let completion = completion.as_mut().map(|ik| ik as &mut dyn PoseCompletion);
    let other = |name: &str| neighbour(path, name).map(Arc::new).map_err(|why| format!("{name:?}: {why}"));
    apply_edits(list, take, &other, completion, progress).map_err(|error| {
        let remedy = if matches!(error, EditError::Take { .. }) { TOGETHER } else { "" };
        Failure::input(format!("{}: {error}", path.display()), remedy)
    })
}

/// A take in the folder of a list.
fn neighbour(list: &Path, name: &str) -> Result<Take, String> {
    let (take, report) = Take::read(&files::neighbours(list)(name)?).map_err(|error| error.to_string())?;
    report.problems.iter().for_each(|problem| aside!("note: {name}: {problem}"));
    Ok(take)
}
