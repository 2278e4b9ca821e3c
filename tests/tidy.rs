//! Project rules that a machine can check: who may use whom, what is where, what must not be left behind.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand};

use modules::Modules;

#[path = "tidy/items.rs"]
mod items;
#[path = "tidy/modules.rs"]
mod modules;
#[path = "tidy/tokens.rs"]
mod tokens;

/// For each crate, the crates it may use (with any features). ARCHITECTURE.md draws the same arrows.
const ARROWS: &[(&str, &[&str])] = &[
    ("firmware-protocol", &[]),
    ("armature-geometry", &[]),
    ("armature-rig", &[]),
    ("armature-weights", &["armature-geometry"]),
    ("armature-deform", &["armature-geometry"]),
    ("armature-fairing", &["armature-geometry"]),
    ("armature-formats", &["armature-geometry", "armature-rig"]),
    (
        "armature-character",
        &["armature-deform", "armature-formats", "armature-geometry", "armature-rig", "armature-weights"],
    ),
    ("armature-device", &["firmware-protocol"]),
    ("armature-take", &["armature-formats", "armature-rig"]),
    ("armature-render", &["armature-deform", "armature-geometry"]),
    // On its own the library uses only firmware-protocol; serving on a pty and playing motion files is its feature
    // `serve`.
    ("armature-sim", &["armature-formats", "armature-rig", "firmware-protocol"]),
];

/// Test helpers, which use no other crate: every crate may use them in its tests, none in its library.
const TEST_SUPPORT: &str = "armature-test-support";

/// What the simulator's library may use with all its features off.
const SIM_LIBRARY: &[&str] = &["firmware-protocol"];

/// Crates that pull in a window, a GPU, an async runtime or a file format, kept out of the numerical crates.
const HEAVY: &[&str] = &["eframe", "egui", "wgpu", "gltf", "tokio", "serde_json", "image"];
/// What must not be in a build without the window.
const WINDOW: &[&str] = &["wgpu", "eframe", "egui", "winit", "rfd", "image", "accesskit", "zbus"];
const NUMERICAL: &[&str] = &[
    "firmware-protocol",
    "armature-geometry",
    "armature-rig",
    "armature-weights",
    "armature-deform",
    "armature-fairing",
];

const TOP_LEVEL: &[&str] = &[
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
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

/// A struct with more `pub(super)` fields than this ...
const OPEN_FIELDS: usize = 3;
/// ... is changed by fewer files than this, including its own.
const SHARED_BY: usize = 3;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests package is in the workspace").to_path_buf()
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
        assert!(!used.iter().any(|(name, _)| name == TEST_SUPPORT), "{room} needs {TEST_SUPPORT} outside its tests");
        for (name, _) in used.iter().filter(|(name, _)| rooms.contains(&name.as_str()) || name == "armature") {
            assert!(allowed.contains(&name.as_str()), "{room} may not use {name}; see ARCHITECTURE.md");
        }
    }
    assert!(dependencies[TEST_SUPPORT].is_empty(), "{TEST_SUPPORT} must use no other crate, so that all can use it");
    for (name, _) in dependencies["armature-sim"].iter().filter(|(_, optional)| !optional) {
        let is_room = rooms.contains(&name.as_str());
        assert!(!is_room || SIM_LIBRARY.contains(&name.as_str()), "the simulator's library may not use {name}");
    }
    for package in dependencies.keys() {
        let known = ["armature", "armature-tests", TEST_SUPPORT].contains(&package.as_str());
        let known = known || rooms.contains(&package.as_str());
        assert!(known, "{package} has no arrows: add it to ARROWS and to ARCHITECTURE.md");
    }
}

/// What a puppet is built from is no package: firmware, boards on emulators, wiring, printable parts. The host needs none of it.
#[test]
fn rooms_of_the_puppet_are_known_and_the_host_needs_none() {
    let table = std::fs::read_to_string(root().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md");
    let rooms: BTreeSet<String> = tracked_files()
        .iter()
        .filter_map(|file| {
            let mut folders = file.strip_prefix("firmware-protocol").ok()?.iter();
            let folder = folders.next()?.to_string_lossy().into_owned();
            folders.next().map(|_| folder)
        })
        .collect();
    let of_the_crate = ["src", "tests", "examples", "fuzz"];
    for room in rooms.iter().filter(|room| !of_the_crate.contains(&room.as_str())) {
        assert!(table.contains(&format!("`firmware-protocol/{room}/`")), "ARCHITECTURE.md does not know {room}");
        for file in tracked_files().iter().filter(|file| file.extension().is_some_and(|kind| kind == "rs")) {
            let is_host = file.starts_with("host") && !file.components().any(|part| part.as_os_str() == "tests");
            let content = || std::fs::read_to_string(root().join(file)).expect("a source file");
            assert!(!is_host || !content().contains(&format!("firmware-protocol/{room}/")), "{}", file.display());
        }
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

/// The build without the window is for servers, CI and a first look: it must stay small.
#[test]
fn a_build_without_the_window_has_no_graphics() {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let tree = |features: &[&str]| {
        let output = std::process::Command::new(&cargo)
            .args(["tree", "--locked", "-p", "armature", "-e", "normal,build", "--prefix", "none"])
            .args(features)
            .current_dir(root())
            .output()
            .expect("cargo tree");
        assert!(output.status.success(), "cargo tree: {}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8(output.stdout).expect("names are UTF-8");
        text.lines().filter_map(|line| line.split_whitespace().next()).map(str::to_string).collect::<BTreeSet<_>>()
    };
    let (full, headless) = (tree(&[]), tree(&["--no-default-features"]));
    for name in WINDOW {
        assert!(full.contains(*name), "{name} is not in the full build either: correct this list");
        assert!(!headless.contains(*name), "{name} is in the build without the window");
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

/// `out!` and `aside!` escape the control characters that names from files and devices may contain.
#[test]
fn the_program_prints_in_one_way() {
    let program = Path::new("host/src");
    let prints = ["println!(", "print!("];
    for path in tracked_files().iter().filter(|p| p.starts_with(program) && p.extension().is_some_and(|e| e == "rs")) {
        let text = std::fs::read_to_string(root().join(path)).expect("sources are UTF-8");
        let found = text.lines().position(|line| prints.iter().any(|print| line.contains(print)));
        let line = found.map_or(0, |line| line + 1);
        assert!(found.is_none(), "{}:{line}: print by crate::terminal::out! or aside!", path.display());
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

/// The modules of every crate's library: package name to modules.
fn modules_of_packages() -> BTreeMap<String, Modules> {
    let source = |package: &cargo_metadata::Package| Path::new(&package.manifest_path).with_file_name("src/lib.rs");
    let packages = metadata().packages;
    let with_source = packages.iter().map(|p| (p.name.to_string(), source(p))).filter(|(_, file)| file.exists());
    with_source.map(|(name, file)| (name, Modules::read(&file))).collect()
}

#[test]
fn modules_side_by_side_form_no_circle() {
    let mut found = String::new();
    for (package, modules) in modules_of_packages() {
        for circle in modules.circles() {
            let _ = writeln!(found, "{package}, in {:?}: {}", circle.within, circle.members.join(", "));
            for (who, whom, file) in circle.mentions {
                let file = file.strip_prefix(root()).unwrap_or(&file).display().to_string();
                let _ = writeln!(found, "    {who} mentions {whom} ({file})");
            }
        }
    }
    assert!(found.is_empty(), "modules that use each other in a circle:\n{found}");
}

#[test]
fn private_state_is_changed_in_few_files() {
    for (package, modules) in modules_of_packages() {
        for (name, files) in modules.open_structs(OPEN_FIELDS) {
            let files: Vec<_> = files.iter().filter_map(|f| f.strip_prefix(root()).ok()).collect();
            assert!(
                files.len() < SHARED_BY,
                "{package}: {name} has pub(super) fields and is changed in {files:?}; give it methods or split it"
            );
        }
    }
}

/// Tests the module reader on a crate made for it.
#[test]
fn circles_are_found_through_re_exports_groups_and_macros() {
    let folder = std::env::temp_dir().join(format!("armature-tidy-{}", std::process::id()));
    let crate_of = |files: &[(&str, &str)]| {
        for (name, text) in files {
            let file = folder.join(name);
            std::fs::create_dir_all(file.parent().expect("a folder")).expect("a folder");
            std::fs::write(file, text).expect("a file");
        }
        let modules = Modules::read(&folder.join("lib.rs"));
        let circles: Vec<(String, Vec<String>)> =
            modules.circles().into_iter().map(|circle| (circle.within, circle.members)).collect();
        let shared: Vec<(String, usize)> =
            modules.open_structs(OPEN_FIELDS).into_iter().map(|(name, files)| (name, files.len())).collect();
        (circles, shared)
    };
    let a_and_b = vec![(String::new(), vec!["a".to_string(), "b".to_string()])];
    let root = "pub mod a; mod b; pub use b::{deep::Thing as Other, *};";
    let deep = ("b/deep.rs", "pub struct Thing;");
    let b = "pub mod deep; use crate::a::f; pub fn g() { f() }";
    // By the name that the root gives it, by a glob, in a macro, in a function's own `use`, by `super`, and as a whole
    // module.
    for a in [
        "use crate::Other; pub fn f() {}",
        "pub fn f() { crate::g() }",
        "pub fn f() { println!(\"{}\", crate::b::g()) }",
        "pub fn f() { use super::{Other, b as c}; }",
        "pub fn f(it: super::b::deep::Thing) {}",
        "use crate::{b}; pub fn f() {}",
    ] {
        assert_eq!(crate_of(&[("lib.rs", root), ("a.rs", a), ("b/mod.rs", b), deep]).0, a_and_b, "{a}");
    }
    // Text, tests, other crates, the root's own items and a parent's children do not make a circle.
    for a in [
        "/// Like crate::b::g.\npub fn f() -> &'static str { \"crate::b::g\" }",
        "pub fn f() {}\n#[cfg(test)]\nmod tests { use crate::b::g; }",
        "use other::b::g; pub fn f() {}",
        "use super::of_root; pub fn f() {}",
        "pub mod inner { pub fn h() { super::f() } } pub fn f() { inner::h() }",
    ] {
        let root = format!("{root} pub fn of_root() {{ a::f() }}");
        assert_eq!(crate_of(&[("lib.rs", &root), ("a.rs", a), ("b/mod.rs", b), deep]).0, [], "{a}");
    }
    let state = "pub struct State { pub(super) a: u8, pub(super) b: u8, pub(super) c: u8, pub(super) d: u8, e: u8 } impl<T> State where T: Copy { fn up(&mut self) {} }";
    let root = "mod a; mod b; mod c;";
    let (changing, reading) = ("fn f(s: &'static mut super::a::State) {}", "fn f(s: &super::a::State) {}");
    let count = |b: &str, c: &str| crate_of(&[("lib.rs", root), ("a.rs", state), ("b.rs", b), ("c.rs", c)]).1;
    let (naming, method) =
        ("use super::a::State; fn f(s: &mut State) {}", "impl super::a::State { fn f(&mut self) {} }");
    for (b, c, files) in [(naming, method, 3), (changing, reading, 2), (reading, reading, 1)] {
        assert_eq!(count(b, c), [("State".to_string(), files)], "{b} {c}");
    }
    let record = "pub struct Few { pub(super) a: u8, b: u8 }";
    assert_eq!(crate_of(&[("lib.rs", "mod a;"), ("a.rs", record)]).1, []);
    std::fs::remove_dir_all(&folder).expect("the folder can go");
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

/// A path in a document may omit the folders that its sentence or table names.
#[test]
fn files_that_the_documents_name_are_there() {
    let tracked: Vec<String> = tracked_files().iter().map(|path| format!("/{}", path.display())).collect();
    let exists = |name: &str| {
        let name = format!("/{name}");
        tracked.iter().any(|path| if name.ends_with('/') { path.contains(&name) } else { path.ends_with(&name) })
    };
    let is_path = |text: &str| {
        let plain = text.chars().all(|c| c.is_ascii_alphanumeric() || "._-/".contains(c));
        plain && [".rs", ".md", ".toml", ".txt", ".take", ".py", "/"].iter().any(|end| text.ends_with(end))
    };
    for document in ["ARCHITECTURE.md", "CONTRIBUTING.md"] {
        let text = std::fs::read_to_string(root().join(document)).expect("a document");
        for name in text.split('`').skip(1).step_by(2).filter(|name| is_path(name)) {
            assert!(exists(name), "{document} names {name}, which does not exist");
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
