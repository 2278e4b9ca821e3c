//! `armature puppet …`

use armature_device::{DeviceAddress, PartKind};
use clap::{Args, Subcommand, ValueEnum};

/// What is done to a puppet's own parts.
#[derive(Debug, Subcommand)]
pub enum PuppetCommand {
    /// List the parts that are plugged in, each with its number
    Parts(PartsArgs),
    /// Write into a part's own memory what it is; a part fresh from the soldering iron needs this once
    Label(LabelArgs),
}

/// `armature puppet parts`
#[derive(Debug, Args)]
pub struct PartsArgs {
    /// The puppet: serial:PATH[@BAUD], usb:VID:PID[,SERIAL], hid:VID:PID[,SERIAL] or tcp:HOST:PORT
    #[arg(short, long)]
    pub device: DeviceAddress,
}

/// `armature puppet label`
#[derive(Debug, Args)]
pub struct LabelArgs {
    /// The puppet: serial:PATH[@BAUD], usb:VID:PID[,SERIAL], hid:VID:PID[,SERIAL] or tcp:HOST:PORT
    #[arg(short, long)]
    pub device: DeviceAddress,
    /// Which part: its number, or the last digits of it; without it, the only part that has no label yet
    #[arg(long, value_name = "NUMBER")]
    pub part: Option<String>,
    /// What it is
    #[arg(long)]
    pub kind: LabelKind,
    /// How many outlets it has; joints have one, splitters up to five
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..=5))]
    pub outlets: Option<u8>,
    /// Resolution of its sensors, counts per turn
    #[arg(long, default_value_t = 4096, value_parser = clap::value_parser!(u32).range(2..=65_536))]
    pub counts: u32,
}

/// The kinds of parts that can be written.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum LabelKind {
    /// One sensor, bending.
    Bend,
    /// One sensor, twisting.
    Twist,
    /// Three sensors.
    TwistBendTwist,
    /// No sensor, one to five outlets.
    Splitter,
}

impl LabelKind {
    /// As the protocol knows it.
    pub fn part_kind(self) -> PartKind {
        match self {
            Self::Bend => PartKind::Bend,
            Self::Twist => PartKind::Twist,
            Self::TwistBendTwist => PartKind::TwistBendTwist,
            Self::Splitter => PartKind::Splitter,
        }
    }
}
