//! Clothes over a body: parts that come without weights, or with bad ones, take those of the parts they lie on.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::ops::ControlFlow;
use std::sync::OnceLock;

use armature_character::bind::{BindError, BindMethod, BindSettings, bind};
use armature_character::{Character, Provenance};
use armature_formats::model::{MeshPart, Model, ModelRig};
use armature_geometry::search::TriangleHierarchy;
use armature_geometry::{Influences, TriangleMesh};
use glam::{Affine3A, DVec3, Quat};

fn human() -> &'static Character {
    static HUMAN: OnceLock<Character> = OnceLock::new();
    HUMAN.get_or_init(|| armature_character::own::human().unwrap())
}

fn height() -> f64 {
    let (low, high) = human().surface.mesh.bounds().unwrap();
    high[1] - low[1]
}

fn bind_quietly(model: Model, settings: &BindSettings) -> Result<Character, BindError> {
    bind(model, None, settings, &mut |_, _| ControlFlow::Continue(()))
}

fn dressing() -> BindSettings {
    BindSettings { bind_unbound: true, ..BindSettings::default() }
}

/// The human's weights, with the first bone for these further vertices.
fn with_further(more: usize) -> Influences {
    let own = &human().surface.influences;
    let per_vertex = own.per_vertex();
    let mut bones = own.bones().to_vec();
    let mut weights = own.weights().to_vec();
    for _ in 0..more {
        bones.extend(vec![0; per_vertex]);
        weights.extend((0..per_vertex).map(|slot| if slot == 0 { 1.0 } else { 0.0 }));
    }
    Influences::restore(per_vertex, bones, weights, human().skeleton.len()).unwrap()
}

/// The human and a further mesh that comes without weights.
fn wearing(name: &str, cloth: &TriangleMesh) -> Model {
    let mut mesh = human().surface.mesh.clone();
    let (first, first_triangle) = (mesh.vertices.len() as u32, mesh.triangles.len() as u32);
    mesh.vertices.extend(&cloth.vertices);
    mesh.triangles.extend(cloth.triangles.iter().map(|t| t.map(|v| v + first)));
    let all = (mesh.vertices.len() as u32, mesh.triangles.len() as u32);
    let part =
        |name: &str, vertices, triangles| MeshPart { name: name.into(), vertices, triangles, ..MeshPart::default() };
    let parts = vec![part("body", 0..first, 0..first_triangle), part(name, first..all.0, first_triangle..all.1)];
    let influences = with_further(cloth.vertices.len());
    let rig = ModelRig {
        skeleton: human().skeleton.clone(),
        influences,
        unbound: (first..all.0).collect(),
        ..ModelRig::default()
    };
    Model { name: "dressed".into(), mesh, parts, rig: Some(rig), ..Model::default() }
}

/// The skin between two heights and within this distance of the middle, pushed out by `gap`.
fn shirt(from: f64, to: f64, wide: f64, gap: f64) -> TriangleMesh {
    let surface = &human().surface;
    let inside = |v: u32| {
        let p = surface.mesh.vertices[v as usize];
        (from..to).contains(&(p[1] / height())) && p[0].abs() < wide * height()
    };
    let mut number = vec![u32::MAX; surface.mesh.vertices.len()];
    let mut made = TriangleMesh::default();
    for triangle in surface.mesh.triangles.iter().filter(|t| t.iter().all(|&v| inside(v))) {
        made.triangles.push(triangle.map(|v| {
            let slot = &mut number[v as usize];
            if *slot == u32::MAX {
                *slot = made.vertices.len() as u32;
                let (p, n) = (surface.mesh.vertices[v as usize], surface.normals[v as usize]);
                made.vertices.push(std::array::from_fn(|k| p[k] + gap * f64::from(n[k])));
            }
            *slot
        }));
    }
    assert!(made.triangles.len() > 200, "{}", made.triangles.len());
    made
}

/// The weights of two rows differ by at most this.
fn apart(a: &[(u16, f32)], b: &[(u16, f32)]) -> f32 {
    let of = |row: &[(u16, f32)], bone: u16| row.iter().find(|(own, _)| *own == bone).map_or(0.0, |(_, w)| *w);
    a.iter().chain(b).map(|&(bone, _)| (of(a, bone) - of(b, bone)).abs()).fold(0.0, f32::max)
}

fn row(character: &Character, vertex: usize) -> Vec<(u16, f32)> {
    character.surface.influences.of_vertex(vertex).collect()
}

fn assert_body_kept(character: &Character) {
    let own = human();
    for vertex in 0..own.surface.mesh.vertices.len() {
        let bits = |row: Vec<(u16, f32)>| row.into_iter().map(|(b, w)| (b, w.to_bits())).collect::<Vec<_>>();
        assert_eq!(bits(row(character, vertex)), bits(row(own, vertex)), "painted weights of vertex {vertex}");
    }
}

#[test]
fn coincident_clothes_follow_as_the_body_does() {
    let cloth = shirt(0.45, 0.85, 0.4, 0.0);
    let character = bind_quietly(wearing("shirt", &cloth), &dressing()).unwrap();
    assert_eq!(character.provenance, Provenance::Artist);
    assert_body_kept(&character);
    let first = human().surface.mesh.vertices.len();
    let mut worst = 0.0_f32;
    for (k, place) in cloth.vertices.iter().enumerate() {
        let same = human().surface.mesh.vertices.iter().position(|p| DVec3::from(*p) == DVec3::from(*place)).unwrap();
        worst = worst.max(apart(&row(&character, first + k), &row(human(), same)));
    }
    assert!(worst <= 1e-6, "{worst}");
    let told = character.warnings.join("\n");
    let all = format!("shirt: takes its weights from the parts it lies on: {} vertices", cloth.vertices.len());
    assert!(told.contains("stay as they are: body") && told.contains(&all), "{told}");
}

/// Arms down, elbows and knees bent, back turned.
fn posed(character: &Character, turns: &[(&str, Quat)]) -> Vec<[f32; 3]> {
    let skeleton = &character.skeleton;
    let mut pose = skeleton.rest_pose();
    for (name, turn) in turns {
        let bone = skeleton.find(name).unwrap_or_else(|| panic!("{name}"));
        pose.parent_from_bone[bone].rotation *= *turn;
    }
    let mut world = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut world);
    let (mut positions, mut normals) = (character.rest_positions(), character.surface.normals.clone());
    character.linear_skin().unwrap().solve(&world, &mut positions, &mut normals).unwrap();
    positions
}

#[test]
fn clothes_do_not_poke_through_in_a_pose() {
    let gap = 0.006 * height();
    let cloth = shirt(0.45, 0.83, 0.25, gap);
    let character = bind_quietly(wearing("shirt", &cloth), &dressing()).unwrap();
    let names: Vec<String> = human().skeleton.bones().iter().map(|bone| bone.name.clone()).collect();
    let all: Vec<(&str, Quat)> = names
        .iter()
        .enumerate()
        .map(|(k, name)| (name.as_str(), Quat::from_euler(glam::EulerRot::XYZ, 0.25, 0.2 * (k % 3) as f32 - 0.2, 0.3)))
        .collect();
    let first = human().surface.mesh.vertices.len();
    for some in [&all[..], &all[..all.len() / 2], &all[all.len() / 3..]] {
        let positions = posed(&character, some);
        let place = |p: &[f32; 3]| p.map(f64::from);
        let body = TriangleMesh {
            vertices: positions[..first].iter().map(place).collect(),
            triangles: human().surface.mesh.triangles.clone(),
        };
        let hierarchy = TriangleHierarchy::new(&body).unwrap();
        let mut deepest = 0.0_f64;
        for p in positions[first..].iter().map(place) {
            let near = hierarchy.closest_point(p).unwrap();
            let [a, b, c] = body.triangles[near.triangle as usize].map(|v| DVec3::from(body.vertices[v as usize]));
            let out = (DVec3::from(p) - DVec3::from(near.point)).dot((b - a).cross(c - a));
            if out < 0.0 {
                deepest = deepest.max(near.distance_squared.sqrt());
            }
        }
        assert!(deepest <= gap, "{deepest} inside with a gap of {gap}");
    }
}

#[test]
fn what_an_artist_left_out_is_filled_in() {
    let own = human();
    // A patch of the chest.
    let middle = |v: usize| {
        let p = own.surface.mesh.vertices[v];
        (0.62..0.70).contains(&(p[1] / height())) && p[2] > 0.0 && p[0].abs() < 0.05 * height()
    };
    let unbound: Vec<u32> = (0..own.surface.mesh.vertices.len()).filter(|&v| middle(v)).map(|v| v as u32).collect();
    assert!(unbound.len() > 20, "{}", unbound.len());
    let (mut bones, mut weights) = (own.surface.influences.bones().to_vec(), own.surface.influences.weights().to_vec());
    let per_vertex = own.surface.influences.per_vertex();
    for &v in &unbound {
        let row = v as usize * per_vertex..(v as usize + 1) * per_vertex;
        bones[row.clone()].fill(0);
        weights[row.clone()].fill(0.0);
        weights[row.start] = 1.0;
    }
    let influences = Influences::restore(per_vertex, bones, weights, own.skeleton.len()).unwrap();
    let rig = ModelRig { skeleton: own.skeleton.clone(), influences, unbound: unbound.clone(), ..ModelRig::default() };
    let model = Model { name: "human".into(), mesh: own.surface.mesh.clone(), rig: Some(rig), ..Model::default() };
    let character = bind_quietly(model, &dressing()).unwrap();
    let off: Vec<f32> = unbound.iter().map(|&v| apart(&row(&character, v as usize), &row(own, v as usize))).collect();
    let worst = off.iter().copied().fold(0.0, f32::max);
    assert!(worst < 0.15, "{worst}");
    let told = character.warnings.join("\n");
    assert!(told.contains(&format!("{} vertices that have none get those around them", unbound.len())), "{told}");
}

/// A square below the feet.
fn floor() -> TriangleMesh {
    let (low, _) = human().surface.mesh.bounds().unwrap();
    let wide = 3.0 * height();
    let vertices = vec![[-wide, low[1], -wide], [wide, low[1], -wide], [wide, low[1], wide], [-wide, low[1], wide]];
    TriangleMesh { vertices, triangles: vec![[0, 2, 1], [0, 3, 2]] }
}

#[test]
fn what_does_not_lie_on_the_body_stays_whole() {
    let first = human().surface.mesh.vertices.len();
    let character = bind_quietly(wearing("floor", &floor()), &dressing()).unwrap();
    assert_eq!(row(&character, first), [(0, 1.0)]);
    let told = character.warnings.join("\n");
    let root = &human().skeleton.bones()[0].name;
    assert!(told.contains("floor: has no weights, and only 0 % of it") && told.contains(root), "{told}");
    // Opened without being bound anew, nothing changes, and the user is told.
    let opened = bind_quietly(wearing("floor", &floor()), &BindSettings::default()).unwrap();
    assert_eq!(row(&opened, first), [(0, 1.0)]);
    assert!(opened.warnings.join("\n").contains("no weights come with floor"), "{:?}", opened.warnings);
}

#[test]
fn a_part_can_be_told_to_take_the_weights_of_the_others() {
    let cloth = shirt(0.45, 0.85, 0.4, 0.004 * height());
    let mut model = wearing("shirt", &cloth);
    // Painted, but badly: all on the first bone.
    model.rig.as_mut().unwrap().unbound.clear();
    let first = human().surface.mesh.vertices.len();
    let kept = bind_quietly(model.clone(), &dressing()).unwrap();
    assert_eq!(row(&kept, first), [(0, 1.0)]);
    let settings = BindSettings { transfer: vec!["shirt".into()], ..BindSettings::default() };
    let character = bind_quietly(model.clone(), &settings).unwrap();
    assert_body_kept(&character);
    let near = human().surface.mesh.vertices.iter().enumerate();
    let place = DVec3::from(cloth.vertices[100]);
    let distance = |p: &[f64; 3]| DVec3::from(*p).distance(place);
    let (same, _) = near.min_by(|a, b| distance(a.1).total_cmp(&distance(b.1))).unwrap();
    assert!(apart(&row(&character, first + 100), &row(human(), same)) < 0.2);
    let wrong = BindSettings { transfer: vec!["hat".into()], ..BindSettings::default() };
    let refused = bind_quietly(model.clone(), &wrong).unwrap_err().to_string();
    assert!(refused.contains("no part \"hat\"; it has body, shirt"), "{refused}");

    // Computed for the body alone, the shirt follows it.
    let settings = BindSettings { replace_rig: true, method: BindMethod::BoneHeat, max_influences: 4, ..settings };
    let computed = bind_quietly(model.clone(), &settings).unwrap();
    assert!(matches!(computed.provenance, Provenance::Computed(_)));
    assert!(apart(&row(&computed, first + 100), &row(&computed, same)) < 0.2);
    assert!(computed.warnings.join("\n").contains("shirt: takes its weights"), "{:?}", computed.warnings);
    let both = BindSettings { transfer: vec!["shirt".into(), "body".into()], ..settings };
    assert_eq!(bind_quietly(model, &both), Err(BindError::NothingToTransfer));
}

#[test]
fn painted_weights_are_limited_on_request_alone() {
    let own = human();
    let rig =
        ModelRig { skeleton: own.skeleton.clone(), influences: own.surface.influences.clone(), ..ModelRig::default() };
    let model = Model { name: "human".into(), mesh: own.surface.mesh.clone(), rig: Some(rig), ..Model::default() };
    let most =
        |character: &Character| (0..own.surface.mesh.vertices.len()).map(|v| row(character, v).len()).max().unwrap();
    let kept = bind_quietly(model.clone(), &BindSettings { max_influences: 2, ..BindSettings::default() }).unwrap();
    assert_body_kept(&kept);
    assert!(most(&kept) > 3);
    for limit in [1, 3, 4, 16] {
        let settings = BindSettings { limit_painted: Some(limit), ..BindSettings::default() };
        let limited = bind_quietly(model.clone(), &settings).unwrap();
        assert!(most(&limited) <= limit);
        let told = limited.warnings.iter().any(|text| text.contains(&format!("more than {limit} bones")));
        assert_eq!(told, most(&kept) > limit, "{:?}", limited.warnings);
    }
    let none = BindSettings { limit_painted: Some(0), ..BindSettings::default() };
    assert_eq!(bind_quietly(model, &none), Err(BindError::InfluenceCount(0)));
}
