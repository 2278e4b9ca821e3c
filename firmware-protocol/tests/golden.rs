//! Every message against `golden.txt`, both ways: encoding gives those bytes, decoding them gives the message.

use std::collections::BTreeMap;

use firmware_protocol::{
    Acknowledge, Decoder, DeviceMessage, Encode, FrameBuffer, Hello, HostMessage, PartKind, PartRecord, PartUid, Pong,
    RateSet, RefusalReason, Refuse, SampleMessage, SensorState, TopologyChanged, TopologyMessage, message_type,
};

const UID: PartUid = PartUid([0xA0, 0xA1, 0xA2, 0xA3, 0xA4, 0xA5, 0xA6, 0xA7, 0xA8, 0xA9, 0xAA, 0xAB]);

fn golden() -> BTreeMap<&'static str, Vec<u8>> {
    let lines = include_str!("../golden.txt").lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines
        .map(|line| {
            let (name, hex) = line.split_once(" = ").expect("a line reads: name = bytes");
            let byte = |at| u8::from_str_radix(&hex[at..at + 2], 16).expect("bytes are hexadecimal");
            (name, (0..hex.len()).step_by(2).map(byte).collect())
        })
        .collect()
}

fn host_messages() -> Vec<(&'static str, HostMessage)> {
    vec![
        ("hello_request", HostMessage::HELLO_REQUEST),
        ("topology_request", HostMessage::TopologyRequest),
        ("set_rate", HostMessage::SetRate { rate_millihertz: 1_000_000 }),
        ("start", HostMessage::Start),
        ("stop", HostMessage::Stop),
        ("ping", HostMessage::Ping { token: 0x0123_4567_89AB_CDEF }),
        ("blink", HostMessage::Blink { uid: UID, duration_millis: 1_500 }),
        (
            "label",
            HostMessage::Label {
                uid: UID,
                kind: PartKind::TwistBendTwist,
                sensor_count: 3,
                outlet_count: 1,
                counts_per_turn: 4_096,
            },
        ),
    ]
}

fn short_device_messages() -> Vec<(&'static str, DeviceMessage<'static>)> {
    let hello = Hello {
        protocol_major: 1,
        protocol_minor: 0,
        features: 3,
        firmware: [2, 10, 255],
        uid: UID,
        max_rate_millihertz: 1_000_000,
        name: "Armature ½",
    };
    vec![
        ("hello", DeviceMessage::Hello(hello)),
        ("hello_without_name", DeviceMessage::Hello(Hello { features: 0, name: "", ..hello })),
        ("topology_changed", DeviceMessage::TopologyChanged(TopologyChanged { epoch: 8 })),
        ("rate_set", DeviceMessage::RateSet(RateSet { rate_millihertz: 999_999 })),
        ("acknowledge", DeviceMessage::Acknowledge(Acknowledge { request: message_type::START })),
        (
            "pong",
            DeviceMessage::Pong(Pong {
                token: 0x0123_4567_89AB_CDEF,
                received_micros: 1_000_000,
                sent_micros: 1_000_040,
            }),
        ),
        ("refuse", DeviceMessage::Refuse(Refuse { request: message_type::BLINK, reason: RefusalReason::NoSuchPart })),
    ]
}

fn parts() -> [PartRecord; 5] {
    let part = |kind: PartKind, sensor_count, outlet, outlet_count, parent, last, counts_per_turn| {
        let mut uid = UID;
        uid.0[11] = last;
        PartRecord { kind, sensor_count, outlet, outlet_count, parent, uid, counts_per_turn }
    };
    [
        part(PartKind::Splitter, 0, 0, 5, None, 1, 0),
        part(PartKind::TwistBendTwist, 3, 4, 1, Some(0), 2, 16_384),
        part(PartKind::Bend, 1, 0, 1, Some(1), 3, 4_096),
        part(PartKind::Twist, 1, 1, 1, Some(0), 4, 65_536),
        part(PartKind::Other(9), 2, 2, 3, Some(0), 5, 1_000),
    ]
}

fn topologies(parts: &[PartRecord]) -> Vec<(&'static str, TopologyMessage<'_>)> {
    let whole = TopologyMessage { epoch: 7, part_count: 5, first_index: 0, records: parts };
    vec![
        ("topology_of_nothing", TopologyMessage { epoch: 0, part_count: 0, first_index: 0, records: &[] }),
        ("topology", whole),
        ("topology_second_part", TopologyMessage { first_index: 3, records: &parts[3..], ..whole }),
    ]
}

struct OwnedSample {
    name: &'static str,
    device_micros: u64,
    sequence: u32,
    epoch: u16,
    counts: Vec<u16>,
    states: Vec<SensorState>,
}

fn samples() -> Vec<OwnedSample> {
    use SensorState::{MagnetWeak, NoData, Ok, Outlier};
    let sample = |name, device_micros, sequence, epoch, counts, states| OwnedSample {
        name,
        device_micros,
        sequence,
        epoch,
        counts,
        states,
    };
    vec![
        sample("sample_of_nothing", 0, 0, 0, vec![], vec![]),
        sample(
            "sample",
            1_234_567_890_123,
            u32::MAX,
            7,
            vec![0, 1, 255, 256, 16_383, 65_535],
            vec![Ok, NoData, MagnetWeak, Outlier, Ok, MagnetWeak],
        ),
        sample("sample_of_96", 5_000, 5, 1, (0..96).map(|i| (641 * i + 1) % 16_384).collect(), vec![Ok; 96]),
        sample(
            "sample_with_full_run",
            0x0101_0101_0101_0101,
            0x0101_0101,
            0x0101,
            (0..120).map(|i| 0x0101 + i).collect(),
            vec![Outlier; 120],
        ),
    ]
}

fn check_encoding(golden: &mut BTreeMap<&'static str, Vec<u8>>, name: &str, message: &dyn Encode) -> Vec<u8> {
    let expected = golden.remove(name).unwrap_or_else(|| panic!("golden.txt has no {name}"));
    let mut buffer = FrameBuffer::new();
    assert_eq!(buffer.encode(message).as_deref(), Ok(expected.as_slice()), "{name}");
    expected
}

/// The decoder's view of one frame, handed to `check`.
fn decode(name: &str, bytes: &[u8], check: impl Fn(firmware_protocol::Frame<'_>)) {
    let mut decoder = Decoder::new();
    let mut rest = bytes;
    check(decoder.next_frame(&mut rest).unwrap_or_else(|| panic!("{name} is not a frame")));
    assert!(decoder.next_frame(&mut rest).is_none());
    assert_eq!((decoder.counters().frames, decoder.counters().bytes_discarded), (1, 0), "{name}");
}

#[test]
fn every_message_is_written_and_read_as_in_the_golden_file() {
    let mut golden = golden();
    let mut types = std::collections::BTreeSet::new();
    for (name, message) in host_messages() {
        let bytes = check_encoding(&mut golden, name, &message);
        types.insert(message.message_type());
        decode(name, &bytes, |frame| assert_eq!(HostMessage::parse(frame), Ok(message), "{name}"));
    }
    for (name, message) in short_device_messages() {
        let encodable: &dyn Encode = match &message {
            DeviceMessage::Hello(m) => m,
            DeviceMessage::TopologyChanged(m) => m,
            DeviceMessage::RateSet(m) => m,
            DeviceMessage::Acknowledge(m) => m,
            DeviceMessage::Pong(m) => m,
            DeviceMessage::Refuse(m) => m,
            DeviceMessage::Topology(_) | DeviceMessage::Sample(_) => unreachable!("checked separately"),
        };
        let bytes = check_encoding(&mut golden, name, encodable);
        types.insert(encodable.message_type());
        decode(name, &bytes, |frame| assert_eq!(DeviceMessage::parse(frame), Ok(message), "{name}"));
    }
    for (name, message) in topologies(&parts()) {
        let bytes = check_encoding(&mut golden, name, &message);
        types.insert(message.message_type());
        decode(name, &bytes, |frame| {
            let Ok(DeviceMessage::Topology(chunk)) = DeviceMessage::parse(frame) else { panic!("{name}") };
            let found = (chunk.epoch, chunk.part_count, chunk.first_index, chunk.len());
            assert_eq!(found, (message.epoch, message.part_count, message.first_index, message.records.len()));
            assert_eq!(chunk.records().collect::<Vec<_>>(), message.records, "{name}");
        });
    }
    for sample in &samples() {
        let bytes = check_sample(&mut golden, sample);
        types.insert(message_type::SAMPLE);
        decode(sample.name, &bytes, |frame| read_sample(sample, frame));
    }
    assert!(golden.is_empty(), "golden.txt has messages that are not checked: {:?}", golden.keys());
    assert_eq!(types, (0x01..=0x08).chain(0x81..=0x88).collect(), "a message type without golden bytes");
}

fn check_sample(golden: &mut BTreeMap<&'static str, Vec<u8>>, sample: &OwnedSample) -> Vec<u8> {
    let message = SampleMessage {
        device_micros: sample.device_micros,
        sequence: sample.sequence,
        epoch: sample.epoch,
        counts: &sample.counts,
        states: &sample.states,
    };
    check_encoding(golden, sample.name, &message)
}

fn read_sample(expected: &OwnedSample, frame: firmware_protocol::Frame<'_>) {
    let name = expected.name;
    let Ok(DeviceMessage::Sample(sample)) = DeviceMessage::parse(frame) else { panic!("{name}") };
    assert_eq!(
        (sample.device_micros, sample.sequence, sample.epoch),
        (expected.device_micros, expected.sequence, expected.epoch)
    );
    assert_eq!(sample.counts().collect::<Vec<_>>(), expected.counts, "{name}");
    assert_eq!(sample.states().collect::<Vec<_>>(), expected.states, "{name}");
    for sensor in 0..expected.counts.len() {
        assert_eq!(sample.count(sensor), Some(expected.counts[sensor]), "{name}");
        assert_eq!(sample.state(sensor), Some(expected.states[sensor]), "{name}");
    }
    let beyond = expected.counts.len();
    assert_eq!((sample.count(beyond), sample.state(beyond), sample.count(usize::MAX / 2)), (None, None, None));
}
