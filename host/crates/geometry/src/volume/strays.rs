//! Pieces of next to no volume, left behind where a surface crosses itself.

use super::elements::Elements;
use super::tessellate::Tessellation;

/// Pieces of a smaller share of the volume than this are strays: those of a cube half a percent as wide as the shape.
/// Where surfaces cross they are around 1e-9, or due to rounding.
const STRAY: f64 = 1e-7;
const NONE: u32 = u32::MAX;

/// Which vertices have to stay vertices of the volume.
pub(super) struct Needed {
    /// Of bones and point handles.
    pub(super) by_handles: Vec<bool>,
    /// Of the surface, if the volume conforms to it.
    pub(super) by_surface: Vec<bool>,
}

/// What happened to strays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Strays {
    /// Pieces that are outside now.
    pub(super) left_out: usize,
    /// Elements that are inside now, each of which joins a stray that alone holds a vertex to another piece.
    pub(super) bridges: usize,
}

impl Needed {
    pub(super) fn of(whole: &Tessellation, every_vertex: bool) -> Self {
        let count = whole.elements.vertices.len();
        let mut needed = Self { by_handles: vec![false; count], by_surface: vec![false; count] };
        whole.segments.iter().flatten().chain(&whole.points).for_each(|&v| needed.by_handles[v as usize] = true);
        let shell = whole.shell.iter().flatten().filter(|_| every_vertex);
        shell.for_each(|&v| needed.by_surface[v as usize] = true);
        needed
    }

    pub(super) fn either(&self) -> Vec<bool> {
        self.by_handles.iter().zip(&self.by_surface).map(|(&a, &b)| a || b).collect()
    }
}

/// Labels strays as outside, except those that hold a handle, or a needed vertex of the surface that no other piece
/// holds. The latter are joined to their neighbours where a single element of no more volume can do it.
pub(super) fn drop_strays(elements: &Elements, needed: &Needed, labels: &mut [bool]) -> Strays {
    let mut found = Strays { left_out: 0, bridges: 0 };
    let (piece_of, pieces) = pieces(elements, labels);
    let volume_of = |piece: &[u32]| piece.iter().map(|&e| elements.volumes[e as usize]).sum::<f64>();
    let volumes: Vec<f64> = pieces.iter().map(|piece| volume_of(piece)).collect();
    let limit = STRAY * volumes.iter().sum::<f64>();
    let mut strays: Vec<usize> = (0..pieces.len()).filter(|&piece| volumes[piece] < limit).collect();
    if strays.is_empty() {
        return found;
    }
    strays.sort_by(|&a, &b| volumes[a].total_cmp(&volumes[b]).then(a.cmp(&b)));
    let vertices: Vec<Vec<u32>> = pieces.iter().map(|piece| vertices_of(elements, piece)).collect();
    let mut holders = vec![0_u32; elements.vertices.len()];
    vertices.iter().flatten().for_each(|&v| holders[v as usize] += 1);
    let mut stay = vec![false; pieces.len()];
    for &stray in &strays {
        let holds = |&v: &u32| needed.by_handles[v as usize];
        let alone = |&v: &u32| needed.by_surface[v as usize] && holders[v as usize] == 1;
        stay[stray] = vertices[stray].iter().any(|v| holds(v) || alone(v));
        if !stay[stray] {
            found.left_out += 1;
            pieces[stray].iter().for_each(|&e| labels[e as usize] = false);
            vertices[stray].iter().for_each(|&v| holders[v as usize] -= 1);
        }
    }
    for &stray in strays.iter().filter(|&&stray| stay[stray]) {
        if let Some(bridge) = bridge(elements, &pieces[stray], &piece_of, labels)
            && elements.volumes[bridge] < limit
        {
            labels[bridge] = true;
            found.bridges += 1;
        }
    }
    found
}

/// The smallest outside element between a piece and another.
fn bridge(elements: &Elements, piece: &[u32], piece_of: &[u32], labels: &[bool]) -> Option<usize> {
    let own = piece_of[*piece.first()? as usize];
    let is_other = |&n: &u32| labels.get(n as usize).is_some_and(|&inside| inside) && piece_of[n as usize] != own;
    let around = piece.iter().flat_map(|&e| elements.neighbours[e as usize]).map(|n| n as usize);
    let between =
        around.filter(|&n| labels.get(n).is_some_and(|&inside| !inside) && elements.neighbours[n].iter().any(is_other));
    between.min_by(|&a, &b| elements.volumes[a].total_cmp(&elements.volumes[b]).then(a.cmp(&b)))
}

/// The piece of each inside element, and the elements of each piece.
fn pieces(elements: &Elements, labels: &[bool]) -> (Vec<u32>, Vec<Vec<u32>>) {
    let mut piece_of = vec![NONE; labels.len()];
    let mut pieces: Vec<Vec<u32>> = Vec::new();
    for seed in 0..labels.len() {
        if !labels[seed] || piece_of[seed] != NONE {
            continue;
        }
        let name = pieces.len() as u32;
        piece_of[seed] = name;
        let mut piece = vec![seed as u32];
        let mut next = 0;
        while let Some(&element) = piece.get(next) {
            next += 1;
            for &n in &elements.neighbours[element as usize] {
                if labels.get(n as usize).is_some_and(|&inside| inside) && piece_of[n as usize] == NONE {
                    piece_of[n as usize] = name;
                    piece.push(n);
                }
            }
        }
        pieces.push(piece);
    }
    (piece_of, pieces)
}

fn vertices_of(elements: &Elements, piece: &[u32]) -> Vec<u32> {
    let mut vertices: Vec<u32> = piece.iter().flat_map(|&e| elements.tetrahedra[e as usize]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two large elements that share a facet, and three tiny ones: the first two alone, the third across an outside
    /// element from the second large one.
    fn elements() -> Elements {
        let tetrahedra =
            vec![[0, 1, 2, 3], [1, 2, 3, 4], [5, 6, 7, 8], [4, 9, 10, 11], [12, 13, 14, 15], [12, 13, 14, 4]];
        let neighbours = vec![
            [1, NONE, NONE, NONE],
            [NONE, NONE, 5, 0],
            [NONE; 4],
            [NONE; 4],
            [NONE, NONE, NONE, 5],
            [NONE, NONE, 1, 4],
        ];
        let volumes = vec![1.0, 1.0, 1e-9, 1e-12, 1e-12, 1e-12];
        Elements { vertices: vec![[0.0; 3]; 16], tetrahedra, neighbours, volumes, ..Elements::default() }
    }

    fn dropped(by_handles: &[usize], by_surface: &[usize]) -> (Strays, Vec<bool>) {
        let flags = |of: &[usize]| (0..16).map(|v| of.contains(&v)).collect();
        let needed = Needed { by_handles: flags(by_handles), by_surface: flags(by_surface) };
        let mut labels = vec![true, true, true, true, true, false];
        (drop_strays(&elements(), &needed, &mut labels), labels)
    }

    #[test]
    fn strays_go_unless_they_hold_a_handle_or_alone_a_vertex() {
        let (found, labels) = dropped(&[], &[4]);
        assert_eq!(found, Strays { left_out: 3, bridges: 0 });
        assert_eq!(labels, [true, true, false, false, false, false], "the second large element holds vertex 4 too");
        let (found, labels) = dropped(&[9], &[7]);
        assert_eq!(found, Strays { left_out: 1, bridges: 0 });
        assert_eq!(labels, [true, true, true, true, false, false]);
    }

    #[test]
    fn a_stray_that_stays_is_joined_where_one_element_can() {
        let (found, labels) = dropped(&[], &[15]);
        assert_eq!(found, Strays { left_out: 2, bridges: 1 });
        assert_eq!(labels, [true, true, false, false, true, true]);
    }
}
