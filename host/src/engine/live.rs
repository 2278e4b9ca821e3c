//! A puppet on a real line, seen from a thread that wants its events one after the other.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use armature_device::servo::ServoSettings;
use armature_device::{Connection, ConnectionSettings, DeviceAddress, DeviceProblem, SessionCounters};
use tokio::runtime::Runtime;

use super::perform::{Next, Source};
use super::second_process::SimulatedPuppet;
use crate::engine::simulated::SimulatedArgs;
use crate::failure::Failure;

/// How long one look for an event may take, so that Ctrl-C and the clock are heeded.
const PATIENCE: Duration = Duration::from_millis(50);

/// A connected puppet. A simulated one runs in a second process, which ends with this value.
#[derive(Debug)]
pub struct Live {
    connection: Connection,
    runtime: Runtime,
    address: String,
    simulated: Option<SimulatedPuppet>,
    interrupted: Arc<AtomicBool>,
    /// Samples a second that are wanted as soon as the character is ready for them.
    wanted: Option<f64>,
}

impl Live {
    /// Connects to `sim:…`, `serial:…`, `usb:…`, `hid:…`, `feetech:…`, `dynamixel:…` or `tcp:…`.
    pub fn connect(device: &str, simulated: &SimulatedArgs) -> Result<Self, Failure> {
        Self::connect_with(device, simulated, ServoSettings::default())
    }

    /// The same, with what is allowed of an arm of servos.
    pub fn connect_with(device: &str, simulated: &SimulatedArgs, servos: ServoSettings) -> Result<Self, Failure> {
        let parsed = parse_address(device)?;
        let (address, process) = match &parsed {
            DeviceAddress::Sim { name } => {
                let process = SimulatedPuppet::start(name, simulated)?;
                (parse_address(process.address())?, Some(process))
            }
            other => (other.clone(), None),
        };
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .thread_name("device")
            .build()
            .map_err(|e| Failure::device(format!("no thread for the device: {e}"), "close other programs"))?;
        // The simulated puppet's process is ours: when its line is gone, so is the puppet.
        let settings = ConnectionSettings { servos, reopen: process.is_none(), ..ConnectionSettings::default() };
        let opening = Connection::open(runtime.handle(), &address, settings);
        let connection = runtime.block_on(opening).map_err(|e| problem_failure(&e))?;
        let address = address.to_string();
        Ok(Self { connection, runtime, address, simulated: process, interrupted: Arc::default(), wanted: None })
    }

    /// From now on Ctrl-C interrupts the performance in place of ending the program at once.
    pub fn catch_interrupt(&self) {
        let flag = self.interrupted.clone();
        self.runtime.spawn(async move {
            if tokio::signal::ctrl_c().await.is_ok() {
                flag.store(true, Ordering::Relaxed);
            }
        });
    }

    /// Where the puppet is: the line that was opened.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// The process number of a simulated puppet.
    pub fn simulated_process(&self) -> Option<u32> {
        self.simulated.as_ref().map(SimulatedPuppet::process_id)
    }

    /// Wants this many samples a second.
    pub fn start(&self, samples_per_second: f64) {
        self.connection.start((samples_per_second * 1000.0).round() as u32);
    }

    /// Wants this many samples a second once the puppet has described itself and the character is prepared for it, so
    /// that no sample waits for that.
    pub fn start_when_ready(&mut self, samples_per_second: f64) {
        self.wanted = Some(samples_per_second);
    }

    /// Makes a part show itself.
    pub fn blink(&self, uid: armature_device::PartUid, duration_millis: u16) {
        self.connection.blink(uid, duration_millis);
    }

    /// The next event, waiting for it at most so long.
    pub fn next_within(&mut self, patience: Duration) -> Next {
        if let Some(event) = self.connection.try_next() {
            return Next::Event(event);
        }
        let connection = &mut self.connection;
        match self.runtime.block_on(async { tokio::time::timeout(patience, connection.next()).await }) {
            Ok(Some(event)) => Next::Event(event),
            Ok(None) => Next::Over,
            Err(_) => Next::Quiet,
        }
    }
}

impl Source for Live {
    fn next(&mut self) -> Next {
        self.next_within(PATIENCE)
    }

    fn ready(&mut self) {
        if let Some(samples_per_second) = self.wanted.take() {
            self.start(samples_per_second);
        }
    }

    fn now(&self) -> f64 {
        self.connection.began().elapsed().as_secs_f64()
    }

    fn age(&self, received: Duration) -> Option<Duration> {
        Some((self.connection.began() + received).elapsed())
    }

    fn counters(&self) -> SessionCounters {
        self.connection.counters()
    }

    fn interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }

    fn close(self) -> SessionCounters {
        let Self { connection, runtime, .. } = self;
        runtime.block_on(connection.close())
    }
}

/// Reads a device address as the user writes it.
pub fn parse_address(text: &str) -> Result<DeviceAddress, Failure> {
    text.parse().map_err(|e: armature_device::AddressError| Failure::usage(e.to_string(), ""))
}

/// The device with the arm's name in its address; only arms of servos have one.
pub fn with_preset(device: &str, preset: Option<&str>) -> Result<String, Failure> {
    let Some(preset) = preset else { return Ok(device.to_owned()) };
    match parse_address(device)? {
        DeviceAddress::Servos { protocol, path, baud, .. } => {
            Ok(DeviceAddress::Servos { protocol, path, baud, arm: Some(preset.to_owned()) }.to_string())
        }
        _ => Err(Failure::usage("--preset names an arm of servos", "choose a --device feetech:PATH or dynamixel:PATH")),
    }
}

/// A device's trouble as the program tells it.
pub fn problem_failure(problem: &DeviceProblem) -> Failure {
    Failure::device(problem.to_string(), "")
}
