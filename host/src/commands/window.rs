//! `armature` without a subcommand

use std::thread::JoinHandle;

use crate::app::{self, Start};
use crate::characters;
use crate::characters::skin::SkinArgs;
use crate::cli::args::WindowArgs;
use crate::engine::command::CharacterChoice;
use crate::engine::drive::drive;
use crate::engine::event::{EngineEvent, Problem};
use crate::engine::link::EngineLink;
use crate::engine::machine::{Engine, EngineSettings};
use crate::engine::sources::{LiveSettings, LiveSource};
use crate::failure::Failure;

/// Opens the window.
pub fn window(args: &WindowArgs) -> Result<(), Failure> {
    let device = args.device.as_deref().unwrap_or_default();
    let character = args.character.as_deref().unwrap_or_else(|| characters::default_for(device));
    let start = Start { character: CharacterChoice::named(character), device: args.device.clone() };
    let skin = args.skin;
    app::run(start, move |link| spawn_engine(link, skin)).map_err(|e| Failure::device(e.to_string(), ""))
}

/// Starts the engine's thread; it ends when the window closes.
fn spawn_engine(link: EngineLink, skin: SkinArgs) -> JoinHandle<()> {
    std::thread::spawn(move || {
        let (inbox, mut window) = link.into_parts();
        let settings = LiveSettings { keeps_calibration: true, skin, ..LiveSettings::default() };
        match LiveSource::new(inbox, settings) {
            Ok(mut source) => drive(&mut Engine::new(EngineSettings::default()), &mut source, [], &mut window),
            Err(failure) => window.send(EngineEvent::Problem(Problem::from(&failure))),
        }
    })
}
