//! What `armature volume` reports about its volume.

use armature_geometry::improve::{DihedralStatistics, dihedral_angles};
use armature_geometry::planar::Refinement;
use armature_geometry::volume::{Resolution, ShellShortfall, Volume, VolumeReport};
use serde_json::{Value, json};

use crate::characters::volumes::{FlatDomain, Handles};
use crate::terminal::{counted, grouped};

/// From this winding error on, the inside was a guess.
const GUESSED: f64 = 0.3;
/// Vertices of the surface farther outside the volume than this fraction of its size are worth a warning.
const FAR_OUTSIDE: f64 = 0.01;
/// Dihedral angles below this make solvers slow.
const THIN_DEGREES: usize = 5;
/// From this share of them on they are worth a warning.
const MANY_THIN: f64 = 1e-3;
/// Below this share of the surface's area the boundary is rough.
const COVERED: f64 = 0.98;

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
    lines.extend(left_out(report));
    let warnings = solid_warnings(volume, angles.as_ref());
    Told {
        summary: format!("{}, {pieces}", counts.join(", ")),
        lines,
        warnings,
        json: solid_json(volume, angles.as_ref(), handles),
    }
}

/// What was removed from the volume, if anything.
fn left_out(report: &VolumeReport) -> Option<String> {
    let counts = [
        (report.flat_elements_left_out, "flat element at the boundary", "flat elements at the boundary"),
        (report.slivers_left_out, "sliver at the boundary", "slivers at the boundary"),
        (report.pieces_left_out, "stray piece of next to no volume", "stray pieces of next to no volume"),
    ];
    let counted: Vec<String> =
        counts.iter().filter(|(count, ..)| *count > 0).map(|&(count, one, many)| counted(count, one, many)).collect();
    (!counted.is_empty()).then(|| format!("left out: {}", counted.join(", ")))
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
        "the surface is closed"
    } else if report.winding_error < GUESSED {
        "0 is a closed surface; above 0.3 the inside is a guess"
    } else {
        "the inside is a guess"
    }
}

fn solid_warnings(volume: &Volume, angles: Option<&DihedralStatistics>) -> Vec<String> {
    let report = &volume.report;
    let mut warnings = Vec::new();
    let mut tell = |is_so: bool, text: String| {
        if is_so {
            warnings.push(text);
        }
    };
    let turned = report.triangles_turned;
    tell(turned > 0, format!("{} inside out and turned", counted(turned, "triangle was", "triangles were")));
    shell_warnings(volume).into_iter().for_each(|text| tell(true, text));
    tell(
        report.area_covered < COVERED,
        format!(
            "facets of {:.1} % of the surface's area could not be kept; the boundary is rough there",
            100.0 - percent(report.area_covered)
        ),
    );
    let thin = angles.map_or(0.0, |a| a.share_below(THIN_DEGREES));
    tell(
        thin >= MANY_THIN,
        format!(
            "{:.2} % of the dihedral angles are below {THIN_DEGREES}°; solvers are slow and less accurate there",
            100.0 * thin
        ),
    );
    tell(
        report.winding_error >= GUESSED,
        format!("inside and outside are uncertain (winding error {:.2})", report.winding_error),
    );
    tell(
        report.bones_apart > 0,
        format!(
            "{} through more than one piece of the volume; weights cannot spread from one to the other",
            counted(report.bones_apart, "group of joined bones runs", "groups of joined bones run")
        ),
    );
    let kept = report.elements_for_bones;
    tell(kept > 0, format!("{} kept so that bones stay in one piece", counted(kept, "element was", "elements were")));
    let kept = report.elements_for_constraints;
    tell(kept > 0, format!("{} kept to satisfy --require", counted(kept, "element was", "elements were")));
    let unsatisfied = report.constraints_unsatisfied;
    tell(unsatisfied > 0, format!("{} not satisfy --require", counted(unsatisfied, "place does", "places do")));
    let kept = report.elements_for_vertices;
    tell(
        kept > 0,
        format!(
            "{} kept so that every vertex of the surface lies in the volume",
            counted(kept, "element was", "elements were")
        ),
    );
    let diagonal = diagonal(volume);
    let far = volume.surface.distance.iter().filter(|&&d| d > FAR_OUTSIDE * diagonal).count();
    tell(
        far > 0,
        format!(
            "{} of the surface lie outside the volume by more than a hundredth of its size",
            counted(far, "vertex", "vertices")
        ),
    );
    warnings
}

/// The volume's size, corner to corner.
fn diagonal(volume: &Volume) -> f64 {
    let bounds = volume.mesh.bounds();
    bounds.map_or(0.0, |(low, high)| low.iter().zip(high).map(|(l, h)| (h - l).powi(2)).sum::<f64>().sqrt())
}

/// How the surface differs from what the volume was made around.
fn shell_warnings(volume: &Volume) -> Vec<String> {
    let report = &volume.report;
    let mut warnings = Vec::new();
    match report.shortfall {
        Some(ShellShortfall::Vertices(count)) => warnings.push(format!(
            "the surface could not be simplified below {} vertices without tearing it or joining its sheets",
            grouped(count)
        )),
        Some(ShellShortfall::Samples) => warnings
            .push("the triangles are not connected; points spread over them were used instead of a surface".to_owned()),
        None => {}
    }
    if let Some(wanted) = report.inner_points_wanted {
        warnings.push(format!(
            "edges of the surface differ so much in length that {} vertices inside would be needed beside the shortest; \
             the volume is coarser there",
            grouped(wanted)
        ));
    }
    if let Some(moved) = report.roughness_smoothed {
        warnings.push(format!(
            "the surface is rougher than elements of this size can follow: it was smoothed, by at most {:.1} % of its \
             size, before it was simplified; ask for more --vertices to keep more of it",
            100.0 * moved / diagonal(volume)
        ));
    }
    let long = report.edges_left_long;
    if long > 0 {
        warnings.push(format!(
            "{} long beside narrow triangles; the volume is coarse there",
            counted(long, "edge of the surface is", "edges of the surface are")
        ));
    }
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
        "pieces_left_out": r.pieces_left_out,
        "flat_elements_left_out": r.flat_elements_left_out,
        "slivers_left_out": r.slivers_left_out,
        "volume": r.volume,
        "winding_error": r.winding_error,
        "closed": r.closed,
        "facets": r.facets,
        "facets_whole": r.facets_whole,
        "facets_cut": r.facets_cut,
        "area_covered": r.area_covered,
        "triangles_turned": r.triangles_turned,
        "shell_vertices": r.shell_vertices,
        "roughness_smoothed": r.roughness_smoothed,
        "edges_left_long": r.edges_left_long,
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
            "smallest angle {:.2}°, {} below the target",
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
        warnings.push(
            "edges of the outline differ so much in length that refining stopped early; some triangles are larger or \
             flatter than they should be"
                .into(),
        );
    }
    if report.pieces_with_bones > 1 {
        warnings.push(format!(
            "bones run through {} separate pieces; weights cannot spread from one to the other",
            report.pieces_with_bones
        ));
    }
    if report.bone_vertices_outside > 0 {
        let count = counted(report.bone_vertices_outside, "place along bones lies", "places along bones lie");
        warnings.push(format!("{count} outside the figure and got no vertex"));
    }
    if !report.points_outside.is_empty() {
        let count = counted(report.points_outside.len(), "point handle lies", "point handles lie");
        warnings.push(format!("{count} outside the figure"));
    }
    warnings
}
