//! The link between a window and the engine's thread: commands one way, events the other.
//!
//! The engine's thread owns every file, port and clock; the window only shows the latest [`EngineEvent`]s and sends
//! [`Command`]s. A recorded list of events replays what a window showed.
//!
//! The queue from engine to window never grows without bound: of frames, busy notes and recording clocks only the
//! newest waits, a problem that is already waiting is not queued twice, and beyond [`EVENT_CAPACITY`] the oldest
//! waiting event is dropped (and counted).

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::command::Command;
use super::drive::Listener;
use super::event::{EngineEvent, Frame};
use super::inbox::{Inbox, InboxSender};
use super::input::Input;

/// How many events may wait for the window.
pub const EVENT_CAPACITY: usize = 256;

/// Makes both ends. `wake` is called after every event sent (on the engine's thread) so that the window redraws.
pub fn link(wake: impl Fn() + Send + Sync + 'static) -> (AppLink, EngineLink) {
    let inbox = Inbox::default();
    let mailbox = Arc::new(Mailbox::default());
    let app = AppLink { inputs: inbox.sender(), mailbox: mailbox.clone() };
    (app, EngineLink { outbox: EngineOutbox { mailbox, wake: Arc::new(wake) }, inbox })
}

/// The window's end. When it is dropped, the engine quits.
#[derive(Debug)]
pub struct AppLink {
    inputs: InboxSender,
    mailbox: Arc<Mailbox>,
}

impl AppLink {
    /// Sends the engine a command. Returns whether the engine still exists.
    pub fn send(&self, command: Command) -> bool {
        self.inputs.send(Input::Command(command))
    }

    /// The oldest waiting event.
    pub fn next_event(&self) -> Option<EngineEvent> {
        self.mailbox.lock().events.pop_front()
    }

    /// Gives a frame's buffers back for reuse.
    pub fn recycle(&self, frame: Box<Frame>) {
        self.mailbox.recycle(frame);
    }

    /// How many events were dropped because the window did not keep up.
    pub fn overflowed(&self) -> u64 {
        self.mailbox.lock().overflowed
    }
}

impl Drop for AppLink {
    fn drop(&mut self) {
        self.send(Command::Quit);
    }
}

/// The engine's end: inputs in, events out.
#[derive(Debug)]
pub struct EngineLink {
    outbox: EngineOutbox,
    inbox: Inbox,
}

impl EngineLink {
    /// Sends an event to the window; never blocks.
    pub fn send(&self, event: EngineEvent) {
        self.outbox.send(event);
    }

    /// A frame to fill, with the buffers of an earlier one if there is one.
    pub fn frame_buffer(&self) -> Box<Frame> {
        self.outbox.frame_buffer()
    }

    /// The next command, if one is waiting: for scripted engines. [`Command::Quit`] if the window is gone.
    pub fn try_command(&self) -> Option<Command> {
        self.inbox.waiting_command()
    }

    /// What an engine is driven with: what it waits on, and who listens to it.
    pub fn into_parts(self) -> (Inbox, EngineOutbox) {
        (self.inbox, self.outbox)
    }
}

/// The sending half of the engine's end.
#[derive(Clone)]
pub struct EngineOutbox {
    mailbox: Arc<Mailbox>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl std::fmt::Debug for EngineOutbox {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("EngineOutbox").finish_non_exhaustive()
    }
}

impl EngineOutbox {
    /// Sends an event to the window; never blocks.
    pub fn send(&self, event: EngineEvent) {
        self.mailbox.push(event);
        (self.wake)();
    }

    /// A frame to fill, with the buffers of an earlier one if there is one.
    pub fn frame_buffer(&self) -> Box<Frame> {
        self.mailbox.lock().spare_frames.pop().unwrap_or_default()
    }
}

impl Listener for EngineOutbox {
    fn hear(&mut self, event: EngineEvent) -> ControlFlow<()> {
        self.send(event);
        ControlFlow::Continue(())
    }

    fn frame_buffer(&mut self) -> Box<Frame> {
        EngineOutbox::frame_buffer(self)
    }
}

#[derive(Debug, Default)]
struct Mailbox {
    queue: Mutex<Queue>,
}

#[derive(Debug, Default)]
struct Queue {
    events: VecDeque<EngineEvent>,
    #[expect(clippy::vec_box, reason = "frames travel in boxes; unpacking them here would allocate on every frame")]
    spare_frames: Vec<Box<Frame>>,
    overflowed: u64,
}

/// One being filled, one waiting, one being drawn.
const SPARE_FRAMES: usize = 3;

impl Mailbox {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        // Every change below leaves the queue intact, so a panic elsewhere does not make it unusable.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn recycle(&self, frame: Box<Frame>) {
        let mut queue = self.lock();
        if queue.spare_frames.len() < SPARE_FRAMES {
            queue.spare_frames.push(frame);
        }
    }

    fn push(&self, event: EngineEvent) {
        let superseded = {
            let mut queue = self.lock();
            let superseded = queue.take_superseded(&event);
            if queue.events.len() >= EVENT_CAPACITY {
                queue.events.pop_front();
                queue.overflowed += 1;
            }
            queue.events.push_back(event);
            superseded
        };
        if let Some(EngineEvent::Frame(frame)) = superseded {
            self.recycle(frame);
        }
    }
}

impl Queue {
    /// Removes the waiting event that the new one supersedes.
    fn take_superseded(&mut self, new: &EngineEvent) -> Option<EngineEvent> {
        let index = self.events.iter().rposition(|waiting| match (waiting, new) {
            (EngineEvent::Frame(_), EngineEvent::Frame(_))
            | (EngineEvent::Calibrating { .. }, EngineEvent::Calibrating { .. })
            | (EngineEvent::Recording { .. }, EngineEvent::Recording { .. })
            | (EngineEvent::Busy { .. }, EngineEvent::Busy { .. })
            | (EngineEvent::Playback(_), EngineEvent::Playback(_))
            | (EngineEvent::Countdown { .. }, EngineEvent::Countdown { .. })
            | (EngineEvent::Takes(_), EngineEvent::Takes(_))
            | (EngineEvent::Devices(_), EngineEvent::Devices(_)) => true,
            (EngineEvent::Problem(waiting), EngineEvent::Problem(new))
            | (EngineEvent::Waiting(waiting), EngineEvent::Waiting(new)) => waiting == new,
            _ => false,
        })?;
        self.events.remove(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::event::{Problem, Stats};

    fn frame(samples: u64) -> Box<Frame> {
        Box::new(Frame { stats: Stats { samples, ..Stats::default() }, ..Frame::default() })
    }

    #[test]
    fn the_latest_frame_wins_and_its_predecessor_is_reused() {
        let (app, engine) = link(|| {});
        for samples in 0..1000 {
            let mut buffer = engine.frame_buffer();
            if samples > 1 {
                assert!(buffer.positions.capacity() >= 100, "the buffer of an earlier frame comes back");
            }
            buffer.positions.resize(100, [0.0; 3]);
            buffer.stats.samples = samples;
            engine.send(EngineEvent::Frame(buffer));
        }
        let Some(EngineEvent::Frame(latest)) = app.next_event() else { panic!("a frame waits") };
        assert_eq!(latest.stats.samples, 999);
        assert!(app.next_event().is_none());
    }

    #[test]
    fn other_events_keep_their_order_around_frames() {
        let (app, engine) = link(|| {});
        engine.send(EngineEvent::Frame(frame(1)));
        engine.send(EngineEvent::CharacterLoaded(Arc::default()));
        engine.send(EngineEvent::Frame(frame(2)));
        assert!(matches!(app.next_event(), Some(EngineEvent::CharacterLoaded(_))));
        assert!(matches!(app.next_event(), Some(EngineEvent::Frame(f)) if f.stats.samples == 2));
    }

    #[test]
    fn a_window_that_sleeps_does_not_fill_the_memory() {
        let (app, engine) = link(|| {});
        for number in 0..EVENT_CAPACITY + 10 {
            let problem = Problem { what: format!("problem {number}"), remedy: String::new() };
            engine.send(EngineEvent::Problem(problem.clone()));
            engine.send(EngineEvent::Problem(problem));
        }
        assert_eq!(app.overflowed(), 10);
        assert_eq!(std::iter::from_fn(|| app.next_event()).count(), EVENT_CAPACITY);
    }

    #[test]
    fn an_engine_without_a_window_is_told_to_quit() {
        let (app, engine) = link(|| {});
        assert!(app.send(Command::Zero));
        drop(app);
        assert_eq!(engine.try_command(), Some(Command::Zero));
        assert_eq!(engine.try_command(), Some(Command::Quit));
    }

    #[test]
    fn a_window_without_an_engine_knows_it() {
        let (app, engine) = link(|| {});
        drop(engine);
        assert!(!app.send(Command::Zero));
    }
}
