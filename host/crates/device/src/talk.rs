//! What a connection carries: the conversation with a puppet or with an arm, in the same words.

use std::time::Duration;

use crate::servo::ServoSession;
use crate::{Event, PartUid, Session, SessionCounters};

#[derive(Debug)]
pub(crate) enum Talk {
    Puppet(Box<Session>),
    Arm(Box<ServoSession>),
}

impl Talk {
    pub(crate) fn start(&mut self, rate_millihertz: u32) {
        match self {
            Self::Puppet(session) => session.start(rate_millihertz),
            Self::Arm(session) => session.start(rate_millihertz),
        }
    }

    pub(crate) fn stop(&mut self) {
        match self {
            Self::Puppet(session) => session.stop(),
            Self::Arm(session) => session.stop(),
        }
    }

    pub(crate) fn blink(&mut self, now: Duration, uid: PartUid, duration_millis: u16, events: &mut Vec<Event>) {
        match self {
            Self::Puppet(session) => session.blink(uid, duration_millis),
            Self::Arm(session) => session.blink(now, uid, duration_millis, events),
        }
    }

    pub(crate) fn line_opened(&mut self, now: Duration, events: &mut Vec<Event>) {
        match self {
            Self::Puppet(session) => session.line_opened(now, events),
            Self::Arm(session) => session.line_opened(now),
        }
    }

    pub(crate) fn receive(&mut self, now: Duration, bytes: &[u8], events: &mut Vec<Event>) {
        match self {
            Self::Puppet(session) => session.receive(now, bytes, events),
            Self::Arm(session) => session.receive(now, bytes, events),
        }
    }

    pub(crate) fn tick(&mut self, now: Duration, events: &mut Vec<Event>) {
        match self {
            Self::Puppet(session) => session.tick(now, events),
            Self::Arm(session) => session.tick(now, events),
        }
    }

    pub(crate) fn take_outgoing(&mut self) -> Vec<u8> {
        match self {
            Self::Puppet(session) => session.take_outgoing(),
            Self::Arm(session) => session.take_outgoing(),
        }
    }

    /// The speed at which the line has to be, where the conversation has a say in it.
    pub(crate) fn line_baud(&self) -> Option<u32> {
        match self {
            Self::Puppet(_) => None,
            Self::Arm(session) => Some(session.line_baud()),
        }
    }

    pub(crate) fn next_due(&self) -> Option<Duration> {
        match self {
            Self::Puppet(_) => None,
            Self::Arm(session) => session.next_due(),
        }
    }

    pub(crate) fn is_streaming(&self) -> bool {
        match self {
            Self::Puppet(session) => session.is_streaming(),
            Self::Arm(session) => session.is_streaming(),
        }
    }

    pub(crate) fn counters(&self) -> SessionCounters {
        match self {
            Self::Puppet(session) => session.counters(),
            Self::Arm(session) => session.counters(),
        }
    }
}
