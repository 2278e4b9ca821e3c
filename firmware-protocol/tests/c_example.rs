//! The C code in the documentation writes the same frames as this crate.

use std::process::Command;

use firmware_protocol::{Encode, EncodeError, FrameBuffer, FrameWriter};

/// The payload byte at this position: no zeros for the first kind, ever more of them for the others.
fn payload_byte(kind: usize, at: usize) -> u8 {
    if kind > 0 && at % (kind * 97) == kind { 0 } else { (at % 255) as u8 + 1 }
}

const LENGTHS: [usize; 14] = [0, 1, 2, 16, 252, 253, 254, 255, 507, 508, 509, 761, 1_015, 1_024];

const MAIN: &str = r#"
#include <stdio.h>
int main(void)
{
    static const size_t lengths[] = {LENGTHS};
    static uint8_t payload[1024], wire[1041];
    for (size_t kind = 0; kind < 4; kind++)
        for (size_t l = 0; l < sizeof lengths / sizeof *lengths; l++) {
            for (size_t at = 0; at < lengths[l]; at++)
                payload[at] = kind > 0 && at % (kind * 97) == kind ? 0 : (uint8_t)(at % 255 + 1);
            size_t length = armature_frame(wire, (uint8_t)kind, payload, lengths[l]);
            for (size_t at = 0; at < length; at++)
                printf("%02x", wire[at]);
            printf("\n");
        }
    return 0;
}
"#;

struct Raw(u8, Vec<u8>);

impl Encode for Raw {
    fn message_type(&self) -> u8 {
        self.0
    }

    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
        writer.put_bytes(&self.1);
        Ok(())
    }
}

#[test]
fn the_documented_c_writes_the_same_frames() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (source, program) = (folder.join("c_example.c"), folder.join("c_example"));
    let lengths = LENGTHS.map(|length| length.to_string()).join(", ");
    let text = [include_str!("../c/frame.c"), &MAIN.replace("LENGTHS", &lengths)].concat();
    std::fs::write(&source, text).unwrap();
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-O1", "-o"]).arg(&program).arg(&source);
    let Ok(compiled) = compiler.output() else {
        println!("SKIPPED: there is no C compiler `cc`");
        return;
    };
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let output = String::from_utf8(Command::new(&program).output().unwrap().stdout).unwrap();
    let mut lines = output.lines();
    for kind in 0..4 {
        for length in LENGTHS {
            let message = Raw(kind as u8, (0..length).map(|at| payload_byte(kind, at)).collect());
            let mut buffer = FrameBuffer::new();
            let bytes = buffer.encode(&message).unwrap();
            let line = lines.next().expect("a line for each frame");
            let byte = |at| u8::from_str_radix(&line[at..at + 2], 16).expect("hexadecimal");
            let written: Vec<u8> = (0..line.len()).step_by(2).map(byte).collect();
            assert_eq!(written, bytes, "kind {kind}, {length} bytes");
        }
    }
    assert_eq!(lines.next(), None);
}
