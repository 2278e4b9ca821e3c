//! `armature replay`

use armature_rig::PoseCompletion;
use armature_take::{Take, Timeline, verify_completed};

use crate::cli::args::ReplayArgs;
use crate::engine::actor::Actor;
use crate::failure::Failure;
use crate::talk::{Bar, Talk};
use crate::{characters, pictures, takes};

/// Solves a take again and compares with the recorded poses; draws a moment of it if asked.
pub fn replay(args: &ReplayArgs, talk: Talk) -> Result<(), Failure> {
    let take = takes::read_and_tell(&args.take)?;
    let mut completion = match &take.header().inverse_kinematics {
        Some(_) => takes::completion(&take, &character_of(&take, args, talk)?)?,
        None => None,
    };
    let bar = Bar::new(talk, "solving again");
    let completion = completion.as_mut().map(|ik| ik as &mut dyn PoseCompletion);
    let verification = verify_completed(&take, completion, &mut bar.fraction("solving again"))
        .map_err(|e| Failure::input(format!("{}: {e}", args.take.display()), ""))?;
    bar.finish();
    if let (Some(path), Some(at)) = (&args.picture, args.at) {
        draw(&take, args, at, path, talk)?;
    }
    let name = args.take.display();
    if verification.is_exact() {
        println!("{name}: {} poses solved again, all the same to the last bit", verification.identical);
        return Ok(());
    }
    let what = format!(
        "{name}: of the recorded poses {} came out the same, {} differ, {} have no sample",
        verification.identical, verification.different, verification.without_sample
    );
    let remedy = match &verification.first_difference {
        Some(first) => format!(
            "the first difference is at sample {}, bone {:?}: recorded {:?}, solved {:?}; another version of the program may have recorded it",
            first.sequence, first.bone_name, first.recorded.rotation, first.solved.rotation
        ),
        None => "the take holds no pose; record it again".to_string(),
    };
    Err(Failure::not_converged(what, remedy))
}

/// The character that the take was recorded with, or the one named.
fn character_of(take: &Take, args: &ReplayArgs, talk: Talk) -> Result<Actor, Failure> {
    let bar = Bar::new(talk, "loading the character");
    let source = args.character.clone().unwrap_or_else(|| take.header().character_name.clone());
    let found = characters::find(&source, &mut bar.binding())?;
    bar.finish();
    if take.skeleton() != Some(&found.actor.skeleton) {
        let what = format!("{} was recorded on another skeleton than that of {source:?}", args.take.display());
        return Err(Failure::usage(
            what,
            format!("give --character the one it was recorded with ({:?})", take.header().character_name),
        ));
    }
    Ok(found.actor)
}

fn draw(take: &Take, args: &ReplayArgs, at: f64, path: &std::path::Path, talk: Talk) -> Result<(), Failure> {
    let actor = character_of(take, args, talk)?;
    let timeline = Timeline::recorded(take)
        .ok_or_else(|| Failure::input(format!("{} holds no pose", args.take.display()), "record it again"))?;
    let (_, packed) = timeline
        .get(timeline.at(at))
        .ok_or_else(|| Failure::input(format!("{} holds no pose", args.take.display()), "record it again"))?;
    let (positions, normals) = pictures::skin_once(&actor, &take.unpack(packed))?;
    let by = pictures::write_picture(path, &actor, &positions, &normals)?;
    println!("{}: {by}", path.display());
    Ok(())
}
