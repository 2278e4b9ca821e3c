//! A device in its own thread, on a real line.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use std::io::{ErrorKind, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::common::FakeDevice;

/// A device that runs in its own thread until it is unplugged.
pub(crate) struct Served {
    unplugged: Arc<AtomicBool>,
    thread: JoinHandle<FakeDevice>,
}

impl Served {
    /// Serves a device on a line that does not block. The line is closed when the device is unplugged.
    pub(crate) fn on(mut line: impl Read + Write + Send + 'static, mut device: FakeDevice) -> Self {
        let unplugged = Arc::new(AtomicBool::new(false));
        let ends = unplugged.clone();
        let thread = std::thread::spawn(move || {
            let began = Instant::now();
            let mut buffer = [0; 4_096];
            while !ends.load(Ordering::Relaxed) {
                match line.read(&mut buffer) {
                    Ok(0) => break,
                    Ok(length) => device.hear(began.elapsed(), &buffer[..length]),
                    Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(Duration::from_millis(1)),
                    Err(_) => break,
                }
                device.step(began.elapsed());
                let mut out = device.take_outgoing();
                while !out.is_empty() && !ends.load(Ordering::Relaxed) {
                    match line.write(&out) {
                        Ok(length) => drop(out.drain(..length)),
                        Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::yield_now(),
                        Err(_) => return device,
                    }
                }
                if line.flush().is_err() {
                    return device;
                }
            }
            device
        });
        Self { unplugged, thread }
    }

    /// Waits until the line is closed from the other side.
    pub(crate) fn join(self) -> std::thread::Result<FakeDevice> {
        self.thread.join()
    }

    pub(crate) fn unplug(self) -> FakeDevice {
        self.unplugged.store(true, Ordering::Relaxed);
        self.thread.join().expect("the device does not panic")
    }
}

/// Opens a pseudo-terminal in raw mode: the device's side, a file that keeps the other side open, and its path.
pub(crate) fn pseudo_terminal() -> (std::fs::File, std::fs::File, String) {
    use nix::fcntl::{FcntlArg, OFlag, fcntl};
    use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
    let pair = nix::pty::openpty(None, None).expect("a pseudo terminal");
    let mut mode = tcgetattr(&pair.slave).expect("its mode");
    cfmakeraw(&mut mode);
    tcsetattr(&pair.slave, SetArg::TCSANOW, &mode).expect("raw mode");
    fcntl(&pair.master, FcntlArg::F_SETFL(OFlag::O_NONBLOCK)).expect("no blocking");
    let path = nix::unistd::ttyname(&pair.slave).expect("its path");
    (pair.master.into(), pair.slave.into(), path.to_string_lossy().into_owned())
}
