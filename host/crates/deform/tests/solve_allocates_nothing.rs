//! Pose time never touches the allocator: counted, not assumed.

#![expect(clippy::unwrap_used, reason = "a test may fail by panic")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use armature_deform::arap::{
    Anchor, ArapDynamics, ArapEnergy, ArapSettings, ArapShape, ArapStop, ArapWeights, HandleConstraint, ReducedArap,
};
use armature_deform::skin::{
    BoneBlend, BoneSegment, DualQuaternionSkin, LinearBlendSkin, StretchTwist, StretchTwistSkin,
};
use armature_geometry::Influences;
use glam::{Affine3A, Quat, Vec3};

struct Counting;

/// For all threads, including the test harness's own.
static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

thread_local! {
    /// For this thread.
    static OWN: Cell<usize> = const { Cell::new(0) };
}

fn count() {
    ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
    OWN.with(|own| own.set(own.get() + 1));
}

// SAFETY: every call is passed to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        count();
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Linear blending, dual quaternions, stretched and twisted bones; in this thread, and in all.
fn allocations_of_a_hundred_solves(vertex_count: usize) -> [usize; 2] {
    let positions: Vec<[f32; 3]> = (0..vertex_count).map(|i| [i as f32 * 1e-3, 1.0, 0.5]).collect();
    let normals = vec![[0.0, 0.0, 1.0]; vertex_count];
    let bones = (0..4 * vertex_count).map(|i| (i % 20) as u16).collect();
    let influences = Influences::new(4, bones, vec![0.25; 4 * vertex_count], 20).unwrap();
    let rest = vec![Affine3A::IDENTITY; 20];
    let mut skin = LinearBlendSkin::precompute(&positions, &normals, &influences, &rest).unwrap();
    let mut dual = DualQuaternionSkin::precompute(&positions, &normals, &influences, &rest).unwrap();
    let segments = [BoneSegment { start: Vec3::ZERO, end: Vec3::Y }; 20];
    let ends = vec![0.5; 4 * vertex_count];
    let blend = BoneBlend::DualQuaternion;
    let mut twisted = StretchTwistSkin::precompute(&positions, &normals, &influences, &ends, &segments, blend).unwrap();
    let stretched = [StretchTwist { start: Vec3::ZERO, turn: Quat::IDENTITY, stretch: 1.5, twist: [0.0, 1.0] }; 20];
    let mut pose = rest;
    let mut out = (positions, normals);
    // The first call may start the thread pool.
    skin.solve(&pose, &mut out.0, &mut out.1).unwrap();
    let counts = || [OWN.get(), ALLOCATIONS.load(Ordering::Relaxed)];
    let before = counts();
    for step in 0..100 {
        for (bone, frame) in pose.iter_mut().enumerate() {
            *frame = Affine3A::from_axis_angle(Vec3::Y, (step * bone) as f32 * 1e-3);
        }
        skin.solve(&pose, &mut out.0, &mut out.1).unwrap();
        dual.solve(&pose, &mut out.0, &mut out.1).unwrap();
        twisted.solve(&stretched, &mut out.0, &mut out.1).unwrap();
    }
    let after = counts();
    [after[0] - before[0], after[1] - before[1]]
}

fn allocations_of_a_hundred_reduced_solves() -> usize {
    let positions: Vec<[f64; 3]> =
        (0..60).map(|i| [f64::from(i / 2), f64::from(i % 2), 0.1 * f64::from(i % 3)]).collect();
    let triangles: Vec<[u32; 3]> = (0..58).map(|i| [i, i + 1, i + 2]).collect();
    let weights: Vec<f64> = (0..60).flat_map(|i| [1.0 - f64::from(i) / 59.0, f64::from(i) / 59.0]).collect();
    let shape = ArapShape {
        positions: &positions,
        energy: ArapEnergy::SpokesAndRims(&triangles),
        weights: ArapWeights::Matrix(&weights),
        handle_points: &[positions[0], positions[59]],
        joints: &[],
    };
    let go_on = &mut |_, _| ControlFlow::Continue(());
    let mut arap = ReducedArap::precompute(&shape, &ArapSettings::default(), go_on).unwrap();
    let anchor = Anchor::on_shape([30, 31, 32], [0.25, 0.5, 0.25]);
    arap.constrain(&[HandleConstraint::Full, HandleConstraint::Position], &[anchor]).unwrap();
    let before = OWN.get();
    for step in 0..100 {
        let turned = Affine3A::from_axis_angle(Vec3::Y, step as f32 * 1e-2);
        arap.solve(&[turned; 2], &[Vec3::new(14.0, step as f32, f32::NAN)], ArapStop::default()).unwrap();
    }
    let solved = OWN.get() - before;
    // The first frames find the step lengths that a frame rate needs.
    let dynamics = ArapDynamics { gravity: Vec3::NEG_Y, ..ArapDynamics::default() };
    let mut stepped = 0;
    for step in 0..200 {
        let before = OWN.get();
        let turned = Affine3A::from_axis_angle(Vec3::Y, step as f32 * 1e-2);
        arap.step(&dynamics, 1.0 / 60.0, &[turned; 2], &[Vec3::Y], ArapStop::default()).unwrap();
        stepped += if step < 100 { 0 } else { OWN.get() - before };
    }
    solved + stepped
}

#[test]
fn solve_allocates_nothing() {
    assert_eq!(allocations_of_a_hundred_reduced_solves(), 0);
    assert_eq!(allocations_of_a_hundred_solves(10_000)[0], 0);
    // With threads, only rayon's own job queue may grow by a block now and then, not once per frame.
    let [_, threaded] = allocations_of_a_hundred_solves(60_000);
    assert!(threaded <= 30, "{threaded} allocations in three hundred solves");
}
