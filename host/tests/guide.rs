//! What *Build your own puppet* says that the program says.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod common;

use common::Place;

const GUIDE: &str = include_str!("../../firmware-protocol/BUILD_YOUR_OWN_PUPPET.md");

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
        "part 1: TwistBendTwist, in outlet 0 of part 0, 3 sensors, 1 outlets, 16384 counts a turn",
        "rate set: 1000 samples a second",
        "sample: number 0, at 40100 µs, epoch 0, 15 sensors: 1821 1609",
        "acknowledge: stop",
        "16 messages, 0 pieces that are none, 0 things that cannot be",
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
    assert!(ran.out.contains(" 0 pieces that are none, 0 things"), "{}", ran.out);
    place.fails(2, "nothing.bin", &["devices", "--decode", "nothing.bin"]);
    place.fails(2, "servos", &["devices", "--decode", "feetech:/dev/none"]);
    place.write("empty", "");
    place.fails(4, "not one byte", &["devices", "--decode", "empty"]);
}
