//! Samples solved again: with another filter, and with bones from other takes.

use std::ops::ControlFlow;

use armature_rig::{BoneQuality, BoneStatus, Filter, Pose, PoseMoment, Skeleton, Standing, StreamSolver, TargetError};
use glam::Vec3;

use super::performance::{blend, inside, micros};
use crate::file::{Record, Take};
use crate::replay::{Completed, filtered};
use crate::time::{DeviceClock, between};

/// Bones that another take brings.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layer<'a> {
    pub(super) take: &'a Take,
    /// Which bones, in the order of the skeleton.
    pub(super) bones: &'a [bool],
    /// When its first sample is, microseconds after the base take's.
    pub(super) at: i64,
    /// From when to when it counts; `None` for its own start and end.
    pub(super) from: Option<i64>,
    pub(super) to: Option<i64>,
    /// How long it comes and goes.
    pub(super) fade: i64,
}

/// The poses of a take, microseconds, and which bones joints turn.
pub(super) type Driven = Vec<(i64, Pose, Vec<BoneStatus>)>;

/// Why there is no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unsolved {
    /// The callback asked to stop.
    Cancelled,
    /// A target of the take cannot be followed by this character.
    Target(TargetError),
}

/// A take with its layers.
#[derive(Clone, Debug, Default)]
pub(super) struct Solved {
    /// By time, before the feet have moved the roots.
    pub(super) poses: Driven,
    /// For each, whether a target holds a root.
    pub(super) held: Vec<bool>,
}

/// The poses of a take's samples by its joints alone, in time order.
fn driven(
    take: &Take,
    skeleton: &Skeleton,
    filter: Option<Filter>,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Driven, Unsolved> {
    let mut solver = StreamSolver::new(skeleton.clone());
    let mut clock = DeviceClock::new(take);
    let mut out: Driven = Vec::new();
    for (index, record) in take.records().iter().enumerate() {
        match record {
            Record::Topology(topology) => solver.set_topology(topology.epoch, topology.tree.clone()),
            Record::Calibration(calibration) => {
                solver.set_calibration(filtered(calibration, filter));
            }
            Record::Mapping(mapping) => solver.set_mapping(mapping.clone()),
            Record::Engagement { micros, all } => solver.engage(*micros, *all),
            Record::ReadingsReturn { micros } => solver.return_over(*micros),
            Record::Sample(sample) => {
                let time = clock.next_sample();
                if let Ok(pose) = solver.solve(&sample.raw) {
                    let pose = pose.clone();
                    let status = solver.solver().map(|solver| solver.bone_status().to_vec()).unwrap_or_default();
                    out.push((time, pose, status));
                }
            }
            // The ground and what swings follow once all layers are there; targets belong to what completes the poses.
            Record::Skeleton(_)
            | Record::Pose(_)
            | Record::Event(_)
            | Record::Ground(_)
            | Record::Dynamics(_)
            | Record::Shape(_)
            | Record::Target(_)
            | Record::InverseKinematics(_) => {}
        }
        if index.is_multiple_of(1024) && progress(index as f64 / take.records().len() as f64).is_break() {
            return Err(Unsolved::Cancelled);
        }
    }
    out.sort_by_key(|(time, ..)| *time);
    out.dedup_by_key(|(time, ..)| *time);
    Ok(out)
}

/// Solves a take again with layers over it. Bones of a layer are those that its joints drive, between its two samples
/// around each moment; everything else follows by `completion`, which sees the joints of all takes at once. Where a layer
/// comes or goes, the whole pose goes over from the one without it to the one with it. With each pose, which bones joints
/// turn.
pub(super) fn solve_layers(
    base: &Take,
    skeleton: &Skeleton,
    filter: Option<Filter>,
    layers: &[Layer<'_>],
    mut completed: Completed<'_, '_>,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Solved, Unsolved> {
    let told = told(base);
    let steps = 1.0 + 2.0 * layers.len() as f64;
    let (base_take, base) = (base, driven(base, skeleton, filter, &mut |done| progress(done / steps))?);
    let over = layers
        .iter()
        .enumerate()
        .map(|(n, layer)| driven(layer.take, skeleton, filter, &mut |done| progress((1.0 + n as f64 + done) / steps)));
    let over: Vec<Driven> = over.collect::<Result<_, _>>()?;
    let mut out: Driven = Vec::new();
    let mut held = vec![false; base.len()];
    let first = base.first().map_or(0, |(time, ..)| *time);
    for count in 0..=layers.len() {
        completed.begin(base_take);
        let mut told = told.iter().peekable();
        // Targets are places in the world, so they need to know by how much the feet will move the roots.
        let mut standing = base_take
            .ground()
            .filter(|_| told.peek().is_some())
            .and_then(|ground| Standing::new(skeleton, ground.clone()).ok());
        let active: Vec<(&Layer<'_>, &Driven)> = layers.iter().zip(&over).take(count).collect();
        for (index, (time, pose, status)) in base.iter().enumerate() {
            let (mut pose, mut status) = (pose.clone(), status.clone());
            for (layer, driven) in &active {
                if weight(layer, driven, *time) > 0.0 {
                    put_over(&mut pose, &mut status, layer, driven, *time);
                }
            }
            while let Some((_, record)) = told.next_if(|(from, _)| *from <= *time) {
                completed.hear(record).map_err(Unsolved::Target)?;
            }
            if let Some(completion) = completed.now() {
                let device_micros = time.saturating_sub(first).max(0).unsigned_abs();
                let offset = standing.as_ref().map_or(Vec3::ZERO, Standing::offset);
                completion.complete(PoseMoment { device_micros, offset }, &status, &mut pose);
                held[index] = completion.holds_root();
                if let Some(standing) = &mut standing {
                    let turned: Vec<bool> =
                        status.iter().map(|status| status.quality != BoneQuality::Unmapped).collect();
                    standing.stand(device_micros, held[index], skeleton, &turned, &mut pose.clone());
                }
            }
            match active.last() {
                None => out.push((*time, pose, status)),
                Some((layer, driven)) => {
                    let weight = weight(layer, driven, *time);
                    let (_, before, driven) = &mut out[index];
                    if weight >= 1.0 {
                        (*before, *driven) = (pose, status);
                    } else if weight > 0.0 {
                        *before = blend(before, &pose, weight);
                        // Legs that one of the two turns are turned.
                        driven.iter_mut().zip(&status).for_each(|(driven, status)| {
                            driven.quality = driven.quality.max(status.quality);
                        });
                    }
                }
            }
            let done = 1.0 + layers.len() as f64 + (count as f64 - 1.0 + index as f64 / base.len() as f64).max(0.0);
            if index.is_multiple_of(256) && progress((done / steps).min(1.0)).is_break() {
                return Err(Unsolved::Cancelled);
            }
        }
    }
    Ok(Solved { poses: out, held })
}

/// What a take tells whatever completes its poses, with the time of the sample from which on it holds.
fn told(take: &Take) -> Vec<(i64, &Record)> {
    let mut clock = DeviceClock::new(take);
    let (mut told, mut waiting) = (Vec::new(), Vec::new());
    for record in take.records() {
        match record {
            Record::Sample(_) => {
                let time = clock.next_sample();
                told.extend(waiting.drain(..).map(|record| (time, record)));
            }
            Record::Target(_) | Record::InverseKinematics(_) => waiting.push(record),
            _ => {}
        }
    }
    // What holds from a sample on that is not there any more never comes to bear.
    told.sort_by_key(|(time, _)| *time);
    told
}

/// How much a layer counts at a time.
fn weight(layer: &Layer<'_>, driven: &Driven, time: i64) -> f64 {
    let (Some(first), Some(last)) = (driven.first(), driven.last()) else { return 0.0 };
    let from = layer.from.unwrap_or(i64::MIN).max(layer.at.saturating_add(first.0));
    let to = layer.to.unwrap_or(i64::MAX).min(layer.at.saturating_add(last.0));
    inside(time, from, to, layer.fade)
}

/// Puts a layer's bones over a pose, as its two samples around the time say.
fn put_over(pose: &mut Pose, status: &mut [BoneStatus], layer: &Layer<'_>, driven: &Driven, time: i64) {
    let own = time.saturating_sub(layer.at);
    let after = driven.partition_point(|(time, ..)| *time <= own).clamp(1, driven.len());
    let (start, before, quality) = &driven[after - 1];
    let next = driven.get(after);
    for (bone, _) in layer.bones.iter().enumerate().filter(|(_, chosen)| **chosen) {
        let is_driven = quality.get(bone).is_some_and(|status| status.quality > BoneQuality::Unmapped);
        let here = before.parent_from_bone[bone];
        pose.parent_from_bone[bone] = match next {
            Some((end, after, _)) if own > *start => {
                between(&here, &after.parent_from_bone[bone], (own - start) as f64 / (end - start) as f64)
            }
            _ => here,
        };
        if let (true, Some(status)) = (is_driven, status.get_mut(bone)) {
            *status = quality[bone];
        } else if let Some(status) = status.get_mut(bone) {
            *status = BoneStatus::default();
        }
    }
}

/// Seconds as the layer counts them.
pub(super) fn layer_micros(seconds: Option<f64>) -> Option<i64> {
    seconds.map(micros)
}
