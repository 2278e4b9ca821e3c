//! Additional weights free a reduced deformation: its as-rigid-as-possible energy falls (thesis 7.3.3).
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has to fail")]

mod support;

use std::ops::ControlFlow;

use armature_deform::arap::{
    ArapEnergy, ArapOutcome, ArapSettings, ArapShape, ArapStop, ArapWeights, HandleConstraint, ReducedArap,
};
use armature_geometry::TetrahedralMesh;
use armature_geometry::operators::{Lumping, cotangent_laplacian_tetrahedra, lumped_mass_tetrahedra};
use armature_test_support::{read_npy, shared};
use armature_weights::WeightMatrix;
use armature_weights::additional::{AdditionalSettings, additional_weights};
use armature_weights::biharmonic::{BiharmonicProblem, BiharmonicSettings, bounded_biharmonic_weights};
use armature_weights::finish::normalise;
use glam::{Affine3A, Mat3A, Quat, Vec3};
use support::read_mesh;

/// A bar of 24×2×2 cubes of edge length 1, six tetrahedra each.
fn bar() -> TetrahedralMesh {
    let at = |x: u32, y: u32, z: u32| 9 * x + 3 * y + z;
    let mut mesh = TetrahedralMesh::default();
    for x in 0..25_u8 {
        mesh.vertices.extend((0..9_u8).map(|k| [x, k / 3, k % 3].map(f64::from)));
    }
    for x in 0..24 {
        for (y, z) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let corner = |bits: u32| at(x + (bits >> 2 & 1), y + (bits >> 1 & 1), z + (bits & 1));
            for [a, b] in [[4, 6], [6, 2], [2, 3], [3, 1], [1, 5], [5, 4]] {
                mesh.tetrahedra.push([corner(0), corner(a), corner(b), corner(7)]);
            }
        }
    }
    mesh
}

/// Bounded biharmonic weights of the bar's two ends, each three slices long.
fn end_weights(mesh: &TetrahedralMesh) -> WeightMatrix {
    let n = mesh.vertices.len();
    let fixed: Vec<usize> = (0..27).chain(n - 27..n).collect();
    let given: Vec<f64> = (0..2).flat_map(|end| (0..54).map(move |k| f64::from(u8::from(k / 27 == end)))).collect();
    let problem = BiharmonicProblem {
        laplacian: &cotangent_laplacian_tetrahedra(mesh).unwrap().matrix,
        mass: &lumped_mass_tetrahedra(mesh, Lumping::Barycentric).unwrap(),
        fixed: &fixed,
        fixed_weights: &given,
        handles: 2,
        shape_preservation: None,
    };
    let settings = BiharmonicSettings::interactive();
    let mut found = bounded_biharmonic_weights(&problem, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
    normalise(&mut found.weights);
    found.weights
}

/// The energy of a pose in which all but the additional handles are given.
fn posed_energy(
    mesh: &TetrahedralMesh,
    weights: &WeightMatrix,
    extra: usize,
    clusters: Option<usize>,
    pose: &[Affine3A],
) -> f64 {
    let columns = if extra == 0 {
        WeightMatrix::default()
    } else {
        additional_weights(weights, &AdditionalSettings { count: extra, ..AdditionalSettings::default() })
            .unwrap()
            .weights
    };
    assert_eq!(columns.bones(), extra);
    let handles = weights.bones() + extra;
    let row = |vertex: usize| {
        let own = weights.vertex(vertex);
        own.chain((0..extra).map(|k| columns.weight(vertex, k))).collect::<Vec<f64>>()
    };
    let rows: Vec<f64> = (0..weights.vertices()).flat_map(row).collect();
    let shape = ArapShape {
        positions: &mesh.vertices,
        energy: ArapEnergy::Tetrahedra(&mesh.tetrahedra),
        weights: ArapWeights::Matrix(&rows),
        handle_points: &vec![[0.0; 3]; handles],
        joints: &[],
    };
    let settings = ArapSettings { clusters, ..ArapSettings::default() };
    let mut arap = ReducedArap::precompute(&shape, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
    let mut kinds = vec![HandleConstraint::Full; weights.bones()];
    kinds.resize(handles, HandleConstraint::Free);
    arap.constrain(&kinds, &[]).unwrap();
    let mut targets = pose.to_vec();
    targets.resize(handles, Affine3A::IDENTITY);
    let stop = ArapStop { iterations: 150, tolerance: 1e-6 };
    let report = arap.solve(&targets, &[], stop).unwrap();
    assert!(matches!(report.outcome, ArapOutcome::Converged { .. } | ArapOutcome::IterationLimit { .. }));
    assert!(report.warnings.contradiction.is_none(), "{report:?}");
    report.energy
}

/// More than the bar has elements, so each rotates on its own.
const ALL_TURN: Option<usize> = Some(1000);

#[test]
fn a_bent_bar_finds_an_easier_shape() {
    let mesh = bar();
    let weights = end_weights(&mesh);
    let bent = Affine3A::from_rotation_translation(Quat::from_rotation_z(1.6), Vec3::new(14.0, -9.0, 0.0));
    let twisted = Affine3A { matrix3: Mat3A::from_rotation_x(2.4), ..Affine3A::IDENTITY };
    for end in [bent, twisted] {
        let pose = [Affine3A::IDENTITY, end];
        let energies: Vec<f64> = [0, 5, 15].map(|extra| posed_energy(&mesh, &weights, extra, ALL_TURN, &pose)).to_vec();
        println!("{energies:?}");
        assert!(energies[1] < 0.8 * energies[0] && energies[2] < 0.7 * energies[0], "{energies:?}");
        assert!(energies[2] < 1.001 * energies[1], "a larger space cannot cost more: {energies:?}");
        let clustered = [0, 15].map(|extra| posed_energy(&mesh, &weights, extra, Some(40), &pose));
        assert!(clustered[1] < 0.8 * clustered[0], "with clustered rotations too: {clustered:?}");
    }
}

#[test]
fn a_hand_with_closed_fingers_finds_an_easier_shape() {
    let (Some(mesh), Some(reference)) = (shared("hand.mesh"), shared("../reference/hand-bbw-w.npy")) else {
        return;
    };
    let mesh = read_mesh(&mesh);
    let reference = read_npy(&reference);
    let positive: Vec<f64> = reference.values.iter().map(|w| w.max(0.0)).collect();
    let mut weights = WeightMatrix::from_columns(mesh.vertices.len(), reference.columns, &positive).unwrap();
    normalise(&mut weights);
    // Every handle turns about its own middle, neighbours in different directions.
    let pose: Vec<Affine3A> = (0..weights.bones())
        .map(|bone| {
            let held = || (0..mesh.vertices.len()).filter(|&v| weights.weight(v, bone) > 0.99);
            let sum: Vec3 = held().map(|v| Vec3::from(mesh.vertices[v].map(|c| c as f32))).sum();
            let middle = sum / held().count().max(1) as f32;
            let turn = Quat::from_rotation_x(if bone % 2 == 0 { 0.25 } else { -0.25 });
            Affine3A::from_translation(middle) * Affine3A::from_quat(turn) * Affine3A::from_translation(-middle)
        })
        .collect();
    let energies = [0, 15].map(|extra| posed_energy(&mesh, &weights, extra, Some(200), &pose));
    println!("{energies:?}");
    assert!(energies[1] < 0.98 * energies[0], "{energies:?}");
}
