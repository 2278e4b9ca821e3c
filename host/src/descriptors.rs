//! File descriptors: how many files, lines and pipes a process may have open.

use std::fs::File;
use std::io::Error;

use crate::failure::Failure;

/// What to do when there are none left.
pub(crate) const REMEDY: &str =
    "raise the number of files that a program may have open (`ulimit -n 4096`), or close other programs";

/// A line, a simulated puppet in its own process, a take and the thread that waits for them need fewer together.
const NEEDED: usize = 24;

/// EMFILE and ENFILE, on every Unix: this process, or the whole machine, has as many files open as it may.
pub(crate) fn are_used_up(error: &Error) -> bool {
    cfg!(unix) && matches!(error.raw_os_error(), Some(24 | 23))
}

/// Whether there are enough for a line. Asked before it is opened, because libraries panic where they get none.
pub(crate) fn check() -> Result<(), Failure> {
    if !cfg!(unix) {
        return Ok(());
    }
    let held: Result<Vec<File>, Error> = (0..NEEDED).map(|_| File::open("/dev/null")).collect();
    match held {
        Err(error) if are_used_up(&error) => {
            Err(Failure::device(format!("too few files may be open for a puppet's line: {error}"), REMEDY))
        }
        // Without that file nothing is known, and whatever is missing is reported where it is.
        _ => Ok(()),
    }
}
