//! A take's samples solved again for another character, or with another mapping: the puppet performs once more.

use std::sync::Arc;

use armature_character::Progress;
use armature_character::inverse_kinematics::IkSettings;
use armature_rig::{GroundMode, Mapping, Skeleton, Target, TargetChange, TargetPoint};
use armature_take::{Header, Record, Take};
use glam::{Quat, Vec3};

use super::puppeteer::{Puppeteer, Step, ZeroPolicy};
use super::take_recorder::{TakeRecorder, take_header};
use crate::characters::LoadedCharacter;
use crate::characters::ground::{GroundArgs, GroundChoice};
use crate::characters::inverse_kinematics::{IkArgs, IkMode};
use crate::characters::shapes::ShapeWeight;
use crate::failure::Failure;

/// Records between two calls of the progress callback.
const STRIDE: usize = 256;

/// Who performs, and how.
#[derive(Clone, Debug)]
pub struct Recast {
    /// The character.
    pub character: Arc<LoadedCharacter>,
    /// Which joint drives which bone; `None`: as in the take where the skeleton is the same, otherwise proposed.
    pub mapping: Option<Mapping>,
    /// How the roots follow the feet; where it says nothing, as in the take.
    pub ground: GroundArgs,
}

/// Lets the puppet of a take move a character again, and says what of the take could not be kept. Readings, calibration and
/// events are those of the take; poses, and what completes them, are new. Pins and preferences of bones that the character
/// has are kept; a character with another skeleton has its own limits.
pub fn recast(take: &Take, cast: &Recast, progress: Progress<'_>) -> Result<(Take, Vec<String>), Failure> {
    let mut notes = Vec::new();
    let former = take.skeleton().ok_or_else(|| {
        Failure::input(
            "the take holds no skeleton",
            "record it with a character; `armature inspect` says what it holds",
        )
    })?;
    let is_same = *former == cast.character.skeleton;
    let mapping = cast.mapping.clone().or_else(|| mapping_of(take).filter(|_| is_same));
    let ground = if cast.ground.ground.is_some() { cast.ground.clone() } else { ground_of(take) };
    let ik = ik_of(take, cast, is_same, &mut notes);
    let calibration = armature_rig::Calibration::default();
    let mut puppeteer = Puppeteer::new(cast.character.clone(), mapping, calibration, ZeroPolicy::OnRequest)?
        .with_inverse_kinematics(&ik)?
        .with_ground(&ground)?;
    if take.dynamics().is_some() {
        notes.push("bones that swing in the take do not swing here".into());
    }
    let from = take.header();
    let rate = from.nominal_samples_per_second.unwrap_or_default();
    let header = Header {
        nominal_samples_per_second: from.nominal_samples_per_second,
        seed: from.seed,
        virtual_clock: from.virtual_clock,
        unix_micros: from.unix_micros,
        ..take_header(&cast.character, rate)
    };
    let mut recorder: Option<TakeRecorder<Vec<u8>>> = None;
    let count = take.records().len();
    for (index, record) in take.records().iter().enumerate() {
        match record {
            Record::Topology(topology) => {
                puppeteer.set_topology(topology.epoch, topology.tree.clone(), progress);
                recorder.iter_mut().try_for_each(|recorder| recorder.topology(&puppeteer))?;
            }
            Record::Calibration(calibration) => {
                puppeteer.set_calibration(calibration.clone());
                recorder.iter_mut().try_for_each(|recorder| recorder.calibration(&puppeteer))?;
            }
            Record::Engagement { all: true, .. } => {
                puppeteer.engage_all();
                recorder.iter_mut().try_for_each(|recorder| recorder.engagement(true))?;
            }
            Record::Event(event) => {
                recorder.iter_mut().try_for_each(|recorder| recorder.event(event.kind.clone()))?;
            }
            Record::Target(change) => match moved_over(change, former, &cast.character.skeleton, is_same) {
                Ok(change) => puppeteer.change_target(change)?,
                Err(note) => notes.push(note),
            },
            Record::Shape(setting) => {
                let shape = ShapeWeight { name: setting.name.clone(), weight: setting.weight };
                match puppeteer.set_shape(&shape) {
                    Ok(()) => recorder.iter_mut().try_for_each(|r| r.shape(&shape.name, shape.weight))?,
                    Err(failure) => notes.push(failure.what),
                }
            }
            Record::Sample(sample) => {
                let recorder = match &mut recorder {
                    Some(recorder) => recorder,
                    None => recorder.insert(TakeRecorder::begin(Vec::new(), "the take", &header, &mut puppeteer)?),
                };
                let step = puppeteer.follow(&sample.raw)?;
                if step != Step::Ignored {
                    recorder.step(&sample.raw, &step, &puppeteer, sample.host_receive_seconds)?;
                }
            }
            Record::Skeleton(_)
            | Record::Mapping(_)
            | Record::Pose(_)
            | Record::Engagement { .. }
            | Record::ReadingsReturn { .. }
            | Record::Ground(_)
            | Record::Dynamics(_)
            | Record::InverseKinematics(_) => {}
        }
        if index.is_multiple_of(STRIDE) && progress("solving again", index as f64 / count as f64).is_break() {
            return Err(Failure::usage("solving the take again was cancelled", ""));
        }
    }
    let none = || Failure::input("the take holds no samples that could be solved again", "record it with a puppet");
    let (bytes, recorded) = recorder.ok_or_else(none)?.finish()?;
    if recorded.samples == 0 {
        return Err(none());
    }
    let (solved, _) = Take::read(&bytes).map_err(|error| Failure::input(error.to_string(), ""))?;
    notes.sort();
    notes.dedup();
    Ok((solved, notes))
}

fn mapping_of(take: &Take) -> Option<Mapping> {
    take.records().iter().rev().find_map(|record| match record {
        Record::Mapping(mapping) => Some(mapping.clone()),
        _ => None,
    })
}

fn ground_of(take: &Take) -> GroundArgs {
    let choice = |mode| match mode {
        GroundMode::Stand => GroundChoice::Stand,
        GroundMode::Walk => GroundChoice::Walk,
    };
    GroundArgs { ground: take.ground().map(|ground| choice(ground.mode)), ..GroundArgs::default() }
}

/// What completed the poses of the take, for another character.
fn ik_of(take: &Take, cast: &Recast, is_same: bool, notes: &mut Vec<String>) -> IkArgs {
    let Some(header) = take.inverse_kinematics() else { return IkArgs::default() };
    let mut known = |words: &[String]| -> Vec<String> {
        // The name of a bone may have colons, and so have the words after it.
        let has_bone = |text: &str| {
            let ends = text.match_indices(':').map(|(end, _)| end).chain([text.len()]);
            ends.map(|end| &text[..end]).any(|name| cast.character.skeleton.find(name).is_some())
        };
        let (kept, left): (Vec<String>, Vec<String>) = words.iter().cloned().partition(|text| has_bone(text));
        notes.extend(left.iter().map(|text| format!("{} has no bone for {text}", cast.character.name)));
        kept
    };
    let (pin, prefer) = (known(&header.pins), known(&header.preferences));
    // A pin of the root alone is what there is without any.
    let roots = cast.character.skeleton.bones().iter().filter(|bone| bone.parent.is_none());
    let is_root = |pin: &String| roots.clone().any(|root| *pin == format!("{}:fixed", root.name));
    let pin = if pin.iter().all(is_root) { Vec::new() } else { pin };
    let limit = if is_same { std::iter::once("off".into()).chain(header.limits.clone()).collect() } else { Vec::new() };
    // Another character is solved as is usual.
    let recorded = IkSettings::from_words(&header.settings).map_err(|error| notes.push(error.to_string()));
    let recorded = recorded.ok().filter(|_| is_same);
    IkArgs { ik: IkMode::Auto, pin, prefer, limit, recorded, ..IkArgs::default() }
}

/// A target of one skeleton for another: the same bone by its name, its place by the size of the two, its orientation as a
/// turn from rest.
fn moved_over(change: &TargetChange, from: &Skeleton, to: &Skeleton, is_same: bool) -> Result<TargetChange, String> {
    let name = change.point().name(from);
    let bone = |bone: usize| {
        let found = from.bones().get(bone).and_then(|bone| to.find(&bone.name));
        found.ok_or_else(|| format!("{name} is not dragged: there is no such bone"))
    };
    let point = match change.point() {
        TargetPoint::Head(index) => TargetPoint::Head(bone(index)?),
        TargetPoint::Tail(index) => TargetPoint::Tail(bone(index)?),
        point @ TargetPoint::Skin { .. } if is_same => point,
        TargetPoint::Skin { .. } => return Err(format!("{name} is not dragged: it is a point of another skin")),
    };
    Ok(match *change {
        TargetChange::Release { over_micros, .. } => TargetChange::Release { point, over_micros },
        TargetChange::Set { target, over_micros } if is_same => TargetChange::Set { target, over_micros },
        TargetChange::Set { target, over_micros } => {
            let (heads_from, heads_to) = (from.rest_segments(), to.rest_segments());
            let scale = size(to) / size(from);
            let start = |segments: &[(Vec3, Vec3)]| segments.first().map_or(Vec3::ZERO, |(head, _)| *head);
            let position = target.position.map(|at| start(&heads_to) + (at - start(&heads_from)) * scale);
            let rest = |skeleton: &Skeleton, point: TargetPoint| match point {
                TargetPoint::Head(bone) | TargetPoint::Tail(bone) => {
                    skeleton.rest_model_from_bone()[bone].to_scale_rotation_translation().1
                }
                TargetPoint::Skin { .. } => Quat::IDENTITY,
            };
            let turned = |turn: Quat| (turn * rest(from, target.point).inverse() * rest(to, point)).normalize();
            let orientation = target.orientation.map(turned);
            TargetChange::Set { target: Target { point, position, orientation, ..target }, over_micros }
        }
    })
}

/// From the lowest to the highest end of a bone at rest.
fn size(skeleton: &Skeleton) -> f32 {
    let ends = skeleton.rest_segments().into_iter().flat_map(|(head, tail)| [head.y, tail.y]);
    let (low, high) = ends.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), y| (low.min(y), high.max(y)));
    if high - low > f32::MIN_POSITIVE { high - low } else { 1.0 }
}
