//! The weights of shapes: set by hand, or by a joint.

use super::sensor::Sensor;
use crate::mapping::ShapeDrive;

/// A weight is no finite number.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the weight of the shape {shape:?} is {weight}; give a number, 0 for not at all and 1 for wholly")]
pub struct ShapeError {
    /// The shape.
    pub shape: String,
    /// The weight given.
    pub weight: f32,
}

/// Weights of shapes by their names, in the order in which they were first spoken of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShapeWeights {
    names: Vec<String>,
    /// `None` for one that a joint drives which was never read.
    weights: Vec<Option<f32>>,
}

impl ShapeWeights {
    /// Sets a weight; it must be finite.
    pub fn set(&mut self, shape: &str, weight: f32) -> Result<(), ShapeError> {
        if !weight.is_finite() {
            return Err(ShapeError { shape: shape.to_owned(), weight });
        }
        let place = self.place(shape);
        self.weights[place] = Some(weight);
        Ok(())
    }

    /// A shape's weight; `None` for one that was never set.
    pub fn get(&self, shape: &str) -> Option<f32> {
        self.names.iter().position(|name| name == shape).and_then(|place| self.weights[place])
    }

    /// Whether none was set.
    pub fn is_empty(&self) -> bool {
        self.iter().next().is_none()
    }

    /// All that were set, each once.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f32)> {
        self.names.iter().zip(&self.weights).filter_map(|(name, weight)| Some((name.as_str(), (*weight)?)))
    }

    /// Becomes like another, reusing its own storage.
    pub fn copy_from(&mut self, other: &Self) {
        self.names.clone_from(&other.names);
        self.weights.clone_from(&other.weights);
    }

    /// The place of a shape, which is made if it is not there.
    pub(super) fn place(&mut self, shape: &str) -> usize {
        self.names.iter().position(|name| name == shape).unwrap_or_else(|| {
            self.names.push(shape.to_owned());
            self.weights.push(None);
            self.names.len() - 1
        })
    }

    pub(super) fn put(&mut self, place: usize, weight: f32) {
        self.weights[place] = Some(weight);
    }
}

/// A joint that sets a shape's weight.
#[derive(Clone, Debug)]
pub(super) struct ShapeDriver {
    drive: ShapeDrive,
    /// `None` while its part is not plugged in.
    sensor: Option<Sensor>,
    /// The weight shown; `None` before the first good reading.
    shown: Option<f32>,
    /// Its part is back: the weight that was shown, and the device's clock when readings were good again.
    from: Option<(f32, Option<u64>)>,
}

impl ShapeDriver {
    pub(super) fn new(drive: ShapeDrive, sensor: Option<Sensor>) -> Self {
        Self { drive, sensor, shown: None, from: None }
    }

    /// The shape's name.
    pub(super) fn shape(&self) -> &str {
        &self.drive.shape
    }

    /// Its sensor, while its part is plugged in.
    pub(super) fn sensor(&self) -> Option<&Sensor> {
        self.sensor.as_ref()
    }

    /// Takes over from the driver that this one replaces. Where the part was away and is back, the weight glides.
    pub(super) fn continue_from(&mut self, all: &[Self]) {
        let same = |before: &&Self| {
            let (own, other) = (&self.drive, &before.drive);
            (&own.shape, own.part, own.axis) == (&other.shape, other.part, other.axis)
        };
        let Some(before) = all.iter().find(same) else { return };
        self.shown = before.shown;
        let is_back = self.sensor.is_some() && before.sensor.is_none();
        if let (Some(sensor), Some(old)) = (&mut self.sensor, &before.sensor) {
            sensor.continue_from(old, false);
        }
        self.from = if is_back { before.shown.map(|shown| (shown, None)) } else { before.from };
    }

    /// The whole puppet was away.
    pub(super) fn engage(&mut self) {
        self.from = self.shown.map(|shown| (shown, None));
        if let Some(sensor) = &mut self.sensor {
            sensor.forget_smoothing();
        }
    }

    /// Takes a sample; `over`: how long a part that is back takes, microseconds. The weight; `None` before the first good
    /// reading.
    pub(super) fn follow(
        &mut self,
        micros: u64,
        counts: &[u16],
        states: &[crate::puppet::SensorState],
        over: u32,
    ) -> Option<f32> {
        let Some(sensor) = &mut self.sensor else { return self.shown };
        sensor.read(micros, counts[sensor.slot()], states[sensor.slot()]);
        let is_good = sensor.held_samples() == 0;
        if !is_good && self.shown.is_none() {
            return None;
        }
        let measured = self.drive.weight(sensor.angle());
        self.shown = Some(match &mut self.from {
            Some((from, None)) if !is_good => *from,
            Some((from, since)) => {
                let begun = *since.get_or_insert(micros);
                // A clock that has gone back means that the device restarted.
                *since = Some(begun.min(micros));
                let part = micros.saturating_sub(begun) as f64 / f64::from(over.max(1));
                if part < 1.0 && over > 0 {
                    let eased = (part * part * (3.0 - 2.0 * part)) as f32;
                    *from + (measured - *from) * eased
                } else {
                    self.from = None;
                    measured
                }
            }
            None => measured,
        });
        self.shown
    }
}
