use faer::Mat;
use glam::{DMat3, DQuat, DVec3};

use super::*;

/// Numbers in [-1, 1), the same in every run.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 / (1_u64 << 52) as f64) - 1.0
    }

    fn rotation(&mut self) -> DMat3 {
        DMat3::from_quat(DQuat::from_xyzw(self.roll(), self.roll(), self.roll(), self.roll()).normalize())
    }
}

fn entry(m: &DMat3, row: usize, column: usize) -> f64 {
    m.col(column)[row]
}

fn pack(matrices: &[DMat3]) -> Matrices {
    let mut out = [[[0.0; LANES]; 3]; 3];
    for (lane, m) in matrices.iter().enumerate() {
        for row in 0..3 {
            for column in 0..3 {
                out[row][column][lane] = entry(m, row, column) as f32;
            }
        }
    }
    out
}

fn unpack(matrices: &Matrices, lane: usize) -> DMat3 {
    let column = |c: usize| DVec3::from_array([0, 1, 2].map(|r| f64::from(matrices[r][c][lane])));
    DMat3::from_cols(column(0), column(1), column(2))
}

/// The definition, in f64: from a singular value decomposition, with the last direction flipped where that avoids a
/// reflection. Also the singular values, the smallest with the sign of the determinant.
fn by_decomposition(m: &DMat3) -> (DMat3, [f64; 3]) {
    let svd = Mat::from_fn(3, 3, |r, c| entry(m, r, c)).svd().unwrap();
    let dense = |m: faer::MatRef<f64>| {
        DMat3::from_cols(
            DVec3::new(m[(0, 0)], m[(1, 0)], m[(2, 0)]),
            DVec3::new(m[(0, 1)], m[(1, 1)], m[(2, 1)]),
            DVec3::new(m[(0, 2)], m[(1, 2)], m[(2, 2)]),
        )
    };
    let (u, v) = (dense(svd.U()), dense(svd.V()));
    let sign = (u.determinant() * v.determinant()).signum();
    let s = [0, 1, 2].map(|i| svd.S().column_vector()[i]);
    (u * DMat3::from_diagonal(DVec3::new(1.0, 1.0, sign)) * v.transpose(), [s[0], s[1], sign * s[2]])
}

fn product_trace(r: &DMat3, s: &DMat3) -> f64 {
    (r.transpose() * *s).to_cols_array().iter().step_by(4).sum()
}

fn distance(a: &DMat3, b: &DMat3) -> f64 {
    (*a - *b).to_cols_array().iter().map(|d| d * d).sum::<f64>().sqrt()
}

/// Every result is a rotation, no rotation fits better, and it is as close to the true one as `f32` input allows.
fn check(matrices: &[DMat3]) {
    for chunk in matrices.chunks(LANES) {
        let packed = pack(chunk);
        let found = nearest_rotations(&packed);
        for lane in 0..chunk.len() {
            // The input as rounded to f32.
            let asked = unpack(&packed, lane);
            let rotation = unpack(&found, lane);
            assert!(distance(&(rotation * rotation.transpose()), &DMat3::IDENTITY) < 2e-6, "{asked}");
            assert!(rotation.determinant() > 0.999);
            let (best, [s1, s2, s3]) = by_decomposition(&asked);
            let lost = product_trace(&best, &asked) - product_trace(&rotation, &asked);
            assert!(lost <= 3e-6 * s1, "{asked}: {lost} lost of {s1}");
            let allowed = 4e-6 * s1 / (s2 + s3);
            let off = distance(&rotation, &best);
            assert!(
                !allowed.is_finite() || allowed > 0.1 || off <= allowed,
                "{asked}: off by {off}, {allowed} allowed"
            );
        }
    }
}

#[test]
fn agrees_with_singular_value_decompositions() {
    let dice = &mut Dice(1);
    let matrices: Vec<DMat3> =
        (0..20_000).map(|_| DMat3::from_cols_array(&std::array::from_fn(|_| dice.roll()))).collect();
    let reflections = matrices.iter().filter(|m| m.determinant() < 0.0).count();
    assert!(reflections > 5000);
    check(&matrices);
}

#[test]
fn agrees_for_every_spread_of_singular_values() {
    let dice = &mut Dice(2);
    let mut matrices = Vec::new();
    for exponents in [[0, 0], [0, 1], [1, 1], [1, 2], [2, 3], [3, 3], [3, 5], [4, 5], [0, 30], [2, 30], [4, 30]] {
        for sign in [1.0, -1.0] {
            for size in [1.0, 1e-30, 1e-12, 1e20, 1e37] {
                for _ in 0..16 {
                    let s = DVec3::new(1.0, 10_f64.powi(-exponents[0]), sign * 10_f64.powi(-exponents[1]));
                    matrices.push(dice.rotation() * DMat3::from_diagonal(s * size) * dice.rotation());
                }
            }
        }
    }
    check(&matrices);
}

#[test]
fn rotations_are_their_own_nearest() {
    let dice = &mut Dice(3);
    let mut rotations: Vec<DMat3> = (0..4000).map(|_| dice.rotation()).collect();
    // Half turns, where the real part of the quaternion vanishes.
    rotations.extend((0..200).map(|_| {
        let axis = DVec3::new(dice.roll(), dice.roll(), dice.roll()).normalize();
        DMat3::from_axis_angle(axis, std::f64::consts::PI)
    }));
    for chunk in rotations.chunks(LANES) {
        let found = nearest_rotations(&pack(chunk));
        for (lane, rotation) in chunk.iter().enumerate() {
            assert!(distance(&unpack(&found, lane), rotation) < 1e-6);
        }
    }
}

#[test]
fn singular_and_symmetric_input_gives_one_of_the_best() {
    let dice = &mut Dice(4);
    let mut matrices = vec![DMat3::ZERO, DMat3::IDENTITY, -DMat3::IDENTITY, DMat3::from_diagonal(DVec3::X)];
    matrices.push(DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)));
    matrices.push(DMat3::from_diagonal(DVec3::new(0.0, -3.0, 0.0)));
    for _ in 0..50 {
        let (a, b) = (dice.rotation().x_axis, dice.rotation().y_axis);
        matrices.push(DMat3::from_cols(a * b.x, a * b.y, a * b.z));
        matrices.push(-dice.rotation());
    }
    check(&matrices);
    let still = nearest_rotations(&pack(&[DMat3::ZERO; LANES]));
    assert!((0..LANES).all(|lane| unpack(&still, lane) == DMat3::IDENTITY));
}

#[test]
fn what_is_not_finite_gives_the_identity_and_spoils_no_neighbour() {
    for (lane, nonsense) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().enumerate() {
        let turned = DMat3::from_rotation_x(1.0);
        let mut packed = pack(&[turned; LANES]);
        packed[1][lane][lane] = nonsense;
        let found = nearest_rotations(&packed);
        for other in 0..LANES {
            let expected = if other == lane { DMat3::IDENTITY } else { turned };
            assert!(distance(&unpack(&found, other), &expected) < 1e-6);
        }
    }
}

#[test]
fn every_register_width_computes_the_same_bits() {
    let dice = &mut Dice(5);
    for _ in 0..500 {
        let matrices: Vec<DMat3> =
            (0..LANES).map(|_| DMat3::from_cols_array(&std::array::from_fn(|_| dice.roll()))).collect();
        let packed = pack(&matrices);
        assert_eq!(nearest_rotations(&packed), nearest_rotations_inlined(&packed));
    }
}
