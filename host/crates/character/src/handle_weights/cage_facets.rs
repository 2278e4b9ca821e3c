//! Edges of cages as facets on which weights are linear (thesis eq. 4.4).

use armature_weights::handles::CageFacet;
use glam::DVec3;

use super::domain::WeightDomain;

/// Vertices count as on an edge within this fraction of its length; solving allows twice as much.
const ON_EDGE: f64 = 5e-7;

/// The facets for those cage edges (pairs of handles) both of whose ends hold something, with the domain's vertices
/// along them; corners are numbered as in `columns`, a list of handles, ascending.
pub(super) fn cage_facets(domain: &WeightDomain, columns: &[usize], edges: &[[usize; 2]]) -> Vec<CageFacet> {
    let facet = |ends: &[usize; 2]| -> Option<CageFacet> {
        let mut corners = Vec::with_capacity(2);
        let mut places = [DVec3::ZERO; 2];
        for (end, place) in ends.iter().zip(&mut places) {
            corners.push(columns.binary_search(end).ok()?);
            *place = domain.vertices[*domain.held[*end].first()?].into();
        }
        let [a, along] = [places[0], places[1] - places[0]];
        let squared = along.length_squared();
        let is_on = |p: DVec3| {
            let share = (p - a).dot(along) / squared;
            (0.0..=1.0).contains(&share) && p.distance_squared(a + share * along) <= ON_EDGE * ON_EDGE * squared
        };
        let usable = (0..domain.vertices.len()).filter(|&vertex| domain.mass[vertex] > 0.0);
        let vertices = usable.filter(|&vertex| is_on(domain.vertices[vertex].into())).collect();
        Some(CageFacet { corners, vertices })
    };
    edges.iter().filter_map(facet).collect()
}
