//! A simulated puppet in its own process, on a real serial line (a pseudo-terminal) or a TCP port.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use super::simulated::SimulatedArgs;
use crate::descriptors;
use crate::failure::Failure;

const PATIENCE: Duration = Duration::from_secs(10);
const PATIENCE_FOR_ITS_END: Duration = Duration::from_secs(1);

/// The process. It ends when this value is dropped, and also if this program is killed, because its standard input
/// closes.
#[derive(Debug)]
pub struct SimulatedPuppet {
    process: Child,
    address: String,
}

impl SimulatedPuppet {
    /// Starts this same program as `armature sim …` and waits until it reports its address.
    pub fn start(puppet: &str, simulated: &SimulatedArgs) -> Result<Self, Failure> {
        let failed = |what: String, error: &std::io::Error| {
            let alone = "run `armature sim` by itself to see what it says";
            let remedy = if descriptors::are_used_up(error) { descriptors::REMEDY } else { alone };
            Failure::device(format!("{what}: {error}"), remedy)
        };
        let program = std::env::current_exe().map_err(|e| failed("cannot find this program's own file".into(), &e))?;
        let mut command = Command::new(program);
        command.arg("sim").args(simulated.arguments(puppet)).arg("--until-input-ends");
        if cfg!(not(unix)) {
            // Without pseudo-terminals, the same bytes go over TCP.
            command.args(["--tcp", "127.0.0.1:0"]);
        }
        leave_our_interrupts_to_us(&mut command);
        let process = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| failed("the simulated puppet does not start".into(), &e))?;
        let mut puppet = Self { process, address: String::new() };
        let complaint = puppet.complaint();
        puppet.address = match puppet.first_line() {
            Some(address) => address,
            None => return Err(puppet.refusal(&complaint)),
        };
        Ok(puppet)
    }

    /// What it writes to standard error until it ends or serves; passed on to ours as well once it serves.
    fn complaint(&mut self) -> mpsc::Receiver<String> {
        let (sender, receiver) = mpsc::channel();
        if let Some(errors) = self.process.stderr.take() {
            std::thread::spawn(move || {
                for line in BufReader::new(errors).lines().map_while(Result::ok) {
                    // Nobody listens any more once it serves.
                    if let Err(mpsc::SendError(line)) = sender.send(line) {
                        tracing::warn!("simulated puppet: {line}");
                    }
                }
            });
        }
        receiver
    }

    /// Its exit code. Without an address it is ending, or will never serve and is killed.
    fn exit_code(&mut self) -> Option<i32> {
        let began = Instant::now();
        while began.elapsed() < PATIENCE_FOR_ITS_END {
            if let Ok(Some(status)) = self.process.try_wait() {
                return status.code();
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = self.process.kill();
        let _ = self.process.wait();
        None
    }

    /// Why it did not start, in its own words, with the kind of its exit code.
    fn refusal(&mut self, complaint: &mpsc::Receiver<String>) -> Failure {
        let code = self.exit_code();
        let said: Vec<String> = complaint.iter().collect();
        let remedy = said.iter().find_map(|line| line.trim().strip_prefix("→ ")).unwrap_or_default().to_owned();
        let what = said.iter().find_map(|line| line.strip_prefix("error: "));
        match (what, code) {
            (Some(what), Some(2)) => Failure::usage(what, remedy),
            (Some(what), Some(3)) => Failure::input(what, remedy),
            (Some(what), _) => Failure::device(what, remedy),
            (None, _) => Failure::device(
                "the simulated puppet did not say where it serves",
                "run `armature sim` by itself to see what it reports",
            ),
        }
    }

    fn first_line(&mut self) -> Option<String> {
        let output = self.process.stdout.take()?;
        let (sender, receiver) = mpsc::channel();
        std::thread::spawn(move || {
            let mut lines = BufReader::new(output).lines();
            let first = lines.next();
            // Nobody listens any more once the wait below has given up.
            let _ = sender.send(first);
            // Keeps reading whatever else it prints, so that it never blocks.
            lines.for_each(drop);
        });
        receiver.recv_timeout(PATIENCE).ok()??.ok().map(|line| line.trim().to_string()).filter(|l| !l.is_empty())
    }

    /// Where it is served: `serial:PATH` or `tcp:HOST:PORT`.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Its process ID.
    pub fn process_id(&self) -> u32 {
        self.process.id()
    }
}

/// Ctrl-C goes to every process in a terminal's group. The puppet must not die when the user ends the performance, or
/// that would look like an unplugged cable.
fn leave_our_interrupts_to_us(command: &mut Command) {
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    #[cfg(not(unix))]
    let _ = command;
}

impl Drop for SimulatedPuppet {
    fn drop(&mut self) {
        // It may have ended on its own; then there is nothing else to clean up.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
