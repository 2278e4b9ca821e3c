//! The emulated puppet ([`Puppet::step`]) and all its settings ([`PuppetSettings`]).

mod device;
mod line;
mod sensors;
mod settings;
mod timeline;

pub use device::Puppet;
pub use settings::{PuppetSettings, SettingsError};
