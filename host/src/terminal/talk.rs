//! Progress on a terminal.

use std::ops::ControlFlow;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::interrupt::Interrupt;

const STEPS: u64 = 1000;
const REDRAWS_PER_SECOND: u8 = 15;

/// How much the program reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Talk {
    /// Results and errors only.
    pub quiet: bool,
}

/// A progress bar that appears only on a terminal, and not if the user asked for quiet.
#[derive(Debug)]
pub struct Bar {
    bar: ProgressBar,
    interrupt: Option<Interrupt>,
}

impl Bar {
    /// Shows a bar with a task's name.
    pub fn new(talk: Talk, task: &str) -> Self {
        let bar = ProgressBar::new(STEPS);
        bar.set_draw_target(if talk.quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr_with_hz(REDRAWS_PER_SECOND)
        });
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg:32} [{bar:32}] {percent:>3} %  {elapsed}") {
            bar.set_style(style.progress_chars("━╸ "));
        }
        bar.set_message(task.to_string());
        bar.enable_steady_tick(Duration::from_millis(100));
        Self { bar, interrupt: None }
    }

    /// From now on Ctrl-C stops the work at its next progress report instead of ending the program.
    #[must_use]
    pub fn until_interrupted(mut self) -> Self {
        self.interrupt = Some(Interrupt::catch());
        self
    }

    fn go_on(&self) -> ControlFlow<()> {
        if self.interrupt.as_ref().is_some_and(Interrupt::is_raised) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    /// Shows how far a task is, 0 to 1.
    pub fn show(&self, task: &str, done: f64) {
        if self.bar.message() != task {
            self.bar.set_message(task.to_string());
        }
        self.bar.set_position((done.clamp(0.0, 1.0) * STEPS as f64) as u64);
    }

    /// For work that reports its progress.
    pub fn stages(&self) -> impl FnMut(&'static str, f64) -> ControlFlow<()> + '_ {
        |stage, done| {
            self.show(stage, done);
            self.go_on()
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.finish();
    }
}
