//! The edit list: a text file beside the takes it speaks of.

use serde::{Deserialize, Serialize};

/// The version of the notation.
const VERSION: u32 = 1;

/// What is done to a take, in order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EditList {
    /// The version of the notation: 1.
    version: u32,
    /// The take's file, seen from the list's folder.
    pub take: String,
    /// The edits. Those that solve samples again come first; times of the others are those after the edits before them.
    #[serde(default, rename = "edit", skip_serializing_if = "Vec::is_empty")]
    pub edits: Vec<Edit>,
}

/// One edit. Times are seconds since the take's first sample, lengths of time seconds. `bones` are names; each stands
/// for everything below it as well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Edit {
    /// Bones from another take over this one, aligned on the devices' clocks; the others are solved again around them.
    Overdub {
        /// The other take's file, seen from the list's folder.
        take: String,
        /// The bones that it brings.
        bones: Vec<String>,
        /// When its first sample is.
        #[serde(default)]
        at: f64,
        /// From when it counts; without it, from its start.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        from: Option<f64>,
        /// Until when; without it, to its end.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        to: Option<f64>,
        /// How long it takes to come in, and to go.
        #[serde(default)]
        blend: f64,
    },
    /// All samples are solved again with this filter on every joint: `none`, `one-euro:CUTOFF,BETA`, `hold:MILLISECONDS`.
    Filter {
        /// The filter, as for `armature run --filter`.
        filter: String,
    },
    /// Only this part is left; it starts at zero.
    Trim {
        /// First moment.
        from: f64,
        /// Last moment.
        to: f64,
    },
    /// A name for a part.
    Segment {
        /// The name.
        name: String,
        /// First moment.
        from: f64,
        /// Last moment.
        to: f64,
    },
    /// A note at a moment.
    Marker {
        /// The moment.
        at: f64,
        /// The note.
        text: String,
    },
    /// Bones rest.
    Mute {
        /// Which ones.
        bones: Vec<String>,
        /// From when; without it, from the start.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        from: Option<f64>,
        /// Until when; without it, to the end.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        to: Option<f64>,
        /// How long it takes to go to rest, and to come back.
        #[serde(default)]
        blend: f64,
    },
    /// Everything faster than this is smoothed away, before and after each moment alike: no lag.
    Smooth {
        /// The frequency of which half is left, Hz.
        cutoff: f64,
        /// Which bones; without them, all.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        bones: Vec<String>,
    },
    /// Left and right change places.
    Mirror,
    /// Faster or slower.
    Retime {
        /// 2 is twice as fast.
        speed: f64,
    },
    /// The end goes over into the start, several times in a row.
    Loop {
        /// How often.
        times: u32,
        /// How long it takes to go over; the loop is that much shorter.
        blend: f64,
    },
    /// A pose key: the pose of one moment is held at others.
    Hold {
        /// The moment of the pose.
        pose: f64,
        /// From when it is held.
        from: f64,
        /// Until when.
        to: f64,
        /// How long it takes to go to the pose, and to leave it; before and after the hold.
        #[serde(default)]
        blend: f64,
        /// Which bones; without them, all.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        bones: Vec<String>,
    },
    /// Adds what another take moves away from its first pose.
    Add {
        /// The other take's file, seen from the list's folder.
        take: String,
        /// When its first sample is.
        #[serde(default)]
        at: f64,
        /// How much of it: 1 is all.
        #[serde(default = "one")]
        weight: f64,
        /// Which bones; without them, all.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        bones: Vec<String>,
    },
}

impl Edit {
    /// Whether it works on samples, not on the poses that came of them.
    pub fn solves_again(&self) -> bool {
        matches!(self, Self::Overdub { .. } | Self::Filter { .. })
    }
}

fn one() -> f64 {
    1.0
}

/// Why a text is not an edit list.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EditListError {
    /// A line cannot be read.
    #[error("line {line}: {what}; `armature edit --help` lists the edits and what belongs to each")]
    Line {
        /// One-based.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// It was written by another version.
    #[error("this is an edit list of version {got}, but this program knows version {VERSION}; use a newer program")]
    Version {
        /// Its version.
        got: u32,
    },
}

impl Default for EditList {
    fn default() -> Self {
        Self::new("")
    }
}

impl EditList {
    /// A list without edits.
    pub fn new(take: &str) -> Self {
        Self { version: VERSION, take: take.to_owned(), edits: Vec::new() }
    }

    /// Adds edits: one that solves samples again behind the others of its kind, any other at the end.
    pub fn add(&mut self, edits: impl IntoIterator<Item = Edit>) {
        for edit in edits {
            let solving = self.edits.iter().take_while(|edit| edit.solves_again()).count();
            let place = if edit.solves_again() { solving } else { self.edits.len() };
            self.edits.insert(place, edit);
        }
    }

    /// Reads a list.
    ///
    /// ```
    /// use armature_take::{Edit, EditList};
    ///
    /// let text = r#"
    ///     version = 1
    ///     take = "walk.take"
    ///     [[edit]]
    ///     do = "trim"
    ///     from = 1.5
    ///     to = 8.0
    /// "#;
    /// let list = EditList::read(text)?;
    /// assert_eq!(list.edits, [Edit::Trim { from: 1.5, to: 8.0 }]);
    /// assert_eq!(EditList::read(&list.write())?, list);
    /// # Ok::<(), armature_take::EditListError>(())
    /// ```
    pub fn read(text: &str) -> Result<Self, EditListError> {
        let list: Self = toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start);
            let line = 1 + text.bytes().take(start).filter(|&byte| byte == b'\n').count();
            EditListError::Line { line, what: error.message().replace('\n', " ") }
        })?;
        if list.version == VERSION { Ok(list) } else { Err(EditListError::Version { got: list.version }) }
    }

    /// The list as text.
    pub fn write(&self) -> String {
        // Strings, numbers and lists of them: there is nothing that TOML could not hold.
        toml::to_string(self).unwrap_or_default()
    }

    /// The files that it speaks of besides its own take.
    pub fn other_takes(&self) -> impl Iterator<Item = &str> {
        self.edits.iter().filter_map(|edit| match edit {
            Edit::Overdub { take, .. } | Edit::Add { take, .. } => Some(take.as_str()),
            _ => None,
        })
    }
}
