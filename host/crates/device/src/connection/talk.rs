//! What a connection carries: the conversation with a puppet or with an arm, behind one interface.

use std::time::Duration;

use firmware_protocol::PartUid;

use crate::events::{Event, SessionCounters};
use crate::servo::ServoSession;
use crate::session::Session;

#[derive(Debug)]
pub(super) enum Talk {
    Puppet(Box<Session>),
    Arm(Box<ServoSession>),
}

impl Talk {
    pub(super) fn start(&mut self, rate_millihertz: u32) {
        match self {
            Self::Puppet(session) => session.start(rate_millihertz),
            Self::Arm(session) => session.start(rate_millihertz),
        }
    }

    pub(super) fn stop(&mut self) {
        match self {
            Self::Puppet(session) => session.stop(),
            Self::Arm(session) => session.stop(),
        }
    }

    pub(super) fn blink(&mut self, now: Duration, uid: PartUid, duration_millis: u16, events: &mut Vec<Event>) {
        match self {
            Self::Puppet(session) => session.blink(uid, duration_millis),
            Self::Arm(session) => session.blink(now, uid, duration_millis, events),
        }
    }

    pub(super) fn line_opened(&mut self, now: Duration, events: &mut Vec<Event>) {
        match self {
            Self::Puppet(session) => session.line_opened(now, events),
            Self::Arm(session) => session.line_opened(now),
        }
    }

    pub(super) fn receive(&mut self, now: Duration, bytes: &[u8], events: &mut Vec<Event>) {
        match self {
            Self::Puppet(session) => session.receive(now, bytes, events),
            Self::Arm(session) => session.receive(now, bytes, events),
        }
    }

    pub(super) fn tick(&mut self, now: Duration, events: &mut Vec<Event>) {
        match self {
            Self::Puppet(session) => session.tick(now, events),
            Self::Arm(session) => session.tick(now, events),
        }
    }

    pub(super) fn take_outgoing(&mut self) -> Vec<u8> {
        match self {
            Self::Puppet(session) => session.take_outgoing(),
            Self::Arm(session) => session.take_outgoing(),
        }
    }

    /// The line speed the conversation requires, if it requires one.
    pub(super) fn line_baud(&self) -> Option<u32> {
        match self {
            Self::Puppet(_) => None,
            Self::Arm(session) => Some(session.line_baud()),
        }
    }

    /// The median time that bytes travel to a puppet and back.
    pub(super) fn round_trip(&self) -> Option<Duration> {
        match self {
            Self::Puppet(session) => session.round_trip(),
            Self::Arm(_) => None,
        }
    }

    pub(super) fn next_due(&self) -> Option<Duration> {
        match self {
            Self::Puppet(_) => None,
            Self::Arm(session) => session.next_due(),
        }
    }

    pub(super) fn is_streaming(&self) -> bool {
        match self {
            Self::Puppet(session) => session.is_streaming(),
            Self::Arm(session) => session.is_streaming(),
        }
    }

    pub(super) fn counters(&self) -> SessionCounters {
        match self {
            Self::Puppet(session) => session.counters(),
            Self::Arm(session) => session.counters(),
        }
    }
}
