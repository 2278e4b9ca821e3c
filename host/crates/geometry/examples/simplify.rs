//! Simplifies surfaces and measures how far the results are from the originals:
//! `cargo run --release -p armature-geometry --example simplify -- MESH [VERTICES]...`.
//!
//! MESH is an OBJ or OFF file. Distances are fractions of the diagonal of the mesh's bounding box, measured both ways:
//! from the original vertices to the coarse surface, and from points spread over the coarse surface to the original.
//! Then the original vertices are located in those Delaunay tetrahedra of the coarse vertices that are inside, a rough
//! volume. Runs on one thread with `RAYON_NUM_THREADS=1`.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use armature_geometry::delaunay::delaunay_tetrahedra;
use armature_geometry::embed::embed_points;
use armature_geometry::search::TriangleHierarchy;
use armature_geometry::simplify::simplify;
use armature_geometry::surface::diagnose;
use armature_geometry::winding::FastWindingNumber;
use armature_geometry::{TetrahedralMesh, TriangleMesh};
use glam::DVec3;

#[path = "../tests/support/mod.rs"]
mod support;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().ok_or("which mesh? name an OBJ or OFF file")?;
    let mesh = support::read_triangles(Path::new(&name));
    let mut targets = arguments.map(|a| a.parse()).collect::<Result<Vec<usize>, _>>()?;
    if targets.is_empty() {
        targets = vec![2500, 5000, 10_000];
    }
    let (low, high) = mesh.bounds().ok_or("the mesh is empty")?;
    let diagonal = DVec3::from(low).distance(DVec3::from(high));
    println!("{name}: {} vertices, {} triangles", mesh.vertices.len(), mesh.triangles.len());
    for target in targets {
        let start = Instant::now();
        let simplified = simplify(&mesh, target, &mut |_, _| ControlFlow::Continue(()))?;
        let seconds = start.elapsed().as_secs_f64();
        let coarse = &simplified.mesh;
        println!("  {target}: {seconds:.3} s, {} vertices, {:?}", coarse.vertices.len(), simplified.outcome);
        let there = (simplified.mean_distance / diagonal, simplified.largest_distance / diagonal);
        let back = distance_back(&mesh, coarse)?;
        println!("    distance there {:.2e} (root mean square), {:.2e} (largest)", there.0, there.1);
        println!("    distance back  {:.2e} (mean), {:.2e} (largest)", back.0 / diagonal, back.1 / diagonal);
        let mut quality: Vec<f64> = coarse.triangles.iter().map(|t| quality(coarse, *t)).collect();
        quality.sort_by(f64::total_cmp);
        let at = |share: f64| quality[(share * (quality.len() - 1) as f64) as usize];
        println!(
            "    quality least {:.3}, 1 % {:.3}, 10 % {:.3}, median {:.3}",
            quality[0],
            at(0.01),
            at(0.1),
            at(0.5)
        );
        println!("    {} pairs of triangles meet", diagnose(coarse)?.self_intersections);
        let volume = rough_volume(coarse)?;
        let hints = simplified.hints(Some);
        let start = Instant::now();
        let embedding = embed_points(&volume, &mesh.vertices, Some(&hints))?;
        let seconds = start.elapsed().as_secs_f64();
        let farthest = embedding.distance.iter().fold(0.0, |most: f64, d| most.max(*d)) / diagonal;
        let outside = embedding.distance.iter().filter(|d| **d > 0.0).count();
        println!(
            "    located in {} tetrahedra: {seconds:.3} s, {outside} outside, by {farthest:.2e} at most, {} without hint",
            volume.tetrahedra.len(),
            embedding.searched_everywhere
        );
    }
    Ok(())
}

/// The Delaunay tetrahedra whose barycentres are inside.
fn rough_volume(surface: &TriangleMesh) -> Result<TetrahedralMesh, Box<dyn std::error::Error>> {
    let all = delaunay_tetrahedra(&surface.vertices, &mut |_, _| ControlFlow::Continue(()))?.tetrahedra;
    let middle = |t: &[u32; 4]| {
        (0.25 * t.map(|v| DVec3::from(surface.vertices[v as usize])).into_iter().sum::<DVec3>()).to_array()
    };
    let winding = FastWindingNumber::precompute(surface)?;
    let numbers = winding.evaluate_many(&all.iter().map(middle).collect::<Vec<_>>());
    let tetrahedra = all.into_iter().zip(numbers).filter(|(_, number)| *number > 0.5).map(|(t, _)| t).collect();
    Ok(TetrahedralMesh { vertices: surface.vertices.clone(), tetrahedra })
}

/// Mean and largest distance from points on `coarse` to `mesh`.
fn distance_back(mesh: &TriangleMesh, coarse: &TriangleMesh) -> Result<(f64, f64), Box<dyn std::error::Error>> {
    let hierarchy = TriangleHierarchy::new(mesh)?;
    let (mut sum, mut largest, mut count) = (0.0, 0.0_f64, 0.0);
    for t in &coarse.triangles {
        let [a, b, c] = t.map(|v| DVec3::from(coarse.vertices[v as usize]));
        for point in [(a + b + c) / 3.0, 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)] {
            let distance = hierarchy.closest_point(point.to_array()).ok_or("no closest point")?.distance_squared.sqrt();
            (sum, largest, count) = (sum + distance, largest.max(distance), count + 1.0);
        }
    }
    Ok((sum / count, largest))
}

/// Area over squared edges; 1 is equilateral.
fn quality(mesh: &TriangleMesh, triangle: [u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|v| DVec3::from(mesh.vertices[v as usize]));
    let edges = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
    2.0 * 3.0_f64.sqrt() * (b - a).cross(c - a).length() / edges
}
