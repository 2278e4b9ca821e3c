//! Whole shapes posed by a handful of points (thesis chapter 7): no bone is posed directly. Only where a few points of
//! the skin go is given, and the transformations of all bones follow from the shape.
//!
//! `cargo run --release --example posed_by_few [-- FOLDER]` writes one picture each: an elephant held at its feet and
//! led by the tip of its trunk; a human led by head, hands and soles; the same human on a skeleton of bones that do not
//! hang together; and a hundred armadillos. Shared meshes are read from `../shared/data` and left out where it is
//! absent.

use std::error::Error;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use armature::characters::{self, LoadedCharacter};
use armature::files::inputs;
use armature::pictures::{Skinned, View, draw, draw_mesh};
use armature_character::Character;
use armature_character::bind::BindSettings;
use armature_deform::arap::{
    Anchor, ArapEnergy, ArapSettings, ArapShape, ArapStop, ArapWeights, HandleConstraint, ReducedArap, SharedJoint,
};
use armature_formats::model::Model;
use armature_render::{Material, MeshView, encode_png};
use armature_rig::{Bone, Skeleton, Transform};
use glam::{Affine3A, Quat, Vec3};

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Steps from rest to the targets; each starts from the previous pose, as frames do.
const WAY: usize = 24;
const STEPS_ON_THE_WAY: ArapStop = ArapStop { iterations: 100, tolerance: 1e-6 };
/// As many as the thesis takes per frame.
const STEPS_A_FRAME: ArapStop = ArapStop { iterations: 15, tolerance: 0.0 };
const CROWD: usize = 10;

fn main() -> Outcome<()> {
    let folder = std::env::args().nth(1).map_or_else(|| PathBuf::from("posed-by-few"), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    let human = found(characters::find("human", &mut |_, _| ControlFlow::Continue(())))?.character;
    let human = human.shape.ok_or("the human has a mesh")?.character;
    reach_up(&human, &human.skeleton, &folder.join("human.png"))?;
    reach_up(&loose_bones(&human)?, &human.skeleton, &folder.join("loose-bones.png"))?;
    match (shared("elephant"), shared("armadillo")) {
        (Some(elephant), Some(armadillo)) => {
            lead_by_the_trunk(&elephant?, &folder.join("elephant.png"))?;
            hundred(&armadillo?, &folder.join("armadillos.png"))?;
        }
        _ => println!("../shared/data is not here: no elephant and no armadillos"),
    }
    Ok(())
}

fn found<T>(result: Result<T, armature::failure::Failure>) -> Outcome<T> {
    result.map_err(|failure| failure.what.into())
}

/// A mesh of the shared data bound to its skeleton, or taken from the cache; `None` without the data.
fn shared(name: &str) -> Option<Outcome<Character>> {
    let file = |extension: &str| Path::new("../shared/data").join(format!("{name}.{extension}"));
    let (mesh, bones) = (file("obj"), file("tgf"));
    if !(mesh.exists() && bones.exists()) {
        return None;
    }
    let bound = inputs::model(&mesh).and_then(|model| {
        let go_on = &mut |_: &'static str, _: f64| ControlFlow::Continue(());
        characters::bind_cached(
            model,
            b"",
            &mesh,
            Some(characters::Given::File(&bones)),
            &BindSettings::default(),
            true,
            go_on,
        )
    });
    Some(found(bound).map(|bound| bound.character))
}

/// A character reduced to its bones, all of them free.
fn reduce(character: &Character) -> Outcome<ReducedArap> {
    let skeleton = &character.skeleton;
    let bones = skeleton.len();
    let mut weights = vec![0.0; character.surface.mesh.vertices.len() * bones];
    for (vertex, row) in weights.chunks_exact_mut(bones).enumerate() {
        character.surface.influences.of_vertex(vertex).for_each(|(bone, w)| row[usize::from(bone)] = f64::from(w));
    }
    let heads: Vec<[f64; 3]> = skeleton.rest_segments().iter().map(|(head, _)| head.as_dvec3().to_array()).collect();
    let parents = skeleton.bones().iter().enumerate().filter_map(|(bone, b)| Some((bone, b.parent?)));
    let joints: Vec<SharedJoint> =
        parents.map(|(bone, parent)| SharedJoint { handles: [parent, bone], point: heads[bone] }).collect();
    let shape = ArapShape {
        positions: &character.surface.mesh.vertices,
        energy: ArapEnergy::SpokesAndRims(&character.surface.mesh.triangles),
        weights: ArapWeights::Matrix(&weights),
        handle_points: &heads,
        joints: &joints,
    };
    Ok(ReducedArap::precompute(&shape, &ArapSettings::default(), &mut |_, _| ControlFlow::Continue(()))?)
}

/// The vertex nearest to a point, as something to hold.
fn held_at(character: &Character, point: Vec3) -> (Anchor, Vec3) {
    let place = |v: &[f64; 3]| Vec3::from_array(v.map(|c| c as f32));
    let vertices = character.surface.mesh.vertices.iter().map(place).enumerate();
    let (vertex, at) = vertices.min_by(|a, b| a.1.distance(point).total_cmp(&b.1.distance(point))).unwrap_or_default();
    (Anchor::on_shape([vertex as u32; 3], [1.0, 0.0, 0.0]), at)
}

/// Leads points of the skin from where they are to `targets`, and draws where everything else went.
fn lead(character: &Character, pulls: &[(Vec3, Vec3)], view: &View, picture: &Path) -> Outcome<()> {
    let began = Instant::now();
    let mut arap = reduce(character)?;
    let prepared = began.elapsed();
    let held: Vec<(Anchor, Vec3)> = pulls.iter().map(|(from, _)| held_at(character, *from)).collect();
    let anchors: Vec<Anchor> = held.iter().map(|(anchor, _)| anchor.clone()).collect();
    let began = Instant::now();
    arap.constrain(&vec![HandleConstraint::Free; arap.handle_count()], &anchors)?;
    let switched = began.elapsed();
    let at_rest = vec![Affine3A::IDENTITY; arap.handle_count()];
    let mut report = None;
    for step in 1..=WAY {
        let part = step as f32 / WAY as f32;
        // What a pull reports about its own point holds for the vertex nearest to it.
        let way = held.iter().zip(pulls).map(|((_, at), (from, to))| *at + (*to - *from) * part);
        let targets: Vec<Vec3> = way.collect();
        report = Some(arap.solve(&at_rest, &targets, STEPS_ON_THE_WAY)?);
    }
    let (positions, normals) = skinned(character, arap.transforms())?;
    let (loaded, _) = LoadedCharacter::bound(&character.name, character.clone());
    let shape = loaded.shape.as_ref().ok_or("a character has a mesh")?;
    std::fs::write(picture, encode_png(&draw(shape, &positions, &normals, view)?.0)?)?;
    println!(
        "{}: {} bones by {} points, {} clusters, prepared in {prepared:.2?}, switched in {switched:.2?}, {:?}",
        picture.display(),
        arap.handle_count(),
        pulls.len(),
        arap.cluster_count(),
        report.map(|r| (r.outcome, r.energy, r.warnings))
    );
    Ok(())
}

fn skinned(character: &Character, model_from_rest: &[Affine3A]) -> Outcome<Skinned> {
    let rest = character.skeleton.rest_model_from_bone();
    let frames: Vec<Affine3A> = model_from_rest.iter().zip(&rest).map(|(map, rest)| *map * *rest).collect();
    let (mut positions, mut normals) = (character.rest_positions(), character.surface.normals.clone());
    character.linear_skin()?.solve(&frames, &mut positions, &mut normals)?;
    Ok((positions, normals))
}

/// A human steps forward and reaches up: one point of the head, one of each hand, heel and ball of each foot.
fn reach_up(human: &Character, body: &Skeleton, picture: &Path) -> Outcome<()> {
    let segments = body.rest_segments();
    let ends = |name: &str| body.find(name).map(|bone| segments[bone]).ok_or_else(|| format!("there is no {name}"));
    let (head, crown) = ends("Head")?;
    let mut pulls = vec![(head.midpoint(crown), head.midpoint(crown) + Vec3::new(0.0, -0.07, 0.03))];
    let left = ("LeftHand", Vec3::new(0.34, 1.88, 0.16), "LeftFoot", -0.22);
    let right = ("RightHand", Vec3::new(-0.38, 0.98, 0.22), "RightFoot", 0.28);
    for (hand, reach, foot, step) in [left, right] {
        let (wrist, knuckles) = ends(hand)?;
        pulls.push((wrist.midpoint(knuckles), reach));
        let (ankle, ball) = ends(foot)?;
        let heel = Vec3::new(ankle.x, 0.0, ankle.z - 0.04);
        for sole in [heel, Vec3::new(ball.x, 0.0, ball.z)] {
            pulls.push((sole, sole + Vec3::Z * step));
        }
    }
    let view = View { size: [720, 720], yaw: 0.9, closer: 0.95, floor: Some(0.0), ..View::default() };
    lead(human, &pulls, &view, picture)
}

/// The same body on six bones, none attached to another.
fn loose_bones(human: &Character) -> Outcome<Character> {
    let segments = human.skeleton.rest_segments();
    let mut bones = Vec::new();
    for name in ["Head", "Chest", "LeftHand", "RightHand", "LeftFoot", "RightFoot"] {
        let bone = human.skeleton.find(name).ok_or_else(|| format!("there is no {name}"))?;
        let (head, tail) = segments[bone];
        let rest = Transform { translation: head, ..Transform::IDENTITY };
        bones.push(Bone { name: name.into(), parent: None, rest, tail: tail - head });
    }
    let model = Model {
        name: "loose bones".into(),
        mesh: human.surface.mesh.clone(),
        normals: Some(human.surface.normals.clone()),
        materials: human.materials.clone(),
        ..Model::default()
    };
    let go_on = &mut |_: &'static str, _: f64| ControlFlow::Continue(());
    Ok(armature_character::bind::bind(model, Some(Skeleton::new(bones)?), &BindSettings::default(), go_on)?)
}

/// Ends of the skeleton's leaves, lowest first.
fn leaf_ends(skeleton: &Skeleton) -> Vec<Vec3> {
    let segments = skeleton.rest_segments();
    let leaves = (0..skeleton.len()).filter(|&bone| skeleton.children(bone).next().is_none());
    let mut ends: Vec<Vec3> = leaves.map(|bone| segments[bone].1).collect();
    ends.sort_by(|a, b| a.y.total_cmp(&b.y));
    ends
}

/// An elephant stands on its hind feet, holds its forefeet where they are, and lifts the tip of its trunk.
fn lead_by_the_trunk(elephant: &Character, picture: &Path) -> Outcome<()> {
    let place = |v: &[f64; 3]| Vec3::from_array(v.map(|c| c as f32));
    let vertices = || elephant.surface.mesh.vertices.iter().map(place);
    let Some(trunk) = vertices().max_by(|a, b| a.z.total_cmp(&b.z)) else { return Err("the elephant is empty".into()) };
    let top = vertices().map(|v| v.y).fold(f32::MIN, f32::max);
    // Feet are the ends of the skeleton; the highest of these is the top of the head and left alone.
    let mut feet = leaf_ends(&elephant.skeleton);
    feet.pop();
    let mut pulls: Vec<(Vec3, Vec3)> = feet.iter().map(|end| (*end, *end)).collect();
    pulls.push((trunk, trunk + Vec3::new(0.22, 0.26, -0.06) * top));
    lead(elephant, &pulls, &View { size: [720, 720], yaw: 0.6, ..View::default() }, picture)
}

/// A hundred armadillos, each led by its own points to the same beat.
fn hundred(armadillo: &Character, picture: &Path) -> Outcome<()> {
    let one = reduce(armadillo)?;
    let ends = leaf_ends(&armadillo.skeleton);
    let held: Vec<(Anchor, Vec3)> = ends.iter().map(|end| held_at(armadillo, *end)).collect();
    let anchors: Vec<Anchor> = held.iter().map(|(anchor, _)| anchor.clone()).collect();
    let mut crowd = vec![one; CROWD * CROWD];
    for each in &mut crowd {
        each.constrain(&vec![HandleConstraint::Free; each.handle_count()], &anchors)?;
    }
    let at_rest = vec![Affine3A::IDENTITY; armadillo.skeleton.len()];
    let frames = 40_usize;
    let mut targets = vec![Vec3::ZERO; held.len()];
    let mut seconds = 0.0;
    for frame in 0..=frames {
        for (number, each) in crowd.iter_mut().enumerate() {
            let beat = 0.12 * frame as f32 + 0.7 * number as f32;
            for (k, (target, (_, at))) in targets.iter_mut().zip(&held).enumerate() {
                // The lowest two are the feet it stands on.
                let sway = Vec3::new((beat + k as f32).sin(), (1.3 * beat + 2.0 * k as f32).cos(), (0.7 * beat).sin());
                *target = *at + if k < 2 { Vec3::ZERO } else { 0.16 * sway };
            }
            let began = Instant::now();
            each.solve(&at_rest, &targets, STEPS_A_FRAME)?;
            seconds += began.elapsed().as_secs_f64();
        }
    }
    let poses = (frames + 1) as f64;
    println!("{}: {:.0} poses of the whole crowd a second, 15 steps each", picture.display(), poses / seconds);
    draw_crowd(armadillo, &crowd, picture)
}

fn draw_crowd(armadillo: &Character, crowd: &[ReducedArap], picture: &Path) -> Outcome<()> {
    let vertices = armadillo.surface.mesh.vertices.len() as u32;
    let (mut all_positions, mut all_normals, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for (number, each) in crowd.iter().enumerate() {
        let (positions, normals) = skinned(armadillo, each.transforms())?;
        let (row, column) = ((number / CROWD) as f32, (number % CROWD) as f32);
        let turn = Quat::from_rotation_y(0.5 * (1.7 * number as f32).sin());
        let place = Vec3::new(1.15 * (column - 4.5), 0.0, -1.15 * row);
        all_positions.extend(positions.iter().map(|p| (turn * Vec3::from(*p) + place).to_array()));
        all_normals.extend(normals.iter().map(|n| (turn * Vec3::from(*n)).to_array()));
        let first = number as u32 * vertices;
        triangles.extend(armadillo.surface.mesh.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    let mesh = MeshView {
        positions: &all_positions,
        normals: &all_normals,
        triangles: &triangles,
        materials: &[Material::of_color([0.46, 0.55, 0.42])],
        ..MeshView::default()
    };
    let view = View { size: [1280, 720], yaw: 0.35, pitch: 0.32, closer: 0.74, floor: None };
    std::fs::write(picture, encode_png(&draw_mesh(&mesh, &view)?.0)?)?;
    Ok(())
}
