//! Cages, open and closed: weights are linear along their edges (thesis eq. 4.4).

use std::ops::ControlFlow;

use armature_character::handle_weights::{
    BiharmonicTier, DomainKind, HandlePlace, HandleShape, HandleWeights, HandleWeightsError, HandleWeightsSettings,
    Held, Partition, WeightMethod, WeightsOn, handle_weights,
};
use armature_geometry::{TetrahedralMesh, TriangleMesh};
use armature_weights::handles::FREE_NEAR_JOINTS;

fn point(name: &str, at: [f64; 3]) -> HandleShape {
    HandleShape { name: name.into(), place: HandlePlace::Point(at) }
}

fn bone(name: &str, ends: [[f64; 3]; 2]) -> HandleShape {
    HandleShape { name: name.into(), place: HandlePlace::Segments(vec![ends]) }
}

fn weights(
    surface: &TriangleMesh,
    tetrahedra: Option<&TetrahedralMesh>,
    shapes: &[HandleShape],
    cage: &[[usize; 2]],
) -> Result<HandleWeights, HandleWeightsError> {
    let on = if tetrahedra.is_some() { WeightsOn::OwnElements } else { WeightsOn::Volume { vertices: 1200 } };
    let settings = HandleWeightsSettings {
        method: WeightMethod::BoundedBiharmonic,
        tier: BiharmonicTier::Certified,
        on,
        partition: Partition::Normalised,
        joint_release: FREE_NEAR_JOINTS,
    };
    let held = Held::Shapes { shapes, cage };
    handle_weights(surface, tetrahedra, held, &settings, &mut |_, _| ControlFlow::Continue(()))
}

/// 5 × 9 vertices in the plane.
fn sheet() -> TriangleMesh {
    let vertices = (0..45).map(|k| [f64::from(k % 5), f64::from(k / 5), 0.0]).collect();
    let squares = (0..40_u32).filter(|k| k % 5 < 4);
    let triangles = squares.flat_map(|k| [[k, k + 1, k + 6], [k, k + 6, k + 5]]).collect();
    TriangleMesh { vertices, triangles }
}

#[test]
fn in_a_flat_figure_open_and_closed_cages_are_linear() {
    let at = |x, y| [x, y, 0.0];
    let shapes = [
        point("a", at(1.0, 1.0)),
        point("b", at(3.0, 1.0)),
        point("c", at(3.0, 5.0)),
        point("d", at(1.0, 5.0)),
        bone("top", [at(1.0, 7.0), at(3.0, 7.0)]),
    ];
    let open = [[0, 1], [1, 2]];
    let closed = [[0, 1], [1, 2], [2, 3], [3, 0]];
    for cage in [&open[..], &closed] {
        let made = weights(&sheet(), None, &shapes, cage).unwrap();
        assert_eq!((made.domain, made.unconverged()), (DomainKind::Flat, 0));
        assert!(made.warnings.is_empty(), "{:?}", made.warnings);
        for &[from, to] in cage {
            let place = |k: usize| match shapes[k].place {
                HandlePlace::Point([x, y, _]) => [x, y],
                HandlePlace::Segments(_) => panic!("a cage ends at points"),
            };
            let ([x, y], [u, v]) = (place(from), place(to));
            let steps = (u - x).abs().max((v - y).abs());
            for step in 0..=steps as usize {
                let share = step as f64 / steps;
                let vertex = (5.0 * (y + share * (v - y)) + x + share * (u - x)) as usize;
                for handle in 0..shapes.len() {
                    let expected = match handle {
                        h if h == from => 1.0 - share,
                        h if h == to => share,
                        _ => 0.0,
                    };
                    let weight = made.weights.bone(handle)[vertex];
                    assert!((weight - expected).abs() < 1e-6, "{from}-{to}, step {step}, {handle}: {weight}");
                }
            }
        }
    }
}

#[test]
fn on_tetrahedra_the_vertices_along_an_edge_are_linear() {
    // A block of 4 × 2 × 2 cubes of six tetrahedra each.
    let number = |x: u32, y: u32, z: u32| x + 5 * (y + 3 * z);
    let vertices: Vec<[f64; 3]> =
        (0..45).map(|k| [f64::from(k % 5), f64::from(k / 5 % 3), f64::from(k / 15)]).collect();
    let mut tetrahedra = Vec::new();
    for (x, y, z) in (0..16).map(|k| (k % 4, k / 4 % 2, k / 8)) {
        for (first, second) in [(0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)] {
            let mut at = [x, y, z];
            let mut corners = vec![number(x, y, z)];
            for axis in [first, second, 3 - first - second] {
                at[axis] += 1;
                corners.push(number(at[0], at[1], at[2]));
            }
            let [a, b, c, d] = [corners[0], corners[1], corners[2], corners[3]];
            let is_even = matches!((first, second), (0, 1) | (1, 2) | (2, 0));
            tetrahedra.push(if is_even { [a, b, c, d] } else { [a, c, b, d] });
        }
    }
    let surface = TriangleMesh { vertices: vertices.clone(), triangles: vec![[0, 1, 5]] };
    let own = TetrahedralMesh { vertices, tetrahedra };
    let shapes = [point("a", [0.0, 1.0, 1.0]), point("b", [4.0, 1.0, 1.0]), point("c", [2.0, 0.0, 0.0])];
    let made = weights(&surface, Some(&own), &shapes, &[[0, 1]]).unwrap();
    let along: Vec<f64> = (0..5).map(|x| made.weights.bone(0)[number(x, 1, 1) as usize]).collect();
    let expected = [1.0, 0.75, 0.5, 0.25, 0.0];
    assert!(along.iter().zip(expected).all(|(w, e)| (w - e).abs() < 1e-9), "{along:?}");
}

/// A closed box around the z axis, 1 × 1 × 4, with a vertex every half of a unit.
fn column() -> TriangleMesh {
    let round: Vec<[f64; 2]> =
        [[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 2], [0, 1]].map(|p| p.map(|c| f64::from(c) / 2.0)).into();
    let mut vertices: Vec<[f64; 3]> =
        (0..9).flat_map(|z| round.iter().map(move |&[x, y]| [x, y, f64::from(z) / 2.0])).collect();
    vertices.extend([[0.5, 0.5, 0.0], [0.5, 0.5, 4.0]]);
    let mut triangles = Vec::new();
    for k in 0..8 {
        let next = (k + 1) % 8;
        triangles.extend([[72, next, k], [73, 64 + k, 64 + next]]);
        for z in (0..64).step_by(8) {
            triangles.extend([[z + k, z + next, z + 8 + next], [z + k, z + 8 + next, z + 8 + k]]);
        }
    }
    TriangleMesh { vertices, triangles }
}

#[test]
fn in_a_volume_weights_follow_the_edge_inside() {
    let shapes = [point("low", [0.5, 0.5, 0.5]), point("high", [0.5, 0.5, 3.5])];
    let mesh = column();
    let made = weights(&mesh, None, &shapes, &[[0, 1]]).unwrap();
    assert_eq!((made.domain, made.unconverged()), (DomainKind::Volume, 0));
    for (vertex, p) in mesh.vertices.iter().enumerate() {
        let expected = ((3.5 - p[2]) / 3.0).clamp(0.0, 1.0);
        let weight = made.weights.bone(0)[vertex];
        assert!((weight - expected).abs() < 0.05, "{p:?}: {weight}, linear would be {expected}");
    }
    // Points alone have flat weights around them, far from linear.
    let apart = weights(&mesh, None, &shapes, &[]).unwrap();
    let differs = |v: usize| (apart.weights.bone(0)[v] - made.weights.bone(0)[v]).abs() > 0.03;
    assert!((0..mesh.vertices.len()).any(differs));
}

#[test]
fn what_is_no_cage_is_named() {
    let at = |x, y| [x, y, 0.0];
    let ends = [point("a", at(1.0, 1.0)), point("b", at(3.0, 1.0))];
    let with = |more: HandleShape, cage: &[[usize; 2]]| {
        let shapes = [ends.to_vec(), vec![more]].concat();
        weights(&sheet(), None, &shapes, cage).unwrap_err()
    };
    let far = || point("c", at(2.0, 6.0));
    let along = || bone("c", [at(1.0, 5.0), at(3.0, 5.0)]);
    for (shape, edge) in [(far(), [0, 0]), (far(), [0, 3]), (along(), [0, 2])] {
        assert_eq!(with(shape, &[[0, 1], edge]), HandleWeightsError::CageEdge { edge: 1 });
    }
    let same = with(point("c", at(3.0, 1.0)), &[[0, 1]]);
    assert_eq!(same, HandleWeightsError::CagePoint { first: "b".into(), second: "c".into() });
    let crossed = with(bone("c", [at(2.0, 1.0), at(2.0, 3.0)]), &[[0, 1]]);
    assert_eq!(crossed, HandleWeightsError::CageCrossed { from: "a".into(), to: "b".into() });
}
