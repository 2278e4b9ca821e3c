//! A line, on any carrier.

use tokio::io::{AsyncRead, AsyncWrite};

/// A line: bytes in, bytes out, in order. Reading 0 bytes means that the other end is gone.
pub trait Transport: AsyncRead + AsyncWrite + Send + Unpin + 'static {
    /// Changes to another speed, bits per second; lines without a speed ignore it.
    fn set_baud(&mut self, _baud: u32) -> std::io::Result<()> {
        Ok(())
    }
}

impl Transport for Box<dyn Transport> {
    fn set_baud(&mut self, baud: u32) -> std::io::Result<()> {
        (**self).set_baud(baud)
    }
}
