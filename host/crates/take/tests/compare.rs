//! Comparing takes finds the one thing that was changed.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]
#![allow(clippy::float_cmp, reason = "what is copied keeps its bits")]

mod support;

use std::ops::ControlFlow;

use armature_take::{CompareError, PackedPose, Take, TakeWriter, Tolerance, compare, solve_again};
use glam::Quat;
use support::{begun, header, raw, read};

/// A take whose hand is turned by `off` radians more than solved, from `from` on.
fn recorded(samples: u32, from: u32, off: f32) -> Take {
    let (mut writer, mut solver) = begun(&header());
    for n in 0..samples {
        let sample = raw(n, 500_000 + 10_000 * u64::from(n));
        writer.sample(&sample, None).unwrap();
        let mut pose = solver.solve(&sample).unwrap().clone();
        if n >= from {
            let turn = &mut pose.parent_from_bone[2].rotation;
            *turn = (*turn * Quat::from_rotation_z(off)).normalize();
        }
        writer.pose(n, sample.device_micros, &pose).unwrap();
    }
    read(&writer.finish().unwrap())
}

fn solved(take: &Take) -> Vec<PackedPose> {
    solve_again(take, None, &mut |_, _| ControlFlow::Continue(())).unwrap().0
}

#[test]
fn the_first_difference_is_told_by_joint_time_and_angle() {
    let take = recorded(50, 50, 0.0);
    let poses = solved(&take);
    let same = compare(&take, &poses, &take, Tolerance::default()).unwrap();
    assert!(same.agrees() && same.equal == 50 && same.largest_angle == 0.0, "{same:?}");
    let off = 0.02_f32.to_radians();
    let expected = recorded(50, 30, off);
    let found = compare(&take, &poses, &expected, Tolerance::default()).unwrap();
    assert_eq!((found.equal, found.different, found.agrees()), (30, 20, false));
    let first = found.first.clone().unwrap();
    assert_eq!((first.sequence, first.bone.as_str()), (30, "hand"));
    assert_eq!(first.joint, Some(support::part(2, armature_rig::PartKind::Bend, None).uid.to_string()));
    assert!((first.seconds - 0.3).abs() < 1e-9 && (first.angle - f64::from(off)).abs() < 1e-6, "{first:?}");
    for (degrees, agrees) in [(0.019, false), (0.021, true)] {
        let tolerance = Tolerance { angle: f64::to_radians(degrees), distance: 1e-6 };
        assert_eq!(compare(&take, &poses, &expected, tolerance).unwrap().agrees(), agrees, "{degrees}");
    }
}

#[test]
fn missing_and_unexpected_samples_are_counted() {
    let (long, short) = (recorded(50, 50, 0.0), recorded(40, 40, 0.0));
    let missing = compare(&short, &solved(&short), &long, Tolerance::default()).unwrap();
    assert_eq!((missing.equal, missing.missing, missing.unexpected, missing.agrees()), (40, 10, 0, false));
    let more = compare(&long, &solved(&long), &short, Tolerance::default()).unwrap();
    assert_eq!((more.equal, more.missing, more.unexpected, more.agrees()), (40, 0, 10, false));
    let empty = read(&TakeWriter::new(Vec::new(), &header()).unwrap().finish().unwrap());
    let refused = compare(&long, &[], &empty, Tolerance::default());
    assert_eq!(refused, Err(CompareError::NoSkeleton { which: "expected" }));
    assert!(
        !compare(&long, &[], &recorded(0, 0, 0.0), Tolerance::default()).unwrap().agrees(),
        "nothing is no success"
    );
}
