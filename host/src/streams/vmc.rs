//! The Virtual Motion Capture Protocol: humanoids, as OSC bundles for programs that show VRM avatars.
//!
//! Bones are sent as they turn compared with a rest pose in which every bone has the axes of the model (a T-pose for
//! avatars), each relative to the recognised bone above it, in Unity's frame: left-handed, Y up, the character looks
//! along +Z, so that X changes its sign. Blend shapes that are set are sent by the names that they have in the character.

use std::fmt::Write as _;

use armature_rig::{Figure, HumanoidBone, HumanoidPart, Side};
use glam::{Quat, Vec3};
use rosc::{OscBundle, OscMessage, OscPacket, OscTime, OscType, encoder};

use super::skeleton::{StreamedPose, StreamedSkeleton};

/// A datagram of at most so many bytes crosses any Ethernet in one piece.
const MOST_BYTES: usize = 1_400;

/// OSC's word for "now".
const IMMEDIATELY: OscTime = OscTime { seconds: 0, fractional: 1 };

/// What of a skeleton is sent, prepared once.
#[derive(Debug)]
pub(super) struct VmcSkeleton {
    bones: Vec<VmcBone>,
}

#[derive(Debug)]
struct VmcBone {
    index: usize,
    parent: Option<usize>,
    name: String,
    /// Its head as seen from its parent's, at rest; the hips' in model space.
    offset: Vec3,
}

impl VmcSkeleton {
    /// `None` if it is no human, or has no hips to hang the other bones on.
    pub(super) fn new(skeleton: &StreamedSkeleton) -> Option<Self> {
        let head = |index: usize| Vec3::from(skeleton.bones[index].rest_model_from_bone.translation);
        let hips = HumanoidBone { part: HumanoidPart::Hips, side: None };
        let is_whole = skeleton.bones.iter().any(|bone| bone.humanoid == Some(hips));
        if skeleton.figure != Figure::Human || !is_whole {
            return None;
        }
        let recognised = skeleton.bones.iter().enumerate().filter_map(|(index, bone)| Some((index, bone.humanoid?)));
        let bones = recognised.map(|(index, humanoid)| {
            let parent = skeleton.humanoid_parent(index).filter(|_| humanoid != hips);
            let offset = head(index) - parent.map_or(Vec3::ZERO, head);
            VmcBone { index, parent, name: unity_name(humanoid), offset }
        });
        Some(Self { bones: bones.collect() })
    }

    /// A pose as datagrams: bundles, each short enough to travel in one piece. `alive`: seconds since the stream began.
    pub(super) fn datagrams(&self, skeleton: &StreamedSkeleton, pose: &StreamedPose, alive: f64) -> Vec<Vec<u8>> {
        let mut messages = vec![
            message("/VMC/Ext/OK", vec![OscType::Int(1)]),
            message("/VMC/Ext/T", vec![OscType::Float(alive as f32)]),
            placed("/VMC/Ext/Root/Pos", "root", Vec3::ZERO, Quat::IDENTITY),
        ];
        messages.extend(self.bones.iter().map(|bone| {
            let turn = skeleton.turn(bone.index, pose);
            let (position, rotation) = match bone.parent {
                None => (bone.offset + skeleton.shift(bone.index, pose), turn),
                Some(parent) => (bone.offset, skeleton.turn(parent, pose).inverse() * turn),
            };
            placed("/VMC/Ext/Bone/Pos", &bone.name, position, rotation)
        }));
        for (name, weight) in pose.shapes.iter() {
            let args = vec![OscType::String(name.to_owned()), OscType::Float(weight)];
            messages.push(message("/VMC/Ext/Blend/Val", args));
        }
        if !pose.shapes.is_empty() {
            messages.push(message("/VMC/Ext/Blend/Apply", Vec::new()));
        }
        bundles(messages)
    }

    /// Tells receivers that there is no pose to show: the puppet is silent.
    pub(super) fn silence(alive: f64) -> Vec<Vec<u8>> {
        bundles(vec![
            message("/VMC/Ext/OK", vec![OscType::Int(0)]),
            message("/VMC/Ext/T", vec![OscType::Float(alive as f32)]),
        ])
    }
}

fn message(address: &str, args: Vec<OscType>) -> OscMessage {
    OscMessage { addr: address.to_owned(), args }
}

fn placed(address: &str, name: &str, position: Vec3, rotation: Quat) -> OscMessage {
    let numbers = [-position.x, position.y, position.z, rotation.x, -rotation.y, -rotation.z, rotation.w];
    let mut args = vec![OscType::String(name.to_owned())];
    args.extend(numbers.map(|number| OscType::Float(number + 0.0)));
    message(address, args)
}

/// Groups messages into bundles of at most [`MOST_BYTES`].
fn bundles(messages: Vec<OscMessage>) -> Vec<Vec<u8>> {
    // A bundle starts with its name and time, and says the length of each message.
    let (start, each) = (16, 4);
    let mut datagrams = Vec::new();
    let (mut content, mut bytes) = (Vec::new(), start);
    let mut close = |content: &mut Vec<OscPacket>| {
        let bundle = OscBundle { timetag: IMMEDIATELY, content: std::mem::take(content) };
        datagrams.extend(encoder::encode(&OscPacket::Bundle(bundle)));
    };
    for message in messages {
        let packet = OscPacket::Message(message);
        let length = each + encoder::encode(&packet).map_or(0, |bytes| bytes.len());
        if bytes + length > MOST_BYTES && !content.is_empty() {
            close(&mut content);
            bytes = start;
        }
        bytes += length;
        content.push(packet);
    }
    close(&mut content);
    datagrams
}

/// What Unity calls a bone (`HumanBodyBones`).
fn unity_name(bone: HumanoidBone) -> String {
    let mut name = String::new();
    match bone.side {
        Some(Side::Left) => name.push_str("Left"),
        Some(Side::Right) => name.push_str("Right"),
        None => {}
    }
    match bone.part {
        HumanoidPart::Finger(finger, segment) => {
            let segment = ["Proximal", "Intermediate", "Distal"][usize::from(segment.clamp(1, 3)) - 1];
            let _ = write!(name, "{finger:?}{segment}");
        }
        part => {
            let _ = write!(name, "{part:?}");
        }
    }
    name
}

#[cfg(test)]
mod tests {
    use armature_rig::Finger;

    use super::*;

    #[test]
    fn bones_have_the_names_of_unity() {
        let name = |part, side| unity_name(HumanoidBone { part, side });
        assert_eq!(name(HumanoidPart::Hips, None), "Hips");
        assert_eq!(name(HumanoidPart::UpperLeg, Some(Side::Left)), "LeftUpperLeg");
        assert_eq!(name(HumanoidPart::Toes, Some(Side::Right)), "RightToes");
        assert_eq!(name(HumanoidPart::Finger(Finger::Thumb, 1), Some(Side::Right)), "RightThumbProximal");
        assert_eq!(name(HumanoidPart::Finger(Finger::Little, 2), Some(Side::Left)), "LeftLittleIntermediate");
    }

    #[test]
    fn long_poses_are_split_and_nothing_is_lost() {
        let messages: Vec<OscMessage> = (0..55)
            .map(|index| {
                placed("/VMC/Ext/Bone/Pos", &format!("Bone{index}"), Vec3::splat(index as f32), Quat::IDENTITY)
            })
            .collect();
        let datagrams = bundles(messages.clone());
        assert!(datagrams.len() > 2 && datagrams.iter().all(|bytes| bytes.len() <= MOST_BYTES));
        let mut read = Vec::new();
        for bytes in &datagrams {
            let (rest, packet) = rosc::decoder::decode_udp(bytes).unwrap();
            let OscPacket::Bundle(bundle) = packet else { panic!("{packet:?} is no bundle") };
            assert!(rest.is_empty() && bundle.timetag == IMMEDIATELY);
            read.extend(bundle.content);
        }
        assert_eq!(read, messages.into_iter().map(OscPacket::Message).collect::<Vec<_>>());
    }
}
