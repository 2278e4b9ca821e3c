//! The peak memory of a process. Only Linux reports it.

/// Resets the process's peak. If that is impossible, the peak is that of the whole run, which is no less.
pub(super) fn reset_peak() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// The peak since then, in megabytes; `None` if the system does not report it.
pub(super) fn peak() -> Option<f64> {
    peak_in("/proc/self/status")
}

/// A running process's peak, in megabytes.
pub(super) fn peak_of(process: u32) -> Option<f64> {
    peak_in(&format!("/proc/{process}/status"))
}

fn peak_in(status: &str) -> Option<f64> {
    let status = std::fs::read_to_string(status).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix(" kB")?.trim().parse::<f64>().ok()? / 1000.0)
}
