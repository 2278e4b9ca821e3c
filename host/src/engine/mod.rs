//! The engine: puppet, character and take at pose time, for the window and every subcommand that performs.
//!
//! A closed list of [`input`]s goes into one state machine ([`machine`]), pumped by one loop ([`drive`]) from one of
//! the [`sources`]. Below the machine, each event of a puppet passes through the [`pipeline`]: [`bridge`] (wire types
//! to the rig's) → [`puppeteer`] (samples to a posed and skinned character) → [`take_recorder`].

pub mod bridge;
mod calibrating;
pub mod command;
pub mod drive;
pub mod event;
pub mod frames;
pub mod inbox;
pub mod input;
pub mod latency;
pub mod link;
pub mod machine;
mod missed_pins;
pub mod pipeline;
pub mod playback;
mod player;
pub mod puppet_rest;
pub mod puppeteer;
pub mod recast;
mod run;
pub mod run_summary;
mod shaped_skin;
pub mod sources;
pub mod take_recorder;
