//! Any bytes, in any portions: no panic, and the same frames however the bytes are cut.
#![no_main]

use firmware_protocol::{Decoder, DeviceMessage, HostMessage};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((&portion, stream)) = data.split_first() else { return };
    let mut in_one_go = Vec::new();
    let mut decoder = Decoder::new();
    let mut bytes = stream;
    while let Some(frame) = decoder.next_frame(&mut bytes) {
        let _ = HostMessage::parse(frame);
        match DeviceMessage::parse(frame) {
            Ok(DeviceMessage::Sample(sample)) => assert_eq!(sample.counts().count(), sample.states().count()),
            Ok(DeviceMessage::Topology(chunk)) => assert_eq!(chunk.records().count(), chunk.len()),
            _ => {}
        }
        in_one_go.push((frame.message_type, frame.payload.to_vec()));
    }
    let mut in_portions = Vec::new();
    let mut again = Decoder::new();
    for mut bytes in stream.chunks(usize::from(portion).max(1)) {
        while let Some(frame) = again.next_frame(&mut bytes) {
            in_portions.push((frame.message_type, frame.payload.to_vec()));
        }
    }
    assert_eq!(in_one_go, in_portions);
    assert_eq!(decoder.counters(), again.counters());
});
