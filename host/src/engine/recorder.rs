//! What is performed goes into a take, record by record.

use std::fs::OpenOptions;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use armature_rig::RawSample;
use armature_take::{Event, EventKind, Header, TakeWriter, Totals, WriteError};

use super::performance::{ENGAGE_MICROS, Performance, Step};
use crate::failure::Failure;

/// After so many samples what was written is handed to the operating system, so that a crash of this program loses
/// no more than that.
const FLUSH_EVERY_SAMPLES: u64 = 100;

/// A take being written.
#[derive(Debug)]
pub struct Recorder<W: Write> {
    writer: TakeWriter<W>,
    name: String,
    samples: u64,
    lost: u64,
    first_micros: Option<u64>,
    last_micros: u64,
    /// Whether the take says how parts come back; one in which none does need not.
    engagement_told: bool,
}

/// A take on disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedTake {
    /// Samples in it.
    pub samples: u64,
    /// Samples that never arrived meanwhile.
    pub lost: u64,
    /// Device time from the first sample to the last, microseconds.
    pub micros: u64,
}

/// Says early that a take cannot have this name, before a performance is given for nothing.
pub fn check_take_name(path: &Path) -> Result<(), Failure> {
    if path.exists() { Err(exists_already(path)) } else { Ok(()) }
}

fn exists_already(path: &Path) -> Failure {
    Failure::usage(
        format!("{} exists already, and a take is never written over", path.display()),
        "choose another name, or move the old take away",
    )
}

/// Opens a file for a new take; never writes over an old one.
pub fn create_take(path: &Path) -> Result<BufWriter<std::fs::File>, Failure> {
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder)
            .map_err(|e| Failure::input(format!("{}: {e}", folder.display()), "choose a folder you may write to"))?;
    }
    match OpenOptions::new().write(true).create_new(true).open(path) {
        Ok(file) => Ok(BufWriter::new(file)),
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => Err(exists_already(path)),
        Err(error) => Err(Failure::input(format!("{}: {error}", path.display()), "choose a folder you may write to")),
    }
}

/// The first of `NAME.take`, `NAME-2.take`, … that does not exist yet.
pub fn free_take_name(folder: &Path, name: &str) -> PathBuf {
    let candidate = |n: u32| folder.join(if n < 2 { format!("{name}.take") } else { format!("{name}-{n}.take") });
    (1..u32::MAX).map(candidate).find(|path| !path.exists()).unwrap_or_else(|| candidate(0))
}

impl<W: Write> Recorder<W> {
    /// Begins a take: header, skeleton, and everything needed to solve its samples. The performance forgets what its
    /// sensors said before, so that the take stands on its own.
    pub fn begin(out: W, name: &str, header: &Header, performance: &mut Performance) -> Result<Self, Failure> {
        let header = &Header { inverse_kinematics: performance.begin_take(), ..header.clone() };
        let failed = |error| write_failure(name, &error);
        let mut writer = TakeWriter::new(out, header).map_err(failed)?;
        writer.skeleton(&performance.actor().skeleton).map_err(failed)?;
        let mut recorder = Self {
            writer,
            name: name.to_string(),
            samples: 0,
            lost: 0,
            first_micros: None,
            last_micros: 0,
            engagement_told: false,
        };
        recorder.topology(performance)?;
        Ok(recorder)
    }

    /// The puppet changed: writes topology, calibration and mapping, which hold from here on.
    pub fn topology(&mut self, performance: &Performance) -> Result<(), Failure> {
        let Some((epoch, tree)) = performance.topology() else { return Ok(()) };
        if self.samples > 0 {
            self.event(EventKind::TopologyChange { epoch })?;
            if !self.engagement_told {
                self.engagement(false)?;
            }
        }
        self.writer.topology(epoch, tree).map_err(|e| write_failure(&self.name, &e))?;
        self.calibration(performance)?;
        match performance.mapping() {
            Some(mapping) => self.writer.mapping(mapping).map_err(|e| write_failure(&self.name, &e)),
            None => Ok(()),
        }
    }

    /// How parts come back from here on. `all`: the whole puppet comes back here.
    pub fn engagement(&mut self, all: bool) -> Result<(), Failure> {
        self.engagement_told = true;
        self.writer.engagement(ENGAGE_MICROS, all).map_err(|e| write_failure(&self.name, &e))
    }

    /// Counts mean something else from here on.
    pub fn calibration(&mut self, performance: &Performance) -> Result<(), Failure> {
        self.writer.calibration(performance.calibration()).map_err(|e| write_failure(&self.name, &e))
    }

    /// One sample and the pose that came of it. `host_seconds`: when its last byte arrived, from the take's start.
    pub fn step(
        &mut self,
        sample: &RawSample,
        step: &Step,
        performance: &Performance,
        host_seconds: Option<f64>,
    ) -> Result<(), Failure> {
        let Step::Posed { zeroed } = step else { return Ok(()) };
        if zeroed.is_some() {
            self.calibration(performance)?;
        }
        let failed = |error| write_failure(&self.name, &error);
        self.writer.sample(sample, host_seconds).map_err(failed)?;
        self.writer.pose(sample.sequence, sample.device_micros, performance.pose()).map_err(failed)?;
        self.samples += 1;
        self.first_micros.get_or_insert(sample.device_micros);
        self.last_micros = sample.device_micros;
        if self.samples.is_multiple_of(FLUSH_EVERY_SAMPLES) {
            self.writer.flush().map_err(failed)?;
        }
        Ok(())
    }

    /// Something happened to the stream.
    pub fn event(&mut self, kind: EventKind) -> Result<(), Failure> {
        if let EventKind::LostSamples { count, .. } = kind {
            self.lost += count;
        }
        let device_micros = (self.samples > 0).then_some(self.last_micros);
        let event = Event { device_micros, host_seconds: None, kind };
        self.writer.event(&event).map_err(|e| write_failure(&self.name, &e))
    }

    /// What is written so far.
    pub fn so_far(&self) -> RecordedTake {
        let micros = self.last_micros.saturating_sub(self.first_micros.unwrap_or(self.last_micros));
        RecordedTake { samples: self.samples, lost: self.lost, micros }
    }

    /// What the take's end record will say.
    pub fn totals(&self) -> Totals {
        self.writer.totals()
    }

    /// Ends the take cleanly.
    pub fn finish(self) -> Result<(W, RecordedTake), Failure> {
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
