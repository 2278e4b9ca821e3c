//! `armature replay`

use std::path::Path;

use armature_rig::{PoseCompletion, Skeleton};
use armature_take::{PackedPose, Take, Timeline, Tolerance, compare, solve_again, verify_completed};
use glam::Vec3A;

use crate::characters::LoadedCharacter;
use crate::cli::take_args::ReplayArgs;
use crate::failure::Failure;
use crate::terminal::{Bar, Talk, counted, out};
use crate::{characters, pictures, takes};

/// Solves a take again and compares with the recorded poses; draws a moment of it if asked.
pub fn replay(args: &ReplayArgs, talk: Talk) -> Result<(), Failure> {
    args.picture.iter().chain(&args.filmstrip).try_for_each(|path| args.overwrite.check(path))?;
    let take = takes::read_and_tell(&args.take)?;
    if let Some(at) = args.at {
        check_moment(&take, args, at)?;
    } else if args.filmstrip.is_none() && (!args.shapes.shapes.is_empty() || args.skin.skin.is_some()) {
        let option = if args.shapes.shapes.is_empty() { "--skin" } else { "--shape" };
        return Err(Failure::usage(format!("{option} is for the picture"), "add --at and --picture, or --filmstrip"));
    }
    args.between.iter().flatten().try_for_each(|&at| check_moment(&take, args, at))?;
    if take.samples().next().is_none() && take.poses().next().is_some() {
        return without_samples(args, &take, talk);
    }
    if args.ground.ground.is_some() {
        return stand(args, &take, talk);
    }
    let mut completion = match take.inverse_kinematics() {
        Some(_) => takes::completion(&take, &character_of(&take, args, talk)?)?,
        None => None,
    };
    let bar = Bar::new(talk, "solving again");
    let completion = completion.as_mut().map(|ik| ik as &mut dyn PoseCompletion);
    if let Some(expected) = &args.verify {
        let (poses, _) = solve_again(&take, completion, &mut bar.stages())
            .map_err(|e| Failure::input(format!("{}: {e}", args.take.display()), ""))?;
        bar.finish();
        draw(&take, args, talk)?;
        return compare_with(&take, &poses, expected, args);
    }
    let verification = verify_completed(&take, completion, &mut bar.stages())
        .map_err(|e| Failure::input(format!("{}: {e}", args.take.display()), ""))?;
    bar.finish();
    draw(&take, args, talk)?;
    let name = args.take.display();
    if verification.is_exact() {
        out!("{name}: {} poses solved again, all the same to the last bit", verification.identical);
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

/// A motion that was retargeted, or that another program made, has poses alone: they are drawn, not solved again.
fn without_samples(args: &ReplayArgs, take: &Take, talk: Talk) -> Result<(), Failure> {
    if args.verify.is_none() && (args.picture.is_some() || args.filmstrip.is_some()) {
        return draw(take, args, talk);
    }
    let what = format!("{} has poses but no samples, so there is nothing to solve again", args.take.display());
    Err(Failure::input(what, "export it, or play it in the window"))
}

/// Solves the samples again with the roots following the feet as chosen, and says what came of it.
fn stand(args: &ReplayArgs, take: &Take, talk: Talk) -> Result<(), Failure> {
    let character = character_of(take, args, talk)?;
    let bar = Bar::new(talk, "solving again");
    let take = takes::on_ground(take, &args.ground, &character, &mut bar.stages())?;
    bar.finish();
    draw(&take, args, talk)?;
    if let Some(expected) = &args.verify {
        let poses: Vec<PackedPose> = take.poses().cloned().collect();
        return compare_with(&take, &poses, expected, args);
    }
    let counted = counted(take.poses().count(), "pose", "poses");
    out!("{}: {counted} solved again, not as recorded but with --ground", args.take.display());
    Ok(())
}

/// Compares what was solved with the poses of another take.
fn compare_with(take: &Take, poses: &[PackedPose], expected: &Path, args: &ReplayArgs) -> Result<(), Failure> {
    let (name, other) = (args.take.display(), expected.display());
    let expected = takes::read_and_tell(expected)?;
    let angle = args.tolerance.unwrap_or(0.0).to_radians();
    let tolerance = Tolerance { angle, distance: angle * take.skeleton().map_or(0.0, size) };
    let compared = compare(take, poses, &expected, tolerance)
        .map_err(|e| Failure::input(format!("{name} and {other}: {e}"), ""))?;
    let within = args.tolerance.map_or_else(|| "to the last bit".into(), |degrees| format!("within {degrees}°"));
    if compared.agrees() {
        let most = compared.largest_angle.to_degrees();
        let most =
            if args.tolerance.is_some() { format!("; the largest angle is {most:.2e}°") } else { String::new() };
        out!("{name}: {} poses solved again, all as in {other} {within}{most}", compared.equal);
        return Ok(());
    }
    let what = format!(
        "{name}: of the poses in {other} {} came out the same {within}, {} differ, {} are missing, and {} more are not in it",
        compared.equal, compared.different, compared.missing, compared.unexpected
    );
    let remedy = match &compared.first {
        Some(first) => {
            let joint = first.joint.as_ref().map_or_else(|| "no joint".into(), |part| format!("joint {part}"));
            format!(
                "the first difference is at {:.3} s (sample {}), bone {:?} ({joint}): {:.6}° and a distance of {:.3e}",
                first.seconds,
                first.sequence,
                first.bone,
                first.angle.to_degrees(),
                first.distance
            )
        }
        None => "the takes are not of the same samples; record the expected one again from this one".to_string(),
    };
    Err(Failure::not_converged(what, remedy))
}

/// The skeleton's size in its rest pose.
fn size(skeleton: &Skeleton) -> f64 {
    let heads = skeleton.rest_model_from_bone().into_iter().map(|frame| frame.translation);
    let (low, high) =
        heads.fold((Vec3A::INFINITY, Vec3A::NEG_INFINITY), |(low, high), head| (low.min(head), high.max(head)));
    if skeleton.is_empty() { 0.0 } else { f64::from((high - low).length()) }
}

/// The character that the take was recorded with, or the one named.
fn character_of(take: &Take, args: &ReplayArgs, talk: Talk) -> Result<LoadedCharacter, Failure> {
    let bar = Bar::new(talk, "loading the character");
    let recorded = &take.header().character_name;
    let found = match &args.character {
        Some(source) => characters::find(source, &mut bar.stages())?,
        None => characters::find_for_take(&args.take, recorded, &mut bar.stages())?,
    };
    let found = args.skin.apply(found, &mut bar.stages())?;
    bar.finish();
    if take.skeleton() != Some(&found.character.skeleton) {
        let source = &found.character.source;
        let what = format!("{} was recorded on another skeleton than that of {source:?}", args.take.display());
        return Err(Failure::usage(what, format!("give --character the one it was recorded with ({recorded:?})")));
    }
    Ok(found.character)
}

/// A moment that is not in the take would be drawn as its nearest end.
fn check_moment(take: &Take, args: &ReplayArgs, at: f64) -> Result<(), Failure> {
    let span = Timeline::recorded(take).and_then(|timeline| timeline.span_seconds());
    match span {
        Some((first, last)) if !(first..=last).contains(&at) => Err(Failure::usage(
            format!("{} goes from {first:.3} s to {last:.3} s, and there is nothing at {at} s", args.take.display()),
            "choose a moment within it for --at",
        )),
        _ => Ok(()),
    }
}

/// The picture and the filmstrip that were asked for.
fn draw(take: &Take, args: &ReplayArgs, talk: Talk) -> Result<(), Failure> {
    if args.picture.is_none() && args.filmstrip.is_none() {
        return Ok(());
    }
    let character = character_of(take, args, talk)?;
    let none = || Failure::input(format!("{} holds no pose", args.take.display()), "record it again");
    let timeline = Timeline::recorded(take).ok_or_else(none)?;
    let skinned = |at: f64| {
        let (_, packed) = timeline.get(timeline.at(at)).ok_or_else(none)?;
        pictures::skin_once(&character, &take.unpack(packed), &args.shapes.shapes)
    };
    if let (Some(path), Some(at)) = (&args.picture, args.at) {
        let (positions, normals) = skinned(at)?;
        let by = pictures::write_picture(args.overwrite, path, &character, &positions, &normals)?;
        out!("{}: {by}", path.display());
    }
    if let Some(path) = &args.filmstrip {
        let (first, last) = match args.between.as_deref() {
            Some(&[from, to]) if from < to => (from, to),
            Some(_) => return Err(Failure::usage("--between goes backwards", "give the earlier moment first")),
            None => timeline.span_seconds().ok_or_else(none)?,
        };
        let steps = f64::from(args.moments - 1);
        let moments = (0..args.moments).map(|moment| skinned(first + (last - first) * f64::from(moment) / steps));
        let floor = take.ground().map(|ground| ground.floor);
        let moments = moments.collect::<Result<Vec<_>, _>>()?;
        let by = pictures::write_filmstrip(args.overwrite, path, &character, &moments, floor)?;
        out!("{}: {} moments from {first:.2} s to {last:.2} s, {by}", path.display(), args.moments);
    }
    Ok(())
}
