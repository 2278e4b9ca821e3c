//! A puppet that is taken apart and put together again in the middle of a performance.

use std::io::Sink;

use armature::engine::pipeline::Pipeline;
use armature::engine::puppeteer::{Puppeteer, ZeroPolicy};
use armature_device::{Event, PartKind, PartUid, Sample, Topology};
use armature_rig::{Calibration, Pose};
use armature_tests::{Run, Setup, bones_of, options, perform};

const RATE: f64 = 100.0;

/// What an undisturbed human puppet sent: its tree and its samples.
fn human() -> (Run, Topology, Vec<Sample>) {
    let run = perform(options("human", 5).puppet().unwrap(), &bones_of("human"), &Setup::samples(300, RATE));
    let mut tree = None;
    let mut samples = Vec::new();
    for event in &run.events {
        match event {
            Event::Topology(topology) => tree = Some(topology.clone()),
            Event::Sample(sample) => samples.push(sample.clone()),
            _ => {}
        }
    }
    (run, tree.unwrap(), samples)
}

fn pipeline() -> Pipeline<Sink> {
    let puppeteer = Puppeteer::new(bones_of("human"), None, Calibration::default(), ZeroPolicy::AtStart);
    Pipeline::new(puppeteer.unwrap())
}

/// The tree with another splitter in place of this one and its children in other outlets.
fn with_another_splitter(tree: &Topology, splitter: usize) -> Topology {
    let mut swapped = tree.clone();
    swapped.epoch += 1;
    swapped.parts[splitter].uid = PartUid([0xEE; 12]);
    let outlets = swapped.parts[splitter].outlet_count;
    for part in swapped.parts.iter_mut().filter(|part| part.parent == Some(splitter as u16)) {
        part.outlet = (part.outlet + 1) % outlets;
    }
    Topology::new(swapped.epoch, swapped.parts).unwrap()
}

#[test]
fn a_swapped_splitter_keeps_its_childrens_identity() {
    let (_, tree, samples) = human();
    let splitters: Vec<usize> = (0..tree.parts.len()).filter(|&p| tree.parts[p].kind == PartKind::Splitter).collect();
    assert!(splitters.len() >= 3);
    for splitter in splitters {
        let (mut calm, mut swapped) = (pipeline(), pipeline());
        let another = with_another_splitter(&tree, splitter);
        for pipeline in [&mut calm, &mut swapped] {
            pipeline.handle(&Event::Topology(tree.clone())).unwrap();
        }
        let mut compared = 0;
        for (index, sample) in samples.iter().enumerate() {
            if index == 150 {
                let outcome = swapped.handle(&Event::Topology(another.clone())).unwrap();
                assert!(outcome.new_topology);
                assert_eq!(swapped.puppeteer().mapping(), calm.puppeteer().mapping(), "splitter {splitter}");
            }
            calm.handle(&Event::Sample(sample.clone())).unwrap();
            let epoch = if index < 150 { tree.epoch } else { another.epoch };
            let outcome = swapped.handle(&Event::Sample(Sample { epoch, ..sample.clone() })).unwrap();
            assert!(outcome.posed && (index == 0 || outcome.zeroed.is_none()), "nothing is zeroed again");
            assert_eq!(swapped.puppeteer().pose(), calm.puppeteer().pose(), "splitter {splitter}, sample {index}");
            compared += 1;
        }
        assert!(compared >= 300 && !swapped.puppeteer().waits_for_zero());
    }
}

/// The whole device is gone for a while and is moved meanwhile; it comes back with its clock restarted.
#[test]
fn a_puppet_that_was_away_comes_back_without_a_jump() {
    let (_, tree, samples) = human();
    let mut pipeline = pipeline();
    pipeline.handle(&Event::Topology(tree.clone())).unwrap();
    let (before, after) = samples.split_at(120);
    for sample in before {
        pipeline.handle(&Event::Sample(sample.clone())).unwrap();
    }
    let held = pipeline.puppeteer().pose().clone();
    pipeline.handle(&Event::Restarted).unwrap();
    pipeline.handle(&Event::Topology(tree)).unwrap();
    // As if it had been away for almost a second; its clock starts at zero.
    let back = &after[80..];
    let origin = back[0].device_micros;
    let mut last = held.clone();
    let mut apart_at_first = 0.0;
    for (index, sample) in back.iter().enumerate() {
        let device_micros = sample.device_micros - origin;
        let outcome = pipeline.handle(&Event::Sample(Sample { device_micros, ..sample.clone() })).unwrap();
        assert!(outcome.posed && outcome.zeroed.is_none(), "it keeps its calibration");
        let pose = pipeline.puppeteer().pose();
        if index == 0 {
            apart_at_first = farthest(&held, pose);
        }
        assert!(farthest(&last, pose) < 0.2, "sample {index}: {}", farthest(&last, pose));
        last = pose.clone();
    }
    assert!(apart_at_first < 1e-3, "{apart_at_first}");
    assert!(farthest(&held, &last) > 0.05, "it moved meanwhile");
}

fn farthest(a: &Pose, b: &Pose) -> f32 {
    let pairs = a.parent_from_bone.iter().zip(&b.parent_from_bone);
    pairs
        .map(|(a, b)| 2.0 * (a.rotation - b.rotation).length().min((a.rotation + b.rotation).length()))
        .fold(0.0, f32::max)
}
