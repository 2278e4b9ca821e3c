use std::ops::ControlFlow;

use armature_geometry::{Influences, MeshError, TriangleMesh};
use armature_rig::{Bone, BoneStatus, PoseCompletion, PoseMoment, Target, TargetPoint, Transform};
use glam::Vec3;

use super::*;
use crate::bind::BindMethod;
use crate::character::WeightsRecord;
use crate::handle_weights::{BiharmonicTier, DomainKind, WeightsOn};
use crate::inverse_kinematics::InverseKinematics;

/// A closed tube along y from 0 to `length`, of radius 0.2, with pointed ends.
fn tube(length: f64) -> TriangleMesh {
    const AROUND: u32 = 12;
    const RINGS: u32 = 24;
    let mut vertices = vec![[0.0, 0.0, 0.0], [0.0, length, 0.0]];
    for ring in 0..RINGS {
        for k in 0..AROUND {
            let angle = f64::from(k) / f64::from(AROUND) * std::f64::consts::TAU;
            let y = length * (0.02 + 0.96 * f64::from(ring) / f64::from(RINGS - 1));
            vertices.push([0.2 * angle.cos(), y, 0.2 * angle.sin()]);
        }
    }
    let at = |ring: u32, k: u32| 2 + ring * AROUND + k % AROUND;
    let mut triangles = Vec::new();
    for k in 0..AROUND {
        triangles.push([0, at(0, k), at(0, k + 1)]);
        triangles.push([1, at(RINGS - 1, k + 1), at(RINGS - 1, k)]);
        for ring in 0..RINGS - 1 {
            triangles.push([at(ring, k), at(ring + 1, k), at(ring, k + 1)]);
            triangles.push([at(ring + 1, k), at(ring + 1, k + 1), at(ring, k + 1)]);
        }
    }
    TriangleMesh { vertices, triangles }
}

fn bone(name: &str, parent: Option<usize>, at: [f32; 3], tail: [f32; 3]) -> Bone {
    let rest = Transform { translation: at.into(), ..Transform::IDENTITY };
    Bone { name: name.into(), parent, rest, tail: tail.into() }
}

/// A hub at the bottom, two bones above it.
fn arm(scale: f32) -> Skeleton {
    Skeleton::new(vec![
        bone("hub", None, [0.0; 3], [0.0; 3]),
        bone("lower", Some(0), [0.0, 0.1 * scale, 0.0], [0.0, 0.9 * scale, 0.0]),
        bone("upper", Some(1), [0.0, 0.9 * scale, 0.0], [0.0, 0.9 * scale, 0.0]),
    ])
    .unwrap()
}

fn model() -> Model {
    Model { name: "tube".into(), mesh: tube(2.0), ..Model::default() }
}

fn quiet(_: &'static str, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn bind_quietly(model: Model, skeleton: Option<Skeleton>, settings: &BindSettings) -> Result<Character, BindError> {
    bind(model, skeleton, settings, &mut quiet)
}

/// By bone heat.
fn heat() -> BindSettings {
    BindSettings { method: BindMethod::BoneHeat, max_influences: 4, ..BindSettings::default() }
}

/// On a volume small enough for a test.
fn biharmonic() -> BindSettings {
    BindSettings { on: WeightsOn::Volume { vertices: 800 }, ..BindSettings::default() }
}

/// The lower part of the tube follows one bone, the upper part the other, and none the hub.
fn assert_split(character: &Character) {
    for (vertex, p) in character.surface.mesh.vertices.iter().enumerate() {
        let of = |bone: u16| character.surface.influences.of_vertex(vertex).find(|i| i.0 == bone).map_or(0.0, |i| i.1);
        assert!(of(0) == 0.0, "the hub moves vertex {vertex}");
        if p[1] < 0.6 {
            assert!(of(1) > 0.9, "{p:?}: {}", of(1));
        }
        if p[1] > 1.4 {
            assert!(of(2) > 0.9, "{p:?}: {}", of(2));
        }
    }
    assert!(character.surface.normals.iter().all(|n| (Vec3::from(*n).length() - 1.0).abs() < 1e-5));
    assert!(character.linear_skin().is_ok());
}

#[test]
fn heat_splits_the_tube_and_leaves_the_hub_out() {
    let character = bind_quietly(model(), Some(arm(1.0)), &heat()).unwrap();
    assert_split(&character);
    let Provenance::Computed(WeightsRecord::BoneHeat(record)) = character.provenance else { panic!("not by heat") };
    assert!(record.residual < 1e-10 && record.max_influences == 4);
}

#[test]
fn biharmonic_weights_split_the_tube_and_bring_their_certificate() {
    for tier in [BiharmonicTier::Interactive, BiharmonicTier::Certified] {
        let settings = BindSettings { method: BindMethod::Biharmonic(tier), ..biharmonic() };
        let character = bind_quietly(model(), Some(arm(1.0)), &settings).unwrap();
        assert_split(&character);
        assert!(character.warnings.is_empty(), "{:?}", character.warnings);
        let Provenance::Computed(WeightsRecord::Biharmonic(record)) = character.provenance else { panic!("not so") };
        assert_eq!((record.tier, record.domain, record.unconverged), (tier, DomainKind::Volume, 0));
        assert!(record.error_bound <= tier.settings().error_bound && record.energy > 0.0, "{record:?}");
        assert!((300..2000).contains(&record.domain_vertices), "{record:?}");
    }
    let surface = BindSettings { on: WeightsOn::Surface, ..BindSettings::default() };
    let character = bind_quietly(model(), Some(arm(1.0)), &surface).unwrap();
    let Provenance::Computed(WeightsRecord::Biharmonic(record)) = character.provenance else { panic!("not so") };
    assert_eq!(record.domain, DomainKind::Surface);
}

/// A skeleton of separate bones, each from one place to another.
fn bones(ends: &[[[f32; 3]; 2]]) -> Skeleton {
    let one = |(k, &[head, tail]): (usize, &[[f32; 3]; 2])| {
        bone(&format!("b{k}"), None, head, std::array::from_fn(|i| tail[i] - head[i]))
    };
    Skeleton::new(ends.iter().enumerate().map(one).collect()).unwrap()
}

#[test]
fn odd_bones_are_told_and_the_others_do_their_work() {
    let inside = [[0.0, 0.2, 0.0], [0.0, 1.0, 0.0]];
    let upper = [[0.0, 1.0, 0.0], [0.0, 1.8, 0.0]];
    let beside = [[0.5, 0.5, 0.0], [0.5, 1.2, 0.0]];
    let nothing = [[0.0, 1.0, 0.0]; 2];
    let bound = |ends: &[[[f32; 3]; 2]]| bind_quietly(model(), Some(bones(ends)), &biharmonic()).unwrap();
    let told = |character: &Character, text: &str| {
        assert!(character.warnings.iter().any(|w| w.contains(text)), "{text:?}: {:?}", character.warnings);
    };
    let outside = bound(&[inside, upper, beside]);
    told(&outside, "these bones are outside the shape: b2");
    let short = bound(&[inside, upper, nothing]);
    told(&short, "these bones have no length, so they move nothing: b2");
    let twice = bound(&[inside, upper, upper]);
    told(&twice, "these bones are at the same place and share its weights equally: b1, b2");
    for (vertex, p) in twice.surface.mesh.vertices.iter().enumerate() {
        let of = |bone: u16| twice.surface.influences.of_vertex(vertex).find(|i| i.0 == bone).map_or(0.0, |i| i.1);
        assert!((of(1) - of(2)).abs() < 5e-3, "{p:?}: {} and {}", of(1), of(2));
    }
}

/// A bone below, a point above, as in the thesis' figure 4.9: each holds its own part, and the dragged point pulls it along
/// while the bone stays.
#[test]
fn a_point_is_a_handle_beside_bones_and_can_be_dragged() {
    let skeleton = |point: [f32; 3]| {
        Skeleton::new(vec![
            bone("lower", None, [0.0, 0.2, 0.0], [0.0, 0.8, 0.0]),
            bone("point_3", None, point, [0.0; 3]),
        ])
        .unwrap()
    };
    let character = bind_quietly(model(), Some(skeleton([0.0, 1.7, 0.0])), &biharmonic()).unwrap();
    assert_eq!(character.warnings, Vec::<String>::new());
    let of = |vertex: usize, bone: u16| {
        character.surface.influences.of_vertex(vertex).find(|i| i.0 == bone).map_or(0.0, |i| i.1)
    };
    for (vertex, p) in character.surface.mesh.vertices.iter().enumerate() {
        assert!(p[1] > 0.8 || of(vertex, 0) > 0.9, "{p:?}");
        assert!(p[1] < 1.7 || of(vertex, 1) > 0.9, "{p:?}");
    }
    let mut ik = InverseKinematics::new(&character, &[]).unwrap();
    let to = Vec3::new(0.3, 1.8, 0.1);
    let target = Target { point: TargetPoint::Head(1), position: Some(to), orientation: None, strength: 1.0 };
    ik.set_target(target, 0).unwrap();
    assert!(!ik.holds_root(), "no foot stands on a point");
    let mut pose = character.skeleton.rest_pose();
    ik.complete(PoseMoment::default(), &[BoneStatus::default(); 2], &mut pose);
    assert_eq!(pose.parent_from_bone[0], character.skeleton.bones()[0].rest);
    assert!(pose.parent_from_bone[1].translation.distance(to) < 1e-5, "{}", pose.parent_from_bone[1].translation);
    // Far away from the mesh it is a mark, not a handle.
    let away = bind_quietly(model(), Some(skeleton([5.0, 0.0, 0.0])), &biharmonic()).unwrap();
    assert!(away.warnings.iter().any(|warning| warning.contains("point_3")), "{:?}", away.warnings);
    // Bone heat knows only bones, and says so.
    let hot = bind_quietly(model(), Some(skeleton([0.0, 1.7, 0.0])), &heat()).unwrap();
    assert!(hot.warnings.iter().any(|warning| warning.contains("point_3")), "{:?}", hot.warnings);
}

#[test]
fn a_piece_without_a_bone_follows_its_nearest_rigidly() {
    let mut both = model();
    let count = both.mesh.vertices.len() as u32;
    let second = tube(2.0);
    both.mesh.vertices.extend(second.vertices.iter().map(|p| [p[0] + 0.6, 0.25 * p[1] + 1.4, p[2]]));
    both.mesh.triangles.extend(second.triangles.iter().map(|t| t.map(|v| v + count)));
    let character = bind_quietly(both, Some(arm(1.0)), &biharmonic()).unwrap();
    for vertex in count as usize..character.surface.mesh.vertices.len() {
        assert_eq!(character.surface.influences.of_vertex(vertex).collect::<Vec<_>>(), [(2, 1.0)], "vertex {vertex}");
    }
    let told = "a piece of the shape contains no bone and follows the nearest one rigidly: upper";
    assert!(character.warnings.iter().any(|w| w == told), "{:?}", character.warnings);
}

#[test]
fn a_flat_figure_is_bound_on_its_triangles() {
    let at = |k: u32| [f64::from(k % 3), f64::from(k / 3), 0.0];
    let vertices: Vec<[f64; 3]> = (0..27).map(at).collect();
    let squares = (0..24_u32).filter(|k| k % 3 < 2);
    let triangles = squares.flat_map(|k| [[k, k + 1, k + 4], [k, k + 4, k + 3]]).collect();
    let flat = Model { mesh: TriangleMesh { vertices, triangles }, ..Model::default() };
    let skeleton = bones(&[[[1.0, 0.5, 0.0], [1.0, 4.0, 0.0]], [[1.0, 4.0, 0.0], [1.0, 7.5, 0.0]]]);
    let character = bind_quietly(flat, Some(skeleton), &biharmonic()).unwrap();
    let Provenance::Computed(WeightsRecord::Biharmonic(record)) = character.provenance else { panic!("not so") };
    assert_eq!((record.domain, record.unconverged), (DomainKind::Flat, 0));
    for (vertex, p) in character.surface.mesh.vertices.iter().enumerate() {
        let lower = character.surface.influences.of_vertex(vertex).find(|i| i.0 == 0).map_or(0.0, |i| i.1);
        let expected = if p[1] < 2.0 {
            0.9..=1.0
        } else if p[1] > 6.0 {
            0.0..=0.1
        } else {
            0.0..=1.0
        };
        assert!(expected.contains(&lower), "{p:?} follows the lower bone by {lower}");
    }
}

#[test]
fn an_artists_rig_is_kept_unless_told_otherwise() {
    let rows = model().mesh.vertices.len();
    let influences = Influences::new(1, vec![2; rows], vec![1.0; rows], 3).unwrap();
    let rig = ModelRig { skeleton: arm(1.0), influences: influences.clone(), ..ModelRig::default() };
    let rigged = Model { rig: Some(rig), ..model() };
    let other = Skeleton::new(vec![bone("only", None, [0.0, 0.5, 0.0], [0.0, 1.0, 0.0])]).unwrap();

    let kept = bind_quietly(rigged.clone(), Some(other.clone()), &BindSettings::default()).unwrap();
    assert_eq!((kept.provenance, &kept.surface.influences, kept.skeleton.len()), (Provenance::Artist, &influences, 3));
    assert!(kept.warnings[0].contains("was ignored"), "{:?}", kept.warnings);

    let replace = BindSettings { replace_rig: true, ..heat() };
    let given = bind_quietly(rigged.clone(), Some(other), &replace).unwrap();
    assert_eq!(given.skeleton.len(), 1);
    let own = bind_quietly(rigged, None, &replace).unwrap();
    assert_eq!(own.skeleton.len(), 3);
    assert!(
        matches!(own.provenance, Provenance::Computed(WeightsRecord::BoneHeat(_)))
            && own.surface.influences != influences
    );
}

#[test]
fn each_trouble_has_its_name_and_remedy() {
    let settings = biharmonic();
    let error = |model, skeleton| bind_quietly(model, skeleton, &settings).unwrap_err();
    assert_eq!(error(model(), None), BindError::NoSkeleton);
    assert!(BindError::NoSkeleton.to_string().contains("TGF"));
    assert_eq!(error(model(), Some(Skeleton::default())), BindError::NoSkeleton);
    let hub = Skeleton::new(vec![bone("hub", None, [0.0; 3], [0.0; 3])]).unwrap();
    assert_eq!(error(model(), Some(hub)), BindError::NoBoneWithLength { bones: 1 });

    let mut points = model();
    points.mesh.triangles.clear();
    assert_eq!(error(points, Some(arm(1.0))), BindError::NoSurface { vertices: 290, faces: 0 });
    let mut broken = model();
    broken.mesh.vertices[3][1] = f64::NAN;
    assert_eq!(error(broken, Some(arm(1.0))), BindError::Mesh(MeshError::NotFinite { vertex: 3 }));

    let centimetres = error(model(), Some(arm(100.0)));
    assert!(matches!(centimetres, BindError::Misfit(m) if (m.times_larger() - 87.0).abs() < 2.0), "{centimetres}");
    assert!(centimetres.to_string().contains("scale one of them"), "{centimetres}");

    let few = BindSettings { max_influences: 0, ..settings.clone() };
    assert_eq!(bind_quietly(model(), Some(arm(1.0)), &few), Err(BindError::InfluenceCount(0)));

    let wrong = Model { normals: Some(vec![[0.0; 3]; 7]), ..model() };
    assert_eq!(error(wrong, Some(arm(1.0))), BindError::Inconsistent { what: "normals" });
    let split = armature_formats::model::Split { mesh_vertex: vec![0, 1, 999], triangles: vec![[0, 1, 2]] };
    let wrong = Model { split: Some(split), ..model() };
    assert_eq!(error(wrong, Some(arm(1.0))), BindError::Inconsistent { what: "drawn vertices" });
}

#[test]
fn every_report_may_stop_the_work_and_progress_never_falls() {
    for settings in [heat(), biharmonic()] {
        let mut stages = Vec::new();
        let mut all = |stage: &'static str, done: f64| {
            stages.push((stage, done));
            ControlFlow::Continue(())
        };
        bind(model(), Some(arm(1.0)), &settings, &mut all).unwrap();
        assert!(stages.windows(2).all(|w| w[0].1 <= w[1].1), "{stages:?}");
        assert!((stages[stages.len() - 1].1 - 1.0).abs() < 1e-12);
        // The first report of each stage.
        let first = (0..stages.len()).filter(|&k| k == 0 || stages[k].0 != stages[k - 1].0);
        for stop_at in first {
            let mut left = stop_at;
            let mut stop = |_: &'static str, _: f64| {
                if left == 0 {
                    return ControlFlow::Break(());
                }
                left -= 1;
                ControlFlow::Continue(())
            };
            let stopped = bind(model(), Some(arm(1.0)), &settings, &mut stop);
            assert_eq!(stopped, Err(BindError::Cancelled { stage: stages[stop_at].0 }));
        }
    }
}

#[test]
fn inner_points_of_a_volume_are_left_out() {
    let mut with_loose = model();
    with_loose.mesh.vertices.insert(1, [0.0, 1.0, 0.0]);
    with_loose.mesh.triangles.iter_mut().flatten().for_each(|v| *v += u32::from(*v >= 1));
    let loose = bind_quietly(with_loose, Some(arm(1.0)), &biharmonic()).unwrap();
    let plain = bind_quietly(model(), Some(arm(1.0)), &biharmonic()).unwrap();
    assert_eq!((&loose.surface.mesh, &loose.surface.influences), (&plain.surface.mesh, &plain.surface.influences));
    assert!(loose.warnings[0].starts_with("1 vertices belong to no face"), "{:?}", loose.warnings);
}

#[test]
fn seams_are_split_after_binding() {
    let mut seamed = model();
    let count = seamed.mesh.vertices.len() as u32;
    let mut triangles = seamed.mesh.triangles.clone();
    triangles[0][0] = count;
    let mut mesh_vertex: Vec<u32> = (0..count).collect();
    mesh_vertex.push(0);
    seamed.texture_coordinates = Some((0..=count).map(|k| [k as f32 / 300.0, 0.5]).collect());
    seamed.split = Some(armature_formats::model::Split { mesh_vertex, triangles: triangles.clone() });
    let character = bind_quietly(seamed, Some(arm(1.0)), &biharmonic()).unwrap();
    assert_eq!(character.surface.mesh.vertices.len(), count as usize + 1);
    assert_eq!(character.surface.mesh.triangles, triangles);
    assert_eq!(character.surface.normals.len(), count as usize + 1);
    let rows: Vec<Vec<_>> =
        [0, count as usize].iter().map(|&v| character.surface.influences.of_vertex(v).collect()).collect();
    assert_eq!(rows[0], rows[1]);
}
