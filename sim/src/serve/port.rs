//! A line to a host, of any kind.

use std::io;
use std::time::Duration;

/// A serving loop checks at least this often whether it should stop.
pub(super) const LOOK_UP: Duration = Duration::from_millis(50);

/// A line to a host.
pub(super) trait Port {
    /// Appends what has arrived.
    fn receive(&mut self, bytes: &mut Vec<u8>) -> io::Result<()>;
    /// Sends as much as possible without waiting; `None` if nobody is connected.
    fn send(&mut self, bytes: &[u8]) -> io::Result<Option<usize>>;
    /// Sleeps until something arrives, until there is space to send (if `for_room`), or until the timeout.
    fn wait(&mut self, for_room: bool, timeout: Duration);
}
