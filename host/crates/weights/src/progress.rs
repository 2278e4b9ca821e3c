//! Progress of a long computation, and how it is stopped.

use std::ops::ControlFlow;

/// The progress callback stopped the computation during this stage.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stopped {
    pub(crate) stage: &'static str,
}

/// Reports the current stage and the fraction of the whole that is done.
pub(crate) fn report(
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
    stage: &'static str,
    done: f64,
) -> Result<(), Stopped> {
    match progress(stage, done) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Stopped { stage }),
    }
}
