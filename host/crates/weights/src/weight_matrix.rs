//! Weights of every vertex on every bone; most are zero and not stored.

/// n vertices × m bones in compressed columns: for each bone the vertices that follow it, ascending, and their weights.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightMatrix {
    vertices: usize,
    starts: Vec<usize>,
    rows: Vec<u32>,
    values: Vec<f64>,
}

/// The same by vertex: for each the bones it follows, ascending, and its weights.
pub(crate) struct WeightRows {
    starts: Vec<usize>,
    entries: Vec<(u32, f64)>,
}

impl Default for WeightMatrix {
    fn default() -> Self {
        Self { vertices: 0, starts: vec![0], rows: Vec::new(), values: Vec::new() }
    }
}

impl WeightMatrix {
    /// Takes `vertices · bones` values, column-major; `None` if the length differs, or there are too many to number.
    pub fn from_columns(vertices: usize, bones: usize, values: &[f64]) -> Option<Self> {
        if vertices.checked_mul(bones) != Some(values.len()) {
            return None;
        }
        let column = |bone: usize| values[bone * vertices..(bone + 1) * vertices].iter().copied().enumerate();
        Self::from_sparse_columns(vertices, (0..bones).map(column))
    }

    /// Takes each bone's weights as pairs of vertex and weight, by ascending vertex; zeros may be omitted. `None` if a
    /// vertex does not exist or is out of order, or there is not enough memory.
    pub fn from_sparse_columns<C: IntoIterator<Item = (usize, f64)>>(
        vertices: usize,
        columns: impl IntoIterator<Item = C>,
    ) -> Option<Self> {
        u32::try_from(vertices).ok()?;
        let mut matrix = Self { vertices, ..Self::default() };
        for column in columns {
            let mut next = 0;
            for (vertex, weight) in column {
                if vertex < next || vertex >= vertices {
                    return None;
                }
                next = vertex + 1;
                if weight != 0.0 {
                    matrix.rows.try_reserve(1).ok()?;
                    matrix.values.try_reserve(1).ok()?;
                    matrix.rows.push(vertex as u32);
                    matrix.values.push(weight);
                }
            }
            matrix.starts.push(matrix.rows.len());
        }
        Some(matrix)
    }

    /// Number of vertices (rows).
    pub fn vertices(&self) -> usize {
        self.vertices
    }

    /// Number of bones (columns).
    pub fn bones(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of nonzero weights.
    pub fn stored(&self) -> usize {
        self.values.len()
    }

    /// The vertices that follow a bone, ascending, and their weights.
    ///
    /// # Panics
    /// If there is no such bone.
    pub fn column(&self, bone: usize) -> impl ExactSizeIterator<Item = (usize, f64)> + Clone + '_ {
        let range = self.starts[bone]..self.starts[bone + 1];
        self.rows[range.clone()].iter().zip(&self.values[range]).map(|(&vertex, &weight)| (vertex as usize, weight))
    }

    /// The weights of one bone including zeros, n long.
    ///
    /// # Panics
    /// If there is no such bone.
    pub fn bone(&self, bone: usize) -> Vec<f64> {
        let mut weights = vec![0.0; self.vertices];
        self.column(bone).for_each(|(vertex, weight)| weights[vertex] = weight);
        weights
    }

    /// One weight.
    ///
    /// # Panics
    /// If there is no such vertex or bone.
    pub fn weight(&self, vertex: usize, bone: usize) -> f64 {
        assert!(vertex < self.vertices, "vertex {vertex} of {}", self.vertices);
        let range = self.starts[bone]..self.starts[bone + 1];
        self.rows[range.clone()].binary_search(&(vertex as u32)).map_or(0.0, |at| self.values[range.start + at])
    }

    /// The weights of one vertex, bone by bone.
    ///
    /// # Panics
    /// If there is no such vertex.
    pub fn vertex(&self, vertex: usize) -> impl Iterator<Item = f64> + '_ {
        (0..self.bones()).map(move |bone| self.weight(vertex, bone))
    }

    /// All weights including zeros, column-major; `None` if there is not enough memory.
    pub fn to_columns(&self) -> Option<Vec<f64>> {
        let count = self.vertices.checked_mul(self.bones())?;
        let mut values = Vec::new();
        values.try_reserve_exact(count).ok()?;
        values.resize(count, 0.0);
        for (bone, dense) in values.chunks_exact_mut(self.vertices.max(1)).enumerate() {
            self.column(bone).for_each(|(vertex, weight)| dense[vertex] = weight);
        }
        Some(values)
    }

    /// Changes the nonzero weights; `change` is also given their vertices.
    pub(crate) fn change(&mut self, change: impl Fn(usize, f64) -> f64) {
        for (&vertex, weight) in self.rows.iter().zip(&mut self.values) {
            *weight = change(vertex as usize, *weight);
        }
    }

    /// The nonzero weights of one bone, by ascending vertex; `None` if there is no such bone.
    pub(crate) fn column_mut(&mut self, bone: usize) -> Option<&mut [f64]> {
        let range = *self.starts.get(bone)?..*self.starts.get(bone + 1)?;
        self.values.get_mut(range)
    }

    /// Overwrites weights: for each bone, by ascending vertex. `None` if a vertex does not exist.
    pub(crate) fn overlay(&self, over: &[Vec<(usize, f64)>]) -> Option<Self> {
        let column = |(bone, over): (usize, &Vec<(usize, f64)>)| {
            let is_over = |vertex: usize| over.binary_search_by_key(&vertex, |&(v, _)| v).is_ok();
            let mut column: Vec<(usize, f64)> = self.column(bone).filter(|&(vertex, _)| !is_over(vertex)).collect();
            column.extend(over);
            column.sort_unstable_by_key(|&(vertex, _)| vertex);
            column
        };
        Self::from_sparse_columns(self.vertices, over.iter().enumerate().map(column))
    }

    /// The same by vertex.
    pub(crate) fn rows(&self) -> WeightRows {
        let mut starts = vec![0; self.vertices + 1];
        self.rows.iter().for_each(|&vertex| starts[vertex as usize + 1] += 1);
        (0..self.vertices).for_each(|vertex| starts[vertex + 1] += starts[vertex]);
        let mut next = starts.clone();
        let mut entries = vec![(0, 0.0); self.rows.len()];
        for bone in 0..self.bones() {
            for (vertex, weight) in self.column(bone) {
                entries[next[vertex]] = (bone as u32, weight);
                next[vertex] += 1;
            }
        }
        WeightRows { starts, entries }
    }
}

impl WeightRows {
    /// The bones that a vertex follows, ascending, and its weights.
    pub(crate) fn of(&self, vertex: usize) -> &[(u32, f64)] {
        &self.entries[self.starts[vertex]..self.starts[vertex + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_come_and_go() {
        let values = vec![0.5, 0.0, 1.0, 0.0, 0.0, 0.25];
        let matrix = WeightMatrix::from_columns(3, 2, &values).unwrap();
        assert_eq!((matrix.vertices(), matrix.bones(), matrix.stored()), (3, 2, 3));
        assert_eq!(matrix.to_columns(), Some(values));
        assert_eq!(matrix.bone(1), [0.0, 0.0, 0.25]);
        assert_eq!(matrix.column(0).collect::<Vec<_>>(), [(0, 0.5), (2, 1.0)]);
        assert_eq!(matrix.vertex(2).collect::<Vec<_>>(), [1.0, 0.25]);
        let rows = matrix.rows();
        assert_eq!((rows.of(0), rows.of(1), rows.of(2)), (&[(0, 0.5)][..], &[][..], &[(0, 1.0), (1, 0.25)][..]));
        let over = matrix.overlay(&[vec![(1, 0.75), (2, 0.0)], vec![]]).unwrap();
        assert_eq!(over.to_columns(), Some(vec![0.5, 0.75, 0.0, 0.0, 0.0, 0.25]));
        assert_eq!(WeightMatrix::default(), WeightMatrix::from_columns(0, 0, &[]).unwrap());
        assert_eq!(WeightMatrix::from_columns(0, 2, &[]).unwrap().to_columns(), Some(vec![]));
    }

    #[test]
    fn nonsense_is_refused() {
        assert_eq!(WeightMatrix::from_columns(2, 2, &[0.0; 3]), None);
        assert_eq!(WeightMatrix::from_columns(usize::MAX, 2, &[]), None);
        for column in [vec![(2, 1.0)], vec![(1, 1.0), (0, 1.0)], vec![(1, 1.0), (1, 1.0)]] {
            assert_eq!(WeightMatrix::from_sparse_columns(2, [column]), None);
        }
    }
}
