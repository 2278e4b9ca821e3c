//! What a raw count means as an angle, for each sensor of each part: [`Calibration::zero`],
//! [`SensorCalibration::angle`].

mod sensors;

pub use sensors::{
    Calibration, CalibrationError, PartSettings, SensorCalibration, SensorRange, SkippedSensor, ZeroReport,
};
