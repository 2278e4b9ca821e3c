//! What `armature volume` says about what it made.

use armature_geometry::{
    DihedralStatistics, Refinement, Resolution, ShellShortfall, Volume, VolumeReport, dihedral_angles,
};
use serde_json::{Value, json};

use crate::volumes::{FlatDomain, Handles};
use crate::words::{counted, grouped};

/// From this winding error on, what is inside was a guess.
const GUESSED: f64 = 0.3;
/// Vertices of the surface further outside of the volume than this part of its size are worth a word.
const FAR_OUTSIDE: f64 = 0.01;
/// Dihedral angles below this make solvers slow.
const THIN_DEGREES: usize = 5;

/// For a person, and for a script.
#[derive(Clone, Debug)]
pub(super) struct Told {
    /// Counts.
    pub(super) summary: String,
    /// Further lines.
    pub(super) lines: Vec<String>,
    /// What the user should know.
    pub(super) warnings: Vec<String>,
    /// All of it.
    pub(super) json: Value,
}

/// About a volume.
pub(super) fn solid_report(volume: &Volume, handles: &Handles, resolution: Resolution) -> Told {
    let report = &volume.report;
    let angles = report.dihedral_angles.clone().or_else(|| dihedral_angles(&volume.mesh).ok());
    let pieces = counted(report.pieces, "piece", "pieces");
    let counts = [
        counted(volume.mesh.vertices.len(), "vertex", "vertices"),
        counted(volume.mesh.tetrahedra.len(), "tetrahedron", "tetrahedra"),
    ];
    let shell = if resolution == Resolution::Conforming { "the surface" } else { "the simplified surface" };
    let mut lines = vec![
        format!(
            "{} of {} facets of {shell} are facets of tetrahedra ({:.2} %), {:.2} % of its area is covered",
            grouped(report.facets_whole + report.facets_cut),
            grouped(report.facets),
            percent(share(report.facets_whole + report.facets_cut, report.facets)),
            percent(report.area_covered),
        ),
        format!("volume {:.6}, winding error {:.4} ({})", report.volume, report.winding_error, trust(report)),
    ];
    if let Some(a) = &angles {
        lines.push(format!(
            "dihedral angles from {:.2}° to {:.2}°, {:.3} % of them at {THIN_DEGREES}° or more",
            a.smallest.to_degrees(),
            a.largest.to_degrees(),
            percent(1.0 - a.share_below(THIN_DEGREES)),
        ));
    }
    if !handles.segments.is_empty() || !handles.points.is_empty() {
        lines.push(format!(
            "{} with {} along them, {}",
            counted(handles.segments.len(), "bone", "bones"),
            counted(report.bone_points, "vertex", "vertices"),
            counted(volume.point_vertices.len(), "point handle", "point handles"),
        ));
    }
    let warnings = solid_warnings(volume);
    Told {
        summary: format!("{}, {pieces}", counts.join(", ")),
        lines,
        warnings,
        json: solid_json(volume, angles.as_ref(), handles),
    }
}

fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 { 1.0 } else { part as f64 / whole as f64 }
}

/// Never rounded up to a hundred.
fn percent(share: f64) -> f64 {
    if share < 1.0 { (share * 100.0).min(99.999) } else { 100.0 }
}

fn trust(report: &VolumeReport) -> &'static str {
    if report.closed {
        "a closed surface tells inside from outside"
    } else if report.winding_error < GUESSED {
        "0 were a closed surface, from 0.3 on a guess"
    } else {
        "what is inside is a guess"
    }
}

fn solid_warnings(volume: &Volume) -> Vec<String> {
    let report = &volume.report;
    let mut warnings = Vec::new();
    let mut tell = |is_so: bool, text: String| {
        if is_so {
            warnings.push(text);
        }
    };
    let turned = report.triangles_turned;
    tell(turned > 0, format!("{} inside out and turned round", counted(turned, "triangle was", "triangles were")));
    match report.shortfall {
        Some(ShellShortfall::Vertices(count)) => tell(
            true,
            format!(
                "the surface could not be made simpler than {} vertices without tearing or gluing it",
                grouped(count)
            ),
        ),
        Some(ShellShortfall::Samples) => tell(
            true,
            "the triangles hang together with no others; points spread over them took the place of the surface".into(),
        ),
        None => {}
    }
    tell(
        report.winding_error >= GUESSED,
        format!("the surface hardly tells inside from outside (winding error {:.2})", report.winding_error),
    );
    tell(
        report.bones_apart > 0,
        format!(
            "{} through more than one piece of the volume; weights cannot reach from one to the other",
            counted(report.bones_apart, "group of joined bones runs", "groups of joined bones run")
        ),
    );
    let kept = report.elements_for_bones;
    tell(kept > 0, format!("{} kept so that bones are in one piece", counted(kept, "element was", "elements were")));
    let kept = report.elements_for_constraints;
    tell(kept > 0, format!("{} kept to obey the constraints", counted(kept, "element was", "elements were")));
    let unsatisfied = report.constraints_unsatisfied;
    tell(unsatisfied > 0, format!("{} not obey the constraints", counted(unsatisfied, "place does", "places do")));
    let kept = report.elements_for_vertices;
    tell(
        kept > 0,
        format!(
            "{} kept so that every vertex of the surface is in the volume",
            counted(kept, "element was", "elements were")
        ),
    );
    let diagonal = volume
        .mesh
        .bounds()
        .map_or(0.0, |(low, high)| low.iter().zip(high).map(|(l, h)| (h - l).powi(2)).sum::<f64>().sqrt());
    let far = volume.surface.distance.iter().filter(|&&d| d > FAR_OUTSIDE * diagonal).count();
    tell(
        far > 0,
        format!(
            "{} of the surface lie more than a hundredth of its size outside of the volume",
            counted(far, "vertex", "vertices")
        ),
    );
    warnings
}

fn solid_json(volume: &Volume, angles: Option<&DihedralStatistics>, handles: &Handles) -> Value {
    let r = &volume.report;
    let farthest = volume.surface.distance.iter().copied().fold(0.0, f64::max);
    json!({
        "kind": "volume",
        "vertices": volume.mesh.vertices.len(),
        "tetrahedra": volume.mesh.tetrahedra.len(),
        "pieces": r.pieces,
        "volume": r.volume,
        "winding_error": r.winding_error,
        "closed": r.closed,
        "facets": r.facets,
        "facets_whole": r.facets_whole,
        "facets_cut": r.facets_cut,
        "area_covered": r.area_covered,
        "triangles_turned": r.triangles_turned,
        "shell_vertices": r.shell_vertices,
        "shell_points_added": r.shell_points_added,
        "inner_points": r.inner_points,
        "bones": handles.segments.len(),
        "bone_points": r.bone_points,
        "bones_apart": r.bones_apart,
        "points": volume.point_vertices.len(),
        "elements_for_bones": r.elements_for_bones,
        "elements_for_vertices": r.elements_for_vertices,
        "elements_for_constraints": r.elements_for_constraints,
        "constraints_unsatisfied": r.constraints_unsatisfied,
        "farthest_surface_vertex": farthest,
        "smallest_dihedral_degrees": angles.map(|a| a.smallest.to_degrees()),
        "largest_dihedral_degrees": angles.map(|a| a.largest.to_degrees()),
        "dihedrals_below_5_degrees": angles.map(|a| a.share_below(THIN_DEGREES)),
    })
}

/// About the domain of a flat figure.
pub(super) fn flat_report(flat: &FlatDomain, handles: &Handles) -> Told {
    let report = &flat.domain.report;
    let counts = [
        counted(flat.mesh.vertices.len(), "vertex", "vertices"),
        counted(flat.mesh.triangles.len(), "triangle", "triangles"),
        counted(report.pieces, "piece", "pieces"),
    ];
    let lines = vec![
        format!("area {:.6}, winding error {:.4}", report.area, report.winding_error),
        format!(
            "smallest angle {:.2}°, {} below the one wanted",
            report.smallest_angle.to_degrees(),
            counted(report.sharp_triangles, "triangle", "triangles")
        ),
    ];
    let json = json!({
        "kind": "flat domain",
        "vertices": flat.mesh.vertices.len(),
        "triangles": flat.mesh.triangles.len(),
        "pieces": report.pieces,
        "area": report.area,
        "winding_error": report.winding_error,
        "smallest_angle_degrees": report.smallest_angle.to_degrees(),
        "sharp_triangles": report.sharp_triangles,
        "crossings": report.crossings,
        "complete": report.refinement == Refinement::Complete,
        "bones": handles.segments.len(),
        "pieces_with_bones": report.pieces_with_bones,
        "points": handles.points.len(),
        "points_outside": report.points_outside,
        "bone_vertices_outside": report.bone_vertices_outside,
    });
    Told { summary: format!("a flat figure: {}", counts.join(", ")), lines, warnings: flat_warnings(flat), json }
}

fn flat_warnings(flat: &FlatDomain) -> Vec<String> {
    let report = &flat.domain.report;
    let mut warnings = Vec::new();
    if report.refinement == Refinement::LimitReached {
        warnings.push("the triangles could not all be made small enough; ask for fewer vertices".into());
    }
    if report.pieces_with_bones > 1 {
        warnings.push(format!(
            "bones run through {} pieces that do not touch; weights cannot reach from one to the other",
            report.pieces_with_bones
        ));
    }
    if report.bone_vertices_outside > 0 {
        let count = counted(report.bone_vertices_outside, "place along bones lies", "places along bones lie");
        warnings.push(format!("{count} outside of the figure and got no vertex"));
    }
    if !report.points_outside.is_empty() {
        let count = counted(report.points_outside.len(), "point handle lies", "point handles lie");
        warnings.push(format!("{count} outside of the figure"));
    }
    warnings
}
