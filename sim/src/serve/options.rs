//! The options of `armature-sim`, for every program that starts one.

use std::path::{Path, PathBuf};
use std::time::Duration;

use armature_formats::motion::{BvhMotion, read_bvh};
use armature_rig::Motion as RigMotion;
use firmware_protocol::MAX_RECORDS;

use super::settings::ServeSettings;
use crate::body::{Body, BodyError};
use crate::faults::{ClockFault, ClockFaultKind, Faults, NoiseBurst, SensorFault, SensorFaultKind, Unplugging};
use crate::motion::{Motion, MotionFileError, TrackEnd, puppet_from_motion, retarget};
use crate::puppet::{Puppet, PuppetSettings, SettingsError};
use crate::servo::{ServoBus, ServoBusError, ServoBusSettings};

/// Which puppet to emulate, what it does and what goes wrong. Times are in seconds.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// human, human8, spider, hand, joints:N, or a BVH file (one joint per bone); so101-leader, koch-leader, gello or
    /// gello-franka: an arm of bus servos, on a pseudo-terminal only
    #[arg(default_value = "human")]
    pub puppet: String,
    /// rest, walk, wave, walk+wave, wiggle, sweep, of a human also squat, sit, kick, reach, cartwheel, or a BVH file of a
    /// human figure [default: the puppet's own file, wiggle for joints:N, otherwise walk]
    #[arg(long)]
    pub motion: Option<String>,
    /// Start a file's motion again when it ends, instead of holding its last frame
    #[arg(long = "loop")]
    pub repeat: bool,
    /// Seed for part numbers, magnets, noise and faults
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// The fastest rate it grants, samples per second
    #[arg(long, value_name = "HZ", default_value_t = 1000.0)]
    pub rate: f64,
    /// Hold the rest pose this long after each start, so that it can be zeroed
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0)]
    pub rest: f64,
    /// Sensor resolution, bits per turn
    #[arg(long, default_value_t = 14, value_parser = clap::value_parser!(u8).range(1..=16))]
    pub bits: u8,
    /// Glue every magnet in at 0 instead of at random
    #[arg(long)]
    pub aligned: bool,
    /// Sensors that count backwards, from 0: 3,7
    #[arg(long, value_name = "SENSORS", value_delimiter = ',')]
    pub reverse: Vec<usize>,
    /// Noise of the readings, counts
    #[arg(long, value_name = "COUNTS", default_value_t = 0.0)]
    pub noise: f64,
    /// Chance of a flipped bit, per byte
    #[arg(long, value_name = "CHANCE", default_value_t = 0.0)]
    pub flip: f64,
    /// Chance of a lost byte, per byte
    #[arg(long, value_name = "CHANCE", default_value_t = 0.0)]
    pub drop: f64,
    /// Chance of a byte arriving twice, per byte
    #[arg(long, value_name = "CHANCE", default_value_t = 0.0)]
    pub duplicate: f64,
    /// Chance of a wild reading marked as an outlier, per reading
    #[arg(long, value_name = "CHANCE", default_value_t = 0.0)]
    pub outlier: f64,
    /// Chance of a wild reading that is not marked, per reading
    #[arg(long, value_name = "CHANCE", default_value_t = 0.0)]
    pub hidden_outlier: f64,
    /// Noise instead of everything sent: START:DURATION
    #[arg(long, value_name = "START:DURATION")]
    pub burst: Vec<String>,
    /// A sensor that sticks: SENSOR@START:DURATION
    #[arg(long, value_name = "SENSOR@START:DURATION")]
    pub stuck: Vec<String>,
    /// A sensor that does not answer: SENSOR@START:DURATION
    #[arg(long, value_name = "SENSOR@START:DURATION")]
    pub no_data: Vec<String>,
    /// A sensor with a weak magnet: SENSOR@START:DURATION
    #[arg(long, value_name = "SENSOR@START:DURATION")]
    pub weak: Vec<String>,
    /// A part that is pulled out with everything attached to it: `left_elbow@START:DURATION`, or for good:
    /// `left_elbow@START`
    #[arg(long, value_name = "PART@START[:DURATION]")]
    pub pull: Vec<String>,
    /// How much too fast the device's clock runs, parts per million
    #[arg(long, value_name = "PPM", default_value_t = 0.0, allow_negative_numbers = true)]
    pub drift: f64,
    /// A device clock that shows some seconds more or less: BY@START, or BY@START:DURATION
    #[arg(long, value_name = "BY@START[:DURATION]", allow_hyphen_values = true)]
    pub clock_step: Vec<String>,
    /// A device clock that stands still: START:DURATION
    #[arg(long, value_name = "START:DURATION")]
    pub clock_stand: Vec<String>,
    /// When the device loses power and restarts
    #[arg(long, value_name = "SECONDS")]
    pub restart: Vec<f64>,
    /// Keep to this line speed (ten bits a byte)
    #[arg(long)]
    pub baud: Option<u32>,
    /// Pull the plug after this time
    #[arg(long, value_name = "SECONDS")]
    pub unplug_after: Option<f64>,
}

/// Why the options do not describe a puppet.
#[derive(Debug, thiserror::Error)]
pub enum OptionsError {
    /// A file that cannot be read.
    #[error("cannot read {path}: {source}", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A file that is not a motion.
    #[error(transparent)]
    Format(#[from] armature_formats::FormatError),
    /// A motion that the puppet cannot play.
    #[error(transparent)]
    Motion(#[from] MotionFileError),
    /// No such puppet.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// Impossible settings.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// No such servo bus.
    #[error(transparent)]
    ServoBus(#[from] ServoBusError),
    /// No such motion.
    #[error("there is no motion called {0:?}; choose {known} or a .bvh file", known = Motion::names())]
    UnknownMotion(String),
    /// An exercise that needs a human.
    #[error(
        "{puppet} has no trunk, hips and shoulders for {motion:?}; choose the puppet human or human8, or another motion"
    )]
    NotHuman {
        /// The puppet.
        puppet: String,
        /// The motion.
        motion: String,
    },
    /// A text that does not follow its pattern.
    #[error("{text:?} does not follow the pattern {pattern}; times are in seconds")]
    Pattern {
        /// The text given.
        text: String,
        /// What it should look like.
        pattern: &'static str,
    },
    /// A part that the puppet does not have.
    #[error("the puppet has no part called {name:?}; it has {known}")]
    UnknownPart {
        /// The name given.
        name: String,
        /// All labels.
        known: String,
    },
}

impl Default for Options {
    /// As the command line without options.
    fn default() -> Self {
        #[derive(clap::Parser)]
        struct Line {
            #[command(flatten)]
            options: Options,
        }
        <Line as clap::Parser>::parse_from(["armature-sim"]).options
    }
}

impl Options {
    /// The puppet.
    pub fn puppet(&self) -> Result<Puppet, OptionsError> {
        Ok(Puppet::new(self.puppet_settings()?)?)
    }

    /// The settings of the puppet; reads motion files.
    pub fn puppet_settings(&self) -> Result<PuppetSettings, OptionsError> {
        let (body, own_motion) = if is_motion_file(&self.puppet) {
            let (body, track) = puppet_from_motion(&read_motion(&self.puppet)?, self.seed)?;
            (body, Motion::Track(track))
        } else {
            // Joints without names that mean something cannot walk.
            let motion = if self.puppet.starts_with("joints") { Motion::Wiggle } else { Motion::Walk };
            (Body::preset(&self.puppet, self.seed)?, motion)
        };
        let mut motion = match &self.motion {
            None => own_motion,
            Some(name) if is_motion_file(name) => Motion::Track(retarget(&read_motion(name)?, &body)?.track),
            Some(name) => Motion::by_name(name).ok_or_else(|| OptionsError::UnknownMotion(name.clone()))?,
        };
        if let Motion::Exercise(exercise) = motion
            && !exercise.suits(&body)
        {
            let motion = self.motion.clone().unwrap_or_default();
            return Err(OptionsError::NotHuman { puppet: self.puppet.clone(), motion });
        }
        if let Motion::Track(track) = &mut motion
            && self.repeat
        {
            track.end = TrackEnd::Repeat;
        }
        Ok(PuppetSettings {
            motion,
            leads: true,
            seed: self.seed,
            rest_micros: micros(self.rest),
            counts_per_turn: 1 << self.bits,
            random_zeros: !self.aligned,
            reversed_sensors: self.reverse.clone(),
            noise_counts: self.noise,
            max_rate_millihertz: (self.rate * 1000.0) as u32,
            line_baud: self.baud,
            topology_records: MAX_RECORDS,
            faults: self.faults(&body)?,
            body,
        })
    }

    /// Reads the motion files to be played: what is unusual in them, in sentences.
    pub fn motion_warnings(&self) -> Result<Vec<String>, OptionsError> {
        let files =
            [Some(&self.puppet), self.motion.as_ref()].into_iter().flatten().filter(|name| is_motion_file(name));
        let mut warnings = Vec::new();
        for file in files {
            let read = read_file(file)?;
            warnings.extend(read.warnings.into_iter().map(|warning| format!("{file}: {warning}")));
        }
        Ok(warnings)
    }

    /// The motion that the puppet is made from, if it is made from one.
    pub(super) fn own_motion(&self) -> Result<Option<RigMotion>, OptionsError> {
        is_motion_file(&self.puppet).then(|| read_motion(&self.puppet)).transpose()
    }

    /// The servo bus, if the name is that of an arm; its sensors are the servos.
    pub fn servo_bus(&self) -> Option<Result<ServoBus, OptionsError>> {
        let settings = ServoBusSettings::preset(&self.puppet, self.seed).ok()?;
        Some(self.servo_bus_of(settings))
    }

    fn servo_bus_of(&self, mut settings: ServoBusSettings) -> Result<ServoBus, OptionsError> {
        let no_parts = Body::preset("joints:1", self.seed)?;
        settings.faults = self.faults(&no_parts)?;
        settings.baud = self.baud.unwrap_or(settings.baud);
        Ok(ServoBus::new(settings)?)
    }

    /// How to serve it.
    pub fn serve_settings(&self) -> ServeSettings {
        ServeSettings {
            pace_baud: self.baud,
            unplug_after: self.unplug_after.map(|seconds| Duration::from_micros(micros(seconds))),
            ..ServeSettings::default()
        }
    }

    fn faults(&self, body: &Body) -> Result<Faults, OptionsError> {
        let mut sensors = Vec::new();
        for (texts, kind) in [
            (&self.stuck, SensorFaultKind::Stuck),
            (&self.no_data, SensorFaultKind::NoData),
            (&self.weak, SensorFaultKind::MagnetWeak),
        ] {
            for text in texts {
                sensors.push(sensor_fault(text, kind)?);
            }
        }
        Ok(Faults {
            bit_flip: self.flip,
            byte_drop: self.drop,
            byte_duplicate: self.duplicate,
            noise: self.burst.iter().map(|text| burst(text)).collect::<Result<_, _>>()?,
            sensors,
            outlier: self.outlier,
            hidden_outlier: self.hidden_outlier,
            unplugged: self.pull.iter().map(|text| unplugging(text, body)).collect::<Result<_, _>>()?,
            clock_drift_ppm: self.drift,
            clock: self.clock_faults()?,
            restarts: self.restart.iter().map(|&seconds| micros(seconds)).collect(),
        })
    }
}

impl Options {
    fn clock_faults(&self) -> Result<Vec<ClockFault>, OptionsError> {
        let mut faults = Vec::new();
        for text in &self.clock_step {
            let wrong = || OptionsError::Pattern { text: text.clone(), pattern: "BY@START or BY@START:DURATION" };
            let (by, when) = text.split_once('@').ok_or_else(wrong)?;
            let by_micros = by.parse::<f64>().ok().filter(|by| by.is_finite()).ok_or_else(wrong)? * 1e6;
            let (at_micros, for_micros) = span(when).ok_or_else(wrong)?;
            faults.push(ClockFault { at_micros, for_micros, kind: ClockFaultKind::Steps(by_micros as i64) });
        }
        for text in &self.clock_stand {
            let NoiseBurst { start_micros: at_micros, duration_micros } = burst(text)?;
            faults.push(ClockFault { at_micros, for_micros: Some(duration_micros), kind: ClockFaultKind::Stands });
        }
        Ok(faults)
    }
}

/// `START` or `START:DURATION`.
fn span(text: &str) -> Option<(u64, Option<u64>)> {
    let (at, duration) = text.split_once(':').map_or((text, None), |(at, duration)| (at, Some(duration)));
    let duration = match duration {
        None => None,
        Some(duration) => Some(time(duration)?),
    };
    Some((time(at)?, duration))
}

fn is_motion_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("bvh"))
}

fn read_motion(path: &str) -> Result<RigMotion, OptionsError> {
    Ok(read_file(path)?.motion)
}

fn read_file(path: &str) -> Result<BvhMotion, OptionsError> {
    let bytes = std::fs::read(path).map_err(|source| OptionsError::Read { path: path.into(), source })?;
    Ok(read_bvh(&bytes).map_err(|error| error.in_file(path))?)
}

/// Negative values and NaN become 0; more than a u64 holds means forever.
fn micros(seconds: f64) -> u64 {
    (seconds * 1e6) as u64
}

fn time(text: &str) -> Option<u64> {
    text.parse::<f64>().ok().filter(|seconds| seconds.is_finite() && *seconds >= 0.0).map(micros)
}

fn burst(text: &str) -> Result<NoiseBurst, OptionsError> {
    let wrong = || OptionsError::Pattern { text: text.to_owned(), pattern: "START:DURATION" };
    let (start, duration) = text.split_once(':').ok_or_else(wrong)?;
    let (start_micros, duration_micros) = time(start).zip(time(duration)).ok_or_else(wrong)?;
    Ok(NoiseBurst { start_micros, duration_micros })
}

fn sensor_fault(text: &str, kind: SensorFaultKind) -> Result<SensorFault, OptionsError> {
    let wrong = || OptionsError::Pattern { text: text.to_owned(), pattern: "SENSOR@START:DURATION" };
    let (sensor, when) = text.split_once('@').ok_or_else(wrong)?;
    let sensor = sensor.parse().map_err(|_| wrong())?;
    let NoiseBurst { start_micros, duration_micros } = burst(when).map_err(|_| wrong())?;
    Ok(SensorFault { sensor, kind, start_micros, duration_micros })
}

fn unplugging(text: &str, body: &Body) -> Result<Unplugging, OptionsError> {
    let wrong = || OptionsError::Pattern { text: text.to_owned(), pattern: "PART@START or PART@START:DURATION" };
    let (name, when) = text.rsplit_once('@').ok_or_else(wrong)?;
    let part = body.find(name).ok_or_else(|| {
        let known: Vec<&str> = body.parts().iter().map(|part| part.label.as_str()).collect();
        OptionsError::UnknownPart { name: name.to_owned(), known: known.join(", ") }
    })?;
    let (at_micros, for_micros) = span(when).ok_or_else(wrong)?;
    Ok(Unplugging { part, at_micros, for_micros })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns() {
        let options = Options {
            burst: vec!["1:0.5".into()],
            stuck: vec!["3@2:1".into()],
            pull: vec!["left_elbow@4:2".into(), "head@9".into()],
            restart: vec![7.0],
            clock_step: vec!["-0.5@3".into(), "4294.967296@2:0.01".into()],
            clock_stand: vec!["1:2".into()],
            ..Options::default()
        };
        let settings = options.puppet_settings().unwrap();
        let faults = &settings.faults;
        assert_eq!(faults.noise, [NoiseBurst { start_micros: 1_000_000, duration_micros: 500_000 }]);
        assert_eq!(faults.sensors[0].sensor, 3);
        assert_eq!(faults.unplugged[0].for_micros, Some(2_000_000));
        assert_eq!(faults.unplugged[1].for_micros, None);
        assert_eq!(faults.restarts, [7_000_000]);
        assert_eq!(faults.clock[0].kind, ClockFaultKind::Steps(-500_000));
        assert_eq!((faults.clock[1].kind, faults.clock[1].for_micros), (ClockFaultKind::Steps(1 << 32), Some(10_000)));
        assert_eq!((faults.clock[2].kind, faults.clock[2].at_micros), (ClockFaultKind::Stands, 1_000_000));
        let wrong = |change: fn(&mut Options)| {
            let mut options = Options::default();
            change(&mut options);
            options.puppet_settings().unwrap_err()
        };
        assert!(matches!(wrong(|o| o.burst = vec!["1".into()]), OptionsError::Pattern { .. }));
        assert!(matches!(wrong(|o| o.weak = vec!["x@1:1".into()]), OptionsError::Pattern { .. }));
        assert!(matches!(wrong(|o| o.pull = vec!["head@-1".into()]), OptionsError::Pattern { .. }));
        assert!(matches!(wrong(|o| o.clock_step = vec!["x@1".into()]), OptionsError::Pattern { .. }));
        assert!(matches!(wrong(|o| o.pull = vec!["nose@1".into()]), OptionsError::UnknownPart { .. }));
        assert!(matches!(wrong(|o| o.motion = Some("dance".into())), OptionsError::UnknownMotion(_)));
        assert!(matches!(wrong(|o| o.motion = Some("/none.bvh".into())), OptionsError::Read { .. }));
        assert!(matches!(wrong(|o| o.puppet = "dog".into()), OptionsError::Body(_)));
        let spider_squats = wrong(|o| (o.puppet, o.motion) = ("spider".into(), Some("squat".into())));
        assert!(matches!(spider_squats, OptionsError::NotHuman { .. }));
    }
}
