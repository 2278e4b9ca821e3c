//! Domains in the plane: what must hold for any outline, and what is known of some.

#[path = "support/outlines.rs"]
mod outlines;
mod support;

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::ops::ControlFlow;

use armature_geometry::operators::cotangent_laplacian_of_triangles;
use armature_geometry::planar::{
    PlanarDomain, PlanarError, PlanarInput, PlanarSettings, PlanarShape, Refinement, planar_domain, plane_of,
};
use armature_geometry::winding::WindingNumberHierarchy2d;
use armature_geometry::{MeshError, TriangleMesh};
use glam::{DAffine3, DQuat, DVec2, DVec3};
use outlines::Outline;
use proptest::prelude::*;

fn fill_with(
    (vertices, segments): &Outline,
    bones: &[[[f64; 2]; 2]],
    points: &[[f64; 2]],
    settings: &PlanarSettings,
) -> Result<PlanarDomain, PlanarError> {
    let shape = PlanarShape::Outline { vertices, segments };
    planar_domain(&PlanarInput { shape, bones, points }, settings, &mut |_, _| ControlFlow::Continue(()))
}

/// Fills an outline and checks what must hold for all.
fn fill(outline: &Outline) -> Result<PlanarDomain, PlanarError> {
    let domain = fill_with(outline, &[], &[], &PlanarSettings::default())?;
    check(&outline.0, &domain);
    Ok(domain)
}

fn corners(domain: &PlanarDomain, triangle: [u32; 3]) -> [DVec2; 3] {
    triangle.map(|v| domain.vertices[v as usize].into())
}

fn check(vertices: &[[f64; 2]], domain: &PlanarDomain) {
    let mut sides: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    let mut area = 0.0;
    for &t in &domain.triangles {
        let [a, b, c] = t.map(|v| domain.vertices[v as usize]).map(|[x, y]| robust::Coord { x, y });
        let doubled = robust::orient2d(a, b, c);
        assert!(doubled > 0.0, "{t:?} is flat or inside out");
        area += 0.5 * doubled;
        for k in 0..3 {
            *sides.entry([t[k], t[(k + 1) % 3]]).or_default() += 1;
        }
    }
    assert!(sides.values().all(|&count| count == 1), "triangles overlap");
    assert!((area - domain.report.area).abs() < 1e-9 * area);
    assert_eq!(domain.winding.len(), domain.triangles.len());
    let size = vertices.iter().flatten().fold(0.0, |most: f64, c| most.max(c.abs()));
    assert_eq!(domain.input_vertices.len(), vertices.len());
    for (p, &v) in vertices.iter().zip(&domain.input_vertices) {
        assert!(DVec2::from(*p).distance(domain.vertices[v as usize].into()) <= 2e-15 * size, "{p:?} is lost");
    }
    check_laplacian(domain, &sides);
}

/// Symmetric, rows sum to zero, linear functions are in its null space at interior vertices.
fn check_laplacian(domain: &PlanarDomain, sides: &BTreeMap<[u32; 2], usize>) {
    let laplacian = cotangent_laplacian_of_triangles(&domain.vertices, &domain.triangles);
    // Vertices that are almost on segments leave slivers.
    let sound = domain.report.sharp_triangles == 0;
    assert!(!sound || laplacian.degenerate_elements == 0);
    let matrix = laplacian.matrix;
    let count = domain.vertices.len();
    let mut is_interior = vec![true; count];
    for &[from, to] in sides.keys() {
        if !sides.contains_key(&[to, from]) {
            is_interior[from as usize] = false;
            is_interior[to as usize] = false;
        }
    }
    for column in 0..count {
        let range = matrix.column_starts()[column]..matrix.column_starts()[column + 1];
        let here = DVec2::from(domain.vertices[column]);
        let (mut sum, mut size) = (0.0, 0.0);
        let (mut linear, mut reach) = (DVec2::ZERO, 0.0);
        for entry in range {
            let (row, value) = (matrix.row_indices()[entry], matrix.values()[entry]);
            assert_eq!(value.to_bits(), matrix.get(column, row).to_bits(), "not symmetric");
            let offset = DVec2::from(domain.vertices[row]) - here;
            sum += value;
            size += value.abs();
            linear += value * offset;
            reach += value.abs() * offset.length();
        }
        assert!(sum.abs() <= 1e-12 * size, "row {column} sums to {sum}");
        let tolerance = if sound { 1e-9 } else { 1e-6 };
        assert!(!is_interior[column] || linear.length() <= tolerance * reach, "{linear} of {reach} at {column}");
    }
}

fn circle(count: u32, centre: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
    let at = |k: u32| TAU * f64::from(k) / f64::from(count);
    (0..count).map(|k| [centre[0] + radius * at(k).cos(), centre[1] + radius * at(k).sin()]).collect()
}

/// Several curves as one outline.
fn together(parts: &[Outline]) -> Outline {
    let mut all = Outline::default();
    for (vertices, segments) in parts {
        let first = all.0.len() as u32;
        all.0.extend(vertices);
        all.1.extend(segments.iter().map(|s| s.map(|v| v + first)));
    }
    all
}

fn reversed((vertices, segments): Outline) -> Outline {
    (vertices, segments.into_iter().map(|[a, b]| [b, a]).collect())
}

fn enclosed((vertices, segments): &Outline) -> f64 {
    let at = |v: u32| DVec2::from(vertices[v as usize]);
    0.5 * segments.iter().map(|&[a, b]| at(a).perp_dot(at(b))).sum::<f64>()
}

fn square(low: [f64; 2], side: f64) -> Outline {
    let [x, y] = low;
    outlines::closed(vec![[x, y], [x + side, y], [x + side, y + side], [x, y + side]])
}

#[test]
fn woody_stays_woody() {
    let Some(mesh) = support::shared_triangles("woody.obj") else { return };
    let flat = plane_of(&mesh).unwrap().expect("woody is flat").flatten(&mesh);
    for (vertex, flat) in mesh.vertices.iter().zip(&flat.vertices) {
        assert_eq!(vertex[..2], flat[..]);
    }
    let area: f64 = flat
        .triangles
        .iter()
        .map(|&t| {
            let [a, b, c] = t.map(|v| DVec2::from(flat.vertices[v as usize]));
            0.5 * (b - a).perp_dot(c - a).abs()
        })
        .sum();
    // A spine and an arm that meet, and a handle in the head.
    let bones = [[[160.0, 100.0], [160.0, 220.0]], [[160.0, 220.0], [300.0, 235.0]]];
    let points = [[160.0, 330.0]];
    let shape = PlanarShape::Mesh { vertices: &flat.vertices, triangles: &flat.triangles };
    let input = PlanarInput { shape, bones: &bones, points: &points };
    let mut reports = Vec::new();
    let domain = planar_domain(&input, &PlanarSettings::default(), &mut |_, done| {
        reports.push(done);
        ControlFlow::Continue(())
    })
    .unwrap();
    check(&flat.vertices, &domain);
    let report = &domain.report;
    assert!(reports.is_sorted() && reports[0] == 0.0 && *reports.last().unwrap() <= 1.0, "{reports:?}");
    assert!((report.area - area).abs() < 1e-9 * area, "{} is not {area}", report.area);
    assert!(report.winding_error < 1e-9 && report.pieces == 1 && !report.turned_over, "{report:?}");
    assert_eq!((report.refinement, report.sharp_triangles, report.bone_vertices_outside), (Refinement::Complete, 0, 0));
    assert!(report.smallest_angle.to_degrees() >= 25.0 && report.points_outside.is_empty());
    // Samples run from end to end, in steps no longer than a few edges.
    for (bone, along) in bones.iter().zip(&domain.segment_vertices) {
        let places: Vec<DVec2> = along.iter().map(|&v| domain.vertices[v as usize].into()).collect();
        assert_eq!([places[0], places[places.len() - 1]], bone.map(DVec2::from));
        assert!(places.windows(2).all(|w| w[0].distance(w[1]) < 25.0) && places.len() > 6, "{places:?}");
    }
    assert_eq!(domain.segment_vertices[0].last(), domain.segment_vertices[1].first());
    assert_eq!(DVec2::from(domain.vertices[domain.point_vertices[0] as usize]), points[0].into());
    // From the outline alone, more finely.
    let settings = PlanarSettings { largest_edge: Some(8.0), ..PlanarSettings::default() };
    let fine = planar_domain(&input, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
    check(&flat.vertices, &fine);
    assert!(fine.triangles.len() > 2 * domain.triangles.len() && (fine.report.area - area).abs() < 1e-9 * area);
}

#[test]
fn planes_are_found_in_any_position_and_only_where_they_are() {
    let Some(mesh) = support::shared_triangles("woody.obj") else { return };
    let mut noise = support::noise();
    for _ in 0..50 {
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 3.0 * noise(), 3.0 * noise(), 3.0 * noise());
        let world_from_woody = DAffine3::from_rotation_translation(turn, 200.0 * DVec3::new(noise(), noise(), noise()));
        let move_by = |p: &[f64; 3]| world_from_woody.transform_point3((*p).into()).to_array();
        let moved = TriangleMesh { vertices: mesh.vertices.iter().map(move_by).collect(), ..mesh.clone() };
        let plane = plane_of(&moved).unwrap().expect("still flat");
        assert!(plane.deviation < 1e-10, "{}", plane.deviation);
        assert!((plane.plane_from_world.matrix3.determinant() - 1.0).abs() < 1e-12);
        let flat = plane.flatten(&moved);
        for t in mesh.triangles.iter().step_by(50) {
            let [a, b] = [t[0] as usize, t[1] as usize];
            let before = DVec3::from(mesh.vertices[a]).distance(mesh.vertices[b].into());
            assert!((DVec2::from(flat.vertices[a]).distance(flat.vertices[b].into()) - before).abs() < 1e-9);
        }
        let mut bent = moved;
        bent.vertices[17] = (DVec3::from(bent.vertices[17]) + turn * DVec3::Z * 1e-5).to_array();
        assert_eq!(plane_of(&bent).unwrap(), None);
    }
    assert_eq!(plane_of(&support::sphere(1)).unwrap(), None);
    let line = TriangleMesh { vertices: vec![[0.0; 3], [1.0; 3], [2.0; 3]], triangles: vec![[0, 1, 2]] };
    assert_eq!(plane_of(&line).unwrap(), None);
    let point = TriangleMesh { vertices: vec![[1.0; 3]], triangles: vec![[0, 0, 0]] };
    assert_eq!(plane_of(&point).unwrap(), None);
    assert_eq!(plane_of(&TriangleMesh::default()).unwrap_err(), MeshError::Empty);
    // On the floor: seen from above, with the front (+Z) at the bottom.
    let floor =
        TriangleMesh { vertices: vec![[0.0, 2.0, 0.0], [1.0, 2.0, 0.0], [0.0, 2.0, 1.0]], triangles: vec![[0, 1, 2]] };
    let plane = plane_of(&floor).unwrap().expect("a floor is flat");
    assert_eq!(plane.flatten(&floor).vertices, [[0.0, 0.0], [1.0, 0.0], [0.0, -1.0]]);
}

#[test]
fn a_curve_round_twice_is_filled_once() {
    // A limaçon: the curve winds twice around its inner loop.
    let at = |k: u32| TAU * f64::from(k) / 200.0;
    let limacon = outlines::closed(
        (0..200)
            .map(|k| {
                let radius = 0.5 + (at(k) + 0.01).cos();
                [radius * (at(k) + 0.01).cos(), radius * (at(k) + 0.01).sin()]
            })
            .collect(),
    );
    let domain = fill(&limacon).unwrap();
    assert_eq!((domain.report.crossings, domain.report.pieces), (1, 1));
    let twice: f64 = domain
        .triangles
        .iter()
        .zip(&domain.winding)
        .filter(|(_, w)| **w > 1.5)
        .map(|(&t, _)| {
            let [a, b, c] = corners(&domain, t);
            0.5 * (b - a).perp_dot(c - a)
        })
        .sum();
    assert!(twice > 0.05, "{twice}");
    let enclosed = enclosed(&limacon);
    assert!((domain.report.area + twice - enclosed).abs() < 1e-9 * enclosed);
    assert!(domain.winding.iter().all(|w| (w - w.round()).abs() < 1e-9));
    // The centre of a pentagram too.
    let star = outlines::closed(
        (0..5).map(|k| [(TAU * f64::from(2 * k) / 5.0).cos(), (TAU * f64::from(2 * k) / 5.0).sin()]).collect(),
    );
    let domain = fill(&star).unwrap();
    assert_eq!((domain.report.crossings, domain.report.pieces), (5, 1));
    assert!(domain.winding.iter().any(|w| (w - 2.0).abs() < 1e-9) && domain.report.refinement == Refinement::Complete);
}

#[test]
fn a_figure_eight_has_one_lobe_that_is_inside_out() {
    let at = |k: u32| TAU * (f64::from(k) + 0.3) / 100.0;
    let mut eight = outlines::closed((0..100).map(|k| [at(k).sin(), at(k).sin() * at(k).cos()]).collect());
    // The lobe to the right is larger, so it decides.
    eight.0.iter_mut().filter(|p| p[0] > 0.0).for_each(|p| p[1] *= 1.5);
    let domain = fill(&eight).unwrap();
    assert_eq!((domain.report.crossings, domain.report.pieces), (1, 1));
    assert!(domain.vertices.len() > 100 && domain.triangles.iter().all(|&t| corners(&domain, t)[0].x > -1e-2));
    // The other one counts as error: it is nearly as large.
    assert!((0.5..0.9).contains(&domain.report.winding_error), "{:?}", domain.report);
    let back = fill(&reversed(eight)).unwrap();
    assert!(back.report.turned_over != domain.report.turned_over);
    assert!((back.report.area - domain.report.area).abs() < 1e-9);
}

#[test]
fn gaps_are_closed() {
    let (vertices, mut segments) = outlines::closed(circle(120, [3.0, -1.0], 2.0));
    segments.retain(|s| s[0] % 12 != 0);
    let gappy = (vertices, segments);
    let domain = fill(&gappy).unwrap();
    let area = 0.5 * 120.0 * 4.0 * (TAU / 120.0).sin();
    assert!((domain.report.area - area).abs() < 0.02 * area, "{:?}", domain.report);
    assert!(domain.report.pieces == 1 && domain.report.winding_error > 1e-3);
    assert!(domain.input_vertices.iter().all(|v| domain.triangles.iter().flatten().any(|u| u == v)));
    // A missing quarter is filled up to about its chord.
    let (vertices, mut segments) = outlines::closed(circle(120, [0.0; 2], 1.0));
    segments.retain(|s| s[0] >= 20);
    let area = 0.5 * 100.0 * (TAU / 120.0).sin() + 0.5 * (TAU / 6.0).sin();
    let domain = fill(&(vertices, segments)).unwrap();
    assert!((domain.report.area - area).abs() < 0.05 * area, "{} is not {area}", domain.report.area);
}

#[test]
fn holes_within_holes() {
    let ring = |radius: f64| outlines::closed(circle(60, [0.0; 2], radius));
    let target = together(&[ring(1.0), reversed(ring(0.8)), ring(0.6), reversed(ring(0.3))]);
    let domain = fill(&target).unwrap();
    let enclosed = enclosed(&target);
    assert!((domain.report.area - enclosed).abs() < 1e-9 * enclosed);
    assert_eq!(domain.report.pieces, 2);
    assert!(domain.report.winding_error < 1e-9 && domain.report.sharp_triangles == 0);
    assert!(domain.triangles.iter().all(|&t| {
        let r = (corners(&domain, t).into_iter().sum::<DVec2>() / 3.0).length();
        (0.29..0.6).contains(&r) || (0.79..1.0).contains(&r)
    }));
}

#[test]
fn copies_and_strays_do_no_harm() {
    let plain = outlines::flower(80);
    let mut messy = plain.clone();
    // Every segment three times: twice as it is, once reversed; a repeated vertex; a stray one outside; segments of
    // zero length.
    let count = messy.1.len() as u32;
    messy.1.extend(plain.1.clone());
    messy.1.extend(plain.1.iter().flat_map(|&[a, b]| [[a, b], [b, a]]));
    messy.0.extend([messy.0[3], [-2.0, 2.0]]);
    messy.1.extend([[5, 5], [3, count]]);
    let domain = fill(&messy).unwrap();
    let area = enclosed(&plain);
    assert!((domain.report.area - area).abs() < 1e-9 * area, "{:?}", domain.report);
    assert_eq!(domain.input_vertices[count as usize], domain.input_vertices[3]);
    assert!(domain.winding.iter().all(|w| (w - 2.0).abs() < 1e-9));
    let stray = *domain.input_vertices.last().unwrap();
    assert!(domain.triangles.iter().flatten().all(|&v| v != stray));
}

#[test]
fn sizes_and_places() {
    let plain = outlines::flower(60);
    let expected = fill(&plain).unwrap();
    for (scale, offset) in
        [(2.0_f64.powi(-150), 0.0), (2.0_f64.powi(150), 0.0), (1.0, 4096.0), (1e-3, -7.0), (1e-3, 1e4)]
    {
        let moved = (plain.0.iter().map(|p| p.map(|c| c * scale + offset)).collect(), plain.1.clone());
        let domain = fill(&moved).unwrap();
        let area = domain.report.area / (scale * scale);
        assert!((area - expected.report.area).abs() < 1e-6 * area, "scale {scale}, offset {offset}: {area}");
        assert!(offset != 0.0 || domain.triangles == expected.triangles);
    }
    // So far from the origin that coordinates there are a hundredth of the outline apart.
    let far = (plain.0.iter().map(|p| p.map(|c| c * 1e-6 + 1e8)).collect(), plain.1.clone());
    assert!(matches!(fill(&far), Ok(_) | Err(PlanarError::Precision)));
}

#[test]
fn bones_bridge_gaps_between_pieces() {
    let two = together(&[square([0.0, 0.0], 1.0), square([1.2, 0.0], 1.0)]);
    let settings = PlanarSettings::default();
    let apart = fill_with(&two, &[[[0.2, 0.5], [0.8, 0.5]]], &[], &settings).unwrap();
    assert_eq!((apart.report.pieces, apart.report.pieces_with_bones, apart.report.bridging_triangles), (2, 1, 0));
    let bones = [[[0.2, 0.5], [1.9, 0.5]], [[1.9, 0.5], [1.9, 0.9]]];
    let joined = fill_with(&two, &bones, &[], &settings).unwrap();
    check(&two.0, &joined);
    assert_eq!((joined.report.pieces, joined.report.pieces_with_bones, joined.report.bone_vertices_outside), (1, 1, 0));
    assert!(joined.report.bridging_triangles > 0 && (2.0..2.2).contains(&joined.report.area), "{:?}", joined.report);
    // A joint in the gap: two bones, neither of which spans it.
    let bones = [[[0.2, 0.5], [1.1, 0.5]], [[1.1, 0.5], [1.9, 0.5]]];
    let joined = fill_with(&two, &bones, &[], &settings).unwrap();
    assert_eq!((joined.report.pieces, joined.report.pieces_with_bones), (1, 1));
    // A bone that sticks out does not make the domain grow.
    let out = fill_with(&two, &[[[0.2, 0.5], [0.2, 1.5]], [[0.2, 0.5], [0.2, 40.0]]], &[], &settings).unwrap();
    check(&two.0, &out);
    assert!(out.report.bone_vertices_outside > 0 && (out.report.area - 2.0).abs() < 1e-9);
    assert!(out.segment_vertices.iter().all(|along| along.iter().all(|&v| out.vertices[v as usize][1] <= 1.0)));
}

#[test]
fn points_are_vertices_wherever_they_are() {
    let outline = outlines::flower(60);
    let points = [[0.1, 0.2], [0.1, 0.2], [1.3, -1.2], [1e9, 0.0], outline.0[7]];
    let domain = fill_with(&outline, &[], &points, &PlanarSettings::default()).unwrap();
    check(&outline.0, &domain);
    for (p, &v) in points.iter().zip(&domain.point_vertices) {
        assert_eq!(DVec2::from(domain.vertices[v as usize]), (*p).into());
    }
    assert_eq!(domain.report.points_outside, [2, 3]);
    assert_eq!(domain.point_vertices[4], domain.input_vertices[7]);
}

#[test]
fn bad_input_is_named() {
    let settings = PlanarSettings::default();
    let plain = outlines::flower(20);
    assert_eq!(fill(&Outline::default()).unwrap_err(), PlanarError::Shape(MeshError::Empty));
    let mut bad = plain.clone();
    bad.0[4][1] = f64::NAN;
    assert_eq!(fill(&bad).unwrap_err(), PlanarError::Shape(MeshError::NotFinite { vertex: 4 }));
    bad.0[4][1] = 1e200;
    assert_eq!(fill(&bad).unwrap_err(), PlanarError::Shape(MeshError::TooLarge { vertex: 4 }));
    assert_eq!(fill(&(vec![[1.0, 2.0]], vec![[0, 0]])).unwrap_err(), PlanarError::NoArea);
    let line = outlines::closed((0..10).map(|k| [f64::from(k), f64::from(3 * k)]).collect());
    assert_eq!(fill(&line).unwrap_err(), PlanarError::NothingInside);
    assert_eq!(fill(&(vec![[0.0, 0.0], [1.0, 0.0]], vec![[0, 1]])).unwrap_err(), PlanarError::NothingInside);
    let nan = [f64::NAN, 0.0];
    let bone = fill_with(&plain, &[[[0.0; 2]; 2], [[0.0; 2], nan]], &[], &settings).unwrap_err();
    assert_eq!(bone, PlanarError::BoneNotFinite { bone: 1 });
    let point = fill_with(&plain, &[], &[nan], &settings).unwrap_err();
    assert_eq!(point, PlanarError::PointNotFinite { point: 0 });
    for wrong in [
        PlanarSettings { smallest_angle: f64::NAN, ..settings },
        PlanarSettings { smallest_angle: 1.0, ..settings },
        PlanarSettings { largest_edge: Some(0.0), ..settings },
        PlanarSettings { largest_edge: Some(f64::INFINITY), ..settings },
    ] {
        assert!(matches!(fill_with(&plain, &[], &[], &wrong), Err(PlanarError::BadSetting { .. })));
    }
    let stopped = planar_domain(
        &PlanarInput {
            shape: PlanarShape::Outline { vertices: &plain.0, segments: &plain.1 },
            bones: &[],
            points: &[],
        },
        &settings,
        &mut |_, done| if done > 0.3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) },
    );
    assert_eq!(stopped.unwrap_err(), PlanarError::Cancelled);
    let few = PlanarSettings { most_vertices: 200, largest_edge: Some(0.01), ..settings };
    let coarse = fill_with(&plain, &[], &[], &few).unwrap();
    assert_eq!(coarse.report.refinement, Refinement::LimitReached);
    let crossing = fill_with(&outlines::rough(2000), &[], &[], &PlanarSettings { most_vertices: 2100, ..settings });
    assert!(matches!(crossing, Err(PlanarError::TooManyCrossings { .. })), "{crossing:?}");
}

#[test]
fn sharp_corners_stay_and_end() {
    // Needles of ever smaller angles, and a slit.
    for angle in [0.3, 0.03, 1e-3, 1e-6, 1e-9_f64] {
        let needle = outlines::closed(vec![[0.0, 0.0], [1.0, 0.0], [angle.cos(), angle.sin()]]);
        let domain = fill(&needle).unwrap();
        let area = enclosed(&needle);
        assert!((domain.report.area - area).abs() < 1e-6 * area, "{angle}: {:?}", domain.report);
    }
    let slit = outlines::closed(vec![
        [0.0, 0.0],
        [2.0, 0.0],
        [2.0, 2.0],
        [1.0 + 1e-7, 2.0],
        [1.0, 0.5],
        [1.0 - 1e-7, 2.0],
        [0.0, 2.0],
    ]);
    let domain = fill(&slit).unwrap();
    assert_eq!(domain.report.refinement, Refinement::Complete);
    let comb: Vec<[f64; 2]> = (0..60)
        .map(|k| [f64::from(k) / 60.0, if k % 2 == 0 { 0.0 } else { 0.9 }])
        .chain([[1.0, -0.5], [0.0, -0.5]])
        .collect();
    let domain = fill(&reversed(outlines::closed(comb))).unwrap();
    assert!(domain.report.sharp_triangles < domain.triangles.len() / 2, "{:?}", domain.report);
}

#[test]
fn large_outlines_take_no_time() {
    let outline = outlines::flower(20_000);
    let domain = fill_with(&outline, &[], &[], &PlanarSettings::default()).unwrap();
    check(&outline.0, &domain);
    let enclosed = enclosed(&outline);
    assert!((domain.report.area - enclosed).abs() < 1e-9 * enclosed);
    assert!(domain.report.smallest_angle > 20.0 * PI / 180.0, "{:?}", domain.report);
    let rough = outlines::rough(3000);
    let domain = fill_with(&rough, &[], &[], &PlanarSettings::default()).unwrap();
    assert!(domain.report.crossings > 500, "{:?}", domain.report);
}

/// What random outlines have in common: sound triangles, and those of clear winding number are labelled correctly.
fn agrees_with_winding(outline: &Outline, bones: &[[[f64; 2]; 2]]) -> Result<(), TestCaseError> {
    let domain = match fill_with(outline, bones, &[], &PlanarSettings::default()) {
        Ok(domain) => domain,
        Err(PlanarError::NothingInside | PlanarError::NoArea | PlanarError::Shape(MeshError::Empty)) => return Ok(()),
        Err(error) => return Err(TestCaseError::fail(format!("{error}"))),
    };
    check(&outline.0, &domain);
    let report = &domain.report;
    prop_assert!(report.pieces >= 1 && report.winding_error.is_finite());
    let exact = WindingNumberHierarchy2d::precompute(&outline.0, &outline.1).expect("it was filled");
    let sign = if report.turned_over { -1.0 } else { 1.0 };
    if report.bridging_triangles == 0 {
        for &t in &domain.triangles {
            let w = sign * exact.evaluate((corners(&domain, t).into_iter().sum::<DVec2>() / 3.0).to_array());
            prop_assert!(w > 0.1, "{w} inside");
        }
    }
    for along in &domain.segment_vertices {
        prop_assert!(along.iter().all(|v| domain.triangles.iter().flatten().any(|u| u == v)));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Closed curves through random places, which intersect themselves again and again.
    #[test]
    fn random_closed_curves(
        places in prop::collection::vec(prop::array::uniform2(-1.0..1.0_f64), 3..25),
        bones in prop::collection::vec(prop::array::uniform2(prop::array::uniform2(-1.2..1.2_f64)), 0..4),
    ) {
        agrees_with_winding(&outlines::closed(places), &bones)?;
    }

    /// Closed curves on a coarse grid: corners on segments, overlapping segments, repeated places.
    #[test]
    fn random_closed_curves_on_a_grid(
        places in prop::collection::vec(prop::array::uniform2(0_u8..5), 3..25),
        bones in prop::collection::vec(prop::array::uniform2(prop::array::uniform2(0_u8..5)), 0..4),
    ) {
        let curve = outlines::closed(places.iter().map(|p| p.map(f64::from)).collect());
        let bones: Vec<_> = bones.iter().map(|b| b.map(|p| p.map(f64::from))).collect();
        agrees_with_winding(&curve, &bones)?;
    }

    /// Star-shaped outlines with gaps and noise.
    #[test]
    fn random_stars_with_gaps(
        radii in prop::collection::vec(0.3..1.0_f64, 8..60),
        missing in prop::collection::vec(any::<prop::sample::Index>(), 0..3),
    ) {
        let count = radii.len();
        let at = |k: usize| TAU * k as f64 / count as f64;
        let (vertices, segments) =
            outlines::closed((0..count).map(|k| [radii[k] * at(k).cos(), radii[k] * at(k).sin()]).collect());
        let gone: Vec<usize> = missing.iter().map(|m| m.index(count)).collect();
        let kept = segments.iter().enumerate().filter(|(k, _)| !gone.contains(k)).map(|(_, &s)| s).collect();
        agrees_with_winding(&(vertices.clone(), kept), &[[[0.0, 0.0], [0.2, 0.1]]])?;
        // Without gaps, the area is what the curve encloses.
        let whole = (vertices, segments);
        let domain = fill(&whole).unwrap();
        prop_assert!((domain.report.area - enclosed(&whole)).abs() < 1e-9 * domain.report.area);
        prop_assert_eq!(domain.report.pieces, 1);
    }

    /// Segments between random places with open ends everywhere, and triangles between them.
    #[test]
    fn random_segments_and_flat_soups(
        places in prop::collection::vec(prop::array::uniform2(-1.0..1.0_f64), 3..20),
        ends in prop::collection::vec(prop::array::uniform3(0_u32..1000), 1..30),
    ) {
        let count = places.len() as u32;
        let segments = ends.iter().map(|&[a, b, _]| [a % count, b % count]).collect();
        agrees_with_winding(&(places.clone(), segments), &[])?;
        let triangles: Vec<[u32; 3]> = ends.iter().map(|t| t.map(|v| v % count)).collect();
        let shape = PlanarShape::Mesh { vertices: &places, triangles: &triangles };
        let input = PlanarInput { shape, bones: &[], points: &[] };
        match planar_domain(&input, &PlanarSettings::default(), &mut |_, _| ControlFlow::Continue(())) {
            Ok(domain) => {
                check(&places, &domain);
                prop_assert!(domain.report.winding_error < 100.0 && !domain.report.turned_over);
            }
            Err(error) => prop_assert!(matches!(error, PlanarError::NothingInside | PlanarError::NoArea | PlanarError::Shape(MeshError::Empty)), "{}", error),
        }
    }
}
