//! Serving an emulated servo bus in real time, on a pseudo-terminal.

use std::sync::atomic::{AtomicBool, Ordering};

use super::settings::ServeError;
use crate::servo::{ServoBus, ServoBusTruth};

/// Serves on a new pseudo-terminal until `stop` is set; then the terminal disappears, as if unplugged. `ready` gets the
/// address, `feetech:/dev/pts/N` or `dynamixel:/dev/pts/N`, as soon as a host can open it. A host whose line is set to
/// another speed than the bus receives and sends garbage, as on a real one.
pub fn bus(mut bus: ServoBus, stop: &AtomicBool, ready: impl FnOnce(&str)) -> Result<ServoBusTruth, ServeError> {
    #[cfg(unix)]
    {
        use std::time::{Duration, Instant};

        use super::port::{LOOK_UP, Port};
        use super::pseudo_terminal;

        let (mut port, path) = pseudo_terminal::open().map_err(ServeError::PseudoTerminal)?;
        ready(&format!("{}:{path}", bus.kind().scheme()));
        let start = Instant::now();
        let (mut heard, mut said) = (Vec::new(), Vec::new());
        while !stop.load(Ordering::Relaxed) {
            heard.clear();
            port.receive(&mut heard)?;
            let now = start.elapsed().as_nanos() as u64;
            bus.step(now, port.host_baud()?, &heard, &mut said);
            // What nobody reads is lost: a bus keeps nothing.
            let taken = port.send(&said)?.unwrap_or(said.len());
            said.drain(..taken);
            let now = start.elapsed().as_nanos() as u64;
            let due = bus.next_due_nanos().map_or(LOOK_UP, |at| Duration::from_nanos(at.saturating_sub(now)));
            port.wait(!said.is_empty(), due.min(LOOK_UP));
        }
        Ok(bus.truth())
    }
    #[cfg(not(unix))]
    {
        let _ = (&mut bus, stop, ready, Ordering::Relaxed);
        Err(ServeError::NoPseudoTerminals)
    }
}
