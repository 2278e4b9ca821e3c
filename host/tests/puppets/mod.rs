//! A puppet and a character made of capsules, for testing the window.

use std::sync::Arc;

use armature::characters::LoadedCharacter;
use armature::engine::event::{Frame, Stats};
use armature::takes::opened::{OpenedTake, prepare};
use armature_character::{Character, Provenance, SkinKind};
use armature_formats::model::Material;
use armature_geometry::{Influences, TriangleMesh};
use armature_rig::{
    Bone, Calibration, JointTree, Mapping, MappingEntry, Part, PartKind, PartUid, RawSample, SensorState, Skeleton,
    Transform,
};
use armature_take::{EditList, Header, Take, TakeWriter};
use glam::Vec3;

/// Name, parent, head and tail in model space, radii at both ends, kind of the joint at its head.
type Limb = (&'static str, Option<usize>, [f32; 3], [f32; 3], [f32; 2], PartKind);

const THREE: PartKind = PartKind::TwistBendTwist;

const LIMBS: [Limb; 15] = [
    ("hips", None, [0.0, 0.96, 0.0], [0.0, 1.10, 0.0], [0.15, 0.14], PartKind::Splitter { outlets: 3 }),
    ("spine", Some(0), [0.0, 1.10, 0.0], [0.0, 1.38, 0.01], [0.135, 0.16], THREE),
    ("chest", Some(1), [0.0, 1.38, 0.01], [0.0, 1.46, 0.01], [0.15, 0.11], PartKind::Splitter { outlets: 3 }),
    ("neck", Some(2), [0.0, 1.46, 0.01], [0.0, 1.58, 0.02], [0.06, 0.055], PartKind::Bend),
    ("head", Some(3), [0.0, 1.62, 0.03], [0.0, 1.72, 0.03], [0.10, 0.115], THREE),
    ("upper_arm.L", Some(2), [0.19, 1.41, 0.0], [0.46, 1.36, 0.0], [0.062, 0.052], THREE),
    ("forearm.L", Some(5), [0.46, 1.36, 0.0], [0.70, 1.40, 0.10], [0.05, 0.038], PartKind::Bend),
    ("hand.L", Some(6), [0.70, 1.40, 0.10], [0.82, 1.42, 0.14], [0.042, 0.03], THREE),
    ("upper_arm.R", Some(2), [-0.19, 1.41, 0.0], [-0.40, 1.19, -0.04], [0.062, 0.052], THREE),
    ("forearm.R", Some(8), [-0.40, 1.19, -0.04], [-0.48, 0.95, 0.06], [0.05, 0.038], PartKind::Bend),
    ("hand.R", Some(9), [-0.48, 0.95, 0.06], [-0.49, 0.84, 0.09], [0.042, 0.03], PartKind::Twist),
    ("thigh.L", Some(0), [0.10, 0.94, 0.0], [0.15, 0.52, 0.09], [0.088, 0.066], THREE),
    ("shin.L", Some(11), [0.15, 0.52, 0.09], [0.16, 0.08, -0.03], [0.062, 0.045], PartKind::Bend),
    ("thigh.R", Some(0), [-0.10, 0.94, 0.0], [-0.16, 0.51, 0.02], [0.088, 0.066], THREE),
    ("shin.R", Some(13), [-0.16, 0.51, 0.02], [-0.19, 0.08, -0.10], [0.062, 0.045], PartKind::Bend),
];

#[derive(Default)]
struct Surface {
    mesh: TriangleMesh,
    normals: Vec<[f32; 3]>,
}

/// A figure of capsules, one per bone.
pub(crate) fn character() -> LoadedCharacter {
    let mut surface = Surface::default();
    let mut bones = Vec::new();
    let mut bone_of_vertex = Vec::new();
    for (index, (name, parent, head, tail, radii, _)) in LIMBS.into_iter().enumerate() {
        let origin = parent.map_or(Vec3::ZERO, |parent| Vec3::from(LIMBS[parent].2));
        let rest = Transform { translation: Vec3::from(head) - origin, ..Transform::IDENTITY };
        bones.push(Bone { name: name.into(), parent, rest, tail: Vec3::from(tail) - Vec3::from(head) });
        capsule(&mut surface, head.into(), tail.into(), radii);
        bone_of_vertex.resize(surface.normals.len(), index as u16);
    }
    let weights = vec![1.0; bone_of_vertex.len()];
    let character = Character {
        name: "Test figure".into(),
        surface: Arc::new(armature_character::Surface {
            parts: vec![armature_character::Surface::one_part(&surface.mesh)],
            morph_targets: Vec::new(),
            mesh: surface.mesh,
            normals: surface.normals,
            texture_coordinates: None,
            vertex_colors: None,
            endpoints: None,
            influences: Influences::new(1, bone_of_vertex, weights, bones.len()).expect("one bone per vertex"),
        }),
        materials: vec![Material { base_color: Some([0.78, 0.72, 0.66, 1.0]), ..Material::default() }],
        skins: Vec::new(),
        avatar: None,
        skin: SkinKind::Linear,
        skeleton: Skeleton::new(bones).expect("parents come first"),
        provenance: Provenance::Artist,
        warnings: Vec::new(),
    };
    LoadedCharacter::bound("figure", character).0
}

fn capsule(surface: &mut Surface, from: Vec3, to: Vec3, radii: [f32; 2]) {
    const RINGS: u32 = 14;
    const SECTORS: u32 = 20;
    let axis = (to - from).normalize();
    let (z, x) = axis.any_orthonormal_pair();
    let first = surface.normals.len() as u32;
    for ring in 0..=RINGS {
        let angle = std::f32::consts::PI * (ring as f32 / RINGS as f32 - 0.5);
        let (end, radius) = if ring * 2 < RINGS { (from, radii[0]) } else { (to, radii[1]) };
        for sector in 0..SECTORS {
            let around = std::f32::consts::TAU * sector as f32 / SECTORS as f32;
            let normal = axis * angle.sin() + (x * around.cos() + z * around.sin()) * angle.cos();
            surface.mesh.vertices.push((end + normal * radius).as_dvec3().to_array());
            surface.normals.push(normal.to_array());
        }
    }
    for ring in 0..RINGS {
        for sector in 0..SECTORS {
            let corner = |ring: u32, sector: u32| first + ring * SECTORS + sector % SECTORS;
            let (a, b) = (corner(ring, sector), corner(ring, sector + 1));
            let (c, d) = (corner(ring + 1, sector), corner(ring + 1, sector + 1));
            surface.mesh.triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
}

/// A joint for every limb.
pub(crate) fn tree() -> Arc<JointTree> {
    let mut taken = [0_u8; LIMBS.len()];
    let parts = LIMBS.iter().enumerate().map(|(index, (_, parent, .., kind))| {
        let outlet = parent.map_or(0, |parent| {
            taken[parent] += 1;
            taken[parent] - 1
        });
        let uid = PartUid([0x3a, 0x7f, 0x10, 0x22, 0x09, 0xc4, 0x51, 0x8e, 0x00, 0x61, 0xd3, index as u8]);
        Part { uid, kind: *kind, parent: *parent, outlet, counts_per_turn: 4096 }
    });
    Arc::new(JointTree::new(parts.collect()).expect("a tree"))
}

/// Every part moves the bone of its number.
pub(crate) fn mapping() -> Vec<Option<usize>> {
    (0..LIMBS.len()).map(Some).collect()
}

/// A moment: the rest pose, plausible angles, a few sensors with problems.
pub(crate) fn frame(character: &LoadedCharacter) -> Box<Frame> {
    let shape = character.shape.as_ref().expect("the figure has a surface");
    let sensors = tree().sensor_count();
    let mut states = vec![SensorState::Ok; sensors];
    for (sensor, state) in [(7, SensorState::MagnetWeak), (16, SensorState::Outlier), (18, SensorState::NoData)] {
        states[sensor] = state;
    }
    Box::new(Frame {
        positions: shape.positions.clone(),
        normals: shape.normals().to_vec(),
        bones: character.skeleton.rest_segments().iter().map(|(a, b)| (a.to_array(), b.to_array())).collect(),
        angles: (0..sensors).map(|i| (i as f32 * 2.4).sin() * 1.2).collect(),
        states,
        stats: Stats {
            samples_per_second: 400.0,
            samples: 12_480,
            lost_samples: 0,
            crc_errors: 2,
            resyncs: 3,
            latency_p50_micros: 310.0,
            latency_p99_micros: 840.0,
        },
    })
}

/// A take of two seconds in which every joint swings. After half of it, 0.3 s are missing; one joint has no data in the
/// last quarter.
pub(crate) fn take(character: &Arc<LoadedCharacter>, list: EditList) -> Arc<OpenedTake> {
    let tree = tree();
    let sensors = tree.sensor_count();
    let sample = |step: u32| {
        let swing = |sensor: usize| (f64::from(step) * 0.02 + sensor as f64).sin() * 300.0;
        let state = |sensor| if sensor == 5 && step > 150 { SensorState::NoData } else { SensorState::Ok };
        RawSample {
            device_micros: 10_000 * u64::from(step),
            sequence: step,
            epoch: 0,
            counts: (0..sensors).map(|sensor| (2048.0 + swing(sensor)) as u16).collect(),
            states: (0..sensors).map(state).collect(),
        }
    };
    let mut calibration = Calibration::for_tree(&tree);
    let rest = RawSample { counts: vec![2048; sensors], ..sample(0) };
    calibration.zero(&tree, &rest).expect("it fits the puppet");
    let joints = LIMBS.iter().zip(tree.parts()).filter(|(_, part)| !part.kind.axes().is_empty());
    let entry = |part: PartUid, bone: &str| MappingEntry { part, bone: bone.into(), mounting: glam::Quat::IDENTITY };
    let entries = joints.map(|((bone, ..), part)| entry(part.uid, bone)).collect();
    let mut writer = TakeWriter::new(Vec::new(), &Header::default()).expect("memory");
    writer.skeleton(&character.skeleton).expect("memory");
    writer.topology(0, &tree).expect("memory");
    writer.calibration(&calibration).expect("memory");
    writer.mapping(&Mapping { entries, ..Mapping::default() }).expect("memory");
    for step in (0..=200).filter(|step| !(100..130).contains(step)) {
        writer.sample(&sample(step), None).expect("memory");
    }
    let (take, _) = Take::read(&writer.finish().expect("memory")).expect("a take");
    let never = &mut |_: &'static str, _: f64| std::ops::ControlFlow::Continue(());
    let path = std::path::Path::new("/home/kim/takes/walk.take");
    Arc::new(prepare(path, &take, list, character.clone(), never).expect("it can be played"))
}
