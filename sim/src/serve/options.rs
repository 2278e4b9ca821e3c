//! The options of `armature-sim`, for every program that starts one.

use std::path::{Path, PathBuf};
use std::time::Duration;

use armature_rig::Motion as RigMotion;
use firmware_protocol::MAX_RECORDS;

use super::ServeSettings;
use crate::body::{Body, BodyError};
use crate::faults::{Faults, NoiseBurst, SensorFault, SensorFaultKind, Unplugging};
use crate::motion::{Motion, TrackEnd};
use crate::motion_file::{MotionFileError, puppet_from_motion};
use crate::puppet::Puppet;
use crate::retarget::retarget;
use crate::servo::{ServoBus, ServoBusError, ServoBusSettings};
use crate::settings::{PuppetSettings, SettingsError};

/// Where to serve.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// On a new pseudo-terminal.
    Pty,
    /// Over TCP at this address.
    Tcp(String),
}

/// Which puppet to emulate, what it does and what goes wrong. Times are in seconds.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// human, human8, spider, hand, joints:N, or a BVH file (one joint a bone); so101-leader, koch-leader, gello or gello-franka:
    /// an arm of bus servos, on a pseudo-terminal only
    #[arg(default_value = "human")]
    pub puppet: String,
    /// rest, walk, wave, walk+wave, wiggle, sweep, or a BVH file of a human figure [default: the puppet's own file, wiggle for joints:N, else walk]
    #[arg(long)]
    pub motion: Option<String>,
    /// Begin a file's motion again when it ends, instead of holding its last frame
    #[arg(long = "loop")]
    pub repeat: bool,
    /// Decides part numbers, magnets, noise and faults
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// The fastest rate it grants, samples a second
    #[arg(long, value_name = "HZ", default_value_t = 1000.0)]
    pub rate: f64,
    /// Hold the rest pose for so long after each start, so that it can be zeroed
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0)]
    pub rest: f64,
    /// Resolution of the sensors, bits in a turn
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
    /// Chance of a flipped bit for each byte
    #[arg(long, value_name = "CHANCE", default_value_t = 0.0)]
    pub flip: f64,
    /// Chance for each byte to get lost
    #[arg(long, value_name = "CHANCE", default_value_t = 0.0)]
    pub drop: f64,
    /// Chance for each byte to come twice
    #[arg(long, value_name = "CHANCE", default_value_t = 0.0)]
    pub duplicate: f64,
    /// Chance for each reading to be wild and marked as outlier
    #[arg(long, value_name = "CHANCE", default_value_t = 0.0)]
    pub outlier: f64,
    /// Chance for each reading to be wild and not marked
    #[arg(long, value_name = "CHANCE", default_value_t = 0.0)]
    pub hidden_outlier: f64,
    /// Noise in place of everything sent: START:DURATION
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
    /// A part that is pulled out with all that hangs on it: `left_elbow@START:DURATION`, or for good: `left_elbow@START`
    #[arg(long, value_name = "PART@START[:DURATION]")]
    pub pull: Vec<String>,
    /// How much too fast the device's clock runs, millionths
    #[arg(long, value_name = "PPM", default_value_t = 0.0, allow_negative_numbers = true)]
    pub drift: f64,
    /// When the device loses power and starts anew
    #[arg(long, value_name = "SECONDS")]
    pub restart: Vec<f64>,
    /// Keep to this line speed (ten bits a byte)
    #[arg(long)]
    pub baud: Option<u32>,
    /// Pull the plug after this time
    #[arg(long, value_name = "SECONDS")]
    pub unplug_after: Option<f64>,
}

/// Why options make no puppet.
#[derive(Debug, thiserror::Error)]
pub enum OptionsError {
    /// A file that cannot be read.
    #[error("cannot read {path}: {source}", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file that is no motion.
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
    /// No such bus of servos.
    #[error(transparent)]
    ServoBus(#[from] ServoBusError),
    /// No such motion.
    #[error("there is no motion called {0:?}; choose rest, walk, wave, walk+wave, wiggle, sweep or a .bvh file")]
    UnknownMotion(String),
    /// A text that does not follow its pattern.
    #[error("{text:?} does not follow the pattern {pattern}; times are in seconds")]
    Pattern {
        /// The text given.
        text: String,
        /// What it should look like.
        pattern: &'static str,
    },
    /// A part that the puppet has not.
    #[error("the puppet has no part called {name:?}; it has {known}")]
    UnknownPart {
        /// The name given.
        name: String,
        /// All labels.
        known: String,
    },
}

impl Default for Options {
    /// As the command line without any option.
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
            // Joints without a meaning have nothing to walk with.
            let motion = if self.puppet.starts_with("joints") { Motion::Wiggle } else { Motion::Walk };
            (Body::preset(&self.puppet, self.seed)?, motion)
        };
        let mut motion = match &self.motion {
            None => own_motion,
            Some(name) if is_motion_file(name) => Motion::Track(retarget(&read_motion(name)?, &body)?.track),
            Some(name) => Motion::by_name(name).ok_or_else(|| OptionsError::UnknownMotion(name.clone()))?,
        };
        if let Motion::Track(track) = &mut motion
            && self.repeat
        {
            track.end = TrackEnd::Repeat;
        }
        Ok(PuppetSettings {
            motion,
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

    /// The bus of servos, if the name is that of an arm; sensors are its servos.
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
            restarts: self.restart.iter().map(|&seconds| micros(seconds)).collect(),
        })
    }
}

fn is_motion_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("bvh"))
}

fn read_motion(path: &str) -> Result<RigMotion, OptionsError> {
    let bytes = std::fs::read(path).map_err(|source| OptionsError::Read { path: path.into(), source })?;
    Ok(armature_formats::read_bvh(&bytes).map_err(|error| error.in_file(path))?)
}

/// Negative and senseless times are 0; more than a u64 holds is for ever.
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
    let (at, duration) = when.split_once(':').map_or((when, None), |(at, duration)| (at, Some(duration)));
    let at_micros = time(at).ok_or_else(wrong)?;
    let for_micros = duration.map(|duration| time(duration).ok_or_else(wrong)).transpose()?;
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
            ..Options::default()
        };
        let settings = options.puppet_settings().unwrap();
        let faults = &settings.faults;
        assert_eq!(faults.noise, [NoiseBurst { start_micros: 1_000_000, duration_micros: 500_000 }]);
        assert_eq!(faults.sensors[0].sensor, 3);
        assert_eq!(faults.unplugged[0].for_micros, Some(2_000_000));
        assert_eq!(faults.unplugged[1].for_micros, None);
        assert_eq!(faults.restarts, [7_000_000]);
        let wrong = |change: fn(&mut Options)| {
            let mut options = Options::default();
            change(&mut options);
            options.puppet_settings().unwrap_err()
        };
        assert!(matches!(wrong(|o| o.burst = vec!["1".into()]), OptionsError::Pattern { .. }));
        assert!(matches!(wrong(|o| o.weak = vec!["x@1:1".into()]), OptionsError::Pattern { .. }));
        assert!(matches!(wrong(|o| o.pull = vec!["head@-1".into()]), OptionsError::Pattern { .. }));
        assert!(matches!(wrong(|o| o.pull = vec!["nose@1".into()]), OptionsError::UnknownPart { .. }));
        assert!(matches!(wrong(|o| o.motion = Some("dance".into())), OptionsError::UnknownMotion(_)));
        assert!(matches!(wrong(|o| o.motion = Some("/none.bvh".into())), OptionsError::Read { .. }));
        assert!(matches!(wrong(|o| o.puppet = "dog".into()), OptionsError::Body(_)));
    }
}
