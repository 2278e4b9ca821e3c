//! How the program reports that something went wrong.

use std::fmt;
use std::process::ExitCode;

/// The kind of trouble. Scripts rely on the exit codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureKind {
    /// Exit code 2: the command line asks for something that does not exist.
    Usage,
    /// Exit code 3: a file is missing, damaged, or not what it should be.
    Input,
    /// Exit code 4: the puppet is missing, silent, or speaks another language.
    Device,
    /// Exit code 5: a method did not converge.
    NotConverged,
}

impl FailureKind {
    /// The process exit code.
    pub fn exit_code(self) -> u8 {
        match self {
            Self::Usage => 2,
            Self::Input => 3,
            Self::Device => 4,
            Self::NotConverged => 5,
        }
    }
}

/// What went wrong, and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Decides the exit code.
    pub kind: FailureKind,
    /// One sentence with the file and the place.
    pub what: String,
    /// One sentence that says what to do; empty if `what` already does.
    pub remedy: String,
}

impl Failure {
    /// Wrong usage.
    pub fn usage(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { kind: FailureKind::Usage, what: what.into(), remedy: remedy.into() }
    }

    /// Bad input.
    pub fn input(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { kind: FailureKind::Input, what: what.into(), remedy: remedy.into() }
    }

    /// Device trouble.
    pub fn device(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { kind: FailureKind::Device, what: what.into(), remedy: remedy.into() }
    }

    /// A method that did not converge.
    pub fn not_converged(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { kind: FailureKind::NotConverged, what: what.into(), remedy: remedy.into() }
    }

    /// The process exit code.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.kind.exit_code())
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.what)?;
        if self.remedy.is_empty() { Ok(()) } else { write!(f, "\n  → {}", self.remedy) }
    }
}

impl std::error::Error for Failure {}
