//! A replay goes the way the performance went, whatever went wrong on the way; and joints that come back do not jump.

use std::sync::{Arc, LazyLock};

use armature::characters::LoadedCharacter;
use armature_rig::{Filter, Pose};
use armature_sim::serve::Options;
use armature_take::{Record, Take, summarize, verify};
use armature_test_support::shared;
use armature_tests::{Run, Setup, bones_of, character, keep_going, options, perform};
use proptest::prelude::*;

static HUMAN: LazyLock<Arc<LoadedCharacter>> = LazyLock::new(|| bones_of("human"));

fn performed(options: &Options, filter: Filter, character: &Arc<LoadedCharacter>, samples: u32, rate: f64) -> Run {
    let setup = Setup { filter, ..Setup::samples(samples, rate) };
    perform(options.puppet().unwrap(), character, &setup)
}

fn assert_replays(run: &Run) {
    let verification = verify(&run.take, &mut keep_going).unwrap();
    assert!(verification.is_exact(), "{:?}", verification.first_difference);
    assert_eq!(verification.identical, run.take.samples().count() as u64);
}

/// The furthest that any bone turns from one pose to the next, degrees, and at which pose.
fn largest_step(take: &Take) -> (f32, usize) {
    let poses: Vec<Pose> = take.poses().map(|packed| take.unpack(packed)).collect();
    let mut worst = (0.0, 0);
    for (at, pair) in poses.windows(2).enumerate() {
        let bones = pair[0].parent_from_bone.iter().zip(&pair[1].parent_from_bone);
        for (a, b) in bones {
            let apart = (a.rotation.inverse() * b.rotation).normalize();
            let degrees = 2.0 * apart.xyz().length().atan2(apart.w.abs()).to_degrees();
            worst = if degrees > worst.0 { (degrees, at + 1) } else { worst };
        }
    }
    worst
}

#[test]
fn a_joint_that_loses_its_data_and_comes_back_replays_bit_for_bit() {
    let Some(path) = shared("cases/mapping/h9m.bvh") else { return };
    let puppet = path.to_str().unwrap();
    let no_data = ["12@3.5:1", "13@3.5:1", "14@3.5:1"].map(str::to_owned).to_vec();
    let options = Options { no_data, ..options(puppet, 1) };
    for filter in ["hold:50", "hold", "none", "one-euro"] {
        let run = performed(&options, filter.parse().unwrap(), &HUMAN, 1_200, 200.0);
        assert_replays(&run);
        let named = summarize(&run.take).silent_joints;
        assert_eq!(named.len(), 1, "{filter}: {named:?}");
        assert!((named[0].seconds - 1.0).abs() < 0.02, "{named:?}");
    }
}

#[test]
fn a_sensor_that_comes_back_does_not_jump_with_any_filter() {
    let whole = options("human8", 3);
    let away = Options { no_data: (9..15).map(|sensor| format!("{sensor}@1.3:0.7")).collect(), ..whole.clone() };
    for filter in ["none", "one-euro", "hold:50", "hold"] {
        let filter: Filter = filter.parse().unwrap();
        let (calm, _) = largest_step(&performed(&whole, filter, &HUMAN, 600, 200.0).take);
        let run = performed(&away, filter, &HUMAN, 600, 200.0);
        let (step, at) = largest_step(&run.take);
        assert!(step < 2.0 * calm + 1.5, "{filter}: {step}° at pose {at}, {calm}° while nothing is wrong");
        assert_replays(&run);
        // The take says so once, before the first sample whose readings are missing.
        let said = run.take.records().iter().filter(|record| matches!(record, Record::ReadingsReturn { .. }));
        assert_eq!(said.count(), 1);
    }
    let nothing_wrong = performed(&whole, Filter::None, &HUMAN, 200, 200.0);
    let said = |record: &Record| matches!(record, Record::ReadingsReturn { .. } | Record::Engagement { .. });
    assert!(!nothing_wrong.take.records().iter().any(said), "takes in which nothing is missing are as before");
}

fn filter() -> impl Strategy<Value = Filter> {
    prop_oneof![
        Just(Filter::None),
        (0.3_f64..8.0, 0.0_f64..4.0).prop_map(|(cutoff, beta)| format!("one-euro:{cutoff},{beta}").parse().unwrap()),
        (0_u32..400).prop_map(|millis| format!("hold:{millis}").parse().unwrap()),
    ]
}

fn windows() -> impl Strategy<Value = Vec<String>> {
    let window = (0_usize..24, 0.2_f64..1.8, 0.004_f64..0.9);
    prop::collection::vec(window.prop_map(|(sensor, start, length)| format!("{sensor}@{start:.3}:{length:.3}")), 0..4)
}

fn faults() -> impl Strategy<Value = Options> {
    let sensors = (windows(), windows(), windows(), 0.0_f64..0.02, 0.0_f64..0.01);
    let line = (0.0_f64..2e-4, 0.0_f64..1e-4, prop::option::of((0.3_f64..1.5, 0.01_f64..0.3)));
    let parts = prop::option::of((0_usize..3, 0.3_f64..1.2, 0.05_f64..0.6));
    let clock = prop_oneof![
        3 => Just((None, None)),
        1 => (0.3_f64..1.8).prop_map(|at| (Some(format!("4294.967296@{at:.3}:0.004")), None)),
        1 => (0.3_f64..1.8).prop_map(|at| (Some(format!("-0.4@{at:.3}")), None)),
        1 => (0.3_f64..1.8, 0.1_f64..0.8).prop_map(|(at, length)| (None, Some(format!("{at:.3}:{length:.3}")))),
    ];
    let restart = prop::option::of(0.5_f64..1.7);
    (sensors, line, parts, clock, restart, 0_u64..1_000).prop_map(|(sensors, line, parts, clock, restart, seed)| {
        let (no_data, weak, stuck, outlier, hidden_outlier) = sensors;
        let (flip, drop, burst) = line;
        let pulled = ["left_elbow", "right_shoulder", "spine"];
        Options {
            no_data,
            weak,
            stuck,
            outlier,
            hidden_outlier,
            flip,
            drop,
            burst: burst.map(|(start, length)| format!("{start:.3}:{length:.3}")).into_iter().collect(),
            pull: parts.map(|(part, at, length)| format!("{}@{at:.3}:{length:.3}", pulled[part])).into_iter().collect(),
            clock_step: clock.0.into_iter().collect(),
            clock_stand: clock.1.into_iter().collect(),
            restart: restart.into_iter().collect(),
            ..options("human8", seed)
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    /// Filters, states of sensors, losses, parts pulled out, clocks that lie, restarts: whatever happens live happens
    /// again in the replay, to the bit.
    #[test]
    fn live_and_replayed_poses_are_the_same(options in faults(), filter in filter(), rate in 60_u32..400) {
        let run = performed(&options, filter, &HUMAN, 2 * rate, f64::from(rate));
        let verification = verify(&run.take, &mut keep_going).unwrap();
        prop_assert!(verification.is_exact(), "{:?} {options:?} {filter}", verification.first_difference);
        prop_assert_eq!(verification.identical, run.take.samples().count() as u64);
        let lost = summarize(&run.take).lost_samples;
        let events = run.events_of_take();
        let reported = events.iter().map(|e| if let armature_device::Event::Lost { count, .. } = e { *count } else { 0 });
        prop_assert_eq!(lost, reported.map(u64::from).sum::<u64>());
    }
}

#[test]
fn the_built_in_hand_replays_too() {
    let hand = character("hand");
    let faulty = Options { no_data: vec!["0@0.4:0.5".into(), "4@0.6:1".into()], ..options("hand", 5) };
    assert_replays(&performed(&faulty, "hold:80".parse().unwrap(), &hand, 300, 120.0));
}
