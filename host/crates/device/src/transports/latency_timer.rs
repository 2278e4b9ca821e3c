//! The time for which FTDI's adapters hold bytes back: 16 ms unless it is set to 1. On Linux the driver shows it as a file.

use std::path::Path;

/// Where the driver has a folder for each port.
#[cfg(target_os = "linux")]
pub(super) const PORTS: &str = "/sys/bus/usb-serial/devices";

/// Sets a port's timer to the least, 1 ms, where the system permits it. Returns what it is afterwards, ms; `None` if the
/// port has none.
pub(super) fn shorten(ports: &Path, port: &str) -> Option<u32> {
    let name = Path::new(port).file_name()?;
    let file = ports.join(name).join("latency_timer");
    let read = || std::fs::read_to_string(&file).ok()?.trim().parse::<u32>().ok();
    let before = read()?;
    if before <= 1 {
        return Some(before);
    }
    // Without a rule for it, only an administrator may; then the session measures what it costs and says what to do.
    if let Err(error) = std::fs::write(&file, "1") {
        tracing::debug!(port, millis = before, %error, "the adapter's latency timer stays as it is");
    }
    read()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_timer_is_shortened_where_that_is_permitted() {
        let ports = std::env::temp_dir().join(format!("armature-latency-{}", std::process::id()));
        std::fs::create_dir_all(ports.join("ttyUSB0")).unwrap();
        let file = ports.join("ttyUSB0/latency_timer");
        std::fs::write(&file, "16\n").unwrap();
        assert_eq!(shorten(&ports, "/dev/ttyUSB0"), Some(1));
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "1");
        assert_eq!(shorten(&ports, "/dev/ttyUSB1"), None, "another driver's port");
        std::fs::write(&file, "what\n").unwrap();
        assert_eq!(shorten(&ports, "/dev/ttyUSB0"), None);
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "what\n", "what is not understood is left alone");
        std::fs::remove_dir_all(&ports).unwrap();
    }
}
