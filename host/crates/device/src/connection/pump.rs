//! The pump that moves bytes and time between a line and a session.

use std::time::Duration;

use firmware_protocol::PartUid;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::sync::{mpsc, watch};
use tokio::time::Instant;

use super::talk::Talk;
use super::whereabouts::{Stamp, Whereabouts, ambiguity, is_vacant, stamp};
use crate::address::DeviceAddress;
use crate::events::{DeviceNotice, DeviceProblem, Event, SessionCounters};
use crate::transports::{Transport, open};

/// Time between two clock checks when nothing arrives.
const TICK: Duration = Duration::from_millis(20);
/// Most bytes read at once; 60 samples of 96 sensors.
const READ_CAPACITY: usize = 1 << 14;
/// Time the device has to acknowledge the last stop when the connection is closed.
const CLOSING_PATIENCE: Duration = Duration::from_millis(600);

/// A port that is back but cannot be opened is reported after this time; the system takes a moment to set its
/// permissions.
const TELL_WAITING_AFTER: Duration = Duration::from_secs(1);

/// Where several places are possible, how long one of them has to say who it is; a boot loader comes first on many boards.
const TRIAL: Duration = Duration::from_secs(4);
/// After this time a place that was not the right one is asked again who it is.
const ASK_AGAIN_AFTER: Duration = Duration::from_secs(5);
/// Round trips this long are those of an adapter that holds bytes back.
const SLOW_ROUND_TRIP: Duration = Duration::from_millis(5);

/// The number of a device that does not know its own yet.
const NO_NUMBER: PartUid = PartUid([0; 12]);

/// A request from the connection's owner.
#[derive(Clone, Copy, Debug)]
pub(super) enum Wish {
    Start { rate_millihertz: u32 },
    Stop,
    Blink { uid: PartUid, duration_millis: u16 },
    Close,
}

/// The channels between the pump and the connection's owner.
pub(super) struct Channels {
    pub(super) events: mpsc::Sender<Event>,
    pub(super) wishes: mpsc::UnboundedReceiver<Wish>,
    pub(super) counters: watch::Sender<SessionCounters>,
}

/// Moves bytes and time between line and session.
pub(super) struct Pump {
    talk: Talk,
    whereabouts: Option<Whereabouts>,
    /// The device that was connected first; no other device is accepted in its place.
    owner: Option<PartUid>,
    /// A line that was opened again, until the device on it has said who it is.
    trial: Option<Trial>,
    /// Where the device is not.
    elsewhere: Vec<Elsewhere>,
    /// What was last reported as another device.
    foreign: Option<String>,
    slow_adapter_told: bool,
    began: Instant,
    events: mpsc::Sender<Event>,
    wishes: mpsc::UnboundedReceiver<Wish>,
    counters: watch::Sender<SessionCounters>,
    closing_until: Option<Instant>,
}

/// A line on which the device in use before is looked for.
struct Trial {
    place: DeviceAddress,
    until: Instant,
    /// What is reported once it is found.
    events: Vec<Event>,
}

/// A place with another device, or with one that says nothing.
struct Elsewhere {
    place: DeviceAddress,
    /// As that device calls itself.
    name: Option<String>,
    stamp: Option<Stamp>,
    since: Instant,
}

/// Why carrying a line ended.
enum End {
    Closed,
    Lost(String),
    /// It is not the device that was in use before. As it calls itself; `None` if it says nothing.
    Elsewhere(Option<String>),
}

impl Pump {
    /// `began`: the session's time zero. `whereabouts`: where to look for the line when it is lost.
    pub(super) fn new(talk: Talk, whereabouts: Option<Whereabouts>, began: Instant, channels: Channels) -> Self {
        let Channels { events, wishes, counters } = channels;
        Self {
            talk,
            whereabouts,
            owner: None,
            trial: None,
            elsewhere: Vec::new(),
            foreign: None,
            slow_adapter_told: false,
            began,
            events,
            wishes,
            counters,
            closing_until: None,
        }
    }

    /// Runs until the connection is closed, or its line is lost for good.
    pub(super) async fn run(mut self, mut line: Box<dyn Transport>) {
        let mut lost = Instant::now();
        loop {
            let end = self.carry(line).await;
            // A device that never introduced itself cannot be recognised when it comes back.
            let known = self.whereabouts.is_some() && self.owner.is_some();
            let trial = self.trial.take();
            match end {
                End::Closed => return,
                End::Lost(reason) if !known => {
                    return self.hand_on(vec![Event::Problem(DeviceProblem::Disconnected { reason })]).await;
                }
                End::Lost(_) if trial.is_some() => {}
                End::Lost(reason) => {
                    lost = Instant::now();
                    self.hand_on(vec![Event::Notice(DeviceNotice::LineLost { reason })]).await;
                }
                End::Elsewhere(name) => {
                    if let Some(Trial { place, .. }) = &trial {
                        let (place, stamp) = (place.clone(), stamp(place));
                        self.elsewhere.push(Elsewhere { place, name, stamp, since: Instant::now() });
                    }
                }
            }
            let Some((found, place)) = self.wait_for_line().await else { return };
            line = found;
            let at = self.whereabouts.as_ref().and_then(|whereabouts| whereabouts.moved_to(&place));
            let mut events = vec![Event::Notice(DeviceNotice::LineBack { seconds: lost.elapsed().as_secs_f64(), at })];
            self.talk.line_opened(self.began.elapsed(), &mut events);
            // The session reports a restart once; a place that was tried before may have taken it.
            let owed = trial.is_some_and(|trial| trial.events.contains(&Event::Restarted));
            if owed && !events.contains(&Event::Restarted) {
                events.insert(1, Event::Restarted);
            }
            self.trial = Some(Trial { place, until: Instant::now() + TRIAL, events });
        }
    }

    /// Carries bytes and time both ways until the line is lost or the connection closed.
    async fn carry(&mut self, line: Box<dyn Transport>) -> End {
        let (mut reader, mut writer) = tokio::io::split(line);
        let mut arrived = vec![0; READ_CAPACITY];
        let mut outgoing = Vec::new();
        let mut events = Vec::new();
        let mut baud = None;
        let mut next_tick = Instant::now();
        loop {
            if self.talk.line_baud() != baud {
                // Anything requested at the other speed is dropped.
                outgoing.clear();
                baud = self.talk.line_baud();
                let mut whole = reader.unsplit(writer);
                if let Some(Err(error)) = baud.map(|baud| whole.set_baud(baud)) {
                    tracing::warn!(?baud, %error, "the line cannot be set to this speed");
                }
                (reader, writer) = tokio::io::split(whole);
            }
            outgoing.extend(self.talk.take_outgoing());
            let due = self.talk.next_due().map_or(next_tick, |due| (self.began + due).min(next_tick));
            let mut ended = None;
            tokio::select! {
                read = reader.read(&mut arrived) => match read {
                    // A pseudo-terminal whose other side closed reads as nothing, again and again.
                    Ok(0) => ended = Some("the line was closed".to_owned()),
                    Ok(length) => self.talk.receive(self.began.elapsed(), &arrived[..length], &mut events),
                    Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                    Err(error) => ended = Some(error.to_string()),
                },
                written = writer.write(&outgoing), if !outgoing.is_empty() => match written {
                    Ok(length) => drop(outgoing.drain(..length)),
                    Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                    Err(error) => ended = Some(error.to_string()),
                },
                wish = self.wishes.recv(), if self.closing_until.is_none() => {
                    self.heed(wish, &mut events);
                    self.talk.tick(self.began.elapsed(), &mut events);
                }
                () = tokio::time::sleep_until(due) => {
                    next_tick = Instant::now() + TICK;
                    self.talk.tick(self.began.elapsed(), &mut events);
                    events.extend(self.find_slow_adapter());
                }
            }
            if let Some(end) = self.identify(&mut events) {
                self.hand_on(std::mem::take(&mut events)).await;
                return end;
            }
            self.hand_on(std::mem::take(&mut events)).await;
            if let Some(reason) = ended {
                return if self.closing_until.is_some() { End::Closed } else { End::Lost(reason) };
            }
            if self.talk.line_baud() == baud {
                outgoing.extend(self.talk.take_outgoing());
            }
            let quiet = outgoing.is_empty() && !self.talk.is_streaming();
            if self.closing_until.is_some_and(|until| Instant::now() >= until || quiet) {
                return End::Closed;
            }
        }
    }

    /// Checks who has introduced itself. Another device than the one in use ends this line, and nothing of it is handed
    /// on; so does one that says nothing while there are other places to look.
    fn identify(&mut self, events: &mut Vec<Event>) -> Option<End> {
        let introduced = events.iter().enumerate().find_map(|(at, event)| match event {
            Event::Connected(info) => Some((at, info.uid, info.name.clone())),
            _ => None,
        });
        let Some((at, uid, name)) = introduced else {
            let trial = self.trial.as_mut().filter(|trial| Instant::now() >= trial.until)?;
            trial.until = Instant::now() + TRIAL;
            return self.has_other_places().then_some(End::Elsewhere(None));
        };
        let owner = self.owner.get_or_insert(uid);
        if *owner == NO_NUMBER {
            *owner = uid;
        }
        if *owner != uid && self.whereabouts.is_some() {
            events.truncate(at);
            return Some(End::Elsewhere(Some(name)));
        }
        if let Some(trial) = self.trial.take() {
            self.elsewhere.clear();
            self.foreign = None;
            events.splice(at..at, trial.events);
        }
        None
    }

    /// Whether there are places to look besides the one that is being tried.
    fn has_other_places(&self) -> bool {
        let (Some(whereabouts), Some(trial)) = (&self.whereabouts, &self.trial) else { return false };
        whereabouts.places().iter().any(|place| *place != trial.place && !self.is_elsewhere(place))
    }

    fn is_elsewhere(&self, place: &DeviceAddress) -> bool {
        self.elsewhere.iter().any(|other| other.place == *place)
    }

    fn find_slow_adapter(&mut self) -> Option<Event> {
        let port = self.whereabouts.as_ref()?.slow_adapter().filter(|_| !self.slow_adapter_told)?.to_owned();
        let millis = self.talk.round_trip().filter(|trip| *trip >= SLOW_ROUND_TRIP)?.as_secs_f64() * 1e3;
        self.slow_adapter_told = true;
        Some(Event::Notice(DeviceNotice::AdapterHoldsBytes { port, millis }))
    }

    /// Looks for the line repeatedly; `None` if the connection is closed meanwhile.
    async fn wait_for_line(&mut self) -> Option<(Box<dyn Transport>, DeviceAddress)> {
        let whereabouts = self.whereabouts.clone()?;
        let mut seen: Option<Instant> = None;
        let mut told = false;
        loop {
            let mut events = Vec::new();
            tokio::select! {
                wish = self.wishes.recv() => self.heed(wish, &mut events),
                () = tokio::time::sleep(whereabouts.pause()) => {}
            }
            if self.closing_until.is_some() {
                return None;
            }
            // What is elsewhere may be unplugged or swapped, or may have been asked at a bad moment.
            self.elsewhere
                .retain(|other| other.since.elapsed() < ASK_AGAIN_AFTER && stamp(&other.place) == other.stamp);
            let places = whereabouts.places();
            let mut waits = places.is_empty().then(|| ambiguity(&whereabouts)).flatten();
            events.extend(self.find_only_others(&places));
            let is_only = places.len() == 1 && whereabouts.usb_serial_number().is_some();
            for place in places {
                let is_likely = is_only || whereabouts.moved_to(&place).is_none();
                if self.is_elsewhere(&place) {
                    continue;
                }
                match open(&place).await {
                    Ok(line) => return Some((line, place)),
                    Err(problem) if is_vacant(&problem) => {}
                    Err(problem) if is_likely => waits = waits.or(Some(problem)),
                    // Most likely another puppet, in use by another program.
                    Err(_) => {}
                }
            }
            match waits {
                Some(problem) if !told => {
                    let since = *seen.get_or_insert_with(Instant::now);
                    if since.elapsed() >= TELL_WAITING_AFTER {
                        told = true;
                        events.push(Event::Notice(DeviceNotice::LineWaits { reason: problem.to_string() }));
                    }
                }
                Some(_) => {}
                None => seen = None,
            }
            self.hand_on(events).await;
        }
    }

    /// What to report where every place has another device; once for each set of them.
    fn find_only_others(&mut self, places: &[DeviceAddress]) -> Option<Event> {
        let name = |place: &DeviceAddress| {
            let other = self.elsewhere.iter().find(|other| other.place == *place)?;
            other.name.as_ref().map(|name| format!("{name} at {place}"))
        };
        let names: Option<Vec<String>> = places.iter().map(name).collect();
        let found = names.filter(|names| !names.is_empty())?.join(", ");
        let is_new = self.foreign.as_ref() != Some(&found);
        self.foreign = Some(found.clone());
        is_new.then_some(Event::Problem(DeviceProblem::AnotherDevice { found }))
    }

    async fn hand_on(&mut self, events: Vec<Event>) {
        self.counters.send_replace(self.talk.counters());
        for event in events {
            // Nobody is listening while a connection is being closed.
            let _ = self.events.send(event).await;
        }
    }

    /// Carries out the owner's request.
    fn heed(&mut self, wish: Option<Wish>, events: &mut Vec<Event>) {
        match wish {
            Some(Wish::Start { rate_millihertz }) => self.talk.start(rate_millihertz),
            Some(Wish::Stop) => self.talk.stop(),
            Some(Wish::Blink { uid, duration_millis }) => {
                self.talk.blink(self.began.elapsed(), uid, duration_millis, events);
            }
            Some(Wish::Close) | None => {
                self.talk.stop();
                self.closing_until = Some(Instant::now() + CLOSING_PATIENCE);
            }
        }
    }
}
