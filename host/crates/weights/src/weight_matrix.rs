//! Dense weights: every vertex, every bone.

/// n vertices × m bones, column-major: each bone's weights lie together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WeightMatrix {
    vertices: usize,
    bones: usize,
    values: Vec<f64>,
}

impl WeightMatrix {
    /// Takes `vertices · bones` values, column-major; `None` if there are not so many.
    pub fn from_columns(vertices: usize, bones: usize, values: Vec<f64>) -> Option<Self> {
        (vertices.checked_mul(bones) == Some(values.len())).then_some(Self { vertices, bones, values })
    }

    /// Number of vertices (rows).
    pub fn vertices(&self) -> usize {
        self.vertices
    }

    /// Number of bones (columns).
    pub fn bones(&self) -> usize {
        self.bones
    }

    /// All values, column-major.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// All values, column-major, to change in place.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// The weights of one bone, n long.
    ///
    /// # Panics
    /// If there is no such bone.
    pub fn bone(&self, bone: usize) -> &[f64] {
        assert!(bone < self.bones, "bone {bone} of {}", self.bones);
        &self.values[bone * self.vertices..(bone + 1) * self.vertices]
    }

    /// The weights of one vertex, bone after bone.
    ///
    /// # Panics
    /// If there is no such vertex.
    pub fn vertex(&self, vertex: usize) -> impl Iterator<Item = f64> + '_ {
        assert!(vertex < self.vertices, "vertex {vertex} of {}", self.vertices);
        (0..self.bones).map(move |bone| self.values[bone * self.vertices + vertex])
    }
}
