//! Makes volumes and prints their shape and what they took:
//! `cargo run --release -p armature-geometry --example volume -- [--conforming | --vertices N] {MESH [BONES.tgf]}...`.
//!
//! MESH is an OBJ or OFF file, `rough:R` a sphere of 200,000 triangles whose radius varies by R from vertex to vertex,
//! or `spike:L` a tube one of whose vertices is L away.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use armature_geometry::improve::dihedral_angles;
use armature_geometry::volume::{Resolution, Volume, VolumeInput, VolumeSettings, volume};
use armature_geometry::{TetrahedralMesh, TriangleMesh};
use glam::DVec3;

#[path = "../tests/support/mod.rs"]
mod support;

/// Where solvers drop an element: six volumes relative to the longest edge cubed.
const FLAT: f64 = 1e-3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut resolution = Resolution::Embedded { vertices: 5000 };
    let mut words = std::env::args().skip(1).peekable();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--conforming" => resolution = Resolution::Conforming,
            "--vertices" => {
                resolution =
                    Resolution::Embedded { vertices: words.next().ok_or("--vertices needs a number")?.parse()? };
            }
            name => {
                let bones =
                    words.next_if(|next| Path::new(next).extension().is_some_and(|extension| extension == "tgf"));
                let segments = bones.map_or_else(Vec::new, |path| armature_test_support::read_tgf(Path::new(&path)));
                one(name, &surface(name)?, &segments, resolution)?;
            }
        }
    }
    Ok(())
}

fn surface(name: &str) -> Result<TriangleMesh, Box<dyn std::error::Error>> {
    Ok(match name.split_once(':') {
        Some(("rough", deviation)) => support::rough_sphere(251, 400, deviation.parse()?),
        Some(("spike", length)) => support::spiked_tube(17, 12, length.parse()?),
        _ => support::read_triangles(Path::new(name)),
    })
}

fn one(
    name: &str,
    surface: &TriangleMesh,
    segments: &[[[f64; 3]; 2]],
    resolution: Resolution,
) -> Result<(), Box<dyn std::error::Error>> {
    let settings = VolumeSettings { resolution, ..VolumeSettings::default() };
    let mut stages: Vec<(&str, Instant)> = Vec::new();
    let (start, before) = (Instant::now(), processor_seconds());
    let input = VolumeInput { surface, segments, points: &[] };
    let made = volume(&input, &settings, &mut |stage, _| {
        if stages.last().is_none_or(|last| last.0 != stage) {
            stages.push((stage, Instant::now()));
        }
        ControlFlow::Continue(())
    })?;
    let seconds = start.elapsed().as_secs_f64();
    let processor = processor_seconds().zip(before).map_or(f64::NAN, |(now, before)| now - before);
    println!("{name}: {seconds:.2} s, {processor:.2} s of processor time");
    let ends = stages.iter().skip(1).map(|(_, at)| *at).chain([Instant::now()]);
    for ((stage, from), to) in stages.iter().zip(ends) {
        println!("    {:7.2} s  {stage}", to.duration_since(*from).as_secs_f64());
    }
    describe(&made);
    Ok(())
}

fn describe(made: &Volume) {
    let (mesh, report) = (&made.mesh, &made.report);
    let angles = report.dihedral_angles.clone().or_else(|| dihedral_angles(mesh).ok());
    println!(
        "  {} vertices, {} tetrahedra, {} pieces, volume {:.6}, closed {}, winding error {:.4}",
        mesh.vertices.len(),
        mesh.tetrahedra.len(),
        report.pieces,
        report.volume,
        report.closed,
        report.winding_error
    );
    if let Some(angles) = angles {
        println!(
            "  angles {:.3}° to {:.2}°, below 5° {:.4} %, below 10° {:.3} %; {} flat elements",
            angles.smallest.to_degrees(),
            angles.largest.to_degrees(),
            100.0 * angles.share_below(5),
            100.0 * angles.share_below(10),
            mesh.tetrahedra.iter().filter(|t| is_flat(mesh, **t)).count(),
        );
    }
    let distance = &made.surface.distance;
    println!(
        "  surface at most {:.2e} outside, {} of {} vertices outside; shell {} vertices, {:?}, smoothed {:?}, long {}",
        distance.iter().copied().fold(0.0, f64::max),
        distance.iter().filter(|&&d| d > 0.0).count(),
        distance.len(),
        report.shell_vertices,
        report.shortfall,
        report.roughness_smoothed,
        report.edges_left_long,
    );
    println!(
        "  facets {} whole {} cut {} area {:.4}; added {}; left out: {} pieces, {} flat, {} slivers; bones: {} points, {} elements",
        report.facets,
        report.facets_whole,
        report.facets_cut,
        report.area_covered,
        report.shell_points_added,
        report.pieces_left_out,
        report.flat_elements_left_out,
        report.slivers_left_out,
        report.bone_points,
        report.elements_for_bones,
    );
    if let Some(improvement) = &report.improvement {
        println!("  improvement: {:?} {:?}", improvement.outcome, improvement.operations);
    }
}

fn is_flat(mesh: &TetrahedralMesh, corners: [u32; 4]) -> bool {
    let p = corners.map(|v| DVec3::from(mesh.vertices[v as usize]));
    let longest =
        (0..4).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| p[i].distance(p[j])).fold(0.0, f64::max);
    (p[1] - p[0]).dot((p[2] - p[0]).cross(p[3] - p[0])) < FLAT * longest.powi(3)
}

/// User and system time of this process; none where the system does not tell.
fn processor_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    let after_name = text.rsplit_once(") ")?.1;
    let ticks: Vec<f64> = after_name.split_whitespace().skip(11).take(2).filter_map(|word| word.parse().ok()).collect();
    Some(ticks.iter().sum::<f64>() / 100.0)
}
