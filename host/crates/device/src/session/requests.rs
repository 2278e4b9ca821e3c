//! Which requests are waiting for an answer, and when to repeat them.

use std::time::Duration;

use crate::events::RequestKind;

#[derive(Clone, Copy, Debug)]
struct Waiting {
    ask_again: Duration,
    asked: u32,
}

/// The pending requests, at most one of each kind.
#[derive(Clone, Debug, Default)]
pub(super) struct Requests {
    waiting: [Option<Waiting>; 6],
}

impl Requests {
    /// Whether an answer to this is pending.
    pub(super) fn is_waiting(&self, kind: RequestKind) -> bool {
        self.waiting[slot(kind)].is_some()
    }

    /// Whether to send this now: for the first time, or again.
    pub(super) fn is_due(&self, kind: RequestKind, now: Duration) -> bool {
        self.waiting[slot(kind)].is_none_or(|waiting| now >= waiting.ask_again)
    }

    /// How often this has been sent without an answer.
    pub(super) fn times_asked(&self, kind: RequestKind) -> u32 {
        self.waiting[slot(kind)].map_or(0, |waiting| waiting.asked)
    }

    /// Records that it is sent; returns how often it has been sent before without an answer.
    pub(super) fn asked(&mut self, kind: RequestKind, now: Duration, patience: Duration) -> u32 {
        let slot = &mut self.waiting[slot(kind)];
        let before = slot.map_or(0, |waiting| waiting.asked);
        *slot = Some(Waiting { ask_again: now + patience, asked: before + 1 });
        before
    }

    /// Records that no answer is expected any more; returns whether one was.
    pub(super) fn settle(&mut self, kind: RequestKind) -> bool {
        self.waiting[slot(kind)].take().is_some()
    }

    /// Repeats only after that time; for refused requests.
    pub(super) fn postpone(&mut self, kind: RequestKind, until: Duration) {
        self.waiting[slot(kind)] = Some(Waiting { ask_again: until, asked: 0 });
    }

    /// Expects nothing any more.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}

/// The slot of a pending request of this kind.
fn slot(kind: RequestKind) -> usize {
    match kind {
        RequestKind::Hello => 0,
        RequestKind::Topology => 1,
        RequestKind::SetRate => 2,
        RequestKind::Start => 3,
        RequestKind::Stop => 4,
        RequestKind::Blink | RequestKind::Other(_) => 5,
    }
}
