//! The options of `armature edit`.

use std::path::PathBuf;

use armature_take::Edit;
use clap::{Args, Subcommand};

use crate::files::Overwrite;

const EDIT_HELP: &str = "\
The list is a text file in the folder of its takes; the takes themselves are never changed. Edit it by these actions or \
in any editor: the edits are applied in order, and times are those after the edits before. Without an action, the edits \
are listed, with what they make of the take.

  armature edit walk.edit new body.take
  armature edit walk.edit overdub arms.take --bones LeftUpperArm,RightUpperArm --blend 0.3
  armature edit walk.edit trim 0.5 1.9
  armature edit walk.edit smooth 8
  armature edit walk.edit                             what is left, with its markers and segments
  armature edit walk.edit undo
  armature export walk.edit --to walk.glb --fps 24";

/// `armature edit`
#[derive(Debug, Args)]
#[command(after_help = EDIT_HELP)]
pub struct EditArgs {
    /// The edit list, a text file whose name ends in .edit
    pub list: PathBuf,
    /// The character, if the take was recorded with inverse kinematics and its own is not found
    #[arg(short, long, global = true)]
    pub character: Option<String>,
    /// What to do; without it, the edits are listed.
    #[command(subcommand)]
    pub action: Option<EditAction>,
}

/// What is done to an edit list.
#[derive(Clone, Debug, Subcommand)]
pub enum EditAction {
    /// Begin a list for a take in the same folder
    New {
        /// The take's file name
        take: String,
        /// Files that are already there.
        #[command(flatten)]
        overwrite: Overwrite,
    },
    /// Delete the last edit of the list, or the one of this number
    Undo {
        /// Its number in the list
        number: Option<usize>,
    },
    /// Bring bones from another take over this one; both are solved again together
    Overdub {
        /// The other take's file name
        take: String,
        /// The bones that it brings, with everything below them
        #[arg(long, value_delimiter = ',', required = true)]
        bones: Vec<String>,
        /// When its first sample is, seconds
        #[arg(long, default_value_t = 0.0)]
        at: f64,
        /// From when it counts; without it, from its start
        #[arg(long)]
        from: Option<f64>,
        /// Until when it counts; without it, to its end
        #[arg(long)]
        to: Option<f64>,
        /// How long it takes to come in and to go, seconds
        #[arg(long, default_value_t = 0.25)]
        blend: f64,
    },
    /// Solve all samples again with another filter; its lag is reported
    Filter {
        /// none, one-euro, one-euro:CUTOFF,BETA or hold:MILLISECONDS
        filter: String,
    },
    /// Keep only this part
    Trim {
        /// First moment, seconds
        from: f64,
        /// Last moment
        to: f64,
    },
    /// Name a part
    Segment {
        /// The name
        name: String,
        /// First moment, seconds
        from: f64,
        /// Last moment
        to: f64,
    },
    /// Note something at a moment
    Marker {
        /// The moment, seconds
        at: f64,
        /// The note
        text: String,
    },
    /// Let bones rest
    Mute {
        /// Which bones, with everything below them
        #[arg(long, value_delimiter = ',', required = true)]
        bones: Vec<String>,
        /// From when; without it, from the start
        #[arg(long)]
        from: Option<f64>,
        /// Until when; without it, to the end
        #[arg(long)]
        to: Option<f64>,
        /// How long it takes to go to rest and to come back, seconds
        #[arg(long, default_value_t = 0.25)]
        blend: f64,
    },
    /// Smooth away what is faster than this many Hz, without lag (zero phase)
    Smooth {
        /// The frequency of which half is left
        cutoff: f64,
        /// Which bones, with everything below them; without it, all
        #[arg(long, value_delimiter = ',')]
        bones: Vec<String>,
    },
    /// Let left and right change places
    Mirror,
    /// Play faster or slower; 2 is twice as fast
    Retime {
        /// The speed
        speed: f64,
    },
    /// Repeat, the end going over into the start
    Loop {
        /// How often
        times: u32,
        /// How long the end takes to go over, seconds; the loop is that much shorter
        #[arg(long, default_value_t = 0.25)]
        blend: f64,
    },
    /// Hold the pose of one moment at others (a pose key)
    Hold {
        /// The moment of the pose, seconds
        pose: f64,
        /// From when it is held
        #[arg(long)]
        from: f64,
        /// Until when
        #[arg(long)]
        to: f64,
        /// How long it takes to get there before, and away after, seconds
        #[arg(long, default_value_t = 0.25)]
        blend: f64,
        /// Which bones, with everything below them; without it, all
        #[arg(long, value_delimiter = ',')]
        bones: Vec<String>,
    },
    /// Add what another take moves away from its first pose (an additive layer)
    Add {
        /// The other take's file name
        take: String,
        /// When its first sample is, seconds
        #[arg(long, default_value_t = 0.0)]
        at: f64,
        /// How much of it; 1 is all
        #[arg(long, default_value_t = 1.0)]
        weight: f64,
        /// Which bones, with everything below them; without it, all
        #[arg(long, value_delimiter = ',')]
        bones: Vec<String>,
    },
}

impl EditAction {
    /// The edit that an action adds; `None` for those that add none.
    pub fn edit(&self) -> Option<Edit> {
        Some(match self.clone() {
            Self::New { .. } | Self::Undo { .. } => return None,
            Self::Overdub { take, bones, at, from, to, blend } => Edit::Overdub { take, bones, at, from, to, blend },
            Self::Filter { filter } => Edit::Filter { filter },
            Self::Trim { from, to } => Edit::Trim { from, to },
            Self::Segment { name, from, to } => Edit::Segment { name, from, to },
            Self::Marker { at, text } => Edit::Marker { at, text },
            Self::Mute { bones, from, to, blend } => Edit::Mute { bones, from, to, blend },
            Self::Smooth { cutoff, bones } => Edit::Smooth { cutoff, bones },
            Self::Mirror => Edit::Mirror,
            Self::Retime { speed } => Edit::Retime { speed },
            Self::Loop { times, blend } => Edit::Loop { times, blend },
            Self::Hold { pose, from, to, blend, bones } => Edit::Hold { pose, from, to, blend, bones },
            Self::Add { take, at, weight, bones } => Edit::Add { take, at, weight, bones },
        })
    }
}
