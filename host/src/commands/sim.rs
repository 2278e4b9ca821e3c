//! `armature sim`

use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use armature_sim::serve::{self, ServeError};
use armature_sim::servo::ServoBus;

use crate::cli::args::SimArgs;
use crate::descriptors;
use crate::engine::sources::simulated;
use crate::failure::Failure;

/// Serves a simulated puppet or arm until the program is ended. First prints a line saying where.
pub fn sim(args: &SimArgs) -> Result<(), Failure> {
    match args.options.servo_bus() {
        Some(bus) => serve_arm(args, bus.map_err(simulated::options_failure)?),
        None => serve_puppet(args),
    }
}

fn serve_puppet(args: &SimArgs) -> Result<(), Failure> {
    let puppet = simulated::puppet(&args.options)?;
    let settings = args.options.serve_settings();
    let stop = stop(args);
    let served = match &args.tcp {
        Some(address) => serve::tcp(puppet, address, &settings, &stop, tell),
        None => serve::pty(puppet, &settings, &stop, tell),
    };
    let report = served.map_err(|e| failed(&e))?;
    tracing::info!(?report, "served");
    Ok(())
}

fn serve_arm(args: &SimArgs, bus: ServoBus) -> Result<(), Failure> {
    if args.tcp.is_some() {
        let what = format!("{} is a servo arm, which cannot be served over TCP", args.options.puppet);
        return Err(Failure::usage(what, "leave out --tcp"));
    }
    let truth = serve::bus(bus, &stop(args), tell).map_err(|e| failed(&e))?;
    tracing::info!(?truth, "served");
    Ok(())
}

fn stop(args: &SimArgs) -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    if args.until_input_ends {
        serve::stop_when_input_ends(stop.clone());
    }
    stop
}

fn tell(address: &str) {
    let mut out = std::io::stdout();
    // Whoever started this may have ended already; then nobody needs the address.
    let _ = writeln!(out, "{address}").and_then(|()| out.flush());
}

fn failed(error: &ServeError) -> Failure {
    let (ServeError::PseudoTerminal(cause) | ServeError::Line(cause) | ServeError::Listen { source: cause, .. }) =
        error
    else {
        return Failure::device(error.to_string(), "");
    };
    if descriptors::are_used_up(cause) {
        return Failure::device(format!("the puppet cannot be served: {cause}"), descriptors::REMEDY);
    }
    Failure::device(error.to_string(), "")
}
