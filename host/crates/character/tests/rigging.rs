//! Skeletons fitted into meshes: our own characters, whose bones are known, the same moved, turned, posed and remeshed,
//! real models, and meshes that no skeleton belongs in.

#![expect(clippy::unwrap_used, reason = "a test may fail by panic")]

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::OnceLock;

use armature_character::rigging::{Doubt, Fit, RigError, RigSettings, Template, fit};
use armature_character::{Character, own};
use armature_formats::model::Model;
use armature_formats::read_model;
use armature_formats::skeleton::read_tgf;
use armature_geometry::TriangleMesh;
use armature_geometry::simplify::simplify;
use armature_rig::{Figure, Skeleton, recognise};
use armature_test_support::shared;
use glam::{Affine3A, DAffine3, DQuat, DVec3, Quat, Vec3};

fn fitted(mesh: &TriangleMesh, template: &Template, settings: &RigSettings) -> Result<Fit, RigError> {
    fit(mesh, template, settings, &mut |_, done| {
        assert!((0.0..=1.0).contains(&done));
        ControlFlow::Continue(())
    })
}

fn human_in(mesh: &TriangleMesh) -> Fit {
    fitted(mesh, &Template::human().unwrap(), &RigSettings::default()).unwrap()
}

fn human() -> &'static Character {
    static HUMAN: OnceLock<Character> = OnceLock::new();
    HUMAN.get_or_init(|| own::human().unwrap())
}

/// Our own human with few triangles.
fn coarse() -> &'static TriangleMesh {
    static COARSE: OnceLock<TriangleMesh> = OnceLock::new();
    COARSE.get_or_init(|| {
        let made = simplify(&human().surface.mesh, 2500, &mut |_, _| ControlFlow::Continue(()));
        made.unwrap().mesh
    })
}

fn heads(skeleton: &Skeleton) -> BTreeMap<&str, DVec3> {
    let names = skeleton.bones().iter().map(|bone| bone.name.as_str());
    names.zip(skeleton.rest_segments()).map(|(name, (head, _))| (name, head.as_dvec3())).collect()
}

fn height(mesh: &TriangleMesh) -> f64 {
    let (low, high) = mesh.bounds().unwrap();
    (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max)
}

/// Mean and largest distance between the heads of bones of the same name.
fn apart(a: &BTreeMap<&str, DVec3>, b: &BTreeMap<&str, DVec3>) -> (f64, f64) {
    let distances: Vec<f64> = a.iter().filter_map(|(name, at)| Some(at.distance(*b.get(name)?))).collect();
    assert!(distances.len() > 5, "the names have nothing in common");
    (distances.iter().sum::<f64>() / distances.len() as f64, distances.iter().copied().fold(0.0, f64::max))
}

fn is_sure(fit: &Fit, least: f64) {
    for (bone, sure) in fit.skeleton.bones().iter().zip(&fit.certainty) {
        assert!(*sure > least, "{} is only {sure:.2} sure; {:?}", bone.name, fit.doubts);
    }
}

#[test]
fn the_bones_of_our_own_human_are_found_again() {
    let character = human();
    let mesh = &character.surface.mesh;
    let fit = human_in(mesh);
    is_sure(&fit, 0.6);
    assert_eq!(fit.doubts, []);
    assert!(fit.up[1] > 0.999 && fit.front[2] > 0.999, "{:?} {:?}", fit.up, fit.front);
    let (mean, most) = apart(&heads(&fit.skeleton), &heads(&character.skeleton));
    println!("own human: mean {:.4}, most {:.4} of its size", mean / height(mesh), most / height(mesh));
    assert!(mean < 0.02 * height(mesh) && most < 0.05 * height(mesh), "{mean} {most}");
    // Both sides are alike.
    let heads = heads(&fit.skeleton);
    for (name, at) in &heads {
        if let Some(other) = name.strip_prefix("Left").and_then(|rest| heads.get(format!("Right{rest}").as_str())) {
            assert!(at.x > 0.0, "{name} is on the wrong side");
            assert!(at.distance(DVec3::new(-other.x, other.y, other.z)) < 0.003 * height(mesh), "{name}");
        }
    }
    let recognised = recognise(&fit.skeleton);
    assert_eq!((recognised.figure, recognised.count()), (Figure::Human, fit.skeleton.len()));
}

#[test]
fn joints_move_with_the_mesh() {
    let mesh = coarse();
    let still = human_in(mesh);
    let still = heads(&still.skeleton);
    let turn = |axis: DVec3, degrees: f64| DAffine3::from_quat(DQuat::from_axis_angle(axis, degrees.to_radians()));
    let quarter = turn(DVec3::X, 90.0);
    for (what, moved_from_mesh) in [
        ("metres to centimetres", DAffine3::from_scale(DVec3::splat(100.0))),
        (
            "tiny and far away",
            DAffine3::from_translation(DVec3::splat(50.0)) * DAffine3::from_scale(DVec3::splat(0.01)),
        ),
        ("looking along +X", turn(DVec3::Y, 90.0)),
        ("between the axes", turn(DVec3::Y, 33.0)),
        ("+Z up", quarter),
    ] {
        let vertices = mesh.vertices.iter().map(|&v| moved_from_mesh.transform_point3(v.into()).to_array()).collect();
        let moved = TriangleMesh { vertices, triangles: mesh.triangles.clone() };
        let fit = human_in(&moved);
        let expected = still.iter().map(|(name, at)| (*name, moved_from_mesh.transform_point3(*at))).collect();
        let (mean, most) = apart(&heads(&fit.skeleton), &expected);
        let size = moved_from_mesh.matrix3.determinant().abs().cbrt() * height(mesh);
        println!("{what}: mean {:.4}, most {:.4} of its size", mean / size, most / size);
        assert!(mean < 0.012 * size && most < 0.04 * size, "{what}: {mean} {most} {:?} {:?}", fit.up, fit.front);
    }
}

#[test]
fn a_coarser_mesh_has_the_same_joints() {
    let mesh = &human().surface.mesh;
    let (fine, coarse) = (human_in(mesh), human_in(coarse()));
    let (mean, most) = apart(&heads(&fine.skeleton), &heads(&coarse.skeleton));
    assert!(mean < 0.01 * height(mesh) && most < 0.03 * height(mesh), "{mean} {most}");
}

/// Our own skin bends the mesh; the fitted bones must bend with it.
#[test]
fn a_posed_mesh_has_the_posed_skeleton() {
    let character = human();
    let mut pose = character.skeleton.rest_pose();
    let mut bend = |bone: &str, axis: Vec3, degrees: f32| {
        let bone = character.skeleton.find(bone).unwrap();
        pose.parent_from_bone[bone].rotation *= Quat::from_axis_angle(axis, degrees.to_radians());
    };
    bend("LeftUpperArm", Vec3::Z, -50.0);
    bend("RightUpperArm", Vec3::Z, 40.0);
    bend("LeftLowerArm", Vec3::Y, -70.0);
    bend("RightLowerArm", Vec3::Y, 50.0);
    bend("LeftUpperLeg", Vec3::X, -45.0);
    bend("LeftLowerLeg", Vec3::X, 60.0);
    let mut model_from_bone = vec![Affine3A::IDENTITY; character.skeleton.len()];
    pose.forward_kinematics(&character.skeleton, &mut model_from_bone);
    let mut skin = character.linear_skin().unwrap();
    let mut positions = vec![[0.0; 3]; character.surface.mesh.vertices.len()];
    let mut normals = positions.clone();
    skin.solve(&model_from_bone, &mut positions, &mut normals).unwrap();
    let vertices = positions.iter().map(|p| p.map(f64::from)).collect();
    let mesh = TriangleMesh { vertices, triangles: character.surface.mesh.triangles.clone() };
    let fit = human_in(&mesh);
    let names = character.skeleton.bones().iter().map(|bone| bone.name.as_str());
    let posed = names.zip(&model_from_bone).map(|(name, m)| (name, m.translation.as_dvec3())).collect();
    let (mean, most) = apart(&heads(&fit.skeleton), &posed);
    println!("posed human: mean {:.4}, most {:.4} of its size", mean / height(&mesh), most / height(&mesh));
    assert!(mean < 0.025 * height(&mesh) && most < 0.07 * height(&mesh), "{mean} {most}");
}

fn model(folder: &Path, name: &str) -> Model {
    let resolver = |file: &str| std::fs::read(folder.join(file)).map_err(|error| error.to_string());
    read_model(name, &std::fs::read(folder.join(name)).unwrap(), &resolver).unwrap()
}

/// The skeletons that come with real models were made by hand, with other bones: what is compared is how far each of
/// our joints is from their nearest bone.
#[test]
fn joints_are_near_the_bones_that_artists_placed() {
    let Some(folder) = shared("") else { return };
    let quadruped = Template::quadruped().unwrap();
    for (mesh, bones, template, front, nearest) in [
        ("armadillo.obj", "armadillo.tgf", Template::human().unwrap(), [0.0, 0.0, 1.0], 0.04),
        ("hand.mesh", "hand.tgf", Template::hand().unwrap(), [0.0, 0.0, 1.0], 0.04),
        ("Fox.glb", "", quadruped.clone(), [0.0, 0.0, 1.0], 0.06),
        ("cow.off", "", quadruped, [1.0, 0.0, 0.0], 0.0),
    ] {
        let model = model(&folder, mesh);
        let fit = fitted(&model.mesh, &template, &RigSettings::default()).unwrap();
        let front = DVec3::from(fit.front).dot(front.into());
        assert!(fit.up[1] > 0.99 && front > 0.95, "{mesh}: {:?} {:?}", fit.up, fit.front);
        let segments: Vec<[DVec3; 2]> = if bones.is_empty() {
            let rig = model.rig.as_ref().map(|rig| rig.skeleton.rest_segments()).unwrap_or_default();
            rig.iter().map(|(head, tail)| [head.as_dvec3(), tail.as_dvec3()]).collect()
        } else {
            let graph = read_tgf(&std::fs::read(folder.join(bones)).unwrap()).unwrap();
            graph.edges.iter().map(|edge| edge.map(|point| graph.points[point].into())).collect()
        };
        if segments.is_empty() {
            continue;
        }
        let from_segment = |p: DVec3, [a, b]: &[DVec3; 2]| {
            let way = *b - *a;
            let along = ((p - *a).dot(way) / way.length_squared().max(1e-30)).clamp(0.0, 1.0);
            p.distance(*a + along * way)
        };
        let size = height(&model.mesh);
        let off: Vec<f64> = fit
            .skeleton
            .rest_segments()
            .iter()
            .map(|(head, _)| {
                segments.iter().map(|s| from_segment(head.as_dvec3(), s)).fold(f64::INFINITY, f64::min) / size
            })
            .collect();
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        println!("{mesh}: mean {mean:.4}, most {:.4} of its size", off.iter().copied().fold(0.0, f64::max));
        assert!(mean < nearest, "{mesh}: {mean} {off:?}");
    }
}

fn sphere() -> TriangleMesh {
    let (rows, columns) = (24_u32, 32_u32);
    let at = |row: u32, column: u32| {
        let (polar, around) = (
            std::f64::consts::PI * f64::from(row) / f64::from(rows),
            2.0 * std::f64::consts::PI * f64::from(column) / f64::from(columns),
        );
        [polar.sin() * around.cos(), polar.cos(), polar.sin() * around.sin()]
    };
    let vertices = (0..=rows).flat_map(|row| (0..columns).map(move |column| at(row, column))).collect();
    let quad = |row: u32, column: u32| {
        let [a, b] = [row * columns + column, row * columns + (column + 1) % columns];
        [[a, b, a + columns], [b, b + columns, a + columns]]
    };
    let triangles = (0..rows).flat_map(|row| (0..columns).flat_map(move |column| quad(row, column))).collect();
    TriangleMesh { vertices, triangles }
}

#[test]
fn what_no_skeleton_belongs_in_is_said() {
    let human = Template::human().unwrap();
    let usual = RigSettings::default();
    // A ball has no limbs.
    let ball = fitted(&sphere(), &human, &usual).unwrap();
    assert!(ball.doubts.iter().any(|doubt| matches!(doubt, Doubt::NoLimb { .. })), "{:?}", ball.doubts);
    assert!(ball.certainty.iter().sum::<f64>() < 0.35 * ball.certainty.len() as f64, "{:?}", ball.certainty);
    // Nor a single triangle, a flat figure, and what is not a number.
    let corner = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let single = TriangleMesh { vertices: corner.to_vec(), triangles: vec![[0, 1, 2]] };
    assert_eq!(fitted(&single, &human, &usual), Err(RigError::Flat));
    let mut bad = sphere();
    bad.vertices[5][1] = f64::NAN;
    assert!(matches!(fitted(&bad, &human, &usual), Err(RigError::Mesh(_))));
    assert!(matches!(fitted(&TriangleMesh::default(), &human, &usual), Err(RigError::Mesh(_))));
    // Triangles everywhere enclose nothing.
    let scattered: Vec<[f64; 3]> = (0..3000_u32)
        .map(|k| [1, 2, 3].map(|axis| f64::from(k.wrapping_mul(2_654_435_761).rotate_left(7 * axis) % 1000) * 1e-3))
        .collect();
    let soup =
        TriangleMesh { vertices: scattered, triangles: (0..1000).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect() };
    match fitted(&soup, &human, &usual) {
        Err(RigError::NoInside { .. }) => {}
        Ok(fit) => assert!(!fit.doubts.is_empty(), "a soup has a skeleton"),
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn another_figure_fits_worse() {
    let mesh = coarse();
    let own = human_in(mesh);
    let other = fitted(mesh, &Template::quadruped().unwrap(), &RigSettings::default()).unwrap();
    let mean = |fit: &Fit| fit.certainty.iter().sum::<f64>() / fit.certainty.len() as f64;
    println!("a human's bones are {:.2} sure, a quadruped's {:.2}", mean(&own), mean(&other));
    assert!(mean(&other) < 0.7 * mean(&own), "{} {}", mean(&other), mean(&own));
    assert!(!other.doubts.is_empty());
}

#[test]
fn open_meshes_in_pieces_have_skeletons_too() {
    let mesh = coarse();
    let full = human_in(mesh);
    // Without the crown and with a ball in the chest and another beside the figure.
    let mut open = mesh.clone();
    open.triangles.retain(|t| t.iter().all(|&v| mesh.vertices[v as usize][1] < 1.70));
    for (at, size) in [([0.0, 1.2, 0.0], 0.03), ([0.8, 0.3, 0.0], 0.04)] {
        let (ball, first) = (sphere(), open.vertices.len() as u32);
        open.vertices.extend(ball.vertices.iter().map(|v| [0, 1, 2].map(|k| at[k] + size * v[k])));
        open.triangles.extend(ball.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    let fit = human_in(&open);
    let (mean, most) = apart(&heads(&fit.skeleton), &heads(&full.skeleton));
    println!("open, in pieces: mean {:.4}, most {:.4} of its size", mean / height(mesh), most / height(mesh));
    assert!(mean < 0.015 * height(mesh) && most < 0.07 * height(mesh), "{mean} {most}");
}

#[test]
fn how_it_stands_can_be_said_and_nonsense_is_named() {
    let mesh = coarse();
    let human = Template::human().unwrap();
    let told = RigSettings { up: Some([0.0, 2.0, 0.0]), front: Some([0.0, 0.0, -1.0]), ..RigSettings::default() };
    let backwards = fitted(mesh, &human, &told).unwrap();
    assert!(backwards.front[2] < -0.999, "{:?}", backwards.front);
    let heads = heads(&backwards.skeleton);
    assert!(heads["LeftHand"].x < 0.0, "left and right change with the front");
    let along = RigSettings { up: Some([0.0, 1.0, 0.0]), front: Some([0.0, -3.0, 0.0]), ..RigSettings::default() };
    assert_eq!(fitted(mesh, &human, &along), Err(RigError::FrontAlongUp));
    let cancelled = fit(mesh, &human, &RigSettings::default(), &mut |_, _| ControlFlow::Break(()));
    assert!(matches!(cancelled, Err(RigError::Cancelled { .. })));
}

#[test]
fn templates_are_recognised_as_what_they_are() {
    for (template, figure, recognised) in [
        (Template::human(), Figure::Human, 22),
        // All but the tail.
        (Template::quadruped(), Figure::Quadruped, 18),
        // A hand with a stub of its arm.
        (Template::hand(), Figure::Other, 17),
    ] {
        let found = recognise(template.unwrap().skeleton());
        assert_eq!((found.figure, found.count()), (figure, recognised));
    }
    assert_eq!(Template::spider().unwrap().skeleton().len(), 26);
    assert_eq!(Template::new(Skeleton::default()).err(), Some(RigError::NoBones));
}
