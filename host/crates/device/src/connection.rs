//! A session on a real line: the pump that moves bytes and time.

use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::runtime::Handle;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tokio::time::{Instant, MissedTickBehavior};

use crate::{DeviceProblem, Event, PartUid, Session, SessionCounters, SessionSettings, Transport};

/// Time between two looks at the clock when nothing arrives.
const TICK: Duration = Duration::from_millis(20);
/// Bytes read at once at most; 60 samples of 96 sensors.
const READ_CAPACITY: usize = 1 << 14;
/// Events that wait for their receiver at most; four seconds of samples at 1,000 Hz. When they are that many, the
/// line is not read until some have been taken.
const EVENT_CAPACITY: usize = 4_096;
/// Time the device has to acknowledge the last stop when the connection is closed.
const CLOSING_PATIENCE: Duration = Duration::from_millis(600);

#[derive(Clone, Copy, Debug)]
enum Wish {
    Start { rate_millihertz: u32 },
    Stop,
    Blink { uid: PartUid, duration_millis: u16 },
    Close,
}

/// A session that runs over a line, on a tokio runtime, until the line ends or it is closed.
///
/// Events come out of a bounded channel in the order in which they happened; the last one of a line that ended is
/// [`DeviceProblem::Disconnected`]. Dropping a connection stops the device in the background, as long as the
/// runtime lives; [`close`](Self::close) also waits for that.
#[derive(Debug)]
pub struct Connection {
    events: mpsc::Receiver<Event>,
    wishes: mpsc::UnboundedSender<Wish>,
    counters: watch::Receiver<SessionCounters>,
    began: Instant,
    pump: JoinHandle<()>,
}

impl Connection {
    /// Begins a session on this line. The runtime needs I/O and time enabled.
    pub fn spawn(runtime: &Handle, line: impl Transport, settings: SessionSettings) -> Self {
        let (event_sender, events) = mpsc::channel(EVENT_CAPACITY);
        let (wishes, wish_receiver) = mpsc::unbounded_channel();
        let (counter_sender, counters) = watch::channel(SessionCounters::default());
        let began = Instant::now();
        let pump = Pump {
            session: Session::new(settings),
            began,
            events: event_sender,
            wishes: wish_receiver,
            counters: counter_sender,
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
    session: Session,
    began: Instant,
    events: mpsc::Sender<Event>,
    wishes: mpsc::UnboundedReceiver<Wish>,
    counters: watch::Sender<SessionCounters>,
}

impl Pump {
    async fn run(mut self, line: impl Transport) {
        let (mut reader, mut writer) = tokio::io::split(line);
        let mut arrived = vec![0; READ_CAPACITY];
        let mut outgoing = Vec::new();
        let mut events = Vec::new();
        let mut closing_until = None;
        let mut ticker = tokio::time::interval(TICK);
        ticker.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            let mut ended = None;
            tokio::select! {
                read = reader.read(&mut arrived) => match read {
                    // A pseudo terminal whose other side closed reads as nothing, again and again.
                    Ok(0) => ended = Some("the line was closed".to_owned()),
                    Ok(length) => self.session.receive(self.began.elapsed(), &arrived[..length], &mut events),
                    Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                    Err(error) => ended = Some(error.to_string()),
                },
                written = writer.write(&outgoing), if !outgoing.is_empty() => match written {
                    Ok(length) => drop(outgoing.drain(..length)),
                    Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                    Err(error) => ended = Some(error.to_string()),
                },
                wish = self.wishes.recv(), if closing_until.is_none() => {
                    if self.heed(wish) {
                        closing_until = Some(Instant::now() + CLOSING_PATIENCE);
                    }
                    self.session.tick(self.began.elapsed(), &mut events);
                }
                _ = ticker.tick() => self.session.tick(self.began.elapsed(), &mut events),
            }
            outgoing.extend(self.session.take_outgoing());
            let over = ended.is_some();
            events.extend(ended.map(|reason| Event::Problem(DeviceProblem::Disconnected { reason })));
            self.counters.send_replace(self.session.counters());
            for event in events.drain(..) {
                // Nobody listens while a connection is being closed.
                let _ = self.events.send(event).await;
            }
            let closed = closing_until
                .is_some_and(|until| Instant::now() >= until || (outgoing.is_empty() && !self.session.is_streaming()));
            if over || closed {
                return;
            }
        }
    }

    /// Does what the owner wants; returns whether that is to close.
    fn heed(&mut self, wish: Option<Wish>) -> bool {
        match wish {
            Some(Wish::Start { rate_millihertz }) => self.session.start(rate_millihertz),
            Some(Wish::Stop) => self.session.stop(),
            Some(Wish::Blink { uid, duration_millis }) => self.session.blink(uid, duration_millis),
            Some(Wish::Close) | None => {
                self.session.stop();
                return true;
            }
        }
        false
    }
}
