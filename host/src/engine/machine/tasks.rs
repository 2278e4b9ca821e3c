//! What a person asked for and the clock ends: runs, recordings, calibration steps.

use std::path::PathBuf;

use armature_device::SessionCounters;
use armature_rig::{CalibrationStep, Progress, StepError, StepReport};
use armature_take::Header;

use super::line::Line;
use super::{Engine, EngineEvent, LoadedCharacter, Pipeline, Problem, Shell, TakeName};
use crate::engine::calibrating::{in_seconds, no_samples, step_failure};
use crate::engine::run::PATIENCE_SECONDS;
use crate::engine::take_recorder::{RecordedTake, take_header};
use crate::failure::Failure;
use crate::files;

/// A take that has ended.
struct FinishedTake {
    path: PathBuf,
    recorded: RecordedTake,
    /// Where it is, if the file that it was to replace was kept.
    beside: Option<PathBuf>,
}

impl Engine {
    /// A sample has posed the character. `received`: by its session's clock.
    pub(super) fn posed(&mut self, now: f64, received: f64, shell: &mut dyn Shell) -> Result<(), Failure> {
        let is_seen = self.draws_puppet();
        let (Some(pipeline), Line::Open(open)) = (&mut self.pipeline, &self.line) else { return Ok(()) };
        let latency = shell.age(open.began + received);
        pipeline.posed(latency);
        if let Some(sample) = pipeline.latest_sample() {
            let (seconds, puppeteer) = (sample.device_micros as f64 * 1e-6, pipeline.puppeteer());
            shell.posed(seconds, puppeteer.model_from_bone(), puppeteer.shapes());
        }
        if self.settings.draws {
            self.frame_clock.sample(latency.unwrap_or_default(), now);
            self.frame_waits = is_seen;
        }
        let Some(run) = self.run.as_mut().filter(|_| pipeline.is_ready()) else { return Ok(()) };
        if !run.waits() {
            run.posed(latency);
            return Ok(());
        }
        run.begin(now);
        match run.plan().record.clone() {
            Some(path) => {
                let (header, overwrite) = (run.plan().header.clone(), run.plan().overwrite);
                self.begin_take(now, TakeName::Path { path, overwrite }, Some(header), shell)
            }
            None => Ok(()),
        }
    }

    pub(super) fn look_after_run(&mut self, now: f64, shell: &mut dyn Shell) -> Result<(), Failure> {
        let (Some(run), Some(pipeline)) = (&mut self.run, &self.pipeline) else { return Ok(()) };
        let mut counters = SessionCounters::default();
        if let Line::Open(open) = &self.line {
            let described = pipeline.tree().is_some();
            run.check_patience(now - open.began, described, open.refused.as_ref())?;
            counters = open.counters;
        }
        if run.is_over(now) {
            self.end_run(now, None, shell);
        } else if let Some((task, done)) = run.status(now, pipeline.puppeteer(), &counters) {
            shell.tell(EngineEvent::Busy { task, fraction: Some(done as f32) });
        }
        Ok(())
    }

    /// Ends the run: its take at once; what it came to is reported when the line is closed. `failure`: why nothing
    /// came of it.
    pub(super) fn end_run(&mut self, now: f64, failure: Option<Failure>, shell: &mut dyn Shell) {
        let Some(run) = self.run.take() else { return };
        let take = self.finish_take(failure.is_none());
        if let Ok(Some(FinishedTake { path, beside: Some(beside), .. })) = &take {
            let what = format!("{} is not replaced; the take of this run is {}", path.display(), beside.display());
            shell.tell(EngineEvent::Problem(Problem { what, remedy: String::new() }));
        }
        let take = take.map(|take| take.map(|FinishedTake { path, recorded, .. }| (path, recorded)));
        let period = 1.0 / self.settings.samples_per_second;
        let outcome = match (failure, &self.pipeline) {
            (Some(failure), _) => Err(failure),
            (None, None) => Err(Failure::usage("there was no character to perform with", "load one first")),
            (None, Some(pipeline)) => {
                let on_virtual_clock = shell.age(now).is_none();
                take.and_then(|take| run.finish(now, period, on_virtual_clock, pipeline.puppeteer(), take))
            }
        };
        self.run_over = Some(outcome);
        self.close_line(None, shell);
        if matches!(self.line, Line::Off) {
            self.tell_run_over(SessionCounters::default(), shell);
        }
    }

    pub(super) fn tell_run_over(&mut self, counters: SessionCounters, shell: &mut dyn Shell) {
        if let Some(mut outcome) = self.run_over.take() {
            if let Ok(summary) = &mut outcome {
                summary.counters = counters;
            }
            shell.tell(EngineEvent::RunOver(Box::new(outcome)));
        }
    }

    /// Whether a take can begin, and the character that it would be of.
    pub(super) fn ready_to_record(&self) -> Result<&LoadedCharacter, Failure> {
        let (Some(pipeline), Line::Open(_)) = (&self.pipeline, &self.line) else {
            return Err(Failure::usage("there is no puppet to record", "connect one first"));
        };
        if !pipeline.is_ready() {
            return Err(Failure::usage(
                "the rest pose is not known yet",
                "hold the puppet in its rest pose and press Zero",
            ));
        }
        Ok(pipeline.puppeteer().character())
    }

    /// Starts a take of the puppet alone; a take that is shown is closed.
    pub(super) fn start_recording(&mut self, now: f64, shell: &mut dyn Shell) -> Result<(), Failure> {
        if self.recording.is_some() {
            return Ok(());
        }
        let name = files::name_of(std::path::Path::new(&self.ready_to_record()?.name));
        self.close_take(shell);
        self.record_as(now, TakeName::After(name), shell)
    }

    pub(super) fn record_as(&mut self, now: f64, name: TakeName, shell: &mut dyn Shell) -> Result<(), Failure> {
        self.begin_take(now, name, None, shell)?;
        shell.tell(EngineEvent::Recording { seconds: 0.0, samples: 0 });
        Ok(())
    }

    fn begin_take(
        &mut self,
        now: f64,
        name: TakeName,
        header: Option<Header>,
        shell: &mut dyn Shell,
    ) -> Result<(), Failure> {
        let (Some(pipeline), Line::Open(open)) = (&mut self.pipeline, &self.line) else { return Ok(()) };
        let new = shell.create_take(name)?;
        let header = header.unwrap_or_else(|| Header {
            unix_micros: new.unix_micros,
            ..take_header(pipeline.puppeteer().character(), self.settings.samples_per_second)
        });
        pipeline.start_recording(new.file, &new.path.display().to_string(), &header, now - open.began)?;
        self.recording = Some(new.path);
        Ok(())
    }

    /// The end of every take, however it came about: its last record, and all of it safe on the disk. `succeeded`: it
    /// takes the place of the file that it was to replace, if there is one.
    fn finish_take(&mut self, succeeded: bool) -> Result<Option<FinishedTake>, Failure> {
        let path = self.recording.take().unwrap_or_default();
        let Some((mut file, recorded)) = self.pipeline.as_mut().map_or(Ok(None), Pipeline::stop_recording)? else {
            return Ok(None);
        };
        let settled = file.settle(succeeded);
        let beside =
            settled.map_err(|e| Failure::input(format!("{}: {e}", path.display()), "free some space on the disk"))?;
        Ok(Some(FinishedTake { path, recorded, beside }))
    }

    pub(super) fn stop_recording(&mut self, shell: &mut dyn Shell) {
        match self.finish_take(true) {
            Ok(Some(FinishedTake { path, recorded: RecordedTake { samples, lost, micros }, .. })) => {
                shell.tell(EngineEvent::Saved { path: path.clone(), seconds: micros as f64 * 1e-6, samples, lost });
                self.take_saved(&path, shell);
            }
            Ok(None) => {}
            Err(failure) => shell.tell(EngineEvent::RecordingFailed(Problem::from(&failure))),
        }
    }

    /// Whether the take could not be written on and was given up.
    pub(super) fn recording_broke(&mut self) -> bool {
        let is_written = self.pipeline.as_ref().is_some_and(|pipeline| pipeline.recorded().is_some());
        !is_written && self.recording.take().is_some()
    }

    pub(super) fn is_calibrating(&self) -> bool {
        let under_way = self.pipeline.as_ref().is_some_and(|pipeline| pipeline.calibrating(0.0).is_some());
        under_way || self.calibration_plan.is_some()
    }

    pub(super) fn begin_calibration_step(&mut self, now: f64, step: CalibrationStep) -> Result<(), Failure> {
        let (Some(pipeline), Line::Open(open)) = (&mut self.pipeline, &self.line) else {
            return Err(Failure::usage("there is no puppet to calibrate", "connect one first"));
        };
        pipeline.begin_calibration(step, self.settings.step_times, now - open.began);
        Ok(())
    }

    /// Begins the next step, reports where the one under way stands, and ends it where no sample comes to do so.
    pub(super) fn look_after_calibration(&mut self, now: f64, shell: &mut dyn Shell) -> Result<(), Failure> {
        let (Some(pipeline), Line::Open(open)) = (&mut self.pipeline, &self.line) else { return Ok(()) };
        let session_now = now - open.began;
        if let Some(plan) = &mut self.calibration_plan {
            if pipeline.latest_sample().is_none() {
                return if session_now > PATIENCE_SECONDS { Err(no_samples(open.refused.as_ref())) } else { Ok(()) };
            }
            if let Some(step) = plan.next() {
                pipeline.begin_calibration(step, self.settings.step_times, session_now);
            }
        }
        match pipeline.calibrating(session_now) {
            None => Ok(()),
            Some((_, Progress::Over)) => match pipeline.calibrate(session_now)? {
                Some(finished) => {
                    self.calibration_step_over(finished, shell)?;
                    self.look_after_calibration(now, shell)
                }
                None => Ok(()),
            },
            Some((step, progress)) => {
                let seconds = in_seconds(progress);
                if self.calibration_reported != seconds {
                    self.calibration_reported = seconds;
                    shell.tell(EngineEvent::Calibrating { step, progress });
                }
                Ok(())
            }
        }
    }

    pub(super) fn calibration_step_over(
        &mut self,
        finished: Result<StepReport, StepError>,
        shell: &mut dyn Shell,
    ) -> Result<(), Failure> {
        self.calibration_reported = None;
        shell.tell(EngineEvent::Idle);
        let report = finished.map_err(|error| step_failure(&error))?;
        let failed = report.findings.iter().filter(|found| found.finding.is_bad()).count();
        let measured = report.findings.len() - failed;
        shell.tell(EngineEvent::Calibrated { step: report.step, measured, failed });
        self.keep_calibration(shell);
        if let Some(reports) = self.calibration_plan.as_mut().and_then(|plan| plan.step_over(report)) {
            self.calibration_plan = None;
            shell.tell(EngineEvent::CalibrationOver(Ok(reports)));
        }
        Ok(())
    }

    /// Gives up the calibration step that is under way.
    pub(super) fn end_calibration_step(&mut self, shell: &mut dyn Shell) {
        self.calibration_reported = None;
        let Some(pipeline) = &mut self.pipeline else { return };
        if pipeline.calibrating(0.0).is_some() {
            pipeline.cancel_calibration();
            shell.tell(EngineEvent::Idle);
        }
    }
}
