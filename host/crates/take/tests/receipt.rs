//! The receipt says what was put into a take on purpose.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]

mod support;

use armature_rig::{Calibration, Filter, PartSettings, PartUid};
use armature_take::{EventKind, TakeWriter, receipt};
use support::{arm_calibration, arm_tree, event, header, raw, read};

/// A device at 200 Hz whose clock is 80 ppm slow, that measures with a known jitter, loses samples and stops for half a
/// second, and a line that delays one sample in ten by 3 ms.
#[test]
fn a_receipt_of_a_take_with_known_faults() {
    let mut calibration: Calibration = arm_calibration();
    calibration.filter = "one-euro:2,1".parse().unwrap();
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    writer.topology(1, &arm_tree()).unwrap();
    writer.calibration(&calibration).unwrap();
    let (mut micros, mut written) = (5_000_000_u64, 0);
    for n in 0..4_000_u32 {
        micros += 5_000;
        if n == 2_000 {
            micros += 500_000;
        }
        if [100, 101, 900].contains(&n) {
            continue;
        }
        let off = if n % 2 == 0 { 40 } else { 0 };
        let host = (micros + off) as f64 * 1e-6 * (1.0 + 80e-6) + if n % 10 == 3 { 3e-3 } else { 0.0 };
        writer.sample(&raw(n, micros + off), Some(host)).unwrap();
        written += 1;
    }
    writer.event(&event(EventKind::LostSamples { count: 3, after_sequence: 899 })).unwrap();
    writer.event(&event(EventKind::Posing { p50_micros: 170, p99_micros: 420, max_micros: 3_000 })).unwrap();
    let take = read(&writer.finish().unwrap());
    let got = receipt(&take);
    assert_eq!(got.posing.map(|posing| (posing.p99_seconds * 1e6).round()), Some(420.0));
    assert_eq!((got.samples, got.lost_samples, got.missing_numbers), (written, 3, 3));
    assert_eq!((got.gaps.len(), got.restarts), (1, 0));
    let gap = got.gaps[0];
    assert!((gap.end_seconds - gap.start_seconds - 0.505).abs() < 1e-4, "{gap:?}");
    let jitter = got.jitter.unwrap();
    assert!((jitter.p99 - 80.0).abs() < 1.0 && jitter.max < 100.0, "{jitter:?}");
    let arrival = got.arrival.unwrap();
    assert!((arrival.drift_ppm - 80.0).abs() < 4.0 * arrival.drift_error_ppm, "{arrival:?}");
    assert!(arrival.drift_error_ppm < 5.0, "{arrival:?}");
    assert!((arrival.late_p99_seconds - 3e-3).abs() < 1e-4 && arrival.late_median_seconds < 1e-4, "{arrival:?}");
    let [filter] = &got.filters[..] else { panic!("{:?}", got.filters) };
    let expected = Filter::lag_seconds(&calibration.filter, 0.5, jitter.period * 1e-6);
    assert!((filter.lag_seconds[0] - expected).abs() < 1e-9 && filter.part.is_none(), "{filter:?}");
    let words = got.to_string();
    for said in
        ["a second", "3 lost", "a gap of 0.505 s", "3.0 ms late", "ppm", "0.17 ms after the last byte", "filter lag"]
    {
        assert!(words.contains(said), "{said:?}: {words}");
    }
}

#[test]
fn a_receipt_says_what_it_cannot_know() {
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    let empty = receipt(&read(&writer.finish().unwrap()));
    assert_eq!((empty.samples, empty.rate, empty.arrival, empty.jitter), (0, None, None, None));
    assert!(empty.to_string().contains("no rate"));
    writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    let mut calibration = arm_calibration();
    calibration.filter = Filter::None;
    let settings = PartSettings { filter: Some("hold:200".parse().unwrap()), ..PartSettings::default() };
    calibration.set_part_settings(PartUid([2; 12]), settings);
    writer.topology(1, &arm_tree()).unwrap();
    writer.calibration(&calibration).unwrap();
    for n in 0..10 {
        writer.sample(&raw(n, 10_000 * u64::from(n)), None).unwrap();
    }
    let got = receipt(&read(&writer.finish().unwrap()));
    assert_eq!((got.arrival, got.filters.len()), (None, 1));
    assert_eq!(got.filters[0].part, Some(PartUid([2; 12])));
    assert!((got.rate.unwrap() - 100.0).abs() < 1e-9);
    assert!(got.to_string().contains("drift of the clock unknown"), "{got}");
}
