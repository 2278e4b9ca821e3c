//! Samples, poses and what happens to the stream go into a take, record by record.

use std::io::Write;
use std::time::Duration;

use armature_rig::{RawSample, SensorState};
use armature_take::{Event, EventKind, Header, ShapeSetting, TakeWriter, Totals, WriteError};

use super::latency::Latencies;
use super::puppeteer::{ENGAGE_MICROS, Puppeteer, Step};
use crate::characters::{LoadedCharacter, name_in_takes};
use crate::failure::Failure;

/// After this many samples, what was written goes to the operating system, so that a crash of this program loses
/// no more than that.
const FLUSH_EVERY_SAMPLES: u64 = 100;

/// A take being written.
#[derive(Debug)]
pub struct TakeRecorder<W: Write> {
    writer: TakeWriter<W>,
    name: String,
    samples: u64,
    lost: u64,
    clock: TakeClock,
    /// From the last byte of each sample to its pose; nothing where time is simulated.
    latencies: Latencies,
    /// Whether the take says how parts come back; one in which none does need not.
    engagement_told: bool,
    /// Whether the take says how readings come back; one in which none are missing need not.
    return_told: bool,
}

/// How long a take has lasted, also where the device starts again.
#[derive(Clone, Copy, Debug, Default)]
struct TakeClock {
    /// Device time and host time of the latest sample.
    latest: Option<(u64, Option<f64>)>,
    restarted: bool,
    micros: u64,
}

impl TakeClock {
    fn sample(&mut self, micros: u64, host_seconds: Option<f64>) {
        let restarted = std::mem::take(&mut self.restarted);
        if let Some((before, host_before)) = self.latest {
            self.micros += match micros.checked_sub(before) {
                Some(step) if !restarted => step,
                // Its clock has begun again: the host knows how long that took.
                _ => host_seconds.zip(host_before).map_or(0, |(now, then)| ((now - then).max(0.0) * 1e6) as u64),
            };
        }
        self.latest = Some((micros, host_seconds));
    }
}

/// A take on disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedTake {
    /// Samples in it.
    pub samples: u64,
    /// Samples that never arrived meanwhile.
    pub lost: u64,
    /// Device time from the first sample to the last, microseconds; over restarts of the device the host's.
    pub micros: u64,
}

/// The header of a take of this character.
pub fn take_header(character: &LoadedCharacter, samples_per_second: f64) -> Header {
    Header {
        program_version: env!("CARGO_PKG_VERSION").into(),
        character_name: name_in_takes(&character.source),
        character_hash: character.content_hash(),
        nominal_samples_per_second: Some(samples_per_second),
        ..Header::default()
    }
}

impl<W: Write> TakeRecorder<W> {
    /// Begins a take: header, skeleton, and everything needed to solve its samples. The puppeteer forgets what its
    /// sensors said before, so that the take stands on its own.
    pub fn begin(out: W, name: &str, header: &Header, puppeteer: &mut Puppeteer) -> Result<Self, Failure> {
        let header = &Header { inverse_kinematics: puppeteer.begin_take(), ..header.clone() };
        let failed = |error| write_failure(name, &error);
        let mut writer = TakeWriter::new(out, header).map_err(failed)?;
        writer.skeleton(&puppeteer.character().skeleton).map_err(failed)?;
        if let Some(ground) = puppeteer.ground() {
            writer.ground(Some(ground)).map_err(failed)?;
        }
        if let Some(dynamics) = puppeteer.dynamics() {
            writer.dynamics(Some(dynamics)).map_err(failed)?;
        }
        let mut recorder = Self {
            writer,
            name: name.to_string(),
            samples: 0,
            lost: 0,
            clock: TakeClock::default(),
            latencies: Latencies::default(),
            engagement_told: false,
            return_told: false,
        };
        for (name, weight) in puppeteer.shapes().iter() {
            recorder.shape(name, weight)?;
        }
        recorder.topology(puppeteer)?;
        Ok(recorder)
    }

    /// The puppet changed: writes topology, calibration and mapping, which hold from here on.
    pub fn topology(&mut self, puppeteer: &Puppeteer) -> Result<(), Failure> {
        let Some((epoch, tree)) = puppeteer.topology() else { return Ok(()) };
        if self.samples > 0 {
            self.event(EventKind::TopologyChange { epoch })?;
            if !self.engagement_told {
                self.engagement(false)?;
            }
        }
        self.writer.topology(epoch, tree).map_err(|e| write_failure(&self.name, &e))?;
        self.calibration(puppeteer)?;
        match puppeteer.mapping() {
            Some(mapping) => self.writer.mapping(mapping).map_err(|e| write_failure(&self.name, &e)),
            None => Ok(()),
        }
    }

    /// How parts come back from here on. `all`: the whole puppet comes back here.
    pub fn engagement(&mut self, all: bool) -> Result<(), Failure> {
        self.engagement_told = true;
        self.writer.engagement(ENGAGE_MICROS, all).map_err(|e| write_failure(&self.name, &e))
    }

    /// A shape of the character is set by hand.
    pub fn shape(&mut self, name: &str, weight: f32) -> Result<(), Failure> {
        let device_micros = self.clock.latest.map(|(micros, _)| micros);
        let setting = ShapeSetting { device_micros, name: name.to_owned(), weight };
        self.writer.shape(&setting).map_err(|e| write_failure(&self.name, &e))
    }

    /// Counts mean something else from here on.
    pub fn calibration(&mut self, puppeteer: &Puppeteer) -> Result<(), Failure> {
        self.writer.calibration(puppeteer.calibration()).map_err(|e| write_failure(&self.name, &e))
    }

    /// One sample and the pose that came of it. `host_seconds`: when its last byte arrived, from the take's start.
    pub fn step(
        &mut self,
        sample: &RawSample,
        step: &Step,
        puppeteer: &Puppeteer,
        host_seconds: Option<f64>,
    ) -> Result<(), Failure> {
        let Step::Posed { zeroed, told } = step else { return Ok(()) };
        if zeroed.is_some() {
            self.calibration(puppeteer)?;
        }
        let failed = |error| write_failure(&self.name, &error);
        told.iter().try_for_each(|record| self.writer.record(record)).map_err(failed)?;
        let is_missing = |state: &SensorState| matches!(state, SensorState::NoData | SensorState::Outlier);
        if !self.return_told && sample.states.iter().any(is_missing) {
            self.return_told = true;
            self.writer.readings_return(ENGAGE_MICROS).map_err(failed)?;
        }
        self.writer.sample(sample, host_seconds).map_err(failed)?;
        self.writer.pose(sample.sequence, sample.device_micros, puppeteer.pose()).map_err(failed)?;
        self.samples += 1;
        self.clock.sample(sample.device_micros, host_seconds);
        if self.samples.is_multiple_of(FLUSH_EVERY_SAMPLES) {
            self.writer.flush().map_err(failed)?;
        }
        Ok(())
    }

    /// How long the latest sample took from its last byte until the character was posed.
    pub fn posed(&mut self, latency: Duration) {
        self.latencies.add(latency);
    }

    /// Something happened to the stream.
    pub fn event(&mut self, kind: EventKind) -> Result<(), Failure> {
        if let EventKind::LostSamples { count, .. } = kind {
            self.lost += count;
        }
        self.clock.restarted |= kind == EventKind::Restart;
        let device_micros = self.clock.latest.map(|(micros, _)| micros);
        let event = Event { device_micros, host_seconds: None, kind };
        self.writer.event(&event).map_err(|e| write_failure(&self.name, &e))
    }

    /// What is written so far.
    pub fn so_far(&self) -> RecordedTake {
        RecordedTake { samples: self.samples, lost: self.lost, micros: self.clock.micros }
    }

    /// What the take's end record will say.
    pub fn totals(&self) -> Totals {
        self.writer.totals()
    }

    /// Ends the take cleanly.
    pub fn finish(mut self) -> Result<(W, RecordedTake), Failure> {
        if let Some(latency) = self.latencies.measured() {
            let micros = |micros: f64| micros.round() as u32;
            let (p50_micros, p99_micros) = (micros(latency.p50), micros(latency.p99));
            self.event(EventKind::Posing { p50_micros, p99_micros, max_micros: micros(latency.max) })?;
        }
        let recorded = self.so_far();
        let out = self.writer.finish().map_err(|e| write_failure(&self.name, &e))?;
        Ok((out, recorded))
    }
}

fn write_failure(name: &str, error: &WriteError) -> Failure {
    Failure::input(
        format!("{name}: {error}"),
        "make room on the disk; what was recorded until now is safe and `armature inspect` shows it",
    )
}
