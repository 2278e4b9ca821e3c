use armature_rig::{Bone, Transform};
use glam::Vec3;

use super::*;

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

fn quiet(_: BindProgress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn bind_quietly(model: Model, skeleton: Option<Skeleton>, settings: &BindSettings) -> Result<Character, BindError> {
    bind(model, skeleton, settings, &mut quiet)
}

#[test]
fn heat_splits_the_tube_and_leaves_the_hub_out() {
    let character = bind_quietly(model(), Some(arm(1.0)), &BindSettings::default()).unwrap();
    for (vertex, p) in character.mesh.vertices.iter().enumerate() {
        let of = |bone: u16| character.influences.of_vertex(vertex).find(|i| i.0 == bone).map_or(0.0, |i| i.1);
        assert!(of(0) == 0.0, "the hub moves vertex {vertex}");
        if p[1] < 0.6 {
            assert!(of(1) > 0.9, "{p:?}");
        }
        if p[1] > 1.4 {
            assert!(of(2) > 0.9, "{p:?}");
        }
    }
    assert!(matches!(character.provenance, Provenance::BoneHeat(r) if r.residual < 1e-10 && r.max_influences == 4));
    assert!(character.normals.iter().all(|n| (Vec3::from(*n).length() - 1.0).abs() < 1e-5));
    assert!(character.skin().is_ok());
}

#[test]
fn an_artists_rig_is_kept_unless_told_otherwise() {
    let rows = model().mesh.vertices.len();
    let influences = Influences::new(1, vec![2; rows], vec![1.0; rows], 3).unwrap();
    let rig = ModelRig { skeleton: arm(1.0), influences: influences.clone() };
    let rigged = Model { rig: Some(rig), ..model() };
    let other = Skeleton::new(vec![bone("only", None, [0.0, 0.5, 0.0], [0.0, 1.0, 0.0])]).unwrap();

    let kept = bind_quietly(rigged.clone(), Some(other.clone()), &BindSettings::default()).unwrap();
    assert_eq!((kept.provenance, &kept.influences, kept.skeleton.len()), (Provenance::Artist, &influences, 3));
    assert!(kept.warnings[0].contains("left aside"), "{:?}", kept.warnings);

    let replace = BindSettings { replace_rig: true, ..BindSettings::default() };
    let given = bind_quietly(rigged.clone(), Some(other), &replace).unwrap();
    assert_eq!(given.skeleton.len(), 1);
    let own = bind_quietly(rigged, None, &replace).unwrap();
    assert_eq!(own.skeleton.len(), 3);
    assert!(matches!(own.provenance, Provenance::BoneHeat(_)) && own.influences != influences);
}

#[test]
fn each_trouble_has_its_name_and_remedy() {
    let settings = BindSettings::default();
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
    let split = armature_formats::Split { mesh_vertex: vec![0, 1, 999], triangles: vec![[0, 1, 2]] };
    let wrong = Model { split: Some(split), ..model() };
    assert_eq!(error(wrong, Some(arm(1.0))), BindError::Inconsistent { what: "drawn vertices" });
}

#[test]
fn every_report_may_stop_the_work_and_progress_never_falls() {
    let mut stages = Vec::new();
    let mut all = |p: BindProgress| {
        stages.push(p);
        ControlFlow::Continue(())
    };
    bind(model(), Some(arm(1.0)), &BindSettings::default(), &mut all).unwrap();
    assert!(stages.windows(2).all(|w| w[0].done <= w[1].done), "{stages:?}");
    assert!((stages[stages.len() - 1].done - 1.0).abs() < 1e-12);
    for stop_at in 0..stages.len() {
        let mut left = stop_at;
        let mut stop = |_: BindProgress| {
            if left == 0 {
                return ControlFlow::Break(());
            }
            left -= 1;
            ControlFlow::Continue(())
        };
        let stopped = bind(model(), Some(arm(1.0)), &BindSettings::default(), &mut stop);
        assert_eq!(stopped, Err(BindError::Cancelled { stage: stages[stop_at].stage }));
    }
}

#[test]
fn inner_points_of_a_volume_are_left_out() {
    let mut with_loose = model();
    with_loose.mesh.vertices.insert(1, [0.0, 1.0, 0.0]);
    with_loose.mesh.triangles.iter_mut().flatten().for_each(|v| *v += u32::from(*v >= 1));
    let loose = bind_quietly(with_loose, Some(arm(1.0)), &BindSettings::default()).unwrap();
    let plain = bind_quietly(model(), Some(arm(1.0)), &BindSettings::default()).unwrap();
    assert_eq!((&loose.mesh, &loose.influences), (&plain.mesh, &plain.influences));
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
    seamed.split = Some(armature_formats::Split { mesh_vertex, triangles: triangles.clone() });
    let character = bind_quietly(seamed, Some(arm(1.0)), &BindSettings::default()).unwrap();
    assert_eq!(character.mesh.vertices.len(), count as usize + 1);
    assert_eq!(character.mesh.triangles, triangles);
    assert_eq!(character.normals.len(), count as usize + 1);
    let rows: Vec<Vec<_>> = [0, count as usize].iter().map(|&v| character.influences.of_vertex(v).collect()).collect();
    assert_eq!(rows[0], rows[1]);
}
