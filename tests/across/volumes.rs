//! Volumes of every available mesh, whole and damaged in every way: a usable volume, or an error that says why.

use std::ops::ControlFlow;

use armature::characters::volumes::{FlatDomain, Handles, Made, make};
use armature::files::inputs;
use armature_geometry::TriangleMesh;
use armature_geometry::planar::plane_of;
use armature_geometry::surface::connected_components;
use armature_geometry::volume::{Resolution, Volume, VolumeSettings};
use armature_test_support::shared;
use glam::DVec3;

/// Enough for fingers, few enough for a minute of tests.
const VERTICES: usize = 2500;

/// Pseudo-random numbers, the same every time (Steele, Lea and Flood's `SplitMix`).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// From 0 to 1.
    fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn vector(&mut self, size: f64) -> DVec3 {
        DVec3::new(self.share() - 0.5, self.share() - 0.5, self.share() - 0.5) * 2.0 * size
    }
}

/// The damage done to a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    /// Nothing.
    None,
    /// A tenth of the triangles is missing.
    Deleted,
    /// A tenth of the triangles is repeated.
    Duplicated,
    /// A component is inside out.
    Flipped,
    /// Every triangle is moved separately by a hundredth of the size.
    Soup,
    /// Some vertices are NaN or infinite.
    NotNumbers,
    /// There are no faces.
    NoFaces,
}

use Fault::{Deleted, Duplicated, Flipped, NoFaces, None as Whole, NotNumbers, Soup};

impl Fault {
    fn inflict(self, mesh: &TriangleMesh) -> TriangleMesh {
        let mut random = Random(0x5eed ^ self as u64);
        let mut damaged = mesh.clone();
        match self {
            Self::None => {}
            Self::Deleted => damaged.triangles.retain(|_| random.share() >= 0.1),
            Self::Duplicated => {
                let again: Vec<_> = mesh.triangles.iter().filter(|_| random.share() < 0.1).copied().collect();
                damaged.triangles.extend(again);
            }
            Self::Flipped => {
                // The one with the most triangles.
                let components = connected_components(mesh.vertices.len(), &mesh.triangles);
                let of = |t: &[u32; 3]| components.of_vertex[t[0] as usize] as usize;
                let mut sizes = vec![0; components.count];
                mesh.triangles.iter().for_each(|t| sizes[of(t)] += 1);
                let largest = (0..sizes.len()).max_by_key(|&c| sizes[c]).unwrap();
                damaged.triangles.iter_mut().filter(|t| of(t) == largest).for_each(|t| t.swap(0, 1));
            }
            Self::Soup => {
                let (low, high) = mesh.bounds().unwrap();
                let size = 0.01 * DVec3::from(low).distance(DVec3::from(high));
                let moved = mesh.triangles.iter().flat_map(|t| {
                    let by = random.vector(size);
                    t.map(|v| (DVec3::from(mesh.vertices[v as usize]) + by).to_array())
                });
                damaged.vertices = moved.collect();
                damaged.triangles = (0..mesh.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            }
            Self::NotNumbers => {
                for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                    let vertex = random.next() as usize % mesh.vertices.len();
                    damaged.vertices[vertex][random.next() as usize % 3] = value;
                }
            }
            Self::NoFaces => damaged.triangles.clear(),
        }
        damaged
    }
}

/// Checks what every user of a volume relies on.
fn assert_usable(what: &str, volume: &Volume, mesh: &TriangleMesh, handles: &Handles) {
    let at = |v: u32| DVec3::from(volume.mesh.vertices[v as usize]);
    volume.mesh.validate().unwrap_or_else(|e| panic!("{what}: {e}"));
    let mut sum = 0.0;
    for t in &volume.mesh.tetrahedra {
        let [a, b, c, d] = t.map(at);
        let six = (b - a).dot((c - a).cross(d - a));
        // Rounding may leave nothing of a sliver; its orientation is exact.
        let is_positive = six > 0.0 || exactly_positive(t.map(|v| volume.mesh.vertices[v as usize]));
        assert!(is_positive, "{what}: an element is inverted or flat: {six}");
        sum += six / 6.0;
    }
    let report = &volume.report;
    assert!((sum - report.volume).abs() <= 1e-9 * sum, "{what}: {sum} is not {}", report.volume);
    assert!(report.winding_error.is_finite() && report.winding_error >= 0.0, "{what}: {}", report.winding_error);
    assert_eq!(volume.winding.len(), volume.mesh.tetrahedra.len(), "{what}");
    assert!(volume.winding.iter().all(|w| w.is_finite()), "{what}");
    assert_eq!(volume.segment_vertices.len(), handles.segments.len(), "{what}");
    let pieces = pieces(&volume.mesh.tetrahedra, volume.mesh.vertices.len());
    let mut of_bones: Vec<u32> = volume.segment_vertices.iter().flatten().map(|&v| pieces[v as usize]).collect();
    assert!(volume.segment_vertices.iter().all(|bone| bone.len() >= 2), "{what}: a bone has no vertices");
    of_bones.sort_unstable();
    of_bones.dedup();
    assert!(of_bones.len() <= 1 && report.bones_apart == 0, "{what}: bones are in {} pieces", of_bones.len());
    let embedding = &volume.surface;
    assert_eq!(embedding.tetrahedra.len(), mesh.vertices.len(), "{what}");
    for (&tetrahedron, weights) in embedding.tetrahedra.iter().zip(&embedding.barycentric) {
        assert!((tetrahedron as usize) < volume.mesh.tetrahedra.len(), "{what}");
        let sum: f64 = weights.iter().sum();
        assert!((sum - 1.0).abs() < 1e-9 && weights.iter().all(|&w| w >= 0.0), "{what}: {weights:?}");
    }
}

fn exactly_positive(corners: [[f64; 3]; 4]) -> bool {
    let [a, b, c, d] = corners.map(|[x, y, z]| robust::Coord3D { x, y, z });
    // Positive if `d` is below the plane through `a`, `b`, `c`, which run counter-clockwise seen from above.
    robust::orient3d(a, b, c, d) < 0.0
}

/// For every vertex, the piece that its elements belong to, joined through facets.
fn pieces(tetrahedra: &[[u32; 4]], vertex_count: usize) -> Vec<u32> {
    let mut facets: Vec<([u32; 3], u32)> = Vec::with_capacity(4 * tetrahedra.len());
    for (index, &[a, b, c, d]) in tetrahedra.iter().enumerate() {
        for mut facet in [[b, c, d], [a, c, d], [a, b, d], [a, b, c]] {
            facet.sort_unstable();
            facets.push((facet, index as u32));
        }
    }
    facets.sort_unstable();
    assert!(facets.chunk_by(|a, b| a.0 == b.0).all(|same| same.len() <= 2), "a facet has more than two elements");
    // Adjacent elements, as edges of a graph.
    let joined: Vec<[u32; 3]> =
        facets.chunk_by(|a, b| a.0 == b.0).filter(|s| s.len() == 2).map(|s| [s[0].1, s[1].1, s[1].1]).collect();
    let of_element = connected_components(tetrahedra.len(), &joined).of_vertex;
    let mut of_vertex = vec![u32::MAX; vertex_count];
    for (corners, &piece) in tetrahedra.iter().zip(&of_element) {
        corners.iter().for_each(|&v| of_vertex[v as usize] = piece);
    }
    of_vertex
}

fn assert_usable_flat(what: &str, flat: &FlatDomain) {
    flat.mesh.validate().unwrap_or_else(|e| panic!("{what}: {e}"));
    let at = |v: u32| flat.domain.vertices[v as usize];
    for t in &flat.domain.triangles {
        let [a, b, c] = t.map(at);
        let double = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        assert!(double > 0.0, "{what}: a triangle is inverted or has no area");
    }
    assert!(flat.domain.report.winding_error.is_finite(), "{what}");
    assert!(flat.domain.report.pieces_with_bones <= 1, "{what}");
}

/// The result for a mesh, in one line: counts, or the error.
fn outcome(what: &str, mesh: &TriangleMesh, handles: &Handles, resolution: Resolution) -> Result<String, String> {
    let settings = VolumeSettings { resolution, ..VolumeSettings::default() };
    match make(mesh, handles, &settings, &mut |_, _| ControlFlow::Continue(())) {
        Ok(Made::Solid(volume)) => {
            assert_usable(what, &volume, mesh, handles);
            let r = &volume.report;
            let (count, pieces, error) = (volume.mesh.tetrahedra.len(), r.pieces, r.winding_error);
            Ok(format!("{count} tetrahedra in {pieces} pieces, volume {:.5}, winding error {error:.3}", r.volume))
        }
        Ok(Made::Flat(flat)) => {
            assert_usable_flat(what, &flat);
            Ok(format!("{} triangles", flat.mesh.triangles.len()))
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.len() > 20 && !text.contains('{'), "{what}: {text}");
            Err(text)
        }
    }
}

/// A model, and its bones if it has any.
fn read(mesh: &str, skeleton: Option<&str>) -> Option<(TriangleMesh, Handles)> {
    let model = inputs::model(&shared(mesh)?).unwrap();
    let skeleton = skeleton.and_then(shared);
    let handles = Handles::read(&model, skeleton.as_deref(), None).unwrap();
    Some((model.mesh, handles))
}

/// Damages a mesh; damage that leaves something to work on must still give a volume.
fn survive(name: &str, skeleton: Option<&str>, faults: &[Fault]) {
    let Some((mesh, handles)) = read(name, skeleton) else { return };
    for &fault in faults {
        let what = format!("{name}, {fault:?}");
        let damaged = fault.inflict(&mesh);
        let came = outcome(&what, &damaged, &handles, Resolution::Embedded { vertices: VERTICES });
        println!("{what}: {came:?}");
        match fault {
            NotNumbers => assert!(came.unwrap_err().contains("not a finite number"), "{what}"),
            NoFaces => assert!(came.unwrap_err().contains("no vertices or no elements"), "{what}"),
            // The loose triangles of a flat figure may enclose nothing; the error then says so.
            Soup if plane_of(&mesh).unwrap().is_some() => assert!(
                came.is_ok() || came.as_ref().is_err_and(|e| e.contains("encloses nothing")),
                "{what}: {came:?}"
            ),
            _ => assert!(came.is_ok(), "{what}: {came:?}"),
        }
    }
}

const ALL: [Fault; 7] = [Whole, Deleted, Duplicated, Flipped, Soup, NotNumbers, NoFaces];

#[test]
fn armadillo() {
    survive("armadillo.obj", Some("armadillo.tgf"), &ALL);
}

#[test]
fn hand() {
    survive("hand.mesh", Some("hand.tgf"), &ALL);
}

#[test]
fn elephant() {
    survive("elephant.obj", Some("elephant.tgf"), &ALL);
}

#[test]
fn arm() {
    survive("arm.obj", Some("arm.tgf"), &ALL);
}

#[test]
fn octopus() {
    survive("octopus-low.mesh", None, &ALL);
}

#[test]
fn spot() {
    survive("spot.obj", None, &ALL);
}

#[test]
fn cow() {
    survive("cow.off", None, &ALL);
}

#[test]
fn truck() {
    survive("truck.obj", None, &ALL);
}

#[test]
fn woody() {
    survive("woody.obj", None, &ALL);
}

#[test]
fn fox() {
    survive("Fox.glb", None, &ALL);
}

/// Random triangles in a box; and a flat sheet, also bent.
#[test]
fn soups_and_sheets() {
    let mut random = Random(7);
    let vertices: Vec<[f64; 3]> = (0..3 * 400).map(|_| random.vector(1.0).to_array()).collect();
    let triangles = (0..400).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let soup = TriangleMesh { vertices, triangles };
    let side = 12_u32;
    let place = |bend: f64| {
        let at = move |i: u32| {
            let (x, y) = (f64::from(i % (side + 1)), f64::from(i / (side + 1)));
            [x, y, bend * (0.3 * x).sin()]
        };
        (0..(side + 1) * (side + 1)).map(at).collect::<Vec<_>>()
    };
    let corner = |x: u32, y: u32| y * (side + 1) + x;
    let squares = (0..side * side).map(|i| (i % side, i / side));
    let triangles: Vec<[u32; 3]> = squares
        .flat_map(|(x, y)| {
            let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let sheet = |bend: f64| TriangleMesh { vertices: place(bend), triangles: triangles.clone() };
    let none = Handles::default();
    let resolution = Resolution::Embedded { vertices: VERTICES };
    for (what, mesh) in [("a soup", soup), ("a bent sheet", sheet(1.0)), ("a hardly bent sheet", sheet(1e-7))] {
        // Nothing encloses anything here: either answer will do, as long as there is one.
        println!("{what}: {:?}", outcome(what, &mesh, &none, resolution));
    }
    let flat = outcome("a flat sheet", &sheet(0.0), &none, resolution);
    println!("a flat sheet: {flat:?}");
    assert!(flat.unwrap().contains("triangles"));
}
