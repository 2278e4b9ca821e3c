//! Connects blocking libraries to a line of the runtime: two threads and an in-memory pipe, for any library.

use std::io;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt, DuplexStream, ReadBuf, ReadHalf, WriteHalf};
use tokio::runtime::Handle;

use super::transport::Transport;

/// Bytes kept each way; about 250 samples of 96 sensors.
const CAPACITY: usize = 1 << 16;
/// Most bytes read or written at once: a multiple of every USB packet length.
const AT_ONCE: usize = 1 << 14;
/// How long one read waits for bytes; a dropped line is released within this time.
pub(crate) const READ_PATIENCE: Duration = Duration::from_millis(20);

/// The reading half of a device.
pub(crate) trait BlockingRead: Send + 'static {
    /// Waits for bytes, for at most [`READ_PATIENCE`]; 0 if none arrived.
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize>;
}

/// The writing half of a device.
pub(crate) trait BlockingWrite: Send + 'static {
    /// Writes some of the bytes and returns how many; 0 if the device took none for a while.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;
}

/// A device behind a blocking library, as a line. Dropping it ends the threads, which release the device as soon as
/// everything written before has been sent.
#[derive(Debug)]
pub(crate) struct Bridge {
    near: DuplexStream,
    ends: Arc<Ends>,
}

/// What the two threads share.
#[derive(Debug, Default)]
struct Ends {
    over: AtomicBool,
    lost: OnceLock<(io::ErrorKind, String)>,
}

impl Ends {
    fn lose(&self, error: &io::Error) {
        // The first reason is the real one; later ones are its consequences.
        let _ = self.lost.set((error.kind(), error.to_string()));
    }

    fn why(&self) -> Option<io::Error> {
        self.lost.get().map(|(kind, why)| io::Error::new(*kind, why.clone()))
    }
}

impl Bridge {
    /// Starts carrying bytes. Must be called on a runtime.
    pub(crate) fn start(reader: impl BlockingRead, writer: impl BlockingWrite) -> io::Result<Self> {
        let (near, far) = tokio::io::duplex(CAPACITY);
        let (from_host, to_host) = tokio::io::split(far);
        let ends = Arc::new(Ends::default());
        let (runtime, shared) = (Handle::current(), ends.clone());
        std::thread::Builder::new()
            .name("device-in".into())
            .spawn(move || carry_in(reader, to_host, &shared, &runtime))?;
        let (runtime, shared) = (Handle::current(), ends.clone());
        std::thread::Builder::new()
            .name("device-out".into())
            .spawn(move || carry_out(writer, from_host, &shared, &runtime))?;
        Ok(Self { near, ends })
    }
}

fn carry_in(mut device: impl BlockingRead, mut to_host: WriteHalf<DuplexStream>, ends: &Ends, runtime: &Handle) {
    let mut bytes = vec![0; AT_ONCE];
    while !ends.over.load(Ordering::Acquire) {
        match device.read(&mut bytes) {
            Ok(0) => {}
            Ok(length) if runtime.block_on(to_host.write_all(&bytes[..length])).is_ok() => {}
            // Nobody reads any more.
            Ok(_) => break,
            Err(error) => {
                ends.lose(&error);
                break;
            }
        }
    }
    // What has arrived can still be read; then comes the end.
    let _ = runtime.block_on(to_host.shutdown());
}

fn carry_out(mut device: impl BlockingWrite, mut from_host: ReadHalf<DuplexStream>, ends: &Ends, runtime: &Handle) {
    let mut bytes = vec![0; AT_ONCE];
    // 0 bytes: the near end was dropped.
    while let Ok(length @ 1..) = runtime.block_on(from_host.read(&mut bytes)) {
        let mut left = &bytes[..length];
        while !left.is_empty() && ends.lost.get().is_none() {
            match device.write(left) {
                Ok(taken) => left = &left[taken..],
                Err(error) => ends.lose(&error),
            }
        }
        if ends.lost.get().is_some() {
            break;
        }
    }
    ends.over.store(true, Ordering::Release);
}

impl AsyncRead for Bridge {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context<'_>, into: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        let before = into.filled().len();
        ready!(Pin::new(&mut self.near).poll_read(context, into))?;
        if into.filled().len() == before
            && let Some(error) = self.ends.why()
        {
            return Poll::Ready(Err(error));
        }
        Poll::Ready(Ok(()))
    }
}

impl AsyncWrite for Bridge {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        if let Some(error) = self.ends.why() {
            return Poll::Ready(Err(error));
        }
        Pin::new(&mut self.near).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.near).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.near).poll_shutdown(context)
    }
}

impl Transport for Bridge {}

#[cfg(test)]
#[path = "bridge_tests.rs"]
mod tests;
