//! Files given to the program.

use std::io::Read as _;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use crate::common::Place;
use crate::damage::{Damaged, Dice};
use crate::readers::failed;

/// A command on a small file that runs for this long hangs.
const LIMIT: Duration = Duration::from_mins(2);
/// Success, wrong usage, bad input, a method that did not converge. Device trouble (4) is wrong for a file.
const CODES: [i32; 4] = [0, 2, 3, 5];

/// Runs one of the commands that take such a file; gives its exit code.
pub(crate) fn run(place: &Place, seed: u64, file: &Damaged) -> i32 {
    let extension = file.name.rsplit('.').next().unwrap_or_default();
    let damaged = format!("damaged-{seed}.{extension}");
    place.write(&damaged, &file.bytes);
    // Not the dice of the damage, so that the same damage meets every command as seeds go on.
    let mut dice = Dice::of_seed(!seed);
    let arguments = arguments(&mut dice, extension, &file.name, &damaged);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let told = |what: &str| -> ! { failed(place, seed, file, &format!("armature {}: {what}", arguments.join(" "))) };
    let mut command = place.command(&arguments);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the program starts");
    // Errors are read on the way, so that a long one does not keep the program waiting.
    let mut errors = child.stderr.take().expect("standard error is a pipe");
    let errors = std::thread::spawn(move || {
        let mut text = Vec::new();
        let _ = errors.read_to_end(&mut text);
        String::from_utf8_lossy(&text).into_owned()
    });
    let Some(status) = wait(&mut child) else {
        let _ = child.kill();
        let _ = child.wait();
        told(&format!("it still runs after {LIMIT:?}"));
    };
    let errors = errors.join().unwrap_or_default();
    if errors.contains("panicked") {
        told(&errors);
    }
    match status.code() {
        // An empty recording of a line is a silent device.
        Some(code) if CODES.contains(&code) || (code == 4 && extension == "bin") => {
            if code != 0 && !errors.contains("error: ") {
                told(&format!("exit code {code} without an error: {errors}"));
            }
            std::fs::remove_file(place.path(&damaged)).expect("the damaged file is still there");
            code
        }
        other => told(&format!("it ended with {other:?} ({status}): {errors}")),
    }
}

fn wait(child: &mut Child) -> Option<std::process::ExitStatus> {
    let start = Instant::now();
    let mut pause = Duration::from_millis(2);
    while start.elapsed() < LIMIT {
        if let Some(status) = child.try_wait().expect("the program can be waited for") {
            return Some(status);
        }
        std::thread::sleep(pause);
        pause = (pause * 2).min(Duration::from_millis(50));
    }
    None
}

fn with<'w>(start: &[&'w str], rest: &[&'w str]) -> Vec<&'w str> {
    [start, rest].concat()
}

/// A command that reads files of this kind.
fn arguments(dice: &mut Dice, extension: &str, name: &str, file: &str) -> Vec<String> {
    let virtual_run = ["run", "--device", "sim:good.bvh", "--virtual-clock", "--seconds", "0.5", "--rate", "20"];
    let simulated = format!("sim:{file}");
    let choices: Vec<Vec<&str>> = match extension {
        "take" => vec![
            vec!["inspect", file],
            vec!["replay", file, "--character", "good.bvh"],
            vec!["replay", file, "--character", "good.bvh", "--at", "0.5", "--picture", "out.png", "--force"],
            vec!["replay", file, "--character", "good.bvh", "--verify", "good.take"],
            vec!["export", file, "--to", "out.bvh", "--force"],
            vec!["export", file, "--to", "out.glb", "--force"],
            vec!["export", file, "--to", "out.fbx", "--force"],
            vec![
                "export",
                file,
                "--to",
                "out.glb",
                "--fps",
                "24",
                "--low-pass",
                "--reduce-keys",
                "--splines",
                "--force",
            ],
        ],
        "edit" => vec![vec!["edit", file], vec!["export", file, "--to", "out.bvh", "--force"]],
        "bin" => vec![vec!["devices", "--decode", file]],
        "bvh" => vec![
            vec!["inspect", file],
            vec!["run", "--device", &simulated, "--character", "good.bvh", "--virtual-clock", "--seconds", "2"],
            with(&virtual_run, &["--character", file]),
            vec!["bind", "good.obj", "--skeleton", file, "--output", "out.armature", "--no-cache", "--force"],
        ],
        "tgf" => vec![
            vec!["inspect", file],
            vec!["bind", "good.obj", "--skeleton", file, "--output", "out.armature", "--no-cache", "--force"],
            vec!["weights", "good.obj", "--handles", file, "--output", "out.npy", "--force"],
            vec!["volume", "good.obj", "--skeleton", file, "--output", "out.mesh", "--force"],
        ],
        "armature" => vec![vec!["inspect", file], with(&virtual_run, &["--character", file])],
        "toml" if name.contains("mapping") => vec![with(&virtual_run, &["--character", "good.bvh", "--mapping", file])],
        "toml" => vec![with(&virtual_run, &["--character", "good.bvh", "--calibration", file])],
        "npy" | "dmat" => vec![vec!["weights", "good.obj", "--boundary", file, file, "--output", "out.npy", "--force"]],
        _ => vec![
            vec!["inspect", file],
            vec!["inspect", file, "--json"],
            vec!["bind", file, "--skeleton", "good.tgf", "--output", "out.armature", "--no-cache", "--force"],
            vec!["weights", file, "--handles", "good.tgf", "--output", "out.npy", "--force"],
            vec!["volume", file, "--output", "out.mesh", "--force"],
            vec!["surface", "fill", file, "--all", "--output", "out.obj", "--force"],
        ],
    };
    dice.one_of(&choices).iter().map(|&word| word.to_owned()).collect()
}
