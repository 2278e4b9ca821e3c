//! Endpoint and joint weights: their values on the bones, on a bar and on a hand, and changes that must not affect
//! them.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has to fail")]
#![allow(clippy::float_cmp, reason = "given weights are kept to the last bit")]

mod support;

use std::ops::ControlFlow;

use armature_geometry::operators::{Lumping, SparseMatrix, cotangent_laplacian_tetrahedra, lumped_mass_tetrahedra};
use armature_geometry::search::closest_on_segment;
use armature_geometry::{Influences, TetrahedralMesh};
use armature_test_support::{read_npy_indices, shared};
use armature_weights::biharmonic::{BiharmonicError, BiharmonicOutcome, BiharmonicSettings};
use armature_weights::endpoints::{
    EndpointError, EndpointWeights, JointWeights, OtherBones, SampledSkeleton, endpoint_weights,
    endpoint_weights_from_joints, endpoint_weights_of_influences, joint_weights, projected_endpoint_weights,
};
use armature_weights::{BoneSegment, WeightMatrix};
use glam::DVec3;
use support::{read_mesh, read_tgf};

/// A mesh, its operators, and bones among its vertices.
struct Setup {
    mesh: TetrahedralMesh,
    laplacian: SparseMatrix,
    mass: Vec<f64>,
    bones: Vec<BoneSegment>,
    held: Vec<Vec<usize>>,
}

impl Setup {
    fn new(mesh: TetrahedralMesh, bones: Vec<BoneSegment>, held: Vec<Vec<usize>>) -> Self {
        let laplacian = cotangent_laplacian_tetrahedra(&mesh).unwrap().matrix;
        let mass = lumped_mass_tetrahedra(&mesh, Lumping::Barycentric).unwrap();
        Self { mesh, laplacian, mass, bones, held }
    }

    fn skeleton(&self) -> SampledSkeleton<'_> {
        SampledSkeleton { vertices: &self.mesh.vertices, bones: &self.bones, bone_vertices: &self.held }
    }

    fn solve(&self, others: OtherBones) -> EndpointWeights {
        self.try_solve(others).unwrap()
    }

    fn try_solve(&self, others: OtherBones) -> Result<EndpointWeights, EndpointError> {
        let settings = BiharmonicSettings::interactive();
        let mut go_on = |_, _: f64| ControlFlow::Continue(());
        endpoint_weights(&self.laplacian, &self.mass, &self.skeleton(), others, &settings, &mut go_on)
    }

    fn joints(&self) -> JointWeights {
        let settings = BiharmonicSettings::interactive();
        let mut go_on = |_, _: f64| ControlFlow::Continue(());
        joint_weights(&self.laplacian, &self.mass, &self.skeleton(), &settings, &mut go_on).unwrap()
    }

    /// The endpoint weights by eq. 6.7.
    fn joint_endpoints(&self) -> WeightMatrix {
        let joints = self.joints();
        endpoint_weights_from_joints(&joints.weights.weights, &joints.ends).unwrap()
    }
}

/// A bar of `cells` cubes of edge length 1 along x, six tetrahedra each; slice k is vertices `4k..4k + 4`.
fn bar(cells: usize) -> TetrahedralMesh {
    let mut mesh = TetrahedralMesh::default();
    for x in 0..=cells {
        mesh.vertices.extend((0..4_u8).map(|corner| [x as f64, f64::from(corner % 2), f64::from(corner / 2)]));
    }
    for x in 0..cells {
        let at = |dx: usize, dy: usize, dz: usize| (4 * (x + dx) + dy + 2 * dz) as u32;
        let (first, last) = (at(0, 0, 0), at(1, 1, 1));
        let ring = [at(1, 0, 0), at(1, 1, 0), at(0, 1, 0), at(0, 1, 1), at(0, 0, 1), at(1, 0, 1)];
        mesh.tetrahedra.extend((0..6).map(|k| [first, last, ring[k], ring[(k + 1) % 6]]));
    }
    mesh
}

/// All vertices of the slices of a bar that a bone along it holds.
fn slices(from: usize, to: usize) -> Vec<usize> {
    (4 * from..4 * to + 4).collect()
}

fn along_x(from: f64, to: f64) -> BoneSegment {
    BoneSegment { head: [from, 0.0, 0.0], tail: [to, 0.0, 0.0] }
}

/// A bar of 24 cells with a chain of three bones along the edge y = z = 0; the middle one, from 8 to 16, holds whole
/// slices if asked to.
fn chain(whole: bool) -> Setup {
    let edge = |from: usize, to: usize| (from..=to).map(|slice| 4 * slice).collect::<Vec<_>>();
    let middle = if whole { slices(8, 16) } else { edge(8, 16) };
    let bones = vec![along_x(3.0, 8.0), along_x(8.0, 16.0), along_x(16.0, 21.0)];
    Setup::new(bar(24), bones, vec![edge(3, 8), middle, edge(16, 21)])
}

fn hand() -> Option<Setup> {
    let mesh = read_mesh(&shared("hand.mesh")?);
    let bones = read_tgf(&shared("hand.tgf")?);
    let fixed = read_npy_indices(&shared("../reference/hand-bbw-b.npy")?);
    let on = |bone: &BoneSegment, vertex: usize| {
        let place = DVec3::from(mesh.vertices[vertex]);
        closest_on_segment(place, bone.head.into(), bone.tail.into()).distance(place) < 1e-6
    };
    let held = bones.iter().map(|bone| fixed.iter().copied().filter(|&v| on(bone, v)).collect()).collect();
    Some(Setup::new(mesh, bones, held))
}

#[test]
fn a_bar_held_across_has_the_linear_function() {
    let setup = Setup::new(bar(16), vec![along_x(4.0, 12.0)], vec![slices(4, 12)]);
    for others in [OtherBones::OnTheirSide, OtherBones::Free] {
        let result = setup.solve(others);
        assert_eq!(result.reports[0].outcome, BiharmonicOutcome::Converged);
        for (vertex, weight) in result.weights.bone(0).iter().enumerate() {
            let wanted = ((setup.mesh.vertices[vertex][0] - 4.0) / 8.0).clamp(0.0, 1.0);
            assert!((weight - wanted).abs() < 2e-3, "{others:?}: {weight} instead of {wanted} at vertex {vertex}");
        }
    }
}

#[test]
fn a_chain_is_linear_on_each_bone_and_knows_its_sides() {
    let setup = chain(false);
    let result = setup.solve(OtherBones::OnTheirSide);
    assert!(result.told_by_projection.iter().all(Vec::is_empty) && result.without_length.is_empty());
    for slice in 8..=16_usize {
        assert_eq!(result.weights.weight(4 * slice, 1), (slice - 8) as f64 / 8.0, "linear on the bone itself");
    }
    for bone in 0..3 {
        let weights = result.weights.bone(bone);
        let mut last = 0.0;
        // The edge across from the bone: the shape is thin, so its values are close to the bone's and rise with them.
        for slice in 0..=24 {
            let wanted = match bone {
                0 => (slice as f64 - 3.0) / 5.0,
                1 => (slice as f64 - 8.0) / 8.0,
                _ => (slice as f64 - 16.0) / 5.0,
            };
            let weight = weights[4 * slice + 3];
            assert!((weight - wanted.clamp(0.0, 1.0)).abs() < 0.1, "{weight} at slice {slice} of bone {bone}");
            assert!(weight >= last - 4e-3, "bone {bone} falls to {weight} after {last} at slice {slice}");
            last = weight;
        }
    }
    assert!(setup.held[0].iter().all(|v| result.weights.weight(*v, 1) == 0.0), "everything that hangs on the head");
    assert!(setup.held[2].iter().all(|v| result.weights.weight(*v, 1) == 1.0), "everything that hangs on the tail");
    let free = setup.solve(OtherBones::Free);
    let difference = largest_difference(&free.weights.to_columns().unwrap(), &result.weights.to_columns().unwrap());
    assert!(difference < 0.05, "on a thin chain the other bones' values hardly matter: {difference}");
}

#[test]
fn joints_give_endpoint_weights_too() {
    let setup = chain(false);
    let joints = setup.joints();
    assert_eq!(joints.vertices, [12, 32, 64, 84]);
    assert_eq!(joints.ends, [[0, 1], [1, 2], [2, 3]]);
    let from_joints = setup.joint_endpoints();
    for (bone, &[head, tail]) in joints.ends.iter().enumerate() {
        let weights = from_joints.bone(bone);
        assert_eq!((weights[joints.vertices[head]], weights[joints.vertices[tail]]), (0.0, 1.0));
        assert!(weights.iter().all(|e| (0.0..=1.0).contains(e)));
        let (from, to) = (joints.vertices[head] / 4, joints.vertices[tail] / 4);
        let rising: Vec<f64> = (from..=to).map(|slice| weights[4 * slice + 3]).collect();
        assert!(rising.is_sorted_by(|a, b| *b > a - 4e-3), "{rising:?}");
        assert!((rising[rising.len() / 2] - 0.5).abs() < 0.15, "{rising:?}");
    }
}

#[test]
fn a_hand_has_smooth_weights_within_bounds() {
    let Some(setup) = hand() else { return };
    let result = setup.solve(OtherBones::OnTheirSide);
    let projected = projected_endpoint_weights(&setup.mesh.vertices, &setup.bones);
    for (bone, report) in result.reports.iter().enumerate() {
        assert_eq!(report.outcome, BiharmonicOutcome::Converged, "bone {bone}: {report:?}");
        assert!(report.error_bound <= 2e-3 && report.largest_bound_violation == 0.0, "bone {bone}: {report:?}");
        let weights = result.weights.bone(bone);
        assert!(weights.iter().all(|e| (0.0..=1.0).contains(e)));
        assert!(setup.held[bone].iter().all(|&v| weights[v] == projected.weight(v, bone)), "on bone {bone}");
        let (least, most) = ends(&setup.held[bone], &weights);
        // A fingertip has no sample at its very end.
        assert!(least < 1e-9 && most > 0.9, "bone {bone} goes from {least} to {most}");
    }
    assert!(result.told_by_projection.iter().all(Vec::is_empty), "the hand's skeleton is a tree");
    assert!(result.projected.iter().all(|count| *count == 0));
    let from_joints = setup.joint_endpoints();
    assert!(from_joints.to_columns().unwrap().iter().all(|e| (0.0..=1.0).contains(e)));
    for bone in 0..setup.bones.len() {
        let (least, most) = ends(&setup.held[bone], &from_joints.bone(bone));
        assert!(least == 0.0 && most == 1.0, "bone {bone} goes from {least} to {most}");
    }
}

/// Least and most of the weights at some vertices.
fn ends(at: &[usize], weights: &[f64]) -> (f64, f64) {
    at.iter().map(|&v| weights[v]).fold((f64::INFINITY, 0.0), |(least, most), e| (e.min(least), e.max(most)))
}

#[test]
fn motion_scale_and_direction_change_nothing() {
    let setup = chain(false);
    let weights = setup.solve(OtherBones::OnTheirSide).weights;
    let joints = setup.joint_endpoints();
    for scale in [1e-4, 3e5] {
        let place =
            |[x, y, z]: [f64; 3]| [scale * (0.6 * x - 0.8 * y + 3.0), scale * (0.8 * x + 0.6 * y), scale * (z - 7.0)];
        let mut mesh = setup.mesh.clone();
        mesh.vertices.iter_mut().for_each(|p| *p = place(*p));
        let bones = setup.bones.iter().map(|b| BoneSegment { head: place(b.head), tail: place(b.tail) }).collect();
        let moved = Setup::new(mesh, bones, setup.held.clone());
        let difference = largest_difference(
            &moved.solve(OtherBones::OnTheirSide).weights.to_columns().unwrap(),
            &weights.to_columns().unwrap(),
        )
        .max(largest_difference(&moved.joint_endpoints().to_columns().unwrap(), &joints.to_columns().unwrap()));
        assert!(difference < 4e-3, "{difference} at {scale}");
    }
    let turned = setup.bones.iter().map(|b| BoneSegment { head: b.tail, tail: b.head }).collect();
    let turned = Setup::new(setup.mesh.clone(), turned, setup.held.clone()).solve(OtherBones::OnTheirSide);
    let mirrored: Vec<f64> = turned.weights.to_columns().unwrap().iter().map(|e| 1.0 - e).collect();
    let difference = largest_difference(&mirrored, &weights.to_columns().unwrap());
    assert!(difference < 4e-3, "{difference}");
}

#[test]
fn skeletons_that_do_not_tell_are_told() {
    // A bone beside the chain that touches no other, and one that joins the middle bone at both of its ends.
    let mut setup = chain(false);
    let (far, arch) = (along_x(10.0, 12.0), along_x(8.0, 16.0));
    setup.bones.extend([far, arch]);
    setup.held.extend([vec![4 * 10 + 3, 4 * 11 + 3, 4 * 12 + 3], vec![4 * 8, 4 * 12 + 1, 4 * 16]]);
    let result = setup.solve(OtherBones::OnTheirSide);
    let middle = result.weights.bone(1);
    assert_eq!(result.told_by_projection, [vec![3], vec![3, 4], vec![3], vec![0, 1, 2, 4], vec![1, 3]]);
    assert_eq!((middle[4 * 10 + 3], middle[4 * 11 + 3], middle[4 * 12 + 1]), (0.25, 0.375, 0.5));
    // A bone that joins another halfway has its value there.
    let mut setup = chain(false);
    setup.bones.push(BoneSegment { head: [12.0, 0.0, 0.0], tail: [12.0, 1.0, 1.0] });
    setup.held.push(vec![4 * 12, 4 * 12 + 3]);
    let result = setup.solve(OtherBones::OnTheirSide);
    assert_eq!(result.weights.weight(4 * 12 + 3, 1), 0.5);
    assert!(result.told_by_projection.iter().all(Vec::is_empty));
}

#[test]
fn bones_without_length_and_lost_pieces_are_told() {
    let mut setup = chain(false);
    setup.bones.push(along_x(21.0, 21.0));
    setup.held.push(vec![4 * 21]);
    let away = setup.mesh.vertices.len();
    let mut mesh = setup.mesh.clone();
    let second = bar(2);
    mesh.tetrahedra.extend(second.tetrahedra.iter().map(|corners| corners.map(|v| v + away as u32)));
    mesh.vertices.extend(second.vertices.iter().map(|[x, y, z]| [x + 10.0, y + 50.0, *z]));
    let setup = Setup::new(mesh, setup.bones, setup.held);
    for others in [OtherBones::OnTheirSide, OtherBones::Free] {
        let result = setup.solve(others);
        assert_eq!(result.without_length, [3], "{others:?}");
        assert!(result.weights.bone(3)[..away].iter().all(|e| (e - 0.5).abs() < 1e-6), "{others:?}");
        assert_eq!(result.projected, [12; 4], "{others:?}");
        assert_eq!(result.weights.bone(1)[away..away + 4], [0.25; 4], "{others:?}: the projection");
    }
}

#[test]
fn influences_get_the_weight_of_their_bone() {
    let endpoints = WeightMatrix::from_columns(2, 3, &[0.0, 0.1, 0.2, 0.3, 0.4, 0.5]).unwrap();
    let influences = Influences::new(2, vec![2, 1, 0, 0], vec![0.25, 0.75, 1.0, 0.0], 3).unwrap();
    let of_slots = endpoint_weights_of_influences(&endpoints, &influences).unwrap();
    assert_eq!(of_slots, [0.2, 0.4, 0.1, 0.5]);
    let too_few = WeightMatrix::from_columns(2, 1, &[0.0; 2]).unwrap();
    assert_eq!(endpoint_weights_of_influences(&too_few, &influences), None);
    assert_eq!(endpoint_weights_of_influences(&WeightMatrix::default(), &influences), None);
}

#[test]
fn threads_change_no_bit() {
    let setup = chain(true);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (setup.solve(OtherBones::OnTheirSide), setup.joints()))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn nonsense_is_named() {
    let with = |change: &dyn Fn(&mut Setup)| {
        let mut setup = chain(false);
        change(&mut setup);
        let together = setup.try_solve(OtherBones::OnTheirSide).unwrap_err();
        assert_eq!(setup.try_solve(OtherBones::Free).unwrap_err(), together);
        together
    };
    assert_eq!(with(&|s| s.held.truncate(2)), EndpointError::BoneCount { bones: 3, given: 2 });
    assert_eq!(with(&|s| s.held[1].clear()), EndpointError::NoVertex { bone: 1 });
    assert_eq!(with(&|s| s.held[2][0] = 100), EndpointError::NoSuchVertex { bone: 2, vertex: 100, vertices: 100 });
    assert_eq!(with(&|s| s.bones[0].tail[1] = f64::NAN), EndpointError::NotFinite { bone: 0 });
    let size = with(&|s| s.mass.truncate(3));
    assert!(matches!(size, EndpointError::Weights(BiharmonicError::Size { given: 100, wanted: 3, .. })), "{size}");
    assert!(matches!(with(&|s| s.mass[7] = 0.0), EndpointError::Weights(BiharmonicError::BadMass { vertex: 7, .. })));
    let none = Setup::new(bar(2), Vec::new(), Vec::new());
    assert_eq!(none.try_solve(OtherBones::OnTheirSide), Err(BiharmonicError::NoHandles.into()));
}

#[test]
fn stops_when_asked() {
    let setup = chain(false);
    for others in [OtherBones::OnTheirSide, OtherBones::Free] {
        let mut last = 0.0;
        let mut stop = |_: &'static str, done: f64| {
            assert!(done >= last, "{done} after {last}");
            last = done;
            if done > 0.5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let settings = BiharmonicSettings::interactive();
        let stopped = endpoint_weights(&setup.laplacian, &setup.mass, &setup.skeleton(), others, &settings, &mut stop);
        assert!(matches!(stopped, Err(EndpointError::Weights(BiharmonicError::Cancelled { .. }))), "{others:?}");
    }
    let settings = BiharmonicSettings::interactive();
    let wanted = "guessing the weights that reach far";
    let mut stop = |stage: &'static str, _: f64| match stage {
        stage if stage == wanted => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    };
    let stopped = joint_weights(&setup.laplacian, &setup.mass, &setup.skeleton(), &settings, &mut stop);
    assert_eq!(stopped, Err(BiharmonicError::Cancelled { stage: wanted }.into()));
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
