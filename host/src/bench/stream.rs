//! Thirty-two three-axis joints at 1,000 Hz on a real pseudo-terminal, posing and skinning the default character.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::Measurement;
use crate::characters;
use crate::characters::inverse_kinematics::{IkArgs, IkMode};
use crate::cli::args::BenchArgs;
use crate::engine::command::RunPlan;
use crate::engine::drive::drive_run;
use crate::engine::inbox::Inbox;
use crate::engine::machine::{Engine, EngineSettings};
use crate::engine::puppeteer::ZeroPolicy;
use crate::engine::sources::simulated::SimulatedArgs;
use crate::engine::sources::{LiveSettings, LiveSource};
use crate::failure::Failure;

pub(super) const NAMES: &[&str] = &[
    "stream/32x3-1000hz-lost",
    "stream/32x3-1000hz-rate",
    "stream/32x3-1000hz-latency-p50",
    "stream/32x3-1000hz-latency-p99",
];

const PUPPET: &str = "sim:joints:32";
const SAMPLES_PER_SECOND: f64 = 1000.0;

pub(super) fn run(args: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let found = characters::find("human", &mut |_, _| ControlFlow::Continue(()))?;
    let mut engine = Engine::new(EngineSettings {
        samples_per_second: SAMPLES_PER_SECOND,
        zero_policy: ZeroPolicy::AtStart,
        ik: IkArgs { ik: IkMode::Off, ..IkArgs::default() },
        draws: false,
        ..EngineSettings::default()
    });
    let simulated = SimulatedArgs { motion: Some("wiggle".into()), ..SimulatedArgs::default() };
    let mut source = LiveSource::new(Inbox::default(), LiveSettings { simulated, ..LiveSettings::default() })?;
    let plan = RunPlan { seconds: Some(args.stream_seconds), ..RunPlan::default() };
    let character = Arc::new(found.character);
    let summary = drive_run(&mut engine, &mut source, character, PUPPET, plan, None, &mut |_| ())?;
    if let Some(trouble) = summary.trouble {
        return Err(trouble);
    }
    let latency = summary.latency.unwrap_or_default();
    let samples = summary.poses as usize;
    let [lost, rate, p50, p99] = [NAMES[0], NAMES[1], NAMES[2], NAMES[3]];
    Ok(vec![
        Measurement::new(lost, summary.counters.lost_samples as f64, "samples", samples).at_most(0.0, "none"),
        Measurement::new(rate, summary.poses as f64 / summary.seconds, "/s", samples).at_least(995.0, "1,000 Hz"),
        Measurement::new(p50, latency.p50, "µs", samples),
        Measurement::new(p99, latency.p99, "µs", samples).at_most(2000.0, "below 2 ms"),
    ])
}
