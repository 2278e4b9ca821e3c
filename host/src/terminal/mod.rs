//! What the program says on a terminal and hears from it: progress, numbers in sentences, Ctrl-C.

mod interrupt;
pub(crate) mod streams;
mod talk;
mod words;

pub use interrupt::{Interrupt, on_request_to_end};
pub(crate) use streams::{aside, out};
pub use streams::{not_printed, printed};
pub use talk::{Bar, Talk};
pub use words::{counted, grouped, plain};
