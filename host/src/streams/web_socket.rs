//! A WebSocket server for poses: each listener gets the newest one, however slow it is.

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message, WebSocket, accept_with_config};

/// More listeners than this are turned away.
const MOST_LISTENERS: usize = 32;
/// A listener that takes longer to shake hands or to take a message is given up.
const PATIENCE: Duration = Duration::from_secs(5);
/// So long a listener's own messages are waited for between two poses.
const GLANCE: Duration = Duration::from_millis(1);
/// Listeners say little; more than this in a message is not for us.
const MOST_INCOMING_BYTES: usize = 1 << 16;

/// A running server.
#[derive(Debug)]
pub(super) struct WebSocketServer {
    shared: Arc<Shared>,
    address: SocketAddr,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Shared {
    /// The newest message and its number.
    newest: Mutex<(u64, Option<Arc<str>>)>,
    changed: Condvar,
    is_over: AtomicBool,
    listeners: AtomicUsize,
    most_listeners: AtomicUsize,
}

impl WebSocketServer {
    /// Serves at this address.
    pub(super) fn open(address: SocketAddr) -> std::io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        let shared = Arc::new(Shared::default());
        let for_thread = shared.clone();
        let thread =
            std::thread::Builder::new().name("web socket".into()).spawn(move || listen(&listener, &for_thread))?;
        Ok(Self { shared, address, thread: Some(thread) })
    }

    pub(super) fn port(&self) -> u16 {
        self.address.port()
    }

    /// Gives every listener a message; one that has not taken the last yet never gets that.
    pub(super) fn broadcast(&self, text: Arc<str>) {
        let mut newest = self.shared.newest.lock().unwrap_or_else(PoisonError::into_inner);
        newest.0 += 1;
        newest.1 = Some(text);
        drop(newest);
        self.shared.changed.notify_all();
    }

    /// Ends it; returns how many listened at the same time, at most.
    pub(super) fn finish(mut self) -> usize {
        self.end();
        self.shared.most_listeners.load(Ordering::Relaxed)
    }

    fn end(&mut self) {
        self.shared.is_over.store(true, Ordering::Relaxed);
        self.shared.changed.notify_all();
        if let Some(thread) = self.thread.take() {
            // Wakes the thread that waits for listeners.
            let mut door = self.address;
            match door.ip() {
                IpAddr::V4(ip) if ip.is_unspecified() => door.set_ip(Ipv4Addr::LOCALHOST.into()),
                IpAddr::V6(ip) if ip.is_unspecified() => door.set_ip(Ipv6Addr::LOCALHOST.into()),
                _ => {}
            }
            if TcpStream::connect_timeout(&door, PATIENCE).is_ok() {
                let _ = thread.join();
            }
        }
    }
}

impl Drop for WebSocketServer {
    fn drop(&mut self) {
        self.end();
    }
}

fn listen(listener: &TcpListener, shared: &Arc<Shared>) {
    for stream in listener.incoming() {
        if shared.is_over.load(Ordering::Relaxed) {
            return;
        }
        let Ok(stream) = stream else {
            // Out of file descriptors, say: the next attempt may go better.
            std::thread::sleep(Duration::from_millis(100));
            continue;
        };
        let count = shared.listeners.fetch_add(1, Ordering::Relaxed) + 1;
        let shared = Seat { shared: shared.clone() };
        if count > MOST_LISTENERS {
            continue;
        }
        shared.shared.most_listeners.fetch_max(count, Ordering::Relaxed);
        // Without a thread the seat is free again.
        let _ = std::thread::Builder::new().name("listener".into()).spawn(move || serve(stream, &shared.shared));
    }
}

/// A listener's place, free again when dropped.
struct Seat {
    shared: Arc<Shared>,
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.shared.listeners.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Serves one listener until it or the stream is over.
fn serve(stream: TcpStream, shared: &Shared) {
    let settings = WebSocketConfig::default()
        .max_message_size(Some(MOST_INCOMING_BYTES))
        .max_frame_size(Some(MOST_INCOMING_BYTES));
    let prepared = stream.set_nodelay(true).and_then(|()| stream.set_read_timeout(Some(PATIENCE)));
    if prepared.and_then(|()| stream.set_write_timeout(Some(PATIENCE))).is_err() {
        return;
    }
    let Ok(mut socket) = accept_with_config(stream, Some(settings)) else { return };
    if socket.get_ref().set_read_timeout(Some(GLANCE)).is_err() {
        return;
    }
    let mut seen = 0;
    while !shared.is_over.load(Ordering::Relaxed) {
        let newest = shared.newest.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = shared.changed.wait_timeout_while(newest, PATIENCE / 10, |newest| {
            newest.0 == seen && !shared.is_over.load(Ordering::Relaxed)
        });
        let (number, text) = waited.unwrap_or_else(PoisonError::into_inner).0.clone();
        if number != seen
            && let Some(text) = text
        {
            seen = number;
            if socket.send(Message::text(&*text)).is_err() {
                return;
            }
        }
        if !still_listens(&mut socket) {
            return;
        }
    }
    let _ = socket.close(None);
    let _ = socket.flush();
}

/// Answers pings and a farewell; whatever else a listener says is not for us.
fn still_listens(socket: &mut WebSocket<TcpStream>) -> bool {
    match socket.read() {
        Ok(_) => true,
        Err(Error::Io(error)) => matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut),
        Err(_) => false,
    }
}
