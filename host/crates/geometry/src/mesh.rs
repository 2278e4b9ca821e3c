//! The one mesh representation.

/// A triangle mesh in three dimensions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// n×3 positions, in the mesh's own unit, right-handed, +Y up.
    pub vertices: Vec<[f64; 3]>,
    /// m×3 zero-based vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// A tetrahedral mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TetrahedralMesh {
    /// n×3 positions, in the mesh's own unit.
    pub vertices: Vec<[f64; 3]>,
    /// m×4 zero-based vertex indices; positive volume is `(b-a)·((c-a)×(d-a)) > 0`.
    pub tetrahedra: Vec<[u32; 4]>,
}

/// Why a mesh cannot be used as it is.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MeshError {
    /// There is nothing to work on.
    #[error("the mesh has no vertices or no elements")]
    Empty,
    /// An element refers to a vertex that does not exist.
    #[error("element {element} refers to vertex {vertex}, but there are only {vertex_count} vertices")]
    IndexOutOfRange {
        /// Zero-based element.
        element: usize,
        /// The offending zero-based vertex index.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} has a coordinate that is not a finite number")]
    NotFinite {
        /// Zero-based vertex.
        vertex: usize,
    },
    /// A coordinate is so large that areas and volumes would overflow.
    #[error("vertex {vertex} is further than 1e60 units from the origin; scale the mesh down")]
    TooLarge {
        /// Zero-based vertex.
        vertex: usize,
    },
}

/// Keeps fourth powers of lengths, needed for areas, within f64.
const LARGEST_COORDINATE: f64 = 1e60;

impl TriangleMesh {
    /// Checks what every algorithm here relies on: elements exist, indices are in range, positions are finite.
    pub fn validate(&self) -> Result<(), MeshError> {
        validate(&self.vertices, &self.triangles)
    }

    /// The smallest axis-aligned box around all vertices, `(min, max)`; `None` without vertices.
    pub fn bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        bounds(&self.vertices)
    }
}

impl TetrahedralMesh {
    /// Checks what every algorithm here relies on: elements exist, indices are in range, positions are finite.
    pub fn validate(&self) -> Result<(), MeshError> {
        validate(&self.vertices, &self.tetrahedra)
    }

    /// The smallest axis-aligned box around all vertices, `(min, max)`; `None` without vertices.
    pub fn bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        bounds(&self.vertices)
    }
}

fn validate<const K: usize>(vertices: &[[f64; 3]], elements: &[[u32; K]]) -> Result<(), MeshError> {
    if vertices.is_empty() || elements.is_empty() {
        return Err(MeshError::Empty);
    }
    if let Some(vertex) = vertices.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        return Err(MeshError::NotFinite { vertex });
    }
    if let Some(vertex) = vertices.iter().position(|p| p.iter().any(|c| c.abs() > LARGEST_COORDINATE)) {
        return Err(MeshError::TooLarge { vertex });
    }
    for (element, corners) in elements.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices.len()) {
            return Err(MeshError::IndexOutOfRange { element, vertex, vertex_count: vertices.len() });
        }
    }
    Ok(())
}

fn bounds(vertices: &[[f64; 3]]) -> Option<([f64; 3], [f64; 3])> {
    let first = *vertices.first()?;
    Some(vertices.iter().fold((first, first), |(lo, hi), p| {
        (std::array::from_fn(|k| lo[k].min(p[k])), std::array::from_fn(|k| hi[k].max(p[k])))
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn validate_names_the_offence() {
        let mut mesh =
            TriangleMesh { vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], triangles: vec![[0, 1, 2]] };
        assert_eq!(mesh.validate(), Ok(()));
        assert_eq!(mesh.bounds(), Some(([0.0; 3], [1.0, 1.0, 0.0])));
        mesh.triangles.push([0, 1, 3]);
        assert_eq!(mesh.validate(), Err(MeshError::IndexOutOfRange { element: 1, vertex: 3, vertex_count: 3 }));
        mesh.triangles.pop();
        mesh.vertices[1][0] = f64::NAN;
        assert_eq!(mesh.validate(), Err(MeshError::NotFinite { vertex: 1 }));
        mesh.vertices[1][0] = 1e61;
        assert_eq!(mesh.validate(), Err(MeshError::TooLarge { vertex: 1 }));
        assert_eq!(TriangleMesh::default().validate(), Err(MeshError::Empty));
    }
}
