//! Streams in HID reports against `golden_reports.txt`, both ways.

use firmware_protocol::carriers::{REPORT_CAPACITY, REPORT_DESCRIPTOR, REPORT_LENGTH, read_report, write_report};
use proptest::prelude::*;

fn from_hexadecimal(text: &str) -> Vec<u8> {
    let byte = |at| u8::from_str_radix(&text[at..at + 2], 16).expect("bytes are hexadecimal");
    (0..text.len()).step_by(2).map(byte).collect()
}

fn reports_of(mut stream: &[u8]) -> Vec<Vec<u8>> {
    let mut reports = Vec::new();
    loop {
        let (report, taken) = write_report(stream);
        reports.push(report.to_vec());
        stream = &stream[taken..];
        if stream.is_empty() {
            return reports;
        }
    }
}

#[test]
fn streams_are_cut_into_reports_as_in_the_golden_file() {
    let mut checked = 0;
    for line in include_str!("../golden_reports.txt").lines().filter(|line| !line.starts_with('#')) {
        let (name, rest) = line.split_once(" = ").expect("a name");
        let (stream, reports) = rest.split_once("> ").expect("reports");
        let stream = from_hexadecimal(stream.trim());
        let golden: Vec<Vec<u8>> = reports.split(' ').map(from_hexadecimal).collect();
        assert_eq!(reports_of(&stream), golden, "{name}");
        let read: Vec<u8> = golden.iter().flat_map(|report| read_report(report).expect(name)).copied().collect();
        assert_eq!(read, stream, "{name}");
        checked += 1;
    }
    assert_eq!(checked, 7);
}

#[test]
fn what_is_no_report_is_dropped() {
    let mut report = [0xAA; REPORT_LENGTH];
    for count in 0..=u8::MAX {
        report[0] = count;
        assert_eq!(read_report(&report).is_some(), usize::from(count) <= REPORT_CAPACITY, "{count}");
    }
    report[0] = 1;
    for length in 0..REPORT_LENGTH {
        assert_eq!(read_report(&report[..length]), None, "{length}");
    }
    assert_eq!(read_report(&[1; REPORT_LENGTH + 1]), None);
}

#[test]
fn the_report_descriptor_declares_these_reports() {
    // Short items: one byte of kind, whose lowest two bits say how many bytes follow.
    let (mut at, mut items) = (0, Vec::new());
    while at < REPORT_DESCRIPTOR.len() {
        let kind = REPORT_DESCRIPTOR[at];
        let length = [0, 1, 2, 4][usize::from(kind & 3)];
        let value = REPORT_DESCRIPTOR[at + 1..][..length].iter().rev().fold(0_u32, |v, &b| v << 8 | u32::from(b));
        items.push((kind & 0xFC, value));
        at += 1 + length;
    }
    assert_eq!(items.first(), Some(&(0x04, 0xFF41)), "usage page");
    assert_eq!(items[1], (0x08, 1), "usage");
    assert_eq!((items[2], items.last()), ((0xA0, 1), Some(&(0xC0, 0))), "one collection");
    let of = |kind| items.iter().filter(|item| item.0 == kind).map(|item| item.1).collect::<Vec<_>>();
    assert_eq!((of(0x74), of(0x94)), (vec![8], vec![REPORT_LENGTH as u32]), "bits, count");
    assert_eq!((of(0x80), of(0x90)), (vec![2], vec![2]), "one input, one output");
    assert!(of(0x84).is_empty(), "no report numbers");
}

proptest! {
    #[test]
    fn every_stream_survives_its_reports(stream in proptest::collection::vec(any::<u8>(), 0..500)) {
        let read: Vec<u8> = reports_of(&stream).iter().flat_map(|report| read_report(report).unwrap().to_vec()).collect();
        prop_assert_eq!(read, stream);
    }
}
