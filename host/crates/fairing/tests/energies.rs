//! Patch tests, the convergence of both energies, and the forms of their systems compared.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

use armature_fairing::mixed::{BentCurves, Elements, Energy, Fairing, FairingError, Form, Mass, Settings, Values};
use armature_fairing::study::{Condition, Family, Sample, Wave, held, sample, slope};
use armature_geometry::operators::Lumping;

const FAMILIES: [(&str, Family); 5] = [
    ("regular", Family::Regular),
    ("union jack", Family::UnionJack),
    ("crossed", Family::Crossed),
    ("random 30°", Family::Random { degrees: 30.0, seed: 7 }),
    ("random 1°", Family::Random { degrees: 1.0, seed: 7 }),
];
const ENERGIES: [Energy; 2] = [Energy::Laplacian, Energy::LaplacianGradient];
const CONDITIONS: [Condition; 2] = [Condition::Region, Condition::Curve];
const LUMPINGS: [Lumping; 2] = [Lumping::Barycentric, Lumping::VoronoiHybrid];

fn forms() -> Vec<Form> {
    let lumped = LUMPINGS.iter().flat_map(|&l| [Form::Reduced(l), Form::Mixed(Mass::Lumped(l))]);
    lumped.chain([Form::Mixed(Mass::Full)]).collect()
}

/// Geometric mean over several meshes, where meshes are random.
fn mean_sample(family: Family, cells: usize, condition: Condition, settings: Settings) -> Sample {
    let seeds = if let Family::Random { degrees, .. } = family {
        (0..3).map(|seed| Family::Random { degrees, seed }).collect()
    } else {
        vec![family]
    };
    let all: Vec<Sample> =
        seeds.iter().map(|&f| sample(f, cells, condition, &settings, &Wave::STUDY).unwrap()).collect();
    let mean = |of: fn(&Sample) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
    Sample { edge: mean(|s| s.edge), error: mean(|s| s.error.ln()).exp(), ..all[0] }
}

/// Largest difference from `wave` over the mesh, without a right-hand side.
fn worst(family: Family, condition: Condition, settings: Settings, wave: &Wave) -> f64 {
    let flat = family.mesh(8, if condition == Condition::Region { 4 } else { 0 });
    let (conditions, (fixed, tangents, laplacians)) = held(&flat, condition, settings.energy, wave);
    let elements = Elements::of_positions(&flat.vertices, &flat.triangles).unwrap();
    let fairing = Fairing::precompute(&elements, &conditions, &settings).unwrap();
    let values = Values { fixed: &fixed, tangents: &tangents, laplacians: &laplacians, source: &[] };
    let solution = fairing.solve(&values).unwrap();
    solution.values.iter().zip(&flat.vertices).map(|(u, &p)| (u[0] - wave.value(p)).abs()).fold(0.0, f64::max)
}

#[test]
fn linear_functions_are_exact() {
    let linear = Wave { strength: 0.0, slope: [0.7, -1.3], ..Wave::STUDY };
    for (name, family) in FAMILIES {
        for energy in ENERGIES {
            for condition in CONDITIONS {
                for form in forms() {
                    let settings = Settings { form, ..Settings::new(energy) };
                    let error = worst(family, condition, settings, &linear);
                    assert!(error < 1e-10, "{name} {energy:?} {condition:?} {form:?}: {error:e}");
                }
            }
        }
    }
}

#[test]
fn two_rows_are_exact_for_linear_functions_and_converge_on_regular_meshes() {
    let linear = Wave { strength: 0.0, slope: [0.7, -1.3], ..Wave::STUDY };
    let settings = Settings { bent_curves: BentCurves::TwoRows, ..Settings::new(Energy::LaplacianGradient) };
    for (name, family) in FAMILIES {
        let error = worst(family, Condition::Curve, settings, &linear);
        assert!(error < 1e-10, "{name}: {error:e}");
    }
    let samples = [8, 16, 32].map(|cells| mean_sample(Family::Regular, cells, Condition::Curve, settings));
    assert!(slope(&samples, 3) >= 1.5, "{}", slope(&samples, 3));
}

/// The slope that a problem must have on a family, with Voronoi areas; `None` where the thesis and we find none to rely on.
fn asked(family: Family, energy: Energy, condition: Condition) -> Option<f64> {
    match (energy, family) {
        (Energy::Laplacian, _) => Some(1.5),
        (Energy::LaplacianGradient, Family::Random { .. }) if condition == Condition::Region => None,
        (Energy::LaplacianGradient, _) => Some(if condition == Condition::Curve { 1.0 } else { 1.5 }),
    }
}

#[test]
fn errors_fall_as_fast_as_asked() {
    for (name, family) in FAMILIES {
        for energy in ENERGIES {
            for condition in CONDITIONS {
                let settings = Settings::new(energy);
                let samples: Vec<_> =
                    [8, 16, 32, 64].map(|cells| mean_sample(family, cells, condition, settings)).to_vec();
                let (fall, errors) = (slope(&samples, 4), samples.iter().map(|s| format!("{:.1e}", s.error)));
                let errors: Vec<String> = errors.collect();
                println!("{name:12} {energy:?} {condition:?}: slope {fall:.2}, errors {}", errors.join(" "));
                assert!(samples[3].error < samples[0].error, "{name} {energy:?} {condition:?}");
                if let Some(least) = asked(family, energy, condition) {
                    assert!(fall >= least, "{name} {energy:?} {condition:?}: {fall}");
                }
            }
        }
    }
}

#[test]
fn systems_with_and_without_auxiliary_variables_agree() {
    for (name, family) in FAMILIES {
        for energy in ENERGIES {
            for condition in CONDITIONS {
                for lumping in LUMPINGS {
                    let error = |form| {
                        let settings = Settings { form, ..Settings::new(energy) };
                        sample(family, 16, condition, &settings, &Wave::STUDY).unwrap()
                    };
                    let (reduced, mixed) = (error(Form::Reduced(lumping)), error(Form::Mixed(Mass::Lumped(lumping))));
                    assert!((reduced.error - mixed.error).abs() < 1e-6 * reduced.error, "{name}");
                }
            }
        }
    }
}

#[test]
fn curves_that_fix_too_much_are_named() {
    let flat = Family::Regular.mesh(8, 0);
    let energy = Energy::LaplacianGradient;
    let (conditions, _) = held(&flat, Condition::Curve, energy, &Wave::STUDY);
    let elements = Elements::of_positions(&flat.vertices, &flat.triangles).unwrap();
    let form = Form::Mixed(Mass::Lumped(Lumping::Barycentric));
    let settings = Settings { energy, form, bent_curves: BentCurves::Retained };
    let refused = Fairing::precompute(&elements, &conditions, &settings).unwrap_err();
    assert!(matches!(refused, FairingError::OverDetermined { .. } | FairingError::Singular { .. }), "{refused}");
}
