//! Whatever can be written is read back the same; reading arbitrary bytes never panics.

use firmware_protocol::{
    Decoder, DeviceMessage, Encode, EncodeError, Frame, FrameBuffer, FrameWriter, Hello, HostMessage, MAX_FRAME,
    MAX_PAYLOAD, MAX_RECORDS, MAX_SENSORS, MIN_FRAME, PartKind, PartRecord, PartUid, SampleMessage, SensorState,
    encode_into, frame_length, sample_payload_length, topology_messages,
};
use proptest::prelude::*;

/// Any type with any payload.
#[derive(Debug)]
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

fn check_raw(message: &Raw) -> usize {
    let mut buffer = FrameBuffer::new();
    let bytes = buffer.encode(message).expect("the payload fits a frame").to_vec();
    assert_eq!(bytes.iter().position(|&byte| byte == 0), Some(bytes.len() - 1), "zero only at the end");
    assert!(bytes.len() <= frame_length(message.1.len()));

    let mut singly = vec![0; bytes.len()];
    let mut writer = FrameWriter::new(&mut singly, message.0);
    message.1.iter().for_each(|&byte| writer.put_u8(byte));
    assert_eq!(writer.finish(), Ok(bytes.len()));
    assert_eq!(singly, bytes, "byte by byte and in one go");

    for length in [bytes.len() - 1, bytes.len() / 2, 0] {
        assert_eq!(encode_into(message, &mut singly[..length]), Err(EncodeError::BufferTooSmall));
    }
    let mut decoder = Decoder::new();
    let frame = decoder.next_frame(&mut bytes.as_slice()).expect("a frame");
    assert_eq!(frame, Frame { message_type: message.0, payload: &message.1 });
    bytes.len()
}

/// Bytes with many zeros, and with none for long stretches.
fn payload() -> impl Strategy<Value = Vec<u8>> {
    let byte = |zeros| prop_oneof![zeros => Just(0u8), 10 => any::<u8>()];
    prop_oneof![
        prop::collection::vec(byte(0), 0..=MAX_PAYLOAD),
        prop::collection::vec(1u8.., 0..=MAX_PAYLOAD),
        prop::collection::vec(byte(10), 0..=MAX_PAYLOAD),
    ]
}

fn state() -> impl Strategy<Value = SensorState> {
    (0u8..4).prop_map(SensorState::from_code)
}

fn part() -> impl Strategy<Value = PartRecord> {
    let numbers = (any::<u8>(), any::<u8>(), any::<u8>(), any::<u8>(), 0..u16::MAX, any::<bool>());
    (numbers, any::<[u8; 12]>(), any::<u32>()).prop_map(
        |((kind, sensor_count, outlet, outlet_count, parent, root), uid, counts_per_turn)| PartRecord {
            kind: PartKind::from_code(kind),
            sensor_count,
            outlet,
            outlet_count,
            parent: (!root).then_some(parent),
            uid: PartUid(uid),
            counts_per_turn,
        },
    )
}

proptest! {
    #[test]
    fn any_payload_comes_back(message_type: u8, payload in payload()) {
        check_raw(&Raw(message_type, payload));
    }

    #[test]
    fn any_sample_comes_back(
        device_micros: u64, sequence: u32, epoch: u16,
        readings in prop::collection::vec((any::<u16>(), state()), 0..=MAX_SENSORS),
    ) {
        let (counts, states): (Vec<u16>, Vec<SensorState>) = readings.into_iter().unzip();
        let message = SampleMessage { device_micros, sequence, epoch, counts: &counts, states: &states };
        let mut buffer = FrameBuffer::new();
        let bytes = buffer.encode(&message).unwrap();
        prop_assert!(bytes.len() <= frame_length(sample_payload_length(counts.len())));
        let mut decoder = Decoder::new();
        let frame = decoder.next_frame(&mut &*bytes).expect("a frame");
        let Ok(DeviceMessage::Sample(sample)) = DeviceMessage::parse(frame) else { panic!("a sample") };
        prop_assert_eq!((sample.device_micros, sample.sequence, sample.epoch), (device_micros, sequence, epoch));
        prop_assert_eq!(sample.counts().collect::<Vec<_>>(), counts);
        prop_assert_eq!(sample.states().collect::<Vec<_>>(), states);
    }

    #[test]
    fn any_tree_comes_back(epoch: u16, parts in prop::collection::vec(part(), 0..200)) {
        let mut buffer = FrameBuffer::new();
        let mut decoder = Decoder::new();
        let mut found = Vec::new();
        for message in topology_messages(epoch, &parts) {
            let frame = decoder.next_frame(&mut buffer.encode(&message).unwrap()).expect("a frame");
            let Ok(DeviceMessage::Topology(chunk)) = DeviceMessage::parse(frame) else { panic!("topology") };
            prop_assert_eq!((chunk.epoch, usize::from(chunk.part_count)), (epoch, parts.len()));
            prop_assert_eq!(usize::from(chunk.first_index), found.len());
            found.extend(chunk.records());
        }
        prop_assert_eq!(found, parts);
    }

    #[test]
    fn any_hello_comes_back(features: u32, firmware: [u8; 3], uid: [u8; 12], max_rate_millihertz: u32, name in "\\PC{0,8}") {
        let hello = Hello { protocol_major: 1, protocol_minor: 9, features, firmware, uid: PartUid(uid), max_rate_millihertz, name: &name };
        let mut buffer = FrameBuffer::new();
        let mut decoder = Decoder::new();
        let frame = decoder.next_frame(&mut buffer.encode(&hello).unwrap()).expect("a frame");
        prop_assert_eq!(DeviceMessage::parse(frame), Ok(DeviceMessage::Hello(hello)));
    }

    #[test]
    fn any_bytes_are_parsed_without_panic(message_type in prop_oneof![0u8..12, 0x80u8..0x8C, any::<u8>()], payload: Vec<u8>) {
        let frame = Frame { message_type, payload: &payload };
        let _ = HostMessage::parse(frame);
        match DeviceMessage::parse(frame) {
            Ok(DeviceMessage::Sample(sample)) => {
                prop_assert_eq!(sample.counts().count(), sample.sensor_count());
                prop_assert_eq!(sample.states().count(), sample.sensor_count());
            }
            Ok(DeviceMessage::Topology(chunk)) => prop_assert_eq!(chunk.records().count(), chunk.len()),
            _ => {}
        }
    }
}

/// Runs of exactly 254 bytes, the longest a code byte can stand for, and their neighbours.
#[test]
fn runs_at_the_limit_of_a_code_byte_come_back() {
    for run in [252, 253, 254, 255, 506, 507, 508, 509, 761, 762, 1_016, 1_017] {
        for zeros_behind in 0..3 {
            let mut payload = vec![0x55; run];
            payload.extend(vec![0; zeros_behind]);
            check_raw(&Raw(0x55, payload.clone()));
            payload.push(0x66);
            check_raw(&Raw(0x55, payload));
        }
    }
}

#[test]
fn the_shortest_and_the_longest_frame_have_the_stated_lengths() {
    assert_eq!(check_raw(&Raw(1, vec![])), MIN_FRAME);
    assert_eq!(check_raw(&Raw(1, vec![1; MAX_PAYLOAD])), MAX_FRAME);
    assert_eq!((MIN_FRAME, MAX_FRAME), (12, 1_040));
    let too_long = Raw(1, vec![1; MAX_PAYLOAD + 1]);
    assert_eq!(FrameBuffer::new().encode(&too_long).err(), Some(EncodeError::PayloadTooLong));
}

#[test]
fn messages_that_contradict_themselves_are_not_sent() {
    let mut buffer = FrameBuffer::new();
    let sample = |counts, states| SampleMessage { device_micros: 0, sequence: 0, epoch: 0, counts, states };
    let states = vec![SensorState::Ok; MAX_SENSORS + 1];
    let counts = vec![0; MAX_SENSORS + 1];
    assert_eq!(buffer.encode(&sample(&counts, &states)).err(), Some(EncodeError::PayloadTooLong));
    assert_eq!(buffer.encode(&sample(&counts[..3], &states[..2])).err(), Some(EncodeError::Inconsistent));
    assert!(buffer.encode(&sample(&counts[..MAX_SENSORS], &states[..MAX_SENSORS])).is_ok());
    assert_eq!((MAX_SENSORS, MAX_RECORDS), (448, 46));
    let hello = Hello {
        protocol_major: 1,
        protocol_minor: 0,
        features: 0,
        firmware: [0; 3],
        uid: PartUid([0; 12]),
        max_rate_millihertz: 1,
        name: "a name of more than thirty-two bytes",
    };
    assert_eq!(buffer.encode(&hello).err(), Some(EncodeError::Inconsistent));
}

/// The arithmetic of the crate's documentation.
#[test]
fn thirty_two_three_axis_joints_at_one_kilohertz_fit_three_megabaud() {
    const BITS_A_BYTE: usize = 10;
    let frame = frame_length(sample_payload_length(32 * 3));
    assert_eq!(frame, 244);
    let bits_a_second = frame * BITS_A_BYTE * 1_000;
    assert_eq!(bits_a_second, 2_440_000);
    assert!((bits_a_second as f64 / 3e6 - 0.813).abs() < 0.001, "81.3 % of the line");

    let counts = [u16::MAX; 96];
    let message = SampleMessage {
        device_micros: u64::MAX,
        sequence: 0,
        epoch: 1,
        counts: &counts,
        states: &[SensorState::Outlier; 96],
    };
    assert_eq!(FrameBuffer::new().encode(&message).unwrap().len(), frame, "whatever the sensors say");
}
