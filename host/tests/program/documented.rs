//! Every command shown in help, hints and documents is run, or is at least a valid command.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::common::{Place, SMALL_BVH, TUBE_TGF, tube_obj};
use armature::cli::Cli;
use armature_sim::Body;
use armature_sim::servo::ServoBusSettings;
use clap::error::ErrorKind;
use clap::{Command, CommandFactory};

/// What a capitalised word or a gap stands for.
const STANDS_FOR: &[(&str, &str)] = &[
    ("armature COMMAND --help", "armature run --help"),
    ("FILE.svg", "plot.svg"),
    ("MESH", "model.obj"),
    ("BONES.tgf", "bones.tgf"),
    ("BONES", "bones.tgf"),
    ("--character FILE", "--character fox.glb"),
    ("calibrate -o {}", "calibrate --device sim:hand -o hint.toml"),
    ("bind {}", "bind model.obj"),
    ("bind --skin {kind}", "bind model.obj -s bones.tgf --skin stretch-twist"),
    ("inspect {}", "inspect model.obj"),
    ("surface fill {}", "surface fill model.obj"),
    ("sim …", "sim"),
    ("puppet …", "puppet"),
];

/// Along the tube's axis; the documents draw the third.
const THREE_BONES: &str = "1 0 0.05 0\n2 0 0.7 0\n3 0 1.3 0\n4 0 1.95 0\n#\n1 2\n2 3\n3 4\n";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// All files below a folder with this extension.
fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        if path.is_dir() && name != "target" && !name.starts_with('.') {
            found.extend(files(&path, ending));
        } else if name.ends_with(ending) {
            found.push(path);
        }
    }
    found
}

/// The command on a line, without the explanation after wide blanks or a mark.
fn without_remark(line: &str) -> &str {
    ["  ", " # ", " | "].iter().fold(line, |line, mark| line.split(mark).next().unwrap_or(line)).trim()
}

fn is_command(text: &str) -> bool {
    text == "armature" || text.starts_with("armature ")
}

/// Commands on their own lines and between backticks, by the place where they are shown.
fn shown() -> BTreeMap<String, String> {
    let mut shown = BTreeMap::new();
    let mut add = |command: &str, place: &str| {
        let command = without_remark(command);
        if is_command(command) {
            shown.entry(command.to_string()).or_insert_with(|| place.to_string());
        }
    };
    let documents = files(&root(), ".md");
    let sources = ["host/src", "host/crates", "sim/src"].map(|folder| files(&root().join(folder), ".rs")).concat();
    for path in documents.iter().chain(&sources) {
        let text = std::fs::read_to_string(path).unwrap();
        let place = path.strip_prefix(root()).unwrap_or(path).display().to_string();
        // An inline command does not extend over the end of a line.
        text.lines().flat_map(|line| line.split('`').skip(1).step_by(2)).for_each(|inline| add(inline, &place));
        if path.extension().is_some_and(|extension| extension == "md") {
            for line in text.lines().map(str::trim) {
                match line.strip_prefix("cargo run ").and_then(|line| line.split_once("-- ")) {
                    Some((_, arguments)) => add(&format!("armature {arguments}"), &place),
                    None => add(line, &place),
                }
            }
        }
    }
    let mut cli = Cli::command();
    cli.build();
    let names: Vec<String> = cli.get_subcommands().map(|command| command.get_name().to_string()).collect();
    let after = |command: &Command| command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let helps = names.iter().map(|name| (name.clone(), after(cli.find_subcommand(name).unwrap())));
    for (name, help) in helps.chain([("armature".to_string(), after(&cli))]) {
        help.lines().for_each(|line| add(line.trim(), &format!("the help of {name}")));
    }
    shown
}

/// The files that every shown command finds in its folder.
fn prepared() -> Place {
    let place = Place::new("documented");
    for mesh in ["model.obj", "body.obj", "truck.obj", "armadillo.obj", "face.obj"] {
        place.write(mesh, tube_obj());
    }
    for bones in ["bones.tgf", "armadillo.tgf", "hand.tgf"] {
        place.write(bones, THREE_BONES);
    }
    place.done(&["rig", "body.obj", "--template", "bones.tgf", "-o", "body.bvh", "--quiet"]);
    place.write("walk.bvh", SMALL_BVH);
    let guide = std::fs::read_to_string(root().join("firmware-protocol/BUILD_YOUR_OWN_PUPPET.md")).unwrap();
    let dump = guide.split("```dump\n").nth(1).unwrap().split("\n```").next().unwrap();
    place.write("dump.txt", dump);
    place.write("answer", dump);
    place.done(&["volume", "model.obj", "--skeleton", "bones.tgf", "--vertices", "500", "-o", "hand.mesh", "--quiet"]);
    place.done(&["bind", "model.obj", "-s", "bones.tgf", "--method", "heat", "-o", "tube.armature", "--quiet"]);
    let record = ["run", "--device", "sim:walk.bvh", "--virtual-clock", "--seconds", "1", "--quiet", "--record"];
    place.done(&[&record[..], &["fox.take", "--character", "tube.armature"]].concat());
    place.done(&["export", "fox.take", "--to", "fox.glb", "--quiet"]);
    // Recorded by the puppet of the guide, which is not here.
    std::fs::rename(place.path("fox.take"), place.path("first.take")).unwrap();
    // Takes for edit lists, and a folder of takes.
    let human =
        ["run", "--device", "sim:human", "--character", "human", "--virtual-clock", "--seconds", "2.5", "--quiet"];
    place.done(&[&human[..], &["--record", "body.take"]].concat());
    place.done(&[&human[..], &["--motion", "wave", "--record", "arms.take"]].concat());
    place.done(&["edit", "walk.edit", "new", "body.take", "--quiet"]);
    std::fs::create_dir(place.path("takes")).unwrap();
    // Two handles that hold a vertex each.
    let table =
        |rows: usize, columns: usize, values: Vec<f64>| armature_formats::tables::NumberTable { rows, columns, values };
    place.write("b.npy", armature_formats::tables::write_npy(&table(2, 1, vec![0.0, 150.0])));
    place.write("bc.npy", armature_formats::tables::write_npy(&table(2, 2, vec![1.0, 0.0, 0.0, 1.0])));
    // Data with noise, and two colours.
    let painted = (0..206).map(|k| (0.05 * f64::from(k)).sin() + 0.1 * f64::from(k % 7)).collect();
    place.write("painted.npy", armature_formats::tables::write_npy(&table(206, 1, painted)));
    place.write("colours.txt", "vertex 0 = #ff8800\nvertex 150 = 0 0 1\n");
    place
}

/// A shown command as it is run here: only for a moment, and overwriting existing files.
fn runnable(words: &[String], cli: &Command) -> Vec<String> {
    let mut words = words.to_vec();
    let Some(command) = words.first().and_then(|name| cli.find_subcommand(name)) else { return words };
    let has = |option: &str| command.get_arguments().any(|arg| arg.get_long() == Some(option));
    let says = |words: &[String], option: &str| words.iter().any(|word| word == option);
    let mut more: Vec<&str> = Vec::new();
    match words[0].as_str() {
        "bench" if !says(&words, "--list") => more.push("--list"),
        "sim" => more.push("--until-input-ends"),
        "edit" if says(&words, "new") => more.push("--force"),
        "devices" if says(&words, "--watch") => more.extend(["--seconds", "0.1"]),
        // A simulated puppet's calibration is saved only if a file is given.
        "calibrate" if !says(&words, "--device") => {
            more.extend(["--device", "sim:hand", "--virtual-clock", "-o", "shown.toml"]);
        }
        "calibrate" if words.iter().any(|word| word.starts_with("sim:")) => more.push("--virtual-clock"),
        _ => {}
    }
    if has("seconds") && ["run", "demo"].contains(&words[0].as_str()) {
        match words.iter().position(|word| word == "--seconds") {
            Some(at) => words[at + 1] = "0.3".into(),
            None => more.extend(["--seconds", "0.3"]),
        }
    }
    if has("force") {
        more.push("--force");
    }
    words.extend(more.into_iter().map(str::to_string));
    words
}

#[test]
fn every_command_that_is_shown_works() {
    let shown = shown();
    assert!(shown.len() > 50, "only {} commands were found", shown.len());
    for expected in ["armature demo --puppet human8", "armature devices --decode dump.txt", "armature bind fox.glb"] {
        assert!(shown.contains_key(expected), "{expected} is not found: {:?}", shown.keys());
    }
    let place = prepared();
    let mut cli = Cli::command();
    cli.build();
    let (mut run, mut failures) = (0, Vec::new());
    // Commands that record come before those that read the record.
    // Shortened as they are here, those for the edit list would be too short for its edits.
    let is_recording = |command: &str| {
        command.contains("--record") && !["body.take", "arms.take"].iter().any(|take| command.contains(take))
    };
    let in_order = shown.iter().filter(|(c, _)| is_recording(c)).chain(shown.iter().filter(|(c, _)| !is_recording(c)));
    for (command, source) in in_order {
        let filled = STANDS_FOR.iter().fold(command.clone(), |text, (what, with)| text.replace(what, with));
        let words: Vec<String> = filled.split_whitespace().skip(1).map(str::to_string).collect();
        let unknown =
            words.iter().find(|w| w.contains(['{', '…']) || w.len() > 3 && w.chars().all(|c| c.is_ascii_uppercase()));
        assert_eq!(unknown, None, "{command} in {source}: add what this stands for to STANDS_FOR");
        let parsed = cli.clone().try_get_matches_from(std::iter::once("armature".to_string()).chain(words.clone()));
        match parsed.map_err(|error| (error.kind(), error.to_string())) {
            // Help, or only a name, or an option of a command that needs more.
            Err((
                ErrorKind::DisplayHelp
                | ErrorKind::MissingRequiredArgument
                | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand,
                _,
            )) => {}
            Err((ErrorKind::InvalidValue, error)) if error.contains("a value is required") => {}
            Err((_, error)) => failures.push(format!("{command} in {source}: {error}")),
            Ok(_) if words.is_empty() || words[0] == "window" => {}
            Ok(_) => {
                let words = runnable(&words, &cli);
                let arguments: Vec<&str> = words.iter().map(String::as_str).collect();
                let ran = place.run(&arguments);
                // The puppet on that port does not exist here.
                let expected = if filled.contains("/dev/tty") { 4 } else { 0 };
                run += 1;
                if ran.code != expected {
                    failures.push(format!("{command} in {source}, as {arguments:?}: {ran:?}"));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{} of {run}:\n{}", failures.len(), failures.join("\n"));
    assert!(run > 30, "only {run} commands were run");
}

/// The puppets and arms that the help offers are served.
#[cfg(unix)]
#[test]
fn every_simulated_puppet_and_arm_starts() {
    let place = Place::new("documented-sim");
    let puppets = Body::presets().map(|(name, _)| name.to_string());
    let arms = ServoBusSettings::preset_names().map(ToString::to_string);
    let names: Vec<String> = puppets.chain(arms).chain(["joints:3".to_string()]).collect();
    assert!(names.len() >= 9, "{names:?}");
    for name in names {
        let ran = place.done(&["sim", &name, "--until-input-ends"]);
        let scheme = ran.out.split(':').next().unwrap();
        assert!(["serial", "feetech", "dynamixel"].contains(&scheme) && ran.out.contains(":/dev/"), "{name}: {ran:?}");
    }
    // And they drive a character; a bus does not say which arm it is.
    place.write("walk.bvh", SMALL_BVH);
    for (arm, joints) in [("so101-leader", 6), ("gello-franka", 8)] {
        let device = format!("sim:{arm}");
        let run = ["run", "--device", &device, "--character", "walk.bvh", "--rate", "50", "--seconds", "0.3"];
        let ran = place.done(&run);
        assert!(ran.out.contains(&format!("{joints} joints drive")), "{arm}: {ran:?}");
        place.fails(2, "servos", &["devices", "--decode", &device]);
    }
    place.fails(2, "so101-leader", &["sim", "so101-leader", "--tcp", "127.0.0.1:0", "--until-input-ends"]);
}

/// A wrong bone name is answered with the right ones, and `armature inspect` lists them too.
#[test]
fn bones_are_listed_where_a_name_is_needed() {
    let place = Place::new("documented-inspect");
    place.write("model.obj", tube_obj());
    place.write("bones.tgf", TUBE_TGF);
    place.write("walk.bvh", SMALL_BVH);
    place.done(&["bind", "model.obj", "-s", "bones.tgf", "--method", "heat", "-o", "a.armature", "--quiet"]);
    let run = ["run", "--device", "sim:hand", "--character", "a.armature", "--virtual-clock", "--seconds", "0.5"];
    let ran = place.fails(2, "wing", &[&run[..], &["--pin", "wing"]].concat());
    assert!(ran.err.contains("its bones are bone_1, bone_2"), "{ran:?}");
    for (file, bone) in [("a.armature", "bone_2"), ("bones.tgf", "bone_2"), ("walk.bvh", "hips, knee")] {
        let ran = place.done(&["inspect", file]);
        assert!(ran.out.contains(bone), "{file}: {ran:?}");
    }
}
