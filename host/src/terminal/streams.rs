//! Lines for standard output and standard error. A reader that has seen enough, a full disk or a terminal that is gone
//! never ends the work: what can no longer be printed is remembered, and reported at the end.

use std::fmt::Arguments;
use std::io::{Error, ErrorKind, Write, stderr, stdout};
use std::sync::OnceLock;

use super::words::plain;
use crate::failure::Failure;

/// Why nothing more is printed on standard output, which the whole process has only once.
static TROUBLE: OnceLock<Error> = OnceLock::new();

/// EIO, on every Unix: the error of a terminal that is gone.
const INPUT_OUTPUT_ERROR: i32 = 5;

/// A line for standard output: results. Control characters are escaped.
macro_rules! out {
    ($($words:tt)*) => { $crate::terminal::streams::write_out(format_args!($($words)*)) };
}

/// A line for standard error: notes and problems. Control characters are escaped.
macro_rules! aside {
    ($($words:tt)*) => { $crate::terminal::streams::write_aside(format_args!($($words)*)) };
}

pub(crate) use {aside, out};

pub(crate) fn write_out(line: Arguments) {
    if TROUBLE.get().is_none()
        && let Err(error) = writeln!(stdout().lock(), "{}", plain(&line.to_string()))
    {
        // The first reason is kept.
        let _ = TROUBLE.set(error);
    }
}

pub(crate) fn write_aside(line: Arguments) {
    // There is nobody left to report it to.
    let _ = writeln!(stderr().lock(), "{}", plain(&line.to_string()));
}

/// Whether everything meant for standard output got there. A reader that closed it wanted no more.
pub fn printed() -> Result<(), Failure> {
    if TROUBLE.get().is_none()
        && let Err(error) = stdout().lock().flush()
    {
        let _ = TROUBLE.set(error);
    }
    TROUBLE.get().map_or(Ok(()), not_printed)
}

/// What an error on standard output means.
pub fn not_printed(error: &Error) -> Result<(), Failure> {
    let is_gone = error.kind() == ErrorKind::BrokenPipe || error.raw_os_error() == Some(INPUT_OUTPUT_ERROR);
    if is_gone {
        return Ok(());
    }
    let remedy = match error.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "free some space, or send the output elsewhere",
        _ => "send the output elsewhere",
    };
    Err(Failure::input(format!("standard output cannot be written: {error}"), remedy))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_closed_pipe_is_no_failure_and_a_full_disk_is_one() {
        assert_eq!(not_printed(&ErrorKind::BrokenPipe.into()), Ok(()));
        assert_eq!(not_printed(&Error::from_raw_os_error(INPUT_OUTPUT_ERROR)), Ok(()));
        let full = not_printed(&ErrorKind::StorageFull.into()).unwrap_err();
        assert!(full.kind.exit_code() == 3 && full.remedy.contains("space"), "{full}");
    }
}
