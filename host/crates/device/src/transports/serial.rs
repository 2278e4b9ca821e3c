//! Serial ports, and pseudo-terminals that look like them.

use std::path::Path;

use tokio_serial::{ErrorKind, SerialPort, SerialStream};

#[cfg(target_os = "linux")]
use super::latency_timer;
use super::transport::Transport;
use crate::events::DeviceProblem;

impl Transport for SerialStream {
    fn set_baud(&mut self, baud: u32) -> std::io::Result<()> {
        SerialPort::set_baud_rate(self, baud).map_err(std::io::Error::from)
    }
}

/// Opens the port.
pub(super) fn open(path: &str, baud: u32) -> Result<SerialStream, DeviceProblem> {
    if cfg!(unix) && !Path::new(path).exists() {
        return Err(DeviceProblem::PortMissing { port: path.to_owned() });
    }
    let mut line = SerialStream::open(&tokio_serial::new(path, baud)).map_err(|error| serial_problem(path, &error))?;
    // Many USB devices send only while DTR signals a listener. A pseudo-terminal has no such wire and reports an error.
    if let Err(error) = line.write_data_terminal_ready(true) {
        tracing::debug!(path, %error, "no DTR here");
    }
    #[cfg(target_os = "linux")]
    {
        // A link stands for the port it points to.
        let real = std::fs::canonicalize(path).unwrap_or_else(|_| Path::new(path).to_path_buf());
        latency_timer::shorten(Path::new(latency_timer::PORTS), &real.to_string_lossy());
    }
    Ok(line)
}

fn serial_problem(path: &str, error: &tokio_serial::Error) -> DeviceProblem {
    let port = path.to_owned();
    match error.kind {
        ErrorKind::NoDevice if cfg!(unix) => DeviceProblem::PortBusy { port },
        ErrorKind::Io(std::io::ErrorKind::PermissionDenied) if cfg!(windows) => DeviceProblem::PortBusy { port },
        ErrorKind::Io(std::io::ErrorKind::PermissionDenied) => {
            DeviceProblem::PermissionDenied { group: group_of(path), port }
        }
        ErrorKind::NoDevice | ErrorKind::Io(std::io::ErrorKind::NotFound) => DeviceProblem::PortMissing { port },
        _ => DeviceProblem::NotASerialPort { port, reason: error.to_string() },
    }
}

/// The group that may use a port, if the system reports it.
fn group_of(path: &str) -> Option<String> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let group = std::fs::metadata(path).ok()?.gid().to_string();
        let groups = std::fs::read_to_string("/etc/group").ok()?;
        // name:password:number:members
        let name = |line: &str| {
            let mut fields = line.split(':');
            fields.next().filter(|_| fields.nth(1) == Some(&group)).map(str::to_owned)
        };
        groups.lines().find_map(name)
    }
    #[cfg(not(unix))]
    {
        let _ = path;
        None
    }
}
