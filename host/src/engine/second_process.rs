//! A simulated puppet in a process of its own, on a real serial line (a pseudo-terminal) or a TCP port.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use crate::engine::simulated::SimulatedArgs;
use crate::failure::Failure;

const PATIENCE: Duration = Duration::from_secs(10);

/// The process; it ends when this value goes, and also if this program is killed: its standard input ends then.
#[derive(Debug)]
pub struct SimulatedPuppet {
    process: Child,
    address: String,
}

impl SimulatedPuppet {
    /// Starts this very program as `armature sim …` and waits until it says where it serves.
    pub fn start(puppet: &str, simulated: &SimulatedArgs) -> Result<Self, Failure> {
        let failed = |what: String| Failure::device(what, "run `armature sim` by itself to see what it says");
        let program =
            std::env::current_exe().map_err(|e| failed(format!("this program's own file is not found: {e}")))?;
        let mut command = Command::new(program);
        command.arg("sim").args(simulated.arguments(puppet)).arg("--until-input-ends");
        if cfg!(not(unix)) {
            // There are no pseudo-terminals here; the same bytes go over TCP.
            command.args(["--tcp", "127.0.0.1:0"]);
        }
        leave_our_interrupts_to_us(&mut command);
        let process = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|e| failed(format!("the simulated puppet does not start: {e}")))?;
        let mut puppet = Self { process, address: String::new() };
        puppet.address = puppet.first_line().ok_or_else(|| failed("the simulated puppet said no address".into()))?;
        Ok(puppet)
    }

    fn first_line(&mut self) -> Option<String> {
        let output = self.process.stdout.take()?;
        let (sender, receiver) = mpsc::channel();
        std::thread::spawn(move || {
            let mut lines = BufReader::new(output).lines();
            let first = lines.next();
            // Nobody listens any more once the wait below gave up.
            let _ = sender.send(first);
            // Whatever else it prints is read on, so that it never blocks.
            lines.for_each(drop);
        });
        receiver.recv_timeout(PATIENCE).ok()??.ok().map(|line| line.trim().to_string()).filter(|l| !l.is_empty())
    }

    /// Where it serves: `serial:PATH` or `tcp:HOST:PORT`.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Its process number.
    pub fn process_id(&self) -> u32 {
        self.process.id()
    }
}

/// Ctrl-C goes to every process of a terminal's group. The puppet is not to fall over when the user ends the
/// performance, or that would look like a pulled cable.
fn leave_our_interrupts_to_us(command: &mut Command) {
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    #[cfg(not(unix))]
    let _ = command;
}

impl Drop for SimulatedPuppet {
    fn drop(&mut self) {
        // It may have ended by itself; there is nothing else to clean up then.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
