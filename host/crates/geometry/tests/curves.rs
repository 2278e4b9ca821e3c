//! Winding numbers of curves in the plane: fast compared with exact.

mod support {
    pub(crate) mod outlines;
}

use armature_geometry::MeshError;
use armature_geometry::winding::{FastWindingNumber2d, WindingNumberHierarchy2d, winding_number_2d};
use proptest::prelude::*;
use support::outlines;

#[test]
fn fast_is_near_the_exact_one_on_all_kinds_of_outlines() {
    for (name, (vertices, segments)) in outlines::all(20_000) {
        let points = outlines::points_around(&vertices, &segments, 3000);
        let exact = WindingNumberHierarchy2d::precompute(&vertices, &segments).unwrap().evaluate_many(&points);
        let fast = FastWindingNumber2d::precompute(&vertices, &segments).unwrap().evaluate_many(&points);
        let off = |k: usize| (exact[k] - fast[k]).abs();
        let most = (0..points.len()).map(off).fold(0.0, f64::max);
        let mean = (0..points.len()).map(off).sum::<f64>() / points.len() as f64;
        assert!(most < 5e-3 && mean < 1e-3, "{name}: off by {most}, {mean} on average");
        assert!(most > 0.0, "{name}: no expansion was used");
    }
}

#[test]
fn the_wider_the_opening_the_nearer_and_one_thread_or_many_agree() {
    let (vertices, segments) = outlines::strewn(5000);
    let points = outlines::points_around(&vertices, &segments, 500);
    let exact = WindingNumberHierarchy2d::precompute(&vertices, &segments).unwrap().evaluate_many(&points);
    let mut before = f64::INFINITY;
    for opening in [1.3, 2.0, 4.0, 1e6] {
        let fast = FastWindingNumber2d::precompute_with_opening(&vertices, &segments, opening).unwrap();
        let many = fast.evaluate_many(&points);
        let most = exact.iter().zip(&many).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(most < before, "{most} with {opening}, {before} with less");
        before = most;
        assert_eq!(many[7].to_bits(), fast.evaluate(points[7]).to_bits());
    }
    assert!(before < 1e-9, "{before} although everything is near");
    let counted = FastWindingNumber2d::precompute_with_opening(&vertices, &segments, f64::NAN).unwrap();
    let usual = FastWindingNumber2d::precompute(&vertices, &segments).unwrap();
    assert_eq!(counted.evaluate(points[3]).to_bits(), usual.evaluate(points[3]).to_bits());
}

#[test]
fn any_size_and_place_will_do() {
    let (vertices, segments) = outlines::flower(1000);
    for (scale, offset) in [(1e-30, 0.0), (1e50, 0.0), (1.0, 1e6), (1e-3, 5.0)] {
        let moved = |p: [f64; 2]| p.map(|c| c * scale + offset);
        let other: Vec<[f64; 2]> = vertices.iter().map(|&p| moved(p)).collect();
        let fast = FastWindingNumber2d::precompute(&other, &segments).unwrap();
        for (p, expected) in [([0.0, 0.0], 1.0), ([0.1, -0.4], 1.0), ([1.5, 0.9], 0.0), ([-40.0, 3.0], 0.0)] {
            let found = fast.evaluate(moved(p));
            assert!((found - expected).abs() < 1e-3, "scale {scale}, offset {offset}: {found} is not {expected}");
        }
    }
}

#[test]
fn odd_queries_and_odd_outlines() {
    let (mut vertices, segments) = outlines::flower(300);
    let fast = FastWindingNumber2d::precompute(&vertices, &segments).unwrap();
    for far in [[1e300; 2], [f64::MAX, 0.0], [1e40, -1e80]] {
        assert!(fast.evaluate(far).abs() < 1e-9);
    }
    assert!(fast.evaluate([f64::NAN, 0.0]).is_nan() && fast.evaluate([0.0, f64::INFINITY]).is_nan());
    assert!((-0.01..1.01).contains(&fast.evaluate(vertices[5])));
    // Segments of zero length span nothing, however many are at one place.
    let point = FastWindingNumber2d::precompute(&[[1.0; 2]], &[[0, 0]; 50]).unwrap();
    assert!(point.evaluate([0.0; 2]).abs() < 1e-12 && point.evaluate([1.0; 2]).abs() < 1e-12);
    assert_eq!(FastWindingNumber2d::precompute(&[], &[]).unwrap_err(), MeshError::Empty);
    let out = FastWindingNumber2d::precompute(&[[0.0; 2]], &[[0, 4]]).unwrap_err();
    assert_eq!(out, MeshError::IndexOutOfRange { element: 0, vertex: 4, vertex_count: 1 });
    vertices[3][1] = f64::NAN;
    let bad = FastWindingNumber2d::precompute(&vertices, &segments).unwrap_err();
    assert_eq!(bad, MeshError::NotFinite { vertex: 3 });
}

proptest! {
    /// Segments between few places: places with many segments, both directions, repeated segments, zero length.
    #[test]
    fn soups_are_no_harder(
        places in prop::collection::vec(prop::array::uniform2(-1.0..1.0_f64), 2..60),
        ends in prop::collection::vec(prop::array::uniform2(0_u32..1000), 1..400),
        queries in prop::collection::vec(prop::array::uniform2(-2.0..2.0_f64), 20),
    ) {
        let count = places.len() as u32;
        let segments: Vec<[u32; 2]> = ends.iter().map(|s| s.map(|v| v % count)).collect();
        let direct = winding_number_2d(&places, &segments, &queries).unwrap();
        let fast = FastWindingNumber2d::precompute(&places, &segments).unwrap().evaluate_many(&queries);
        for k in 0..queries.len() {
            prop_assert!((direct[k] - fast[k]).abs() < 1e-3 * (1.0 + 0.1 * segments.len() as f64));
        }
    }
}
