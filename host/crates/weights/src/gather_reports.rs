//! Work on many items on all cores, with progress reported on the waiting thread.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use rayon::Yield;
use rayon::prelude::*;

/// Results in the order of the items, or `None` if `between` stopped the work. `work` calls its second argument now and
/// then and gives up when that returns `false`; `between` is called on this thread about as often.
pub(crate) fn gather_reports<T: Send, R: Send>(
    items: Vec<T>,
    work: impl Fn(T, &dyn Fn() -> bool) -> R + Sync,
    mut between: impl FnMut() -> ControlFlow<()>,
) -> Option<Vec<R>> {
    let stop = AtomicBool::new(false);
    let (sender, receiver) = channel();
    let mut results = None;
    rayon::in_place_scope(|scope| {
        let (results, stop, work) = (&mut results, &stop, &work);
        scope.spawn(move |_| {
            let one = |sender: &mut std::sync::mpsc::Sender<()>, item| {
                work(item, &|| sender.send(()).is_ok() && !stop.load(Ordering::Relaxed))
            };
            *results = Some(items.into_par_iter().with_max_len(1).map_with(sender, one).collect());
        });
        while next(&receiver) {
            if between().is_break() {
                stop.store(true, Ordering::Relaxed);
            }
        }
    });
    results.filter(|_| !stop.into_inner())
}

/// Waits for a report; returns whether there was one. A thread of the pool helps meanwhile, or it would starve its own
/// work.
fn next(receiver: &Receiver<()>) -> bool {
    loop {
        match receiver.try_recv() {
            Ok(()) => return true,
            Err(TryRecvError::Disconnected) => return false,
            Err(TryRecvError::Empty) => match rayon::yield_now() {
                Some(Yield::Executed) => {}
                Some(Yield::Idle) => std::thread::yield_now(),
                None => return receiver.recv().is_ok(),
            },
        }
    }
}
