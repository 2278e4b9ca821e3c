//! Live streams while a puppet performs: what other programs receive is what the take has.
//!
//! `ARMATURE_BPY_PYTHON` names a Python that has `bpy`, `ARMATURE_MESHIO_PYTHON` one that has `python-osc`. Without them
//! those checks print that they are skipped; in CI they fail.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Read};
use std::net::{TcpStream, UdpSocket};
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;

use armature::streams::StreamedSkeleton;
use armature_rig::{HumanoidBone, HumanoidPart, Side, Skeleton};
use armature_take::Take;
use glam::{Affine3A, Quat, Vec3};
use rosc::{OscPacket, OscType};
use serde_json::Value;
use tungstenite::Message;

use crate::common::Place;
use crate::exports::{script, tool};

const SECONDS: &str = "2";
/// Numbers travel with six digits after the point.
const ROUNDING: f32 = 2e-6;

/// A performance that streams to these targets and records itself; ends by itself.
fn perform(place: &Place, targets: &[&str]) -> Child {
    let mut arguments = vec!["run", "--device", "sim:human", "--motion", "walk+wave", "--seconds", SECONDS];
    arguments.extend(["--record", "streamed.take"]);
    targets.iter().for_each(|target| arguments.extend(["--stream", target]));
    let mut command = place.command(&arguments);
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts")
}

/// The take of a performance that has ended, and for each pose its time in microseconds.
fn recorded(place: &Place) -> (Skeleton, BTreeMap<u64, Vec<Affine3A>>) {
    let (take, report) = Take::read(&place.read("streamed.take")).unwrap();
    assert!(report.is_whole(), "{report}");
    let skeleton = take.skeleton().expect("a skeleton").clone();
    let poses = take.poses().map(|packed| {
        let mut model_from_bone = vec![Affine3A::IDENTITY; skeleton.len()];
        take.unpack(packed).forward_kinematics(&skeleton, &mut model_from_bone);
        (packed.device_micros, model_from_bone)
    });
    (skeleton.clone(), poses.collect())
}

/// Collects datagrams until none has come for a while.
fn collect(socket: UdpSocket) -> JoinHandle<Vec<Vec<u8>>> {
    socket.set_read_timeout(Some(Duration::from_mins(1))).unwrap();
    std::thread::spawn(move || {
        let (mut datagrams, mut buffer) = (Vec::new(), vec![0; 1 << 16]);
        while let Ok(length) = socket.recv(&mut buffer) {
            datagrams.push(buffer[..length].to_vec());
            socket.set_read_timeout(Some(Duration::from_secs(3))).unwrap();
        }
        datagrams
    })
}

fn micros(seconds: &Value) -> u64 {
    (seconds.as_f64().unwrap() * 1e6).round() as u64
}

fn numbers<const N: usize>(value: &Value) -> [f32; N] {
    std::array::from_fn(|index| value[index].as_f64().unwrap_or_else(|| panic!("{value} has {N} numbers")) as f32)
}

fn same_turn(a: Quat, b: Quat) -> bool {
    a.dot(b).abs() > 1.0 - 1e-6
}

fn rotation(transform: &Affine3A) -> Quat {
    transform.to_scale_rotation_translation().1
}

/// A pose as JSON against the take's.
fn assert_same_pose(text: &str, skeleton: &Skeleton, poses: &BTreeMap<u64, Vec<Affine3A>>) -> u64 {
    let message: Value = serde_json::from_str(text).unwrap();
    let (_, subject) = message.as_object().unwrap().iter().next().unwrap();
    assert_eq!(subject["Version"], 1);
    let at = micros(&subject["Time"]);
    let Some(expected) = poses.get(&at) else { return at };
    let rest = skeleton.rest_model_from_bone();
    let mut composed: Vec<Affine3A> = Vec::new();
    assert_eq!(subject["Bone"].as_array().unwrap().len(), skeleton.len());
    for (index, (bone, known)) in subject["Bone"].as_array().unwrap().iter().zip(skeleton.bones()).enumerate() {
        assert_eq!(bone["Name"], known.name.as_str());
        assert_eq!(bone["Parent"], known.parent.map_or(-1, |parent| parent as i64));
        let [scale, location] = [&bone["Scale"], &bone["Location"]].map(|v| Vec3::from(numbers::<3>(v)));
        let own =
            Affine3A::from_scale_rotation_translation(scale, Quat::from_array(numbers(&bone["Rotation"])), location);
        let model_from_bone = known.parent.map_or(own, |parent| composed[parent] * own);
        assert!(model_from_bone.abs_diff_eq(expected[index], 1e-4), "{} at {at}", known.name);
        composed.push(model_from_bone);
        let turn = rotation(&expected[index]) * rotation(&rest[index]).inverse();
        assert!(same_turn(Quat::from_array(numbers(&bone["Turn"])), turn), "{} at {at}", known.name);
        let shift = Vec3::from(expected[index].translation - rest[index].translation);
        assert!(shift.distance(Vec3::from(numbers::<3>(&bone["Shift"]))) < ROUNDING, "{} at {at}", known.name);
    }
    at
}

/// Address and arguments of each message.
type Messages = Vec<(String, Vec<Value>)>;

fn read_osc(bytes: &[u8]) -> Messages {
    let (_, packet) = rosc::decoder::decode_udp(bytes).unwrap();
    let OscPacket::Bundle(bundle) = packet else { panic!("{packet:?} is no bundle") };
    let read = bundle.content.into_iter().map(|packet| {
        let OscPacket::Message(message) = packet else { panic!("a bundle in a bundle") };
        let args = message.args.into_iter().map(|argument| match argument {
            OscType::String(text) => Value::from(text),
            OscType::Float(number) => Value::from(number),
            OscType::Int(number) => Value::from(number),
            other => panic!("{other:?} is not of this protocol"),
        });
        (message.addr, args.collect())
    });
    read.collect()
}

/// The poses of a VMC stream against the take's: what a receiver shows whose bones rest along the model's axes.
fn assert_same_humanoid(messages: &Messages, skeleton: &Skeleton, poses: &BTreeMap<u64, Vec<Affine3A>>) {
    let streamed = StreamedSkeleton::new("human", skeleton);
    let find = |part, side| {
        let wanted = Some(HumanoidBone { part, side });
        streamed.bones.iter().position(|bone| bone.humanoid == wanted).unwrap()
    };
    let chain = [
        ("Hips", find(HumanoidPart::Hips, None)),
        ("LeftUpperLeg", find(HumanoidPart::UpperLeg, Some(Side::Left))),
        ("LeftLowerLeg", find(HumanoidPart::LowerLeg, Some(Side::Left))),
        ("LeftFoot", find(HumanoidPart::Foot, Some(Side::Left))),
    ];
    let rest = skeleton.rest_model_from_bone();
    let mirrored = |v: Vec3| Vec3::new(-v.x, v.y, v.z);
    let mut shown = Affine3A::IDENTITY;
    let shown: Vec<Affine3A> = chain
        .iter()
        .map(|(name, _)| {
            let of_bone = |message: &&(String, Vec<Value>)| message.0 == "/VMC/Ext/Bone/Pos" && message.1[0] == *name;
            let (_, args) = messages.iter().rfind(of_bone).unwrap_or_else(|| panic!("{name} is missing"));
            let args = Value::from(args[1..].to_vec());
            let [x, y, z, qx, qy, qz, qw] = numbers::<7>(&args);
            shown *= Affine3A::from_rotation_translation(Quat::from_xyzw(qx, qy, qz, qw), Vec3::new(x, y, z));
            shown
        })
        .collect();
    let is_this = |pose: &Vec<Affine3A>| {
        chain.iter().zip(&shown).all(|((_, index), shown)| {
            let head = Vec3::from(pose[*index].translation);
            let turn = rotation(&pose[*index]) * rotation(&rest[*index]).inverse();
            let mirrored_turn = Quat::from_xyzw(turn.x, -turn.y, -turn.z, turn.w);
            Vec3::from(shown.translation).distance(mirrored(head)) < 1e-4 && same_turn(rotation(shown), mirrored_turn)
        })
    };
    assert!(poses.values().any(is_this), "no pose of the take is shown by {messages:?}");
    // Its left is on the left of somebody who looks along +Z in a left-handed frame.
    assert!(shown[1].translation.x < shown[0].translation.x);
}

#[test]
fn what_other_programs_receive_is_what_the_take_has() {
    let place = Place::new("streams");
    let [vmc, json] = [0; 2].map(|_| UdpSocket::bind("127.0.0.1:0").unwrap());
    let targets =
        [("vmc", &vmc), ("json", &json)].map(|(kind, s)| format!("{kind}:{}", s.local_addr().unwrap().port()));
    let [vmc, json] = [vmc, json].map(collect);
    let mut child = perform(&place, &[&targets[0], &targets[1], "ws:0"]);
    let mut notes = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    let served = notes.find_map(|line| line.strip_prefix("streaming to ws:").map(str::to_owned)).expect("an address");
    let stream = TcpStream::connect(&served).unwrap();
    let (mut socket, _) = tungstenite::client(format!("ws://{served}/"), stream).unwrap();
    let mut over_web_socket = Vec::new();
    while let Ok(message) = socket.read() {
        if let Message::Text(text) = message {
            over_web_socket.push(text.to_string());
        }
    }
    let noted: Vec<String> = notes.collect();
    let mut summary = String::new();
    child.stdout.take().unwrap().read_to_string(&mut summary).unwrap();
    assert!(child.wait().unwrap().success(), "{noted:?}");
    assert_eq!(summary.matches("streamed ").count(), 3, "{summary}");
    assert!(summary.contains("1 listener"), "{summary}");
    let (skeleton, poses) = recorded(&place);
    let [vmc, json] = [vmc, json].map(|thread| thread.join().unwrap());
    let as_text: Vec<String> = json.into_iter().map(|bytes| String::from_utf8(bytes).unwrap()).collect();
    for texts in [&as_text, &over_web_socket] {
        let times: Vec<u64> = texts.iter().map(|text| assert_same_pose(text, &skeleton, &poses)).collect();
        let recorded = times.iter().filter(|at| poses.contains_key(at)).count();
        assert!(recorded > 20, "{recorded} of {} poses are in the take", times.len());
        assert!(times.is_sorted_by(|a, b| a < b), "no pose comes twice or late");
    }
    // A pose may need several datagrams; the first begins with the state.
    let messages: Vec<Messages> = vmc.iter().map(|bytes| read_osc(bytes)).collect();
    let frames: Vec<Messages> = messages.chunk_by(|_, next| next[0].0 != "/VMC/Ext/OK").map(<[_]>::concat).collect();
    let whole: Vec<&Messages> = frames.iter().filter(|frame| frame[0].1[0] == 1).collect();
    assert!(whole.len() > 20, "{}", whole.len());
    // Poses before the take began are not in it.
    whole[whole.len() / 2..].iter().for_each(|frame| assert_same_humanoid(frame, &skeleton, &poses));
    assert_read_by_python(&place, &vmc, &messages);
}

fn assert_read_by_python(place: &Place, datagrams: &[Vec<u8>], expected: &[Messages]) {
    let Some(python) = tool("ARMATURE_MESHIO_PYTHON", "python-osc") else { return };
    let mut lines = String::new();
    for datagram in datagrams {
        datagram.iter().for_each(|byte| write!(lines, "{byte:02x}").unwrap());
        lines.push('\n');
    }
    let lines = place.write("datagrams.txt", lines);
    let result = place.path("osc.json");
    let status = Command::new(python).arg(script("osc_check.py")).args([&lines, &result]).status().unwrap();
    assert!(status.success());
    let read: Vec<Vec<Vec<Value>>> = serde_json::from_slice(&place.read("osc.json")).unwrap();
    let exact = |value: &Value| value.as_f64().map_or_else(|| value.clone(), |number| Value::from(number as f32));
    for (read, expected) in read.iter().zip(expected) {
        let expected: Vec<Vec<Value>> = expected
            .iter()
            .map(|(address, args)| std::iter::once(&Value::from(address.as_str())).chain(args).map(exact).collect())
            .collect();
        assert_eq!(read.iter().map(|m| m.iter().map(exact).collect::<Vec<_>>()).collect::<Vec<_>>(), expected);
    }
    assert_eq!(read.len(), expected.len());
}

#[test]
fn blender_follows_and_records() {
    let Some(python) = tool("ARMATURE_BPY_PYTHON", "Blender") else { return };
    let place = Place::new("blender-link");
    place.done(&["run", "--device", "sim:human", "--virtual-clock", "--seconds", "0.2", "--record", "rest.take"]);
    place.done(&["export", "rest.take", "--to", "human.glb"]);
    let extension = script("../host/blender/armature_link");
    let mut blender = Command::new(python)
        .arg(script("blender_link.py"))
        .args([extension, place.path("human.glb"), place.path("blender.json")])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(blender.stdout.take().unwrap()).lines().map_while(Result::ok);
    let port = lines.find_map(|line| line.strip_prefix("port ").map(str::to_owned)).expect("Blender listens");
    let performed = perform(&place, &[&format!("json:{port}")]).wait_with_output().unwrap();
    assert!(performed.status.success(), "{}", String::from_utf8_lossy(&performed.stderr));
    lines.for_each(|line| println!("{line}"));
    assert!(blender.wait().unwrap().success());
    let result: Value = serde_json::from_slice(&place.read("blender.json")).unwrap();
    let (skeleton, poses) = recorded(&place);
    assert_eq!(result["same_rig"], true);
    assert_eq!(result["followed"], skeleton.len());
    let rest = skeleton.rest_model_from_bone();
    let mut compared = 0;
    for shown in result["poses"].as_array().unwrap() {
        let Some(pose) = poses.get(&micros(&shown["seconds"])) else { continue };
        assert_shown(&shown["bones"], &skeleton, &rest, pose, 1e-4);
        compared += 1;
    }
    assert!(compared > 20, "{compared}");
    // What was recorded lies between the poses around each frame.
    let frames = result["frames"].as_array().unwrap();
    assert!(frames.len() > 30, "{} frames", frames.len());
    let received: Vec<u64> = result["poses"].as_array().unwrap().iter().map(|pose| micros(&pose["seconds"])).collect();
    let mut compared = 0;
    for frame in frames {
        let at = micros(&frame["seconds"]);
        // On a loaded machine poses come seldom, and a frame between them says little.
        let after = received.partition_point(|&seconds| seconds < at);
        let span = |(from, to): (&u64, &u64)| to - from;
        let apart = after.checked_sub(1).and_then(|before| received.get(before).zip(received.get(after))).map(span);
        if apart.is_none_or(|micros| micros > 40_000) {
            continue;
        }
        let (Some((_, before)), Some((_, after))) = (poses.range(..=at).next_back(), poses.range(at..).next()) else {
            continue;
        };
        let between = |(a, b): (&Affine3A, &Affine3A)| {
            let turn = rotation(a).slerp(rotation(b), 0.5);
            Affine3A::from_rotation_translation(turn, (a.translation + b.translation).to_vec3() / 2.0)
        };
        let pose: Vec<Affine3A> = before.iter().zip(after).map(between).collect();
        // Half a sample of motion, and what a stream of 60 poses a second cuts off.
        assert_shown(&frame["bones"], &skeleton, &rest, &pose, 0.02);
        compared += 1;
    }
    assert!(compared > 5, "{compared} of {} frames lie between poses that are near each other", frames.len());
}

fn assert_shown(bones: &Value, skeleton: &Skeleton, rest: &[Affine3A], pose: &[Affine3A], tolerance: f32) {
    for (index, bone) in skeleton.bones().iter().enumerate() {
        let shown = &bones[&bone.name];
        let [w, x, y, z] = numbers::<4>(&shown["turn"]);
        let turn = rotation(&pose[index]) * rotation(&rest[index]).inverse();
        // Blender's axes are (x, -z, y) of ours.
        let expected = Quat::from_xyzw(turn.x, -turn.z, turn.y, turn.w);
        let shown_turn = Quat::from_xyzw(x, y, z, w).normalize();
        // Of small angles an arc cosine keeps no digits.
        let angle = 2.0 * (shown_turn - expected).length().min((shown_turn + expected).length());
        assert!(angle < tolerance, "{}: {angle} rad", bone.name);
        let head = pose[index].translation;
        let off = Vec3::from(numbers::<3>(&shown["head"])).distance(Vec3::new(head.x, -head.z, head.y));
        assert!(off < tolerance, "{}: {off} off", bone.name);
    }
}

#[test]
fn streams_that_cannot_be_are_named() {
    let place = Place::new("no-streams");
    let run = ["run", "--device", "sim:human", "--seconds", "1", "--stream"];
    place.fails(2, "osc", &[&run[..], &["osc:1"]].concat());
    place.fails(2, "--virtual-clock", &[&run[..], &["vmc", "--virtual-clock"]].concat());
    place.fails(
        2,
        "spider",
        &["run", "--device", "sim:spider", "--character", "spider", "--seconds", "1", "--stream", "vmc"],
    );
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let target = format!("ws:{}", taken.local_addr().unwrap().port());
    place.fails(3, &target[..2], &[&run[..], &[&target]].concat());
}
