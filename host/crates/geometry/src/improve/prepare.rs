//! From plain arrays to a complex and back, with all checks.

use glam::DVec3;

use super::complex::Complex;
use super::error::ImproveError;
use super::facets::{Facets, NONE};
use super::loose::{BoundaryGive, Loose};
use crate::TetrahedralMesh;
use crate::facets::facet;
use crate::predicates::orientation;
use crate::vectors::is_flatter;

/// Slots are addressed in 32 bits and their facets by four times that.
const MOST_TETRAHEDRA: usize = 1 << 28;
/// Coordinates below this would lose bits when scaled back.
const SMALLEST_SIZE: f64 = 1e-200;
/// Heights below this fraction of the longest edge count as flat.
const FLAT: f64 = 1e-9;

pub(super) struct Prepared {
    pub(super) complex: Complex,
    /// The power of two that positions were multiplied by.
    shift: i32,
    /// Facets of the boundary as they were, each turned to its smallest corner, sorted.
    boundary: Vec<[u32; 3]>,
}

pub(super) struct Finished {
    pub(super) mesh: TetrahedralMesh,
    pub(super) unreferenced: Vec<u32>,
    pub(super) flat_at_boundary: Vec<u32>,
}

pub(super) fn prepare(
    mesh: &TetrahedralMesh,
    fixed: &[bool],
    locked: &[[u32; 3]],
    give: Option<&BoundaryGive<'_>>,
) -> Result<Prepared, ImproveError> {
    mesh.validate()?;
    let vertices = mesh.vertices.len();
    if fixed.len() != vertices {
        return Err(ImproveError::FixedLength { given: fixed.len(), vertices });
    }
    if let Some(give) = give
        && let Some(far) = [give.recede, give.bulge].into_iter().find(|far| far.len() != vertices)
    {
        return Err(ImproveError::GiveLength { given: far.len(), vertices });
    }
    if mesh.tetrahedra.len() > MOST_TETRAHEDRA || vertices > MOST_TETRAHEDRA {
        return Err(ImproveError::TooMany { tetrahedra: mesh.tetrahedra.len(), most: MOST_TETRAHEDRA });
    }
    let largest = mesh.vertices.iter().flatten().fold(0.0, |most: f64, c| most.max(c.abs()));
    if largest < SMALLEST_SIZE {
        return Err(ImproveError::TooSmall);
    }
    let shift = -libm::ilogb(largest);
    let positions: Vec<DVec3> = mesh.vertices.iter().map(|&p| DVec3::from(p.map(|c| libm::scalbn(c, shift)))).collect();
    check_orientation(&positions, &mesh.tetrahedra)?;
    let facets = Facets::gather(&mesh.tetrahedra);
    let neighbours = facets.neighbours(mesh.tetrahedra.len())?;
    let mut pinned = fixed.to_vec();
    let mut locked_sides = vec![0_u8; mesh.tetrahedra.len()];
    for (index, &corners) in locked.iter().enumerate() {
        let sides = facets.sides(corners);
        for side in sides {
            locked_sides[side.tetrahedron as usize] |= 1 << side.opposite;
        }
        if sides.is_empty() {
            return Err(ImproveError::LockedFacetMissing { index, facet: corners });
        }
        corners.iter().for_each(|&v| pinned[v as usize] = true);
    }
    let boundary = boundary(&mesh.tetrahedra, &neighbours);
    let mut may_give = vec![false; vertices];
    for &v in boundary.iter().flatten() {
        may_give[v as usize] = !fixed[v as usize];
        pinned[v as usize] = true;
    }
    let mut complex = Complex::new(positions, mesh.tetrahedra.clone(), neighbours, pinned, locked_sides);
    if let Some(give) = give {
        complex.loosen(Loose::new(give, may_give, |far| libm::scalbn(far, shift)));
    }
    Ok(Prepared { complex, shift, boundary })
}

fn check_orientation(positions: &[DVec3], tetrahedra: &[[u32; 4]]) -> Result<(), ImproveError> {
    let is_positive = |t: &[u32; 4]| {
        let [a, b, c, d] = t.map(|v| positions[v as usize].to_array());
        orientation(&a, &b, &c, &d) > 0.0
    };
    match tetrahedra.iter().position(|t| !is_positive(t)) {
        Some(tetrahedron) => Err(ImproveError::NotPositive { tetrahedron }),
        None => Ok(()),
    }
}

/// Converts back to plain arrays. Input whose tetrahedra overlap without meeting could have become worse, so every
/// guarantee is checked on the result.
pub(super) fn finish(prepared: &Prepared, mesh: &TetrahedralMesh) -> Result<Finished, ImproveError> {
    let complex = &prepared.complex;
    let mut vertices = mesh.vertices.clone();
    vertices.resize(complex.positions().len(), [0.0; 3]);
    for ((index, vertex), position) in (0..).zip(&mut vertices).zip(complex.positions()) {
        if !complex.is_pinned(index) || complex.may_give(index) {
            *vertex = position.to_array().map(|c| libm::scalbn(c, -prepared.shift));
        }
    }
    let tetrahedra: Vec<[u32; 4]> = complex.alive().collect();
    let neighbours = Facets::gather(&tetrahedra).neighbours(tetrahedra.len()).map_err(|_| ImproveError::Overlapping)?;
    let may_differ = complex.loose.is_some();
    let same_boundary = may_differ || boundary(&tetrahedra, &neighbours) == prepared.boundary;
    if !same_boundary || !tetrahedra.iter().all(|&t| complex.is_positive(t)) {
        return Err(ImproveError::Overlapping);
    }
    let flat_at_boundary = flat_at_boundary(complex, &tetrahedra, &neighbours);
    let mut used = vec![false; vertices.len()];
    tetrahedra.iter().flatten().for_each(|&v| used[v as usize] = true);
    let mut was_used = vec![false; mesh.vertices.len()];
    mesh.tetrahedra.iter().flatten().for_each(|&v| was_used[v as usize] = true);
    was_used.resize(vertices.len(), true);
    let unreferenced = (0..vertices.len() as u32).filter(|&v| was_used[v as usize] && !used[v as usize]).collect();
    let mesh = TetrahedralMesh { vertices, tetrahedra };
    mesh.validate()?;
    Ok(Finished { mesh, unreferenced, flat_at_boundary })
}

fn boundary(tetrahedra: &[[u32; 4]], neighbours: &[[u32; 4]]) -> Vec<[u32; 3]> {
    let mut boundary = Vec::new();
    for (&tetrahedron, across) in tetrahedra.iter().zip(neighbours) {
        for k in (0..4).filter(|&k| across[k] == NONE) {
            let [a, b, c] = facet(tetrahedron, k);
            boundary.push([[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap_or([a, b, c]));
        }
    }
    boundary.sort_unstable();
    boundary
}

fn flat_at_boundary(complex: &Complex, tetrahedra: &[[u32; 4]], neighbours: &[[u32; 4]]) -> Vec<u32> {
    let is_flat = |&(index, corners): &(usize, &[u32; 4])| {
        neighbours[index].contains(&NONE) && is_flatter(corners.map(|v| complex.at(v)), FLAT)
    };
    tetrahedra.iter().enumerate().filter(is_flat).map(|(index, _)| index as u32).collect()
}
