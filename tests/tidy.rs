//! Rules of the house that a machine can check: who may use whom, what lies where, what may not be left behind.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand};

/// Room by room, the rooms it may use (in every feature combination). ARCHITECTURE.md draws the same arrows.
const ARROWS: &[(&str, &[&str])] = &[
    ("firmware-protocol", &[]),
    ("armature-geometry", &[]),
    ("armature-rig", &[]),
    ("armature-weights", &["armature-geometry"]),
    ("armature-deform", &["armature-geometry"]),
    ("armature-formats", &["armature-geometry", "armature-rig"]),
    (
        "armature-character",
        &["armature-deform", "armature-formats", "armature-geometry", "armature-rig", "armature-weights"],
    ),
    ("armature-device", &["firmware-protocol"]),
    ("armature-take", &["armature-formats", "armature-rig"]),
    ("armature-render", &["armature-deform", "armature-geometry"]),
    // The library alone uses firmware-protocol; serving on a pty and playing motion files is its feature `serve`.
    ("armature-sim", &["armature-formats", "armature-rig", "firmware-protocol"]),
];

/// What the simulator's library may use when none of its features is on.
const SIM_LIBRARY: &[&str] = &["firmware-protocol"];

/// Crates that pull in a window, a GPU, an async runtime or a file format, kept out of the numerical rooms.
const HEAVY: &[&str] = &["eframe", "egui", "wgpu", "gltf", "tokio", "serde_json", "image"];
const NUMERICAL: &[&str] =
    &["firmware-protocol", "armature-geometry", "armature-rig", "armature-weights", "armature-deform"];

const TOP_LEVEL: &[&str] = &[
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "Cargo.lock",
    "Cargo.toml",
    "LICENSE",
    "README.md",
    "firmware-protocol",
    "host",
    "sim",
    "tests",
];

const LONGEST_FILE: usize = 560;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests package lies in the workspace").to_path_buf()
}

fn metadata() -> Metadata {
    MetadataCommand::new().current_dir(root()).no_deps().exec().expect("cargo metadata")
}

/// Normal and build dependencies of each package of the workspace: name to (dependency, optional).
fn dependencies() -> BTreeMap<String, Vec<(String, bool)>> {
    let package_dependencies = |package: &cargo_metadata::Package| {
        let used = package.dependencies.iter().filter(|d| d.kind != DependencyKind::Development);
        used.map(|d| (d.name.clone(), d.optional)).collect()
    };
    metadata().packages.iter().map(|p| (p.name.to_string(), package_dependencies(p))).collect()
}

fn tracked_files() -> Vec<PathBuf> {
    let output =
        std::process::Command::new("git").args(["ls-files", "-z"]).current_dir(root()).output().expect("git ls-files");
    assert!(output.status.success(), "git ls-files failed");
    let names = String::from_utf8(output.stdout).expect("file names are UTF-8");
    names.split('\0').filter(|n| !n.is_empty()).map(PathBuf::from).filter(|p| root().join(p).exists()).collect()
}

#[test]
fn rooms_use_only_the_rooms_they_may() {
    let dependencies = dependencies();
    let rooms: Vec<&str> = ARROWS.iter().map(|(room, _)| *room).collect();
    for (room, allowed) in ARROWS {
        let used = dependencies.get(*room).unwrap_or_else(|| panic!("{room} is not in the workspace"));
        for (name, _) in used.iter().filter(|(name, _)| rooms.contains(&name.as_str()) || name == "armature") {
            assert!(allowed.contains(&name.as_str()), "{room} may not use {name}; see ARCHITECTURE.md");
        }
    }
    for (name, _) in dependencies["armature-sim"].iter().filter(|(_, optional)| !optional) {
        let is_room = rooms.contains(&name.as_str());
        assert!(!is_room || SIM_LIBRARY.contains(&name.as_str()), "the simulator's library may not use {name}");
    }
    for package in dependencies.keys() {
        let known = rooms.contains(&package.as_str()) || ["armature", "armature-tests"].contains(&package.as_str());
        assert!(known, "{package} has no arrows: add it to ARROWS and to ARCHITECTURE.md");
    }
}

#[test]
fn numerical_rooms_stay_light() {
    let dependencies = dependencies();
    for room in NUMERICAL {
        for (name, _) in &dependencies[*room] {
            assert!(!HEAVY.contains(&name.as_str()), "{room} uses {name}, which makes it slow to build");
        }
    }
}

#[test]
fn the_top_level_holds_only_what_was_agreed() {
    for path in tracked_files() {
        let first = path.components().next().expect("a path has a first component");
        let first = first.as_os_str().to_string_lossy();
        assert!(
            first.starts_with('.') || TOP_LEVEL.contains(&first.as_ref()),
            "{} does not belong at the top",
            path.display()
        );
    }
}

#[test]
fn files_fit_a_thought() {
    for path in tracked_files() {
        if path.extension().is_none_or(|e| e != "rs" && e != "wgsl") {
            continue;
        }
        let text = std::fs::read_to_string(root().join(&path)).expect("sources are UTF-8");
        let lines = text.lines().count();
        assert!(lines <= LONGEST_FILE, "{} has {lines} lines; split it by idea", path.display());
    }
}

#[test]
fn nothing_is_left_behind() {
    // Written in pieces so that this file does not find itself.
    let leftovers = [
        concat!("FIX", "ME"),
        concat!("TO", "DO"),
        concat!("XX", "X:"),
        concat!("to", "do!("),
        concat!("unimple", "mented!("),
        concat!("db", "g!("),
        concat!("#[ig", "nore"),
        concat!("/wo", "rk/"),
        concat!("/ro", "ot/"),
    ];
    for path in tracked_files() {
        let Ok(text) = std::fs::read_to_string(root().join(&path)) else { continue };
        if path.ends_with("Cargo.lock") {
            continue;
        }
        for (number, line) in text.lines().enumerate() {
            for word in leftovers {
                assert!(!line.contains(word), "{}:{}: {word}", path.display(), number + 1);
            }
        }
    }
}

#[test]
fn every_exception_has_a_reason() {
    for path in tracked_files() {
        if path.extension().is_none_or(|e| e != "rs") || path.ends_with("tests/tidy.rs") {
            continue;
        }
        let text = std::fs::read_to_string(root().join(&path)).expect("sources are UTF-8");
        for attribute in ["#[allow(", "#![allow(", "#[expect(", "#![expect("] {
            for (at, _) in text.match_indices(attribute) {
                let end = text[at..].find(")]").map_or(text.len(), |e| at + e);
                let has_reason = text[at..end].contains("reason");
                let line = text[..at].lines().count() + 1;
                assert!(has_reason, "{}:{line}: {attribute}..)] needs a reason", path.display());
            }
        }
    }
}

#[test]
fn shared_data_is_read_in_place() {
    for path in tracked_files() {
        let size = std::fs::metadata(root().join(&path)).expect("a tracked file").len();
        assert!(size < 1_500_000, "{} has {size} bytes; data does not belong in the project", path.display());
    }
}
