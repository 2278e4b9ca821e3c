//! The elements inside, on their way to a volume.

use std::collections::HashMap;
use std::ops::ControlFlow;

use glam::DVec3;

use super::compact::compact;
use super::elements::Elements;
use super::error::VolumeError;
use super::field::Field;
use super::input::VolumeInput;
use super::inside::{Inside, bone_groups};
use super::peel::is_flat;
use super::peel_slivers::peel_slivers;
use super::report::Volume;
use super::shell::{Places, Shell, mean_edge_lengths};
use super::tessellate::Tessellation;
use crate::embed::{EmbedError, Embedding, SurfacePlaceHint, embed_points};
use crate::facets::{facet, neighbour_pairs, sorted, sorted_sides};
use crate::improve::{
    BoundaryGive, ImproveError, ImproveSettings, dihedral_angles, improve_tetrahedra, improve_with_boundary,
};
use crate::simplify::{SurfacePlace, space_around};
use crate::surface::connected_components;
use crate::vectors::{places, six_volumes};
use crate::{TetrahedralMesh, TriangleMesh};

/// How far the boundary of an embedded volume may recede where slivers are, relative to the edges there.
const RECEDE: f64 = 0.15;
/// How far it may bulge, likewise.
const BULGE: f64 = 0.05;
/// Their mean counts as at most this many times their median: a spike's long edges say nothing about what is beside it.
const MOST_TIMES_MEDIAN: f64 = 2.0;
/// If that could add more than this share to the volume ...
const MOST_GROWTH: f64 = 0.1;
/// ... what is thin becomes thicker by no more than this share on either side.
const SHARE_OF_THICKNESS: f64 = 0.5;
/// It uses up no more than this share of the space up to the next sheet.
const SHARE_OF_SPACE: f64 = 0.2;

/// What sliver removal may do to the boundary.
#[derive(Clone, Copy)]
pub(super) enum Boundary<'a> {
    /// The shell's vertices stay, and with these labels its facets inside.
    Conforms(&'a [bool]),
    /// It stays.
    Stays,
    /// It may recede and bulge a little.
    GivesWay(&'a Shell),
}

/// Tetrahedra in the numbering of the tessellation, with all its vertices still present.
pub(super) struct Solid {
    mesh: TetrahedralMesh,
    /// The winding number of all elements, if they have the same.
    common_winding: Option<f64>,
    /// Vertices that vanished from the boundary, each with one that is in its place.
    merged: HashMap<u32, u32>,
}

impl Solid {
    pub(super) fn new(whole: &Tessellation, inside: &Inside) -> Self {
        let elements = &whole.elements;
        let kept = || (0..inside.labels.len()).filter(|&element| inside.labels[element]);
        let tetrahedra = kept().map(|element| elements.tetrahedra[element]).collect();
        let first = kept().next().map(|element| inside.winding[element]);
        let is_common = |w: &f64| kept().all(|element| (inside.winding[element] - w).abs() <= 0.0);
        let common_winding = first.filter(|w| whole.report.closed && is_common(w));
        Self {
            mesh: TetrahedralMesh { vertices: elements.vertices.clone(), tetrahedra },
            common_winding,
            merged: HashMap::new(),
        }
    }

    /// Removes slivers. Vertices of handles stay.
    pub(super) fn improve(
        &mut self,
        settings: &ImproveSettings,
        boundary: Boundary<'_>,
        whole: &mut Tessellation,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<(), VolumeError> {
        let mut fixed = vec![false; self.mesh.vertices.len()];
        let conforms = matches!(boundary, Boundary::Conforms(_));
        let kept = whole.shell.iter().flatten().filter(|_| conforms);
        for &vertex in whole.segments.iter().flatten().chain(&whole.points).chain(kept) {
            fixed[vertex as usize] = true;
        }
        let mut told = |_: &str, done| progress(done);
        let improved = match boundary {
            Boundary::Conforms(labels) => {
                let locked = inner_facets(&whole.elements, labels, &self.mesh);
                improve_tetrahedra(&mut self.mesh, &fixed, &locked, settings, &mut told)
            }
            Boundary::Stays => improve_tetrahedra(&mut self.mesh, &fixed, &[], settings, &mut told),
            Boundary::GivesWay(shell) => {
                let (recede, bulge) = give(&self.mesh, whole, shell);
                let give = BoundaryGive { recede: &recede, bulge: &bulge };
                improve_with_boundary(&mut self.mesh, &fixed, &give, settings, &mut told)
            }
        };
        match improved {
            Ok(improvement) => {
                self.merged = improvement.vertices_merged.iter().map(|&[vertex, place]| (vertex, place)).collect();
                whole.report.improvement = Some(improvement);
            }
            Err(ImproveError::Cancelled) => return Err(VolumeError::Cancelled),
            Err(error) => return Err(VolumeError::Improvement(error)),
        }
        if !conforms {
            whole.report.slivers_left_out = peel_slivers(&mut self.mesh, &fixed);
        }
        Ok(())
    }

    /// The volume, with used vertices only.
    pub(super) fn finish(
        self,
        input: &VolumeInput<'_>,
        shell: &Shell,
        field: &Field,
        whole: Tessellation,
    ) -> Result<Volume, VolumeError> {
        let first = whole.shell.iter().flatten().copied();
        let (mesh, number_of) = compact(&self.mesh, first);
        let number = |v: &u32| number_of[*v as usize];
        let numbers = |run: &Vec<u32>| run.iter().map(number).collect::<Option<Vec<u32>>>();
        let handles: Option<(Vec<_>, Vec<_>)> =
            whole.segments.iter().map(numbers).collect::<Option<_>>().zip(numbers(&whole.points));
        let (segment_vertices, point_vertices) = handles.ok_or(VolumeError::HandleLost)?;
        let mut report = whole.report;
        (report.pieces, report.bones_apart) = pieces(&mesh, &segment_vertices);
        report.dihedral_angles = Some(dihedral_angles(&mesh)?);
        report.volume = positions(&mesh).map(|p| six_volumes(p) / 6.0).sum();
        let winding = if let Some(winding) = self.common_winding {
            vec![winding; mesh.tetrahedra.len()]
        } else {
            let barycentre = |[a, b, c, d]: [DVec3; 4]| (0.25 * (a + b + c + d)).to_array();
            field.winding.evaluate_many(&positions(&mesh).map(barycentre).collect::<Vec<_>>())
        };
        let place = |v: u32| number_of[v as usize].or_else(|| number_of[*self.merged.get(&v)? as usize]);
        let at: Vec<Option<u32>> = whole.shell.iter().map(|site| site.and_then(place)).collect();
        let surface = embed(&mesh, input, shell, &at)?;
        Ok(Volume { mesh, winding, segment_vertices, point_vertices, surface, report })
    }
}

/// How far the boundary of an embedded volume may recede and bulge at each vertex: small parts of the length of the edges
/// there, of the space outside, and of what is thin.
fn give(mesh: &TetrahedralMesh, whole: &Tessellation, shell: &Shell) -> (Vec<f64>, Vec<f64>) {
    let sides = sorted_sides(&mesh.tetrahedra);
    let alone =
        sides.chunk_by(|a, b| a.corners == b.corners).filter(|same| same.len() == 1).map(|same| same[0].corners);
    let boundary = TriangleMesh { vertices: mesh.vertices.clone(), triangles: alone.collect() };
    let mut edges = mean_edge_lengths(&boundary);
    let mut lengths: Vec<Vec<f64>> = vec![Vec::new(); edges.len()];
    for [a, b, c] in &boundary.triangles {
        for [a, b] in [[a, b], [b, c], [c, a]].map(|edge| edge.map(|&v| v as usize)) {
            let length = DVec3::from(boundary.vertices[a]).distance(DVec3::from(boundary.vertices[b]));
            [a, b].into_iter().for_each(|v| lengths[v].push(length));
        }
    }
    for (edge, lengths) in edges.iter_mut().zip(&mut lengths).filter(|(_, lengths)| !lengths.is_empty()) {
        let middle = lengths.len() / 2;
        *edge = edge.min(MOST_TIMES_MEDIAN * *lengths.select_nth_unstable_by(middle, f64::total_cmp).1);
    }
    let recede: Vec<f64> = edges.iter().map(|edge| if edge.is_finite() { RECEDE * edge } else { 0.0 }).collect();
    let mut bulge = vec![0.0; recede.len()];
    let longest = edges.iter().filter(|edge| edge.is_finite()).fold(0.0, |most: f64, &edge| most.max(edge));
    let space = space_around(&shell.mesh, longest);
    let mut limit = |share: f64| {
        for (site, [outside, inside]) in whole.shell.iter().zip(&space) {
            if let &Some(vertex) = site {
                let v = vertex as usize;
                let most = (SHARE_OF_SPACE * outside).min(share * inside);
                bulge[v] = (BULGE / RECEDE * recede[v]).min(most);
            }
        }
        let thicker = boundary.triangles.iter().map(|&t| {
            let [a, b, c] = places(&boundary.vertices, t);
            0.5 * (b - a).cross(c - a).length() * t.iter().map(|&v| bulge[v as usize]).sum::<f64>() / 3.0
        });
        thicker.sum::<f64>()
    };
    let volume: f64 = positions(mesh).map(|p| six_volumes(p) / 6.0).sum();
    // Only where thin walls are most of the shape; elsewhere sheets that cross would count as thin.
    if limit(f64::INFINITY) > MOST_GROWTH * volume {
        limit(SHARE_OF_THICKNESS);
    }
    (recede, bulge)
}

/// Facets of the shell with inside elements on both sides, as far as those are still in the mesh. Elements that are flat
/// up to rounding may lose theirs: nothing moves, and only so can they go.
fn inner_facets(elements: &Elements, labels: &[bool], mesh: &TetrahedralMesh) -> Vec<[u32; 3]> {
    let mut facets = Vec::new();
    for (element, corners) in elements.tetrahedra.iter().enumerate().filter(|&(element, _)| labels[element]) {
        for slot in (0..4).filter(|&slot| elements.locked[element][slot]) {
            let across = elements.neighbours[element][slot] as usize;
            let is_inner = labels.get(across).is_some_and(|&inside| inside);
            if element < across && is_inner && ![element, across].iter().any(|&e| is_flat(elements, e)) {
                facets.push(sorted(facet(*corners, slot)).0);
            }
        }
    }
    if !facets.is_empty() {
        let known = sorted_sides(&mesh.tetrahedra);
        facets.retain(|facet| known.binary_search_by(|side| side.corners.cmp(facet)).is_ok());
    }
    facets
}

fn positions(mesh: &TetrahedralMesh) -> impl Iterator<Item = [DVec3; 4]> + '_ {
    mesh.tetrahedra.iter().map(|&t| places(&mesh.vertices, t))
}

/// The number of pieces, connected through facets, and the number of groups of bones sharing ends that are in several
/// pieces.
fn pieces(mesh: &TetrahedralMesh, runs: &[Vec<u32>]) -> (usize, usize) {
    let joined: Vec<[u32; 3]> = neighbour_pairs(&mesh.tetrahedra).into_iter().map(|[a, b]| [a, b, b]).collect();
    let pieces = connected_components(mesh.tetrahedra.len(), &joined);
    let mut pieces_at: Vec<Vec<u32>> = vec![Vec::new(); mesh.vertices.len()];
    for (element, t) in mesh.tetrahedra.iter().enumerate() {
        for &v in t {
            pieces_at[v as usize].push(pieces.of_vertex[element]);
        }
    }
    let groups = bone_groups(runs);
    let is_apart = |group: &Vec<u32>| {
        let Some((&first, rest)) = group.split_first() else { return false };
        let holds_all = |piece: &u32| rest.iter().all(|&v| pieces_at[v as usize].contains(piece));
        !pieces_at[first as usize].iter().any(holds_all)
    };
    (pieces.count, groups.iter().filter(|group| is_apart(group)).count())
}

/// Where the surface's vertices are; `at`: the vertex of the volume at each vertex of the shell, if it has one.
fn embed(
    mesh: &TetrahedralMesh,
    input: &VolumeInput<'_>,
    shell: &Shell,
    at: &[Option<u32>],
) -> Result<Embedding, EmbedError> {
    let vertices = &input.surface.vertices;
    let hint = |place: &SurfacePlace| SurfacePlaceHint {
        vertices: shell.mesh.triangles[place.triangle as usize]
            .map(|v| at[v as usize].unwrap_or(SurfacePlaceHint::UNKNOWN)),
    };
    match &shell.places {
        Places::OnShell(on_shell) => {
            let hints: Vec<SurfacePlaceHint> = on_shell.iter().map(hint).collect();
            embed_points(mesh, vertices, Some(&hints))
        }
        Places::AreVertices => embed_vertices(mesh, vertices, at),
        Places::Unknown => embed_points(mesh, vertices, None),
    }
}

/// Vertices of the surface that are vertices of the volume are at a corner; the others, which are in no triangle, are
/// at the nearest place.
fn embed_vertices(mesh: &TetrahedralMesh, vertices: &[[f64; 3]], at: &[Option<u32>]) -> Result<Embedding, EmbedError> {
    let mut corner_at = vec![None; mesh.vertices.len()];
    for (element, corners) in mesh.tetrahedra.iter().enumerate() {
        for (k, &v) in corners.iter().enumerate() {
            corner_at[v as usize] = Some((element as u32, k));
        }
    }
    let corner_of: Vec<Option<(u32, usize)>> = at.iter().map(|v| v.and_then(|v| corner_at[v as usize])).collect();
    let others: Vec<[f64; 3]> =
        vertices.iter().zip(&corner_of).filter(|(_, corner)| corner.is_none()).map(|(&p, _)| p).collect();
    let others = embed_points(mesh, &others, None)?;
    let mut embedding = Embedding { searched_everywhere: others.searched_everywhere, ..Embedding::default() };
    let mut next_other = 0;
    for corner in corner_of {
        if let Some((element, k)) = corner {
            embedding.tetrahedra.push(element);
            embedding.barycentric.push(std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 }));
            embedding.distance.push(0.0);
        } else {
            embedding.tetrahedra.push(others.tetrahedra[next_other]);
            embedding.barycentric.push(others.barycentric[next_other]);
            embedding.distance.push(others.distance[next_other]);
            next_other += 1;
        }
    }
    Ok(embedding)
}
