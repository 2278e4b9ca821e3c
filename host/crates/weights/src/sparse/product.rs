//! Products of sparse symmetric matrices that are symmetric again.

use super::symmetric::Symmetric;

/// `A diag(scale) B`, for matrices of one size whose product is symmetric.
pub(crate) fn scaled_product(a: &Symmetric, scale: &[f64], b: &Symmetric) -> Symmetric {
    let n = b.len();
    let (mut sums, mut last_column) = (vec![0.0; n], vec![usize::MAX; n]);
    let mut touched: Vec<u32> = Vec::new();
    let mut product = Symmetric::new();
    for column in 0..n {
        touched.clear();
        for (middle, value) in b.column(column) {
            let scaled = value * scale[middle];
            for (row, entry) in a.column(middle) {
                if last_column[row] != column {
                    last_column[row] = column;
                    sums[row] = 0.0;
                    touched.push(row as u32);
                }
                sums[row] += entry * scaled;
            }
        }
        touched.sort_unstable();
        touched.iter().for_each(|&row| product.push(row, sums[row as usize]));
        product.end_column();
    }
    product
}

#[cfg(test)]
mod tests {
    use armature_geometry::operators::SparseMatrix;

    use super::*;

    #[test]
    fn multiplies_like_its_factors() {
        let entries: Vec<(u32, u32, f64)> =
            (0..5).flat_map(|k| [(k, k, -2.0), (k, (k + 1) % 5, 1.0), ((k + 1) % 5, k, 1.0)]).collect();
        let dense = SparseMatrix::from_triplets(5, 5, &entries).unwrap();
        let (ring, scale) = (Symmetric::of(&dense), [1.0, 2.0, 3.0, 4.0, 5.0]);
        let squared = scaled_product(&ring, &scale, &ring);
        let x = [1.0, -2.0, 0.5, 3.0, 7.0];
        let scaled: Vec<f64> = dense.multiply(&x).iter().zip(scale).map(|(y, s)| y * s).collect();
        let mut got = [0.0; 5];
        squared.multiply_into(&x, &mut got);
        assert!(got.iter().zip(dense.multiply(&scaled)).all(|(a, b)| (a - b).abs() < 1e-12), "{got:?}");
    }
}
