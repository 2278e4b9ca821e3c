//! Monotone functions beside an implementation of its own in `NumPy` and `SciPy`.
//!
//! `ARMATURE_SCIPY_PYTHON` names a Python that has the package `scipy`. Without it the check prints that it is skipped; in CI
//! it fails.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has to fail")]

mod support;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

use armature_geometry::operators::{Lumping, cotangent_laplacian, lumped_mass};
use armature_weights::extrema::Neighbours;
use armature_weights::monotone::{MonotoneProblem, MonotoneSettings, PrescribedFunction, monotone_functions};
use support::{flat_shape, nearest};

fn scipy() -> Option<PathBuf> {
    let python = std::env::var_os("ARMATURE_SCIPY_PYTHON").filter(|value| !value.is_empty()).map(PathBuf::from);
    if python.is_none() {
        let in_ci = ["CI", "ARMATURE_REQUIRE_SHARED_DATA"].iter().all(|name| std::env::var_os(name).is_some());
        assert!(!in_ci, "ARMATURE_SCIPY_PYTHON must be set in CI: SciPy was not run");
        println!("SKIPPED: ARMATURE_SCIPY_PYTHON is not set, so SciPy was not run");
    }
    python
}

#[test]
fn edges_and_values_are_those_that_scipy_finds() {
    let Some(python) = scipy() else { return };
    // Leaning and stretched, so that no two neighbours are equally high.
    let mut mesh = flat_shape(0.25, [3.0, 2.0], |x, y| (0.75..1.5).contains(&y) || (1.5..2.25).contains(&x));
    for place in &mut mesh.vertices {
        let [x, y, z] = *place;
        *place = [x + 0.07 * y + 0.01 * (3.0 * x).sin(), 1.05 * y + 0.02 * x * x, z];
    }
    let fixed =
        [[0.1, 1.2, 0.0], [1.9, 1.3, 0.0], [3.0, 1.4, 0.0], [1.0, 1.1, 0.0]].map(|p| nearest(&mesh.vertices, p));
    let values = [0.0, 1.0, 0.0, 0.5];
    let laplacian = cotangent_laplacian(&mesh).unwrap().matrix;
    let mass = lumped_mass(&mesh, Lumping::Barycentric).unwrap();
    let neighbours = Neighbours::of_elements(mesh.vertices.len(), &mesh.triangles).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests/scipy_monotone.py");
    for order in 2..=4 {
        let problem = MonotoneProblem {
            neighbours: &neighbours,
            laplacian: &laplacian,
            mass: &mass,
            order,
            blend: None,
            data: None,
        };
        let settings = MonotoneSettings { error_bound: 1e-7, relative_gap: 1e-12, ..MonotoneSettings::certified() };
        let prescribed = PrescribedFunction::between_extremes(&values);
        let mut on = |_: &'static str, _: f64| ControlFlow::Continue(());
        let made = monotone_functions(&problem, &fixed, &[prescribed], &settings, &mut on).unwrap().remove(0);
        println!("{:?}", made.report);
        let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("monotone-{order}.json"));
        // Lists of numbers are the same in JSON as Rust prints them.
        let text = format!(
            r#"{{"vertices": {:?}, "triangles": {:?}, "order": {order}, "fixed": {fixed:?}, "values": {values:?},
            "margin": {:?}, "rising": {:?}, "solution": {:?}}}"#,
            mesh.vertices, mesh.triangles, made.report.margin, made.rising, made.values,
        );
        std::fs::write(&file, text).unwrap();
        let ran = Command::new(&python).arg(&script).arg(&file).output().unwrap();
        let told = String::from_utf8_lossy(&ran.stdout);
        println!("{told}");
        assert!(ran.status.success(), "order {order}: {told}{}", String::from_utf8_lossy(&ran.stderr));
    }
}
