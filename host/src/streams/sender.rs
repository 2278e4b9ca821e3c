//! The thread that sends poses, and the slot through which it gets them.

use std::fmt;
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use armature_rig::ShapeWeights;
use glam::Affine3A;

use super::json;
use super::skeleton::{StreamedPose, StreamedSkeleton};
use super::target::{StreamKind, StreamTarget};
use super::vmc::VmcSkeleton;
use super::web_socket::WebSocketServer;
use crate::failure::Failure;

/// More does not fit into a UDP datagram.
const MOST_DATAGRAM_BYTES: usize = 65_507;
/// Receivers are told that the puppet is silent after this long without a pose.
const SILENT: Duration = Duration::from_secs(1);

/// Running streams. They end when this is dropped or [finished](Self::finish).
#[derive(Debug)]
pub struct Streams {
    slot: Arc<Slot>,
    thread: Option<JoinHandle<Vec<StreamReport>>>,
    addresses: Vec<String>,
}

/// What a stream came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StreamReport {
    /// Where it went.
    pub target: StreamTarget,
    /// Poses that were sent.
    pub poses: u64,
    /// Poses that could not be sent, and the last reason.
    pub failed: Option<(u64, String)>,
    /// How many programs listened, at most; unknown for datagrams.
    pub listeners: Option<usize>,
}

impl fmt::Display for StreamReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} poses to {}", self.poses, self.target)?;
        if let Some(listeners) = self.listeners {
            write!(f, ", at most {} at a time", crate::terminal::counted(listeners, "listener", "listeners"))?;
        }
        match &self.failed {
            Some((count, why)) => write!(f, "; {count} could not be sent: {why}"),
            None => Ok(()),
        }
    }
}

/// Where the newest pose lies until the thread takes it.
#[derive(Debug, Default)]
struct Slot {
    state: Mutex<SlotState>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct SlotState {
    pose: StreamedPose,
    is_new: bool,
    is_over: bool,
}

impl Slot {
    /// A thread that panicked left at worst an old pose.
    fn lock(&self) -> MutexGuard<'_, SlotState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Streams {
    /// Opens streams to all targets. `rate`: poses per second, at most; the puppet may send fewer.
    pub fn open(targets: &[StreamTarget], rate: f64, skeleton: StreamedSkeleton) -> Result<Self, Failure> {
        let outlets = targets.iter().map(|target| Outlet::open(target, &skeleton)).collect::<Result<Vec<_>, _>>()?;
        let addresses = outlets.iter().map(|outlet| outlet.report.target.to_string()).collect();
        let slot = Arc::new(Slot::default());
        let sender = Sender { slot: slot.clone(), outlets, skeleton, period: Duration::from_secs_f64(1.0 / rate) };
        let thread = std::thread::Builder::new().name("streams".into()).spawn(move || sender.run());
        let thread =
            thread.map_err(|e| Failure::input(format!("no thread for the streams: {e}"), "end other programs"))?;
        Ok(Self { slot, thread: Some(thread), addresses })
    }

    /// Where they go, in words; a WebSocket's port is the one it listens at.
    pub fn addresses(&self) -> &[String] {
        &self.addresses
    }

    /// Hands over a new pose. Copies it and returns; a pose that was not sent yet is replaced.
    ///
    /// `seconds`: the device's clock. `model_from_bone`: one for each bone of the skeleton. `shapes`: those that are set.
    pub fn pose(&self, seconds: f64, model_from_bone: &[Affine3A], shapes: &ShapeWeights) {
        let mut state = self.slot.lock();
        state.pose.seconds = seconds;
        state.pose.model_from_bone.clear();
        state.pose.model_from_bone.extend_from_slice(model_from_bone);
        state.pose.shapes.copy_from(shapes);
        state.is_new = true;
        drop(state);
        self.slot.changed.notify_one();
    }

    /// Ends the streams.
    pub fn finish(mut self) -> Vec<StreamReport> {
        self.end()
    }

    fn end(&mut self) -> Vec<StreamReport> {
        self.slot.lock().is_over = true;
        self.slot.changed.notify_one();
        self.thread.take().and_then(|thread| thread.join().ok()).unwrap_or_default()
    }
}

impl Drop for Streams {
    fn drop(&mut self) {
        self.end();
    }
}

struct Sender {
    slot: Arc<Slot>,
    outlets: Vec<Outlet>,
    skeleton: StreamedSkeleton,
    period: Duration,
}

impl Sender {
    fn run(mut self) -> Vec<StreamReport> {
        let began = Instant::now();
        let mut due = began;
        let mut heard = began;
        let mut pose = StreamedPose::default();
        loop {
            let mut state = self.slot.lock();
            loop {
                let until = if state.is_new { due } else { heard + SILENT };
                let wait = until.saturating_duration_since(Instant::now());
                if state.is_over || wait.is_zero() {
                    break;
                }
                state = self.slot.changed.wait_timeout(state, wait).unwrap_or_else(PoisonError::into_inner).0;
            }
            if state.is_over {
                break;
            }
            let is_new = std::mem::take(&mut state.is_new);
            if is_new {
                std::mem::swap(&mut pose, &mut state.pose);
            }
            drop(state);
            let now = Instant::now();
            heard = now;
            let alive = now.duration_since(began).as_secs_f64();
            if is_new {
                // Times that were missed are not made up for.
                due = if now > due + self.period { now + self.period } else { due + self.period };
                let mut text = None;
                self.outlets.iter_mut().for_each(|outlet| outlet.send(&self.skeleton, &pose, alive, &mut text));
            } else {
                self.outlets.iter().for_each(|outlet| outlet.tell_silence(alive));
            }
        }
        self.outlets.into_iter().map(Outlet::finish).collect()
    }
}

/// One stream.
struct Outlet {
    road: Road,
    report: StreamReport,
}

enum Road {
    Vmc { socket: UdpSocket, skeleton: VmcSkeleton, to: SocketAddr },
    Json { socket: UdpSocket, to: SocketAddr },
    WebSocket(WebSocketServer),
}

impl Outlet {
    fn open(target: &StreamTarget, skeleton: &StreamedSkeleton) -> Result<Self, Failure> {
        let mut report = StreamReport { target: target.clone(), poses: 0, failed: None, listeners: None };
        let road = match target.kind {
            StreamKind::WebSocket => {
                let server = WebSocketServer::open(resolve(target)?).map_err(|e| cannot_open(target, &e))?;
                report.target.port = server.port();
                Road::WebSocket(server)
            }
            StreamKind::Json => {
                let (socket, to) = datagrams(target)?;
                Road::Json { socket, to }
            }
            StreamKind::Vmc => {
                let Some(vmc) = VmcSkeleton::new(skeleton) else {
                    let what =
                        format!("{target}: {} was not recognised as a human, and VMC is for humans", skeleton.subject);
                    return Err(Failure::usage(what, "stream it as json or ws, which take any skeleton"));
                };
                let (socket, to) = datagrams(target)?;
                Road::Vmc { socket, skeleton: vmc, to }
            }
        };
        Ok(Self { road, report })
    }

    /// `text`: the pose as JSON, once one of the streams needed it.
    fn send(&mut self, skeleton: &StreamedSkeleton, pose: &StreamedPose, alive: f64, text: &mut Option<Arc<str>>) {
        let mut json = || text.get_or_insert_with(|| json::message(skeleton, pose).into()).clone();
        let sent = match &self.road {
            Road::Vmc { socket, skeleton: vmc, to } => send_all(socket, *to, &vmc.datagrams(skeleton, pose, alive)),
            Road::Json { socket, to } => {
                let text = json();
                if text.len() > MOST_DATAGRAM_BYTES {
                    Err(format!("{} bytes do not fit into a datagram; use ws, which has no limit", text.len()))
                } else {
                    send_all(socket, *to, &[text.as_bytes()])
                }
            }
            Road::WebSocket(server) => {
                server.broadcast(json());
                Ok(())
            }
        };
        match sent {
            Ok(()) => self.report.poses += 1,
            Err(why) => {
                let (count, reason) = self.report.failed.get_or_insert_with(|| (0, String::new()));
                if *count == 0 {
                    tracing::warn!("{}: {why}", self.report.target);
                }
                *count += 1;
                *reason = why;
            }
        }
    }

    fn tell_silence(&self, alive: f64) {
        if let Road::Vmc { socket, to, .. } = &self.road {
            // A receiver that is gone need not know.
            let _ = send_all(socket, *to, &VmcSkeleton::silence(alive));
        }
    }

    fn finish(mut self) -> StreamReport {
        if let Road::WebSocket(server) = self.road {
            self.report.listeners = Some(server.finish());
        }
        self.report
    }
}

fn send_all(socket: &UdpSocket, to: SocketAddr, datagrams: &[impl AsRef<[u8]>]) -> Result<(), String> {
    datagrams.iter().try_for_each(|bytes| socket.send_to(bytes.as_ref(), to).map(drop)).map_err(|e| e.to_string())
}

fn resolve(target: &StreamTarget) -> Result<SocketAddr, Failure> {
    let remedy = "give the address of the machine, as in 192.0.2.7, or leave the host away for this one";
    let found = (target.host.as_str(), target.port).to_socket_addrs();
    let mut found = found.map_err(|e| Failure::usage(format!("{target}: {e}"), remedy))?;
    found.next().ok_or_else(|| Failure::usage(format!("{target}: the host has no address"), remedy))
}

fn datagrams(target: &StreamTarget) -> Result<(UdpSocket, SocketAddr), Failure> {
    let to = resolve(target)?;
    let from = if to.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
    let socket = UdpSocket::bind(from).and_then(|socket| {
        // A full buffer drops a pose; it never delays the next one.
        socket.set_nonblocking(true)?;
        socket.set_broadcast(true)?;
        Ok(socket)
    });
    Ok((socket.map_err(|e| cannot_open(target, &e))?, to))
}

fn cannot_open(target: &StreamTarget, error: &std::io::Error) -> Failure {
    let remedy = match error.kind() {
        std::io::ErrorKind::AddrInUse => "another program uses this port: choose another, or end that program",
        std::io::ErrorKind::AddrNotAvailable => {
            "a WebSocket is served at an address of this machine: 127.0.0.1, or 0.0.0.0 for all"
        }
        _ => "choose another address or port",
    };
    Failure::input(format!("{target} cannot be opened: {error}"), remedy)
}
