//! Opens the line to a device, on any carrier.

use std::time::{Duration, Instant};

use super::bridge::{BlockingRead, BlockingWrite, Bridge, READ_PATIENCE};
use super::transport::Transport;
use super::{hid, serial, tcp, usb_bulk};
use crate::address::DeviceAddress;
use crate::events::DeviceProblem;

/// Time for a device to be released by its previous user.
const RELEASE_PATIENCE: Duration = Duration::from_millis(250);
/// The speed at which a line to servos is opened; the session changes it from there.
const FIRST_SERVO_BAUD: u32 = 1_000_000;

/// Opens the line to a device. Must be called on a tokio runtime with I/O and time enabled.
pub async fn open(address: &DeviceAddress) -> Result<Box<dyn Transport>, DeviceProblem> {
    // The libraries in between lose the system's error number, so it is looked up afterwards.
    carrier(address).await.map_err(|problem| match problem {
        _ if descriptors_are_used_up() => DeviceProblem::NoDescriptors { port: address.to_string() },
        problem => problem,
    })
}

/// Whether this process, or the whole machine, has as many files open as it may.
fn descriptors_are_used_up() -> bool {
    /// On every Unix.
    const EMFILE_AND_ENFILE: [i32; 2] = [24, 23];
    let error = std::fs::File::open("/dev/null").err().and_then(|error| error.raw_os_error());
    cfg!(unix) && error.is_some_and(|number| EMFILE_AND_ENFILE.contains(&number))
}

async fn carrier(address: &DeviceAddress) -> Result<Box<dyn Transport>, DeviceProblem> {
    match address {
        DeviceAddress::Serial { path, baud } => Ok(Box::new(serial::open(path, *baud)?)),
        DeviceAddress::Servos { path, baud, .. } => Ok(Box::new(serial::open(path, baud.unwrap_or(FIRST_SERVO_BAUD))?)),
        DeviceAddress::Usb(id) => {
            let id = id.clone();
            bridged(move || usb_bulk::open(&id)).await
        }
        DeviceAddress::Hid(place) => {
            let place = place.clone();
            bridged(move || hid::open(&place)).await
        }
        DeviceAddress::Tcp { host, port } => Ok(Box::new(tcp::open(host, *port).await?)),
        DeviceAddress::Sim { name } => Err(DeviceProblem::SimulatedHere { name: name.clone() }),
    }
}

/// Opens a device through a blocking library. A line that this program has just closed may hold the device for another
/// moment.
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
