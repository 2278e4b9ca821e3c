//! A run by a plan, from the first hello to the finished take: when it begins, when it is over, what it came to.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Duration;

use armature_character::inverse_kinematics::RefitCost;
use armature_device::{DeviceInfo, DeviceNotice, DeviceProblem, Event, SessionCounters};

use super::calibrating::no_samples;
use super::command::RunPlan;
use super::latency::Latencies;
use super::puppeteer::Puppeteer;
use super::run_summary::{RunSummary, filter_line};
use super::sources::address::problem_failure;
use super::take_recorder::RecordedTake;
use crate::characters::inverse_kinematics::RoleCounts;
use crate::failure::Failure;

/// Before the first pose (or the first sample, for calibration) the program waits at most so long after the line was
/// opened.
pub(super) const PATIENCE_SECONDS: f64 = 12.0;
/// A puppet that has sent no sample for this long at the end of a run has failed, not finished.
const SILENT_SECONDS: f64 = 1.0;
/// The same in samples, for slow ones.
const SILENT_PERIODS: f64 = 5.0;
/// A line that is lost is waited for so long.
const LINE_PATIENCE_SECONDS: f64 = 30.0;
/// A pin that is missed by less than this share of the skeleton's height is held: half a millimetre of a person.
const PIN_HELD: f32 = 0.5e-3 / 1.9;
/// A standing foot that is dragged by less than this share of the skeleton's height stays: a millimetre of a person.
const FOOT_HELD: f32 = 2.0 * PIN_HELD;
/// So often the run says how it goes.
pub(super) const STATUS_SECONDS: f64 = 0.1;

/// A run that is under way. Times are the engine's, seconds.
#[derive(Debug)]
pub(super) struct Run {
    plan: RunPlan,
    device: Option<DeviceInfo>,
    latencies: Latencies,
    began: Option<f64>,
    /// When the latest sample came.
    heard: Option<f64>,
    /// Since when the line is lost, and why.
    lost: Option<(f64, String)>,
    poses: u64,
    reported: f64,
    trouble: Option<Failure>,
}

impl Run {
    pub(super) fn new(plan: RunPlan) -> Self {
        Self {
            plan,
            device: None,
            latencies: Latencies::default(),
            began: None,
            heard: None,
            lost: None,
            poses: 0,
            reported: f64::NEG_INFINITY,
            trouble: None,
        }
    }

    pub(super) fn plan(&self) -> &RunPlan {
        &self.plan
    }

    /// Whether the first pose is still to come.
    pub(super) fn waits(&self) -> bool {
        self.began.is_none()
    }

    /// The first pose after zeroing is there.
    pub(super) fn begin(&mut self, now: f64) {
        self.began = Some(now);
    }

    /// A pose of the run proper.
    pub(super) fn posed(&mut self, latency: Option<Duration>) {
        self.poses += 1;
        if let Some(latency) = latency {
            self.latencies.add(latency);
        }
    }

    /// Takes note of what concerns it. Before the first pose a problem is the end; afterwards only the loss of the line.
    pub(super) fn note(&mut self, event: &Event, now: f64) -> Result<(), Failure> {
        match event {
            Event::Connected(info) => self.device = Some(info.clone()),
            Event::Sample(_) => self.heard = Some(now),
            Event::Notice(DeviceNotice::LineLost { reason }) => self.lost = Some((now, reason.clone())),
            Event::Notice(DeviceNotice::LineBack { .. }) => self.lost = None,
            Event::Problem(DeviceProblem::Refused { .. } | DeviceProblem::NoAnswer { .. }) => {}
            Event::Problem(problem) if self.waits() => return Err(problem_failure(problem)),
            Event::Problem(problem @ DeviceProblem::Disconnected { .. }) => {
                self.trouble = Some(problem_failure(problem));
            }
            _ => {}
        }
        Ok(())
    }

    /// The line is gone for good.
    pub(super) fn line_is_over(&mut self, reason: String) {
        self.trouble = Some(problem_failure(&DeviceProblem::Disconnected { reason }));
    }

    /// Whether it is over at this time.
    pub(super) fn is_over(&mut self, now: f64) -> bool {
        let done = self.began.zip(self.plan.seconds).is_some_and(|(began, seconds)| now - began >= seconds);
        let given_up = self.lost.as_ref().is_some_and(|(since, _)| now - since > LINE_PATIENCE_SECONDS);
        done || given_up || self.trouble.is_some()
    }

    /// Gives up waiting for the first pose after some time. `described`: whether the puppet has described itself;
    /// `refused`: what the device refused.
    pub(super) fn check_patience(
        &self,
        waited: f64,
        described: bool,
        refused: Option<&DeviceProblem>,
    ) -> Result<(), Failure> {
        if !self.waits() || waited < PATIENCE_SECONDS {
            return Ok(());
        }
        if let Some(problem) = refused {
            return Err(problem_failure(problem));
        }
        Err(if described && self.heard.is_none() {
            no_samples(None)
        } else if described {
            Failure::device(
                "the puppet sends no good readings, so its rest pose is unknown",
                "look at the joints' magnets and cables; `armature` (the window) shows the state of each sensor",
            )
        } else {
            Failure::device(
                "the puppet did not describe itself",
                "unplug it, plug it in again, and look at `armature devices`",
            )
        })
    }

    /// One line about how it goes and the part done, now and then.
    pub(super) fn status(
        &mut self,
        now: f64,
        puppeteer: &Puppeteer,
        counters: &SessionCounters,
    ) -> Option<(String, f64)> {
        if now - self.reported <= STATUS_SECONDS {
            return None;
        }
        self.reported = now;
        let Some(began) = self.began else {
            let line = match puppeteer.topology() {
                None => "waiting for the puppet",
                Some(_) if puppeteer.waits_for_zero() => "taking the rest pose",
                Some(_) => "waiting for samples",
            };
            return Some((line.into(), 0.0));
        };
        let elapsed = now - began;
        let rate = self.poses as f64 / elapsed.max(1e-9);
        let kind = if self.plan.record.is_some() { "recording" } else { "performing" };
        let (least, most) = puppeteer.lag_seconds();
        let lag = if most > 0.0 { format!(", lag {:.0}–{:.0} ms", least * 1e3, most * 1e3) } else { String::new() };
        let line = format!("{kind} {rate:.0}/s, {} lost{lag}", counters.lost_samples);
        Some((line, self.plan.seconds.map_or(0.0, |seconds| elapsed / seconds)))
    }

    /// When the engine has to look at it again without anything happening.
    pub(super) fn wakes_at(&self) -> f64 {
        let done = self.began.zip(self.plan.seconds).map(|(began, seconds)| began + seconds);
        done.unwrap_or(f64::INFINITY).min(self.reported + STATUS_SECONDS)
    }

    /// What it came to. `period`: from one sample to the next as requested, seconds. The counts of the session come later,
    /// when the line is closed.
    pub(super) fn finish(
        mut self,
        now: f64,
        period: f64,
        on_virtual_clock: bool,
        puppeteer: &Puppeteer,
        take: Option<(PathBuf, RecordedTake)>,
    ) -> Result<RunSummary, Failure> {
        // A line that is still lost at the end is trouble even where nobody waited for it any longer.
        if let Some((_, reason)) = self.lost.take() {
            self.line_is_over(reason);
        }
        let silent = self.heard.map_or(0.0, |heard| now - heard);
        if self.trouble.is_none() && !self.waits() && silent > SILENT_SECONDS.max(SILENT_PERIODS * period) {
            let what = format!("the puppet sent no more samples for the last {silent:.1} s of the run");
            self.trouble = Some(Failure::device(what, "check its power and its cable; everything before is recorded"));
        }
        if self.waits()
            && let Some(trouble) = self.trouble
        {
            return Err(trouble);
        }
        let bones: BTreeSet<&str> =
            puppeteer.mapping().iter().flat_map(|m| &m.entries).map(|e| e.bone.as_str()).collect();
        let joints = puppeteer
            .topology()
            .map_or(0, |(_, tree)| tree.parts().iter().filter(|p| !p.kind.axes().is_empty()).count());
        if let Some(RefitCost { minimiser, posed }) = puppeteer.refit_cost() {
            let times = posed / minimiser.max(f64::MIN_POSITIVE);
            tracing::info!(
                "energy of the last pose: {posed:.4}, {times:.2} times that of the minimiser, {minimiser:.4}"
            );
        }
        let seconds = self.began.map_or(0.0, |began| now - began);
        let period = self.began.map_or(f64::NAN, |began| (now - began) / self.poses.max(1) as f64);
        Ok(RunSummary {
            filter: filter_line(puppeteer, period),
            device: self.device,
            joints_bones_driven: (joints, puppeteer.character().skeleton.len(), bones.len()),
            roles: puppeteer.bone_roles().map(RoleCounts::of).filter(|roles| roles.solved > 0),
            missed_targets: puppeteer.missed_targets(PIN_HELD * puppeteer.height()),
            missed_pins: puppeteer.missed.beyond(PIN_HELD * puppeteer.height()),
            dragged_foot: Some(puppeteer.dragged_foot()).filter(|dragged| *dragged > FOOT_HELD * puppeteer.height()),
            poses: self.poses,
            seconds,
            latency: (!on_virtual_clock).then(|| self.latencies.summary()),
            counters: SessionCounters::default(),
            take,
            trouble: self.trouble,
        })
    }
}
