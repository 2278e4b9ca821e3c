//! Adjacency: edges, fans, components. Plain index lists, rebuilt when needed.

use crate::TriangleMesh;

/// One undirected edge and the triangles on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Its two vertices, the smaller index first.
    pub vertices: [u32; 2],
    /// How many triangles use it: one at a boundary, two inside a surface, more where the surface is non-manifold.
    pub triangles: u32,
    /// How many of those run along it from the smaller to the larger index; half of them in a surface that is
    /// oriented consistently.
    pub forward: u32,
}

/// Every undirected edge once, sorted by its vertices. Edges from a vertex to itself are skipped.
pub fn edges(triangles: &[[u32; 3]]) -> Vec<Edge> {
    let mut sides: Vec<(u32, u32, bool)> = Vec::with_capacity(3 * triangles.len());
    for &[a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if from != to {
                sides.push((from.min(to), from.max(to), from < to));
            }
        }
    }
    sides.sort_unstable();
    let mut edges: Vec<Edge> = Vec::with_capacity(sides.len() / 2);
    for (low, high, forward) in sides {
        match edges.last_mut() {
            Some(edge) if edge.vertices == [low, high] => {
                edge.triangles += 1;
                edge.forward += u32::from(forward);
            }
            _ => edges.push(Edge { vertices: [low, high], triangles: 1, forward: u32::from(forward) }),
        }
    }
    edges
}

/// For every item a slice of a shared list.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Fans {
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Fans {
    /// The items of one vertex, ascending; empty for a vertex that does not exist.
    pub fn of(&self, vertex: usize) -> &[u32] {
        match (self.starts.get(vertex), self.starts.get(vertex + 1)) {
            (Some(&first), Some(&end)) => &self.items[first as usize..end as usize],
            _ => &[],
        }
    }
}

/// For every vertex, the triangles that use it (once per triangle, even if the triangle repeats the vertex).
///
/// # Panics
/// If a triangle refers to a vertex that does not exist.
pub fn vertex_triangles(vertex_count: usize, triangles: &[[u32; 3]]) -> Fans {
    let distinct =
        |&[a, b, c]: &[u32; 3]| [Some(a), (b != a).then_some(b), (c != a && c != b).then_some(c)].into_iter().flatten();
    let mut starts = vec![0_u32; vertex_count + 1];
    for vertex in triangles.iter().flat_map(distinct) {
        starts[vertex as usize + 1] += 1;
    }
    for vertex in 0..vertex_count {
        starts[vertex + 1] += starts[vertex];
    }
    let mut next = starts.clone();
    let mut items = vec![0; starts[vertex_count] as usize];
    for (index, triangle) in triangles.iter().enumerate() {
        for vertex in distinct(triangle) {
            let slot = &mut next[vertex as usize];
            items[*slot as usize] = index as u32;
            *slot += 1;
        }
    }
    Fans { starts, items }
}

/// Which vertices are connected through triangles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Components {
    /// Number of components; a vertex in no triangle is one of its own.
    pub count: usize,
    /// Component of every vertex, numbered by their first vertices.
    pub of_vertex: Vec<u32>,
}

/// Connected components.
///
/// # Panics
/// If a triangle refers to a vertex that does not exist.
pub fn connected_components(vertex_count: usize, triangles: &[[u32; 3]]) -> Components {
    let mut parents: Vec<u32> = (0..vertex_count as u32).collect();
    for &[a, b, c] in triangles {
        for other in [b, c] {
            let (x, y) = (root(&mut parents, a), root(&mut parents, other));
            // The smaller index stays the root, so roots are first vertices.
            parents[x.max(y) as usize] = x.min(y);
        }
    }
    let mut count = 0_u32;
    let mut of_vertex = vec![0; vertex_count];
    for vertex in 0..vertex_count as u32 {
        let root = root(&mut parents, vertex);
        if root == vertex {
            of_vertex[vertex as usize] = count;
            count += 1;
        } else {
            of_vertex[vertex as usize] = of_vertex[root as usize];
        }
    }
    Components { count: count as usize, of_vertex }
}

fn root(parents: &mut [u32], mut vertex: u32) -> u32 {
    while parents[vertex as usize] != vertex {
        let grandparent = parents[parents[vertex as usize] as usize];
        parents[vertex as usize] = grandparent;
        vertex = grandparent;
    }
    vertex
}

/// Edges with one triangle: the rims of holes.
pub fn boundary_edges(mesh: &TriangleMesh) -> Vec<[u32; 2]> {
    edges(&mesh.triangles).iter().filter(|e| e.triangles == 1).map(|e| e.vertices).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_know_their_triangles() {
        let edges = edges(&[[0, 1, 2], [2, 1, 3], [1, 2, 4], [5, 5, 6]]);
        let shared = edges.iter().find(|e| e.vertices == [1, 2]).unwrap();
        assert_eq!((shared.triangles, shared.forward), (3, 2));
        assert_eq!(edges.iter().filter(|e| e.triangles == 1).count(), 6);
        assert!(edges.windows(2).all(|w| w[0].vertices < w[1].vertices));
    }

    #[test]
    fn fans_and_components() {
        let triangles = [[0, 1, 2], [2, 1, 3], [5, 4, 5]];
        let fans = vertex_triangles(7, &triangles);
        assert_eq!(fans.of(1), [0, 1]);
        assert_eq!(fans.of(5), [2]);
        assert_eq!((fans.of(6), fans.of(99)), (&[][..], &[][..]));
        let components = connected_components(7, &triangles);
        assert_eq!(components.count, 3);
        assert_eq!(components.of_vertex, [0, 0, 0, 0, 1, 1, 2]);
    }
}
