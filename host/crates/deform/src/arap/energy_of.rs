//! The energy of given transformations, solved or not.

use glam::{Affine3A, DMat3, DVec3};

use super::reduction::Reduction;
use crate::lanes::LANES;
use crate::nearest_rotation::nearest_rotations;

/// `½ tr(Tᵀ L̃ T) − Σ max tr(R S)` plus the constant (eq. 7.15), with the nearest rotation of every cluster.
pub(super) fn energy_of(reduction: &Reduction, transforms: &[Affine3A]) -> f64 {
    let stacked: Vec<[DVec3; 4]> = transforms.iter().map(|transform| normalised(reduction, transform)).collect();
    let product =
        |values: &[f64; 4], four: &[DVec3; 4]| -> DVec3 { values.iter().zip(four).map(|(v, f)| *v * *f).sum() };
    let mut sum = reduction.constant;
    for (handle, own) in stacked.iter().enumerate() {
        for (other, block) in reduction.stiffness.row(handle) {
            for (part, values) in block.iter().enumerate() {
                sum += 0.5 * own[part].dot(product(values, &stacked[*other as usize]));
            }
        }
    }
    for cluster in 0..reduction.covariance.len() {
        let mut covariance = [DVec3::ZERO; 3];
        for (handle, block) in reduction.covariance.row(cluster) {
            for (rest, values) in block.iter().enumerate() {
                covariance[rest] += product(values, &stacked[*handle as usize]);
            }
        }
        let mut lanes = [[[0.0; LANES]; 3]; 3];
        for (rest, row) in covariance.iter().enumerate() {
            (0..3).for_each(|axis| lanes[rest][axis][0] = row[axis] as f32);
        }
        let nearest = nearest_rotations(&lanes);
        for (rest, row) in covariance.iter().enumerate() {
            sum -= (0..3).map(|axis| f64::from(nearest[rest][axis][0]) * row[axis]).sum::<f64>();
        }
    }
    sum * reduction.energy_unit
}

/// The transposed rows of a `model_from_rest` map in coordinates with the shape's centre at the origin.
fn normalised(reduction: &Reduction, transform: &Affine3A) -> [DVec3; 4] {
    let linear: DMat3 = transform.matrix3.as_dmat3();
    let centre = DVec3::from(reduction.centre);
    let moved = (linear * centre + transform.translation.as_dvec3() - centre) / reduction.size;
    [linear.x_axis, linear.y_axis, linear.z_axis, moved]
}
