//! A session on a real line: the pump that moves bytes and time.

use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::runtime::Handle;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tokio::time::Instant;

use crate::reopening::Whereabouts;
use crate::servo::{ServoArm, ServoSession, ServoSettings, seat_of};
use crate::talk::Talk;
use crate::{
    DeviceAddress, DeviceNotice, DeviceProblem, Event, PartUid, Session, SessionCounters, SessionSettings, Transport,
    open,
};

/// Time between two looks at the clock when nothing arrives.
const TICK: Duration = Duration::from_millis(20);
/// Bytes read at once at most; 60 samples of 96 sensors.
const READ_CAPACITY: usize = 1 << 14;
/// Events that wait for their receiver at most; four seconds of samples at 1,000 Hz. When they are that many, the
/// line is not read until some have been taken.
const EVENT_CAPACITY: usize = 4_096;
/// Time the device has to acknowledge the last stop when the connection is closed.
const CLOSING_PATIENCE: Duration = Duration::from_millis(600);

/// A port that is back but cannot be opened is told after this; the system takes a moment to set its permissions.
const TELL_WAITING_AFTER: Duration = Duration::from_secs(1);

/// Time between two looks whether another device is still plugged in where the one used was, and the time after which
/// it is asked again who it is.
const FOREIGN_PAUSE: Duration = Duration::from_millis(200);
const FOREIGN_PATIENCE: Duration = Duration::from_secs(5);

/// How a connection is to go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConnectionSettings {
    /// The conversation with a puppet.
    pub session: SessionSettings,
    /// The conversation with an arm of bus servos.
    pub servos: ServoSettings,
    /// Whether a line that is lost is taken up again as soon as it is back. Otherwise its loss ends the connection.
    pub reopen: bool,
}

impl Default for ConnectionSettings {
    fn default() -> Self {
        Self { session: SessionSettings::default(), servos: ServoSettings::default(), reopen: true }
    }
}

#[derive(Clone, Copy, Debug)]
enum Wish {
    Start { rate_millihertz: u32 },
    Stop,
    Blink { uid: PartUid, duration_millis: u16 },
    Close,
}

/// A session that runs over a line, on a tokio runtime, until it is closed.
///
/// Events come out of a bounded channel in the order in which they happened. A line that is lost is told
/// ([`DeviceNotice::LineLost`]) and taken up again by itself when it is back; where that is not wanted or not possible,
/// the last event is [`DeviceProblem::Disconnected`]. Dropping a connection stops the device in the background, as long
/// as the runtime lives; [`close`](Self::close) also waits for that.
#[derive(Debug)]
pub struct Connection {
    events: mpsc::Receiver<Event>,
    wishes: mpsc::UnboundedSender<Wish>,
    counters: watch::Receiver<SessionCounters>,
    began: Instant,
    pump: JoinHandle<()>,
}

impl Connection {
    /// Opens the line to a device and begins a session on it: a puppet's, or that of an arm of bus servos. The runtime
    /// needs I/O and time enabled.
    pub async fn open(
        runtime: &Handle,
        address: &DeviceAddress,
        settings: ConnectionSettings,
    ) -> Result<Self, DeviceProblem> {
        let whereabouts = Whereabouts::note(address);
        let talk = match address {
            DeviceAddress::Servos { protocol, baud, arm, .. } => {
                let arm = ServoArm::preset(*protocol, arm.as_deref())?;
                let seat = whereabouts.usb_serial_number().map_or(settings.servos.seat, seat_of);
                let session = ServoSession::new(arm, *baud, ServoSettings { seat, ..settings.servos })?;
                Talk::Arm(Box::new(session))
            }
            _ => Talk::Puppet(Box::new(Session::new(settings.session))),
        };
        let line = open(address).await?;
        Ok(Self::run(runtime, line, talk, settings.reopen.then_some(whereabouts)))
    }

    /// Begins a puppet's session on this line; its loss ends the connection. The runtime needs I/O and time enabled.
    pub fn spawn(runtime: &Handle, line: impl Transport, settings: SessionSettings) -> Self {
        Self::run(runtime, Box::new(line), Talk::Puppet(Box::new(Session::new(settings))), None)
    }

    fn run(runtime: &Handle, line: Box<dyn Transport>, talk: Talk, whereabouts: Option<Whereabouts>) -> Self {
        let (event_sender, events) = mpsc::channel(EVENT_CAPACITY);
        let (wishes, wish_receiver) = mpsc::unbounded_channel();
        let (counter_sender, counters) = watch::channel(SessionCounters::default());
        let began = Instant::now();
        let pump = Pump {
            talk,
            whereabouts,
            owner: None,
            foreign: None,
            began,
            events: event_sender,
            wishes: wish_receiver,
            counters: counter_sender,
            closing_until: None,
        };
        let pump = runtime.spawn(pump.run(line));
        Self { events, wishes, counters, began, pump }
    }

    /// The instant at which the session's time is zero: `began + sample.received` is when its last byte came.
    pub fn began(&self) -> std::time::Instant {
        self.began.into_std()
    }

    /// Wants samples, so many in 1,000 seconds; see [`Session::start`].
    pub fn start(&self, rate_millihertz: u32) {
        self.wish(Wish::Start { rate_millihertz });
    }

    /// Wants no more samples; see [`Session::stop`].
    pub fn stop(&self) {
        self.wish(Wish::Stop);
    }

    /// Makes a part show itself; see [`Session::blink`].
    pub fn blink(&self, uid: PartUid, duration_millis: u16) {
        self.wish(Wish::Blink { uid, duration_millis });
    }

    /// The next event; `None` once the connection has ended and all events have been taken.
    pub async fn next(&mut self) -> Option<Event> {
        self.events.recv().await
    }

    /// As [`next`](Self::next), for threads outside of the runtime.
    pub fn blocking_next(&mut self) -> Option<Event> {
        self.events.blocking_recv()
    }

    /// An event that is already there; for callers that draw frames and must not wait.
    pub fn try_next(&mut self) -> Option<Event> {
        self.events.try_recv().ok()
    }

    /// Whether the connection has ended and all its events have been taken.
    pub fn is_over(&self) -> bool {
        self.pump.is_finished() && self.events.is_empty()
    }

    /// What has been counted so far.
    pub fn counters(&self) -> SessionCounters {
        *self.counters.borrow()
    }

    /// Stops the device, gives up the line and returns the final counts. Events not taken are dropped.
    pub async fn close(mut self) -> SessionCounters {
        self.wish(Wish::Close);
        self.events.close();
        if let Err(error) = (&mut self.pump).await {
            tracing::error!(%error, "the session ended by itself");
        }
        self.counters()
    }

    /// A pump that has ended needs no wishes any more.
    fn wish(&self, wish: Wish) {
        if self.wishes.send(wish).is_err() {
            tracing::debug!(?wish, "the connection has ended");
        }
    }
}

struct Pump {
    talk: Talk,
    whereabouts: Option<Whereabouts>,
    /// The device that was connected first; another one is not taken in its place.
    owner: Option<PartUid>,
    /// The other one that was told of last.
    foreign: Option<PartUid>,
    began: Instant,
    events: mpsc::Sender<Event>,
    wishes: mpsc::UnboundedReceiver<Wish>,
    counters: watch::Sender<SessionCounters>,
    closing_until: Option<Instant>,
}

/// Why a line is no longer carried.
enum End {
    Closed,
    Lost(String),
    /// Another device is at it.
    Foreign,
}

impl Pump {
    async fn run(mut self, mut line: Box<dyn Transport>) {
        loop {
            let end = self.carry(line).await;
            let lost = Instant::now();
            // Where nobody ever introduced himself there is nobody to come back.
            let known = self.whereabouts.as_ref().filter(|_| self.owner.is_some());
            match (end, known) {
                (End::Closed, _) => return,
                (End::Lost(reason), None) => {
                    return self.hand_on(vec![Event::Problem(DeviceProblem::Disconnected { reason })]).await;
                }
                (End::Lost(reason), Some(_)) => {
                    self.hand_on(vec![Event::Notice(DeviceNotice::LineLost { reason })]).await;
                }
                (End::Foreign, whereabouts) => {
                    let whereabouts = whereabouts.cloned();
                    if !self.wait_until_gone(whereabouts).await {
                        return;
                    }
                }
            }
            let Some(found) = self.wait_for_line().await else { return };
            line = found;
            let mut events = vec![Event::Notice(DeviceNotice::LineBack { seconds: lost.elapsed().as_secs_f64() })];
            self.talk.line_opened(self.began.elapsed(), &mut events);
            self.hand_on(events).await;
        }
    }

    /// Carries bytes and time to and fro until the line is lost or the connection closed.
    async fn carry(&mut self, line: Box<dyn Transport>) -> End {
        let (mut reader, mut writer) = tokio::io::split(line);
        let mut arrived = vec![0; READ_CAPACITY];
        let mut outgoing = Vec::new();
        let mut events = Vec::new();
        let mut baud = None;
        let mut next_tick = Instant::now();
        loop {
            if self.talk.line_baud() != baud {
                // Whatever was asked at the other speed is given up.
                outgoing.clear();
                baud = self.talk.line_baud();
                let mut whole = reader.unsplit(writer);
                if let Some(Err(error)) = baud.map(|baud| whole.set_baud(baud)) {
                    tracing::warn!(?baud, %error, "the line does not go to this speed");
                }
                (reader, writer) = tokio::io::split(whole);
            }
            outgoing.extend(self.talk.take_outgoing());
            let due = self.talk.next_due().map_or(next_tick, |due| (self.began + due).min(next_tick));
            let mut ended = None;
            tokio::select! {
                read = reader.read(&mut arrived) => match read {
                    // A pseudo terminal whose other side closed reads as nothing, again and again.
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
                }
            }
            let foreign = self.find_foreign(&events);
            if let Some((at, problem)) = foreign {
                events.truncate(at);
                events.extend(problem.map(Event::Problem));
                self.hand_on(std::mem::take(&mut events)).await;
                return End::Foreign;
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

    /// Whether another device than the one used so far has introduced itself: from which event on, and in what words.
    fn find_foreign(&mut self, events: &[Event]) -> Option<(usize, Option<DeviceProblem>)> {
        for (at, event) in events.iter().enumerate() {
            if let Event::Connected(info) = event
                && *self.owner.get_or_insert(info.uid) != info.uid
                && self.whereabouts.is_some()
            {
                let told = self.foreign.replace(info.uid) == Some(info.uid);
                return Some((at, (!told).then(|| DeviceProblem::AnotherDevice { found: info.name.clone() })));
            }
        }
        None
    }

    /// Waits until the device that is at the line now is unplugged or swapped, or for some time; whether that came before
    /// the connection was closed.
    async fn wait_until_gone(&mut self, whereabouts: Option<Whereabouts>) -> bool {
        let stamp = || whereabouts.as_ref().and_then(Whereabouts::stamp);
        let (foreign, since) = (stamp(), Instant::now());
        while self.closing_until.is_none() {
            tokio::select! {
                wish = self.wishes.recv() => self.heed(wish, &mut Vec::new()),
                () = tokio::time::sleep(FOREIGN_PAUSE) => {
                    if stamp() != foreign || since.elapsed() >= FOREIGN_PATIENCE {
                        return true;
                    }
                }
            }
        }
        false
    }

    /// Looks for the line again and again; `None` if the connection is closed meanwhile.
    async fn wait_for_line(&mut self) -> Option<Box<dyn Transport>> {
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
            match whereabouts.try_again().await {
                Some(Ok(line)) => return Some(line),
                Some(Err(problem)) if !told => {
                    let since = *seen.get_or_insert_with(Instant::now);
                    if since.elapsed() >= TELL_WAITING_AFTER {
                        told = true;
                        events.push(Event::Notice(DeviceNotice::LineWaits { reason: problem.to_string() }));
                    }
                }
                Some(Err(_)) => {}
                None => seen = None,
            }
            self.hand_on(events).await;
        }
    }

    async fn hand_on(&mut self, events: Vec<Event>) {
        self.counters.send_replace(self.talk.counters());
        for event in events {
            // Nobody listens while a connection is being closed.
            let _ = self.events.send(event).await;
        }
    }

    /// Does what the owner wants.
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
