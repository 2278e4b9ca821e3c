//! Delaunay tetrahedra: their defining properties, for all kinds of points, and comparison with brute force.

mod support;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

use armature_geometry::delaunay::{DelaunayError, DelaunayTetrahedra, delaunay_tetrahedra};
use proptest::prelude::*;
use robust::{Coord3D, insphere, orient3d};

type Points = Vec<[f64; 3]>;

fn tetrahedralise(points: &[[f64; 3]]) -> Result<DelaunayTetrahedra, DelaunayError> {
    delaunay_tetrahedra(points, &mut |_, _| ControlFlow::Continue(()))
}

/// The three corners of the facet opposite corner `k`, counter-clockwise seen from outside.
fn facet(t: [u32; 4], k: usize) -> [u32; 3] {
    [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]][k].map(|i: usize| t[i])
}

fn volume6(a: [f64; 3], b: [f64; 3], c: [f64; 3], d: [f64; 3]) -> f64 {
    let [a, b, c, d] = [a, b, c, d].map(glam::DVec3::from);
    (b - a).dot((c - a).cross(d - a))
}

/// Everything that must hold for any points; returns the sum of volumes times six.
fn check(points: &[[f64; 3]], delaunay: &DelaunayTetrahedra) -> f64 {
    let DelaunayTetrahedra { tetrahedra, neighbours, first_at_place } = delaunay;
    let at = |v: u32| points[v as usize];
    let exact = |v: u32| Coord3D { x: at(v)[0], y: at(v)[1], z: at(v)[2] };
    let mut hull = Vec::new();
    assert_eq!(tetrahedra.len(), neighbours.len());
    for (index, (&t, across)) in tetrahedra.iter().zip(neighbours).enumerate() {
        let [a, b, c, d] = t.map(exact);
        // The predicate's orientation is the opposite of ours.
        assert!(orient3d(a, b, c, d) < 0.0, "{t:?} is flat or inside out");
        for k in 0..4 {
            let mut seen = facet(t, k);
            if across[k] == DelaunayTetrahedra::OUTSIDE {
                hull.push(seen);
                continue;
            }
            let (other, back) = (tetrahedra[across[k] as usize], neighbours[across[k] as usize]);
            let back = back.iter().position(|&n| n as usize == index).expect("neighbours know each other");
            let mut theirs = facet(other, back);
            seen.sort_unstable();
            theirs.sort_unstable();
            assert_eq!(seen, theirs);
            assert!(insphere(b, a, c, d, exact(other[back])) <= 0.0, "{t:?} has {} inside", other[back]);
        }
    }
    check_vertices(points, delaunay);
    check_hull(points, &hull);
    check_euler(tetrahedra, hull.len(), first_at_place);
    // Both sums are rounded, and hulls may be far from the origin.
    let inside: f64 = tetrahedra.iter().map(|t| volume6(at(t[0]), at(t[1]), at(t[2]), at(t[3]))).sum();
    let anchor = at(tetrahedra[0][0]);
    let around: f64 = hull.iter().map(|f| volume6(anchor, at(f[0]), at(f[1]), at(f[2]))).sum();
    assert!((inside - around).abs() <= 1e-9 * around.abs(), "{inside} inside a hull of {around}");
    inside
}

fn check_vertices(points: &[[f64; 3]], delaunay: &DelaunayTetrahedra) {
    let used: BTreeSet<u32> = delaunay.tetrahedra.iter().flatten().copied().collect();
    let mut first: BTreeMap<[u64; 3], u32> = BTreeMap::new();
    for (index, p) in points.iter().enumerate() {
        // Adding zero turns -0 into 0.
        let first = *first.entry(p.map(|c| (c + 0.0).to_bits())).or_insert(index as u32);
        assert_eq!(delaunay.first_at_place[index], first, "point {index}");
        assert_eq!(used.contains(&(index as u32)), first == index as u32, "point {index}");
    }
}

/// The hull's facets form a closed surface that nowhere turns inwards, so it is convex.
fn check_hull(points: &[[f64; 3]], hull: &[[u32; 3]]) {
    let exact = |v: u32| {
        let [x, y, z] = points[v as usize];
        Coord3D { x, y, z }
    };
    let opposite: BTreeMap<[u32; 2], u32> =
        hull.iter().flat_map(|f| (0..3).map(|k| ([f[k], f[(k + 1) % 3]], f[(k + 2) % 3]))).collect();
    assert_eq!(opposite.len(), 3 * hull.len(), "an edge of the hull occurs twice");
    for (&[from, to], &tip) in &opposite {
        let other = *opposite.get(&[to, from]).expect("the hull is closed");
        assert!(orient3d(exact(from), exact(to), exact(tip), exact(other)) >= 0.0, "the hull turns inwards");
    }
}

/// Corners − edges + facets − tetrahedra of a ball is 1.
fn check_euler(tetrahedra: &[[u32; 4]], hull_facets: usize, first_at_place: &[u32]) {
    let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    let mut edges: Vec<[u32; 2]> =
        tetrahedra.iter().flat_map(|t| pairs.map(|[i, j]: [usize; 2]| [t[i].min(t[j]), t[i].max(t[j])])).collect();
    edges.sort_unstable();
    edges.dedup();
    let corners = first_at_place.iter().enumerate().filter(|&(index, &first)| index == first as usize).count();
    let facets = usize::midpoint(4 * tetrahedra.len(), hull_facets);
    assert_eq!((corners + facets) as i64 - (edges.len() + tetrahedra.len()) as i64, 1);
}

fn random(count: usize) -> Points {
    let mut noise = support::noise();
    (0..count).map(|_| std::array::from_fn(|_| noise())).collect()
}

fn grid(sides: [u32; 3]) -> Points {
    let [nx, ny, nz] = sides;
    let cell = |i: u32| [i % nx, i / nx % ny, i / nx / ny].map(f64::from);
    (0..nx * ny * nz).map(cell).collect()
}

#[test]
fn random_points_have_as_many_tetrahedra_as_qhull_finds() {
    // scipy 1.17.1, scipy.spatial.Delaunay, on the same points: 66,411 and 672,651.
    for (count, tetrahedra) in [(10_000, 66_411), (100_000, 672_651)] {
        let points = random(count);
        let delaunay = tetrahedralise(&points).unwrap();
        assert_eq!(delaunay.tetrahedra.len(), tetrahedra);
        let volume = check(&points, &delaunay) / 6.0;
        assert!(volume < 8.0 && volume > 7.8, "random points nearly fill their cube: {volume}");
    }
}

#[test]
fn the_same_points_give_the_same_tetrahedra_on_one_thread() {
    let points = random(20_000);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(tetrahedralise(&points), one.install(|| tetrahedralise(&points)));
}

#[test]
fn grids_fill_their_box() {
    for sides in [[2, 2, 2], [12, 12, 12], [40, 3, 2], [2, 50, 50]] {
        let points = grid(sides);
        let volume = check(&points, &tetrahedralise(&points).unwrap()) / 6.0;
        let wanted = sides.map(|n| f64::from(n - 1)).iter().product::<f64>();
        assert!((volume - wanted).abs() < 1e-9, "{sides:?}: {volume}");
    }
}

#[test]
fn points_on_spheres_and_layers() {
    let sphere = support::sphere(4).vertices;
    let volume = check(&sphere, &tetrahedralise(&sphere).unwrap()) / 6.0;
    assert!((volume / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.01, "{volume}");
    // Nested, and with the centre: every sphere's points are cospherical, nearly or exactly.
    let mut nested = vec![[0.0; 3]];
    nested.extend([0.25, 0.5, 1.0].iter().flat_map(|r| sphere.iter().map(move |p| p.map(|c| c * r))));
    check(&nested, &tetrahedralise(&nested).unwrap());
    // Integers with x² + y² + z² = 1125 lie on one sphere exactly.
    let cube = || (-33_i32..=33).flat_map(|x| (-33..=33).flat_map(move |y| (-33..=33).map(move |z| [x, y, z])));
    let integer: Points =
        cube().filter(|p| p.iter().map(|c| c * c).sum::<i32>() == 1125).map(|p| p.map(f64::from)).collect();
    assert!(integer.len() > 100, "{}", integer.len());
    check(&integer, &tetrahedralise(&integer).unwrap());
    let layers: Points = random(3000).into_iter().map(|[x, y, z]| [x, y, (3.0 * z).floor()]).collect();
    check(&layers, &tetrahedralise(&layers).unwrap());
    let mut flat_but_one = grid([20, 20, 1]);
    flat_but_one.push([3.0, 4.0, 1e-30]);
    check(&flat_but_one, &tetrahedralise(&flat_but_one).unwrap());
}

#[test]
fn clusters_lines_and_duplicates() {
    let clustered: Points =
        random(4000).iter().enumerate().map(|(i, p)| p.map(|c| c * 10_f64.powi(-(i as i32 % 12)))).collect();
    check(&clustered, &tetrahedralise(&clustered).unwrap());
    // Two skew lines: every segment of one forms a tetrahedron with every segment of the other.
    let lines =
        |n: u32| -> Points { (0..n).flat_map(|i| [[f64::from(i), 0.0, 0.0], [0.0, f64::from(i), 1.0]]).collect() };
    let refused = tetrahedralise(&lines(4000)).unwrap_err();
    assert!(matches!(refused, DelaunayError::TooManyTetrahedra { .. }), "{refused}");
    let lines = lines(60);
    let delaunay = tetrahedralise(&lines).unwrap();
    check(&lines, &delaunay);
    assert_eq!(delaunay.tetrahedra.len(), 59 * 59);
    let twice: Points = [random(2000), random(1500), grid([3, 3, 3]), grid([3, 3, 3]), vec![[-0.0; 3]]].concat();
    check(&twice, &tetrahedralise(&twice).unwrap());
}

#[test]
fn scale_changes_nothing() {
    let points = [grid([5, 5, 5]), random(500)].concat();
    let expected = tetrahedralise(&points).unwrap();
    for exponent in [-960, -300, 300, 1000] {
        let scaled: Points = points.iter().map(|p| p.map(|c| libm::scalbn(c, exponent))).collect();
        assert_eq!(tetrahedralise(&scaled).as_ref(), Ok(&expected), "2^{exponent}");
    }
    // Far from the origin, where few bits are left, many points coincide.
    let far: Points = points.iter().map(|p| p.map(|c| c + 1e14)).collect();
    check(&far, &tetrahedralise(&far).unwrap());
    let thin: Points = points.iter().map(|&[x, y, z]| [1e-40 * x, 1e-20 * y, z]).collect();
    tetrahedralise(&thin).unwrap();
}

#[test]
fn what_has_no_volume_is_said() {
    let told = |points: &[[f64; 3]]| tetrahedralise(points).unwrap_err();
    assert_eq!(told(&[]), DelaunayError::TooFewPoints { distinct: 0 });
    assert_eq!(told(&[[0.0; 3]; 9]), DelaunayError::TooFewPoints { distinct: 1 });
    assert_eq!(told(&[[1.0, 0.0, 0.0], [2.0; 3], [1.0, 0.0, 0.0]]), DelaunayError::TooFewPoints { distinct: 2 });
    assert_eq!(told(&grid([7, 1, 1])), DelaunayError::Collinear);
    assert_eq!(told(&grid([7, 1, 4])), DelaunayError::Coplanar);
    let mut points = random(50);
    points[7][1] = f64::NAN;
    assert_eq!(told(&points), DelaunayError::NotFinite { point: 7 });
    points[7][1] = f64::NEG_INFINITY;
    assert_eq!(told(&points), DelaunayError::NotFinite { point: 7 });
    points[7][1] = 1e-300;
    assert_eq!(told(&points), DelaunayError::TooFine { point: 7 });
    points[7] = [f64::MAX, -f64::MAX, f64::MAX];
    assert!(matches!(told(&points), DelaunayError::TooFine { .. }), "all others vanish beside the largest");
    points[7] = [1e90, -1e90, 1e80];
    assert!(tetrahedralise(&points).is_ok());
}

#[test]
fn it_can_be_cancelled() {
    let mut calls = 0;
    let cancel = &mut |_: &str, done: f64| {
        calls += 1;
        assert!((0.0..=1.0).contains(&done));
        if done > 0.5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    assert_eq!(delaunay_tetrahedra(&random(20_000), cancel), Err(DelaunayError::Cancelled));
    assert_eq!(calls, 3);
}

#[test]
fn vertices_of_real_meshes() {
    for file in ["armadillo.obj", "elephant.obj", "truck.obj", "spot.obj", "cow.off"] {
        let Some(mesh) = support::shared_triangles(file) else { continue };
        let delaunay = tetrahedralise(&mesh.vertices).unwrap();
        check(&mesh.vertices, &delaunay);
    }
}

/// The sphere determinant in integers, positive inside: 4×4, rows Δx, Δy, Δz, |Δ|².
fn in_sphere_of_integers(corners: [[i64; 3]; 5]) -> i64 {
    let rows: [[i64; 4]; 4] = std::array::from_fn(|r| {
        let [x, y, z] = std::array::from_fn(|k| corners[r][k] - corners[4][k]);
        [x, y, z, x * x + y * y + z * z]
    });
    let minor = |skip: usize| {
        let [a, b, c] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]][skip].map(|r: usize| rows[r]);
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    rows[0][3] * minor(0) - rows[1][3] * minor(1) + rows[2][3] * minor(2) - rows[3][3] * minor(3)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_sphere_around_small_integers_holds_a_point(points in prop::collection::vec(prop::array::uniform3(-3..=3_i64), 0..40)) {
        let real: Points = points.iter().map(|p| p.map(|c| c as f64)).collect();
        match tetrahedralise(&real) {
            Ok(delaunay) => {
                check(&real, &delaunay);
                for t in &delaunay.tetrahedra {
                    let [a, b, c, d] = t.map(|v| points[v as usize]);
                    prop_assert!(points.iter().all(|&e| in_sphere_of_integers([a, b, c, d, e]) <= 0));
                }
            }
            Err(DelaunayError::TooFewPoints { distinct }) => {
                let places: BTreeSet<_> = points.iter().collect();
                prop_assert!(distinct < 4 && distinct == places.len());
            }
            Err(DelaunayError::Collinear | DelaunayError::Coplanar) => {
                let first = real[0];
                for i in &real {
                    for j in &real {
                        prop_assert!(real.iter().all(|&k| volume6(first, *i, *j, k) == 0.0));
                    }
                }
            }
            Err(other) => prop_assert!(false, "{other}"),
        }
    }

    #[test]
    fn any_coordinates_give_tetrahedra_or_a_reason(points in prop::collection::vec(prop::array::uniform3(any::<f64>()), 0..30)) {
        if let Ok(delaunay) = tetrahedralise(&points) {
            prop_assert_eq!(delaunay.tetrahedra.len(), delaunay.neighbours.len());
            prop_assert!(delaunay.tetrahedra.iter().flatten().all(|&v| (v as usize) < points.len()));
        }
    }
}
