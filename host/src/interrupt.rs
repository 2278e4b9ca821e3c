//! Ctrl-C, for work that can be stopped at its next report.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What a shell says of a program that an interrupt ended.
const INTERRUPTED: i32 = 130;

/// Whether Ctrl-C was pressed.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// From now on the first Ctrl-C sets the flag, and a second one ends the program at once. Where the system gives no
    /// thread or signal, Ctrl-C ends the program as ever.
    pub fn catch() -> Self {
        let interrupt = Self::default();
        let flag = interrupt.0.clone();
        let wait = move || {
            let Ok(runtime) = tokio::runtime::Builder::new_current_thread().enable_all().build() else { return };
            runtime.block_on(async move {
                while tokio::signal::ctrl_c().await.is_ok() {
                    if flag.swap(true, Ordering::Relaxed) {
                        std::process::exit(INTERRUPTED);
                    }
                }
            });
        };
        // Without the thread nothing is lost but a tidy end.
        let _ = std::thread::Builder::new().name("interrupt".into()).spawn(wait);
        interrupt
    }

    /// Whether the work should stop.
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
