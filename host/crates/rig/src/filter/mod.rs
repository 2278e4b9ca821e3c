//! What is done to a sensor's readings before they move a bone, and the lag it adds ([`Filter::lag_seconds`]).

mod choice;
mod one_euro;

pub use choice::{DEFAULT_PATIENCE_SECONDS, Filter, FilterError};
pub use one_euro::OneEuro;
pub(crate) use one_euro::Smoother;
