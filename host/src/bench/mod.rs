//! `armature bench`: what this machine achieves, by name, compared with another program if one is installed.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use crate::cli::args::BenchArgs;
use crate::engine::latency::percentile;
use crate::failure::Failure;
use crate::terminal::{aside, out};

mod avatar;
mod bind;
mod deform;
mod device;
#[cfg(feature = "window")]
mod gpu_skinning;
mod heat;
mod large_rigs;
mod monotone;
mod peak_memory;
mod pose;
mod protocol;
mod rig;
mod stream;
mod surface;
mod surface_convergence;
mod volume;
mod volume_growth;
mod weight_convergence;
mod weight_growth;
mod weight_partition;
mod weights;
mod winding;

/// One measured number.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// Such as `protocol/decode`.
    pub name: &'static str,
    /// The median over the runs.
    pub value: f64,
    /// Such as `MB/s`.
    pub unit: &'static str,
    /// Number of runs.
    pub runs: usize,
    /// The other program's name and its value, measured at about the same time.
    pub peer: Option<(String, f64)>,
    /// The target, in words, and whether it is met; `None` if the number is only for information.
    pub budget: Option<(&'static str, bool)>,
    /// Anything else worth knowing, such as a number measured elsewhere.
    pub note: Option<&'static str>,
}

impl Measurement {
    fn new(name: &'static str, value: f64, unit: &'static str, runs: usize) -> Self {
        Self { name, value, unit, runs, peer: None, budget: None, note: None }
    }

    fn at_most(mut self, limit: f64, words: &'static str) -> Self {
        self.budget = Some((words, self.value <= limit));
        self
    }

    fn at_least(mut self, limit: f64, words: &'static str) -> Self {
        self.budget = Some((words, self.value >= limit));
        self
    }

    fn to_json(&self) -> String {
        let mut object = serde_json::json!({
            "name": self.name, "value": self.value, "unit": self.unit, "runs": self.runs,
        });
        if let Some((peer, value)) = &self.peer {
            object["peer"] = peer.as_str().into();
            object["peer_value"] = (*value).into();
            object["ratio"] = (self.value / value).into();
        }
        if let Some((words, met)) = self.budget {
            object["budget"] = words.into();
            object["met"] = met.into();
        }
        if let Some(note) = self.note {
            object["note"] = note.into();
        }
        object.to_string()
    }

    fn to_line(&self) -> String {
        let mut line = format!("{:32} {:>12} {:8} ({} runs)", self.name, significant(self.value), self.unit, self.runs);
        if let Some((words, met)) = self.budget {
            line.extend(["  ", if met { "✓" } else { "✗" }, " ", words]);
        }
        if let Some((peer, value)) = &self.peer {
            let (theirs, ratio) = (significant(*value), self.value / value);
            line = format!("{line}  {peer}: {theirs} {}, ratio {ratio:.3}", self.unit);
        }
        if let Some(note) = self.note {
            line.extend(["  (", note, ")"]);
        }
        line
    }
}

/// Four significant digits, without an exponent.
fn significant(value: f64) -> String {
    let digits = if value == 0.0 || !value.is_finite() { 0 } else { 3 - value.abs().log10().floor() as i32 };
    format!("{value:.*}", digits.clamp(0, 9) as usize)
}

/// A benchmark: the names of its measurements, and how to make them.
struct Benchmark {
    names: &'static [&'static str],
    run: fn(&BenchArgs) -> Result<Vec<Measurement>, Failure>,
}

const BENCHMARKS: &[Benchmark] = &[
    Benchmark { names: protocol::NAMES, run: protocol::run },
    Benchmark { names: pose::NAMES, run: pose::run },
    Benchmark { names: deform::NAMES, run: deform::run },
    #[cfg(feature = "window")]
    Benchmark { names: gpu_skinning::NAMES, run: gpu_skinning::run },
    Benchmark { names: heat::NAMES, run: heat::run },
    Benchmark { names: winding::NAMES, run: winding::run },
    Benchmark { names: volume::NAMES, run: volume::run },
    Benchmark { names: volume_growth::NAMES, run: volume_growth::run },
    Benchmark { names: rig::NAMES, run: rig::run },
    Benchmark { names: large_rigs::NAMES, run: large_rigs::run },
    Benchmark { names: weights::NAMES, run: weights::run },
    Benchmark { names: monotone::NAMES, run: monotone::run },
    Benchmark { names: bind::NAMES, run: bind::run },
    Benchmark { names: avatar::NAMES, run: avatar::run },
    Benchmark { names: weight_convergence::NAMES, run: weight_convergence::run },
    Benchmark { names: weight_growth::NAMES, run: weight_growth::run },
    Benchmark { names: weight_partition::NAMES, run: weight_partition::run },
    Benchmark { names: surface_convergence::NAMES, run: surface_convergence::run },
    Benchmark { names: surface::NAMES, run: surface::run },
    Benchmark { names: stream::NAMES, run: stream::run },
    Benchmark { names: device::NAMES, run: device::run },
];

/// Runs the benchmarks whose names contain `args.what`.
pub fn bench(args: &BenchArgs) -> Result<(), Failure> {
    let asked = |name: &str| args.what.as_deref().is_none_or(|what| name.contains(what));
    let chosen: Vec<&Benchmark> = BENCHMARKS.iter().filter(|b| b.names.iter().any(|n| asked(n))).collect();
    if chosen.is_empty() {
        let what = format!("no benchmark has {:?} in its name", args.what.as_deref().unwrap_or_default());
        return Err(Failure::usage(what, "`armature bench --list` prints the names"));
    }
    if args.list {
        chosen.iter().flat_map(|b| b.names).filter(|n| asked(n)).for_each(|name| out!("{name}"));
        return Ok(());
    }
    if cfg!(debug_assertions) && !args.json {
        aside!("note: this is a development build; numbers count in a release build (`cargo run --release -- bench`)");
    }
    // Checked before minutes of work; several benchmarks of one run may draw into it.
    args.plot.as_deref().map_or(Ok(()), |path| args.overwrite.check(path))?;
    for benchmark in chosen {
        for measurement in (benchmark.run)(args)?.iter().filter(|m| asked(m.name)) {
            out!("{}", if args.json { measurement.to_json() } else { measurement.to_line() });
        }
    }
    Ok(())
}

/// Runs `work` once to warm up and `runs` times to measure; returns the seconds of each run, sorted.
fn time_runs(runs: usize, mut work: impl FnMut()) -> Vec<f64> {
    work();
    let mut seconds: Vec<f64> = (0..runs)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64()
        })
        .collect();
    seconds.sort_by(f64::total_cmp);
    seconds
}

/// A file of the models that the budgets are stated for, if a checkout has them beside it.
fn shared_file(name: &str) -> Option<PathBuf> {
    let here = std::env::current_dir().ok()?;
    here.ancestors().map(|folder| folder.join("shared/data").join(name)).find(|file| file.exists())
}

/// Runs another program's script from `tests/` and parses the last line of its output that is a JSON object.
fn python_peer(
    python: &Path,
    script: &str,
    arguments: &[&PathBuf],
    install: &str,
) -> Result<serde_json::Value, Failure> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests").join(script);
    let failed = |what: String| Failure::usage(what, format!("give a Python that has it ({install})"));
    let output = Command::new(python)
        .arg(&script)
        .args(arguments)
        .output()
        .map_err(|e| failed(format!("{} does not start: {e}", python.display())))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let object =
        text.lines().rev().filter_map(|line| serde_json::from_str(line).ok()).find(serde_json::Value::is_object);
    let complaint = || format!("{} gave no result: {}", script.display(), String::from_utf8_lossy(&output.stderr));
    object.ok_or_else(|| failed(complaint()))
}

/// A number that a peer measured. One that cannot be (a time below zero, as the difference of two noisy ones may be) is
/// left out, and that is said.
fn of_peer(measured: &serde_json::Value, key: &str, peer: &str) -> Option<(String, f64)> {
    let value = measured[key].as_f64().filter(|value| value.is_finite() && *value > 0.0);
    if value.is_none() {
        aside!("note: {peer}: {key} was not measured ({}); run it again on a quiet machine", measured[key]);
    }
    value.map(|value| (peer.to_owned(), value))
}

fn median(sorted: &[f64]) -> f64 {
    percentile(sorted, 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_carries_the_ratio_to_the_peer() {
        let measurement = Measurement { peer: Some(("other".into(), 4.0)), ..Measurement::new("a/b", 2.0, "s", 3) };
        let value: serde_json::Value = serde_json::from_str(&measurement.to_json()).unwrap();
        assert_eq!(value["ratio"], 0.5);
        assert_eq!(value["peer"], "other");
    }

    #[test]
    fn a_peer_has_no_negative_times() {
        let measured = serde_json::json!({"fast": -0.3, "exact": 2.5, "none": null});
        assert_eq!(of_peer(&measured, "exact", "libigl"), Some(("libigl".into(), 2.5)));
        for key in ["fast", "none", "missing"] {
            assert_eq!(of_peer(&measured, key, "libigl"), None, "{key}");
        }
    }
}
