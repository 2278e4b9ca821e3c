//! Harmonic functions with given values and flux, and the maximum principle on obtuse elements.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has to fail")]

mod support;

use armature_geometry::TetrahedralMesh;
use armature_geometry::operators::{SparseMatrix, cotangent_laplacian, cotangent_laplacian_tetrahedra};
use armature_weights::extrema::{Neighbours, local_extrema};
use armature_weights::harmonic::{HarmonicError, HarmonicProblem, harmonic_function, positive_conductances};
use support::{block, flat_shape};

/// A block whose elements are so slanted that many conductances are negative.
fn slanted() -> (TetrahedralMesh, SparseMatrix) {
    let mesh = block([10, 6, 5], |[x, y, z]| [x + 1.4 * y + 1.9 * z, y + 0.8 * z, 0.6 * z]);
    let laplacian = cotangent_laplacian_tetrahedra(&mesh).unwrap().matrix;
    (mesh, laplacian)
}

#[test]
fn a_linear_function_is_harmonic_with_values_or_with_flux() {
    let mesh = flat_shape(0.25, [3.0, 1.0], |_, _| true);
    let laplacian = cotangent_laplacian(&mesh).unwrap().matrix;
    let x = |vertex: usize| mesh.vertices[vertex][0];
    let at = |end: f64| (0..mesh.vertices.len()).filter(move |&v| x(v) - end == 0.0).collect::<Vec<usize>>();
    let (left, right) = (at(0.0), at(3.0));
    let both: Vec<usize> = left.iter().chain(&right).copied().collect();
    let values: Vec<f64> = both.iter().map(|&v| 2.0 * x(v)).collect();
    let given = HarmonicProblem { laplacian: &laplacian, fixed: &both, values: &values, flux: &[] };
    // The slope of two along the right end, each vertex by its part of it.
    let part = |v: usize| if mesh.vertices[v][1] == 0.0 || mesh.vertices[v][1] - 1.0 == 0.0 { 0.125 } else { 0.25 };
    let flux: Vec<(usize, f64)> = right.iter().map(|&v| (v, 2.0 * part(v))).collect();
    let pushed = HarmonicProblem { fixed: &left, values: &values[..left.len()], flux: &flux, ..given };
    for problem in [given, pushed] {
        let made = harmonic_function(&problem).unwrap();
        let worst = (0..mesh.vertices.len()).map(|v| (made.values[v] - 2.0 * x(v)).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-12 && made.residual < 1e-12, "{worst} {}", made.residual);
        assert!(made.unreached.is_empty());
    }
}

#[test]
fn positive_conductances_keep_the_maximum_principle_where_obtuse_elements_break_it() {
    let (mesh, laplacian) = slanted();
    let neighbours = Neighbours::of_elements(mesh.vertices.len(), &mesh.tetrahedra).unwrap();
    let fixed = [0, 40, mesh.vertices.len() - 1];
    let extrema = |laplacian: &SparseMatrix| {
        let problem = HarmonicProblem { laplacian, fixed: &fixed, values: &[0.0, 1.0, 0.0], flux: &[] };
        local_extrema(&neighbours, &harmonic_function(&problem).unwrap().values).unwrap().besides(&fixed).count()
    };
    let positive = positive_conductances(&laplacian);
    let (before, after) = (extrema(&laplacian), extrema(&positive.matrix));
    println!("{before} extrema before, {after} after; {} vertices of {}", positive.vertices, mesh.vertices.len());
    assert!(before > 0 && after == 0, "{before} {after}");
    assert!(positive.raised_edges > 0 && positive.vertices <= mesh.vertices.len());
    for column in 0..mesh.vertices.len() {
        let sum: f64 = positive.matrix.column(column).map(|(_, value)| value).sum();
        let largest = positive.matrix.column(column).map(|(_, value)| value.abs()).fold(0.0, f64::max);
        assert!(sum.abs() < 1e-12 * largest, "row {column} sums to {sum}");
        for (row, value) in positive.matrix.column(column).filter(|&(row, _)| row != column) {
            assert!(value >= 0.0 && value - positive.matrix.get(column, row) == 0.0, "{row} {column}");
            let given = laplacian.get(row, column);
            assert!(given <= 0.0 || value - given == 0.0, "a good conductance stays");
        }
    }
    assert_eq!(positive_conductances(&positive.matrix).raised_edges, 0);
}

#[test]
fn what_cannot_be_is_named() {
    let (_, laplacian) = slanted();
    let good = HarmonicProblem { laplacian: &laplacian, fixed: &[0, 5], values: &[0.0, 1.0], flux: &[] };
    let error = |problem: HarmonicProblem<'_>| harmonic_function(&problem).unwrap_err();
    assert!(matches!(error(HarmonicProblem { values: &[0.0], ..good }), HarmonicError::Size { .. }));
    assert_eq!(error(HarmonicProblem { fixed: &[3, 3], ..good }), HarmonicError::FixedTwice { vertex: 3 });
    let nan = error(HarmonicProblem { values: &[f64::NAN, 0.0], ..good });
    assert!(matches!(nan, HarmonicError::NotFinite { vertex: 0, .. }), "{nan}");
    let far = laplacian.columns();
    assert!(matches!(error(HarmonicProblem { fixed: &[0, far], ..good }), HarmonicError::NoSuchVertex { .. }));
    let lost = error(HarmonicProblem { fixed: &[], values: &[], flux: &[(7, 1.0)], ..good });
    assert_eq!(lost, HarmonicError::FluxWithoutValue { vertex: 7 });
}
