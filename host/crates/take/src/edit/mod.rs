//! Edits without loss: a text file beside takes says what is done to them ([`EditList`]), and [`apply_edits`] does it.
//! Takes are only read, so every edit can be taken back by deleting it.
//!
//! Edits are applied in order. [`Edit::Overdub`] and [`Edit::Filter`] solve samples again and so come first; all others
//! change the poses that came of them.

mod layers;
mod list;
mod mirror;
mod performance;
mod solve;
mod timing;

use std::ops::ControlFlow;

use armature_rig::{
    BoneQuality, BoneStatus, Filter, Pose, PoseCompletion, Skeleton, SpringBones, Standing, TargetError,
};

use self::mirror::Mirror;
use self::performance::{Performance, chosen, micros};
use self::solve::{Driven, Layer, Solved, Unsolved, layer_micros, solve_layers};
use crate::file::{PackedPose, Record, Take};
use crate::replay::Completed;
use crate::shapes::ShapeTrack;
use crate::time::{ResampleError, ResampleSettings, Resampled, Timeline, resample};

pub use self::list::{Edit, EditList, EditListError};

/// Most bone transforms that repeating may make, poses times bones: 0.8 GB.
const MOST_TRANSFORMS: usize = 20_000_000;

/// Why edits cannot be applied.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EditError {
    /// Another take cannot be read.
    #[error("edit {edit}: {why}")]
    Take {
        /// One-based.
        edit: usize,
        /// What is wrong with it.
        why: String,
    },
    /// A take has no skeleton.
    #[error("the take {take:?} holds no skeleton; record it with a character")]
    NoSkeleton {
        /// Its file.
        take: String,
    },
    /// The takes are of different characters.
    #[error("edit {edit}: {take:?} was recorded with another skeleton; both must be of the same character")]
    OtherSkeleton {
        /// One-based.
        edit: usize,
        /// The other take's file.
        take: String,
    },
    /// A take was recorded with inverse kinematics, and no solver was given that could repeat it.
    #[error(
        "bones without a joint were posed by inverse kinematics, which needs the character's shape; name it with --character"
    )]
    NeedsCharacter,
    /// A target of the take cannot be followed by this character.
    #[error("{why}; give the character the take was recorded with")]
    Target {
        /// What is wrong.
        why: TargetError,
    },
    /// There is no bone of that name.
    #[error("edit {edit}: the skeleton has no bone {bone:?}; `armature inspect` lists them")]
    NoBone {
        /// One-based.
        edit: usize,
        /// The name given.
        bone: String,
    },
    /// A number does not fit.
    #[error("edit {edit}: {what}")]
    BadValue {
        /// One-based.
        edit: usize,
        /// What is wrong, and what to give.
        what: String,
    },
    /// Samples are solved after poses were changed.
    #[error("edit {edit} solves samples again and must come before the edits that change poses; move it up")]
    TooLate {
        /// One-based.
        edit: usize,
    },
    /// Nothing is left.
    #[error("edit {edit} leaves nothing of the take; `armature edit` without an action shows how long it is there")]
    NothingLeft {
        /// One-based; 0 for the take itself.
        edit: usize,
    },
    /// It would not fit in memory.
    #[error("edit {edit} makes {poses} poses of {bones} bones, which are too many; edit a shorter part")]
    TooMany {
        /// One-based.
        edit: usize,
        /// Poses.
        poses: usize,
        /// Bones.
        bones: usize,
    },
    /// The callback asked to stop.
    #[error("editing was cancelled")]
    Cancelled,
}

/// A take after its edits.
#[derive(Clone, Debug, PartialEq)]
pub struct Edited {
    skeleton: Skeleton,
    poses: Vec<(i64, PackedPose)>,
    /// Notes and their times, seconds.
    pub markers: Vec<(f64, String)>,
    /// Named parts, and from when to when they last, seconds.
    pub segments: Vec<(String, f64, f64)>,
    /// What the edits cost, in sentences: lag and phase.
    pub notes: Vec<String>,
    /// The weights of blend shapes, if the take sets any. Trims, retimes and loops move them, and the mirror swaps those of
    /// left and right; they are not changed by the edits of bones, and an overdub keeps those of its base.
    pub shapes: Option<ShapeTrack>,
}

impl Edited {
    /// The skeleton.
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// Its poses on a timeline that starts at zero.
    pub fn timeline(&self) -> Timeline<'_> {
        Timeline::of(&self.skeleton, &self.poses)
    }

    /// Time of the last pose, seconds.
    pub fn seconds(&self) -> f64 {
        self.poses.last().map_or(0.0, |(micros, _)| *micros as f64 * 1e-6)
    }

    /// Its poses at a constant rate.
    pub fn at_rate(
        &self,
        settings: &ResampleSettings,
        progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
    ) -> Result<Resampled, ResampleError> {
        resample(&self.timeline(), settings, progress)
    }
}

/// Applies a list to its take. `other` gives the other takes that it speaks of by their names in the list. A take that
/// was recorded with inverse kinematics needs the same `completion` again.
///
/// `progress` is called with the current stage and the fraction done, 0 to 1, and can stop the work with
/// [`ControlFlow::Break`].
pub fn apply_edits(
    list: &EditList,
    take: &Take,
    other: &dyn Fn(&str) -> Result<std::sync::Arc<Take>, String>,
    completion: Option<&mut (dyn PoseCompletion + '_)>,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Edited, EditError> {
    let skeleton = take.skeleton().ok_or_else(|| EditError::NoSkeleton { take: list.take.clone() })?;
    let mut work = Work { skeleton, notes: Vec::new(), other };
    let solving = list.edits.iter().take_while(|edit| edit.solves_again()).count();
    if let Some(late) = list.edits.iter().skip(solving).position(Edit::solves_again) {
        return Err(EditError::TooLate { edit: solving + late + 1 });
    }
    let mut performance = work.solve(take, &list.edits[..solving], completion, progress)?;
    for (index, edit) in list.edits.iter().enumerate().skip(solving) {
        work.change(index + 1, edit, &mut performance)?;
        if performance.poses.is_empty() {
            return Err(EditError::NothingLeft { edit: index + 1 });
        }
        if progress("editing", (index + 1) as f64 / list.edits.len() as f64).is_break() {
            return Err(EditError::Cancelled);
        }
    }
    Ok(work.finish(performance))
}

/// What all edits need.
struct Work<'a> {
    skeleton: &'a Skeleton,
    notes: Vec<String>,
    other: &'a dyn Fn(&str) -> Result<std::sync::Arc<Take>, String>,
}

impl Work<'_> {
    fn solve(
        &mut self,
        take: &Take,
        edits: &[Edit],
        completion: Option<&mut (dyn PoseCompletion + '_)>,
        progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
    ) -> Result<Performance, EditError> {
        let (mut filter, mut overdubs) = (None, Vec::new());
        for (index, edit) in edits.iter().enumerate() {
            match edit {
                Edit::Filter { filter: text } => filter = Some(self.filter(index + 1, text, take)?),
                Edit::Overdub { take: name, bones, at, from, to, blend } => {
                    let over = self.take(index + 1, name)?;
                    let bones = self.bones(index + 1, bones)?;
                    times(index + 1, &[Some(*at), *from, *to])?;
                    length(index + 1, *blend)?;
                    overdubs.push((over, bones, micros(*at), layer_micros(*from), layer_micros(*to), micros(*blend)));
                }
                _ => {}
            }
        }
        let completed = Completed::new(take, completion).ok_or(EditError::NeedsCharacter)?;
        let layers: Vec<Layer<'_>> = overdubs
            .iter()
            .map(|(take, bones, at, from, to, fade)| Layer { take, bones, at: *at, from: *from, to: *to, fade: *fade })
            .collect();
        let mut stage = |done| progress("solving again", done);
        let solved = solve_layers(take, self.skeleton, filter, &layers, completed, &mut stage);
        let Solved { mut poses, held } = solved.map_err(|why| match why {
            Unsolved::Cancelled => EditError::Cancelled,
            Unsolved::Target(why) => EditError::Target { why },
        })?;
        if poses.is_empty() {
            // A take of poses alone, such as a motion that was imported: every bone is as it was recorded.
            let timeline = Timeline::recorded(take);
            let all = (0..).map_while(|index| timeline.as_ref()?.get(index));
            let turned = vec![BoneStatus { quality: BoneQuality::Live, held_samples: 0 }; self.skeleton.len()];
            poses = all.map(|(seconds, pose)| (micros(seconds), take.unpack(pose), turned.clone())).collect();
        }
        stand(take, self.skeleton, &mut poses, &held)?;
        let mut poses: Vec<(i64, Pose)> = poses.into_iter().map(|(time, pose, _)| (time, pose)).collect();
        swing(take, self.skeleton, &mut poses)?;
        let performance = Performance::of(poses).with_shapes(ShapeTrack::solve(take, filter));
        if performance.poses.is_empty() { Err(EditError::NothingLeft { edit: 0 }) } else { Ok(performance) }
    }

    fn filter(&mut self, edit: usize, text: &str, take: &Take) -> Result<Filter, EditError> {
        let filter: Filter = text
            .parse()
            .map_err(|error: armature_rig::FilterError| EditError::BadValue { edit, what: error.to_string() })?;
        let rate = crate::summary::summarize(take).samples_per_second;
        let lag = |speed: f64| filter.lag_seconds(speed, 1.0 / rate.unwrap_or(100.0)) * 1e3;
        let [calm, quick] = crate::receipt::LAG_AT_SPEEDS;
        self.notes.push(format!(
            "edit {edit}: filter {filter}, a lag of {:.1} ms at {calm} rad/s and {:.1} ms at {quick} rad/s",
            lag(calm),
            lag(quick)
        ));
        Ok(filter)
    }

    fn take(&self, edit: usize, name: &str) -> Result<std::sync::Arc<Take>, EditError> {
        let take = (self.other)(name).map_err(|why| EditError::Take { edit, why })?;
        let skeleton = take.skeleton().ok_or_else(|| EditError::NoSkeleton { take: name.to_owned() })?;
        let same = skeleton.len() == self.skeleton.len()
            && skeleton
                .bones()
                .iter()
                .zip(self.skeleton.bones())
                .all(|(a, b)| a.name == b.name && a.parent == b.parent);
        if same { Ok(take) } else { Err(EditError::OtherSkeleton { edit, take: name.to_owned() }) }
    }

    fn bones(&self, edit: usize, names: &[String]) -> Result<Vec<bool>, EditError> {
        if names.is_empty() {
            return Err(EditError::BadValue { edit, what: "name the bones".into() });
        }
        chosen(self.skeleton, names).map_err(|bone| EditError::NoBone { edit, bone })
    }

    fn bones_or_all(&self, edit: usize, names: &[String]) -> Result<Vec<bool>, EditError> {
        performance::chosen_or_all(self.skeleton, names).map_err(|bone| EditError::NoBone { edit, bone })
    }

    fn change(&mut self, edit: usize, what: &Edit, performance: &mut Performance) -> Result<(), EditError> {
        match what {
            Edit::Overdub { .. } | Edit::Filter { .. } => {}
            Edit::Trim { from, to } => {
                range(edit, *from, *to)?;
                timing::trim(performance, micros(*from), micros(*to));
            }
            Edit::Segment { name, from, to } => {
                range(edit, *from, *to)?;
                performance.segments.push((name.clone(), micros(*from), micros(*to)));
            }
            Edit::Marker { at, text } => {
                times(edit, &[Some(*at)])?;
                performance.markers.push((micros(*at), text.clone()));
            }
            Edit::Mute { bones, from, to, blend } => {
                let chosen = self.bones(edit, bones)?;
                times(edit, &[*from, *to])?;
                length(edit, *blend)?;
                let (from, to) = (from.map_or(i64::MIN, micros), to.map_or(i64::MAX, micros));
                layers::mute(performance, self.skeleton, &chosen, (from, to), micros(*blend));
            }
            Edit::Smooth { cutoff, bones } => {
                if !(cutoff.is_finite() && (0.01..=1000.0).contains(cutoff)) {
                    return Err(bad(edit, format!("{cutoff} Hz is no cutoff; give 0.01 to 1000")));
                }
                let chosen = self.bones_or_all(edit, bones)?;
                layers::smooth(performance, self.skeleton, &chosen, *cutoff);
                self.notes.push(format!("edit {edit}: smoothed without lag (zero phase); half is left of {cutoff} Hz"));
            }
            Edit::Mirror => {
                let mirror = Mirror::of(self.skeleton).map_err(|bone| {
                    bad(
                        edit,
                        format!(
                            "the bone {bone:?} has no counterpart on the other side, so the pose has no mirror image"
                        ),
                    )
                })?;
                performance.poses.iter_mut().for_each(|(_, pose)| *pose = mirror.pose(self.skeleton, pose));
                performance.shapes_mut().into_iter().for_each(ShapeTrack::mirror);
            }
            Edit::Retime { speed } => {
                if !(speed.is_finite() && (0.01..=100.0).contains(speed)) {
                    return Err(bad(edit, format!("a speed of {speed} is not possible; give 0.01 to 100")));
                }
                timing::retime(performance, *speed);
            }
            Edit::Loop { times, blend } => self.repeat(edit, performance, *times, *blend)?,
            Edit::Hold { pose, from, to, blend, bones } => {
                range(edit, *from, *to)?;
                times(edit, &[Some(*pose)])?;
                length(edit, *blend)?;
                let chosen = self.bones_or_all(edit, bones)?;
                layers::hold(performance, &chosen, micros(*pose), (micros(*from), micros(*to)), micros(*blend));
            }
            Edit::Add { take, at, weight, bones } => {
                times(edit, &[Some(*at)])?;
                if !(weight.is_finite() && weight.abs() <= 10.0) {
                    return Err(bad(edit, format!("a weight of {weight} is not possible; give -10 to 10")));
                }
                let (take, chosen) = (self.take(edit, take)?, self.bones_or_all(edit, bones)?);
                layers::add(performance, &take, &chosen, micros(*at), *weight);
            }
        }
        Ok(())
    }

    fn repeat(&self, edit: usize, performance: &mut Performance, times: u32, blend: f64) -> Result<(), EditError> {
        length(edit, blend)?;
        if !(1..=10_000).contains(&times) {
            return Err(bad(edit, format!("{times} times is not possible; give 1 to 10000")));
        }
        let lasts = performance.span().map_or(0, |(first, last)| last - first);
        if micros(blend) * 2 > lasts {
            let half = lasts as f64 * 0.5e-6;
            return Err(bad(edit, format!("the blend must not be longer than half of what is repeated, {half:.3} s")));
        }
        let poses = performance.poses.len().saturating_mul(times as usize);
        if poses.saturating_mul(self.skeleton.len()) > MOST_TRANSFORMS {
            return Err(EditError::TooMany { edit, poses, bones: self.skeleton.len() });
        }
        timing::repeat(performance, times, micros(blend));
        Ok(())
    }

    fn finish(self, mut performance: Performance) -> Edited {
        let shapes = performance.take_shapes();
        let seconds = |micros: i64| micros as f64 * 1e-6;
        let pack = |(index, (micros, pose)): (usize, (i64, Pose))| {
            let packed = PackedPose::pack(index as u32, micros.max(0).unsigned_abs(), &pose, self.skeleton)?;
            Some((micros, packed))
        };
        Edited {
            skeleton: self.skeleton.clone(),
            poses: performance.poses.into_iter().enumerate().filter_map(pack).collect(),
            markers: performance.markers.into_iter().map(|(at, text)| (seconds(at), text)).collect(),
            segments: performance.segments.into_iter().map(|(name, a, b)| (name, seconds(a), seconds(b))).collect(),
            notes: self.notes,
            shapes,
        }
    }
}

/// The roots follow the feet as they did in the take, now that all layers are there.
/// `held`: for each of the poses, whether a target holds a root.
fn stand(take: &Take, skeleton: &Skeleton, poses: &mut Driven, held: &[bool]) -> Result<(), EditError> {
    let Some(ground) = take.ground() else { return Ok(()) };
    let mut standing = Standing::new(skeleton, ground.clone()).map_err(|why| bad(0, why.to_string()))?;
    let first = poses.first().map_or(0, |(micros, ..)| *micros);
    let mut driven = Vec::new();
    for (index, (micros, pose, status)) in poses.iter_mut().enumerate() {
        let is_held = held.get(index).is_some_and(|held| *held);
        driven.clear();
        driven.extend(status.iter().map(|status| status.quality != BoneQuality::Unmapped));
        standing.stand(micros.saturating_sub(first).max(0).unsigned_abs(), is_held, skeleton, &driven, pose);
    }
    Ok(())
}

/// Bones swing as they did in the take, in the poses that its layers make.
fn swing(take: &Take, skeleton: &Skeleton, poses: &mut [(i64, Pose)]) -> Result<(), EditError> {
    let Some(dynamics) = take.dynamics() else { return Ok(()) };
    let mut springs = SpringBones::new(skeleton, dynamics.clone()).map_err(|why| bad(0, why.to_string()))?;
    let mapping = take.records().iter().rev().find_map(|record| match record {
        Record::Mapping(mapping) => Some(mapping),
        _ => None,
    });
    let driven = mapping.map_or_else(|| vec![false; skeleton.len()], |mapping| mapping.driven_bones(skeleton));
    let first = poses.first().map_or(0, |(micros, _)| *micros);
    for (micros, pose) in poses {
        let micros = micros.saturating_sub(first).max(0).unsigned_abs();
        springs.follow(micros, skeleton, pose, &|bone| driven[bone]);
    }
    Ok(())
}

fn bad(edit: usize, what: String) -> EditError {
    EditError::BadValue { edit, what }
}

fn times(edit: usize, given: &[Option<f64>]) -> Result<(), EditError> {
    match given.iter().flatten().find(|time| !(time.is_finite() && time.abs() <= 1e6)) {
        Some(time) => Err(bad(edit, format!("{time} s is no time; give seconds since the take's first sample"))),
        None => Ok(()),
    }
}

fn length(edit: usize, seconds: f64) -> Result<(), EditError> {
    if seconds.is_finite() && (0.0..=1e6).contains(&seconds) {
        Ok(())
    } else {
        Err(bad(edit, format!("a blend of {seconds} s is not possible; give 0 or more seconds")))
    }
}

fn range(edit: usize, from: f64, to: f64) -> Result<(), EditError> {
    times(edit, &[Some(from), Some(to)])?;
    if from < to {
        Ok(())
    } else {
        Err(bad(edit, format!("{from} s to {to} s is nothing; give a start before the end")))
    }
}
