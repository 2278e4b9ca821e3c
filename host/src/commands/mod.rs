//! What each subcommand does, one file each.

mod bind;
mod calibrate;
mod decode;
mod demo;
mod devices;
mod export;
mod inspect;
mod inspect_mesh;
mod replay;
mod run;
mod sim;
mod volume;
mod volume_report;
mod weights;
mod weights_report;
mod window;

pub use crate::bench::bench;
pub use bind::bind;
pub use calibrate::calibrate;
pub use demo::demo;
pub use devices::devices;
pub use export::export;
pub use inspect::inspect;
pub use replay::replay;
pub use run::run;
pub use sim::sim;
pub use volume::volume;
pub use weights::weights;
pub use window::window;
