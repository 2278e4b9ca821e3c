//! Work on takes, on threads of its own.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::engine::inbox::InboxSender;
use crate::engine::input::{Input, WorkId, WorkNews};
use crate::takes::orders::{self, TakeOrder};

/// Every report makes the window draw, which takes time from the work.
const REPORT_EVERY: Duration = Duration::from_millis(100);

/// The work in progress.
#[derive(Debug, Default)]
pub(super) struct Works {
    cancels: Vec<(WorkId, Arc<AtomicBool>)>,
}

impl Works {
    /// Does work; its progress and result go into the inbox.
    pub(super) fn begin(&mut self, work: WorkId, order: TakeOrder, inbox: InboxSender) {
        // A thread that is done no longer holds its flag.
        self.cancels.retain(|(_, cancel)| Arc::strong_count(cancel) > 1);
        let cancel = Arc::new(AtomicBool::new(false));
        self.cancels.push((work, cancel.clone()));
        std::thread::spawn(move || {
            let mut reported = Instant::now();
            let news = done(&order, &mut |stage, done| {
                if reported.elapsed() >= REPORT_EVERY {
                    reported = Instant::now();
                    let stage = stage.to_owned();
                    inbox.send(Input::Worked { work, news: WorkNews::Progress { stage, done } });
                }
                if cancel.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            // Nobody is waiting if the program has ended meanwhile.
            inbox.send(Input::Worked { work, news });
        });
    }

    /// Cancels work at its next progress report.
    pub(super) fn cancel(&self, work: WorkId) {
        for (_, cancel) in self.cancels.iter().filter(|(id, _)| *id == work) {
            cancel.store(true, Ordering::Relaxed);
        }
    }
}

/// Does work at once.
pub(super) fn done(order: &TakeOrder, progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>) -> WorkNews {
    WorkNews::Over(orders::carry_out(order, progress))
}
