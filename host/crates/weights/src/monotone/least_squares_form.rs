//! Smoothness energies as sums of squares (thesis eqs. 5.19 and 5.20), for the conic form.

use armature_geometry::operators::SparseMatrix;
use glam::DVec3;

/// Entries `(row, column, value)` of a matrix F with `½ ‖F f‖² = ½ fᵀ (L M⁻¹)^(k-1) L f`, and its number of rows: one for
/// each vertex if the order k is even, three for each element if it is odd. `elements` are triangles or tetrahedra; degenerate
/// ones are left out. `laplacian` and `mass` are of the same mesh, with a positive mass for every vertex of an element.
pub fn least_squares_form<const N: usize>(
    vertices: &[[f64; 3]],
    elements: &[[u32; N]],
    laplacian: &SparseMatrix,
    mass: &[f64],
    order: usize,
) -> (Vec<(usize, usize, f64)>, usize) {
    let mut entries: Vec<(usize, usize, f64)> = Vec::new();
    let odd = order % 2 == 1;
    if odd {
        for (index, corners) in elements.iter().enumerate() {
            let places = corners.map(|vertex| DVec3::from(vertices[vertex as usize]));
            let Some((gradients, root)) = hat_gradients(&places) else { continue };
            for (&vertex, gradient) in corners.iter().zip(gradients) {
                let axes = gradient.to_array().into_iter().enumerate();
                entries.extend(axes.map(|(axis, value)| (3 * index + axis, vertex as usize, root * value)));
            }
        }
    } else {
        let used = (0..mass.len()).filter(|&vertex| mass[vertex] > 0.0);
        for vertex in used {
            let root = mass[vertex].sqrt();
            entries.extend(laplacian.column(vertex).map(|(column, value)| (vertex, column, value / root)));
        }
    }
    let times = if odd { (order - 1) / 2 } else { order / 2 - 1 };
    for _ in 0..times {
        entries = times_scaled_laplacian(&entries, laplacian, mass);
    }
    (entries, if odd { 3 * elements.len() } else { mass.len() })
}

/// Entries times `M⁻¹ L`, summed where they meet.
fn times_scaled_laplacian(
    entries: &[(usize, usize, f64)],
    laplacian: &SparseMatrix,
    mass: &[f64],
) -> Vec<(usize, usize, f64)> {
    let mut product = Vec::new();
    for &(row, middle, value) in entries {
        product.extend(laplacian.column(middle).map(|(column, entry)| (row, column, value * entry / mass[middle])));
    }
    product.sort_by_key(|&(row, column, _)| (row, column));
    product.dedup_by(|next, kept| {
        let same = (next.0, next.1) == (kept.0, kept.1);
        kept.2 += if same { next.2 } else { 0.0 };
        same
    });
    product
}

/// The gradients of a simplex's hat functions, and the square root of its area or volume.
fn hat_gradients<const N: usize>(places: &[DVec3; N]) -> Option<([DVec3; N], f64)> {
    let edge = |k: usize| places[k] - places[0];
    let mut gradients = [DVec3::ZERO; N];
    let size = match N {
        3 => {
            let normal = edge(1).cross(edge(2));
            let squared = normal.length_squared();
            gradients[1] = edge(2).cross(normal) / squared;
            gradients[2] = normal.cross(edge(1)) / squared;
            0.5 * squared.sqrt()
        }
        4 => {
            let six = edge(1).cross(edge(2)).dot(edge(3));
            gradients[1] = edge(2).cross(edge(3)) / six;
            gradients[2] = edge(3).cross(edge(1)) / six;
            gradients[3] = edge(1).cross(edge(2)) / six;
            six.abs() / 6.0
        }
        _ => return None,
    };
    gradients[0] = -gradients[1..].iter().sum::<DVec3>();
    gradients.iter().all(|gradient| gradient.is_finite()).then(|| (gradients, size.sqrt()))
}

#[cfg(test)]
mod tests {
    use armature_geometry::TetrahedralMesh;
    use armature_geometry::operators::{
        Lumping, cotangent_laplacian_of_triangles, cotangent_laplacian_tetrahedra, lumped_mass_of_triangles,
        lumped_mass_tetrahedra,
    };

    use super::*;
    use crate::monotone::polyharmonic::polyharmonic;

    fn agrees<const N: usize>(vertices: &[[f64; 3]], elements: &[[u32; N]], laplacian: &SparseMatrix, mass: &[f64]) {
        let f: Vec<f64> = (0..mass.len() as u32).map(|k| f64::from((k * 37) % 11)).collect();
        for order in 2..=4 {
            let (entries, rows) = least_squares_form(vertices, elements, laplacian, mass, order);
            let mut image = vec![0.0; rows];
            entries.iter().for_each(|&(row, column, value)| image[row] += value * f[column]);
            let squares: f64 = image.iter().map(|value| value * value).sum();
            let mut product = vec![0.0; f.len()];
            polyharmonic(laplacian, mass, order, None).multiply_into(&f, &mut product);
            let whole: f64 = product.iter().zip(&f).map(|(a, b)| a * b).sum();
            assert!((squares / whole - 1.0).abs() < 1e-10, "order {order}: {squares} for {whole}");
        }
    }

    #[test]
    fn squares_are_the_energy() {
        let vertices =
            vec![[0.0, 0.0, 0.1], [1.0, 0.0, 0.0], [0.2, 0.9, 0.3], [1.1, 1.2, -0.4], [0.5, 0.4, 1.3], [1.4, 0.2, 0.9]];
        let triangles = [[0, 1, 2], [1, 3, 2], [1, 5, 3], [0, 4, 1]];
        let laplacian = cotangent_laplacian_of_triangles(&vertices, &triangles).matrix;
        let mass = lumped_mass_of_triangles(&vertices, &triangles, Lumping::Barycentric);
        agrees(&vertices, &triangles, &laplacian, &mass);
        let tetrahedra = vec![[0, 1, 2, 4], [1, 3, 2, 4], [1, 5, 3, 4]];
        let mesh = TetrahedralMesh { vertices: vertices.clone(), tetrahedra: tetrahedra.clone() };
        let laplacian = cotangent_laplacian_tetrahedra(&mesh).unwrap().matrix;
        let mass = lumped_mass_tetrahedra(&mesh, Lumping::Barycentric).unwrap();
        agrees(&vertices, &tetrahedra, &laplacian, &mass);
    }
}
