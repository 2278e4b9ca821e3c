//! One reading of every sensor: read in place, written straight into the frame.

use super::fields::{Fields, ParseError};
use super::numbers::message_type;
use crate::framing::{Encode, EncodeError, FrameWriter, MAX_PAYLOAD};

const HEADER_LENGTH: usize = 16;

/// The most sensors one sample holds.
pub const MAX_SENSORS: usize = (MAX_PAYLOAD - HEADER_LENGTH) * 4 / 9;

/// Payload bytes of a sample of `sensor_count` sensors.
pub const fn sample_payload_length(sensor_count: usize) -> usize {
    HEADER_LENGTH + 2 * sensor_count + sensor_count.div_ceil(4)
}

/// What a sensor says about its own reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SensorState {
    /// The count is good.
    #[default]
    Ok,
    /// There is no count; the number beside it means nothing.
    NoData,
    /// The magnet is too weak or too far away; the count is a guess.
    MagnetWeak,
    /// The device itself distrusts this count.
    Outlier,
}

impl SensorState {
    /// Its two bits on the wire.
    pub const fn code(self) -> u8 {
        match self {
            Self::Ok => 0,
            Self::NoData => 1,
            Self::MagnetWeak => 2,
            Self::Outlier => 3,
        }
    }

    /// The state with these two bits; higher bits are ignored.
    pub const fn from_code(code: u8) -> Self {
        match code & 3 {
            0 => Self::Ok,
            1 => Self::NoData,
            2 => Self::MagnetWeak,
            _ => Self::Outlier,
        }
    }
}

/// A sample as received: a view of its payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample<'a> {
    /// When the sensors were read, microseconds of the device's clock.
    pub device_micros: u64,
    /// One more for each sample taken; a gap is a loss.
    pub sequence: u32,
    /// The tree the sensors are numbered by.
    pub epoch: u16,
    counts: &'a [u8],
    states: &'a [u8],
}

impl<'a> Sample<'a> {
    pub(super) fn parse(fields: &Fields<'a>) -> Result<Self, ParseError> {
        let sensor_count = usize::from(fields.u16(14)?);
        Ok(Self {
            device_micros: fields.u64(0)?,
            sequence: fields.u32(8)?,
            epoch: fields.u16(12)?,
            counts: fields.bytes(HEADER_LENGTH, 2 * sensor_count)?,
            states: fields.bytes(HEADER_LENGTH + 2 * sensor_count, sensor_count.div_ceil(4))?,
        })
    }

    /// How many sensors were read.
    pub const fn sensor_count(&self) -> usize {
        self.counts.len() / 2
    }

    /// Raw count of a sensor; `None` if there is no such sensor.
    pub fn count(&self, sensor: usize) -> Option<u16> {
        self.counts().nth(sensor)
    }

    /// State of a sensor; `None` if there is no such sensor.
    pub fn state(&self, sensor: usize) -> Option<SensorState> {
        if sensor >= self.sensor_count() {
            return None;
        }
        self.states.get(sensor / 4).map(|byte| SensorState::from_code(byte >> (2 * (sensor % 4))))
    }

    /// All raw counts in sensor order.
    pub fn counts(&self) -> impl ExactSizeIterator<Item = u16> + 'a {
        self.counts.chunks_exact(2).map(|bytes| u16::from_le_bytes([bytes[0], bytes[1]]))
    }

    /// All states in sensor order.
    pub fn states(&self) -> impl Iterator<Item = SensorState> + 'a {
        let four = |&byte: &u8| [0, 2, 4, 6].map(|shift| SensorState::from_code(byte >> shift));
        self.states.iter().flat_map(four).take(self.sensor_count())
    }
}

/// A sample to send.
#[derive(Clone, Copy, Debug)]
pub struct SampleMessage<'a> {
    /// When the sensors were read, microseconds of the device's clock.
    pub device_micros: u64,
    /// One more for each sample taken, sent or not.
    pub sequence: u32,
    /// The tree the sensors are numbered by.
    pub epoch: u16,
    /// Raw counts, at most [`MAX_SENSORS`].
    pub counts: &'a [u16],
    /// One state per count.
    pub states: &'a [SensorState],
}

impl Encode for SampleMessage<'_> {
    fn message_type(&self) -> u8 {
        message_type::SAMPLE
    }

    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
        if self.counts.len() > MAX_SENSORS {
            return Err(EncodeError::PayloadTooLong);
        }
        if self.counts.len() != self.states.len() {
            return Err(EncodeError::Inconsistent);
        }
        writer.put_u64(self.device_micros);
        writer.put_u32(self.sequence);
        writer.put_u16(self.epoch);
        writer.put_u16(self.counts.len() as u16);
        self.counts.iter().for_each(|&count| writer.put_u16(count));
        for four in self.states.chunks(4) {
            writer.put_u8(four.iter().rev().fold(0, |bits, state| bits << 2 | state.code()));
        }
        Ok(())
    }
}
