//! How much an extremum matters: the difference to the saddle at which, rising from a minimum or falling from a
//! maximum, one first meets what comes from a more extreme one (Edelsbrunner et al. 2002; thesis 5.3.3).

use super::error::ExtremaError;
use super::neighbours::Neighbours;

/// A minimum or maximum and its persistence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PersistentExtremum {
    /// The vertex; of a plateau, the first or last in order of index.
    pub vertex: usize,
    /// Its value.
    pub value: f64,
    /// Whether it is a minimum.
    pub is_minimum: bool,
    /// Difference to its saddle; for the lowest minimum and the highest maximum of a piece, which have none, the range of
    /// the values there.
    pub persistence: f64,
}

/// The extrema of a function, one value for each vertex, most persistent first. A plateau is one extremum, and a piece
/// of the mesh of one value has none.
pub fn persistence(neighbours: &Neighbours, values: &[f64]) -> Result<Vec<PersistentExtremum>, ExtremaError> {
    persistence_preferring(neighbours, values, |_| false)
}

/// The same; of extrema with equal values, those with a preferred vertex count as the more extreme ones.
pub(super) fn persistence_preferring(
    neighbours: &Neighbours,
    values: &[f64],
    is_preferred: impl Fn(usize) -> bool,
) -> Result<Vec<PersistentExtremum>, ExtremaError> {
    neighbours.check(values)?;
    let mut order: Vec<usize> = (0..values.len()).collect();
    let preferred = |a: usize, b: usize| is_preferred(b).cmp(&is_preferred(a));
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]).then(preferred(a, b)).then(a.cmp(&b)));
    let mut found = merge(neighbours, values, &order, true);
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]).then(preferred(a, b)).then(b.cmp(&a)));
    found.extend(merge(neighbours, values, &order, false));
    found.retain(|extremum| extremum.persistence > 0.0);
    found.sort_by(|a, b| b.persistence.total_cmp(&a.persistence).then(a.vertex.cmp(&b.vertex)));
    Ok(found)
}

/// Joins vertices in the given order; where two sets meet, the younger one's first vertex ends.
fn merge(neighbours: &Neighbours, values: &[f64], order: &[usize], is_minimum: bool) -> Vec<PersistentExtremum> {
    let mut place = vec![0_usize; values.len()];
    order.iter().enumerate().for_each(|(k, &vertex)| place[vertex] = k);
    // By place: the parent in a forest; a root is the first vertex of its set.
    let mut parent: Vec<usize> = (0..order.len()).collect();
    let mut last: Vec<f64> = order.iter().map(|&vertex| values[vertex]).collect();
    let mut found = Vec::new();
    let mut end = |root: usize, at: f64| {
        let (vertex, value) = (order[root], values[order[root]]);
        found.push(PersistentExtremum { vertex, value, is_minimum, persistence: (at - value).abs() });
    };
    for (k, &vertex) in order.iter().enumerate() {
        for other in neighbours.of(vertex).map(|other| place[other]).filter(|&other| other < k) {
            let (a, b) = (find(&mut parent, other), find(&mut parent, k));
            let (older, younger) = (a.min(b), a.max(b));
            if older != younger {
                if younger != k {
                    end(younger, values[vertex]);
                }
                parent[younger] = older;
            }
            last[older] = values[vertex];
        }
    }
    for root in 0..order.len() {
        if parent[root] == root {
            end(root, last[root]);
        }
    }
    found
}

fn find(parent: &mut [usize], mut k: usize) -> usize {
    while parent[k] != k {
        parent[k] = parent[parent[k]];
        k = parent[k];
    }
    k
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_landscape_on_a_path() {
        let edges: Vec<[u32; 2]> = (0..6).map(|k| [k, k + 1]).collect();
        let path = Neighbours::of_elements(7, &edges).unwrap();
        let found = persistence(&path, &[0.0, 5.0, 3.0, 3.0, 4.0, 1.0, 9.0]).unwrap();
        let told: Vec<(usize, bool, f64)> = found.iter().map(|e| (e.vertex, e.is_minimum, e.persistence)).collect();
        let expected =
            [(0, true, 9.0), (6, false, 9.0), (1, false, 4.0), (5, true, 4.0), (2, true, 1.0), (4, false, 1.0)];
        assert_eq!(told, expected);
        assert_eq!(persistence(&path, &[2.0; 7]), Ok(vec![]), "constant");
    }
}
