//! Serving in the background, or on behalf of another program.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use super::puppet::{pty, tcp};
use super::settings::{Place, ServeError, ServeReport, ServeSettings};
use crate::puppet::Puppet;

/// A puppet served by its own thread.
#[derive(Debug)]
pub struct Background {
    address: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<ServeReport, ServeError>>>,
}

impl Background {
    /// Starts serving; returns as soon as a host can connect.
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
        // The sender goes away silently only if the place could not be opened; the thread's result says why.
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

    /// Stops, which unplugs the device, and reports what happened.
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

/// Sets `stop` when standard input ends, so that a program serving for another one exits with it, however that one
/// ends.
pub fn stop_when_input_ends(stop: Arc<AtomicBool>) {
    std::thread::spawn(move || {
        let mut sink = io::sink();
        drop(io::copy(&mut io::stdin().lock(), &mut sink));
        stop.store(true, Ordering::Relaxed);
    });
}
