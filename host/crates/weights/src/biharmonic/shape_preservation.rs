//! The shape-preservation brush (thesis eqs. 4.7 and 4.9): `½ ∫ ρ ‖∇w‖²` keeps weights nearly constant where it is
//! painted.

use armature_geometry::operators::{EntryOutOfRange, SparseMatrix};
use glam::DVec3;

/// Why a brush's term could not be built.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum BrushError {
    /// One value is needed for every element.
    #[error("the brush has {given} values, but the mesh has {elements} elements")]
    Size {
        /// Values given.
        given: usize,
        /// Elements of the mesh.
        elements: usize,
    },
    /// Paint must be finite and not negative.
    #[error("the brush is {value} on element {element}; it must be finite and not negative")]
    BadPaint {
        /// Zero-based element.
        element: usize,
        /// The value.
        value: f64,
    },
    /// A painted element has no area or volume, or a corner that is not finite.
    #[error("element {element} is painted, but has no size; leave it unpainted or repair the mesh")]
    Degenerate {
        /// Zero-based element.
        element: usize,
    },
    /// An element refers to a vertex that does not exist.
    #[error(transparent)]
    Vertex(#[from] EntryOutOfRange),
}

/// `Gᵀ R D G` (thesis eq. 4.9): n×n, for [`crate::biharmonic::BiharmonicProblem::shape_preservation`]. Elements have K
/// = 3 corners (triangles, in the plane or in space) or 4 (tetrahedra); `brush` is ρ on each, in energy per area or
/// volume.
pub fn shape_preservation<const K: usize>(
    vertices: &[[f64; 3]],
    elements: &[[u32; K]],
    brush: &[f64],
) -> Result<SparseMatrix, BrushError> {
    if brush.len() != elements.len() {
        return Err(BrushError::Size { given: brush.len(), elements: elements.len() });
    }
    let mut triplets = Vec::new();
    for (element, (corners, &value)) in elements.iter().zip(brush).enumerate() {
        if !(value.is_finite() && value >= 0.0) {
            return Err(BrushError::BadPaint { element, value });
        }
        if value == 0.0 {
            continue;
        }
        let place = |&vertex: &u32| vertices.get(vertex as usize).map(|p| DVec3::from(*p));
        let Some(places) = corners.iter().map(place).collect::<Option<Vec<DVec3>>>() else {
            // The matrix reports which entry it is.
            triplets.extend(corners.iter().map(|&vertex| (vertex, vertex, 0.0)));
            continue;
        };
        let (size, gradients) = hat_gradients(&places).ok_or(BrushError::Degenerate { element })?;
        for (a, &row) in corners.iter().enumerate() {
            for (b, &column) in corners.iter().enumerate() {
                triplets.push((row, column, value * size * gradients[a].dot(gradients[b])));
            }
        }
    }
    Ok(SparseMatrix::from_triplets(vertices.len(), vertices.len(), &triplets)?)
}

/// Size of an element and the gradients of its corners' hat functions.
fn hat_gradients(places: &[DVec3]) -> Option<(f64, Vec<DVec3>)> {
    let (size, gradients) = match *places {
        [a, b, c] => {
            let normal = (b - a).cross(c - a);
            let over = |edge: DVec3| normal.cross(edge) / normal.length_squared();
            (0.5 * normal.length(), vec![over(c - b), over(a - c), over(b - a)])
        }
        [a, b, c, d] => {
            let (ab, ac, ad) = (b - a, c - a, d - a);
            let volume_6 = ab.dot(ac.cross(ad));
            let [at_b, at_c, at_d] = [ac.cross(ad), ad.cross(ab), ab.cross(ac)].map(|face| face / volume_6);
            (volume_6.abs() / 6.0, vec![-(at_b + at_c + at_d), at_b, at_c, at_d])
        }
        _ => return None,
    };
    let fine = size > 0.0 && gradients.iter().all(|gradient| gradient.is_finite());
    fine.then_some((size, gradients))
}

#[cfg(test)]
mod tests {
    use super::*;
    use armature_geometry::operators::{cotangent_laplacian, cotangent_laplacian_tetrahedra};
    use armature_geometry::{TetrahedralMesh, TriangleMesh};

    #[test]
    fn even_paint_is_the_stiffness_matrix() {
        let vertices = vec![[0.0, 0.1, 0.0], [1.0, 0.0, 0.2], [0.3, 1.1, 0.0], [0.2, 0.3, 0.9], [1.0, 1.0, 1.0]];
        let tetrahedra = vec![[0, 1, 2, 3], [1, 2, 3, 4]];
        let brushed = shape_preservation(&vertices, &tetrahedra, &[2.0, 2.0]).unwrap();
        let mesh = TetrahedralMesh { vertices: vertices.clone(), tetrahedra };
        alike(&brushed, &cotangent_laplacian_tetrahedra(&mesh).unwrap().matrix, -2.0);
        let triangles = vec![[0, 1, 2], [2, 1, 4], [0, 3, 2]];
        let brushed = shape_preservation(&vertices, &triangles, &[0.5; 3]).unwrap();
        alike(&brushed, &cotangent_laplacian(&TriangleMesh { vertices, triangles }).unwrap().matrix, -0.5);
    }

    fn alike(a: &SparseMatrix, b: &SparseMatrix, factor: f64) {
        for column in 0..a.columns() {
            for row in 0..a.rows() {
                assert!((a.get(row, column) - factor * b.get(row, column)).abs() < 1e-12, "({row}, {column})");
            }
        }
    }

    #[test]
    fn nonsense_is_named() {
        let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
        let at = |brush: &[f64], triangle: [u32; 3]| shape_preservation(&vertices, &[triangle], brush).unwrap_err();
        assert_eq!(at(&[], [0, 1, 2]), BrushError::Size { given: 0, elements: 1 });
        assert!(matches!(at(&[f64::NAN], [0, 1, 2]), BrushError::BadPaint { element: 0, .. }));
        assert_eq!(at(&[1.0], [0, 1, 2]), BrushError::Degenerate { element: 0 });
        assert!(matches!(at(&[1.0], [0, 1, 7]), BrushError::Vertex(_)));
    }
}
