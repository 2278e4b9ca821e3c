//! Any message type with any payload, wrapped in a valid frame so that the parsers behind the checksum are reached.
#![no_main]

use firmware_protocol::{
    Decoder, DeviceMessage, Encode, EncodeError, FrameBuffer, FrameWriter, HostMessage, MAX_PAYLOAD,
};
use libfuzzer_sys::fuzz_target;

struct Raw<'a>(u8, &'a [u8]);

impl Encode for Raw<'_> {
    fn message_type(&self) -> u8 {
        self.0
    }

    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
        writer.put_bytes(self.1);
        Ok(())
    }
}

fuzz_target!(|data: &[u8]| {
    let Some((&message_type, payload)) = data.split_first() else { return };
    let mut buffer = FrameBuffer::new();
    let Ok(mut bytes) = buffer.encode(&Raw(message_type, payload)) else {
        assert!(payload.len() > MAX_PAYLOAD);
        return;
    };
    let mut decoder = Decoder::new();
    let frame = decoder.next_frame(&mut bytes).expect("what was encoded is a frame");
    assert_eq!((frame.message_type, frame.payload), (message_type, payload));
    if let Ok(message) = HostMessage::parse(frame) {
        let mut again = FrameBuffer::new();
        let mut bytes = again.encode(&message).expect("what was parsed can be encoded");
        let mut decoder = Decoder::new();
        let frame = decoder.next_frame(&mut bytes).expect("what was encoded is a frame");
        assert_eq!(HostMessage::parse(frame), Ok(message));
    }
    match DeviceMessage::parse(frame) {
        Ok(DeviceMessage::Sample(sample)) => {
            assert_eq!(sample.counts().count(), sample.sensor_count());
            assert_eq!(sample.states().count(), sample.sensor_count());
        }
        Ok(DeviceMessage::Topology(chunk)) => assert_eq!(chunk.records().count(), chunk.len()),
        _ => {}
    }
});
