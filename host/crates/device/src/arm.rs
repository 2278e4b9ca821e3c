//! Arms of bus servos: which servo drives which joint.

use std::fmt;
use std::str::FromStr;

use firmware_protocol::{PartKind, PartRecord as Part, PartUid};

use crate::topology::{Topology, TopologyProblem};

/// Which bus an arm's servos are on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ServoProtocol {
    /// Feetech STS/SMS.
    Feetech,
    /// Dynamixel protocol 2.0.
    Dynamixel,
}

impl ServoProtocol {
    /// Its scheme in an address.
    pub const fn scheme(self) -> &'static str {
        match self {
            Self::Feetech => "feetech",
            Self::Dynamixel => "dynamixel",
        }
    }

    /// Speeds at which to look for servos, bits per second, most likely first.
    pub const fn bauds(self) -> &'static [u32] {
        match self {
            Self::Feetech => &[1_000_000, 500_000, 115_200, 250_000, 128_000, 57_600],
            Self::Dynamixel => &[1_000_000, 57_600, 2_000_000, 3_000_000, 4_000_000, 115_200, 9_600],
        }
    }
}

impl fmt::Display for ServoProtocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Feetech => "Feetech",
            Self::Dynamixel => "Dynamixel",
        })
    }
}

/// A servo and its joint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServoJoint {
    /// Its number on the bus.
    pub id: u8,
    /// What it moves.
    pub name: String,
    /// Whether the part after it bends or twists.
    pub kind: PartKind,
    /// The model number it should have.
    pub model: u16,
}

/// An arm: a chain of servos from the base outwards, each joint plugged into the one before.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServoArm {
    /// Its name for `--preset`.
    pub name: String,
    /// Its usual name.
    pub title: String,
    /// Its bus.
    pub protocol: ServoProtocol,
    /// The speed that its building instructions set the servos to, bits per second.
    pub baud: u32,
    /// The joints, from the base outwards.
    pub joints: Vec<ServoJoint>,
}

/// The preset does not exist, or is not for this bus.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no {protocol} arm called `{given}`; choose one of: {known}")]
pub struct UnknownArm {
    /// The bus.
    pub protocol: ServoProtocol,
    /// The name given.
    pub given: String,
    /// All names for this bus.
    pub known: String,
}

/// Counts per turn of all servos used here.
pub const COUNTS_PER_TURN: u32 = 4_096;

const STS3215: u16 = 777;
const XL330_M077: u16 = 1190;
const XL330_M288: u16 = 1200;

type Row = (u8, &'static str, PartKind, u16);
const BEND: PartKind = PartKind::Bend;
const TWIST: PartKind = PartKind::Twist;

/// The built-in arms. Ids run from the base outwards, as in each arm's building instructions. A joint twists if its
/// axis runs along the arm, and bends otherwise.
///
/// Ids, speeds and models were checked against public programs that drive these arms; we had none of the arms at hand.
/// Which joints of GELLO twist is not documented anywhere: we follow the axes of the robots that GELLO copies (UR5:
/// base, wrist 2 and wrist 3 turn about the axis of their own link; Panda: every other joint from the first). A mapping
/// or a calibration's `axis` corrects what is wrong.
#[rustfmt::skip]
const PRESETS: &[(&str, &str, ServoProtocol, u32, &[Row])] = &[
    ("so101-leader", "SO-101 leader arm", ServoProtocol::Feetech, 1_000_000, &[
        (1, "shoulder_pan",  TWIST, STS3215),
        (2, "shoulder_lift", BEND,  STS3215),
        (3, "elbow_flex",    BEND,  STS3215),
        (4, "wrist_flex",    BEND,  STS3215),
        (5, "wrist_roll",    TWIST, STS3215),
        (6, "gripper",       BEND,  STS3215),
    ]),
    ("koch-leader", "Koch v1.1 leader arm", ServoProtocol::Dynamixel, 1_000_000, &[
        (1, "shoulder_pan",  TWIST, XL330_M077),
        (2, "shoulder_lift", BEND,  XL330_M077),
        (3, "elbow_flex",    BEND,  XL330_M077),
        (4, "wrist_flex",    BEND,  XL330_M077),
        (5, "wrist_roll",    TWIST, XL330_M077),
        (6, "gripper",       BEND,  XL330_M077),
    ]),
    ("gello", "GELLO for a UR5", ServoProtocol::Dynamixel, 57_600, &[
        (1, "base",          TWIST, XL330_M288),
        (2, "shoulder",      BEND,  XL330_M288),
        (3, "elbow",         BEND,  XL330_M288),
        (4, "wrist_1",       BEND,  XL330_M288),
        (5, "wrist_2",       TWIST, XL330_M288),
        (6, "wrist_3",       TWIST, XL330_M288),
        (7, "gripper",       BEND,  XL330_M077),
    ]),
    ("gello-franka", "GELLO for a Franka Panda", ServoProtocol::Dynamixel, 57_600, &[
        (1, "joint_1",       TWIST, XL330_M288),
        (2, "joint_2",       BEND,  XL330_M288),
        (3, "joint_3",       TWIST, XL330_M288),
        (4, "joint_4",       BEND,  XL330_M288),
        (5, "joint_5",       TWIST, XL330_M288),
        (6, "joint_6",       BEND,  XL330_M288),
        (7, "joint_7",       TWIST, XL330_M288),
        (8, "gripper",       BEND,  XL330_M077),
    ]),
];

/// Models whose registers and counts this crate reads correctly: STS3215 and STS3250, and the X series with 4,096
/// counts per turn (XH430 and XM430 1000 to 1050, XL430 and XC430 1060 to 1090, XH540 and XM540 1100 to 1150, 2XC430
/// 1160, XL330 1190 and 1200, XC330 1210 to 1240). The numbers come from the makers' own tables; only the arms' own
/// models are emulated.
const USABLE: &[(ServoProtocol, &[u16])] = &[
    (ServoProtocol::Feetech, &[777, 2_825]),
    (
        ServoProtocol::Dynamixel,
        &[
            1_000, 1_010, 1_020, 1_030, 1_040, 1_050, 1_060, 1_070, 1_080, 1_090, 1_100, 1_110, 1_120, 1_130, 1_140,
            1_150, 1_160, 1_190, 1_200, 1_210, 1_220, 1_230, 1_240,
        ],
    ),
];

/// Whether servos of this model are read the way the arms here are.
pub(crate) fn is_usable(protocol: ServoProtocol, model: u16) -> bool {
    USABLE.iter().any(|(bus, models)| *bus == protocol && models.contains(&model))
}

impl ServoArm {
    /// All built-in arms.
    pub fn presets() -> Vec<Self> {
        PRESETS
            .iter()
            .map(|&(name, title, protocol, baud, rows)| Self {
                name: name.to_owned(),
                title: title.to_owned(),
                protocol,
                baud,
                joints: rows
                    .iter()
                    .map(|&(id, joint, kind, model)| ServoJoint { id, name: joint.to_owned(), kind, model })
                    .collect(),
            })
            .collect()
    }

    /// The names of all arms, with commas between.
    pub fn preset_names() -> String {
        PRESETS.iter().map(|&(name, ..)| name).collect::<Vec<_>>().join(", ")
    }

    /// The arm with this name on this bus; without a name, the first preset for the bus.
    pub fn preset(protocol: ServoProtocol, name: Option<&str>) -> Result<Self, UnknownArm> {
        let arms: Vec<Self> = Self::presets().into_iter().filter(|arm| arm.protocol == protocol).collect();
        let known = arms.iter().map(|arm| arm.name.as_str()).collect::<Vec<_>>().join(", ");
        let found = arms.into_iter().find(|arm| name.is_none_or(|name| arm.name == name));
        found.ok_or_else(|| UnknownArm { protocol, given: name.unwrap_or_default().to_owned(), known })
    }

    /// The arm as a tree of parts. Servos have no unique numbers, so a part's number is derived from the arm, the
    /// servo's id and `seat`, which distinguishes two identical arms on one computer.
    pub fn topology(&self, seat: u32) -> Result<Topology, TopologyProblem> {
        let part = |(index, joint): (usize, &ServoJoint)| Part {
            kind: joint.kind,
            sensor_count: joint.kind.sensor_count().unwrap_or(0),
            outlet: 0,
            outlet_count: 1,
            parent: index.checked_sub(1).and_then(|parent| u16::try_from(parent).ok()),
            uid: self.part_uid(seat, joint.id),
            counts_per_turn: COUNTS_PER_TURN,
        };
        Topology::new(1, self.joints.iter().enumerate().map(part).collect())
    }

    /// The part number of the servo with this id.
    pub fn part_uid(&self, seat: u32, id: u8) -> PartUid {
        let mut uid = [0; 12];
        uid[..3].copy_from_slice(match self.protocol {
            ServoProtocol::Feetech => b"fts",
            ServoProtocol::Dynamixel => b"dxl",
        });
        uid[3..7].copy_from_slice(&seat_of(&self.name).to_be_bytes());
        uid[7..11].copy_from_slice(&seat.to_be_bytes());
        uid[11] = id;
        PartUid(uid)
    }

    /// The joint of a built-in arm that has this part number.
    pub fn joint_of(uid: PartUid) -> Option<ServoJoint> {
        let [.., a, b, c, d, id] = uid.0;
        let seat = u32::from_be_bytes([a, b, c, d]);
        let arm = Self::presets().into_iter().find(|arm| arm.part_uid(seat, id) == uid)?;
        arm.joints.into_iter().find(|joint| joint.id == id)
    }
}

/// The seat of an arm whose adapter has no serial number.
pub const NO_SEAT: u32 = 0;

/// A number derived from a text that distinguishes one arm from another, such as its adapter's serial number (FNV-1a).
pub fn seat_of(text: &str) -> u32 {
    text.bytes().fold(0x811C_9DC5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

/// `NAME` of an arm on any bus.
impl FromStr for ServoArm {
    type Err = UnknownArm;

    fn from_str(name: &str) -> Result<Self, UnknownArm> {
        let arms = Self::presets();
        let known = arms.iter().map(|arm| arm.name.as_str()).collect::<Vec<_>>().join(", ");
        let unknown = UnknownArm { protocol: ServoProtocol::Feetech, given: name.to_owned(), known };
        arms.into_iter().find(|arm| arm.name == name).ok_or(unknown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_is_a_tree_of_usable_servos_with_numbers_of_their_own() {
        let mut uids = std::collections::BTreeSet::new();
        for arm in ServoArm::presets() {
            for seat in [0, seat_of("FT123")] {
                let topology = arm.topology(seat).unwrap();
                assert_eq!((topology.parts.len(), topology.sensor_count), (arm.joints.len(), arm.joints.len()));
                assert!(topology.parts.iter().all(|part| uids.insert(part.uid)), "{}", arm.name);
            }
            assert!(arm.joints.iter().all(|joint| is_usable(arm.protocol, joint.model)), "{}", arm.name);
            assert!(arm.protocol.bauds().contains(&arm.baud));
            assert_eq!(ServoArm::preset(arm.protocol, Some(&arm.name)).as_ref(), Ok(&arm));
        }
        let error = ServoArm::preset(ServoProtocol::Feetech, Some("gello")).unwrap_err();
        assert!(error.to_string().contains("so101-leader"), "{error}");
        assert_eq!(ServoArm::preset(ServoProtocol::Dynamixel, None).map(|arm| arm.name), Ok("koch-leader".into()));
    }
}
