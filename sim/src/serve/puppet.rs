//! Serving an emulated puppet in real time, on a pseudo-terminal or over TCP.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::port::{LOOK_UP, Port};
#[cfg(unix)]
use super::pseudo_terminal;
use super::queue::Queue;
use super::settings::{ServeError, ServeReport, ServeSettings};
use super::socket;
use crate::puppet::Puppet;

/// Shortest sleep while a paced line has bytes to send.
const PACED_SLEEP: Duration = Duration::from_micros(500);

/// Serves on a new pseudo-terminal until `stop` is set or the puppet is unplugged. `ready` gets the address,
/// `serial:/dev/pts/N`, as soon as a host can open it.
pub fn pty(
    puppet: Puppet,
    settings: &ServeSettings,
    stop: &AtomicBool,
    ready: impl FnOnce(&str),
) -> Result<ServeReport, ServeError> {
    #[cfg(unix)]
    {
        let (mut port, path) = pseudo_terminal::open().map_err(ServeError::PseudoTerminal)?;
        ready(&format!("serial:{path}"));
        serve(puppet, &mut port, settings, stop)
    }
    #[cfg(not(unix))]
    {
        let _ = (puppet, settings, stop, ready);
        Err(ServeError::NoPseudoTerminals)
    }
}

/// Serves over TCP at `address` (`127.0.0.1:0` lets the system choose a port) until `stop` is set or the puppet is
/// unplugged; one host at a time, the next once it has disconnected. `ready` gets the address, `tcp:127.0.0.1:PORT`.
pub fn tcp(
    puppet: Puppet,
    address: &str,
    settings: &ServeSettings,
    stop: &AtomicBool,
    ready: impl FnOnce(&str),
) -> Result<ServeReport, ServeError> {
    let fail = |source| ServeError::Listen { address: address.to_owned(), source };
    let mut port = socket::Socket::listen(address).map_err(fail)?;
    ready(&format!("tcp:{}", port.local_address().map_err(fail)?));
    serve(puppet, &mut port, settings, stop)
}

/// The loop: receive, step, send, sleep until the next sample is due or something arrives.
fn serve(
    mut puppet: Puppet,
    port: &mut dyn Port,
    settings: &ServeSettings,
    stop: &AtomicBool,
) -> Result<ServeReport, ServeError> {
    let start = Instant::now();
    let mut queue = Queue::new(settings.buffer_bytes, settings.pace_baud);
    let (mut heard, mut said) = (Vec::new(), Vec::new());
    let ends = |elapsed: Duration| settings.unplug_after.is_some_and(|after| elapsed >= after);
    while !stop.load(Ordering::Relaxed) && !ends(start.elapsed()) {
        heard.clear();
        said.clear();
        port.receive(&mut heard)?;
        let now = start.elapsed().as_micros() as u64;
        puppet.step(now, &heard, &mut said);
        queue.push(&said);
        let mut full = false;
        loop {
            let bytes = queue.sendable(now);
            if bytes.is_empty() {
                break;
            }
            match port.send(bytes)? {
                Some(0) => {
                    full = true;
                    break;
                }
                Some(count) => queue.sent(count),
                None => queue.discard(),
            }
        }
        let now = start.elapsed().as_micros() as u64;
        let due = puppet.next_due_micros().map_or(LOOK_UP, |at| Duration::from_micros(at.saturating_sub(now)));
        let paced = if queue.is_empty() || full { LOOK_UP } else { PACED_SLEEP };
        port.wait(full, due.min(paced).min(LOOK_UP));
    }
    let (bytes_sent, frames_dropped, bytes_dropped) = queue.totals();
    Ok(ServeReport { truth: puppet.truth(), bytes_sent, frames_dropped, bytes_dropped })
}
