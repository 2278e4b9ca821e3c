//! *Build your own puppet* shows what the reference firmware sends, byte by byte.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use firmware_protocol::{Decoder, DeviceMessage, FrameBuffer, HostMessage, SampleMessage, SensorState};

const GUIDE: &str = include_str!("../BUILD_YOUR_OWN_PUPPET.md");

/// One entry of a dump.
#[derive(Debug)]
struct Said {
    by_host: bool,
    bytes: Vec<u8>,
    /// The time in microseconds that its remark gives.
    micros: Option<u64>,
}

/// The contents of the blocks with this mark, in order.
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

/// The conversation of the protocol walkthrough; damaged frames come after it.
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
    // What the text reads from them.
    assert_eq!((told[5][0], told[5][15]), (0x84, 15));
    assert!(GUIDE.contains("fifteen sensors") && GUIDE.contains("eight parts"));
}

/// Eight bits, a start and a stop bit for each byte.
#[test]
fn the_guide_states_what_a_line_carries() {
    let sample = SampleMessage {
        device_micros: u64::MAX,
        sequence: u32::MAX,
        epoch: u16::MAX,
        counts: &[u16::MAX; 96],
        states: &[SensorState::Ok; 96],
    };
    let bits = 10 * FrameBuffer::new().encode(&sample).expect("it fits a frame").len();
    let (full, slow) = (bits * 1_000 * 100 / 3_000_000, 115_200 / bits);
    let line = GUIDE.split_once("A 3 Mbaud line").expect("the line's limits").1.split_once("\n*").expect("they end").0;
    assert!(line.contains(&format!("{full} % full")), "{full} %");
    assert!(line.replace('\n', " ").contains(&format!("manages {slow} ")), "{slow} a second");
}

#[test]
fn the_reference_firmware_sends_what_the_guide_shows() {
    let board = Path::new(env!("CARGO_MANIFEST_DIR")).join("reference-firmware/board_script.c");
    hold_the_conversation("guide_firmware", &[board]);
}

/// The chip that the guide's board is for: `board_script.c` without what the guide shows.
const CHIP: &str = r"
int chip_can_send(void)
{
    return 1;
}

void chip_send(uint8_t byte)
{
    putchar(byte);
}
";

#[test]
fn the_board_of_the_guide_holds_the_same_conversation() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (board, chip) = (folder.join("guide_board.c"), folder.join("guide_chip.c"));
    let [shown] = blocks(GUIDE, "c board")[..] else { panic!("the guide shows one board") };
    std::fs::write(&board, shown).unwrap();
    let script = include_str!("../reference-firmware/board_script.c");
    // Everything but sending and waiting, under the chip's names.
    let kept: String = script
        .split("\n\n")
        .filter(|function| {
            !["hardware_wait", "hardware_received_micros", "hardware_send", "hardware_flush"]
                .iter()
                .any(|name| function.contains(&format!("{name}(")))
        })
        .map(|function| function.to_owned() + "\n\n")
        .collect();
    let renamed = kept
        .replace("uint64_t hardware_micros", "uint32_t chip_micros")
        .replace("return now;", "return (uint32_t)now;")
        .replace("hardware_start", "chip_start")
        .replace("hardware_receive", "chip_receive");
    let declared = "void chip_start(void);\nuint32_t chip_micros(void);\nint chip_receive(void);\n\
                    int chip_can_send(void);\nvoid chip_send(uint8_t byte);\n";
    let include = "#include \"hardware.h\"\n";
    let renamed = renamed.replace(include, &(include.to_owned() + declared));
    std::fs::write(&chip, renamed + CHIP).unwrap();
    hold_the_conversation("guide_board", &[board, chip]);
}

/// Builds the firmware with these files as its board, tells it what the host says in the guide, and compares the answers.
fn hold_the_conversation(name: &str, board: &[PathBuf]) {
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("reference-firmware");
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-O1", "-I"]).arg(&here).arg("-o").arg(&program);
    compiler.args(["puppet.c", "synthetic.c"].map(|file| here.join(file))).args(board);
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
