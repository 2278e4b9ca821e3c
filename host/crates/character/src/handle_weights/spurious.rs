//! Extrema of weights where no handle holds the shape: places that move against their surroundings.

use armature_geometry::TriangleMesh;
use armature_geometry::surface::weld_vertices;
use armature_weights::WeightMatrix;
use armature_weights::extrema::{Expected, ExtremaError, Neighbours, PersistentExtremum, spurious_extrema};
use armature_weights::handles::HandleBoundary;
use rayon::prelude::*;

use super::domain::WeightDomain;

/// A minimum or maximum of one handle's weights, or a plateau that is one, without a vertex that any handle holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpuriousExtremum {
    /// Where it is; mesh unit.
    pub place: [f64; 3],
    /// Vertex of what the weights were computed on, value and persistence.
    pub extremum: PersistentExtremum,
}

/// All spurious extrema, exactly, on the elements that the weights were computed on; by handle, most persistent first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpuriousExtrema {
    /// Of the weights as they were computed.
    pub computed: Vec<Vec<SpuriousExtremum>>,
    /// After each vertex's weights were scaled to sum to one; `None` if they were not.
    pub scaled: Option<Vec<Vec<SpuriousExtremum>>>,
}

impl SpuriousExtrema {
    /// Those of the weights that are returned.
    pub fn last(&self) -> &[Vec<SpuriousExtremum>] {
        self.scaled.as_deref().unwrap_or(&self.computed)
    }

    /// How many there are in a list, and the largest persistence among them.
    pub fn total(all: &[Vec<SpuriousExtremum>]) -> (usize, f64) {
        let persistence = all.iter().flatten().map(|one| one.extremum.persistence);
        (all.iter().map(Vec::len).sum(), persistence.fold(0.0, f64::max))
    }
}

/// Those of weights on the domain, whose `columns` belong to these of all `handles`.
pub(super) fn spurious_of(
    domain: &WeightDomain,
    neighbours: &Neighbours,
    boundary: &HandleBoundary,
    weights: &WeightMatrix,
    (columns, handles): (&[usize], usize),
) -> Result<Vec<Vec<SpuriousExtremum>>, ExtremaError> {
    let of_column = |column: usize| -> Result<Vec<SpuriousExtremum>, ExtremaError> {
        let found = spurious_extrema(neighbours, &weights.bone(column), Expected::At(&boundary.fixed))?;
        Ok(found
            .into_iter()
            .map(|one| SpuriousExtremum { place: domain.vertices[one.vertex], extremum: one })
            .collect())
    };
    let found: Vec<_> = (0..columns.len()).into_par_iter().map(of_column).collect::<Result<_, _>>()?;
    let mut all = vec![Vec::new(); handles];
    columns.iter().zip(found).for_each(|(&handle, found)| all[handle] = found);
    Ok(all)
}

/// Extrema of weights that are defined on a surface and not held anywhere, as bone heat's are: all but the lowest and the
/// highest of each handle in each piece. Vertices at one place count as one.
pub fn surface_extrema(surface: &TriangleMesh, weights: &WeightMatrix) -> Result<SpuriousExtrema, ExtremaError> {
    let weld = weld_vertices(&surface.vertices, 0.0);
    let welded = |&vertex: &u32| {
        let missing = ExtremaError::NoSuchVertex { vertex: vertex as usize, vertices: surface.vertices.len() };
        weld.welded_of.get(vertex as usize).copied().ok_or(missing)
    };
    let triangles = surface.triangles.iter().map(|corners| {
        let [a, b, c] = corners.each_ref().map(welded);
        Ok([a?, b?, c?])
    });
    let triangles: Vec<[u32; 3]> = triangles.collect::<Result<_, ExtremaError>>()?;
    let neighbours = Neighbours::of_elements(weld.representative.len(), &triangles)?;
    let of_handle = |handle: usize| -> Result<Vec<SpuriousExtremum>, ExtremaError> {
        let column = weights.bone(handle);
        let values: Vec<f64> = weld.representative.iter().map(|&vertex| column[vertex as usize]).collect();
        let found = spurious_extrema(&neighbours, &values, Expected::Outermost)?;
        let placed = |one: PersistentExtremum| {
            let vertex = weld.representative[one.vertex] as usize;
            SpuriousExtremum { place: surface.vertices[vertex], extremum: PersistentExtremum { vertex, ..one } }
        };
        Ok(found.into_iter().map(placed).collect())
    };
    let computed = (0..weights.bones()).into_par_iter().map(of_handle).collect::<Result<_, _>>()?;
    Ok(SpuriousExtrema { computed, scaled: None })
}
