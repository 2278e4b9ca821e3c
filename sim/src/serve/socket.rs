//! A TCP listener with one host at a time, and what all lines share.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
#[cfg(unix)]
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

use super::port::Port;

#[derive(Debug)]
pub(super) struct Socket {
    listener: TcpListener,
    host: Option<TcpStream>,
}

impl Socket {
    pub(super) fn listen(address: &str) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener, host: None })
    }

    pub(super) fn local_address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    fn accept(&mut self) {
        // A connection that breaks while it is being accepted is simply ignored.
        if let Ok((stream, _)) = self.listener.accept()
            && stream.set_nonblocking(true).is_ok()
            && stream.set_nodelay(true).is_ok()
        {
            self.host = Some(stream);
        }
    }
}

impl Port for Socket {
    fn receive(&mut self, bytes: &mut Vec<u8>) -> io::Result<()> {
        if self.host.is_none() {
            self.accept();
        }
        let gone = self.host.as_mut().is_some_and(|host| !matches!(read_all(host, bytes), Ok(true)));
        if gone {
            self.host = None;
        }
        Ok(())
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Option<usize>> {
        let Some(host) = &mut self.host else { return Ok(None) };
        // A host that went away is not our error: the next one may come.
        let sent = write_some(host, bytes).ok();
        if sent.is_none() {
            self.host = None;
        }
        Ok(sent)
    }

    #[cfg(unix)]
    fn wait(&mut self, for_room: bool, timeout: Duration) {
        match &self.host {
            Some(host) => wait_for(&[(host.as_fd(), for_room)], timeout),
            None => wait_for(&[(self.listener.as_fd(), false)], timeout),
        }
    }

    #[cfg(not(unix))]
    fn wait(&mut self, _for_room: bool, timeout: Duration) {
        std::thread::sleep(timeout.min(Duration::from_millis(1)));
    }
}

/// Appends everything that can be read without waiting; `false` at the end of the stream.
pub(super) fn read_all(from: &mut impl Read, bytes: &mut Vec<u8>) -> io::Result<bool> {
    /// Most bytes received in one step; the rest waits for the next.
    const MOST: usize = 64 * 1024;
    let mut chunk = [0; 4096];
    while bytes.len() < MOST {
        match from.read(&mut chunk) {
            Ok(0) => return Ok(false),
            Ok(count) => bytes.extend_from_slice(&chunk[..count]),
            Err(error) if error.kind() == ErrorKind::WouldBlock => break,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(true)
}

/// Writes as much as possible without waiting; 0 if nothing can be written.
pub(super) fn write_some(to: &mut impl Write, bytes: &[u8]) -> io::Result<usize> {
    match to.write(bytes) {
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(0),
        other => other,
    }
}

/// Sleeps until one of these can be read (or written, if requested), or until the timeout.
#[cfg(unix)]
pub(super) fn wait_for(lines: &[(BorrowedFd<'_>, bool)], timeout: Duration) {
    use nix::poll::{PollFd, PollFlags};
    let mut polled: Vec<PollFd<'_>> = lines
        .iter()
        .map(|&(line, for_room)| {
            let room = if for_room { PollFlags::POLLOUT } else { PollFlags::empty() };
            PollFd::new(line, PollFlags::POLLIN | room)
        })
        .collect();
    // An interruption only ends the sleep early.
    #[cfg(target_os = "linux")]
    let _ = nix::poll::ppoll(&mut polled, Some(timeout.into()), None);
    #[cfg(not(target_os = "linux"))]
    let _ = nix::poll::poll(&mut polled, timeout.as_millis().clamp(1, 1000) as u16);
}
