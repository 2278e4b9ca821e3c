//! Takes on disk.

use std::path::Path;

use armature_character::InverseKinematics;
use armature_take::{ReadReport, Take};

use crate::engine::actor::Actor;
use crate::engine::completion::{IkArgs, IkMode};
use crate::failure::Failure;
use crate::files;

/// Reads a take; what is damaged or missing is in the report.
pub fn read(path: &Path) -> Result<(Take, ReadReport), Failure> {
    Take::read(&files::read(path)?).map_err(|e| Failure::input(format!("{}: {e}", path.display()), ""))
}

/// Reads a take and tells the user what is missing in it.
pub fn read_and_tell(path: &Path) -> Result<Take, Failure> {
    let (take, report) = read(path)?;
    for problem in &report.problems {
        eprintln!("note: {}: {problem}", path.display());
    }
    Ok(take)
}

/// What turned bones without a joint while a take was recorded, made anew from its character; `None` if nothing did.
pub fn completion(take: &Take, actor: &Actor) -> Result<Option<InverseKinematics>, Failure> {
    let Some(header) = &take.header().inverse_kinematics else { return Ok(None) };
    if take.header().character_hash != actor.content_hash() {
        let what = format!(
            "the take was recorded with inverse kinematics on another {} than this one, so its poses cannot be solved again",
            actor.name
        );
        return Err(Failure::usage(what, "name the very character it was recorded with by --character"));
    }
    IkArgs { ik: IkMode::On, pin: header.pins.clone(), prefer: header.preferences.clone() }.of_actor(actor)
}
