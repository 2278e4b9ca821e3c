//! The elements inside, on their way to a volume.

use std::ops::ControlFlow;

use glam::DVec3;
use rayon::prelude::*;

use super::compact::compact;
use super::elements::Elements;
use super::inside::{Inside, bone_groups};
use super::peel_slivers::peel_slivers;
use super::shell::{Places, Shell};
use super::tessellate::Tessellation;
use super::{Field, Volume, VolumeError, VolumeInput};
use crate::{
    EmbedError, Embedding, ImproveError, ImproveSettings, SurfacePlace, SurfacePlaceHint, TetrahedralMesh,
    connected_components, dihedral_angles, embed_points, improve_tetrahedra,
};

/// Tetrahedra in the numbering of the tessellation, whose vertices are all there still.
pub(super) struct Solid {
    mesh: TetrahedralMesh,
    /// The winding number of all elements, if it is the same.
    common_winding: Option<f64>,
}

impl Solid {
    pub(super) fn new(whole: &Tessellation, inside: &Inside) -> Self {
        let elements = &whole.elements;
        let kept = || (0..inside.labels.len()).filter(|&element| inside.labels[element]);
        let tetrahedra = kept().map(|element| elements.tetrahedra[element]).collect();
        let first = kept().next().map(|element| inside.winding[element]);
        let is_common = |w: &f64| kept().all(|element| (inside.winding[element] - w).abs() <= 0.0);
        let common_winding = first.filter(|w| whole.report.closed && is_common(w));
        Self { mesh: TetrahedralMesh { vertices: elements.vertices.clone(), tetrahedra }, common_winding }
    }

    /// Removes slivers. Vertices of handles stay, and with `keep_shell` those of the shell and its facets inside.
    pub(super) fn improve(
        &mut self,
        settings: &ImproveSettings,
        keep_shell: Option<&[bool]>,
        whole: &mut Tessellation,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<(), VolumeError> {
        let mut fixed = vec![false; self.mesh.vertices.len()];
        let shell = whole.shell.iter().flatten().filter(|_| keep_shell.is_some());
        for &vertex in whole.segments.iter().flatten().chain(&whole.points).chain(shell) {
            fixed[vertex as usize] = true;
        }
        let locked = keep_shell.map_or_else(Vec::new, |labels| inner_facets(&whole.elements, labels, &self.mesh));
        match improve_tetrahedra(&mut self.mesh, &fixed, &locked, settings, progress) {
            Ok(improvement) => whole.report.improvement = Some(improvement),
            Err(ImproveError::Cancelled) => return Err(VolumeError::Cancelled),
            Err(error) => return Err(VolumeError::Improvement(error)),
        }
        if keep_shell.is_none() {
            whole.report.slivers_left_out = peel_slivers(&mut self.mesh, &fixed);
        }
        Ok(())
    }

    /// The volume, with vertices that are used only.
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
        report.volume = positions(&mesh).map(|[a, b, c, d]| (b - a).dot((c - a).cross(d - a)) / 6.0).sum();
        let winding = if let Some(winding) = self.common_winding {
            vec![winding; mesh.tetrahedra.len()]
        } else {
            let barycentre = |[a, b, c, d]: [DVec3; 4]| (0.25 * (a + b + c + d)).to_array();
            field.winding.evaluate_many(&positions(&mesh).map(barycentre).collect::<Vec<_>>())
        };
        let at: Vec<Option<u32>> = whole.shell.iter().map(|site| site.and_then(|v| number_of[v as usize])).collect();
        let surface = embed(&mesh, input, shell, &at)?;
        Ok(Volume { mesh, winding, segment_vertices, point_vertices, surface, report })
    }
}

/// Facets of the shell with elements inside on both sides, as far as those are still in the mesh.
fn inner_facets(elements: &Elements, labels: &[bool], mesh: &TetrahedralMesh) -> Vec<[u32; 3]> {
    let mut facets = Vec::new();
    for (element, corners) in elements.tetrahedra.iter().enumerate().filter(|&(element, _)| labels[element]) {
        for slot in (0..4).filter(|&slot| elements.locked[element][slot]) {
            let across = elements.neighbours[element][slot] as usize;
            if element < across && labels.get(across).is_some_and(|&inside| inside) {
                let mut facet = [corners[(slot + 1) % 4], corners[(slot + 2) % 4], corners[(slot + 3) % 4]];
                facet.sort_unstable();
                facets.push(facet);
            }
        }
    }
    if !facets.is_empty() {
        let known = sorted_facets(mesh);
        facets.retain(|facet| known.binary_search_by(|(other, _)| other.cmp(facet)).is_ok());
    }
    facets
}

/// Every facet of every element with its corners ascending, in their order.
fn sorted_facets(mesh: &TetrahedralMesh) -> Vec<([u32; 3], u32)> {
    let mut facets: Vec<([u32; 3], u32)> = Vec::with_capacity(4 * mesh.tetrahedra.len());
    for (element, t) in mesh.tetrahedra.iter().enumerate() {
        for k in 0..4 {
            let mut facet = [t[(k + 1) % 4], t[(k + 2) % 4], t[(k + 3) % 4]];
            facet.sort_unstable();
            facets.push((facet, element as u32));
        }
    }
    facets.par_sort_unstable();
    facets
}

fn positions(mesh: &TetrahedralMesh) -> impl Iterator<Item = [DVec3; 4]> + '_ {
    mesh.tetrahedra.iter().map(|t| t.map(|v| DVec3::from(mesh.vertices[v as usize])))
}

/// Pairs of elements that share a facet.
pub(super) fn facet_neighbours(mesh: &TetrahedralMesh) -> Vec<[u32; 2]> {
    let facets = sorted_facets(mesh);
    facets.windows(2).filter(|pair| pair[0].0 == pair[1].0).map(|pair| [pair[0].1, pair[1].1]).collect()
}

/// How many pieces there are, joined through facets, and how many groups of bones that share ends lie in several.
fn pieces(mesh: &TetrahedralMesh, runs: &[Vec<u32>]) -> (usize, usize) {
    let joined: Vec<[u32; 3]> = facet_neighbours(mesh).into_iter().map(|[a, b]| [a, b, b]).collect();
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
        Places::OnShell(places) => {
            let hints: Vec<SurfacePlaceHint> = places.iter().map(hint).collect();
            embed_points(mesh, vertices, Some(&hints))
        }
        Places::AreVertices => embed_vertices(mesh, vertices, at),
        Places::Unknown => embed_points(mesh, vertices, None),
    }
}

/// Vertices of the surface that are vertices of the volume are at a corner; the others, which are in no triangle, at
/// the nearest place.
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
