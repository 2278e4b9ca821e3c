//! The C code in the documentation reads every golden frame as this crate does, and writes it again byte for byte.

use std::io::Write;
use std::process::{Command, Stdio};

use firmware_protocol::Decoder;

const MAIN: &str = r#"
#include <stdio.h>
int main(void)
{
    static uint8_t piece[2048], plain[2048], wire[2048];
    size_t length = 0;
    int byte;
    while ((byte = getchar()) != EOF) {
        if (byte != 0) {
            if (length < sizeof piece)
                piece[length++] = (uint8_t)byte;
            continue;
        }
        int found = armature_unframe(piece, length, plain);
        length = 0;
        if (found <= 0) {
            printf("none none\n");
            continue;
        }
        for (int i = 0; i < found; i++)
            printf("%02x", plain[i]);
        printf(" ");
        size_t written = armature_frame(wire, plain[0], plain + 1, (size_t)found - 1);
        for (size_t i = 0; i < written; i++)
            printf("%02x", wire[i]);
        printf("\n");
    }
    return 0;
}
"#;

/// Compiles the two files with the compiler's sanitizers; `None` if there is no compiler.
fn program(name: &str) -> Option<std::path::PathBuf> {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (source, program) = (folder.join(format!("{name}.c")), folder.join(name));
    let text = [include_str!("../c/frame.c"), include_str!("../c/unframe.c"), MAIN].concat();
    std::fs::write(&source, text).expect("the folder can be written");
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-O1", "-fsanitize=address,undefined", "-o"]);
    let Ok(compiled) = compiler.arg(&program).arg(&source).output() else {
        println!("SKIPPED: there is no C compiler `cc`");
        return None;
    };
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    Some(program)
}

/// For each piece, type and payload, and the frame written again; `None` for a piece that is not a frame.
fn read_by_c(program: &std::path::Path, bytes: &[u8]) -> Vec<Option<(Vec<u8>, Vec<u8>)>> {
    let mut child =
        Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("the program runs");
    let mut input = child.stdin.take().expect("its input");
    let sent = bytes.to_vec();
    let writer = std::thread::spawn(move || input.write_all(&sent));
    let output = child.wait_with_output().expect("its output");
    writer.join().expect("no panic").expect("it reads all");
    assert!(output.status.success(), "the C goes out of bounds");
    let text = String::from_utf8(output.stdout).expect("hexadecimal");
    text.lines()
        .map(|line| line.split_once(' ').expect("two words"))
        .map(|(plain, wire)| (plain != "none").then(|| (from_hexadecimal(plain), from_hexadecimal(wire))))
        .collect()
}

fn from_hexadecimal(text: &str) -> Vec<u8> {
    let byte = |at| u8::from_str_radix(&text[at..at + 2], 16).expect("hexadecimal");
    (0..text.len()).step_by(2).map(byte).collect()
}

fn golden() -> Vec<Vec<u8>> {
    let lines = include_str!("../golden.txt").lines().filter(|line| !line.starts_with('#'));
    lines.filter_map(|line| line.split_once(" = ")).map(|(_, frame)| from_hexadecimal(frame)).collect()
}

fn read_by_rust(mut bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut decoder: Decoder = Decoder::new();
    let mut found = Vec::new();
    while let Some(frame) = decoder.next_frame(&mut bytes) {
        found.push([&[frame.message_type], frame.payload].concat());
    }
    found
}

#[test]
fn every_golden_frame_is_read_and_written_again() {
    let Some(program) = program("c_golden") else { return };
    let frames = golden();
    assert!(frames.len() > 15, "{} golden frames", frames.len());
    let read = read_by_c(&program, &frames.concat());
    assert_eq!(read.len(), frames.len());
    let by_rust = read_by_rust(&[&[0], &frames.concat()[..]].concat());
    for ((by_c, frame), by_rust) in read.iter().zip(&frames).zip(&by_rust) {
        let (plain, wire) = by_c.as_ref().expect("a golden frame is a frame");
        assert_eq!((plain, wire), (by_rust, frame));
    }
}

#[test]
fn damaged_frames_are_refused_as_by_the_rust_side() {
    let Some(program) = program("c_damaged") else { return };
    let (mut noise, mut seed) = (Vec::new(), 1_u64);
    for _ in 0..60 {
        for frame in golden() {
            let mut frame = frame;
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let at = (seed >> 33) as usize % frame.len();
            match seed >> 61 {
                0..=3 => frame[at] ^= 1 << (seed >> 58 & 7),
                4 => drop(frame.remove(at)),
                5 => frame.insert(at, (seed >> 20) as u8),
                _ => {}
            }
            noise.extend(frame);
        }
    }
    noise.push(0);
    let by_c: Vec<Vec<u8>> = read_by_c(&program, &noise).into_iter().flatten().map(|(plain, _)| plain).collect();
    let by_rust = read_by_rust(&noise);
    assert!(by_rust.len() > 300, "{}", by_rust.len());
    assert_eq!(by_c, by_rust);
}
