//! A volume for a surface: tetrahedra whose vertices lie on the surface, along bones and graded in between, and which of
//! them are inside (thesis chapter 8).
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_geometry::TriangleMesh;
//! use armature_geometry::volume::{Resolution, VolumeInput, VolumeSettings, volume};
//! # let vertices = vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
//! # let triangles = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
//! # let octahedron = TriangleMesh { vertices, triangles };
//! let input = VolumeInput { surface: &octahedron, segments: &[[[-0.5, 0., 0.], [0.5, 0., 0.]]], points: &[] };
//! let settings = VolumeSettings { resolution: Resolution::Embedded { vertices: 500 }, ..VolumeSettings::default() };
//! let solid = volume(&input, &settings, &mut |_stage, _fraction| ControlFlow::Continue(()))?;
//! assert_eq!(solid.report.pieces, 1);
//! assert_eq!(solid.surface.tetrahedra.len(), 6, "one place for each vertex of the surface");
//! # Ok::<(), armature_geometry::volume::VolumeError>(())
//! ```

mod closed_winding;
mod compact;
mod constraints;
mod elements;
mod error;
mod field;
mod input;
mod inside;
mod octree;
mod peel;
mod peel_slivers;
mod recover;
mod report;
mod shell;
mod sites;
mod solid;
mod strays;
mod tessellate;

pub use error::VolumeError;
pub use input::{Resolution, VolumeConstraints, VolumeInput, VolumeSettings};
pub use report::{ShellShortfall, Volume, VolumeReport};

use crate::delaunay::triangulate;
use crate::orientation::orient_patches;
use crate::planar::plane_of;
use crate::progress::{Progress, stage};
use crate::search::TriangleHierarchy;
use crate::winding::FastWindingNumber;
use field::Field;
use inside::find_inside;
use shell::Shell;
use sites::place;
use solid::{Boundary, Solid};
use tessellate::tessellate;

/// The stages of [`volume`] in order, as reported to its progress callback, each with the share of the total time at
/// which it ends, as measured on the armadillo.
pub const STAGES: [(&str, f64); 7] = [
    (SHELL, 0.15),
    (SITES, 0.2),
    (TETRAHEDRA, 0.3),
    (RECOVERY, 0.55),
    (SEGMENTATION, 0.75),
    (IMPROVEMENT, 0.95),
    (EMBEDDING, 1.0),
];
const SHELL: &str = "simplifying the surface";
const SITES: &str = "placing vertices";
const TETRAHEDRA: &str = "connecting vertices";
const RECOVERY: &str = "keeping the surface's facets";
const SEGMENTATION: &str = "telling inside from outside";
const IMPROVEMENT: &str = "removing slivers";
const EMBEDDING: &str = "placing the surface in the volume";

/// A volume for a surface: the surface's triangles are oriented consistently, the volume of its convex hull is
/// tessellated with as many as possible of its facets, or those of a simpler surface (thesis 8.5), inside and outside
/// elements are separated by their winding number and a graph cut (8.5.1), and slivers are removed. `progress` receives
/// the stage and the fraction of it done; see [`Progress`].
pub fn volume(
    input: &VolumeInput<'_>,
    settings: &VolumeSettings,
    progress: Progress<'_>,
) -> Result<Volume, VolumeError> {
    input.validate()?;
    if plane_of(input.surface)?.is_some() {
        return Err(VolumeError::Flat);
    }
    let oriented = orient_patches(input.surface)?;
    let shell = Shell::new(&oriented.mesh, input.segments, settings.resolution, &mut stage(progress, SHELL))?;
    let source = if shell.mesh.triangles.is_empty() { &oriented.mesh } else { &shell.mesh };
    let field = Field { surface: TriangleHierarchy::new(source)?, winding: FastWindingNumber::precompute(source)? };
    if progress(SITES, 0.0).is_break() {
        return Err(VolumeError::Cancelled);
    }
    let sites = place(&shell, &field, input, settings.resolution, settings.grading);
    let bulk = triangulate(&sites.positions, &mut stage(progress, TETRAHEDRA))?;
    let mut whole = tessellate(bulk, &shell, &sites, &mut stage(progress, RECOVERY))?;
    whole.report.triangles_turned = oriented.turned.len();
    whole.report.shortfall = shell.shortfall;
    whole.report.roughness_smoothed = shell.smoothed_by;
    whole.report.edges_left_long = shell.left_long;
    whole.report.inner_points_wanted = sites.wanted_inside;
    let every_vertex = settings.resolution == Resolution::Conforming;
    let inside = find_inside(&mut whole, &field.winding, every_vertex, settings, &mut stage(progress, SEGMENTATION))?;
    let mut solid = Solid::new(&whole, &inside);
    if let Some(improve) = &settings.improve {
        let boundary = match (every_vertex, settings.constraints.facets) {
            (true, _) => Boundary::Conforms(&inside.labels),
            // They may be all there is of a thin part.
            (false, true) => Boundary::Stays,
            (false, false) => Boundary::GivesWay(&shell),
        };
        solid.improve(improve, boundary, &mut whole, &mut stage(progress, IMPROVEMENT))?;
    }
    if progress(EMBEDDING, 0.0).is_break() {
        return Err(VolumeError::Cancelled);
    }
    solid.finish(input, &shell, &field, whole)
}
