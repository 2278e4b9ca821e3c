//! Smoothness energies of order two, three and four (thesis eq. 5.18): `½ fᵀ (L M⁻¹)^(k-1) L f`.

use armature_geometry::operators::SparseMatrix;

use crate::sparse::product::scaled_product;
use crate::sparse::symmetric::Symmetric;

/// The n×n matrix `(L Λ M⁻¹)^(k-1) L` for `order` k, positive semidefinite; `blend` holds Λ's diagonal, each 0 to 1
/// (Botsch & Kobbelt 2004: where it is zero the function may have a crease), and is one everywhere if absent. Vertices
/// without mass, which are in no element, have empty rows.
pub(crate) fn polyharmonic(laplacian: &SparseMatrix, mass: &[f64], order: usize, blend: Option<&[f64]>) -> Symmetric {
    // Only odd powers of the sign matter.
    let negated: Vec<f64> = laplacian.values().iter().map(|value| -value).collect();
    let mut positive = laplacian.clone();
    positive.values_mut().copy_from_slice(&negated);
    let first = Symmetric::of(&positive);
    let scale: Vec<f64> = mass
        .iter()
        .enumerate()
        .map(|(vertex, &mass)| if mass > 0.0 { blend.map_or(1.0, |blend| blend[vertex]) / mass } else { 0.0 })
        .collect();
    let second = scaled_product(&first, &scale, &first);
    match order {
        2 => second,
        3 => scaled_product(&second, &scale, &first),
        _ => scaled_product(&second, &scale, &second),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energies_are_the_squared_derivatives_of_a_chain() {
        // A chain of unit springs and masses; differences of the values by hand, ends without flux.
        let springs = (0..5).flat_map(|k| [(k, k, -1.0), (k + 1, k + 1, -1.0), (k, k + 1, 1.0), (k + 1, k, 1.0)]);
        let laplacian = SparseMatrix::from_triplets(6, 6, &springs.collect::<Vec<_>>()).unwrap();
        let f = [0.0, 1.0, -2.0, 5.0, 3.0, 1.5];
        let bend = |f: &[f64]| -> Vec<f64> {
            let at = |k: usize, other: Option<usize>| other.map_or(0.0, |other| f[other] - f[k]);
            (0..6).map(|k: usize| at(k, k.checked_sub(1)) + at(k, (k < 5).then_some(k + 1))).collect()
        };
        let squares = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
        let second = bend(&f);
        let third: Vec<f64> = second.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let expected = [squares(&second), squares(&third), squares(&bend(&second))];
        for (order, expected) in (2..).zip(expected) {
            let energy = polyharmonic(&laplacian, &[1.0; 6], order, None);
            let mut product = [0.0; 6];
            energy.multiply_into(&f, &mut product);
            let got: f64 = product.iter().zip(f).map(|(a, b)| a * b).sum();
            assert!((got - expected).abs() < 1e-10, "{order}: {got} for {expected}");
        }
    }
}
