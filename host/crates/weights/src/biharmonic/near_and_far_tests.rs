//! Handles solved over nearby vertices, compared with the same handles solved over all.

use std::ops::ControlFlow;

use armature_geometry::operators::SparseMatrix;

use super::active_set::ActiveSet;
use super::bounded_biharmonic::bounded_biharmonic_weights;
use super::energy::BiharmonicEnergy;
use super::exchange_bounds::{Goal, Solve};
use super::far_handles::FarHandles;
use super::near_handles::NearHandles;
use super::problem::{BiharmonicProblem, BiharmonicSettings};

const SIDE: usize = 14;

/// The Laplacian of a cube of points with unit springs between neighbours, some stronger than others.
fn cube() -> SparseMatrix {
    let at = |x: usize, y: usize, z: usize| (x + SIDE * (y + SIDE * z)) as u32;
    let mut triplets = Vec::new();
    let mut join = |a: u32, b: u32| {
        let stiff = 1.0 + 0.5 * f64::from((a * 31 + b) % 7);
        triplets.extend([(a, a, -stiff), (b, b, -stiff), (a, b, stiff), (b, a, stiff)]);
    };
    for z in 0..SIDE {
        for y in 0..SIDE {
            for x in 1..SIDE {
                join(at(x - 1, y, z), at(x, y, z));
                join(at(y, x - 1, z), at(y, x, z));
                join(at(y, z, x - 1), at(y, z, x));
            }
        }
    }
    SparseMatrix::from_triplets(SIDE.pow(3), SIDE.pow(3), &triplets).unwrap()
}

/// Sixty-four points, each with a neighbour of its own.
fn handles() -> (Vec<usize>, Vec<f64>) {
    let along = [1, 5, 8, 12];
    let points: Vec<usize> = (0..64).map(|k| along[k % 4] + SIDE * (along[k / 4 % 4] + SIDE * along[k / 16])).collect();
    let fixed: Vec<usize> = points.iter().flat_map(|&point| [point, point + 1]).collect();
    let mut given = vec![0.0; fixed.len() * points.len()];
    (0..points.len()).for_each(|k| given[k * fixed.len() + 2 * k..][..2].fill(1.0));
    (fixed, given)
}

#[test]
fn near_agrees_with_among_all_and_is_optimal_everywhere() {
    let (laplacian, mass) = (cube(), vec![1.0; SIDE.pow(3)]);
    let (fixed, fixed_weights) = handles();
    let problem = BiharmonicProblem {
        laplacian: &laplacian,
        mass: &mass,
        fixed: &fixed,
        fixed_weights: &fixed_weights,
        handles: 64,
        shape_preservation: None,
    };
    let energy = BiharmonicEnergy::new(&laplacian, &mass, None, &fixed, &vec![true; mass.len()]).unwrap();
    let active_set = ActiveSet::new(&energy);
    for settings in [BiharmonicSettings::interactive(), BiharmonicSettings::certified()] {
        let goal = Goal { settings: &settings, largest_inverse: active_set.largest_inverse() };
        let near = NearHandles::new(&problem, &energy, &active_set);
        let all: Vec<usize> = (0..64).collect();
        let (far, items) = FarHandles::guess(&problem, &energy, &active_set, &all, &goal).unwrap();
        for (handle, item) in items.into_iter().enumerate() {
            let near = near.solve(handle, &goal, &|| true).unwrap().expect("its support is small");
            let places = near.places.as_deref();
            assert!(near.converged && places.unwrap().len() < mass.len());
            let by_near = problem.whole(&energy, handle, places, &near.best.weights);
            let far = far.solve(item, &goal, &|| true).unwrap();
            let by_far = problem.whole(&energy, handle, None, &far.best.weights);
            let bound = |solve: &Solve| goal.error_bound(solve.best.certificate.gap);
            let mut difference = vec![0.0; mass.len()];
            by_near.iter().for_each(|&(vertex, weight)| difference[vertex] += weight);
            by_far.iter().for_each(|&(vertex, weight)| difference[vertex] -= weight);
            let worst = difference.iter().fold(0.0, |worst: f64, d| worst.max(d.abs()));
            assert!(worst <= bound(&near) + bound(&far) && bound(&near) <= settings.error_bound, "{worst}");
            // Nor does any multiplier on the whole mesh have a wrong sign that matters.
            let mut weights = vec![0.0; mass.len()];
            by_near.iter().for_each(|&(vertex, weight)| weights[vertex] = weight);
            let gradient = laplacian.multiply(&laplacian.multiply(&weights));
            let outside = (0..mass.len()).filter(|&vertex| weights[vertex] == 0.0 && !fixed.contains(&vertex));
            let wrong = outside.map(|vertex| -gradient[vertex]).fold(0.0, f64::max);
            assert!(wrong <= 50.0 * settings.error_bound, "{wrong} with {settings:?}");
        }
    }
}

#[test]
fn threads_change_no_bit_of_many_handles() {
    let (laplacian, mass) = (cube(), vec![1.0; SIDE.pow(3)]);
    let (fixed, fixed_weights) = handles();
    let problem = BiharmonicProblem {
        laplacian: &laplacian,
        mass: &mass,
        fixed: &fixed,
        fixed_weights: &fixed_weights,
        handles: 64,
        shape_preservation: None,
    };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let settings = BiharmonicSettings::interactive();
        let go_on = &mut |_: &'static str, _: f64| ControlFlow::Continue(());
        pool.install(|| bounded_biharmonic_weights(&problem, &settings, go_on).unwrap())
    };
    let once = on(1);
    assert!(once.weights.stored() < 64 * mass.len() / 2, "{}", once.weights.stored());
    assert_eq!(once, on(3));
}
