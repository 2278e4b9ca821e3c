//! The program from start to exit code: parse, log, do, report.

use std::io::IsTerminal;
use std::process::ExitCode;

use tracing_subscriber::Layer as _;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

use crate::cli::Cli;
use crate::commands::dispatch;
use crate::failure::Failure;
use crate::terminal::{Talk, aside, not_printed, printed};

/// Parses the command line, does what it says and reports what went wrong.
pub fn main() -> ExitCode {
    let cli = match Cli::read() {
        Ok(cli) => cli,
        Err(error) => {
            let printed = error.print();
            // Help is a result, a wrong command line is not, whether or not anyone sees it.
            return if error.use_stderr() {
                ExitCode::from(2)
            } else {
                exit_code(printed.or_else(|e| not_printed(&e)))
            };
        }
    };
    init_logging(cli.verbose);
    let talk = Talk { quiet: cli.quiet };
    exit_code(dispatch(cli.command, talk).and_then(|()| printed()))
}

/// Reports what went wrong.
fn exit_code(done: Result<(), Failure>) -> ExitCode {
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            aside!("error: {failure}");
            failure.exit_code()
        }
    }
}

fn init_logging(verbose: u8) {
    let default = ["warn", "info", "debug", "trace"][usize::from(verbose.min(3))];
    // Messages from graphics and window libraries below an error are of no use to an animator.
    let usual = format!("{default},wgpu_core=warn,wgpu_hal=error,naga=warn,winit=error");
    let chosen = std::env::var("ARMATURE_LOG").ok().filter(|levels| !levels.is_empty());
    let targets = match chosen.as_deref().map(str::parse::<Targets>) {
        Some(Ok(targets)) => targets,
        Some(Err(error)) => {
            aside!("note: ARMATURE_LOG is ignored: {error}; give a level, or MODULE=LEVEL with commas between");
            usual.parse().unwrap_or_default()
        }
        None => usual.parse().unwrap_or_default(),
    };
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(verbose > 1)
        .without_time();
    // A second subscriber in one process (tests) keeps the first.
    let _ = tracing_subscriber::registry().with(lines.with_filter(targets)).try_init();
}
