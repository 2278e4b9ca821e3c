//! Regions that are dragged.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod support;

use armature_fairing::edit::{EditError, RegionEditor, RegionSettings, SharpCurve, near_vertices, vertices_within};
use armature_fairing::mixed::Energy;
use armature_geometry::TriangleMesh;
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
    let slope = |energy: Energy, sharp: &[SharpCurve]| {
        let settings = RegionSettings { energy };
        let editor = RegionEditor::precompute(&flat, &region, &ridge, sharp, &settings).unwrap();
        let (edited, _) = editor.edited(&flat, &raised).unwrap();
        let height = |x: u32| edited.vertices[(10 * 41 + x) as usize][2];
        (height(20) - height(19), height(20) - height(21))
    };
    for energy in ENERGIES {
        let curve = |slopes| [SharpCurve { vertices: ridge.clone(), slopes }];
        let (smooth, sharp) = (slope(energy, &[]), slope(energy, &curve(None)));
        println!("{energy:?}: {smooth:?} {sharp:?}");
        assert!((smooth.0 - smooth.1).abs() < 1e-6 && (sharp.0 - sharp.1).abs() < 1e-6);
        assert!(smooth.0 < 0.1 && sharp.0 > 0.2, "{smooth:?} {sharp:?}");
        // The ridge runs along y: left of it x is smaller. It goes down to the left, and still up to the right.
        let given = slope(energy, &curve(Some([[0.0, 0.0, -0.6], [0.0, 0.0, 0.3]])));
        println!("{given:?}");
        assert!((given.0 - 0.6).abs() < 0.15 && (given.1 + 0.3).abs() < 0.15, "{given:?}");
    }
}

/// A curve of four vertices of the region, from beside the first handle, with slopes; they become handles.
fn slanted(ball: &TriangleMesh, region: &[u32], handles: &mut Vec<u32>) -> SharpCurve {
    let next = |from: u32, seen: &[u32]| {
        let around = ball.triangles.iter().filter(|t| t.contains(&from)).flatten().copied();
        around.filter(|v| region.contains(v) && !seen.contains(v)).max().unwrap()
    };
    let mut vertices = vec![next(handles[0], handles)];
    for _ in 0..3 {
        vertices.push(next(vertices[vertices.len() - 1], &[&vertices[..], &handles[..]].concat()));
    }
    handles.extend(&vertices);
    SharpCurve { vertices, slopes: Some([[0.1, 0.0, 0.2], [0.0, -0.3, 0.0]]) }
}

#[test]
fn influences_give_what_a_solution_gives() {
    let ball = sphere(4);
    // Eleven handles are more than are solved for together; one is given twice, one is far from the region.
    let mut handles: Vec<u32> = (0..11).map(|k| 6 + 17 * k).collect();
    let region = vertices_within(&ball, &handles, 0.3);
    handles.extend([handles[3], (0..ball.vertices.len() as u32).rfind(|v| !region.contains(v)).unwrap()]);
    let mut dragged: Vec<[f64; 3]> = (0..13).map(|k| [0.1 * f64::from(k), 0.3, -0.02 * f64::from(k * k)]).collect();
    dragged[11] = dragged[3];
    let sharp = [SharpCurve { vertices: handles[4..6].to_vec(), slopes: None }, slanted(&ball, &region, &mut handles)];
    dragged.resize(handles.len(), [0.2, 0.0, 0.1]);
    for energy in ENERGIES {
        let prepare =
            || RegionEditor::precompute(&ball, &region, &handles, &sharp, &RegionSettings { energy }).unwrap();
        let (solved, summed) =
            (prepare().displacements(&dragged).unwrap(), prepare().with_influences().unwrap().displacements(&dragged));
        let summed = summed.unwrap();
        assert_eq!(solved.moves.len(), summed.moves.len());
        assert!(solved.moves.len() > 100 && summed.residual < 1e-12);
        for ((a, from), (b, to)) in solved.moves.iter().zip(&summed.moves) {
            assert_eq!(a, b);
            from.iter().zip(to).for_each(|(x, y)| assert!((x - y).abs() < 1e-9));
        }
    }
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
    let chain = |vertices: &[u32]| SharpCurve { vertices: vertices.to_vec(), slopes: Some([[0.0; 3]; 2]) };
    let broken = |vertices: &[u32]| {
        RegionEditor::precompute(&ball, &region, vertices, &[chain(vertices)], &settings).unwrap_err()
    };
    let (first, last) = (region[1], region[region.len() - 1]);
    assert_eq!(broken(&[0, first]), EditError::ShortCurve { given: 2 });
    assert!(matches!(broken(&[0, last, first]), EditError::NotACurve { .. }));
    let loose = RegionEditor::precompute(&ball, &region, &[0], &[chain(&[0, first, last])], &settings).unwrap_err();
    assert_eq!(loose, EditError::NotDragged { vertex: first });
    let adrift = RegionEditor::precompute(&ball, &everything, &[], &[], &settings).unwrap_err();
    assert!(adrift.to_string().contains("no vertex that is held"), "{adrift}");
}
