//! Which vertices share an edge.

use armature_geometry::operators::SparseMatrix;

use super::error::ExtremaError;

/// The neighbours of every vertex of a mesh, ascending.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Neighbours {
    starts: Vec<usize>,
    around: Vec<u32>,
}

impl Neighbours {
    /// Of a mesh with this many vertices and these elements: edges, triangles or tetrahedra.
    pub fn of_elements<const N: usize>(vertices: usize, elements: &[[u32; N]]) -> Result<Self, ExtremaError> {
        let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(elements.len() * N * (N - 1));
        for corners in elements {
            for &a in corners {
                if a as usize >= vertices {
                    return Err(ExtremaError::NoSuchVertex { vertex: a as usize, vertices });
                }
                pairs.extend(corners.iter().filter(|b| **b != a).map(|&b| (a, b)));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        let mut starts = vec![0; vertices + 1];
        pairs.iter().for_each(|&(a, _)| starts[a as usize + 1] += 1);
        (0..vertices).for_each(|vertex| starts[vertex + 1] += starts[vertex]);
        Ok(Self { starts, around: pairs.into_iter().map(|(_, b)| b).collect() })
    }

    /// Of a mesh of which only a matrix is at hand, such as its Laplacian: vertices with an entry, even a zero.
    pub fn of_matrix(matrix: &SparseMatrix) -> Self {
        let (mut starts, mut around) = (vec![0], Vec::with_capacity(matrix.stored()));
        for column in 0..matrix.columns() {
            let others = matrix.column(column).map(|(row, _)| row);
            around.extend(others.filter(|&row| row != column && row < matrix.columns()).map(|row| row as u32));
            starts.push(around.len());
        }
        Self { starts, around }
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.starts.len() - 1
    }

    /// The neighbours of a vertex, ascending.
    ///
    /// # Panics
    /// If there is no such vertex.
    pub fn of(&self, vertex: usize) -> impl ExactSizeIterator<Item = usize> + Clone + '_ {
        self.around[self.starts[vertex]..self.starts[vertex + 1]].iter().map(|&other| other as usize)
    }

    /// The connected pieces, each ascending, ordered by first vertex.
    pub fn pieces(&self) -> Vec<Vec<usize>> {
        let mut seen = vec![false; self.vertices()];
        let mut pieces = Vec::new();
        for first in 0..self.vertices() {
            if std::mem::replace(&mut seen[first], true) {
                continue;
            }
            let mut piece = vec![first];
            let mut at = 0;
            while let Some(&vertex) = piece.get(at) {
                at += 1;
                piece.extend(self.of(vertex).filter(|&other| !std::mem::replace(&mut seen[other], true)));
            }
            piece.sort_unstable();
            pieces.push(piece);
        }
        pieces
    }

    /// One finite value for each vertex?
    pub(crate) fn check(&self, values: &[f64]) -> Result<(), ExtremaError> {
        if values.len() != self.vertices() {
            return Err(ExtremaError::Size { values: values.len(), vertices: self.vertices() });
        }
        match values.iter().position(|value| !value.is_finite()) {
            Some(vertex) => Err(ExtremaError::NotFinite { vertex, value: values[vertex] }),
            None => Ok(()),
        }
    }
}
