//! Ctrl-C, a request to end (SIGTERM) and a closed terminal (SIGHUP): work in progress is finished first.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

#[cfg(unix)]
use tokio::signal::unix::{Signal, SignalKind, signal};

use crate::descriptors;

/// The exit code that shells use for a program ended by an interrupt.
const INTERRUPTED: i32 = 130;

/// Who asks the program to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Request {
    /// A person, with Ctrl-C.
    Interrupt,
    /// Another program, or a terminal that is being closed; they may send several signals at once.
    #[cfg(unix)]
    End,
}

/// The requests to end that reach this process. From the first one on, none of them ends it directly.
#[derive(Debug)]
struct Stop {
    #[cfg(unix)]
    interrupt: Signal,
    #[cfg(unix)]
    terminate: Signal,
    /// `None` if whoever started the program wants it to outlive the terminal (`nohup`).
    #[cfg(unix)]
    hang_up: Option<Signal>,
}

#[cfg(unix)]
impl Stop {
    /// Must be called on a tokio runtime with I/O enabled.
    fn listen() -> std::io::Result<Self> {
        let hang_up = if ignores_hang_up() { None } else { Some(signal(SignalKind::hangup())?) };
        Ok(Self { interrupt: signal(SignalKind::interrupt())?, terminate: signal(SignalKind::terminate())?, hang_up })
    }

    /// Waits for the next request.
    async fn requested(&mut self) -> std::io::Result<Request> {
        let hang_up = async {
            match &mut self.hang_up {
                Some(signal) => signal.recv().await,
                None => std::future::pending().await,
            }
        };
        Ok(tokio::select! {
            _ = self.interrupt.recv() => Request::Interrupt,
            _ = self.terminate.recv() => Request::End,
            _ = hang_up => Request::End,
        })
    }
}

#[cfg(not(unix))]
impl Stop {
    /// Must be called on a tokio runtime with I/O enabled.
    fn listen() -> std::io::Result<Self> {
        Ok(Self {})
    }

    /// Waits for the next request.
    async fn requested(&mut self) -> std::io::Result<Request> {
        tokio::signal::ctrl_c().await.map(|()| Request::Interrupt)
    }
}

/// Whether SIGHUP was ignored when the program started.
#[cfg(unix)]
fn ignores_hang_up() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or_default();
    // Signal 1 is the lowest bit.
    mask & 1 != 0
}

/// Passes every request to end to `heard`, which returns whether anybody handles it. A request that nobody handles ends
/// the program at once, and so does Ctrl-C after an earlier request. If the system gives no thread or signal, a request
/// ends the program as usual.
pub fn on_request_to_end(mut heard: impl FnMut() -> bool + Send + 'static) {
    if descriptors::check().is_err() {
        return;
    }
    let wait = move || {
        let Ok(runtime) = tokio::runtime::Builder::new_current_thread().enable_all().build() else { return };
        runtime.block_on(async move {
            let Ok(mut stop) = Stop::listen() else { return };
            let mut is_ending = false;
            while let Ok(request) = stop.requested().await {
                if is_ending && request == Request::Interrupt || !heard() {
                    std::process::exit(INTERRUPTED);
                }
                is_ending = true;
            }
        });
    };
    // Without the thread, only a tidy end is lost.
    let _ = std::thread::Builder::new().name("interrupt".into()).spawn(wait);
}

/// Whether the program was asked to end, for work that can be stopped at its next progress report.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// From now on a request sets the flag; a second Ctrl-C ends the program at once.
    pub fn catch() -> Self {
        let interrupt = Self::default();
        let flag = interrupt.0.clone();
        on_request_to_end(move || {
            flag.store(true, Ordering::Relaxed);
            true
        });
        interrupt
    }

    /// Whether the work should stop.
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
