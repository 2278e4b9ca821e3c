//! `armature calibrate` with simulated puppets: it finds the truth.

use crate::common::Place;
use armature_formats::settings::read_calibration;
use armature_sim::{Body, sweep_stops};

const SWEEP: [&str; 6] = ["--step", "zero,sweep", "--countdown", "0.5", "--sweep-seconds", "9"];

#[test]
fn zero_and_sweep_find_what_the_simulator_knows() {
    let place = Place::new("calibrate-sweep");
    let call = [&["calibrate", "--device", "sim:hand", "--virtual-clock", "-o", "hand.toml"][..], &SWEEP].concat();
    let ran = place.done(&call);
    assert!(ran.out.contains("zero: 28 of 28 measured") && ran.out.contains("sweep: 28 of 28 measured"), "{}", ran.out);
    let calibration = read_calibration(&place.read("hand.toml")).unwrap();
    let body = Body::preset("hand", 1).unwrap();
    let mut seen = 0;
    for (index, part) in body.parts().iter().enumerate() {
        let Some(sensors) = calibration.part(armature_rig::PartUid(part.uid.0)) else { continue };
        for (sensor, slot) in sensors.iter().zip(body.sensors(index)) {
            let (most, least) = sweep_stops(slot);
            let range = sensor.range.unwrap();
            let span = f64::from(range.span_counts) / 16_384.0 * std::f64::consts::TAU;
            assert!((span - (most - least)).abs() < 0.01, "sensor {slot}: {span} instead of {most} to {least}");
            assert!(!sensor.reversed, "sensor {slot}");
            let low = sensor.angle(range.first_counts, 16_384).unwrap();
            assert!((low - least).abs() < 0.01, "sensor {slot}: the lower stop is at {low} instead of {least}");
            seen += 1;
        }
    }
    assert_eq!(seen, 28);
    // The next call adds to what is known, and keeps the previous file.
    let heading = ["calibrate", "--device", "sim:hand", "--virtual-clock", "-o", "hand.toml", "--step", "heading"];
    let ran = place.done(&heading);
    assert!(ran.out.contains("heading: 1 of 1 measured"), "{}", ran.out);
    let again = read_calibration(&place.read("hand.toml")).unwrap();
    assert!(again.parts().zip(calibration.parts()).all(|(now, before)| now == before), "zeros and ranges stay");
    // `run` uses it and does not zero again.
    let run = ["run", "--device", "sim:hand", "--virtual-clock", "--seconds", "1", "--calibration", "hand.toml"];
    let ran = place.done(&[&run[..], &["--filter", "one-euro", "-r", "a.take"]].concat());
    assert!(ran.out.contains("filter     one-euro:2,1,1") && ran.out.contains("ms behind"), "{}", ran.out);
    assert!(place.done(&["replay", "a.take"]).code == 0, "the filter is in the take: it replays bit for bit");
    let kept = read_calibration(&place.read("hand.toml")).unwrap();
    assert!(kept.parts().zip(calibration.parts()).all(|(now, before)| now == before));
    assert_eq!(kept.filter, calibration.filter, "the filter of one run is not kept");
    place.done(&[&run[..], &["--filter", "hold:20", "--save-filter"]].concat());
    let kept = read_calibration(&place.read("hand.toml")).unwrap();
    assert_eq!(kept.filter.to_string(), "hold:20");
    place.fails(2, "--filter", &[&run[..], &["--save-filter"]].concat());
}

#[test]
fn a_real_line_and_a_real_clock_do_as_well() {
    let place = Place::new("calibrate-live");
    let call = ["calibrate", "--device", "sim:spider", "-o", "spider.toml", "--countdown", "0.3"];
    let ran = place.done(&call);
    assert!(ran.out.contains("zero: 43 of 43 measured"), "{}", ran.out);
    assert!(ran.err.contains("zero: hold the puppet still in its rest pose"), "{}", ran.err);
    assert_eq!(read_calibration(&place.read("spider.toml")).unwrap().parts().count(), 25);
    // A calibrated puppet needs no rest pose, another one does.
    let run = ["run", "--device", "sim:spider", "--character", "spider", "--seconds", "0.2", "--calibration"];
    let calibrated = place.done(&[&run[..], &["spider.toml"]].concat());
    assert!(calibrated.err.contains("connected to") && !calibrated.err.contains("rest pose"), "{calibrated:?}");
    let zeroed = place.done(&run[..run.len() - 1]);
    assert!(zeroed.err.contains("hold the rest pose"), "{zeroed:?}");
}

#[test]
fn what_cannot_be_measured_is_told_and_changes_nothing() {
    let place = Place::new("calibrate-bad");
    let virtually = ["calibrate", "--device", "sim:hand", "--virtual-clock", "-o", "c.toml"];
    let moving = place.fails(
        4,
        "measured nothing",
        &[&virtually[..], &["--motion", "rest", "--step", "sweep", "--sweep-seconds", "0.5"]].concat(),
    );
    assert!(moving.out.contains("left unchanged"), "{}", moving.out);
    place.fails(2, "-o FILE.toml", &["calibrate", "--device", "sim:hand"]);
    place.fails(2, "no/where", &["calibrate", "--device", "sim:hand", "--virtual-clock", "-o", "no/where/c.toml"]);
    assert!(!place.path("no").exists(), "no folder is made by a slip");
    place.fails(2, "dance", &[&virtually[..], &["--step", "dance"]].concat());
    place.fails(2, "virtual-clock", &["calibrate", "--device", "tcp:localhost:1", "--virtual-clock", "-o", "c.toml"]);
}
