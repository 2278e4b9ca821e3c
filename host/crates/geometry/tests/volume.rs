//! Volumes of all the shared models: what must hold for each, whatever state its surface is in.
#![allow(clippy::unwrap_used, reason = "a test that finds no value has to fail")]

mod support;

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use armature_geometry::operators::cotangent_laplacian_tetrahedra;
use armature_geometry::volume::{
    Resolution, ShellShortfall, Volume, VolumeConstraints, VolumeError, VolumeInput, VolumeSettings, volume,
};
use armature_geometry::winding::FastWindingNumber;
use armature_geometry::{TetrahedralMesh, TriangleMesh};
use armature_test_support::shared;
use glam::DVec3;
use proptest::prelude::*;
use robust::{Coord3D, orient3d};
use support::{noise, shared_triangles, sphere};

const MODELS: [&str; 6] = ["armadillo.obj", "elephant.obj", "arm.obj", "spot.obj", "cow.off", "truck.obj"];
const CONFORMING: Resolution = Resolution::Conforming;
const EMBEDDED: Resolution = Resolution::Embedded { vertices: 4000 };

fn make(surface: &TriangleMesh, segments: &[[[f64; 3]; 2]], resolution: Resolution) -> Result<Volume, VolumeError> {
    let settings = VolumeSettings { resolution, ..VolumeSettings::default() };
    volume(&VolumeInput { surface, segments, points: &[] }, &settings, &mut |_, _| ControlFlow::Continue(()))
}

/// The bones of a shared TGF file.
fn bones(name: &str) -> Vec<[[f64; 3]; 2]> {
    let Some(path) = shared(name) else { return Vec::new() };
    let text = std::fs::read_to_string(path).unwrap();
    let (joints, edges) = text.split_once('#').unwrap();
    let joints: BTreeMap<&str, [f64; 3]> = joints
        .lines()
        .map(|line| line.split_whitespace().collect::<Vec<_>>())
        .filter(|words| words.len() > 3)
        .map(|words| (words[0], std::array::from_fn(|k| words[k + 1].parse().unwrap())))
        .collect();
    let ends = edges.lines().map(|line| line.split_whitespace().take(2).collect::<Vec<_>>());
    ends.filter(|ends| ends.len() == 2).map(|ends| [joints[ends[0]], joints[ends[1]]]).collect()
}

fn skeleton_of(model: &str) -> Vec<[[f64; 3]; 2]> {
    match model {
        "armadillo.obj" | "elephant.obj" => bones(&model.replace("obj", "tgf")),
        _ => Vec::new(),
    }
}

fn volume_of(mesh: &TetrahedralMesh) -> f64 {
    let at = |v: u32| DVec3::from(mesh.vertices[v as usize]);
    mesh.tetrahedra.iter().map(|&[a, b, c, d]| (at(b) - at(a)).dot((at(c) - at(a)).cross(at(d) - at(a))) / 6.0).sum()
}

/// Holds for every volume.
fn check(name: &str, surface: &TriangleMesh, made: &Volume) {
    let mesh = &made.mesh;
    assert!(mesh.validate().is_ok() && made.winding.len() == mesh.tetrahedra.len(), "{name}");
    let exact = |v: u32| {
        let [x, y, z] = mesh.vertices[v as usize];
        Coord3D { x, y, z }
    };
    let mut facets: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    let mut used = vec![false; mesh.vertices.len()];
    for t in &mesh.tetrahedra {
        let [a, b, c, d] = t.map(exact);
        assert!(orient3d(a, b, c, d) < 0.0, "{name}: {t:?} is flat or inverted");
        for k in 0..4 {
            let mut facet = [t[(k + 1) % 4], t[(k + 2) % 4], t[(k + 3) % 4]];
            facet.sort_unstable();
            *facets.entry(facet).or_default() += 1;
            used[t[k] as usize] = true;
        }
    }
    assert!(facets.values().all(|&count| count <= 2), "{name}: a facet has more than two elements");
    assert!(used.iter().all(|&u| u), "{name}: a vertex belongs to no element");
    assert!((volume_of(mesh) - made.report.volume).abs() <= 1e-9 * made.report.volume, "{name}");
    let handles = made.segment_vertices.iter().flatten().chain(&made.point_vertices);
    assert!(handles.into_iter().all(|&v| (v as usize) < used.len()), "{name}: a handle has no vertex");
    let embedding = &made.surface;
    assert_eq!(embedding.tetrahedra.len(), surface.vertices.len(), "{name}");
    for (vertex, (&tet, share)) in embedding.tetrahedra.iter().zip(&embedding.barycentric).enumerate() {
        let corners = mesh.tetrahedra[tet as usize];
        let place: DVec3 = (0..4).map(|k| share[k] * DVec3::from(mesh.vertices[corners[k] as usize])).sum();
        let off = place.distance(DVec3::from(surface.vertices[vertex]));
        let (low, high) = surface.bounds().unwrap();
        let size = DVec3::from(low).distance(DVec3::from(high));
        assert!((off - embedding.distance[vertex]).abs() <= 1e-9 * size, "{name}: vertex {vertex} is off by {off}");
        assert!(share.iter().all(|&s| s >= 0.0) && (share.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{name}");
    }
}

/// The volume of where the winding number of a surface is above a half, on a lattice; and three standard errors.
fn lattice_volume(surface: &TriangleMesh) -> (f64, f64) {
    const SIDE: usize = 60;
    let winding = FastWindingNumber::precompute(surface).unwrap();
    let (low, high) = surface.bounds().unwrap();
    let mut noise = noise();
    let mut points = Vec::with_capacity(SIDE * SIDE * SIDE);
    for i in 0..SIDE * SIDE * SIDE {
        let cell = [i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE];
        let share = cell.map(|c| (c as f64 + 0.5 + 0.5 * noise()) / SIDE as f64);
        points.push(std::array::from_fn(|k| low[k] + share[k] * (high[k] - low[k])));
    }
    let inside = winding.evaluate_many(&points).iter().filter(|&&w| w > 0.5).count() as f64;
    let cell: f64 = (0..3).map(|k| (high[k] - low[k]) / SIDE as f64).product();
    (inside * cell, 3.0 * inside.sqrt() * cell)
}

#[test]
fn conforming_volumes_hold_every_vertex_and_facet() {
    for model in MODELS {
        let Some(surface) = shared_triangles(model) else { continue };
        let made = make(&surface, &skeleton_of(model), CONFORMING).unwrap();
        check(model, &surface, &made);
        let report = &made.report;
        let in_triangles: std::collections::BTreeSet<u32> = surface.triangles.iter().flatten().copied().collect();
        for &vertex in &in_triangles {
            assert!(made.surface.distance[vertex as usize] <= 0.0, "{model}: vertex {vertex} is not in the volume");
            assert!(
                made.surface.barycentric[vertex as usize].contains(&1.0),
                "{model}: vertex {vertex} is not a vertex of the volume"
            );
        }
        if report.closed {
            let signed = armature_geometry::surface::diagnose(&surface).unwrap().signed_volume;
            // A bone that leaves the surface adds a few elements.
            let more = if report.elements_for_bones == 0 { 1e-9 } else { 1e-5 };
            assert!((report.volume - signed).abs() <= more * signed, "{model}: {} of {signed}", report.volume);
            assert!(report.facets_whole as f64 >= 0.99 * report.facets as f64, "{model}");
            let below = report.dihedral_angles.as_ref().unwrap().share_below(5);
            assert!(below <= 1e-3, "{model}: {below} of the dihedral angles are below 5 degrees");
            assert!((report.area_covered - 1.0).abs() < 1e-9 && report.winding_error <= 1e-5, "{model}");
        }
    }
}

/// The smallest height of any element, relative to its longest edge.
fn least_height(mesh: &TetrahedralMesh) -> f64 {
    let height = |t: &[u32; 4]| {
        let p = t.map(|v| DVec3::from(mesh.vertices[v as usize]));
        let pairs = (0..4).flat_map(|i| (0..i).map(move |j| (i, j)));
        let longest = pairs.map(|(i, j)| p[i].distance(p[j])).fold(0.0, f64::max);
        let doubled = |k: usize| (p[(k + 2) % 4] - p[(k + 1) % 4]).cross(p[(k + 3) % 4] - p[(k + 1) % 4]).length();
        let largest = (0..4).map(doubled).fold(0.0, f64::max);
        (p[1] - p[0]).dot((p[2] - p[0]).cross(p[3] - p[0])) / (largest * longest)
    };
    mesh.tetrahedra.iter().map(height).fold(f64::INFINITY, f64::min)
}

#[test]
fn where_surfaces_cross_no_strays_or_flat_elements_are_left() {
    // Two balls, one in the other by half; and a cow whose horns and eyes pass through its head.
    if let Some(balls) = shared_triangles("cases/mesh/two-spheres.obj") {
        let made = make(&balls, &[], CONFORMING).unwrap();
        check("two spheres", &balls, &made);
        assert_eq!(made.report.pieces, 1);
        assert!(made.report.pieces_left_out > 0 && made.report.flat_elements_left_out > 0, "{:?}", made.report);
        assert!(made.surface.distance.iter().all(|&off| off <= 0.0), "every vertex is still in the volume");
        assert!(least_height(&made.mesh) > 1e-3, "{:e}", least_height(&made.mesh));
    }
    if let Some(cow) = shared_triangles("cow.off") {
        let made = make(&cow, &[], CONFORMING).unwrap();
        assert!(least_height(&made.mesh) > 1e-9, "{:e}", least_height(&made.mesh));
    }
}

#[test]
fn embedded_volumes_fit_and_hold_all_bones_in_one_piece() {
    for model in MODELS {
        let Some(surface) = shared_triangles(model) else { continue };
        let segments = skeleton_of(model);
        let made = make(&surface, &segments, EMBEDDED).unwrap();
        check(model, &surface, &made);
        check_laplacian(model, &made.mesh);
        assert!((2000..8000).contains(&made.mesh.vertices.len()), "{model}: {} vertices", made.mesh.vertices.len());
        assert_eq!(made.report.bones_apart, 0, "{model}");
        assert_eq!(made.segment_vertices.len(), segments.len());
        for (run, segment) in made.segment_vertices.iter().zip(&segments) {
            for (vertex, end) in [run[0], run[run.len() - 1]].into_iter().zip(segment) {
                let off = DVec3::from(made.mesh.vertices[vertex as usize]).distance(DVec3::from(*end));
                assert!(off <= 0.0, "{model}: a bone does not end at a vertex");
            }
        }
        let (volume, error) = lattice_volume(&armature_geometry::orientation::orient_patches(&surface).unwrap().mesh);
        let tolerance = 0.05 * volume + error + if made.report.closed { 0.0 } else { 0.15 * volume };
        assert!((made.report.volume - volume).abs() <= tolerance, "{model}: {} of {volume}", made.report.volume);
    }
}

/// The Laplacian of a volume is symmetric, its rows sum to zero, and linear functions are harmonic inside.
fn check_laplacian(model: &str, mesh: &TetrahedralMesh) {
    let laplacian = cotangent_laplacian_tetrahedra(mesh).unwrap().matrix;
    let n = mesh.vertices.len();
    let scale: Vec<f64> = (0..n).map(|v| laplacian.column(v).map(|(_, l)| l.abs()).sum()).collect();
    let (low, high) = mesh.bounds().unwrap();
    let size = DVec3::from(low).distance(DVec3::from(high));
    let on_boundary = boundary_vertices(mesh);
    let coordinates: [Vec<f64>; 3] = std::array::from_fn(|k| mesh.vertices.iter().map(|p| p[k] - low[k]).collect());
    let applied = coordinates.map(|x| laplacian.multiply(&x));
    let sums = laplacian.multiply(&vec![1.0; n]);
    for v in 0..n {
        for (row, value) in laplacian.column(v) {
            let twin = laplacian.get(v, row);
            assert!((value - twin).abs() <= 1e-12 * scale[v].max(scale[row]), "{model}: not symmetric");
        }
        assert!(sums[v].abs() <= 1e-9 * scale[v], "{model}: row {v} sums to {}", sums[v]);
        if !on_boundary[v] {
            for image in &applied {
                assert!(image[v].abs() <= 1e-9 * scale[v] * size, "{model}: {} at {v}", image[v]);
            }
        }
    }
}

fn boundary_vertices(mesh: &TetrahedralMesh) -> Vec<bool> {
    let mut count: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    for t in &mesh.tetrahedra {
        for k in 0..4 {
            let mut facet = [t[(k + 1) % 4], t[(k + 2) % 4], t[(k + 3) % 4]];
            facet.sort_unstable();
            *count.entry(facet).or_default() += 1;
        }
    }
    let mut on_boundary = vec![false; mesh.vertices.len()];
    for (facet, _) in count.iter().filter(|&(_, &count)| count == 1) {
        facet.iter().for_each(|&v| on_boundary[v as usize] = true);
    }
    on_boundary
}

#[test]
fn loose_triangles_have_a_volume_too() {
    let ball = sphere(4);
    let mut soup = TriangleMesh::default();
    let mut noise = noise();
    for t in &ball.triangles {
        let by: [f64; 3] = std::array::from_fn(|_| 0.02 * noise());
        let first = soup.vertices.len() as u32;
        soup.vertices.extend(t.map(|v| std::array::from_fn::<f64, 3, _>(|k| ball.vertices[v as usize][k] + by[k])));
        soup.triangles.push([first, first + 1, first + 2]);
    }
    let made = make(&soup, &[], Resolution::Embedded { vertices: 2000 }).unwrap();
    check("soup", &soup, &made);
    assert_eq!(made.report.shortfall, Some(ShellShortfall::Samples));
    let ball = 4.0 / 3.0 * std::f64::consts::PI;
    assert!((made.report.volume - ball).abs() < 0.1 * ball, "{}", made.report.volume);
}

#[test]
fn two_sheets_a_hair_apart_are_not_glued() {
    // Two spheres side by side, their gap a hundredth of their size.
    let one = sphere(4);
    let mut surface = one.clone();
    let offset = one.vertices.len() as u32;
    surface.vertices.extend(one.vertices.iter().map(|&[x, y, z]| [x + 2.02, y, z]));
    surface.triangles.extend(one.triangles.iter().map(|t| t.map(|v| v + offset)));
    for resolution in [CONFORMING, Resolution::Embedded { vertices: 1500 }] {
        let made = make(&surface, &[], resolution).unwrap();
        check("spheres", &surface, &made);
        assert_eq!(made.report.pieces, 2, "{resolution:?}");
        for (vertex, &tet) in made.surface.tetrahedra.iter().enumerate() {
            let corner = made.mesh.tetrahedra[tet as usize][0];
            let is_right = vertex >= offset as usize;
            assert_eq!(
                made.mesh.vertices[corner as usize][0] > 1.01,
                is_right,
                "vertex {vertex} is in the other sphere"
            );
        }
    }
}

#[test]
fn what_cannot_be_a_volume_says_why() {
    let ball = sphere(2);
    let mut flat = ball.clone();
    flat.vertices.iter_mut().for_each(|v| v[2] = 0.0);
    for resolution in [CONFORMING, Resolution::Embedded { vertices: 500 }] {
        assert!(matches!(make(&TriangleMesh::default(), &[], resolution), Err(VolumeError::Mesh(_))));
        assert!(make(&flat, &[], resolution).is_err());
        let mut bad = ball.clone();
        bad.vertices[3][1] = f64::NAN;
        assert!(matches!(make(&bad, &[], resolution), Err(VolumeError::Mesh(_))));
        let bone = [[0.0; 3], [f64::INFINITY, 0.0, 0.0]];
        let error = make(&ball, &[[[0.0; 3]; 2], bone], resolution).unwrap_err();
        assert_eq!(error, VolumeError::NotFinite { what: "bone", index: 1 });
        let one = TriangleMesh { vertices: ball.vertices[..3].to_vec(), triangles: vec![[0, 1, 2], [0, 0, 0]] };
        assert!(make(&one, &[], resolution).is_err());
    }
}

#[test]
fn cancelling_stops_at_any_stage() {
    let surface = sphere(4);
    let input = VolumeInput { surface: &surface, segments: &[], points: &[] };
    for resolution in [CONFORMING, Resolution::Embedded { vertices: 800 }] {
        let settings = VolumeSettings { resolution, ..VolumeSettings::default() };
        let mut calls = 0;
        let mut stages = Vec::new();
        volume(&input, &settings, &mut |stage, fraction| {
            assert!((0.0..=1.0).contains(&fraction), "{stage:?} {fraction}");
            if stages.last() != Some(&stage) {
                stages.push(stage);
            }
            calls += 1;
            ControlFlow::Continue(())
        })
        .unwrap();
        assert!(stages.len() >= 4, "{stages:?}");
        for stop in [0, calls / 3, calls - 1] {
            let mut count = 0;
            let stopped = volume(&input, &settings, &mut |_, _| {
                count += 1;
                if count > stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            assert_eq!(stopped.unwrap_err(), VolumeError::Cancelled);
        }
    }
}

#[test]
fn constraints_keep_thin_sheets_and_make_the_boundary_manifold() {
    // A ball with a fin, which has no volume of its own.
    let mut surface = sphere(3);
    let fin = surface.vertices.len() as u32;
    surface.vertices.extend([[1.0, 0.0, 0.0], [1.6, 0.1, 0.3], [1.6, -0.1, -0.3]]);
    surface.triangles.push([fin, fin + 1, fin + 2]);
    for (facets, manifold) in [(false, false), (true, false), (true, true)] {
        let constraints = VolumeConstraints { facets, manifold };
        let resolution = Resolution::Embedded { vertices: 1500 };
        let settings = VolumeSettings { resolution, constraints, ..VolumeSettings::default() };
        let input = VolumeInput { surface: &surface, segments: &[], points: &[] };
        let made = volume(&input, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
        check("fin", &surface, &made);
        let tip = made.surface.distance[fin as usize + 1];
        assert_eq!(tip < 0.05, facets, "the fin's tip is {tip} away");
        assert_eq!(made.report.elements_for_constraints > 0, facets);
        assert_eq!(made.report.constraints_unsatisfied, 0);
        if manifold {
            let diagnosis = armature_geometry::surface::diagnose(&boundary(&made.mesh)).unwrap();
            assert_eq!((diagnosis.non_manifold_edges, diagnosis.non_manifold_vertices), (0, 0));
        }
    }
}

/// The facets with one element.
fn boundary(mesh: &TetrahedralMesh) -> TriangleMesh {
    let mut facets: BTreeMap<[u32; 3], Vec<[u32; 3]>> = BTreeMap::new();
    for t in &mesh.tetrahedra {
        for facet in [[t[1], t[2], t[3]], [t[0], t[3], t[2]], [t[0], t[1], t[3]], [t[0], t[2], t[1]]] {
            let mut key = facet;
            key.sort_unstable();
            facets.entry(key).or_default().push(facet);
        }
    }
    let alone = facets.into_values().filter(|sides| sides.len() == 1).flatten().collect();
    TriangleMesh { vertices: mesh.vertices.clone(), triangles: alone }
}

#[test]
fn bones_outside_are_joined_to_the_volume() {
    let surface = sphere(3);
    let segments = [[[0.0, 0.0, 0.0], [0.0, 0.0, 0.5]], [[0.0, 0.0, 0.5], [0.0, 0.0, 1.5]]];
    let made = make(&surface, &segments, EMBEDDED).unwrap();
    check("sphere", &surface, &made);
    assert_eq!(made.report.bones_apart, 0);
    assert!(made.report.elements_for_bones > 0);
}

#[test]
fn slivers_that_join_a_bone_stay() {
    // A random find: peeling slivers off this soup disconnected its bone.
    let corners = [
        [0.0, 0.0, 1.0],
        [0.0, 0.0, 0.0],
        [1.0, 1.0, 4.0],
        [5.0, 1.0, 5.0],
        [2.0, 0.0, 5.0],
        [1.0, 1.0, 2.0],
        [2.0, 0.0, 0.0],
        [1.0, 0.0, 1.0],
        [2.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
    ];
    let triangles = vec![
        [16, 9, 5],
        [1, 2, 13],
        [15, 7, 15],
        [3, 2, 14],
        [4, 3, 0],
        [4, 15, 12],
        [15, 2, 0],
        [6, 7, 16],
        [10, 7, 11],
        [10, 15, 6],
        [5, 14, 15],
        [11, 5, 5],
        [6, 14, 3],
        [6, 14, 17],
        [10, 14, 3],
        [4, 15, 5],
        [1, 16, 0],
        [4, 12, 17],
        [16, 11, 15],
        [11, 3, 13],
        [14, 5, 17],
        [1, 7, 0],
        [4, 16, 9],
        [15, 3, 5],
        [8, 8, 16],
        [11, 7, 5],
        [8, 3, 4],
        [14, 0, 9],
        [2, 11, 5],
        [14, 6, 2],
        [7, 2, 0],
        [16, 1, 2],
        [11, 6, 4],
        [4, 15, 13],
        [7, 9, 0],
        [0, 7, 7],
        [12, 0, 13],
        [6, 0, 5],
        [12, 8, 4],
        [1, 14, 7],
        [11, 4, 10],
        [17, 12, 11],
        [10, 1, 4],
        [3, 11, 12],
        [4, 17, 4],
        [11, 14, 1],
        [0, 14, 9],
        [14, 10, 4],
        [7, 9, 8],
    ];
    let mut noise = noise();
    let mut place = |c: [f64; 3]| c.map(|c| c + 1e-12 * noise());
    let vertices: Vec<[f64; 3]> = corners.into_iter().map(&mut place).collect();
    let segments = [[place([1.0, 4.0, 5.0]), place([2.0, -1.0, -1.0])]];
    let surface = TriangleMesh { vertices, triangles };
    let made = make(&surface, &segments, Resolution::Embedded { vertices: 200 }).unwrap();
    check("soup", &surface, &made);
    assert_eq!(made.report.bones_apart, 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn any_soup_gives_a_volume_or_says_why_not(
        corners in prop::collection::vec([0_u8..6, 0_u8..6, 0_u8..6], 3..40),
        triangles in prop::collection::vec([any::<u16>(), any::<u16>(), any::<u16>()], 1..80),
        bones in prop::collection::vec([[-1_i8..8, -1_i8..8, -1_i8..8], [-1_i8..8, -1_i8..8, -1_i8..8]], 0..4),
        roughness in prop::sample::select(vec![0.0, 1e-12, 1e-3, 0.3]),
        scale in prop::sample::select(vec![1e-30, 1.0, 1e30]),
        conforming in any::<bool>(),
    ) {
        let mut noise = noise();
        let mut place = |c: [f64; 3]| c.map(|c| (c + roughness * noise()) * scale);
        let vertices: Vec<[f64; 3]> = corners.iter().map(|c| place(c.map(f64::from))).collect();
        let triangles = triangles.iter().map(|t| t.map(|v| u32::from(v) % vertices.len() as u32)).collect();
        let segments: Vec<_> = bones.iter().map(|ends| ends.map(|c| place(c.map(f64::from)))).collect();
        let surface = TriangleMesh { vertices, triangles };
        let resolution = if conforming { CONFORMING } else { Resolution::Embedded { vertices: 200 } };
        match make(&surface, &segments, resolution) {
            Ok(made) => {
                check("soup", &surface, &made);
                prop_assert_eq!(made.report.bones_apart, 0);
            }
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }
}
