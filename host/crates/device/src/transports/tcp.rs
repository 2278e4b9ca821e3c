//! Devices at a TCP port.

use std::time::Duration;

use tokio::net::TcpStream;

use super::transport::Transport;
use crate::events::DeviceProblem;

/// Time a network device has to accept a connection.
const PATIENCE: Duration = Duration::from_secs(5);

impl Transport for TcpStream {}

/// Connects.
pub(super) async fn open(host: &str, port: u16) -> Result<TcpStream, DeviceProblem> {
    let unreachable = |reason: String| DeviceProblem::Unreachable { address: format!("{host}:{port}"), reason };
    let line = match tokio::time::timeout(PATIENCE, TcpStream::connect((host, port))).await {
        Ok(connected) => connected.map_err(|error| unreachable(error.to_string()))?,
        Err(_) => return Err(unreachable(format!("no answer within {} s", PATIENCE.as_secs()))),
    };
    // Pings are small and must not wait for more bytes.
    line.set_nodelay(true).map_err(|error| unreachable(error.to_string()))?;
    Ok(line)
}
