//! Segmentations of Delaunay tetrahedra: against trying all labels, thresholds, volumes, and themselves in other units.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has to fail")]

mod support;

use std::ops::ControlFlow;

use armature_geometry::TriangleMesh;
use armature_geometry::delaunay::delaunay_tetrahedra;
use armature_geometry::segmentation::{
    ElementWinding, ElementWindingSettings, Label, Segmentation, SegmentationError, SegmentationSettings,
    connect_vertices, connected_pieces, element_winding, graph_cut, graph_cut_with_forced_labels,
};
use armature_geometry::winding::{FastWindingNumber, WindingNumberHierarchy2d};
use glam::DVec3;
use proptest::prelude::*;

const HULL: u32 = u32::MAX;

fn go(_: &str, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Tetrahedra in the form the segmentation takes.
struct Elements {
    vertices: Vec<[f64; 3]>,
    tetrahedra: Vec<[u32; 4]>,
    neighbours: Vec<[u32; 4]>,
    areas: Vec<[f64; 4]>,
    volumes: Vec<f64>,
}

/// The Delaunay tetrahedra of a mesh's vertices, the corners of a box around it, and `inner` random points in the box.
fn elements(mesh: &TriangleMesh, inner: usize) -> Elements {
    let (low, high) = mesh.bounds().unwrap();
    let mut noise = support::noise();
    let mut vertices = mesh.vertices.clone();
    let place = |at: [f64; 3]| std::array::from_fn(|k| low[k] + (0.5 + 0.6 * at[k]) * (high[k] - low[k]));
    vertices.extend((0..8).map(|c| place(std::array::from_fn(|k| f64::from(c >> k & 1) * 2.0 - 1.0))));
    vertices.extend((0..inner).map(|_| place(std::array::from_fn(|_| noise()))));
    let delaunay = delaunay_tetrahedra(&vertices, &mut go).unwrap();
    let corners = |t: &[u32; 4]| t.map(|v| DVec3::from(vertices[v as usize]));
    let area = |t: &[u32; 4], k: usize| {
        let [a, b, c] = [1, 2, 3].map(|step| corners(t)[(k + step) % 4]);
        0.5 * (b - a).cross(c - a).length()
    };
    let volume = |t: &[u32; 4]| {
        let [a, b, c, d] = corners(t);
        (b - a).dot((c - a).cross(d - a)) / 6.0
    };
    Elements {
        areas: delaunay.tetrahedra.iter().map(|t| std::array::from_fn(|k| area(t, k))).collect(),
        volumes: delaunay.tetrahedra.iter().map(volume).collect(),
        vertices,
        tetrahedra: delaunay.tetrahedra,
        neighbours: delaunay.neighbours,
    }
}

impl Elements {
    fn winding(&self, mesh: &TriangleMesh, settings: &ElementWindingSettings) -> ElementWinding {
        let number = FastWindingNumber::precompute(mesh).unwrap();
        let evaluate = |p| number.evaluate(p);
        element_winding(&self.vertices, &self.tetrahedra, &self.neighbours, &evaluate, settings, &mut go).unwrap()
    }

    fn cut(&self, winding: &[f64]) -> Segmentation {
        graph_cut(winding, &self.neighbours, &self.areas, &SegmentationSettings::default(), &mut go).unwrap()
    }

    fn volume(&self, inside: &[bool]) -> f64 {
        self.volumes.iter().zip(inside).filter(|(_, inside)| **inside).map(|(v, _)| v).sum()
    }
}

/// The volume where the winding number is at least ½, estimated from random points in a surrounding box.
fn volume_by_points(mesh: &TriangleMesh, count: usize) -> f64 {
    let (low, high) = mesh.bounds().unwrap();
    let mut noise = support::noise();
    let points: Vec<[f64; 3]> =
        (0..count).map(|_| std::array::from_fn(|k| low[k] + (0.5 + 0.5 * noise()) * (high[k] - low[k]))).collect();
    let winding = FastWindingNumber::precompute(mesh).unwrap().evaluate_many(&points);
    let share = winding.iter().filter(|&&w| w >= 0.5).count() as f64 / count as f64;
    share * (DVec3::from(high) - DVec3::from(low)).element_product()
}

fn proven(segmentation: &Segmentation) {
    let gap = segmentation.energy - segmentation.lower_bound;
    assert!((0.0..1e-6 * (1.0 + segmentation.energy)).contains(&gap), "{gap} is between bound and energy");
}

/// Equation 8.8 written down as it stands.
fn energy(
    winding: &[f64],
    neighbours: &[[u32; 4]],
    sizes: &[[f64; 4]],
    settings: &SegmentationSettings,
    x: &[bool],
) -> f64 {
    let mean = |t: usize| sizes[t].iter().sum::<f64>() / 4.0;
    let mut energy = 0.0;
    for t in 0..x.len() {
        energy += if x[t] { (1.0 - winding[t]).max(0.0) } else { winding[t].max(0.0) };
        for k in 0..4 {
            let n = neighbours[t][k];
            let (w, label, other, share) =
                if n == HULL { (0.0, false, t, 1.0) } else { (winding[n as usize], x[n as usize], n as usize, 0.5) };
            if x[t] != label {
                let size = 2.0 * sizes[t][k] / (mean(t) + mean(other));
                let jump = winding[t] - w;
                energy += share * settings.gamma * size * (-jump * jump / (2.0 * settings.sigma.powi(2))).exp();
            }
        }
    }
    energy
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn finds_the_labels_that_trying_all_finds(
        arcs in prop::collection::vec((0_usize..9, 0_usize..9, 0.0_f64..3.0), 4..30),
        winding in prop::collection::vec(-0.5_f64..1.5, 9),
        own in prop::collection::vec(0.1_f64..2.0, 36),
        forced in prop::collection::vec(0_u8..8, 9),
        gamma in 0.0_f64..2.0,
        sigma in 0.05_f64..1.0,
    ) {
        let mut neighbours = vec![[HULL; 4]; 9];
        let mut sizes: Vec<[f64; 4]> = own.chunks(4).map(|c| c.try_into().unwrap()).collect();
        for (a, b, size) in arcs {
            let place = |row: &[u32; 4]| row.iter().position(|&n| n == HULL);
            if let (true, Some(k), Some(l)) = (a != b, place(&neighbours[a]), place(&neighbours[b])) {
                (neighbours[a][k], neighbours[b][l]) = (b as u32, a as u32);
                (sizes[a][k], sizes[b][l]) = (size, size);
            }
        }
        let forced: Vec<Label> =
            forced.iter().map(|f| [Label::Inside, Label::Outside, Label::Free][usize::from(*f).min(2)]).collect();
        let settings = SegmentationSettings { gamma, sigma };
        let found = graph_cut_with_forced_labels(&winding, &neighbours, &sizes, &forced, &settings, &mut go).unwrap();
        let obeys = |x: &[bool]| {
            x.iter().zip(&forced).all(|(&x, f)| *f == Label::Free || x == (*f == Label::Inside))
        };
        let of = |x: &[bool]| energy(&winding, &neighbours, &sizes, &settings, x);
        let least = (0..512_u32)
            .map(|bits| (0..9).map(|t| bits >> t & 1 == 1).collect::<Vec<_>>())
            .filter(|x| obeys(x))
            .map(|x| of(&x))
            .fold(f64::INFINITY, f64::min);
        prop_assert!(obeys(&found.inside));
        prop_assert!((found.energy - of(&found.inside)).abs() < 1e-12);
        prop_assert!((found.energy - least).abs() < 1e-12);
        prop_assert!(found.lower_bound <= least && least - found.lower_bound < 1e-9);
    }
}

#[test]
fn clean_meshes_are_thresholded() {
    for file in ["armadillo.obj", "cow.off", "spot.obj"] {
        let Some(mesh) = support::shared_triangles(file) else { continue };
        let elements = elements(&mesh, 0);
        let settings = ElementWindingSettings { from_neighbour: f64::INFINITY, ..ElementWindingSettings::default() };
        let winding = elements.winding(&mesh, &settings).means;
        // As if the surface were made of facets: then every element is wholly inside or outside.
        let whole: Vec<f64> = winding.iter().map(|w| w.round()).collect();
        let cut = elements.cut(&whole);
        assert_eq!(cut.changed_by_neighbours, 0, "{file}");
        proven(&cut);
        // In fact the surface cuts through elements where Delaunay lost its facets.
        let cut = elements.cut(&winding);
        let changed = cut.changed_by_neighbours as f64 / winding.len() as f64;
        assert!(changed < 5e-3, "{file}: {changed} of the labels follow their neighbours");
        proven(&cut);
        let (volume, expected) = (elements.volume(&cut.inside), volume_by_points(&mesh, 30_000));
        assert!((volume / expected - 1.0).abs() < 0.03, "{file}: volume {volume}, not {expected}");
    }
}

#[test]
fn sphere_without_a_cap_or_covered_twice_is_still_a_ball() {
    let sphere = support::sphere(3);
    let ball = elements(&sphere, 2000);
    let without = |low: f64| {
        let mut open = sphere.clone();
        open.triangles.retain(|t| t.iter().all(|&v| sphere.vertices[v as usize][1] < low));
        open
    };
    let mut twice = sphere.clone();
    twice.triangles.extend(&sphere.triangles);
    for (mesh, name, off) in [(without(0.8), "open", 0.08), (twice, "twice", 0.02), (sphere.clone(), "whole", 0.02)] {
        let winding = ball.winding(&mesh, &ElementWindingSettings::default()).means;
        let cut = ball.cut(&winding);
        proven(&cut);
        let volume = ball.volume(&cut.inside) / (std::f64::consts::PI * 4.0 / 3.0);
        assert!((volume - 1.0).abs() < off, "{name}: {volume} of a ball");
        if name == "twice" {
            assert!(winding.iter().any(|w| (w - 2.0).abs() < 1e-2));
        }
    }
}

#[test]
fn units_do_not_matter() {
    let Some(mesh) = support::shared_triangles("truck.obj") else { return };
    let truck = elements(&mesh, 1000);
    let winding = truck.winding(&mesh, &ElementWindingSettings::default()).means;
    let cut = truck.cut(&winding);
    proven(&cut);
    for unit in [1e-3, 1e3] {
        let areas: Vec<[f64; 4]> = truck.areas.iter().map(|a| a.map(|a| a * unit * unit)).collect();
        let other = graph_cut(&winding, &truck.neighbours, &areas, &SegmentationSettings::default(), &mut go).unwrap();
        assert_eq!(other.inside, cut.inside);
        assert!((other.energy / cut.energy - 1.0).abs() < 1e-9);
    }
    // A solid truck: about as much as its winding number fills, although Delaunay loses many of its facets, and nothing
    // at the corners of the box around it.
    let by_threshold: Vec<bool> = winding.iter().map(|&w| w >= 0.5).collect();
    let (volume, threshold) = (truck.volume(&cut.inside), truck.volume(&by_threshold));
    assert!((volume / threshold - 1.0).abs() < 0.08, "{volume}, not {threshold}");
    let expected = volume_by_points(&mesh, 20_000);
    assert!((volume / expected - 1.0).abs() < 0.2, "{volume}, not {expected}");
    let corner =
        |t: &[u32; 4]| t.iter().any(|&v| (mesh.vertices.len()..mesh.vertices.len() + 8).contains(&(v as usize)));
    assert!(truck.tetrahedra.iter().zip(&cut.inside).all(|(t, &inside)| !(inside && corner(t))));
}

#[test]
fn quadratures_agree() {
    for file in ["spot.obj", "cow.off"] {
        let Some(mut mesh) = support::shared_triangles(file) else { continue };
        let elements = elements(&mesh, 0);
        let mut noise = support::noise();
        mesh.triangles.retain(|_| noise() < 0.8);
        let with = |refinements| ElementWindingSettings { refinements, ..ElementWindingSettings::default() };
        let (coarse, fine) = (elements.winding(&mesh, &with(0)), elements.winding(&mesh, &with(1)));
        assert_eq!(coarse.hard, fine.hard);
        assert!(coarse.hard < coarse.means.len());
        assert_eq!(coarse.evaluations, coarse.means.len() + 14 * coarse.hard);
        // The winding number jumps inside elements that the surface cuts: there 14 points are off by 1/14 or more, but
        // equally often to either side.
        let difference = |t: usize| fine.means[t] - coarse.means[t];
        let all = 0..coarse.means.len();
        let mean = all.clone().map(|t| difference(t).abs()).sum::<f64>() / coarse.hard as f64;
        let largest = all.clone().map(|t| difference(t).abs()).fold(0.0, f64::max);
        let volume: f64 = elements.volumes.iter().sum();
        let bias = all.map(|t| difference(t) * elements.volumes[t]).sum::<f64>() / volume;
        assert!(mean < 0.03 && largest < 0.5 && bias.abs() < 1e-3, "{file}: {mean}, {largest}, {bias}");
    }
}

#[test]
fn triangles_in_the_plane() {
    // A square of 2×2 cells of two triangles in a square of 6×6; a quarter of a side of its outline is missing.
    let vertices: Vec<[f64; 2]> = (0..49).map(|i| [f64::from(i % 7), f64::from(i / 7)]).collect();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for cell in (0..48).filter(|i| i % 7 < 6 && i / 7 < 6) {
        triangles.extend([[cell, cell + 1, cell + 8], [cell, cell + 8, cell + 7]]);
    }
    let edge = |t: usize, k: usize| [triangles[t][(k + 1) % 3], triangles[t][(k + 2) % 3]];
    let across = |t: usize, k: usize| {
        let [a, b] = edge(t, k);
        let all = (0..triangles.len()).flat_map(|t| (0..3).map(move |k| (t, k)));
        all.into_iter().find(|&(t, k)| edge(t, k) == [b, a]).map_or(HULL, |(t, _)| t as u32)
    };
    let neighbours: Vec<[u32; 3]> = (0..triangles.len()).map(|t| std::array::from_fn(|k| across(t, k))).collect();
    let length = |[a, b]: [u32; 2]| {
        let [p, q] = [a, b].map(|v| glam::DVec2::from(vertices[v as usize]));
        p.distance(q)
    };
    let lengths: Vec<[f64; 3]> = (0..triangles.len()).map(|t| std::array::from_fn(|k| length(edge(t, k)))).collect();
    let outline = [[2.0, 2.0], [4.0, 2.0], [4.0, 4.0], [2.0, 4.0], [2.0, 2.5]];
    let number = WindingNumberHierarchy2d::precompute(&outline, &[[0, 1], [1, 2], [2, 3], [3, 4]]).unwrap();
    let evaluate = |p| number.evaluate(p);
    let settings = ElementWindingSettings::default();
    let winding = element_winding(&vertices, &triangles, &neighbours, &evaluate, &settings, &mut go).unwrap();
    assert!(winding.hard > 8, "{} are hard", winding.hard);
    let cut = graph_cut(&winding.means, &neighbours, &lengths, &SegmentationSettings::default(), &mut go).unwrap();
    for (t, &inside) in cut.inside.iter().enumerate() {
        let within = |v: u32| vertices[v as usize].iter().all(|c| (2.0..=4.0).contains(c));
        assert_eq!(inside, triangles[t].iter().all(|&v| within(v)), "{t} with {}", winding.means[t]);
    }
}

#[test]
fn bad_input_is_named() {
    let sizes = [[1.0; 3]; 2];
    let pair = [[1, HULL, HULL], [HULL, 0, HULL]];
    let settings = SegmentationSettings::default();
    let cut = |w: &[f64], n: &[[u32; 3]], s: &[[f64; 3]], settings| graph_cut(w, n, s, &settings, &mut go);
    let refused = |w: &[f64], n: &[[u32; 3]], s: &[[f64; 3]]| cut(w, n, s, settings).unwrap_err();
    assert!(matches!(refused(&[0.0], &pair, &sizes), SegmentationError::WrongLength { .. }));
    assert!(matches!(refused(&[0.0; 2], &pair, &sizes[..1]), SegmentationError::WrongLength { .. }));
    for value in [f64::NAN, f64::INFINITY, -1e300] {
        assert!(matches!(refused(&[0.0, value], &pair, &sizes), SegmentationError::BadWinding { element: 1, .. }));
        let bad = [[1.0; 3], [1.0, value, 1.0]];
        if value != f64::INFINITY || !value.is_finite() {
            assert_eq!(refused(&[0.0; 2], &pair, &bad), SegmentationError::BadFacetSize { element: 1 });
        }
    }
    for bad in [
        [[1, HULL, HULL], [HULL; 3]],
        [[0, HULL, HULL], [HULL; 3]],
        [[7, HULL, HULL], [HULL; 3]],
        [[1, 1, HULL], [0, HULL, HULL]],
    ] {
        assert!(matches!(refused(&[0.0; 2], &bad, &sizes), SegmentationError::BadNeighbour { element: 0, .. }));
    }
    for (gamma, sigma) in [(-1.0, 1.0), (f64::NAN, 1.0), (1e9, 1.0), (1.0, 0.0), (1.0, f64::NAN), (1.0, f64::INFINITY)]
    {
        let refused = cut(&[0.0; 2], &pair, &sizes, SegmentationSettings { gamma, sigma }).unwrap_err();
        assert!(matches!(refused, SegmentationError::BadSetting { .. }));
    }
    // Sizes of zero, sizes near the largest number, and no elements are all fine.
    for size in [0.0, 1e-320, 1e308] {
        assert_eq!(cut(&[0.9, 0.2], &pair, &[[size; 3]; 2], settings).unwrap().inside, [true, false]);
    }
    assert_eq!(cut(&[], &[], &[], settings).unwrap().inside, [false; 0]);
    let stop = graph_cut(&[0.0; 2], &pair, &sizes, &settings, &mut |_, _| ControlFlow::Break(()));
    assert_eq!(stop, Err(SegmentationError::Cancelled));
    let forced = graph_cut_with_forced_labels(&[0.0; 2], &pair, &sizes, &[Label::Free], &settings, &mut go);
    assert!(matches!(forced, Err(SegmentationError::WrongLength { .. })));
}

#[test]
fn bad_elements_are_named() {
    let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, f64::NAN]];
    let settings = ElementWindingSettings::default();
    let of = |elements: &[[u32; 3]], neighbours: &[[u32; 3]], value: f64, settings| {
        element_winding(&square, elements, neighbours, &|_| value, settings, &mut go)
    };
    let refused = |elements: &[[u32; 3]], neighbours: &[[u32; 3]], value: f64| {
        of(elements, neighbours, value, &settings).unwrap_err()
    };
    assert!(matches!(refused(&[[0, 1, 2]], &[], f64::NAN), SegmentationError::BadWinding { element: 0, .. }));
    assert!(matches!(refused(&[[0, 1, 9]], &[], 0.0), SegmentationError::BadCorner { element: 0, vertex: 9, .. }));
    assert!(matches!(refused(&[[0, 1, 3]], &[], 0.0), SegmentationError::BadCoordinate { element: 0, vertex: 3 }));
    assert!(matches!(refused(&[[0, 1, 2]], &[[5; 3]], 0.0), SegmentationError::BadNeighbour { .. }));
    assert!(matches!(refused(&[[0, 1, 2]], &[[HULL; 3]; 2], 0.0), SegmentationError::WrongLength { .. }));
    let deep = ElementWindingSettings { refinements: 5, ..settings };
    assert!(matches!(of(&[[0, 1, 2]], &[], 0.0, &deep), Err(SegmentationError::BadSetting { .. })));
    assert_eq!(of(&[], &[], 0.0, &settings).unwrap(), ElementWinding::default());
    assert_eq!(of(&[[0, 1, 2]], &[], 0.3, &settings).unwrap().hard, 1);
}

#[test]
fn vertices_are_joined_by_the_cheapest_chains() {
    // Two separate balls, and a vertex in the middle of each, near the edge of one, and between them.
    let mut mesh = support::sphere(2);
    let count = mesh.vertices.len() as u32;
    let other = TriangleMesh {
        vertices: mesh.vertices.iter().map(|v| [v[0] + 3.0, v[1], v[2]]).collect(),
        triangles: mesh.triangles.iter().map(|t| t.map(|v| v + count)).collect(),
    };
    mesh.vertices.extend(other.vertices);
    mesh.triangles.extend(other.triangles);
    mesh.vertices.extend([[0.0; 3], [3.0, 0.0, 0.0], [1.5, 0.1, 0.0], [0.5, 0.5, 0.0], [0.0, 0.3, 0.1]]);
    let bone: Vec<u32> = (2 * count..2 * count + 3).collect();
    let within = vec![2 * count + 3, 2 * count + 4];
    let balls = elements(&mesh, 1000);
    let winding = balls.winding(&mesh, &ElementWindingSettings::default()).means;
    let inside = balls.cut(&winding).inside;
    let join = |groups: &[Vec<u32>], inside: &[bool]| {
        connect_vertices(&balls.tetrahedra, &balls.neighbours, &winding, &balls.volumes, inside, groups, &mut go)
    };
    let before = connected_pieces(&inside, &balls.neighbours).unwrap();
    assert_eq!(before.sizes.iter().filter(|&&size| size > 20).count(), 2);
    // Nothing is added where nothing is missing.
    let same = join(std::slice::from_ref(&within), &inside).unwrap();
    assert!(same.inside == inside && same.added.is_empty() && same.unreachable.is_empty());
    let lost = balls.vertices.len() as u32 + 7;
    let mut with_lost = bone.clone();
    with_lost.push(lost);
    let joined = join(&[within.clone(), with_lost], &inside).unwrap();
    assert_eq!(joined.unreachable, [(1, lost)]);
    let after = connected_pieces(&joined.inside, &balls.neighbours).unwrap();
    let touch = |vertex: u32, piece: u32| {
        balls.tetrahedra.iter().zip(&after.piece_of).any(|(t, &p)| p == piece && t.contains(&vertex))
    };
    assert!((0..after.sizes.len() as u32).any(|piece| bone.iter().all(|&v| touch(v, piece))));
    let added: usize = joined.added.iter().map(|chain| chain.elements.len()).sum();
    let now = joined.inside.iter().filter(|&&x| x).count();
    assert!(added > 0 && now == inside.iter().filter(|&&x| x).count() + added);
    let shortfall: f64 = joined.added.iter().map(|chain| chain.shortfall).sum();
    assert!(joined.added.iter().all(|chain| chain.group == 1) && shortfall < 0.1 * balls.volume(&joined.inside));
    // With nothing inside, a chain of its own grows.
    let bare = join(std::slice::from_ref(&bone), &vec![false; inside.len()]).unwrap();
    assert_eq!(connected_pieces(&bare.inside, &balls.neighbours).unwrap().sizes.len(), 1);
    let wrong = join(&[], &inside[1..]);
    assert!(matches!(wrong, Err(SegmentationError::WrongLength { .. })));
}
