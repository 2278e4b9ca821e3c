//! The one channel on which the engine's thread waits: commands, the puppet's events, and results of other threads.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender};
use std::time::Duration;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::command::Command;
use super::input::Input;

/// Most puppet events that may wait here. Beyond that, no more are taken from its line, so that an engine that is too
/// slow loses samples at the device instead of memory here.
const DEVICE_CAPACITY: usize = 256;

/// The engine's end.
#[derive(Debug)]
pub struct Inbox {
    posted: Receiver<Posted>,
    /// Looked at already, but not taken out.
    seen: RefCell<VecDeque<Posted>>,
    sender: InboxSender,
}

/// Everyone else's end.
#[derive(Clone, Debug)]
pub struct InboxSender {
    posted: Sender<Posted>,
    device_permits: Arc<Semaphore>,
}

#[derive(Debug)]
struct Posted {
    input: Input,
    /// Given back when the input is taken out.
    _permit: Option<OwnedSemaphorePermit>,
}

impl Default for Inbox {
    fn default() -> Self {
        let (sender, posted) = mpsc::channel();
        let sender = InboxSender { posted: sender, device_permits: Arc::new(Semaphore::new(DEVICE_CAPACITY)) };
        Self { posted, seen: RefCell::default(), sender }
    }
}

impl Inbox {
    /// For senders of inputs.
    pub fn sender(&self) -> InboxSender {
        self.sender.clone()
    }

    /// The next input, waiting at most this long; without a time, for as long as it takes.
    pub fn next(&self, patience: Option<Duration>) -> Option<Input> {
        if let Some(posted) = self.seen.borrow_mut().pop_front() {
            return Some(posted.input);
        }
        let posted = match patience {
            Some(patience) => self.posted.recv_timeout(patience).ok(),
            None => self.posted.recv().ok(),
        };
        posted.map(|posted| posted.input)
    }

    /// The next command, if one is waiting: for scripted engines.
    pub fn waiting_command(&self) -> Option<Command> {
        let seen = std::mem::take(&mut *self.seen.borrow_mut());
        let mut waiting = seen.into_iter().chain(self.posted.try_iter());
        let command = waiting.find_map(|posted| match posted.input {
            Input::Command(command) => Some(command),
            _ => None,
        });
        let rest: VecDeque<Posted> = waiting.collect();
        self.seen.borrow_mut().extend(rest);
        command
    }

    /// Whether someone waits for what is going on to be cancelled, or for the engine to quit. Takes nothing out.
    pub fn is_stopped(&self) -> bool {
        let mut seen = self.seen.borrow_mut();
        seen.extend(self.posted.try_iter());
        seen.iter().any(|posted| matches!(posted.input, Input::Command(Command::Cancel | Command::Quit)))
    }
}

impl InboxSender {
    /// Sends the engine something. Returns whether the engine still exists.
    pub fn send(&self, input: Input) -> bool {
        self.posted.send(Posted { input, _permit: None }).is_ok()
    }

    /// Passes on a puppet's event as soon as the engine keeps up. Returns whether the engine still exists.
    pub async fn send_from_device(&self, input: Input) -> bool {
        let permit = self.device_permits.clone().acquire_owned().await.ok();
        self.posted.send(Posted { input, _permit: permit }).is_ok()
    }
}
