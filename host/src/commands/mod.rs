//! What each subcommand does, one file or folder each.

mod bind;
mod calibrate;
mod demo;
mod devices;
mod edit;
mod export;
mod functions;
mod inspect;
mod mapping_words;
#[cfg(not(feature = "window"))]
mod no_window;
mod puppet;
mod replay;
mod retarget;
mod rig;
mod run;
mod sim;
mod surface;
mod volume;
mod weights;
#[cfg(feature = "window")]
mod window;

pub use bind::bind;
pub use calibrate::calibrate;
pub use demo::demo;
pub use devices::devices;
pub use edit::edit;
pub use export::export;
pub use functions::{interpolate, smooth};
pub use inspect::inspect;
#[cfg(not(feature = "window"))]
pub use no_window::window;
pub use puppet::puppet;
pub use replay::replay;
pub use retarget::retarget;
pub use rig::rig;
pub use run::run;
pub use sim::sim;
pub use surface::surface;
pub use volume::volume;
pub use weights::weights;
#[cfg(feature = "window")]
pub use window::window;

use crate::bench::bench;
use crate::cli::Command;
use crate::cli::args::WindowArgs;
use crate::failure::Failure;
use crate::terminal::Talk;

/// Does what a subcommand says; without one, opens the window.
pub fn dispatch(command: Option<Command>, talk: Talk) -> Result<(), Failure> {
    match command.unwrap_or_else(|| Command::Window(WindowArgs::default())) {
        Command::Demo(args) => demo(&args, talk),
        Command::Devices(args) => devices(&args),
        Command::Puppet(args) => puppet(&args),
        Command::Inspect(args) => inspect(&args),
        Command::Rig(args) => rig(&args, talk),
        Command::Bind(args) => bind(&args, talk),
        Command::Weights(args) => weights(&args, talk),
        Command::Smooth(args) => smooth(&args, talk),
        Command::Interpolate(args) => interpolate(&args, talk),
        Command::Volume(args) => volume(&args, talk),
        Command::Surface(command) => surface(&command, talk),
        Command::Run(args) => run(&args, talk),
        Command::Calibrate(args) => calibrate(&args, talk),
        Command::Replay(args) => replay(&args, talk),
        Command::Edit(args) => edit(&args, talk),
        Command::Export(args) => export(&args, talk),
        Command::Retarget(args) => retarget(&args, talk),
        Command::Bench(args) => bench(&args),
        Command::Sim(args) => sim(&args),
        Command::Window(args) => window(&args),
    }
}
