//! The characters that the program makes itself: closed, even triangles; bones inside; clean weights; always the same.

#![expect(clippy::unwrap_used, reason = "a test may fail by panic")]

use std::collections::BTreeMap;
use std::sync::LazyLock;

use armature_character::cache::{from_bytes, to_bytes};
use armature_character::own::{hand, human, spider};
use armature_character::{Character, Provenance, WeightsRecord};
use armature_geometry::surface::{connected_components, diagnose};
use glam::{DVec3, Vec3};

static ALL: LazyLock<[Character; 3]> = LazyLock::new(|| [human().unwrap(), spider().unwrap(), hand().unwrap()]);

fn weight(character: &Character, vertex: usize, bone: &str) -> f32 {
    let bone = character.skeleton.find(bone).unwrap_or_else(|| panic!("there is no bone {bone}"));
    character.surface.influences.of_vertex(vertex).find(|(b, _)| usize::from(*b) == bone).map_or(0.0, |(_, w)| w)
}

fn positions(character: &Character) -> impl Iterator<Item = (usize, DVec3)> + '_ {
    character.surface.mesh.vertices.iter().map(|p| DVec3::from(*p)).enumerate()
}

/// How often the surface winds around a point: 1 inside, 0 outside (solid angles of all triangles).
fn winding(character: &Character, p: DVec3) -> f64 {
    let angle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| DVec3::from(character.surface.mesh.vertices[v as usize]) - p);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * a.dot(b.cross(c)).atan2(below)
    };
    character.surface.mesh.triangles.iter().map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

#[test]
fn each_is_one_closed_surface_without_handles() {
    for character in ALL.iter() {
        let mesh = &character.surface.mesh;
        let found = diagnose(mesh).unwrap();
        assert!(found.closed && found.signed_volume > 0.0, "{}: {found:?}", character.name);
        assert_eq!(found.euler_characteristic, 2, "{}", character.name);
        assert_eq!((found.non_manifold_vertices, found.duplicate_vertices, found.isolated_vertices), (0, 0, 0));
        assert_eq!(connected_components(mesh.vertices.len(), &mesh.triangles).count, 1, "{}", character.name);
        let count = mesh.triangles.len();
        assert!((10_000..=20_000).contains(&count), "{} has {count} triangles", character.name);
    }
}

#[test]
fn triangles_are_well_shaped_and_normals_agree_with_them() {
    for character in ALL.iter() {
        let mut shapes = Vec::new();
        let (mut corners, mut against) = (0, 0);
        for t in &character.surface.mesh.triangles {
            let [a, b, c] = t.map(|v| DVec3::from(character.surface.mesh.vertices[v as usize]));
            let area_2 = (b - a).cross(c - a);
            let squares = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
            shapes.push(2.0 * 3.0_f64.sqrt() * area_2.length() / squares);
            for &v in t {
                let normal = Vec3::from(character.surface.normals[v as usize]).as_dvec3();
                assert!((normal.length() - 1.0).abs() < 1e-5);
                corners += 1;
                against += usize::from(normal.dot(area_2.normalize()) < 0.1);
            }
        }
        // The webs between fingers are as narrow as a triangle, and fold.
        assert!(against * 2000 < corners, "{}: {against} of {corners}", character.name);
        shapes.sort_by(f64::total_cmp);
        // 1 is an equilateral triangle, 0 a needle.
        assert!(shapes[0] > 0.3, "{}: worst triangle {}", character.name, shapes[0]);
        assert!(shapes[shapes.len() / 50] > 0.8, "{}", character.name);
    }
}

#[test]
fn each_stands_where_it_is_said_to_stand() {
    let [human, spider, hand] = &*ALL;
    let size = |c: &Character| {
        let (low, high) = c.surface.mesh.bounds().unwrap();
        (DVec3::from(low), DVec3::from(high))
    };
    let (low, high) = size(human);
    assert!(low.y.abs() < 0.005 && (high.y - 1.75).abs() < 0.01, "{low} {high}");
    // The arms span about as much as the figure is tall.
    assert!((high.x - low.x - 1.75).abs() < 0.06, "{low} {high}");
    let (low, high) = size(spider);
    assert!(low.y.abs() < 0.005 && (1.0..1.5).contains(&(high.x - low.x)), "{low} {high}");
    let (low, high) = size(hand);
    assert!(low.y.abs() < 0.005 && (high.y - 1.0).abs() < 0.02, "{low} {high}");
}

#[test]
fn bones_lie_inside() {
    for character in ALL.iter() {
        for (bone, (head, tail)) in character.skeleton.rest_segments().into_iter().enumerate() {
            assert!(head.distance(tail) > 0.01);
            for step in 0..=4 {
                let p = head.lerp(tail, step as f32 / 4.0);
                let turns = winding(character, p.as_dvec3());
                let name = &character.skeleton.bones()[bone].name;
                assert!((turns - 1.0).abs() < 1e-6, "{}: {name} leaves the mesh at {p}", character.name);
            }
        }
    }
}

#[test]
fn every_bone_moves_something_and_weights_sum_to_one() {
    for character in ALL.iter() {
        let mut owned = vec![0.0_f64; character.skeleton.len()];
        for vertex in 0..character.surface.mesh.vertices.len() {
            let mut sum = 0.0;
            for (bone, weight) in character.surface.influences.of_vertex(vertex) {
                sum += weight;
                owned[usize::from(bone)] += f64::from(weight);
            }
            assert!((sum - 1.0).abs() < 1e-5);
        }
        for (bone, owned) in owned.iter().enumerate() {
            let name = &character.skeleton.bones()[bone].name;
            assert!(*owned > 20.0, "{}: {name} owns only {owned} vertices", character.name);
        }
        let Provenance::Generated(WeightsRecord::BoneHeat(record)) = character.provenance else {
            panic!("not by heat")
        };
        assert!(record.residual < 1e-10, "{}", character.name);
    }
}

#[test]
fn human_and_spider_are_their_own_mirror_images() {
    for character in &ALL[..2] {
        let place = |p: DVec3| [p.x, p.y, p.z].map(f64::to_bits);
        let at: BTreeMap<[u64; 3], usize> = positions(character).map(|(v, p)| (place(p), v)).collect();
        let other_side = |name: &str| {
            let swapped = name.strip_prefix("Left").map(|rest| format!("Right{rest}"));
            swapped.or(name.strip_prefix("Right").map(|rest| format!("Left{rest}"))).unwrap_or(name.to_owned())
        };
        let mirror_bone: Vec<usize> =
            character.skeleton.bones().iter().map(|b| character.skeleton.find(&other_side(&b.name)).unwrap()).collect();
        let heads = character.skeleton.rest_segments();
        for (bone, &mirrored) in mirror_bone.iter().enumerate() {
            assert_eq!(heads[bone].1 * Vec3::new(-1.0, 1.0, 1.0), heads[mirrored].1);
        }
        for (vertex, p) in positions(character) {
            // Zero has a sign.
            let image = if p.x == 0.0 { p } else { DVec3::new(-p.x, p.y, p.z) };
            let twin = at[&place(image)];
            let n = Vec3::from(character.surface.normals[vertex]);
            assert!((n * Vec3::new(-1.0, 1.0, 1.0)).distance(character.surface.normals[twin].into()) < 1e-6);
            for (bone, weight) in character.surface.influences.of_vertex(vertex) {
                let image = mirror_bone[usize::from(bone)];
                let there = character.surface.influences.of_vertex(twin).find(|i| usize::from(i.0) == image);
                let difference = (weight - there.map_or(0.0, |i| i.1)).abs();
                assert!(difference < 1e-4, "{}: {p} differs by {difference}", character.name);
            }
        }
    }
}

#[test]
fn a_finger_moves_no_other_finger() {
    let [human, _, hand] = &*ALL;
    let fingers = ["Thumb", "Index", "Middle", "Ring", "Little"];
    let segments = ["Proximal", "Intermediate", "Distal"];
    for character in [human, hand] {
        let rest = character.skeleton.rest_segments();
        for own in fingers {
            // Vertices nearest to the free segments of this finger; the thumb's middle one is inside its web.
            let free = if own == "Thumb" { 2 } else { 1 };
            let bones: Vec<usize> = (0..rest.len())
                .filter(|&b| character.skeleton.bones()[b].name.starts_with(&format!("Left{own}")))
                .collect();
            for (vertex, p) in positions(character) {
                let near = |b: usize| {
                    let (head, tail) = (rest[b].0.as_dvec3(), rest[b].1.as_dvec3());
                    let along = ((p - head).dot(tail - head) / (tail - head).length_squared()).clamp(0.0, 1.0);
                    p.distance(head.lerp(tail, along))
                };
                let nearest = (0..rest.len()).min_by(|&a, &b| near(a).total_cmp(&near(b))).unwrap();
                if !bones[free..].contains(&nearest) {
                    continue;
                }
                for other in fingers.iter().filter(|&&other| other != own) {
                    let strange: f32 =
                        segments.iter().map(|s| weight(character, vertex, &format!("Left{other}{s}"))).sum();
                    assert!(strange < 0.04, "{}: {other} moves {own} at {p} by {strange}", character.name);
                }
            }
        }
    }
}

#[test]
fn limbs_keep_to_their_side() {
    let [human, spider, _] = &*ALL;
    for (vertex, p) in positions(human) {
        for bone in ["LeftLowerArm", "LeftHand", "LeftUpperLeg", "LeftLowerLeg", "LeftFoot", "LeftToes"] {
            let moved = weight(human, vertex, bone);
            let limit = if bone == "LeftUpperLeg" && p.x > -0.05 { 1.0 } else { 0.05 };
            assert!(p.x >= 0.0 || moved <= limit, "{bone} moves {p} by {moved}");
        }
        assert!(p.x.abs() > 0.10 || weight(human, vertex, "LeftUpperArm") < 0.15, "the arm moves the chest at {p}");
        assert!(p.y > 0.75 || weight(human, vertex, "Spine") < 0.05, "the spine moves the leg at {p}");
    }
    for (vertex, p) in positions(spider) {
        for leg in 1..=4 {
            for segment in ["Tibia", "Tarsus"] {
                let moved = weight(spider, vertex, &format!("LeftLeg{leg}{segment}"));
                assert!(p.x > 0.1 || moved < 0.02, "leg {leg} moves {p} by {moved}");
            }
        }
        let outward = p.x > 0.35;
        let own: Vec<usize> = (1..=4)
            .filter(|leg| {
                ["Femur", "Tibia", "Tarsus"].iter().any(|s| weight(spider, vertex, &format!("LeftLeg{leg}{s}")) > 0.01)
            })
            .collect();
        assert!(!outward || own.len() == 1, "legs {own:?} move {p}");
    }
}

#[test]
fn each_is_the_same_every_time_and_survives_its_file() {
    let bytes = to_bytes(&ALL[1]);
    assert!(to_bytes(&spider().unwrap()) == bytes);
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert!(one_thread.install(|| to_bytes(&spider().unwrap())) == bytes);
    assert!(from_bytes(&bytes).unwrap() == ALL[1]);
    assert!(from_bytes(&to_bytes(&ALL[0])).unwrap() == ALL[0]);
}

#[test]
fn the_human_has_the_names_that_other_programs_know() {
    let human = &ALL[0];
    for name in ["Hips", "Spine", "Chest", "UpperChest", "Neck", "Head"] {
        assert!(human.skeleton.find(name).is_some(), "{name}");
    }
    for side in ["Left", "Right"] {
        for name in
            ["Shoulder", "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot", "Toes", "ThumbProximal"]
        {
            assert!(human.skeleton.find(&format!("{side}{name}")).is_some(), "{side}{name}");
        }
    }
    assert_eq!(human.skeleton.len(), 6 + 2 * (8 + 15));
    assert!(human.skeleton.bones().iter().all(|b| b.rest.rotation == glam::Quat::IDENTITY));
    // The left is at +x.
    let hand = human.skeleton.find("LeftHand").unwrap();
    assert!(human.skeleton.rest_segments()[hand].0.x > 0.5);
}
