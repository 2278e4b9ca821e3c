//! A stream of the wire protocol in words, piece by piece, with what is wrong with each piece that is no message.
//!
//! Pure: bytes in, lines out. `armature devices --decode` feeds it from a file or from a device.

use std::fmt::Write as _;

use armature_device::{Part, Topology};
use firmware_protocol::{
    Decoder, DeviceMessage, Frame, HostMessage, MAX_FRAME, ParseError, PartKind, RefusalReason, Sample, SensorState,
    TopologyChunk, diagnose, message_type,
};

use crate::terminal::counted;

/// Bytes of a piece that are shown at most.
const SHOWN: usize = 64;
/// From here on types are those of devices.
const FROM_DEVICE: u8 = 0x80;

/// What was decoded so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct DecodingTotals {
    /// Pieces that are good messages.
    pub(super) messages: u64,
    /// Pieces that are no frame, or no message that can be.
    pub(super) faults: u64,
    /// Good messages with something in them that cannot be.
    pub(super) doubts: u64,
}

/// Decodes a stream, whatever portions it comes in.
#[derive(Clone, Debug, Default)]
pub(super) struct Decoding {
    piece: Vec<u8>,
    /// Where the piece began, bytes from the stream's beginning.
    piece_at: u64,
    offset: u64,
    synchronised: bool,
    parts: Vec<Part>,
    epoch: Option<u16>,
    tree: Option<Topology>,
    last: Option<(u32, u64)>,
    totals: DecodingTotals,
}

impl Decoding {
    /// What was decoded so far.
    pub(super) fn totals(&self) -> DecodingTotals {
        self.totals
    }

    /// Takes bytes; appends what they mean to `lines`.
    pub(super) fn receive(&mut self, bytes: &[u8], lines: &mut Vec<String>) {
        for &byte in bytes {
            self.offset += 1;
            if byte != 0 {
                // A piece that is far too long keeps its beginning, so that it can be shown.
                if self.piece.len() <= MAX_FRAME {
                    self.piece.push(byte);
                }
                continue;
            }
            if !self.piece.is_empty() {
                self.tell(lines);
            }
            self.piece.clear();
            self.piece_at = self.offset;
            self.synchronised = true;
        }
    }

    /// The stream is over; an unfinished frame is reported.
    pub(super) fn finish(&mut self, lines: &mut Vec<String>) {
        if !self.piece.is_empty() {
            let length = self.piece.len();
            self.fault(lines, &format!("the stream ends after {length} bytes without the delimiter 00"));
        }
    }

    fn tell(&mut self, lines: &mut Vec<String>) {
        if let Some(fault) = diagnose(&self.piece) {
            let words = if self.synchronised {
                fault.to_string()
            } else {
                format!("{fault} (nothing came before it, so it may be the tail of a frame)")
            };
            return self.fault(lines, &words);
        }
        let mut decoder: Decoder = Decoder::new();
        let framed = [self.piece.as_slice(), &[0]].concat();
        // Checked just now; the decoder goes by the same rules.
        let Some(frame) = decoder.next_frame(&mut framed.as_slice()) else { return };
        let (words, doubts) = match self.words_of(frame) {
            Ok(told) => told,
            Err(error) => return self.fault(lines, &format!("the frame is intact, but {}", parse_words(&error))),
        };
        self.totals.messages += 1;
        self.totals.doubts += doubts.len() as u64;
        lines.push(format!("{:>7}  {words}", self.piece_at));
        lines.extend(doubts.iter().map(|doubt| format!("{:>7}  ✗ {doubt}", "")));
    }

    fn fault(&mut self, lines: &mut Vec<String>, words: &str) {
        self.totals.faults += 1;
        let shown = &self.piece[..self.piece.len().min(SHOWN)];
        let more = if self.piece.len() > SHOWN { " …" } else { "" };
        lines.push(format!("{:>7}  ✗ {words}", self.piece_at));
        lines.push(format!("{:>7}    {}{more}", "", hex(shown)));
    }

    /// A message in words, and what cannot be in it.
    fn words_of(&mut self, frame: Frame<'_>) -> Result<(String, Vec<String>), ParseError> {
        if frame.message_type < FROM_DEVICE {
            return Ok((host_words(&HostMessage::parse(frame)?), Vec::new()));
        }
        let mut doubts = Vec::new();
        let words = match DeviceMessage::parse(frame)? {
            DeviceMessage::Hello(hello) => {
                (self.epoch, self.tree, self.last) = (None, None, None);
                let [major, minor, patch] = hello.firmware;
                format!(
                    "hello: {:?}, protocol {}.{}, firmware {major}.{minor}.{patch}, part {}, at most {} samples a second, \
                     features {:#x}",
                    hello.name,
                    hello.protocol_major,
                    hello.protocol_minor,
                    hex(&hello.uid.0),
                    f64::from(hello.max_rate_millihertz) / 1_000.0,
                    hello.features
                )
            }
            DeviceMessage::Topology(chunk) => self.topology_words(&chunk, &mut doubts),
            DeviceMessage::TopologyChanged(changed) => format!("topology changed: epoch {}", changed.epoch),
            DeviceMessage::Sample(sample) => self.sample_words(&sample, &mut doubts),
            DeviceMessage::RateSet(rate) => {
                format!("rate set: {} samples a second", f64::from(rate.rate_millihertz) / 1_000.0)
            }
            DeviceMessage::Acknowledge(done) => format!("acknowledge: {}", type_name(done.request)),
            DeviceMessage::Pong(pong) => {
                if pong.sent_micros < pong.received_micros {
                    doubts.push("it was sent before the ping arrived".into());
                }
                format!(
                    "pong: token {:016x}, received at {} µs, sent at {} µs",
                    pong.token, pong.received_micros, pong.sent_micros
                )
            }
            DeviceMessage::Refuse(refuse) => {
                format!("refuse: {}, {}", type_name(refuse.request), reason_words(refuse.reason))
            }
        };
        Ok((words, doubts))
    }

    fn topology_words(&mut self, chunk: &TopologyChunk<'_>, doubts: &mut Vec<String>) -> String {
        if self.epoch != Some(chunk.epoch) || chunk.first_index == 0 {
            (self.epoch, self.tree) = (Some(chunk.epoch), None);
            self.parts.clear();
        }
        if usize::from(chunk.first_index) == self.parts.len() {
            self.parts.extend(chunk.records());
        } else {
            let expected = self.parts.len();
            doubts.push(format!("it starts with part {}, but part {expected} comes next", chunk.first_index));
        }
        if self.parts.len() >= usize::from(chunk.part_count) {
            match Topology::new(chunk.epoch, self.parts.clone()) {
                Ok(tree) => self.tree = Some(tree),
                Err(problem) => doubts.push(format!("this tree is impossible: {problem}")),
            }
        }
        let mut words = format!(
            "topology: epoch {}, parts {} to {} of {}",
            chunk.epoch,
            chunk.first_index,
            (usize::from(chunk.first_index) + chunk.len()).saturating_sub(1),
            chunk.part_count
        );
        for (index, part) in (chunk.first_index..).zip(chunk.records()) {
            let place = match part.parent {
                Some(parent) => format!("in outlet {} of part {parent}", part.outlet),
                None => "the root".to_owned(),
            };
            let _ = write!(
                words,
                "\n{:>11}part {index}: {}, {place}, {}, {}, {} counts per turn, number {}",
                "",
                kind_words(part.kind),
                counted(part.sensor_count.into(), "sensor", "sensors"),
                counted(part.outlet_count.into(), "outlet", "outlets"),
                part.counts_per_turn,
                hex(&part.uid.0)
            );
        }
        words
    }

    fn sample_words(&mut self, sample: &Sample<'_>, doubts: &mut Vec<String>) -> String {
        let counts: Vec<String> = sample.counts().map(|count| count.to_string()).collect();
        let sensors = counts.len();
        match &self.tree {
            None => {}
            Some(tree) if tree.epoch != sample.epoch => {
                doubts.push(format!(
                    "it refers to tree {}, but the device last described tree {}",
                    sample.epoch, tree.epoch
                ));
            }
            Some(tree) if tree.sensor_count != sensors => {
                doubts.push(format!(
                    "it has {}, but the parts described have {}",
                    sensors_words(sensors),
                    tree.sensor_count
                ));
            }
            Some(tree) => counts_within(tree, sample, doubts),
        }
        if let Some((sequence, micros)) = self.last {
            if sample.sequence > sequence && sample.device_micros < micros {
                doubts.push(format!("its clock went back from {micros} µs"));
            }
            let missing = sample.sequence.wrapping_sub(sequence).wrapping_sub(1);
            if missing > 0 && sample.sequence > sequence {
                let missing = counted(missing as usize, "sample is", "samples are");
                doubts.push(format!("{missing} missing before it"));
            }
        }
        self.last = Some((sample.sequence, sample.device_micros));
        let states: Vec<String> = sample
            .states()
            .enumerate()
            .filter(|(_, state)| *state != SensorState::Ok)
            .map(|(sensor, state)| format!("sensor {sensor} {}", state_words(state)))
            .collect();
        let states = if states.is_empty() { "all ok".to_owned() } else { states.join(", ") };
        format!(
            "sample: number {}, at {} µs, epoch {}, {}: {}; {states}",
            sample.sequence,
            sample.device_micros,
            sample.epoch,
            sensors_words(sensors),
            counts.join(" ")
        )
    }
}

/// Counts are less than a turn.
fn counts_within(tree: &Topology, sample: &Sample<'_>, doubts: &mut Vec<String>) {
    let turns = tree.parts.iter().flat_map(|p| std::iter::repeat_n(p.counts_per_turn, usize::from(p.sensor_count)));
    for (sensor, (count, turn)) in sample.counts().zip(turns).enumerate() {
        if u32::from(count) >= turn {
            doubts.push(format!("sensor {sensor} has the count {count}, but a turn has only {turn} counts"));
        }
    }
}

fn sensors_words(sensors: usize) -> String {
    counted(sensors, "sensor", "sensors")
}

fn kind_words(kind: PartKind) -> String {
    match kind {
        PartKind::Bend => "bend joint".into(),
        PartKind::Twist => "twist joint".into(),
        PartKind::TwistBendTwist => "twist-bend-twist joint".into(),
        PartKind::Splitter => "splitter".into(),
        PartKind::Other(code) => format!("part of the unknown kind {code}"),
    }
}

fn host_words(message: &HostMessage) -> String {
    match *message {
        HostMessage::HelloRequest { host_major, host_minor, host_features } => {
            format!("hello request (from the host): protocol {host_major}.{host_minor}, features {host_features:#x}")
        }
        HostMessage::TopologyRequest => "topology request (from the host)".into(),
        HostMessage::SetRate { rate_millihertz } => {
            format!("set rate (from the host): {} samples a second", f64::from(rate_millihertz) / 1_000.0)
        }
        HostMessage::Start => "start (from the host)".into(),
        HostMessage::Stop => "stop (from the host)".into(),
        HostMessage::Ping { token } => format!("ping (from the host): token {token:016x}"),
        HostMessage::Blink { uid, duration_millis } => {
            format!("blink (from the host): part {} for {duration_millis} ms", hex(&uid.0))
        }
        HostMessage::Label { uid, kind, sensor_count, outlet_count, counts_per_turn } => format!(
            "label (from the host): part {} is a {} with {} of {counts_per_turn} counts per turn and {}",
            hex(&uid.0),
            kind_words(kind),
            sensors_words(sensor_count.into()),
            counted(outlet_count.into(), "outlet", "outlets")
        ),
    }
}

fn parse_words(error: &ParseError) -> String {
    match *error {
        ParseError::UnknownType(kind) => {
            format!("type {kind:02x} is unknown in this version; hosts skip it")
        }
        ParseError::TooShort { message_type, needed, found } => format!(
            "a {} message (type {message_type:02x}) needs {needed} bytes of payload and this one has {found}",
            type_name(message_type)
        ),
        ParseError::BadValue { message_type, field, offset } => format!(
            "the field {field} at byte {offset} of the payload of this {} message (type {message_type:02x}) has an impossible value",
            type_name(message_type)
        ),
    }
}

fn type_name(kind: u8) -> &'static str {
    match kind {
        message_type::HELLO_REQUEST => "hello request",
        message_type::TOPOLOGY_REQUEST => "topology request",
        message_type::SET_RATE => "set rate",
        message_type::START => "start",
        message_type::STOP => "stop",
        message_type::PING => "ping",
        message_type::BLINK => "blink",
        message_type::HELLO => "hello",
        message_type::TOPOLOGY => "topology",
        message_type::TOPOLOGY_CHANGED => "topology changed",
        message_type::SAMPLE => "sample",
        message_type::RATE_SET => "rate set",
        message_type::ACKNOWLEDGE => "acknowledge",
        message_type::PONG => "pong",
        message_type::REFUSE => "refuse",
        _ => "unknown",
    }
}

fn reason_words(reason: RefusalReason) -> String {
    match reason {
        RefusalReason::UnknownRequest => "unknown request".into(),
        RefusalReason::Malformed => "malformed".into(),
        RefusalReason::Busy => "busy".into(),
        RefusalReason::NoSuchPart => "no such part".into(),
        RefusalReason::SensorBusFailed => "sensor bus failed".into(),
        RefusalReason::Other(code) => format!("reason {code}"),
    }
}

fn state_words(state: SensorState) -> &'static str {
    match state {
        SensorState::Ok => "ok",
        SensorState::NoData => "no data",
        SensorState::MagnetWeak => "magnet weak",
        SensorState::Outlier => "outlier",
    }
}

fn hex(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(2 * bytes.len());
    for byte in bytes {
        let _ = write!(text, "{byte:02x}");
    }
    text
}

/// The bytes that a file holds: as they are, or, if it is a text of hexadecimal digits, what they say. In such a text
/// blanks and the marks `<` and `>` mean nothing, and `#` begins a remark.
pub(super) fn bytes_of_file(content: &[u8]) -> Vec<u8> {
    let Ok(text) = std::str::from_utf8(content) else { return content.to_vec() };
    let mut digits = Vec::new();
    for line in text.lines() {
        let line = line.split_once('#').map_or(line, |(before, _)| before);
        for letter in line.chars().filter(|letter| !letter.is_whitespace() && !matches!(letter, '<' | '>')) {
            match letter.to_digit(16) {
                Some(digit) => digits.push(digit as u8),
                None => return content.to_vec(),
            }
        }
    }
    digits.chunks(2).map(|pair| pair.iter().fold(0, |byte, digit| byte << 4 | digit)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn golden() -> Vec<(&'static str, Vec<u8>)> {
        let lines =
            include_str!("../../../../firmware-protocol/golden.txt").lines().filter(|line| !line.starts_with('#'));
        lines
            .filter_map(|line| line.split_once(" = "))
            .map(|(name, hex)| (name, bytes_of_file(hex.as_bytes())))
            .collect()
    }

    fn decode(bytes: &[u8]) -> (Vec<String>, DecodingTotals) {
        let (mut decoding, mut lines) = (Decoding::default(), Vec::new());
        decoding.receive(bytes, &mut lines);
        decoding.finish(&mut lines);
        (lines, decoding.totals())
    }

    #[test]
    fn every_golden_frame_is_told_in_words() {
        for (name, bytes) in golden() {
            let (lines, totals) = decode(&bytes);
            assert_eq!((totals.messages, totals.faults), (1, 0), "{name}: {lines:?}");
            let plain = name.split("_of_").next().unwrap_or(name).replace('_', " ");
            let first = plain.split(' ').next().unwrap();
            assert!(lines[0].contains(first), "{name}: {lines:?}");
        }
        let (lines, _) = decode(&golden().into_iter().find(|(name, _)| *name == "hello").unwrap().1);
        assert_eq!(
            lines,
            [
                "      0  hello: \"Armature ½\", protocol 1.0, firmware 2.10.255, part a0a1a2a3a4a5a6a7a8a9aaab, at most \
              1000 samples a second, features 0x3"
            ]
        );
    }

    #[test]
    fn each_fault_is_told_at_its_place() {
        let start = golden().into_iter().find(|(name, _)| *name == "start").unwrap().1;
        let mut damaged = start.clone();
        damaged[3] ^= 1;
        let stream = [&start[..], &damaged, &start[2..], &start, &start[..5]].concat();
        let (lines, totals) = decode(&stream);
        assert_eq!((totals.messages, totals.faults), (2, 3), "{lines:#?}");
        assert!(lines[1].starts_with("     12  ✗ the checksum at byte 6"), "{}", lines[1]);
        assert!(
            lines[3].starts_with("     24  ✗ 9 bytes between two delimiters are too few for a frame"),
            "{}",
            lines[3]
        );
        assert!(lines[6].contains("without the delimiter"), "{}", lines[6]);
    }

    #[test]
    fn what_cannot_be_in_a_good_message_is_told() {
        let find = |wanted: &str| golden().into_iter().find(|(name, _)| *name == wanted).unwrap().1;
        // Tree 7 has 3 + 1 + 1 + 2 sensors; the sample of epoch 7 has six.
        let (lines, totals) = decode(&[find("topology"), find("sample")].concat());
        assert_eq!((totals.messages, totals.doubts), (2, 1), "{lines:#?}");
        assert!(lines[2].contains("it has 6 sensors, but the parts described have 7"), "{}", lines[2]);
        let (lines, _) = decode(&[find("topology"), find("sample_of_96")].concat());
        assert!(lines[2].contains("refers to tree 1, but the device last described tree 7"), "{}", lines[2]);
        let (lines, _) = decode(&find("topology_second_part"));
        assert!(lines[1].contains("starts with part 3, but part 0 comes next"), "{}", lines[1]);
    }

    #[test]
    fn files_are_read_as_bytes_or_as_digits() {
        assert_eq!(bytes_of_file(b"> 00 01 # a remark\n< fF\n"), [0, 1, 255]);
        assert_eq!(bytes_of_file(b"0x00"), b"0x00", "not plain digits");
        assert_eq!(bytes_of_file(&[0x88, 0x80, 0]), [0x88, 0x80, 0]);
    }

    #[test]
    fn any_bytes_are_survived_in_any_portions() {
        let mut state = 7_u64;
        let (mut decoding, mut lines) = (Decoding::default(), Vec::new());
        let frames = golden();
        for _ in 0..20_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let frame = &frames[(state >> 33) as usize % frames.len()].1;
            let cut = (state >> 20) as usize % (frame.len() + 1);
            decoding.receive(&frame[..cut], &mut lines);
            decoding.receive(&[(state >> 50) as u8], &mut lines);
            lines.clear();
        }
        decoding.receive(&vec![1; 100_000], &mut lines);
        decoding.finish(&mut lines);
        assert!(lines.last().is_some_and(|line| line.len() < 400));
    }
}
