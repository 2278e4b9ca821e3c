//! A performance from the first hello to the finished take, whatever the puppet and whatever the clock.

use std::fmt::{self, Write as _};
use std::io::BufWriter;
use std::path::PathBuf;
use std::time::Duration;

use armature_device::{DeviceInfo, DeviceNotice, DeviceProblem, Event, SessionCounters};
use armature_rig::Filter;
use armature_take::Header;

use super::completion::RoleCounts;
use super::latency::{Latencies, LatencySummary};
use super::live::problem_failure;
use super::performance::Performance;
use super::recorder::{RecordedTake, create_take};
use super::stage::Stage;
use crate::failure::Failure;

/// What comes next from a puppet.
#[derive(Debug)]
pub enum Next {
    /// An event of the session.
    Event(Event),
    /// Nothing for the moment.
    Quiet,
    /// The line is gone and every event has been taken.
    Over,
}

/// A puppet, real or simulated, on a real or virtual clock.
pub trait Source {
    /// The next event, waiting a little for it.
    fn next(&mut self) -> Next;
    /// The character is prepared for the puppet as it is plugged together now: samples may come. Told after every
    /// topology; on a virtual clock nothing comes too early.
    fn ready(&mut self) {}
    /// The session's time, seconds.
    fn now(&self) -> f64;
    /// How long ago something was received; `None` on a virtual clock.
    fn age(&self, received: Duration) -> Option<Duration>;
    /// What the session has counted so far.
    fn counters(&self) -> SessionCounters;
    /// Whether the user wants to end.
    fn interrupted(&self) -> bool;
    /// Stops the puppet and gives up the line.
    fn close(self) -> SessionCounters;
}

/// What is to happen.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// For how long, from the first pose after zeroing; without it, until interrupted.
    pub seconds: Option<f64>,
    /// The take.
    pub record: Option<PathBuf>,
    /// What the take says of itself.
    pub header: Header,
}

/// How it went.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Who the puppet was.
    pub device: Option<DeviceInfo>,
    /// How many joints and bones, and how many bones are driven.
    pub joints_bones_driven: (usize, usize, usize),
    /// What turned the bones; `None` where bones without a joint stayed at rest.
    pub roles: Option<RoleCounts>,
    /// Poses of the performance proper, after zeroing.
    pub poses: u64,
    /// How long the performance lasted, seconds of the session's time.
    pub seconds: f64,
    /// Last byte of a sample → posed and skinned; `None` on a virtual clock.
    pub latency: Option<LatencySummary>,
    /// What the filters of the joints do, if they do anything, in words.
    pub filter: Option<String>,
    /// What the session counted.
    pub counters: SessionCounters,
    /// The take.
    pub take: Option<(PathBuf, RecordedTake)>,
    /// What ended the performance early, although everything until then is safe.
    pub trouble: Option<Failure>,
}

/// Before the first pose the program waits at most so long, session's time.
const PATIENCE_SECONDS: f64 = 12.0;
/// A line that is lost is waited for so long, session's time.
const LINE_PATIENCE_SECONDS: f64 = 30.0;
const STATUS_EVERY_SECONDS: f64 = 0.1;
/// Speeds at which the lag of a filter is told, radians a second.
const CALM: f64 = 0.5;
const QUICK: f64 = 3.0;

struct Show<'a> {
    stage: Stage<BufWriter<std::fs::File>>,
    plan: &'a Plan,
    device: Option<DeviceInfo>,
    latencies: Latencies,
    began: Option<f64>,
    /// Since when the line is lost, and why.
    lost: Option<(f64, String)>,
    poses: u64,
    trouble: Option<Failure>,
}

/// Performs until the plan is done. `status` is told a line and the part done, now and then.
///
/// An error means that nothing came of it. Trouble on the way (the cable was pulled) ends the performance, and the
/// take up to there is finished and safe: it is in the summary.
pub fn perform<S: Source>(
    mut source: S,
    performance: Performance,
    plan: &Plan,
    status: &mut dyn FnMut(&str, f64),
) -> Result<(Performance, Summary), Failure> {
    let mut show = Show {
        stage: Stage::new(performance),
        plan,
        device: None,
        latencies: Latencies::default(),
        began: None,
        lost: None,
        poses: 0,
        trouble: None,
    };
    let mut told = f64::NEG_INFINITY;
    while show.trouble.is_none() && !show.is_done(source.now()) && !source.interrupted() {
        match source.next() {
            Next::Event(event) => show.take_in(&event, &mut source)?,
            Next::Over => {
                let reason = "the line was closed".to_string();
                show.trouble = Some(problem_failure(&DeviceProblem::Disconnected { reason }));
            }
            Next::Quiet => {
                show.check_patience(source.now())?;
                show.check_line(false, source.now());
            }
        }
        if source.now() - told > STATUS_EVERY_SECONDS {
            told = source.now();
            show.tell(status, &source.counters(), told);
        }
    }
    show.check_line(true, source.now());
    show.finish(source)
}

impl Show<'_> {
    fn is_done(&self, now: f64) -> bool {
        self.began.zip(self.plan.seconds).is_some_and(|(began, seconds)| now - began >= seconds)
    }

    fn take_in(&mut self, event: &Event, source: &mut impl Source) -> Result<(), Failure> {
        match event {
            Event::Connected(info) => self.device = Some(info.clone()),
            Event::Problem(problem) => self.take_problem(problem)?,
            Event::Notice(notice) => self.take_notice(notice, source.now()),
            _ => {}
        }
        let outcome = self.stage.handle(event)?;
        if outcome.new_topology {
            source.ready();
        }
        if !outcome.posed || !self.stage.is_ready() {
            return Ok(());
        }
        if self.began.is_none() {
            self.began = Some(source.now());
            if let Some(path) = &self.plan.record {
                let out = create_take(path)?;
                self.stage.start_recording(out, &path.display().to_string(), &self.plan.header, source.now())?;
            }
            return Ok(());
        }
        self.poses += 1;
        if let Event::Sample(sample) = event
            && let Some(age) = source.age(sample.received)
        {
            self.latencies.add(age);
        }
        Ok(())
    }

    /// Before the first pose a problem is the end; afterwards only the loss of the line is.
    fn take_problem(&mut self, problem: &DeviceProblem) -> Result<(), Failure> {
        let failure = problem_failure(problem);
        match (self.began, problem) {
            (None, DeviceProblem::Refused { .. } | DeviceProblem::NoAnswer { .. }) => {
                tracing::warn!("{}", failure.what);
            }
            (None, _) => return Err(failure),
            (Some(_), DeviceProblem::Disconnected { .. }) => self.trouble = Some(failure),
            (Some(_), _) => tracing::warn!("{}", failure.what),
        }
        Ok(())
    }

    fn take_notice(&mut self, notice: &DeviceNotice, now: f64) {
        tracing::warn!("{notice}");
        match notice {
            DeviceNotice::LineLost { reason } => self.lost = Some((now, reason.clone())),
            DeviceNotice::LineBack { .. } => self.lost = None,
            _ => {}
        }
    }

    /// A line that does not come back ends the performance.
    fn check_line(&mut self, done: bool, now: f64) {
        if let Some((since, reason)) = &self.lost
            && (done || now - since > LINE_PATIENCE_SECONDS)
        {
            self.trouble = Some(problem_failure(&DeviceProblem::Disconnected { reason: reason.clone() }));
        }
    }

    fn check_patience(&self, now: f64) -> Result<(), Failure> {
        if self.began.is_some() || now < PATIENCE_SECONDS {
            return Ok(());
        }
        Err(if self.stage.tree().is_none() {
            Failure::device(
                "the puppet did not describe itself",
                "unplug it, plug it in again, and look at `armature devices`",
            )
        } else {
            Failure::device(
                "the puppet sends no sample with good readings, so its rest pose is not known",
                "look at the joints' magnets and cables; `armature` (the window) shows the state of every sensor",
            )
        })
    }

    fn tell(&self, status: &mut dyn FnMut(&str, f64), counters: &SessionCounters, now: f64) {
        let Some(began) = self.began else {
            let line = if self.stage.tree().is_some() { "taking the rest pose" } else { "waiting for the puppet" };
            return status(line, 0.0);
        };
        let elapsed = now - began;
        let rate = self.poses as f64 / elapsed.max(1e-9);
        let kind = if self.plan.record.is_some() { "recording" } else { "performing" };
        let (least, most) = self.stage.performance().lag_seconds();
        let lag = if most > 0.0 { format!(", lag {:.0}–{:.0} ms", least * 1e3, most * 1e3) } else { String::new() };
        let line = format!("{kind} {rate:.0}/s, {} lost{lag}", counters.lost_samples);
        status(&line, self.plan.seconds.map_or(0.0, |seconds| elapsed / seconds));
    }

    fn finish<S: Source>(mut self, source: S) -> Result<(Performance, Summary), Failure> {
        let now = source.now();
        let virtual_clock = source.age(Duration::ZERO).is_none();
        let take = self.stage.stop_recording()?;
        let counters = source.close();
        if self.began.is_none() && self.trouble.is_some() {
            return Err(self.trouble.unwrap_or_else(|| Failure::device("the puppet went away", "")));
        }
        let take = match take {
            Some((out, recorded)) => {
                let path = self.plan.record.clone().unwrap_or_default();
                let file = out.into_inner().map_err(std::io::IntoInnerError::into_error);
                file.and_then(|f| f.sync_all())
                    .map_err(|e| Failure::input(format!("{}: {e}", path.display()), "make room on the disk"))?;
                Some((path, recorded))
            }
            None => None,
        };
        let performance = self.stage.into_performance();
        let driven = performance.mapping().map_or(0, |m| {
            let bones: std::collections::BTreeSet<&str> = m.entries.iter().map(|e| e.bone.as_str()).collect();
            bones.len()
        });
        let joints = performance
            .topology()
            .map_or(0, |(_, tree)| tree.parts().iter().filter(|p| !p.kind.axes().is_empty()).count());
        let period = self.began.map_or(f64::NAN, |began| (now - began) / self.poses.max(1) as f64);
        let summary = Summary {
            filter: filter_line(&performance, period),
            device: self.device,
            joints_bones_driven: (joints, performance.actor().skeleton.len(), driven),
            roles: performance.bone_roles().map(RoleCounts::of).filter(|roles| roles.solved > 0),
            poses: self.poses,
            seconds: self.began.map_or(0.0, |began| now - began),
            latency: (!virtual_clock).then(|| self.latencies.summary()),
            counters,
            take,
            trouble: self.trouble,
        };
        Ok((performance, summary))
    }
}

/// What the filters cost, for a calm and for a quick motion.
fn filter_line(performance: &Performance, period: f64) -> Option<String> {
    let calibration = performance.calibration();
    let own = calibration.set_parts().filter(|(_, settings)| settings.filter.is_some()).count();
    if calibration.filter == Filter::None && own == 0 {
        return None;
    }
    let lag = |speed: f64| calibration.filter.lag_seconds(speed, period) * 1e3;
    let mut line = calibration.filter.to_string();
    if lag(CALM) > 0.0 {
        let _ = write!(
            line,
            ": the character is {:.0} ms behind at {CALM} rad/s and {:.0} ms at {QUICK} rad/s",
            lag(CALM),
            lag(QUICK)
        );
    }
    if own > 0 {
        let _ = write!(line, "; {own} parts have a filter of their own");
    }
    let (least, most) = performance.lag_seconds();
    if most > 0.0 {
        let _ = write!(line, "; at the end {:.0} to {:.0} ms", least * 1e3, most * 1e3);
    }
    Some(line)
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (joints, bones, driven) = self.joints_bones_driven;
        let rate = self.poses as f64 / self.seconds.max(1e-9);
        if let Some(device) = &self.device {
            let [major, minor] = device.protocol;
            writeln!(
                f,
                "puppet     {} (protocol {major}.{minor}), {joints} joints drive {driven} of {bones} bones",
                device.name
            )?;
        }
        if let Some(roles) = &self.roles {
            writeln!(f, "bones      {roles}")?;
        }
        writeln!(f, "stream     {} poses in {:.2} s, {rate:.1} a second", self.poses, self.seconds)?;
        let counters = &self.counters;
        write!(
            f,
            "losses     {} samples lost, {} frames with a wrong checksum, {} pieces that were no frame, {} bytes \
             discarded, {} restarts",
            counters.lost_samples,
            counters.checksum_errors,
            counters.framing_errors,
            counters.discarded_bytes,
            counters.restarts
        )?;
        if let Some(filter) = &self.filter {
            write!(f, "\nfilter     {filter}")?;
        }
        if let Some(latency) = &self.latency {
            write!(f, "\nlatency    last byte of a sample → posed and skinned: {latency}")?;
        }
        if let Some((path, take)) = &self.take {
            let seconds = take.micros as f64 * 1e-6;
            write!(
                f,
                "\ntake       {}: {} samples, {seconds:.2} s of device time, {} lost",
                path.display(),
                take.samples,
                take.lost
            )?;
        }
        Ok(())
    }
}
