//! The messages of a log: frame transforms and joint states as Foxglove publishes them, and raw samples of our own, as
//! Protocol Buffers with their descriptions.

use armature_rig::SensorState;
use glam::{DQuat, DVec3};

use super::protobuf::Message;
use super::readings::Row;

/// Seconds and nanoseconds since 1970.
#[derive(Clone, Copy)]
pub(super) struct Timestamp {
    pub(super) seconds: u64,
    pub(super) nanos: u32,
}

impl Timestamp {
    fn encoded(self) -> Message {
        Message::default().number(1, self.seconds).number(2, self.nanos.into())
    }
}

/// A frame in another one.
pub(super) struct FrameTransform<'a> {
    pub(super) parent: &'a str,
    pub(super) child: &'a str,
    pub(super) place: DVec3,
    pub(super) turn: DQuat,
}

/// `foxglove.FrameTransforms`
pub(super) fn frame_transforms(time: Timestamp, transforms: &[FrameTransform]) -> Message {
    transforms.iter().fold(Message::default(), |all, own| {
        let place = Message::default().double(1, own.place.x).double(2, own.place.y).double(3, own.place.z);
        let turn = own.turn;
        let turn = Message::default().double(1, turn.x).double(2, turn.y).double(3, turn.z).double(4, turn.w);
        let frame = Message::default().message(1, &time.encoded()).text(2, own.parent).text(3, own.child);
        all.message(1, &frame.message(4, &place).message(5, &turn))
    })
}

/// `foxglove.JointStates`: names and angles, radians.
pub(super) fn joint_states<'a>(time: Timestamp, joints: impl Iterator<Item = (&'a str, f64)>) -> Message {
    joints.fold(Message::default().message(1, &time.encoded()), |all, (name, angle)| {
        all.message(2, &Message::default().text(1, name).given_double(2, Some(angle)))
    })
}

/// A sample: counts and states in the order of the channel's `joints`; states are 0 ok, 1 no data, 2 magnet weak, 3
/// outlier, 255 not plugged in.
pub(super) fn raw_sample(time: Timestamp, row: &Row, state: impl Fn(SensorState) -> u8) -> Message {
    let sample = &row.sample.raw;
    let cells = || row.readings.iter();
    Message::default()
        .message(1, &time.encoded())
        .number(2, sample.sequence.into())
        .number(3, sample.device_micros)
        .given_double(4, row.sample.host_receive_seconds)
        .number(5, sample.epoch.into())
        .numbers(6, cells().map(|cell| cell.map_or(0, |cell| cell.count.into())))
        .numbers(7, cells().map(|cell| cell.map_or(255, |cell| state(cell.state).into())))
}

/// Types of fields, by the numbers that descriptions have for them.
#[derive(Clone, Copy)]
enum Type {
    Double = 1,
    Int64 = 3,
    Uint64 = 4,
    Int32 = 5,
    String = 9,
    Message = 11,
    Uint32 = 13,
}

/// A file of descriptions: its name and package, the files it needs, and one message.
struct Described {
    name: &'static str,
    package: &'static str,
    needs: &'static [&'static str],
    message: &'static str,
    fields: &'static [Field],
}

/// A field's name, number and type; the name of a message type; whether there are several, or it may be missing.
type Field = (&'static str, u64, Type, &'static str, Count);

#[derive(Clone, Copy, PartialEq, Eq)]
enum Count {
    One,
    Optional,
    Many,
}

const TIME: &str = "google/protobuf/timestamp.proto";
const TIMESTAMP: &str = ".google.protobuf.Timestamp";
const FILES: [Described; 8] = [
    Described {
        name: TIME,
        package: "google.protobuf",
        needs: &[],
        message: "Timestamp",
        fields: &[("seconds", 1, Type::Int64, "", Count::One), ("nanos", 2, Type::Int32, "", Count::One)],
    },
    Described {
        name: "foxglove/Vector3.proto",
        package: "foxglove",
        needs: &[],
        message: "Vector3",
        fields: &[
            ("x", 1, Type::Double, "", Count::One),
            ("y", 2, Type::Double, "", Count::One),
            ("z", 3, Type::Double, "", Count::One),
        ],
    },
    Described {
        name: "foxglove/Quaternion.proto",
        package: "foxglove",
        needs: &[],
        message: "Quaternion",
        fields: &[
            ("x", 1, Type::Double, "", Count::One),
            ("y", 2, Type::Double, "", Count::One),
            ("z", 3, Type::Double, "", Count::One),
            ("w", 4, Type::Double, "", Count::One),
        ],
    },
    Described {
        name: "foxglove/FrameTransform.proto",
        package: "foxglove",
        needs: &["foxglove/Quaternion.proto", "foxglove/Vector3.proto", TIME],
        message: "FrameTransform",
        fields: &[
            ("timestamp", 1, Type::Message, TIMESTAMP, Count::One),
            ("parent_frame_id", 2, Type::String, "", Count::One),
            ("child_frame_id", 3, Type::String, "", Count::One),
            ("translation", 4, Type::Message, ".foxglove.Vector3", Count::One),
            ("rotation", 5, Type::Message, ".foxglove.Quaternion", Count::One),
        ],
    },
    Described {
        name: "foxglove/FrameTransforms.proto",
        package: "foxglove",
        needs: &["foxglove/FrameTransform.proto"],
        message: "FrameTransforms",
        fields: &[("transforms", 1, Type::Message, ".foxglove.FrameTransform", Count::Many)],
    },
    Described {
        name: "foxglove/JointState.proto",
        package: "foxglove",
        needs: &[],
        message: "JointState",
        fields: &[
            ("name", 1, Type::String, "", Count::One),
            ("position", 2, Type::Double, "", Count::Optional),
            ("velocity", 3, Type::Double, "", Count::Optional),
            ("acceleration", 4, Type::Double, "", Count::Optional),
            ("effort", 5, Type::Double, "", Count::Optional),
        ],
    },
    Described {
        name: "foxglove/JointStates.proto",
        package: "foxglove",
        needs: &["foxglove/JointState.proto", TIME],
        message: "JointStates",
        fields: &[
            ("timestamp", 1, Type::Message, TIMESTAMP, Count::One),
            ("joints", 2, Type::Message, ".foxglove.JointState", Count::Many),
        ],
    },
    Described {
        name: "armature/RawSample.proto",
        package: "armature",
        needs: &[TIME],
        message: "RawSample",
        fields: &[
            ("timestamp", 1, Type::Message, TIMESTAMP, Count::One),
            ("sequence", 2, Type::Uint32, "", Count::One),
            ("device_micros", 3, Type::Uint64, "", Count::One),
            ("host_seconds", 4, Type::Double, "", Count::Optional),
            ("epoch", 5, Type::Uint32, "", Count::One),
            ("counts", 6, Type::Uint32, "", Count::Many),
            ("states", 7, Type::Uint32, "", Count::Many),
        ],
    },
];

/// What a reader needs to know of a message: the descriptions of its file and of those that it needs, in that order.
pub(super) fn description(message: &str) -> Vec<u8> {
    let mut names: Vec<&str> = Vec::new();
    let is_it = |file: &&Described| message.strip_prefix(file.package).is_some_and(|rest| rest[1..] == *file.message);
    let mut open: Vec<&Described> = FILES.iter().filter(is_it).collect();
    while let Some(file) = open.pop() {
        // A file that is needed again comes before all that need it.
        names.retain(|known| *known != file.name);
        names.push(file.name);
        open.extend(FILES.iter().filter(|other| file.needs.contains(&other.name)));
    }
    let needed = names.iter().rev().filter_map(|name| FILES.iter().find(|file| file.name == *name));
    needed.fold(Message::default(), |all, file| all.message(1, &described(file))).into_bytes()
}

fn described(file: &Described) -> Message {
    let optional = || file.fields.iter().filter(|field| field.4 == Count::Optional);
    let mut message = Message::default().text(1, file.message);
    for &(name, number, kind, type_name, count) in file.fields {
        let label = if count == Count::Many { 3 } else { 1 };
        let field = Message::default().text(1, name).number(3, number).number(4, label).number(5, kind as u64);
        let mut field = field.text(6, type_name);
        if let Some(oneof) = optional().position(|own| own.0 == name) {
            field = field.given_number(9, oneof as u64).number(17, 1);
        }
        message = message.message(2, &field);
    }
    for field in optional() {
        message = message.message(8, &Message::default().text(1, &format!("_{}", field.0)));
    }
    let head = Message::default().text(1, file.name).text(2, file.package);
    file.needs.iter().fold(head, |head, name| head.text(3, name)).message(4, &message).text(12, "proto3")
}
