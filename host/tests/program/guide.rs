//! What *Build your own puppet* says that the program says.

use std::io::{Read, Write};
use std::net::TcpListener;

use crate::common::Place;
use armature_sim::serve::{self, Background, Options, ServeSettings};
use firmware_protocol::{Decoder, FrameBuffer, HostMessage, RefusalReason, Refuse};

const GUIDE: &str = include_str!("../../../firmware-protocol/BUILD_YOUR_OWN_PUPPET.md");

/// The content of the blocks with this mark, in order.
fn blocks<'t>(text: &'t str, mark: &str) -> Vec<&'t str> {
    let begin = format!("```{mark}\n");
    text.split(&begin).skip(1).map(|rest| rest.split_once("\n```").unwrap().0).collect()
}

#[test]
fn the_walk_through_the_protocol_is_decoded_without_a_fault() {
    let place = Place::new("guide-walk");
    let (walk, check) = GUIDE.split_once("## Check it").unwrap();
    place.write("dump.txt", blocks(walk, "dump").join("\n"));
    let ran = place.done(&["devices", "--decode", "dump.txt"]);
    for told in [
        "hello request (from the host): protocol 1.0",
        "hello: \"Reference firmware\", protocol 1.0",
        "topology: epoch 0, parts 0 to 7 of 8",
        "part 1: twist-bend-twist joint, in outlet 0 of part 0, 3 sensors, 1 outlet, 16384 counts per turn",
        "rate set: 1000 samples a second",
        "sample: number 0, at 40100 µs, epoch 0, 15 sensors: 1821 1609",
        "acknowledge: stop",
        "16 messages, 0 unreadable pieces, 0 contradictions",
    ] {
        assert!(ran.out.contains(told), "{told}: {}", ran.out);
    }
    let (dumps, tells) = (blocks(check, "dump"), blocks(check, "told"));
    assert_eq!((dumps.len(), tells.len()), (2, 2));
    for (dump, told) in dumps.into_iter().zip(tells) {
        place.write("damaged.txt", dump);
        let ran = place.fails(3, "1 fault", &["devices", "--decode", "damaged.txt"]);
        let lines: Vec<&str> = ran.out.lines().map(str::trim_start).collect();
        let expected: Vec<&str> = told.lines().map(str::trim_start).collect();
        assert_eq!(lines[..lines.len() - 1], expected, "{}", ran.out);
    }
}

#[test]
fn a_simulated_puppet_is_decoded_over_a_real_line() {
    let place = Place::new("guide-live");
    let ran = place.done(&["devices", "--decode", "sim:hand", "--listen", "1.5"]);
    for told in ["hello: \"Simulated puppet\"", "topology: epoch 0", "rate set: 10 samples", "sample: number 3"] {
        assert!(ran.out.contains(told), "{told}: {}", ran.out);
    }
    assert!(ran.out.contains(" 0 unreadable pieces, 0 contradictions"), "{}", ran.out);
    place.fails(2, "nothing.bin", &["devices", "--decode", "nothing.bin"]);
    place.fails(2, "servos", &["devices", "--decode", "feetech:/dev/none"]);
    place.write("empty", "");
    place.fails(4, "nothing arrived", &["devices", "--decode", "empty"]);
}

#[test]
fn the_guide_states_the_limits_that_hold() {
    let grouped = armature::terminal::grouped;
    let limits = GUIDE.split_once("Limits: ").unwrap().1.split_once("\n\n").unwrap().0;
    for limit in [firmware_protocol::MAX_SENSORS, 65_534, armature_device::MAX_PARTS] {
        assert!(limits.contains(&grouped(limit)), "{limit}: {limits}");
    }
    for option in ["--clock-step", "--clock-stand"] {
        assert!(GUIDE.contains(option) && Place::new("guide-limits").done(&["sim", "--help"]).out.contains(option));
    }
}

/// The address of a device that refuses everything, once.
fn refusing_device() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        let (mut line, _) = listener.accept().unwrap();
        let (mut decoder, mut frames, mut bytes) = (Decoder::default(), FrameBuffer::default(), [0; 256]);
        while let Ok(read @ 1..) = line.read(&mut bytes) {
            let mut rest = &bytes[..read];
            while let Some(frame) = decoder.next_frame(&mut rest) {
                let request = frame.message_type;
                assert!(HostMessage::parse(frame).is_ok(), "message {request} is one of a host");
                let refusal = Refuse { request, reason: RefusalReason::SensorBusFailed };
                if line.write_all(frames.encode(&refusal).unwrap()).is_err() {
                    return;
                }
            }
        }
    });
    address
}

#[test]
fn a_device_that_refuses_everything_is_device_trouble_and_is_not_called_silent() {
    let place = Place::new("guide-refused");
    let ran =
        place.fails(4, "refuses the hello request", &["devices", "--decode", &refusing_device(), "--listen", "1"]);
    assert!(ran.out.contains(" 0 unreadable pieces, 0 contradictions"), "{}", ran.out);
    let ran = place.fails(4, "refuses the hello request", &["run", "--device", &refusing_device(), "--seconds", "1"]);
    assert!(!ran.err.contains("nothing for") && !ran.err.contains("silent"), "{}", ran.err);
}

#[test]
fn a_settings_folder_that_cannot_be_written_does_not_stop_a_puppet() {
    let place = Place::new("guide-read-only");
    // The folder of settings cannot be made where a file has its name.
    place.write("armature", "");
    let puppet = Options { puppet: "hand".into(), ..Options::default() }.puppet().unwrap();
    let tcp = serve::Place::Tcp("127.0.0.1:0".into());
    let served = Background::start(puppet, tcp, ServeSettings::default()).unwrap();
    let ran = place.done(&["run", "--device", served.address(), "--character", "hand", "--seconds", "0.3"]);
    let note = ran.err.split_once("the calibration is not saved").unwrap_or_else(|| panic!("{ran:?}")).1;
    assert!(note.contains("calibration.toml") && note.contains("--calibration FILE"), "{note}");
}
