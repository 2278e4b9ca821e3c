//! A pseudo-terminal that looks like a serial port.

use std::fs::File;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::time::Duration;

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::ttyname;

use super::port::Port;
use super::socket::{read_all, wait_for, write_some};

/// Our end, plus the host's end kept open so that bytes wait there for the next program that opens it.
#[derive(Debug)]
pub(super) struct PseudoTerminal {
    ours: File,
    theirs: OwnedFd,
}

impl PseudoTerminal {
    /// The speed the host has set on its end, bits per second.
    pub(super) fn host_baud(&self) -> io::Result<u32> {
        Ok(rustix::termios::tcgetattr(&self.theirs)?.output_speed())
    }
}

/// Opens one; the host's end is raw before anything is written, so that nothing is echoed or translated.
pub(super) fn open() -> io::Result<(PseudoTerminal, String)> {
    let pair = openpty(None, None)?;
    let mut mode = tcgetattr(&pair.slave)?;
    cfmakeraw(&mut mode);
    tcsetattr(&pair.slave, SetArg::TCSANOW, &mode)?;
    let path = ttyname(&pair.slave)?;
    let flags = OFlag::from_bits_retain(fcntl(&pair.master, FcntlArg::F_GETFL)?);
    fcntl(&pair.master, FcntlArg::F_SETFL(flags | OFlag::O_NONBLOCK))?;
    let path = path.into_os_string().into_string().map_err(|_| io::Error::other("the terminal's path is not text"))?;
    Ok((PseudoTerminal { ours: File::from(pair.master), theirs: pair.slave }, path))
}

impl Port for PseudoTerminal {
    fn receive(&mut self, bytes: &mut Vec<u8>) -> io::Result<()> {
        read_all(&mut self.ours, bytes).map(drop)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Option<usize>> {
        write_some(&mut self.ours, bytes).map(Some)
    }

    fn wait(&mut self, for_room: bool, timeout: Duration) {
        wait_for(&[(self.ours.as_fd(), for_room)], timeout);
    }
}
