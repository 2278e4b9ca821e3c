//! The host's side of the protocol, pure: bytes and the time in ([`Session::receive`], [`Session::tick`]), events and
//! bytes out. It goes from hello to topology to samples on its own, repeats unanswered requests, follows parts being
//! plugged in and out, survives noise and restarts, and counts losses.

mod assembly;
mod clock;
mod conversation;
mod device_time;
mod puppet_session;
mod requests;
mod sequence;
mod settings;
mod silence;
mod stream;
mod tree;

pub use puppet_session::Session;
pub use settings::SessionSettings;
