//! Regions that are dragged.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod support;

use armature_fairing::edit::{EditError, RegionEditor, RegionSettings, near_vertices, vertices_within};
use armature_fairing::mixed::Energy;
use support::{sheet, sphere};

const ENERGIES: [Energy; 2] = [Energy::Laplacian, Energy::LaplacianGradient];

#[test]
fn only_the_region_moves_and_it_moves_smoothly() {
    let flat = sheet(40, 40);
    for energy in ENERGIES {
        let top = near_vertices(&flat, &[[20.0, 20.0, 0.0]]).unwrap();
        let region = vertices_within(&flat, &top, 12.0);
        let editor = RegionEditor::precompute(&flat, &region, &top, &[], &RegionSettings { energy }).unwrap();
        let (edited, residual) = editor.edited(&flat, &[[0.0, 0.0, 5.0]]).unwrap();
        assert!(residual < 1e-12, "{residual}");
        let height = |x: u32, y: u32| edited.vertices[(y * 41 + x) as usize][2];
        assert!((height(20, 20) - 5.0).abs() < 1e-12);
        for (v, (before, after)) in flat.vertices.iter().zip(&edited.vertices).enumerate() {
            let moved = before.iter().zip(after).any(|(x, y)| (x - y).abs() > 0.0);
            assert!(region.contains(&(v as u32)) || !moved);
            assert!((before[0] - after[0]).abs() < 1e-9 && (before[1] - after[1]).abs() < 1e-9);
        }
        // Near the border of the region the surface leaves its plane gently.
        let edge = (0..20).find(|&x| height(x, 20) != 0.0).unwrap();
        let steps: Vec<f64> = (edge..edge + 3).map(|x| height(x, 20)).collect();
        println!("{energy:?}: {steps:?}");
        assert!(steps[0] < 0.15 && steps[1] < 0.5, "{steps:?}");
        // Twice as far is twice as high: the factor is used again.
        let (twice, _) = editor.edited(&flat, &[[0.0, 0.0, 10.0]]).unwrap();
        edited.vertices.iter().zip(&twice.vertices).for_each(|(a, b)| assert!((2.0 * a[2] - b[2]).abs() < 1e-9));
    }
}

#[test]
fn a_sharp_curve_makes_a_crease() {
    let flat = sheet(40, 20);
    let ridge: Vec<u32> = (0..=20).map(|y| y * 41 + 20).collect();
    let region: Vec<u32> = (0..41 * 21).filter(|v| (5..=35).contains(&(v % 41))).collect();
    let raised = vec![[0.0, 0.0, 3.0]; ridge.len()];
    let slope = |sharp: &[u32]| {
        let settings = RegionSettings { energy: Energy::Laplacian };
        let editor = RegionEditor::precompute(&flat, &region, &ridge, sharp, &settings).unwrap();
        let (edited, _) = editor.edited(&flat, &raised).unwrap();
        let height = |x: u32| edited.vertices[(10 * 41 + x) as usize][2];
        (height(20) - height(19), height(20) - height(21))
    };
    let (smooth, sharp) = (slope(&[]), slope(&ridge));
    println!("{smooth:?} {sharp:?}");
    assert!((smooth.0 - smooth.1).abs() < 1e-6 && (sharp.0 - sharp.1).abs() < 1e-6);
    assert!(smooth.0 < 0.1 && sharp.0 > 0.2, "{smooth:?} {sharp:?}");
}

#[test]
fn contradictions_are_named() {
    let ball = sphere(3);
    let settings = RegionSettings { energy: Energy::Laplacian };
    let region = vertices_within(&ball, &[0], 0.6);
    let editor = RegionEditor::precompute(&ball, &region, &[0, 0], &[], &settings).unwrap();
    let twice = editor.displacements(&[[1.0; 3], [2.0; 3]]).unwrap_err();
    assert_eq!(twice, EditError::Contradiction { vertex: 0 });
    assert!(editor.displacements(&[[1.0; 3]; 2]).is_ok());
    assert_eq!(editor.displacements(&[]).unwrap_err(), EditError::WrongCount { given: 0, wanted: 2 });
    let nothing = RegionEditor::precompute(&ball, &[0], &[0], &[], &settings).unwrap_err();
    println!("{nothing}");
    let far = RegionEditor::precompute(&ball, &[9999], &[], &[], &settings).unwrap_err();
    assert!(matches!(far, EditError::NoSuchVertex { vertex: 9999, .. }));
    let everything: Vec<u32> = (0..ball.vertices.len() as u32).collect();
    let adrift = RegionEditor::precompute(&ball, &everything, &[], &[], &settings).unwrap_err();
    assert!(adrift.to_string().contains("no vertex that is held"), "{adrift}");
}
