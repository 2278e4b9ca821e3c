//! The container: it returns what was put in, and reports what is damaged.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]

mod support;

use std::io;

use armature_rig::{JointTree, Part, PartKind, PartUid, Pose};
use armature_take::{
    EventKind, Header, InverseKinematicsHeader, PREAMBLE_BYTES, PayloadError, Problem, Record, RecordKind, Take,
    TakeError, TakeWriter, WriteError, summarize,
};
use proptest::prelude::*;
use support::{
    any_event, any_sample, any_transform, arm, arm_calibration, arm_mapping, arm_tree, bits, event, header, pose, raw,
    read, small_take,
};

/// Offsets of all records of a whole take, the end of the file last.
fn record_offsets(bytes: &[u8]) -> Vec<usize> {
    let mut offsets = vec![PREAMBLE_BYTES];
    let mut offset = PREAMBLE_BYTES;
    while offset < bytes.len() {
        let length = u32::from_le_bytes(bytes[offset + 2..offset + 6].try_into().expect("four"));
        offset += 10 + length as usize;
        offsets.push(offset);
    }
    assert_eq!(offset, bytes.len());
    offsets
}

/// CRC-32 as in ISO-HDLC (zip, PNG), bit by bit: independent of the crate's own.
fn crc_32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { (c >> 1) ^ 0xEDB8_8320 } else { c >> 1 })
    })
}

fn record(kind: u16, payload: &[u8]) -> Vec<u8> {
    let mut bytes = kind.to_le_bytes().to_vec();
    bytes.extend((payload.len() as u32).to_le_bytes());
    bytes.extend(payload);
    bytes.extend(crc_32(&bytes).to_le_bytes());
    bytes
}

fn preamble(major: u16, minor: u16) -> Vec<u8> {
    let mut bytes = b"\x8aTAKE\r\n\n".to_vec();
    bytes.extend(major.to_le_bytes());
    bytes.extend(minor.to_le_bytes());
    bytes.extend(crc_32(&bytes).to_le_bytes());
    bytes
}

/// The bytes of `small_take` with a different version at the start.
fn with_version(major: u16, minor: u16, bytes: &[u8]) -> Vec<u8> {
    [&preamble(major, minor), &bytes[PREAMBLE_BYTES..]].concat()
}

#[test]
fn a_take_reads_back_and_writes_the_same_bytes() {
    let bytes = small_take(5);
    let (take, report) = Take::read(&bytes).unwrap();
    assert!(report.is_whole(), "{report}");
    assert_eq!((report.read.samples, report.read.poses, report.read.events), (5, 5, 3));
    assert_eq!(take.header(), &header());
    assert_eq!(take.skeleton(), Some(&arm()));
    assert!(take.records().iter().any(|r| matches!(r, Record::Topology(t) if t.tree == arm_tree() && t.epoch == 1)));
    assert!(take.records().contains(&Record::Calibration(arm_calibration())));
    assert!(take.records().contains(&Record::Mapping(arm_mapping())));
    for (sequence, packed) in take.poses().enumerate() {
        assert_eq!(bits(&take.unpack(packed)), bits(&pose(sequence as u32)));
    }
    assert_eq!(take.write(Vec::new()).unwrap(), bytes);
    assert_eq!(small_take(5), bytes);
}

#[test]
fn a_summary_says_what_was_lost() {
    let summary = summarize(&read(&small_take(5)));
    assert_eq!((summary.samples, summary.poses, summary.lost_samples), (5, 5, 3));
    assert_eq!((summary.crc_errors, summary.discarded_bytes, summary.restarts, summary.reconnects), (2, 90, 0, 0));
    assert!((summary.duration_seconds - 0.04).abs() < 1e-12);
    assert!((summary.samples_per_second.unwrap() - 100.0).abs() < 1e-9);
    assert_eq!(summary.markers, [(0.04, "gut so – nochmal".to_owned())]);
    assert_eq!(summarize(&read(&small_take(1))).samples_per_second, None);
}

#[test]
fn layout_and_checksums_agree_with_an_independent_reading() {
    let bytes = small_take(3);
    assert_eq!(bytes[..PREAMBLE_BYTES], preamble(1, 0));
    let offsets = record_offsets(&bytes);
    for window in offsets.windows(2) {
        let (content, crc) = bytes[window[0]..window[1]].split_last_chunk::<4>().unwrap();
        assert_eq!(crc_32(content), u32::from_le_bytes(*crc));
    }
    let end = &bytes[offsets[offsets.len() - 2]..];
    assert_eq!(u16::from_le_bytes([end[0], end[1]]), RecordKind::End.code());
}

#[test]
fn cut_at_every_byte_keeps_every_whole_record_before() {
    let bytes = small_take(4);
    let offsets = record_offsets(&bytes);
    let (whole, _) = Take::read(&bytes).unwrap();
    for length in 0..bytes.len() {
        let read = Take::read(&bytes[..length]);
        if length < offsets[1] {
            assert!(
                matches!(read, Err(TakeError::EndsInHeader { bytes }) if bytes == length as u64),
                "{length}: {read:?}"
            );
            continue;
        }
        let (take, report) = read.unwrap();
        let before = offsets.iter().filter(|&&end| end <= length).count() - 2;
        assert_eq!(take.records(), &whole.records()[..before], "cut at {length}");
        assert!(!report.is_whole() && report.end.is_none());
        let start = offsets[before + 1];
        if start == length {
            assert_eq!(report.problems, []);
        } else {
            let [Problem::CutOff { offset, bytes: left, kind }] = report.problems[..] else {
                panic!("cut at {length}: {report:?}")
            };
            assert_eq!((offset, left), (start as u64, (length - start) as u64));
            assert_eq!(kind.is_some(), length - start >= 6);
        }
    }
}

#[test]
fn one_bad_bit_anywhere_loses_one_record() {
    let bytes = small_take(3);
    let offsets = record_offsets(&bytes);
    let (whole, _) = Take::read(&bytes).unwrap();
    for bit in 0..8 * bytes.len() {
        let mut damaged = bytes.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        let read = Take::read(&damaged);
        if bit / 8 < offsets[1] {
            assert!(read.is_err(), "bit {bit}");
            continue;
        }
        let (take, report) = read.unwrap();
        let hit = offsets.iter().filter(|&&start| start <= bit / 8).count() - 1;
        let (start, end) = (offsets[hit] as u64, offsets[hit + 1] as u64);
        assert!(!report.is_whole(), "bit {bit}");
        let named = report.problems.first();
        let last = hit + 2 == offsets.len();
        match named {
            Some(Problem::Damaged { offset, bytes, rest_unread: false, .. }) => {
                assert_eq!((*offset, *bytes), (start, end - start), "bit {bit}");
            }
            Some(Problem::CutOff { offset, .. }) => assert!(*offset == start && last, "bit {bit}: {report}"),
            other => panic!("bit {bit}: {other:?}"),
        }
        // Without the skeleton (the first record after the header) the poses are meaningless; everything else stays.
        let kept = whole
            .records()
            .iter()
            .enumerate()
            .filter(|&(i, r)| i + 1 != hit && (hit != 1 || r.kind() != RecordKind::Pose));
        assert!(take.records().iter().eq(kept.map(|(_, r)| r)), "bit {bit}");
        if hit != 1 && !last {
            assert_eq!(report.missing().unwrap().records, 1, "bit {bit}");
            assert_eq!(report.missing().unwrap().bytes, end - start, "bit {bit}");
        }
    }
}

#[test]
fn several_records_destroyed_together_are_one_damage_and_counted() {
    let bytes = small_take(6);
    let offsets = record_offsets(&bytes);
    let (first, after) = (offsets[4], offsets[9]);
    let mut damaged = bytes.clone();
    damaged[first..after].fill(0xFF);
    let (_, report) = Take::read(&damaged).unwrap();
    let lost = (after - first) as u64;
    assert_eq!(
        report.problems,
        [Problem::Damaged { offset: first as u64, bytes: lost, kind: None, rest_unread: false }]
    );
    let missing = report.missing().unwrap();
    assert_eq!((missing.records, missing.bytes), (5, lost));
    assert!(report.to_string().contains(&format!("byte {first}: {lost} bytes are damaged")), "{report}");
}

#[test]
fn a_newer_minor_version_is_read_and_its_additions_are_passed_over() {
    let bytes = small_take(2);
    let offsets = record_offsets(&bytes);
    let sample = record_of(&bytes, &offsets, RecordKind::Sample);
    let longer = record(RecordKind::Sample.code(), &[&bytes[sample.0 + 6..sample.1 - 4], &[1, 2, 3][..]].concat());
    let newer =
        [&with_version(1, 9, &bytes[..sample.0])[..], &longer, &record(700, b"something to come"), &bytes[sample.1..]]
            .concat();
    let (take, report) = Take::read(&newer).unwrap();
    assert_eq!(report.problems, []);
    assert_eq!(report.unknown[&700].count, 1);
    assert_eq!(report.unknown[&700].bytes, 17);
    assert!(report.to_string().contains("newer program"));
    assert_eq!(take.records(), Take::read(&bytes).unwrap().0.records());
}

fn record_of(bytes: &[u8], offsets: &[usize], kind: RecordKind) -> (usize, usize) {
    let is = |w: &&[usize]| u16::from_le_bytes([bytes[w[0]], bytes[w[0] + 1]]) == kind.code();
    let window = offsets.windows(2).find(is).expect("a record of this kind");
    (window[0], window[1])
}

#[test]
fn only_a_take_with_inverse_kinematics_needs_the_newer_version() {
    let version = |ik: Option<InverseKinematicsHeader>| {
        let header = Header { inverse_kinematics: ik, ..support::header() };
        let bytes = TakeWriter::new(Vec::new(), &header).unwrap().finish().unwrap();
        assert_eq!(read(&bytes).header(), &header);
        u16::from_le_bytes([bytes[10], bytes[11]])
    };
    assert_eq!(version(None), 0, "as it always was, to the last byte");
    assert_eq!(version(Some(InverseKinematicsHeader::default())), 1);
    assert_eq!(
        version(Some(InverseKinematicsHeader {
            pins: vec!["LeftFoot".into(), "Fuß".into()],
            preferences: vec!["Neck:stiff=1".into()],
            ..InverseKinematicsHeader::default()
        })),
        1
    );
    let limits = vec!["LeftLowerLeg:bend=0..140".to_string()];
    assert_eq!(version(Some(InverseKinematicsHeader { limits, ..InverseKinematicsHeader::default() })), 2);
    let settings = vec!["factor=64".to_string(), "clusters=80".into()];
    assert_eq!(version(Some(InverseKinematicsHeader { settings, ..InverseKinematicsHeader::default() })), 3);
}

#[test]
fn trailing_fields_in_our_own_version_are_unusable() {
    let bytes = small_take(1);
    let offsets = record_offsets(&bytes);
    let (start, end) = record_of(&bytes, &offsets, RecordKind::Sample);
    let longer = record(RecordKind::Sample.code(), &[&bytes[start + 6..end - 4], &[0][..]].concat());
    let (_, report) = Take::read(&[&bytes[..start], &longer, &bytes[end..]].concat()).unwrap();
    let expected = Problem::Unusable {
        offset: start as u64,
        kind: RecordKind::Sample,
        reason: PayloadError::TooLong { bytes: 1 },
    };
    assert_eq!(report.problems, [expected]);
}

#[test]
fn what_is_no_take_is_refused_with_a_remedy() {
    let bytes = small_take(1);
    assert_eq!(Take::read(b"HIERARCHY\nROOT hips").unwrap_err(), TakeError::NotATake);
    assert_eq!(Take::read(b"").unwrap_err(), TakeError::EndsInHeader { bytes: 0 });
    let other = Take::read(&with_version(2, 1, &bytes)).unwrap_err();
    assert_eq!(other, TakeError::OtherMajorVersion { major: 2, minor: 1 });
    assert!(other.to_string().contains("program that reads 2.x"));
    let no_header = [&preamble(1, 0)[..], &record(8, &[])].concat();
    assert_eq!(Take::read(&no_header).unwrap_err(), TakeError::DamagedHeader { offset: 16 });
    let bad_header = [&preamble(1, 0)[..], &record(1, &[0; 7])].concat();
    assert!(matches!(Take::read(&bad_header), Err(TakeError::BadHeader { offset: 16, .. })));
}

#[test]
fn bytes_after_the_end_are_counted_not_read() {
    let bytes = small_take(2);
    let (take, report) = Take::read(&[&bytes[..], &bytes].concat()).unwrap();
    assert_eq!(take, read(&bytes));
    let after = bytes.len() as u64;
    assert_eq!(report.problems, [Problem::AfterEnd { offset: after, bytes: after }]);
}

#[test]
fn huge_counts_in_small_records_allocate_nothing() {
    let mut bytes = small_take(1);
    let end = *record_offsets(&bytes).iter().rev().nth(1).unwrap();
    bytes.truncate(end);
    bytes.extend(record(RecordKind::Topology.code(), &[1, 0, 0xFF, 0xFF]));
    bytes.extend(record(RecordKind::Sample.code(), &[[0; 15].as_slice(), &[0xFF; 2]].concat()));
    bytes.extend(record(RecordKind::Event.code(), &[[0; 17].as_slice(), &[6, 0, 0xFF, 0xFF]].concat()));
    bytes.extend(RecordKind::Sample.code().to_le_bytes());
    bytes.extend(u32::MAX.to_le_bytes());
    let (_, report) = Take::read(&bytes).unwrap();
    assert_eq!(report.problems.len(), 4, "{report}");
    assert!(matches!(report.problems[0], Problem::Unusable { reason: PayloadError::TooManyParts { .. }, .. }));
    assert!(matches!(report.problems[1], Problem::Unusable { reason: PayloadError::TooShort { field: "counts" }, .. }));
    assert!(matches!(report.problems[2], Problem::Unusable { reason: PayloadError::TooShort { field: "marker" }, .. }));
}

/// A file of false starts, each of which claims everything after it: reading it must not take quadratic time. 16 MiB
/// would mean 10¹³ checksummed bytes; the bound makes it 1.3·10⁸.
#[test]
fn a_file_of_false_starts_is_given_up_and_says_so() {
    let mut bytes = small_take(1);
    bytes.truncate(*record_offsets(&bytes).iter().rev().nth(1).unwrap());
    let start = bytes.len() as u64;
    for _ in 0..1 << 20 {
        bytes.extend(RecordKind::Skeleton.code().to_le_bytes());
        bytes.extend(0x0080_0000_u32.to_le_bytes());
        bytes.extend([0; 10]);
    }
    let (take, report) = Take::read(&bytes).unwrap();
    assert_eq!(take.samples().count(), 1);
    let bytes = bytes.len() as u64 - start;
    let kind = Some(RecordKind::Skeleton);
    assert_eq!(report.problems, [Problem::Damaged { offset: start, bytes, kind, rest_unread: true }]);
}

/// Takes `room` bytes and then refuses, like a full disk.
struct Full {
    room: usize,
    bytes: Vec<u8>,
}

impl io::Write for Full {
    fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
        let taken = buf.len().min(self.room - self.bytes.len());
        if taken == 0 && !buf.is_empty() {
            return Err(io::ErrorKind::StorageFull.into());
        }
        self.bytes.extend(&buf[..taken]);
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_full_disk_is_said_and_nothing_is_written_after_it() {
    let mut writer = TakeWriter::new(Full { room: 300, bytes: Vec::new() }, &header()).unwrap();
    let mut written = 0;
    let error = loop {
        match writer.sample(&raw(written, u64::from(written)), None) {
            Ok(()) => written += 1,
            Err(error) => break error,
        }
    };
    assert!(matches!(error, WriteError::Io(_)));
    assert!(matches!(writer.sample(&raw(9, 9), None), Err(WriteError::CutOff)));
    let (take, report) = Take::read(&writer.abandon().bytes).unwrap();
    assert_eq!(take.samples().count(), written as usize);
    assert!(matches!(report.problems[..], [Problem::CutOff { kind: Some(RecordKind::Sample), .. }]));
}

#[test]
fn the_writer_refuses_what_the_format_cannot_hold_and_goes_on() {
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    assert!(matches!(writer.pose(0, 0, &Pose::default()), Err(WriteError::NoSkeleton)));
    writer.skeleton(&arm()).unwrap();
    assert!(matches!(writer.skeleton(&arm()), Err(WriteError::SecondSkeleton)));
    assert!(matches!(writer.pose(0, 0, &Pose::default()), Err(WriteError::BoneCount { got: 0, expected: 3 })));
    let mut uneven = raw(0, 0);
    uneven.states.pop();
    assert!(matches!(writer.sample(&uneven, None), Err(WriteError::UnevenSample { counts: 4, states: 3 })));
    let long = event(EventKind::Marker { text: "x".repeat(70_000) });
    assert!(matches!(writer.event(&long), Err(WriteError::TooMany { count: 70_000, .. })));
    let crowd = |i: usize| Part {
        uid: PartUid(std::array::from_fn(|b| if b < 2 { (i >> (8 * b)) as u8 } else { 0 })),
        kind: PartKind::Bend,
        parent: i.checked_sub(1),
        outlet: 0,
        counts_per_turn: 4096,
    };
    let crowd = JointTree::new((0..4097).map(crowd).collect()).unwrap();
    assert!(matches!(writer.topology(0, &crowd), Err(WriteError::TooMany { count: 4097, limit: 4096, .. })));
    writer.pose(0, 0, &pose(0)).unwrap();
    let take = read(&writer.finish().unwrap());
    assert_eq!(take.records().len(), 2);
}

proptest! {
    #[test]
    fn any_content_round_trips_bit_for_bit(
        samples in prop::collection::vec(any_sample(), 0..8),
        events in prop::collection::vec(any_event(), 0..4),
        poses in prop::collection::vec(prop::collection::vec(any_transform(), 3), 0..4),
        texts in (".{0,20}", ".{0,20}"),
        numbers in (prop::option::of(0.0..1e6), prop::option::of(any::<u64>()), any::<bool>(), prop::option::of(any::<i64>())),
        pins in prop::option::of((prop::collection::vec(".{0,20}", 0..3), prop::collection::vec(".{0,20}", 0..3))),
    ) {
        let header = Header {
            program_version: texts.0,
            character_name: texts.1,
            character_hash: [3; 32],
            nominal_samples_per_second: numbers.0,
            seed: numbers.1,
            virtual_clock: numbers.2,
            unix_micros: numbers.3,
            inverse_kinematics: pins.map(|(pins, preferences)| InverseKinematicsHeader { pins, preferences, ..InverseKinematicsHeader::default() }),
        };
        let mut writer = TakeWriter::new(Vec::new(), &header).unwrap();
        writer.skeleton(&arm()).unwrap();
        for sample in &samples {
            writer.sample(&sample.raw, sample.host_receive_seconds).unwrap();
        }
        let poses: Vec<Pose> = poses.into_iter().map(|parent_from_bone| Pose { parent_from_bone }).collect();
        for (i, pose) in poses.iter().enumerate() {
            writer.pose(i as u32, 5, pose).unwrap();
        }
        for event in &events {
            writer.event(event).unwrap();
        }
        let bytes = writer.finish().unwrap();
        let take = read(&bytes);
        prop_assert_eq!(take.header(), &header);
        prop_assert!(take.samples().eq(samples.iter()));
        prop_assert!(take.events().eq(events.iter()));
        prop_assert_eq!(take.poses().count(), poses.len());
        for (packed, pose) in take.poses().zip(&poses) {
            prop_assert_eq!(bits(&take.unpack(packed)), bits(pose));
        }
        prop_assert_eq!(take.write(Vec::new()).unwrap(), bytes);
    }

    #[test]
    fn damage_never_panics_and_never_invents(
        hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
        cut in prop::option::of(any::<prop::sample::Index>()),
        inserted in prop::option::of((any::<prop::sample::Index>(), prop::collection::vec(any::<u8>(), 1..40))),
    ) {
        let mut bytes = small_take(5);
        let whole = read(&bytes);
        for (at, value) in hits {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Some((at, extra)) = inserted {
            let at = at.index(bytes.len());
            bytes.splice(at..at, extra);
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok((take, report)) = Take::read(&bytes) {
            let mut rest = whole.records().iter();
            for record in take.records() {
                prop_assert!(rest.any(|r| r == record), "a record that was never written, or out of order");
            }
            prop_assert!(take.records().len() == whole.records().len() || !report.is_whole());
            let _ = report.to_string();
        }
    }

    #[test]
    fn any_payload_behind_a_good_checksum_is_survived(
        records in prop::collection::vec((0_u16..12, prop::collection::vec(any::<u8>(), 0..80)), 1..8),
        minor in 0_u16..2,
    ) {
        let small = small_take(1);
        let header_end = record_offsets(&small)[1];
        let mut bytes = with_version(1, minor, &small[..header_end]);
        for (kind, payload) in &records {
            bytes.extend(record(*kind, payload));
        }
        let (take, report) = Take::read(&bytes).unwrap();
        if minor == 0 && report.problems.is_empty() && report.unknown.is_empty() {
            let _ = take.write(Vec::new()).unwrap();
        }
    }
}
