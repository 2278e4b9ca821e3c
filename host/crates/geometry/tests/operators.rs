//! Operators against calculus: eigenfunctions, linear functions, areas and volumes.

mod support;

use std::f64::consts::PI;

use armature_geometry::TriangleMesh;
use armature_geometry::operators::{
    Lumping, SparseMatrix, cotangent_laplacian, cotangent_laplacian_of_triangles, cotangent_laplacian_tetrahedra,
    intrinsic_delaunay_laplacian, lumped_mass, lumped_mass_tetrahedra,
};
use armature_geometry::surface::diagnose;

/// `-fᵀLf / fᵀMf`.
fn rayleigh(laplacian: &SparseMatrix, mass: &[f64], f: &[f64]) -> f64 {
    let energy: f64 = -f.iter().zip(laplacian.multiply(f)).map(|(f, lf)| f * lf).sum::<f64>();
    energy / f.iter().zip(mass).map(|(f, m)| m * f * f).sum::<f64>()
}

#[test]
fn spherical_harmonics_have_their_eigenvalues() {
    let z = |p: &[f64; 3]| p[2];
    let xy = |p: &[f64; 3]| p[0] * p[1];
    let xyz = |p: &[f64; 3]| p[0] * p[1] * p[2];
    for (eigenvalue, harmonic) in [(2.0, &z as &dyn Fn(&[f64; 3]) -> f64), (6.0, &xy), (12.0, &xyz)] {
        let mut errors = Vec::new();
        for cuts in [2, 3, 4] {
            let mesh = support::sphere(cuts);
            let f: Vec<f64> = mesh.vertices.iter().map(harmonic).collect();
            let l = cotangent_laplacian(&mesh).unwrap().matrix;
            let m = lumped_mass(&mesh, Lumping::VoronoiHybrid).unwrap();
            errors.push((rayleigh(&l, &m, &f) / eigenvalue - 1.0).abs());
        }
        assert!(errors[2] < 0.01, "eigenvalue {eigenvalue}: errors {errors:?}");
        // Halving the edges quarters the error; coordinates are even exact eigenfunctions.
        assert!(
            errors.windows(2).all(|e| e[1] < 0.3 * e[0] || e[1] < 1e-12),
            "eigenvalue {eigenvalue}: errors {errors:?}"
        );
    }
}

#[test]
fn cosine_in_a_box_has_its_eigenvalue() {
    let mut errors = Vec::new();
    for n in [4, 8, 16] {
        let mesh = support::box_of_tetrahedra(n, 0.0);
        let f: Vec<f64> = mesh.vertices.iter().map(|p| (PI * p[0]).cos()).collect();
        let l = cotangent_laplacian_tetrahedra(&mesh).unwrap().matrix;
        let m = lumped_mass_tetrahedra(&mesh, Lumping::Barycentric).unwrap();
        errors.push((rayleigh(&l, &m, &f) / (PI * PI) - 1.0).abs());
    }
    assert!(errors[2] < 0.01, "errors {errors:?}");
    assert!(errors.windows(2).all(|e| e[1] < 0.3 * e[0]), "errors {errors:?}");
}

#[test]
fn linear_functions_are_harmonic_inside_a_box_and_have_their_exact_energy() {
    let mesh = support::box_of_tetrahedra(5, 0.2);
    let l = cotangent_laplacian_tetrahedra(&mesh).unwrap().matrix;
    let f: Vec<f64> = mesh.vertices.iter().map(|[x, y, z]| 2.0 * x - y + 0.5 * z).collect();
    let lf = l.multiply(&f);
    for (vertex, value) in mesh.vertices.iter().zip(&lf) {
        let inside = vertex.iter().all(|&c| c > 1e-9 && c < 1.0 - 1e-9);
        assert!(!inside || value.abs() < 1e-12, "{value} at {vertex:?}");
    }
    let energy: f64 = -f.iter().zip(&lf).map(|(f, lf)| f * lf).sum::<f64>();
    assert!((energy - 5.25).abs() < 1e-12, "gradient squared times volume, not {energy}");
    for lumping in [Lumping::Barycentric, Lumping::VoronoiHybrid] {
        let volume: f64 = lumped_mass_tetrahedra(&mesh, lumping).unwrap().iter().sum();
        assert!((volume - 1.0).abs() < 1e-12);
    }
}

/// A jittered, sheared square: plenty of obtuse triangles.
fn sheared_square(n: u32) -> (Vec<[f64; 2]>, Vec<[u32; 3]>) {
    let (side, mut noise) = (n + 1, support::noise());
    let vertices = (0..side * side)
        .map(|i| {
            let [x, y] = [i % side, i / side].map(|c| f64::from(c) + 0.25 * noise());
            [x + 1.3 * y, y]
        })
        .collect();
    let corners = (0..n * n).map(|i| i % n + i / n * side);
    let triangles = corners.flat_map(|c| [[c, c + 1, c + side + 1], [c, c + side + 1, c + side]]).collect();
    (vertices, triangles)
}

#[test]
fn linear_functions_are_harmonic_in_the_plane_before_and_after_flipping() {
    let (flat, triangles) = sheared_square(12);
    let in_plane = cotangent_laplacian_of_triangles(&flat, &triangles).matrix;
    let mesh = TriangleMesh { vertices: flat.iter().map(|&[x, y]| [x, y, 0.0]).collect(), triangles };
    let in_space = cotangent_laplacian(&mesh).unwrap().matrix;
    assert_eq!(in_plane, in_space, "two and three dimensions agree");
    let intrinsic = intrinsic_delaunay_laplacian(&mesh, Lumping::VoronoiHybrid).unwrap();
    assert!(
        in_space.values().iter().filter(|v| **v < 0.0).count() > mesh.vertices.len(),
        "the test needs obtuse edges"
    );
    assert!(intrinsic.flips > 50);
    let boundary: Vec<u32> = armature_geometry::surface::boundary_edges(&mesh).into_iter().flatten().collect();
    let f: Vec<f64> = flat.iter().map(|[x, y]| 3.0 * x - y).collect();
    for laplacian in [&in_space, &intrinsic.matrix] {
        // The doubled cover may flip across the boundary; vertices away from it only see a flat surface.
        let lf = laplacian.multiply(&f);
        for vertex in (0..flat.len()).filter(|v| !boundary.contains(&(*v as u32))) {
            let beside = laplacian.column(vertex).any(|(other, _)| boundary.contains(&(other as u32)));
            assert!(beside || lf[vertex].abs() < 1e-11, "{} at {vertex}", lf[vertex]);
        }
    }
}

#[test]
fn flipping_does_not_move_the_surface() {
    let mut mesh = support::sphere(3);
    let mut noise = support::noise();
    for vertex in &mut mesh.vertices {
        *vertex = vertex.map(|c| c + 0.04 * noise());
    }
    let plain = lumped_mass(&mesh, Lumping::Barycentric).unwrap();
    let intrinsic = intrinsic_delaunay_laplacian(&mesh, Lumping::Barycentric).unwrap();
    assert!(intrinsic.flips > 20 && !intrinsic.doubled);
    let (before, after) = (plain.iter().sum::<f64>(), intrinsic.mass.iter().sum::<f64>());
    assert!((before - after).abs() < 1e-12 * before);
}

#[test]
fn diagnosis_of_a_sphere_is_its_textbook_one() {
    let d = diagnose(&support::sphere(4)).unwrap();
    assert!(d.closed && d.euler_characteristic == 2 && d.components == 1);
    assert!((d.signed_volume / (4.0 / 3.0 * PI) - 1.0).abs() < 0.01);
    assert!((d.area / (4.0 * PI) - 1.0).abs() < 0.01);
}

#[test]
fn diagnosis_of_shared_meshes_is_what_their_description_says() {
    if let Some(truck) = support::shared_triangles("truck.obj") {
        let d = diagnose(&truck).unwrap();
        println!("{d:?}");
        assert!(!d.closed && d.boundary_edges > 0 && d.non_manifold_edges > 0 && d.components > 10);
    }
    for name in ["armadillo.obj", "elephant.obj"] {
        let Some(mesh) = support::shared_triangles(name) else { continue };
        let d = diagnose(&mesh).unwrap();
        assert!(d.closed && d.signed_volume > 0.0 && d.components == 1, "{name}: {d:?}");
    }
}
