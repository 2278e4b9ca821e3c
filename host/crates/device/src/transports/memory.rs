//! Lines within this machine: memory, and Unix sockets.

use tokio::io::DuplexStream;

use super::transport::Transport;

/// Bytes each way of an in-memory line; about 250 samples of 96 sensors.
const MEMORY_CAPACITY: usize = 1 << 16;

impl Transport for DuplexStream {}
#[cfg(unix)]
impl Transport for tokio::net::UnixStream {}

/// An in-memory line: what is written to one end is read from the other. Dropping an end closes it.
pub fn memory() -> (DuplexStream, DuplexStream) {
    tokio::io::duplex(MEMORY_CAPACITY)
}
