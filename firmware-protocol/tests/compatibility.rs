//! An old host reads a newer device, and the reverse.

use firmware_protocol::{
    Acknowledge, Decoder, DeviceMessage, Encode, EncodeError, Frame, FrameBuffer, FrameWriter, Hello, HostMessage,
    ParseError, PartKind, PartRecord, PartUid, RECORD_LENGTH, RefusalReason, Refuse, SampleMessage, SensorState,
    TopologyMessage, message_type,
};

/// The payload of a message, as a newer peer might extend it.
fn payload(message: &dyn Encode, more: &[u8]) -> Vec<u8> {
    let mut buffer = FrameBuffer::new();
    let mut bytes = buffer.encode(message).expect("the message fits a frame");
    let mut payload = Decoder::new().next_frame(&mut bytes).expect("a frame").payload.to_vec();
    payload.extend_from_slice(more);
    payload
}

#[test]
fn fields_added_behind_the_known_ones_are_ignored() {
    let host = [
        HostMessage::HELLO_REQUEST,
        HostMessage::TopologyRequest,
        HostMessage::SetRate { rate_millihertz: 5 },
        HostMessage::Start,
        HostMessage::Stop,
        HostMessage::Ping { token: 9 },
        HostMessage::Blink { uid: PartUid([3; 12]), duration_millis: 4 },
        HostMessage::Label {
            uid: PartUid([3; 12]),
            kind: PartKind::Bend,
            sensor_count: 1,
            outlet_count: 1,
            counts_per_turn: 9,
        },
    ];
    for message in host {
        let payload = payload(&message, b"newer");
        assert_eq!(HostMessage::parse(Frame { message_type: message.message_type(), payload: &payload }), Ok(message));
    }
    let acknowledge = Acknowledge { request: 4 };
    let longer = payload(&acknowledge, &[1, 2]);
    let frame = Frame { message_type: message_type::ACKNOWLEDGE, payload: &longer };
    assert_eq!(DeviceMessage::parse(frame), Ok(DeviceMessage::Acknowledge(acknowledge)));

    let hello = Hello {
        protocol_major: 1,
        protocol_minor: 200,
        features: u32::MAX,
        firmware: [9, 9, 9],
        uid: PartUid([1; 12]),
        max_rate_millihertz: 2_000_000,
        name: "newer",
    };
    let longer = payload(&hello, b"and its serial number");
    let frame = Frame { message_type: message_type::HELLO, payload: &longer };
    assert_eq!(DeviceMessage::parse(frame), Ok(DeviceMessage::Hello(hello)));

    let sample = SampleMessage {
        device_micros: 1,
        sequence: 2,
        epoch: 3,
        counts: &[7, 8],
        states: &[SensorState::Ok, SensorState::Outlier],
    };
    let longer = payload(&sample, &[0xFF; 8]);
    let Ok(DeviceMessage::Sample(sample)) =
        DeviceMessage::parse(Frame { message_type: message_type::SAMPLE, payload: &longer })
    else {
        panic!("a sample with more after it is still a sample")
    };
    assert_eq!(sample.counts().collect::<Vec<_>>(), [7, 8]);
    assert_eq!(sample.states().collect::<Vec<_>>(), [SensorState::Ok, SensorState::Outlier]);
}

#[test]
fn records_grown_in_a_later_version_are_read_by_their_stated_length() {
    let records: Vec<PartRecord> = (0..3)
        .map(|index| PartRecord {
            kind: PartKind::from_code(40 + index),
            sensor_count: 2,
            outlet: 0,
            outlet_count: 1,
            parent: index.checked_sub(1).map(u16::from),
            uid: PartUid([index; 12]),
            counts_per_turn: 4_096,
        })
        .collect();
    let message = TopologyMessage { epoch: 1, part_count: 3, first_index: 0, records: &records };
    let old = payload(&message, &[]);
    let mut newer = old[..8].to_vec();
    newer[7] = RECORD_LENGTH as u8 + 5;
    for record in old[8..].chunks(RECORD_LENGTH) {
        newer.extend_from_slice(record);
        newer.extend_from_slice(b"extra");
    }
    let frame = Frame { message_type: message_type::TOPOLOGY, payload: &newer };
    let Ok(DeviceMessage::Topology(chunk)) = DeviceMessage::parse(frame) else { panic!("topology") };
    assert_eq!(chunk.records().collect::<Vec<_>>(), records, "unknown kinds keep their number and their sensors");
}

#[test]
fn unknown_types_say_so() {
    for message_type in [0, 0x09, 0x70, 0xFF] {
        let frame = Frame { message_type, payload: &[1, 2, 3] };
        assert_eq!(HostMessage::parse(frame), Err(ParseError::UnknownType(message_type)));
        assert_eq!(DeviceMessage::parse(frame), Err(ParseError::UnknownType(message_type)));
    }
    let refuse = Frame { message_type: message_type::REFUSE, payload: &[0x70, 200] };
    let expected = Refuse { request: 0x70, reason: RefusalReason::Other(200) };
    assert_eq!(DeviceMessage::parse(refuse), Ok(DeviceMessage::Refuse(expected)));
}

#[test]
fn every_known_message_cut_short_is_an_error() {
    let golden = include_str!("../golden.txt")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .filter_map(|line| line.split_once(" = "));
    for (name, hex) in golden {
        let bytes: Vec<u8> =
            (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect();
        let mut decoder = Decoder::new();
        let whole = decoder.next_frame(&mut bytes.as_slice()).unwrap();
        for length in 0..whole.payload.len() {
            let frame = Frame { payload: &whole.payload[..length], ..whole };
            let failed = if whole.message_type < 0x80 {
                HostMessage::parse(frame).err()
            } else {
                DeviceMessage::parse(frame).err()
            };
            let Some(ParseError::TooShort { needed, found, .. }) = failed else {
                panic!("{name} cut to {length} bytes: {failed:?}")
            };
            assert!(found == length && needed > length, "{name}: {needed} needed, {found} found");
        }
    }
}

#[test]
fn impossible_values_are_named() {
    let record_length = Frame { message_type: message_type::TOPOLOGY, payload: &[0, 0, 0, 0, 0, 0, 0, 21] };
    let beyond = Frame { message_type: message_type::TOPOLOGY, payload: &[0, 0, 1, 0, 1, 0, 1, 22] };
    let mut hello = [0; 64];
    (hello[0], hello[25]) = (1, 33);
    let name_length = Frame { message_type: message_type::HELLO, payload: &hello };
    for (frame, field, offset) in
        [(record_length, "record_length", 7), (beyond, "record_count", 6), (name_length, "name_length", 25)]
    {
        let expected = ParseError::BadValue { message_type: frame.message_type, field, offset };
        assert_eq!(DeviceMessage::parse(frame), Err(expected));
    }
}

#[test]
fn a_hello_of_another_major_version_still_tells_its_version() {
    let Ok(DeviceMessage::Hello(hello)) =
        DeviceMessage::parse(Frame { message_type: message_type::HELLO, payload: &[2, 5] })
    else {
        panic!("two bytes are enough for the version")
    };
    assert_eq!((hello.protocol_major, hello.protocol_minor, hello.name), (2, 5, ""));
}

#[test]
fn a_name_that_is_no_text_is_cut_where_it_stops_being_one() {
    let mut payload = vec![0; 26];
    (payload[0], payload[25]) = (1, 4);
    payload.extend_from_slice(b"ab\xFFc");
    let frame = Frame { message_type: message_type::HELLO, payload: &payload };
    let Ok(DeviceMessage::Hello(hello)) = DeviceMessage::parse(frame) else { panic!("a hello") };
    assert_eq!(hello.name, "ab");
}

/// Some stuffing routines write one more code byte after a run of 254; their frames are accepted.
#[test]
fn a_needless_last_code_byte_is_accepted() {
    struct Full;
    impl Encode for Full {
        fn message_type(&self) -> u8 {
            0x70
        }
        fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
            writer.put_bytes(&[7; 253]);
            Ok(())
        }
    }
    let mut buffer = FrameBuffer::new();
    let short = buffer.encode(&Full).unwrap().to_vec();
    assert_eq!(short.len(), 2 + 255 + 2 + 5 + 1);
    let length = [0x80, 0x82];
    let covered = [&length, &short[2..257], &[1], &length].concat();
    let sum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&covered);
    let sum = [0, 7, 14, 21, 28].map(|shift| 0x80 | (sum >> shift) as u8 & 0x7F);
    let long = [covered.as_slice(), &sum, &[0]].concat();
    let mut decoder = Decoder::new();
    let frame = decoder.next_frame(&mut long.as_slice()).expect("accepted");
    assert_eq!((frame.message_type, frame.payload), (0x70, [7; 253].as_slice()));
}
