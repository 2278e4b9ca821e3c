//! Thirty-two three-axis joints at 1,000 Hz on a real pseudo-terminal, posing and skinning the default character.

use std::ops::ControlFlow;
use std::sync::Arc;

use armature_rig::Calibration;
use armature_take::Header;

use super::Measurement;
use crate::characters;
use crate::cli::args::BenchArgs;
use crate::engine::live::Live;
use crate::engine::perform::{self, Plan};
use crate::engine::performance::{Performance, ZeroPolicy};
use crate::engine::simulated::SimulatedArgs;
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
    let found = characters::find("human", &mut |_| ControlFlow::Continue(()))?;
    let performance = Performance::new(Arc::new(found.actor), None, Calibration::default(), ZeroPolicy::AtStart)?;
    let simulated = SimulatedArgs { motion: Some("wiggle".into()), ..SimulatedArgs::default() };
    let mut live = Live::connect(PUPPET, &simulated)?;
    live.start_when_ready(SAMPLES_PER_SECOND);
    let plan = Plan { seconds: Some(args.stream_seconds), record: None, header: Header::default() };
    let (_, summary) = perform::perform(live, performance, &plan, &mut |_, _| ())?;
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
