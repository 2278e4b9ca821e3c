//! A session on a real line, from its owner's side.

use firmware_protocol::PartUid;
use tokio::runtime::Handle;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tokio::time::Instant;

use super::pump::{Channels, Pump, Wish};
use super::talk::Talk;
use super::whereabouts::{Ports, Whereabouts};
use crate::address::DeviceAddress;
use crate::discovery::DeviceDescription;
use crate::events::{DeviceProblem, Event, SessionCounters};
use crate::servo::{ServoArm, ServoSession, ServoSettings, seat_of};
use crate::session::{Session, SessionSettings};
use crate::transports::{Transport, open};

/// Most events that wait for their receiver; four seconds of samples at 1,000 Hz. When the channel is full, the line is
/// not read until some have been taken.
const EVENT_CAPACITY: usize = 4_096;

/// How a connection behaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConnectionSettings {
    /// The conversation with a puppet.
    pub session: SessionSettings,
    /// The conversation with an arm of bus servos.
    pub servos: ServoSettings,
    /// Whether a lost line is reopened as soon as it is back. Otherwise its loss ends the connection.
    pub reopen: bool,
}

impl Default for ConnectionSettings {
    fn default() -> Self {
        Self { session: SessionSettings::default(), servos: ServoSettings::default(), reopen: true }
    }
}

/// A session that runs over a line, on a tokio runtime, until it is closed.
///
/// Events come out of a bounded channel in the order in which they happened. A lost line is reported
/// ([`DeviceNotice::LineLost`](crate::DeviceNotice::LineLost)) and reopened automatically when it is back; where that
/// is not wanted or not possible, the last event is [`DeviceProblem::Disconnected`]. Dropping a connection stops the
/// device in the background, as long as the runtime lives; [`close`](Self::close) also waits for that.
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
        Self::open_at(runtime, address, settings, Ports::of_this_machine()).await
    }

    /// Like [`open`](Self::open), where `ports` lists the serial ports among which a lost device is looked for, not the
    /// operating system.
    pub async fn open_among(
        runtime: &Handle,
        address: &DeviceAddress,
        settings: ConnectionSettings,
        ports: impl Fn() -> Vec<DeviceDescription> + Send + Sync + 'static,
    ) -> Result<Self, DeviceProblem> {
        Self::open_at(runtime, address, settings, Ports::listed_by(ports)).await
    }

    async fn open_at(
        runtime: &Handle,
        address: &DeviceAddress,
        settings: ConnectionSettings,
        ports: Ports,
    ) -> Result<Self, DeviceProblem> {
        let whereabouts = Whereabouts::note(address, ports);
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
        let pump = Pump::new(
            talk,
            whereabouts,
            began,
            Channels { events: event_sender, wishes: wish_receiver, counters: counter_sender },
        );
        let pump = runtime.spawn(pump.run(line));
        Self { events, wishes, counters, began, pump }
    }

    /// The instant of the session's time zero: `began + sample.received` is when the sample's last byte arrived.
    pub fn began(&self) -> std::time::Instant {
        self.began.into_std()
    }

    /// Requests samples at this rate, in samples per 1,000 seconds; see [`Session::start`].
    pub fn start(&self, rate_millihertz: u32) {
        self.wish(Wish::Start { rate_millihertz });
    }

    /// Ends the samples; see [`Session::stop`].
    pub fn stop(&self) {
        self.wish(Wish::Stop);
    }

    /// Makes a part blink; see [`Session::blink`].
    pub fn blink(&self, uid: PartUid, duration_millis: u16) {
        self.wish(Wish::Blink { uid, duration_millis });
    }

    /// The next event; `None` once the connection has ended and all events have been taken.
    pub async fn next(&mut self) -> Option<Event> {
        self.events.recv().await
    }

    /// Like [`next`](Self::next), for threads outside the runtime.
    pub fn blocking_next(&mut self) -> Option<Event> {
        self.events.blocking_recv()
    }

    /// An event that is already there, if any; for callers that draw frames and must not wait.
    pub fn try_next(&mut self) -> Option<Event> {
        self.events.try_recv().ok()
    }

    /// Whether the connection has ended and all its events have been taken.
    pub fn is_over(&self) -> bool {
        self.pump.is_finished() && self.events.is_empty()
    }

    /// The counters so far.
    pub fn counters(&self) -> SessionCounters {
        *self.counters.borrow()
    }

    /// Stops the device, closes the line and returns the final counts. Events not taken are dropped.
    pub async fn close(mut self) -> SessionCounters {
        self.wish(Wish::Close);
        self.events.close();
        if let Err(error) = (&mut self.pump).await {
            tracing::error!(%error, "the session ended unexpectedly");
        }
        self.counters()
    }

    /// A pump that has ended no longer needs any requests.
    fn wish(&self, wish: Wish) {
        if self.wishes.send(wish).is_err() {
            tracing::debug!(?wish, "the connection has ended");
        }
    }
}
