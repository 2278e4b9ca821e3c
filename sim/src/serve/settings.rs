//! How to serve, and what happened while serving.

use std::io;
use std::time::Duration;

use crate::faults::Truth;

/// Where to serve.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// On a new pseudo-terminal.
    Pty,
    /// Over TCP at this address.
    Tcp(String),
}

/// How to serve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServeSettings {
    /// Limit the line to this speed, bits per second with ten bits a byte; a pseudo-terminal itself has no speed.
    pub pace_baud: Option<u32>,
    /// Bytes kept for a host that does not read; beyond that, whole frames are lost, as in a real device.
    pub buffer_bytes: usize,
    /// Unplug after this time: the terminal or connection goes away.
    pub unplug_after: Option<Duration>,
}

impl Default for ServeSettings {
    /// Full speed, a second's worth of buffer, no unplugging.
    fn default() -> Self {
        Self { pace_baud: None, buffer_bytes: 256 * 1024, unplug_after: None }
    }
}

/// What happened while serving.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ServeReport {
    /// What the puppet really did.
    pub truth: Truth,
    /// Bytes sent.
    pub bytes_sent: u64,
    /// Frames lost because nobody read (or nobody was connected) and the buffer was full.
    pub frames_dropped: u64,
    /// Bytes of those.
    pub bytes_dropped: u64,
}

/// Why serving failed.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// No pseudo-terminal.
    #[error("cannot open a pseudo-terminal: {0}; serve over TCP instead")]
    PseudoTerminal(io::Error),
    /// This system has none.
    #[error("this system has no pseudo-terminals; serve over TCP instead")]
    NoPseudoTerminals,
    /// Cannot listen on the address.
    #[error("cannot listen on {address}: {source}; choose another address or port (port 0 lets the system choose)")]
    Listen {
        /// The address given.
        address: String,
        /// The system's error.
        source: io::Error,
    },
    /// The line broke.
    #[error("the connection to the host was lost: {0}")]
    Line(#[from] io::Error),
}
