//! `armature sim`

use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use armature_sim::serve;

use crate::cli::args::SimArgs;
use crate::engine::simulated;
use crate::failure::Failure;

/// Serves a simulated puppet until the program is ended. Says first, on a line of its own, where.
pub fn sim(args: &SimArgs) -> Result<(), Failure> {
    let puppet = simulated::puppet(&args.options)?;
    let settings = args.options.serve_settings();
    let stop = Arc::new(AtomicBool::new(false));
    if args.until_input_ends {
        serve::stop_when_input_ends(stop.clone());
    }
    let ready = |address: &str| {
        let mut out = std::io::stdout();
        // Whoever started this may have gone already; then nobody needs the address.
        let _ = writeln!(out, "{address}").and_then(|()| out.flush());
    };
    let served = match &args.tcp {
        Some(address) => serve::tcp(puppet, address, &settings, &stop, ready),
        None => serve::pty(puppet, &settings, &stop, ready),
    };
    let report = served.map_err(|e| Failure::device(e.to_string(), ""))?;
    tracing::info!(?report, "served");
    Ok(())
}
