//! *Build your own puppet* shows what the reference firmware sends, byte by byte.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use firmware_protocol::{Decoder, DeviceMessage, HostMessage};

const GUIDE: &str = include_str!("../BUILD_YOUR_OWN_PUPPET.md");

/// One thing said in a dump.
#[derive(Debug)]
struct Said {
    by_host: bool,
    bytes: Vec<u8>,
    /// The microseconds that its remark gives.
    micros: Option<u64>,
}

/// The content of the blocks with this mark, in order.
fn blocks<'t>(text: &'t str, mark: &str) -> Vec<&'t str> {
    let begin = format!("```{mark}\n");
    text.split(&begin).skip(1).map(|rest| rest.split_once("\n```").expect("each block is closed").0).collect()
}

fn bytes_of(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|pair| u8::from_str_radix(pair, 16).expect("digits")).collect()
}

fn micros_in(remark: &str) -> Option<u64> {
    remark.trim().split_once(" µs").and_then(|(number, _)| number.parse().ok())
}

fn said(block: &str) -> Vec<Said> {
    let mut said: Vec<Said> = Vec::new();
    for line in block.lines() {
        let (text, remark) = line.split_once('#').unwrap_or((line, ""));
        match text.trim_start().chars().next() {
            Some(mark @ ('<' | '>')) => {
                let bytes = bytes_of(&text[1..]);
                said.push(Said { by_host: mark == '>', bytes, micros: micros_in(remark) });
            }
            Some(_) => said.last_mut().expect("a line begins it").bytes.extend(bytes_of(text)),
            None => {}
        }
    }
    said
}

/// The conversation of the walk through the protocol; what stands behind it are damaged frames.
fn conversation() -> Vec<Said> {
    let walk = GUIDE.split_once("## Check it").expect("the chapter is there").0;
    blocks(walk, "dump").into_iter().flat_map(said).collect()
}

fn payload(bytes: &[u8]) -> Vec<u8> {
    let mut decoder = Decoder::new();
    let mut rest = bytes;
    let frame = decoder.next_frame(&mut rest).expect("a whole frame");
    let plain = [&[frame.message_type], frame.payload].concat();
    assert!(rest.is_empty() && decoder.counters().bytes_discarded == 0, "one frame and nothing else: {bytes:02x?}");
    plain
}

#[test]
fn every_frame_of_the_guide_is_a_message() {
    let conversation = conversation();
    assert_eq!(conversation.iter().filter(|said| said.by_host).count(), 6);
    for said in &conversation {
        let mut decoder: Decoder = Decoder::new();
        let frame = decoder.next_frame(&mut said.bytes.as_slice()).expect("a whole frame");
        if said.by_host {
            assert!(HostMessage::parse(frame).is_ok() && said.micros.is_some(), "{said:02x?}");
        } else {
            assert!(DeviceMessage::parse(frame).is_ok(), "{said:02x?}");
        }
    }
    let unstuffed = blocks(GUIDE, "unstuffed");
    let device: Vec<&Said> = conversation.iter().filter(|said| !said.by_host).collect();
    let told: Vec<Vec<u8>> = device.iter().map(|said| payload(&said.bytes)).collect();
    assert_eq!(unstuffed.iter().map(|block| bytes_of(block)).collect::<Vec<_>>(), [told[2].clone(), told[5].clone()]);
    // What the text reads out of them.
    assert_eq!((told[5][0], told[5][15]), (0x84, 15));
    assert!(GUIDE.contains("fifteen sensors") && GUIDE.contains("eight parts"));
}

#[test]
fn the_reference_firmware_sends_what_the_guide_shows() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("reference-firmware");
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("guide_firmware");
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-O1", "-o"]).arg(&program);
    compiler.args(["puppet.c", "synthetic.c", "board_script.c"].map(|file| here.join(file)));
    let Ok(compiled) = compiler.output() else {
        println!("SKIPPED: there is no C compiler `cc`");
        return;
    };
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let conversation = conversation();
    let mut script = String::new();
    for said in conversation.iter().filter(|said| said.by_host) {
        let digits: Vec<String> = said.bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        script.extend([said.micros.expect("a time").to_string(), " ".into(), digits.join(" "), "\n".into()]);
    }
    script += "60000\n";
    let mut child = Command::new(&program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it runs");
    child.stdin.take().expect("its input").write_all(script.as_bytes()).expect("it listens");
    let sent = child.wait_with_output().expect("it ends").stdout;
    let shown: Vec<u8> = conversation.iter().filter(|said| !said.by_host).flat_map(|said| said.bytes.clone()).collect();
    assert_eq!(sent, shown);
}
