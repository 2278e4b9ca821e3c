//! Lines to puppets: opening and closing them, and what they bring.

use std::ops::ControlFlow;

use armature_character::inverse_kinematics::{ArapError, IkError};
use armature_device::{DeviceNotice, DeviceProblem, Event, SessionCounters, Topology};
use armature_rig::{Calibration, PuppetHints};

use super::{Engine, EngineEvent, FrameClock, Problem, Request, Shell};
use crate::engine::calibrating::CalibrationPlan;
use crate::engine::frames;
use crate::engine::input::{LineId, LineNews, OpenLine};
use crate::engine::pipeline::Outcome;
use crate::failure::Failure;

const LINE_CLOSED: &str = "the line was closed";

/// The line to the puppet.
#[derive(Debug)]
pub(super) enum Line {
    /// There is none.
    Off,
    /// It is being opened.
    Connecting { line: LineId, address: String },
    /// It is open.
    Open(Box<Open>),
    /// It is being closed; then this address is connected, if there is one.
    Closing { line: LineId, then: Option<String> },
}

/// An open line.
#[derive(Debug)]
pub(super) struct Open {
    pub(super) line: LineId,
    /// As the user wrote it.
    address: String,
    /// When its session's time was zero.
    pub(super) began: f64,
    pub(super) counters: SessionCounters,
    /// What was known of its joints when it was opened.
    pub(super) calibration: Calibration,
    pub(super) hints: PuppetHints,
    /// How the puppet is plugged together, for a character that comes later.
    topology: Option<Topology>,
    /// Samples were asked for.
    streams: bool,
    /// What the device refused last, unless samples came since.
    pub(super) refused: Option<DeviceProblem>,
}

impl Engine {
    pub(super) fn connect(&mut self, address: String, shell: &mut dyn Shell) {
        self.disconnect(None, shell);
        shell.tell(EngineEvent::Connecting { address: address.clone() });
        match &mut self.line {
            // A port can be opened again only when it is closed.
            Line::Closing { then, .. } => *then = Some(address),
            _ => self.open_line(address, shell),
        }
    }

    fn open_line(&mut self, address: String, shell: &mut dyn Shell) {
        self.lines += 1;
        let line = LineId(self.lines);
        self.line = Line::Connecting { line, address: address.clone() };
        shell.ask(Request::Connect { line, address });
    }

    /// Ends what goes on over the line, and the line. `why`: where nobody asked for it.
    pub(super) fn disconnect(&mut self, why: Option<Problem>, shell: &mut dyn Shell) {
        if self.run.is_some() && matches!(self.line, Line::Open(_)) {
            self.end_run(self.last_input, None, shell);
            return;
        }
        self.end_calibration_step(shell);
        self.stop_recording(shell);
        self.close_line(why, shell);
    }

    pub(super) fn close_line(&mut self, why: Option<Problem>, shell: &mut dyn Shell) {
        self.line = match std::mem::replace(&mut self.line, Line::Off) {
            Line::Off => return,
            Line::Connecting { .. } => Line::Off,
            Line::Open(open) => {
                let line = open.line;
                shell.ask(Request::Close(line));
                Line::Closing { line, then: None }
            }
            Line::Closing { line, .. } => {
                self.line = Line::Closing { line, then: None };
                return;
            }
        };
        self.frame_waits = false;
        if let Some(pipeline) = &mut self.pipeline {
            pipeline.forget_puppet();
        }
        shell.tell(EngineEvent::Disconnected { problem: why });
    }

    pub(super) fn hear_connected(
        &mut self,
        line: LineId,
        outcome: Result<OpenLine, Failure>,
        shell: &mut dyn Shell,
    ) -> Result<(), Failure> {
        let address = match &mut self.line {
            Line::Connecting { line: awaited, address } if *awaited == line => std::mem::take(address),
            _ => {
                // Somebody changed their mind meanwhile.
                if outcome.is_ok() {
                    shell.ask(Request::Close(line));
                }
                return Ok(());
            }
        };
        self.line = Line::Off;
        let opened = match outcome {
            Ok(opened) => opened,
            Err(failure) if self.run.is_some() || self.calibration_plan.is_some() => return Err(failure),
            Err(failure) => {
                shell.tell(EngineEvent::Disconnected { problem: Some(Problem::from(&failure)) });
                return Ok(());
            }
        };
        shell.tell(EngineEvent::LineOpened { line: opened.address, process: opened.process });
        opened.doubts.into_iter().for_each(|doubt| shell.tell(EngineEvent::Problem(doubt)));
        let calibration = match opened.calibration {
            None => self.settings.calibration.clone(),
            Some(Ok(calibration)) => calibration,
            Some(Err(failure)) => {
                shell.tell(EngineEvent::Problem(Problem::from(&failure)));
                Calibration::default()
            }
        };
        if let Some(pipeline) = &mut self.pipeline {
            pipeline.expect_puppet(calibration.clone(), opened.hints.clone());
        }
        self.frame_clock = FrameClock::default();
        let counters = SessionCounters::default();
        let began = opened.began;
        let open = Open {
            line,
            address,
            began,
            counters,
            calibration,
            hints: opened.hints,
            topology: None,
            streams: false,
            refused: None,
        };
        self.line = Line::Open(Box::new(open));
        Ok(())
    }

    pub(super) fn hear_line(
        &mut self,
        now: f64,
        line: LineId,
        counters: SessionCounters,
        news: LineNews,
        shell: &mut dyn Shell,
    ) -> Result<(), Failure> {
        match &mut self.line {
            Line::Open(open) if open.line == line => open.counters = counters,
            Line::Closing { line: closing, then } if *closing == line => {
                if matches!(news, LineNews::Closed) {
                    let then = then.take();
                    self.line = Line::Off;
                    self.tell_run_over(counters, shell);
                    if let Some(address) = then {
                        self.open_line(address, shell);
                    }
                }
                return Ok(());
            }
            // What comes late from a line that was given up.
            _ => return Ok(()),
        }
        match news {
            LineNews::Event(event) => self.hear_event(now, &event, shell),
            LineNews::Over | LineNews::Closed => {
                let problem = DeviceProblem::Disconnected { reason: LINE_CLOSED.into() };
                self.hear_event(now, &Event::Problem(problem), shell)
            }
        }
    }

    fn hear_event(&mut self, now: f64, event: &Event, shell: &mut dyn Shell) -> Result<(), Failure> {
        if let Some(run) = &mut self.run {
            run.note(event, now)?;
        }
        if self.calibration_plan.is_some() {
            CalibrationPlan::note(event)?;
        }
        let Line::Open(open) = &mut self.line else { return Ok(()) };
        match event {
            Event::Topology(topology) => open.topology = Some(topology.clone()),
            Event::Connected(info) => {
                let (address, device) = (open.address.clone(), frames::device_line(info));
                shell.tell(EngineEvent::Connected { address, device });
            }
            Event::Notice(notice) => {
                let problem = Problem::of(notice);
                shell.tell(match notice {
                    DeviceNotice::WaitsForStart | DeviceNotice::LineWaits { .. } => EngineEvent::Waiting(problem),
                    _ => EngineEvent::Problem(problem),
                });
                match notice {
                    DeviceNotice::LineLost { .. } => shell.tell(EngineEvent::LineBroken),
                    DeviceNotice::LineBack { .. } => shell.tell(EngineEvent::LineRestored),
                    _ => {}
                }
            }
            // A run ends by itself and says so.
            Event::Problem(DeviceProblem::Disconnected { .. }) if self.run.is_some() => {}
            Event::Problem(problem @ DeviceProblem::Disconnected { .. }) => {
                self.disconnect(Some(Problem::of(problem)), shell);
                return Ok(());
            }
            Event::Problem(problem) => {
                if let DeviceProblem::Refused { .. } = problem {
                    open.refused = Some(problem.clone());
                }
                shell.tell(EngineEvent::Problem(Problem::of(problem)));
            }
            Event::Sample(_) => open.refused = None,
            _ => {}
        }
        self.pass_on(now, event, shell)
    }

    /// A character that comes after its puppet gets to know it.
    pub(super) fn introduce_puppet(&mut self, now: f64, shell: &mut dyn Shell) -> Result<(), Failure> {
        let (Some(pipeline), Line::Open(open)) = (&self.pipeline, &self.line) else { return Ok(()) };
        match &open.topology {
            Some(topology) if pipeline.tree().is_none() => self.pass_on(now, &Event::Topology(topology.clone()), shell),
            _ => Ok(()),
        }
    }

    /// Lets the puppet move the character.
    fn pass_on(&mut self, now: f64, event: &Event, shell: &mut dyn Shell) -> Result<(), Failure> {
        let Some(pipeline) = &mut self.pipeline else { return Ok(()) };
        let is_told = pipeline.puppeteer().prepares_long();
        let handled = preparing(is_told, shell, |progress| pipeline.handle_with(event, progress));
        let Outcome { posed, zeroed, new_topology, calibrated } = handled?;
        if new_topology {
            tell_unprepared(pipeline.puppeteer().ik_problem().cloned(), shell);
            let awaits_rest_pose = pipeline.puppeteer().awaits_rest_pose();
            self.tell_topology(shell);
            if awaits_rest_pose {
                shell.tell(EngineEvent::RestPoseAwaited);
            }
            self.tell_replaced(shell);
            self.ask_for_samples(shell);
        }
        if let Some(report) = zeroed {
            shell.tell(EngineEvent::Zeroed { sensors: report.zeroed, unreadable: report.skipped.len() });
            self.keep_calibration(shell);
        }
        if let Some(finished) = calibrated {
            self.calibration_step_over(finished, shell)?;
        }
        match event {
            Event::Sample(sample) if posed => self.posed(now, sample.received.as_secs_f64(), shell),
            _ => Ok(()),
        }
    }

    /// The character is prepared for the puppet; asked any earlier, samples would wait for that.
    fn ask_for_samples(&mut self, shell: &mut dyn Shell) {
        let Line::Open(open) = &mut self.line else { return };
        if !open.streams {
            open.streams = true;
            let samples_per_second = self.settings.samples_per_second;
            shell.ask(Request::Stream { line: open.line, samples_per_second });
        }
    }

    /// Parts that were zeroed as another kind of part.
    fn tell_replaced(&self, shell: &mut dyn Shell) {
        for uid in self.pipeline.iter().flat_map(|pipeline| pipeline.puppeteer().replaced_parts()) {
            let what = format!("part {uid} is of another kind than when it was calibrated: its calibration is dropped");
            let remedy = "it is zeroed with the next pose; hold the rest pose, and measure its mounting again".into();
            shell.tell(EngineEvent::Problem(Problem { what, remedy }));
        }
    }

    /// A calibration that cannot be saved still holds for this session.
    pub(super) fn keep_calibration(&mut self, shell: &mut dyn Shell) {
        if let (Some(pipeline), Line::Open(open)) = (&self.pipeline, &self.line)
            && let Err(failure) = shell.keep_calibration(open.line, pipeline.puppeteer().calibration())
        {
            let what = format!("the calibration is not saved: {}", failure.what);
            shell.tell(EngineEvent::Problem(Problem { what, remedy: failure.remedy }));
        }
    }
}

/// Reports how far preparing inverse kinematics is, if `is_told`, and ends it if someone cancels or quits meanwhile.
pub(super) fn preparing<T>(
    is_told: bool,
    shell: &mut dyn Shell,
    prepare: impl FnOnce(armature_character::Progress<'_>) -> T,
) -> T {
    let mut is_reported = false;
    let prepared = prepare(&mut |stage, done| {
        if is_told {
            is_reported = true;
            shell.tell(EngineEvent::Busy { task: stage.into(), fraction: Some(done as f32) });
        }
        if shell.is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    if is_reported {
        shell.tell(EngineEvent::Idle);
    }
    prepared
}

/// Says why bones without a joint keep their rest pose.
pub(super) fn tell_unprepared(problem: Option<IkError>, shell: &mut dyn Shell) {
    let (what, remedy) = match problem {
        None => return,
        Some(IkError::Shape(ArapError::Cancelled)) => (
            "preparing inverse kinematics was cancelled: bones without a joint keep their rest pose".to_owned(),
            "load the character again to prepare it",
        ),
        Some(error) => (
            format!("bones without a joint keep their rest pose: {error}"),
            "leave them there with --ik off, or choose another character",
        ),
    };
    shell.tell(EngineEvent::Problem(Problem { what, remedy: remedy.into() }));
}
