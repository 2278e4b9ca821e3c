//! Serving an emulated puppet in real time, on a pseudo-terminal or over TCP.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::faults::Truth;
use crate::puppet::Puppet;

mod bus;
mod options;
#[cfg(unix)]
mod pseudo_terminal;
mod queue;
mod socket;

pub use bus::bus;
pub use options::{Options, OptionsError, Place};

use queue::Queue;

/// How often at least the loop looks whether it is to stop.
const LOOK_UP: Duration = Duration::from_millis(50);
/// Shortest sleep while a paced line has bytes to send.
const PACED_SLEEP: Duration = Duration::from_micros(500);

/// How to serve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServeSettings {
    /// Keep to this line speed, bits a second with ten bits a byte; a pseudo-terminal itself has none.
    pub pace_baud: Option<u32>,
    /// Bytes kept for a host that does not read; what comes after is lost, in whole frames, as in a real device.
    pub buffer_bytes: usize,
    /// Pull the plug after this time: the terminal or connection goes away.
    pub unplug_after: Option<Duration>,
}

impl Default for ServeSettings {
    /// Full speed, a second's worth of buffer, no unplugging.
    fn default() -> Self {
        Self { pace_baud: None, buffer_bytes: 256 * 1024, unplug_after: None }
    }
}

/// What happened while serving.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ServeReport {
    /// What the puppet really did.
    pub truth: Truth,
    /// Bytes that left.
    pub bytes_sent: u64,
    /// Frames lost because nobody read (or nobody was connected) and the buffer was full.
    pub frames_dropped: u64,
    /// Bytes of those.
    pub bytes_dropped: u64,
}

/// Why serving failed.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// No pseudo-terminal.
    #[error("cannot open a pseudo-terminal: {0}; serve over TCP instead")]
    PseudoTerminal(io::Error),
    /// This system has none.
    #[error("this system has no pseudo-terminals; serve over TCP instead")]
    NoPseudoTerminals,
    /// The address cannot be listened at.
    #[error("cannot listen at {address}: {source}; choose another address or port (port 0 lets the system choose)")]
    Listen {
        /// The address given.
        address: String,
        /// What the system says.
        source: io::Error,
    },
    /// The line broke.
    #[error("the line to the host broke: {0}")]
    Line(#[from] io::Error),
}

/// A line to a host.
trait Port {
    /// Appends what has come.
    fn receive(&mut self, bytes: &mut Vec<u8>) -> io::Result<()>;
    /// Sends what goes without waiting; `None` if nobody is there.
    fn send(&mut self, bytes: &[u8]) -> io::Result<Option<usize>>;
    /// Sleeps until something comes, there is room to send (if wanted), or the time is over.
    fn wait(&mut self, for_room: bool, timeout: Duration);
}

/// Serves on a new pseudo-terminal until `stop` is set or the plug is pulled. `ready` is told the address,
/// `serial:/dev/pts/N`, as soon as a host may open it.
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

/// Serves over TCP at `address` (`127.0.0.1:0` lets the system choose a port) until `stop` is set or the plug is
/// pulled; one host at a time, the next when it has gone. `ready` is told the address, `tcp:127.0.0.1:PORT`.
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

/// The loop: hear, step, send, sleep until the next sample is due or something comes.
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

/// A puppet served by a thread of its own.
#[derive(Debug)]
pub struct Background {
    address: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<ServeReport, ServeError>>>,
}

impl Background {
    /// Serves at a place, returning when a host may connect.
    pub fn start(puppet: Puppet, place: Place, settings: ServeSettings) -> Result<Self, ServeError> {
        let stop = Arc::new(AtomicBool::new(false));
        let (sender, receiver) = std::sync::mpsc::channel();
        let stop_of_thread = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let ready = |address: &str| drop(sender.send(address.to_owned()));
            match place {
                Place::Pty => pty(puppet, &settings, &stop_of_thread, ready),
                Place::Tcp(at) => tcp(puppet, &at, &settings, &stop_of_thread, ready),
            }
        });
        // The sender is gone without a word only if the place could not be opened: the thread knows why.
        let started = Self { address: receiver.recv().unwrap_or_default(), stop, thread: Some(thread) };
        if started.address.is_empty() {
            let ended = started.finish();
            return Err(ended.err().unwrap_or_else(|| ServeError::Line(io::ErrorKind::UnexpectedEof.into())));
        }
        Ok(started)
    }

    /// Where it is served: `serial:/dev/pts/N` or `tcp:HOST:PORT`.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Stops, which unplugs the device, and tells what happened.
    pub fn finish(mut self) -> Result<ServeReport, ServeError> {
        self.stop.store(true, Ordering::Relaxed);
        let broken = || ServeError::Line(io::Error::other("the serving thread panicked"));
        self.thread.take().map_or_else(|| Err(broken()), |thread| thread.join().map_err(|_| broken())?)
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

/// Sets `stop` when standard input ends: a program that serves for another one then goes with it, whichever way that
/// one ends.
pub fn stop_when_input_ends(stop: Arc<AtomicBool>) {
    std::thread::spawn(move || {
        let mut sink = io::sink();
        drop(io::copy(&mut io::stdin().lock(), &mut sink));
        stop.store(true, Ordering::Relaxed);
    });
}
