//! `armature-sim`: serves an emulated puppet on a pseudo-terminal or over TCP.

use std::io::{self, Write as _};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use armature_sim::serve::{self, Options, ServeReport};
use armature_sim::servo::ServoBusTruth;
use clap::Parser;

/// Emulates a puppet that speaks the wire protocol.
///
/// Prints one line, the address it is served at (`serial:/dev/pts/N` or `tcp:HOST:PORT`), and serves until it is
/// stopped; then prints what really happened, to compare with what the host believes.
#[derive(Debug, Parser)]
#[command(
    version,
    after_help = "Examples:\n  armature-sim human --motion walk\n  armature-sim walk.bvh --tcp \
                                 127.0.0.1:7000\n  armature-sim so101-leader --flip 1e-3 --no-data 2@5:3\n  armature-sim human --motion walk.bvh --flip 1e-4 --burst 3:1 \
                                 --pull left_elbow@5:2"
)]
struct Cli {
    #[command(flatten)]
    options: Options,
    /// Serve over TCP at this address (port 0: the system chooses)
    #[arg(long, value_name = "HOST:PORT", conflicts_with = "pty")]
    tcp: Option<String>,
    /// Serve on a pseudo-terminal, which looks like a serial port (the default)
    #[arg(long)]
    pty: bool,
    /// Stop when standard input ends, as it does when the program that started this one exits
    #[arg(long)]
    until_input_ends: bool,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let outcome = match run_arm(&cli) {
        Some(arm) => arm.map(|truth| format!("{truth:#?}")),
        None => run(&cli).map(|report| format!("{report:#?}")),
    };
    match outcome {
        Ok(report) => {
            eprintln!("{report}");
            ExitCode::SUCCESS
        }
        Err(Failure::Options(error)) => fail(&error, 3),
        Err(Failure::Serve(error)) => fail(&error, 4),
        Err(Failure::ArmOnTcp) => fail(&"a servo arm can only be served on a pseudo-terminal; remove --tcp", 2),
    }
}

enum Failure {
    Options(serve::OptionsError),
    Serve(serve::ServeError),
    /// Servos have no TCP.
    ArmOnTcp,
}

/// Serves an arm of servos, if the name is that of one.
fn run_arm(cli: &Cli) -> Option<Result<ServoBusTruth, Failure>> {
    let bus = cli.options.servo_bus()?;
    if cli.tcp.is_some() {
        return Some(Err(Failure::ArmOnTcp));
    }
    let stop = Arc::new(AtomicBool::new(false));
    if cli.until_input_ends {
        serve::stop_when_input_ends(Arc::clone(&stop));
    }
    Some(bus.map_err(Failure::Options).and_then(|bus| serve::bus(bus, &stop, tell).map_err(Failure::Serve)))
}

fn tell(address: &str) {
    let mut out = io::stdout();
    // The program that started this one may already be gone; then nobody needs the address.
    let _ = writeln!(out, "{address}").and_then(|()| out.flush());
}

fn run(cli: &Cli) -> Result<ServeReport, Failure> {
    for warning in cli.options.motion_warnings().map_err(Failure::Options)? {
        eprintln!("armature-sim: {warning}");
    }
    let puppet = cli.options.puppet().map_err(Failure::Options)?;
    let settings = cli.options.serve_settings();
    let stop = Arc::new(AtomicBool::new(false));
    if cli.until_input_ends {
        serve::stop_when_input_ends(Arc::clone(&stop));
    }
    let report = match &cli.tcp {
        Some(address) => serve::tcp(puppet, address, &settings, &stop, tell),
        None => serve::pty(puppet, &settings, &stop, tell),
    };
    report.map_err(Failure::Serve)
}

fn fail(error: &dyn std::fmt::Display, code: u8) -> ExitCode {
    eprintln!("armature-sim: {error}");
    ExitCode::from(code)
}
