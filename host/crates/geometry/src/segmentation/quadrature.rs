//! Symmetric quadrature on triangles and tetrahedra, degree 5.
//!
//! The points of a rule come in orbits: all permutations of the same barycentric coordinates (the kind of rule that
//! Zhang et al. 2009 list). Both rules have positive weights and no point on a facet.

/// Barycentric coordinates of the points and their weights, which sum to one.
pub(super) type Rule<const K: usize> = Vec<([f64; K], f64)>;

/// The symmetric rule of degree 5 for elements with K corners, applied to each of the (2^(K-1))^refinements parts into
/// which elements are cut at the midpoints of their edges. `None` for K other than 3 and 4.
pub(super) fn symmetric_rule<const K: usize>(refinements: u32) -> Option<Rule<K>> {
    let mut rule: Rule<K> = Vec::new();
    match K {
        // Radon 1948, seven points.
        3 => {
            let root = 15.0_f64.sqrt();
            rule.push(([1.0 / 3.0; K], 9.0 / 40.0));
            rule.extend(orbit_of_one((6.0 - root) / 21.0, (155.0 - root) / 1200.0));
            rule.extend(orbit_of_one((6.0 + root) / 21.0, (155.0 + root) / 1200.0));
        }
        // Walkington 2000, fourteen points.
        4 => {
            rule.extend(orbit_of_one(0.310_885_919_263_300_6, 0.112_687_925_718_015_85));
            rule.extend(orbit_of_one(0.092_735_250_310_891_23, 0.073_493_043_116_361_95));
            rule.extend(orbit_of_two(0.045_503_704_125_649_65, 0.042_546_020_777_081_47));
        }
        _ => return None,
    }
    let mut parts = vec![std::array::from_fn(unit)];
    for _ in 0..refinements {
        parts = parts.iter().flat_map(cut_at_middles).collect();
    }
    let share = 1.0 / parts.len() as f64;
    let place = |part: &[[f64; K]; K], at: &[f64; K]| {
        std::array::from_fn(|axis| (0..K).map(|corner| at[corner] * part[corner][axis]).sum())
    };
    Some(parts.iter().flat_map(|part| rule.iter().map(move |(at, weight)| (place(part, at), weight * share))).collect())
}

fn unit<const K: usize>(axis: usize) -> [f64; K] {
    std::array::from_fn(|k| f64::from(u8::from(k == axis)))
}

/// One coordinate differs from the others, which are `a`.
fn orbit_of_one<const K: usize>(a: f64, weight: f64) -> impl Iterator<Item = ([f64; K], f64)> {
    let rest = 1.0 - (K - 1) as f64 * a;
    (0..K).map(move |other| (std::array::from_fn(|k| if k == other { rest } else { a }), weight))
}

/// Two coordinates of a tetrahedron are `a`, the other two equal.
fn orbit_of_two<const K: usize>(a: f64, weight: f64) -> impl Iterator<Item = ([f64; K], f64)> {
    let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    pairs.into_iter().map(move |pair| (std::array::from_fn(|k| if pair.contains(&k) { a } else { 0.5 - a }), weight))
}

/// Parts of equal measure: four triangles, or four tetrahedra at the corners and four around a diagonal of the
/// octahedron between them.
fn cut_at_middles<const K: usize>(part: &[[f64; K]; K]) -> Vec<[[f64; K]; K]> {
    let middle = |i: usize, j: usize| std::array::from_fn(|axis| f64::midpoint(part[i][axis], part[j][axis]));
    let mut parts: Vec<[[f64; K]; K]> = (0..K).map(|corner| std::array::from_fn(|k| middle(corner, k))).collect();
    if K == 3 {
        parts.push(std::array::from_fn(|k| middle(k, (k + 1) % 3)));
    } else {
        // Around the diagonal from the midpoint of 01 to that of 23.
        let ring = [middle(0, 2), middle(0, 3), middle(1, 3), middle(1, 2)];
        for k in 0..4 {
            let corners = [middle(0, 1), middle(2, 3), ring[k], ring[(k + 1) % 4]];
            parts.push(std::array::from_fn(|c| corners[c]));
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factorial(n: u32) -> f64 {
        (1..=n).map(f64::from).product()
    }

    /// The mean of a product of powers of barycentric coordinates over a simplex of K corners is
    /// (K-1)!·Πpₖ!/(K-1+Σpₖ)!.
    fn largest_error<const K: usize>(rule: &Rule<K>, degree: u32) -> f64 {
        let mut largest = 0.0_f64;
        for code in 0..(degree + 1).pow(K as u32) {
            let powers: [u32; K] = std::array::from_fn(|k| code / (degree + 1).pow(k as u32) % (degree + 1));
            let total: u32 = powers.iter().sum();
            if total > degree {
                continue;
            }
            let exact = factorial(K as u32 - 1) * powers.iter().map(|&p| factorial(p)).product::<f64>()
                / factorial(K as u32 - 1 + total);
            let term = |at: &[f64; K]| (0..K).map(|k| at[k].powi(powers[k] as i32)).product::<f64>();
            let found: f64 = rule.iter().map(|(at, weight)| weight * term(at)).sum();
            largest = largest.max((found - exact).abs());
        }
        largest
    }

    #[test]
    fn exact_for_polynomials_of_degree_five() {
        for refinements in 0..3 {
            let triangle = symmetric_rule::<3>(refinements).unwrap();
            let tetrahedron = symmetric_rule::<4>(refinements).unwrap();
            assert_eq!(triangle.len(), 7 << (2 * refinements));
            assert_eq!(tetrahedron.len(), 14 << (3 * refinements));
            assert!(largest_error(&triangle, 5) < 1e-14);
            assert!(largest_error(&tetrahedron, 5) < 1e-14);
        }
        assert!(largest_error(&symmetric_rule::<4>(0).unwrap(), 6) > 1e-6);
        assert!(symmetric_rule::<5>(0).is_none());
    }
}
