//! Runs the program as a user does: in its own folder, with its own settings and cache.

#![allow(dead_code, reason = "each test uses some of it")]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A folder for one test, empty at first, in which the program runs.
pub(crate) struct Place {
    pub(crate) folder: PathBuf,
}

/// How a run ended.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) code: i32,
    pub(crate) out: String,
    pub(crate) err: String,
    arguments: String,
}

impl Place {
    /// The name must be different for each test.
    pub(crate) fn new(name: &str) -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        if folder.exists() {
            std::fs::remove_dir_all(&folder).expect("the folder of an earlier run can be removed");
        }
        std::fs::create_dir_all(&folder).expect("a folder for the test");
        Self { folder }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, bytes).expect("a file can be written");
        path
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// The program with these arguments, not started yet.
    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_armature"));
        command.args(arguments).current_dir(&self.folder).stdin(Stdio::null());
        for variable in ["HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME"] {
            command.env(variable, &self.folder);
        }
        // The test's own settings for logging or for another Python must not affect the program.
        for variable in ["ARMATURE_LOG", "ARMATURE_BPY_PYTHON", "RUST_BACKTRACE"] {
            command.env_remove(variable);
        }
        command
    }

    /// Runs the program to its end. Whatever its input, it must not panic or be killed.
    pub(crate) fn run(&self, arguments: &[&str]) -> Ran {
        let output = self.command(arguments).output().expect("the program starts");
        let ran = Ran {
            code: output.status.code().unwrap_or(-1),
            out: String::from_utf8_lossy(&output.stdout).into_owned(),
            err: String::from_utf8_lossy(&output.stderr).into_owned(),
            arguments: arguments.join(" "),
        };
        assert!(output.status.code().is_some(), "killed by a signal: {ran:?}");
        assert!(!ran.err.contains("panicked") && !ran.out.contains("panicked"), "{ran:?}");
        ran
    }

    /// Runs a command that must succeed.
    pub(crate) fn done(&self, arguments: &[&str]) -> Ran {
        let ran = self.run(arguments);
        assert_eq!(ran.code, 0, "{ran:?}");
        ran
    }

    /// Runs a command that must fail with this code and an error that names the culprit and says what to do.
    pub(crate) fn fails(&self, code: i32, culprit: &str, arguments: &[&str]) -> Ran {
        let ran = self.run(arguments);
        assert_eq!(ran.code, code, "{ran:?}");
        ran.assert_explains(culprit);
        ran
    }
}

impl Ran {
    /// The error names the culprit and has a remedy: after an arrow, or in the sentence itself.
    pub(crate) fn assert_explains(&self, culprit: &str) {
        let error = self.err.split_once("error: ").map(|(_, error)| error);
        let error = error.unwrap_or_else(|| panic!("no error is reported: {self:?}"));
        assert!(error.contains(culprit), "{culprit:?} is not named: {self:?}");
        let advises =
            ["→", "; ", ": is ", ": check ", ": update ", "(set it with ", "`armature ", "tip: ", "try '--help'"]
                .iter()
                .any(|sign| error.contains(sign));
        assert!(advises, "no remedy: {self:?}");
    }
}

/// A closed tube along +Y from 0 to 2 as OBJ: rings of vertices with a cap at each end.
pub(crate) fn tube_obj() -> String {
    const RINGS: usize = 17;
    const SIDES: usize = 12;
    let mut lines = vec!["# a tube".to_string()];
    for ring in 0..RINGS {
        for side in 0..SIDES {
            let angle = side as f64 / SIDES as f64 * std::f64::consts::TAU;
            let height = ring as f64 * 2.0 / (RINGS - 1) as f64;
            lines.push(format!("v {:.6} {height:.6} {:.6}", 0.25 * angle.sin(), 0.25 * angle.cos()));
        }
    }
    lines.push("v 0 0 0\nv 0 2 0".into());
    let at = |ring: usize, side: usize| ring * SIDES + side % SIDES + 1;
    let (bottom, top) = (RINGS * SIDES + 1, RINGS * SIDES + 2);
    for side in 0..SIDES {
        for ring in 0..RINGS - 1 {
            let [a, b] = [at(ring, side), at(ring, side + 1)];
            let [c, d] = [at(ring + 1, side + 1), at(ring + 1, side)];
            lines.push(format!("f {a} {b} {c}\nf {a} {c} {d}"));
        }
        lines.push(format!("f {bottom} {} {}", at(0, side + 1), at(0, side)));
        lines.push(format!("f {top} {} {}", at(RINGS - 1, side), at(RINGS - 1, side + 1)));
    }
    lines.join("\n") + "\n"
}

/// Two bones along the tube's axis.
pub(crate) const TUBE_TGF: &str = "1 0 0.05 0\n2 0 1 0\n3 0 1.95 0\n#\n1 2\n2 3\n";

/// Two bones that turn for three frames.
pub(crate) const SMALL_BVH: &str = "HIERARCHY\nROOT hips\n{\n\tOFFSET 0 0 0\n\tCHANNELS 6 Xposition Yposition Zposition \
    Zrotation Xrotation Yrotation\n\tJOINT knee\n\t{\n\t\tOFFSET 0 1 0\n\t\tCHANNELS 3 Zrotation Xrotation \
    Yrotation\n\t\tEnd Site\n\t\t{\n\t\t\tOFFSET 0 1 0\n\t\t}\n\t}\n}\nMOTION\nFrames: 3\nFrame Time: 0.05\n\
    0 0 0 0 0 0 0 0 0\n0 0 0 5 0 0 10 0 0\n0 0 0 10 0 0 20 0 0\n";
