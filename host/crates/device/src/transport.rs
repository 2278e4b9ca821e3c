//! The lines that carry the bytes: serial ports, USB bulk, HID, TCP, memory. One small trait, and everything above it the same.

use std::path::Path;
use std::time::{Duration, Instant};

use tokio::io::{AsyncRead, AsyncWrite, DuplexStream};
use tokio::net::TcpStream;
use tokio_serial::{ErrorKind, SerialPort, SerialStream};

use crate::bridge::{BlockingRead, BlockingWrite, Bridge, READ_PATIENCE};
use crate::{DeviceAddress, DeviceProblem, hid, usb_bulk};

/// Time a network device has to accept a connection.
const TCP_PATIENCE: Duration = Duration::from_secs(5);
/// Time a device has to be released by whoever has it.
const RELEASE_PATIENCE: Duration = Duration::from_millis(250);
/// The speed at which a line to servos is opened; the session goes on from there.
const FIRST_SERVO_BAUD: u32 = 1_000_000;
/// Bytes each way of a line in memory; about 250 samples of 96 sensors.
const MEMORY_CAPACITY: usize = 1 << 16;

/// A line: bytes in, bytes out, in order. Reading 0 bytes means that the other end is gone.
pub trait Transport: AsyncRead + AsyncWrite + Send + Unpin + 'static {
    /// Goes to another speed, bits a second; lines that have none stay as they are.
    fn set_baud(&mut self, _baud: u32) -> std::io::Result<()> {
        Ok(())
    }
}

impl Transport for TcpStream {}
impl Transport for DuplexStream {}
#[cfg(unix)]
impl Transport for tokio::net::UnixStream {}

impl Transport for SerialStream {
    fn set_baud(&mut self, baud: u32) -> std::io::Result<()> {
        SerialPort::set_baud_rate(self, baud).map_err(std::io::Error::from)
    }
}

impl Transport for Box<dyn Transport> {
    fn set_baud(&mut self, baud: u32) -> std::io::Result<()> {
        (**self).set_baud(baud)
    }
}

/// Opens the line to a device. Must be called on a tokio runtime with I/O and time enabled.
pub async fn open(address: &DeviceAddress) -> Result<Box<dyn Transport>, DeviceProblem> {
    match address {
        DeviceAddress::Serial { path, baud } => Ok(Box::new(open_serial(path, *baud)?)),
        DeviceAddress::Servos { path, baud, .. } => Ok(Box::new(open_serial(path, baud.unwrap_or(FIRST_SERVO_BAUD))?)),
        DeviceAddress::Usb(id) => {
            let id = id.clone();
            bridged(move || usb_bulk::open(&id)).await
        }
        DeviceAddress::Hid(place) => {
            let place = place.clone();
            bridged(move || hid::open(&place)).await
        }
        DeviceAddress::Tcp { host, port } => Ok(Box::new(open_tcp(host, *port).await?)),
        DeviceAddress::Sim { name } => Err(DeviceProblem::SimulatedHere { name: name.clone() }),
    }
}

/// A line in memory: what is written to one end is read from the other. Dropping an end closes it.
pub fn memory() -> (DuplexStream, DuplexStream) {
    tokio::io::duplex(MEMORY_CAPACITY)
}

/// Opens a device through a library that blocks. A line that this program has just given up may hold the device for
/// another moment.
async fn bridged<R: BlockingRead, W: BlockingWrite>(
    open: impl Fn() -> Result<(R, W), DeviceProblem> + Clone + Send + 'static,
) -> Result<Box<dyn Transport>, DeviceProblem> {
    let broken = |reason: String| DeviceProblem::UsbUnavailable { reason };
    let began = Instant::now();
    loop {
        let attempt = tokio::task::spawn_blocking(open.clone()).await.map_err(|error| broken(error.to_string()))?;
        match attempt {
            Ok((reader, writer)) => {
                let bridge = Bridge::start(reader, writer).map_err(|error| broken(error.to_string()))?;
                return Ok(Box::new(bridge));
            }
            Err(DeviceProblem::PortBusy { .. }) if began.elapsed() < RELEASE_PATIENCE => {
                tokio::time::sleep(READ_PATIENCE).await;
            }
            Err(problem) => return Err(problem),
        }
    }
}

fn open_serial(path: &str, baud: u32) -> Result<SerialStream, DeviceProblem> {
    if cfg!(unix) && !Path::new(path).exists() {
        return Err(DeviceProblem::PortMissing { port: path.to_owned() });
    }
    let mut line = SerialStream::open(&tokio_serial::new(path, baud)).map_err(|error| serial_problem(path, &error))?;
    // Many USB devices send only while DTR says that someone listens. A pseudo terminal has no such wire and says so.
    if let Err(error) = line.write_data_terminal_ready(true) {
        tracing::debug!(path, %error, "no DTR here");
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

/// The group that may use a port, where the system tells.
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

async fn open_tcp(host: &str, port: u16) -> Result<TcpStream, DeviceProblem> {
    let unreachable = |reason: String| DeviceProblem::Unreachable { address: format!("{host}:{port}"), reason };
    let line = match tokio::time::timeout(TCP_PATIENCE, TcpStream::connect((host, port))).await {
        Ok(connected) => connected.map_err(|error| unreachable(error.to_string()))?,
        Err(_) => return Err(unreachable(format!("no answer within {} s", TCP_PATIENCE.as_secs()))),
    };
    // Pings are small and must not wait for more bytes.
    line.set_nodelay(true).map_err(|error| unreachable(error.to_string()))?;
    Ok(line)
}
