//! Settings that users may want to correct, as TOML: calibration of a puppet, and which part drives which bone.

mod calibration;
mod mapping;
mod toml_text;

pub use calibration::{read_calibration, write_calibration};
pub use mapping::{read_mapping, write_mapping};
