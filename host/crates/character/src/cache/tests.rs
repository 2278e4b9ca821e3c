use armature_formats::model::{
    AlphaMode, Avatar, Expression, HumanoidBone, MeshPart, MorphTarget, Skin, SpringChain, SpringCollider, SpringJoint,
    Texture, Wrap,
};
use armature_weights::handles::FREE_NEAR_JOINTS;

use super::*;
use crate::cache::content_hash;
use crate::character::{HeatRecord, MonotoneRecord, Provenance, SolvedRecord, WeightsRecord};
use crate::handle_weights::{BiharmonicTier, DomainKind};
use crate::skin_kind::{EndpointMethod, Endpoints};

fn small() -> Character {
    let vertices = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [0.0, 1.0, 0.2], [0.3, 0.3, 1.0]];
    let bone = |name: &str, parent, y: f32| Bone {
        name: name.into(),
        parent,
        rest: Transform { translation: Vec3::new(0.1, y, 0.2), ..Transform::IDENTITY },
        tail: Vec3::new(0.0, 0.5, 0.0),
    };
    // Thirds are not exact in f32, so normalising a second time would turn bits.
    let weights = vec![0.3, 0.3, 0.3, 1.0, 0.0, 0.0, 0.6, 0.7, 0.0, 0.1, 0.2, 0.3];
    let mesh = TriangleMesh { vertices, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]] };
    let texture = Texture { mime: "image/png".into(), bytes: vec![1, 2, 3], ..Texture::default() };
    Character {
        name: "tetra \u{e4}".into(),
        surface: Arc::new(Surface {
            normals: vec![[0.0, 0.6, 0.8]; 4],
            texture_coordinates: Some(vec![[0.25, 0.5]; 4]),
            vertex_colors: None,
            influences: Influences::new(3, vec![0, 1, 2, 2, 0, 0, 0, 1, 0, 2, 1, 0], weights, 3).unwrap(),
            endpoints: None,
            parts: vec![Surface::one_part(&mesh)],
            morph_targets: Vec::new(),
            mesh,
        }),
        materials: vec![Material {
            base_color: Some([0.1, 0.2, 0.3, 1.0]),
            base_color_map: Some(Arc::new(texture)),
            ..Material::default()
        }],
        skeleton: Skeleton::new(vec![bone("a", None, 0.0), bone("b", Some(0), 0.5), bone("c", Some(1), 0.5)]).unwrap(),
        skins: Vec::new(),
        avatar: None,
        skin: SkinKind::Linear,
        provenance: Provenance::Computed(WeightsRecord::Biharmonic(SolvedRecord {
            tier: BiharmonicTier::Certified,
            domain: DomainKind::Surface,
            domain_vertices: 4,
            joint_release: 0.125,
            flat_elements: Some(3),
            error_bound: 1e-5,
            energy: 12.5,
            unconverged: 1,
            largest_deviation: 0.05,
            max_influences: 4,
            max_dropped: 0.01,
            mean_dropped: 0.001,
        })),
        warnings: vec!["something".into(), String::new()],
    }
}

/// A character with two parts, a second material, morph targets and a skin of its own.
fn rich() -> Character {
    let mut character = small();
    let surface = Arc::make_mut(&mut character.surface);
    surface.mesh.vertices.extend([[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.5]]);
    surface.mesh.triangles.push([4, 5, 6]);
    surface.normals.extend([[1.0, 0.0, 0.0]; 3]);
    surface.texture_coordinates = None;
    surface.vertex_colors = Some(vec![[0.5, 0.25, 1.0, 0.75]; 7]);
    let (bones, weights) = (surface.influences.bones(), surface.influences.weights());
    let bones = bones.iter().copied().chain([0, 1, 2, 0, 1, 2, 0, 1, 2]).collect();
    let weights = weights.iter().copied().chain([1.0, 0.0, 0.0, 0.5, 0.5, 0.0, 1.0, 0.0, 0.0]).collect();
    surface.influences = Influences::restore(3, bones, weights, 3).unwrap();
    surface.parts = vec![
        MeshPart { name: "body".into(), vertices: 0..4, triangles: 0..4, material: Some(1), skin: None },
        MeshPart { name: "flag \u{e4}".into(), vertices: 4..7, triangles: 4..5, material: None, skin: Some(0) },
    ];
    let lifted = vec![[0.0, 0.25, 0.0]; 3];
    surface.morph_targets = vec![
        MorphTarget { name: "up".into(), part: 1, default_weight: 0.5, positions: lifted, normals: Vec::new() },
        MorphTarget { part: 0, positions: vec![[1.0; 3]; 4], normals: vec![[0.5; 3]; 4], ..MorphTarget::default() },
    ];
    let map = character.materials[0].base_color_map.clone();
    character.materials.push(Material {
        name: "glass".into(),
        base_color: Some([1.0, 1.0, 1.0, 0.5]),
        base_color_map: None,
        metallic: 0.25,
        roughness: 0.125,
        metallic_roughness_map: Some(Arc::new(Texture {
            mime: "image/jpeg".into(),
            bytes: vec![9; 7],
            ..Texture::default()
        })),
        normal_map: map,
        normal_scale: 0.75,
        emissive: [0.5, 0.25, 1.0],
        emissive_map: None,
        alpha: AlphaMode::Mask { cutoff: 0.375 },
        double_sided: true,
        unlit: true,
    });
    let bound = glam::Affine3A::from_rotation_translation(Quat::from_rotation_x(0.5), Vec3::Y);
    character.skins = vec![Skin { name: "flag".into(), bound_model_from_bone: vec![bound; 3] }];
    character.check_parts().unwrap();
    character
}

/// Sets the right length and checksum for a changed body, so that the parser itself is reached.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let length = (bytes.len() - HEADER) as u64;
    bytes[12..20].copy_from_slice(&length.to_le_bytes());
    let hash = blake3::hash(&bytes[HEADER..]);
    bytes[20..HEADER].copy_from_slice(hash.as_bytes());
    bytes
}

#[test]
fn what_was_written_comes_back_bit_for_bit() {
    let mut character = small();
    assert_eq!(from_bytes(&to_bytes(&character)), Ok(character.clone()));
    character.materials[0].base_color_map = None;
    Arc::make_mut(&mut character.surface).texture_coordinates = None;
    character.provenance = Provenance::Artist;
    let bytes = to_bytes(&character);
    assert_eq!(from_bytes(&bytes), Ok(character.clone()));
    assert_eq!(to_bytes(&from_bytes(&bytes).unwrap()), bytes);
}

#[test]
fn parts_materials_skins_and_morph_targets_come_back_and_images_stay_shared() {
    let character = rich();
    let bytes = to_bytes(&character);
    let again = from_bytes(&bytes).unwrap();
    assert_eq!(again, character);
    assert_eq!(to_bytes(&again), bytes);
    let maps = [&again.materials[0].base_color_map, &again.materials[1].normal_map].map(|map| map.as_ref().unwrap());
    assert!(Arc::ptr_eq(maps[0], maps[1]), "one image, not two");
    assert!(again.linear_skin().unwrap().bone_count() == 3);
}

#[test]
fn an_avatar_comes_back() {
    let mut character = rich();
    let hash = content_hash(&character);
    let joint = SpringJoint { bone: 2, stiffness: 0.5, gravity_direction: [0.0, -1.0, 0.0], ..SpringJoint::default() };
    let sphere = SpringCollider { bone: 1, offset: [0.25; 3], ..SpringCollider::default() };
    let capsule = SpringCollider { tail: Some([0.5; 3]), radius: 2.0, ..sphere };
    character.avatar = Some(Avatar {
        version: "1.0".into(),
        humanoid: vec![HumanoidBone { name: "hips".into(), bone: 0 }],
        expressions: vec![Expression { name: "happy".into(), targets: vec![(0, 1.0), (1, 0.25)] }],
        springs: vec![SpringChain { name: "hair".into(), joints: vec![joint], colliders: vec![sphere, capsule] }],
    });
    let bytes = to_bytes(&character);
    assert_eq!(bytes[8..12], 8_u32.to_le_bytes());
    assert_eq!(from_bytes(&bytes).as_ref(), Ok(&character));
    assert_eq!(content_hash(&character), hash, "takes find the character that they were recorded with");
    truncations_are_errors(&bytes);
    let avatar = character.avatar.as_mut().unwrap();
    avatar.expressions[0].targets[0].0 = 2;
    let error = from_bytes(&to_bytes(&character)).unwrap_err().to_string();
    assert!(error.contains("morph target 2 of 2"), "{error}");
    let mut weights = character.default_weights();
    character.avatar.as_mut().unwrap().expressions[0].targets[0].0 = 0;
    assert!(character.set_shape(&mut weights, "happy", 0.5) && weights == [0.5, 0.125]);
    assert!(character.set_shape(&mut weights, "up", 1.0) && weights == [1.0, 0.125]);
    assert!(!character.set_shape(&mut weights, "sad", 1.0));
    assert_eq!(character.shape_names(), ["happy", "up", ""]);
}

#[test]
fn images_stay_wrapped() {
    for mut character in [small(), rich()] {
        let hash = content_hash(&character);
        let map = character.materials[0].base_color_map.as_deref().cloned().unwrap();
        let wrapped = Arc::new(Texture { wrap: [Wrap::Clamp, Wrap::Mirror], ..map });
        character.materials.iter_mut().for_each(|material| material.base_color_map = Some(wrapped.clone()));
        let bytes = to_bytes(&character);
        assert_eq!(bytes[8..12], 8_u32.to_le_bytes());
        let again = from_bytes(&bytes).unwrap();
        assert_eq!(again, character);
        let maps = again.materials.iter().map(|material| material.base_color_map.as_ref().unwrap());
        assert!(maps.clone().all(|map| Arc::ptr_eq(map, maps.clone().next().unwrap())), "one image, not several");
        assert!(from_bytes(&sealed(bytes[..bytes.len() - 1].to_vec())).is_err());
        character.materials.truncate(1);
        if character.surface.parts.len() == 1 {
            assert_eq!(content_hash(&character), hash, "takes find the character that they were recorded with");
        }
    }
}

#[test]
fn characters_written_before_vertices_had_colours_open() {
    let mut character = rich();
    character.materials[1].unlit = false;
    Arc::make_mut(&mut character.surface).vertex_colors = None;
    let mut bytes = to_bytes(&character);
    // No colours; a count and a flag for each material.
    bytes.truncate(bytes.len() - 1 - 8 - character.materials.len());
    bytes[8..12].copy_from_slice(&5_u32.to_le_bytes());
    assert_eq!(from_bytes(&sealed(bytes)), Ok(character));
}

#[test]
fn a_character_of_one_mesh_is_written_as_before() {
    assert_eq!(to_bytes(&small())[8..12], 4_u32.to_le_bytes());
    assert_eq!(to_bytes(&rich())[8..12], 6_u32.to_le_bytes());
    for change in [
        |c: &mut Character| c.materials[0].metallic = 1.0,
        |c: &mut Character| c.materials[0].name = "paint".into(),
        |c: &mut Character| c.materials.push(Material::default()),
        |c: &mut Character| c.materials[0].double_sided = false,
        |c: &mut Character| {
            c.skins.push(Skin { bound_model_from_bone: vec![glam::Affine3A::IDENTITY; 3], ..Skin::default() });
        },
        |c: &mut Character| Arc::make_mut(&mut c.surface).parts[0].material = None,
    ] {
        let mut character = small();
        change(&mut character);
        assert_eq!(to_bytes(&character)[8..12], 6_u32.to_le_bytes());
        assert_eq!(from_bytes(&to_bytes(&character)), Ok(character));
    }
}

/// The same textured box, bound twice, as written by the programs that introduced versions 3 and 4. The last program
/// before parts and materials turns each version 3 file into the version 4 file beside it, byte for byte.
const OLD_FILES: [[&[u8]; 2]; 2] = [
    [
        include_bytes!("../../tests/characters/biharmonic-3.armature"),
        include_bytes!("../../tests/characters/biharmonic-4.armature"),
    ],
    [
        include_bytes!("../../tests/characters/heat-3.armature"),
        include_bytes!("../../tests/characters/heat-4.armature"),
    ],
];

#[test]
fn files_of_older_programs_hold_what_they_held() {
    for [third, fourth] in OLD_FILES {
        assert_eq!([third[8], fourth[8]], [3, 4]);
        let [old, character] = [third, fourth].map(|bytes| from_bytes(bytes).unwrap());
        assert_eq!(old, character);
        assert_eq!(to_bytes(&old), fourth, "to the last byte");
        assert!(character.linear_skin().is_ok());

        let Character { surface, materials, skeleton, skins, .. } = &character;
        assert_eq!((materials.len(), materials[0].base_color), (1, Some([0.25, 0.5, 1.0, 0.5])));
        assert_eq!(materials[0].base_color_map.as_ref().unwrap().mime, "image/png");
        assert_eq!((surface.mesh.vertices.len(), surface.mesh.triangles.len()), (20, 12));
        assert_eq!((skeleton.len(), skins.len(), surface.morph_targets.len()), (2, 0, 0));
        assert_eq!(surface.parts, [Surface::one_part(&surface.mesh)]);
    }
}

#[test]
fn each_provenance_comes_back_and_the_first_format_is_still_read() {
    let heat = HeatRecord { heat: 1.0, max_influences: 4, residual: 1e-15, max_dropped: 0.01 };
    let heat = WeightsRecord::BoneHeat(heat);
    let mut character = small();
    let biharmonic = *character.provenance.record().unwrap();
    for provenance in [
        Provenance::Artist,
        Provenance::Computed(heat),
        Provenance::Generated(heat),
        Provenance::Computed(biharmonic),
        Provenance::Generated(biharmonic),
    ] {
        character.provenance = provenance;
        let mut bytes = to_bytes(&character);
        assert_eq!(from_bytes(&bytes), Ok(character.clone()));
        if provenance.record() != Some(&biharmonic) {
            // Nothing else has changed since.
            bytes[8] = 1;
            assert_eq!(from_bytes(&bytes), Ok(character.clone()));
        }
    }
}

#[test]
fn monotone_weights_have_a_layout_that_older_programs_refuse() {
    for mut character in [small(), rich()] {
        let Some(&WeightsRecord::Biharmonic(solved)) = character.provenance.record() else { unreachable!() };
        let record = WeightsRecord::Monotone(MonotoneRecord { order: 3, spurious: 5, solved });
        for provenance in [Provenance::Computed(record), Provenance::Generated(record)] {
            character.provenance = provenance;
            let bytes = to_bytes(&character);
            assert_eq!(bytes[8..12], 7_u32.to_le_bytes());
            assert_eq!(from_bytes(&bytes), Ok(character.clone()));
        }
        truncations_are_errors(&to_bytes(&character));
    }
}

#[test]
fn how_a_skin_follows_comes_back() {
    for mut character in [small(), rich()] {
        for kind in SkinKind::ALL {
            character.skin = kind;
            let bytes = to_bytes(&character);
            assert_eq!(bytes[8] == 9, kind != SkinKind::Linear);
            assert_eq!(from_bytes(&bytes), Ok(character.clone()));
        }
        let weights = vec![0.25; character.surface.influences.bones().len()];
        let endpoints = Endpoints { method: EndpointMethod::BoneHeat, weights };
        Arc::make_mut(&mut character.surface).endpoints = Some(endpoints.clone());
        let bytes = to_bytes(&character);
        assert_eq!(from_bytes(&bytes), Ok(character.clone()));
        truncations_are_errors(&bytes);
        for wrong in [1.5, -0.25] {
            let mut weights = endpoints.weights.clone();
            weights[0] = wrong;
            let wrong = Endpoints { weights, ..endpoints.clone() };
            Arc::make_mut(&mut character.surface).endpoints = Some(wrong);
            let error = from_bytes(&to_bytes(&character)).unwrap_err().to_string();
            assert!(error.contains("endpoint weight"), "{error}");
        }
    }
}

#[test]
fn other_files_and_other_versions_are_named() {
    assert_eq!(from_bytes(b""), Err(CacheError::NotACharacter));
    assert_eq!(from_bytes(b"solid cube, or some other text"), Err(CacheError::NotACharacter));
    let mut bytes = to_bytes(&small());
    bytes[8] = 10;
    assert_eq!(from_bytes(&bytes), Err(CacheError::Version { found: 10 }));
}

#[test]
fn what_older_files_say_of_weights_is_read() {
    let character = small();
    let Provenance::Computed(WeightsRecord::Biharmonic(record)) = character.provenance else { unreachable!() };
    let as_it_was = Character {
        provenance: Provenance::Computed(WeightsRecord::Biharmonic(SolvedRecord {
            joint_release: FREE_NEAR_JOINTS,
            flat_elements: None,
            ..record
        })),
        ..character
    };
    // Older files have another kind, and end the record before the two numbers that were added later.
    let mut bytes = to_bytes(&as_it_was);
    let later = [FREE_NEAR_JOINTS.to_le_bytes(), 0_u64.to_le_bytes()].concat();
    let at = bytes.windows(16).position(|window| window == later).unwrap();
    bytes.drain(at..at + 16);
    let kind = at - (1 + 2 + 3 * 8 + 5 * 8);
    assert_eq!(bytes[kind], 5);
    bytes[kind] = 3;
    bytes[8] = 3;
    assert_eq!(from_bytes(&sealed(bytes)), Ok(as_it_was));
}

#[test]
fn every_truncation_is_an_error() {
    for bytes in [to_bytes(&small()), to_bytes(&rich())] {
        truncations_are_errors(&bytes);
    }
}

fn truncations_are_errors(bytes: &[u8]) {
    for length in 0..bytes.len() {
        assert!(from_bytes(&bytes[..length]).is_err(), "{length} bytes");
        if length >= HEADER {
            assert!(from_bytes(&sealed(bytes[..length].to_vec())).is_err(), "{length} bytes, sealed");
        }
    }
    let mut longer = bytes.to_vec();
    longer.push(0);
    assert!(matches!(from_bytes(&longer), Err(CacheError::Malformed { .. })));
    assert!(matches!(from_bytes(&sealed(longer)), Err(CacheError::Malformed { .. })));
}

#[test]
fn every_single_damaged_byte_is_noticed() {
    let bytes = to_bytes(&small());
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        assert!(from_bytes(&damaged).is_err(), "byte {at}");
    }
}

#[test]
fn hostile_bodies_never_panic_and_never_make_nonsense() {
    let bytes = to_bytes(&rich());
    for at in HEADER..bytes.len() {
        for value in [0x00, 0x01, 0x7f, 0x80, 0xff, bytes[at] ^ 0x01, bytes[at] ^ 0x40] {
            let mut hostile = bytes.clone();
            hostile[at] = value;
            if let Ok(character) = from_bytes(&sealed(hostile)) {
                let surface = &character.surface;
                assert_eq!((surface.mesh.validate(), character.check_parts()), (Ok(()), Ok(())));
                assert_eq!(surface.influences.vertex_count(), surface.mesh.vertices.len());
            }
        }
        // A count of 2^64 - 1 anywhere.
        let mut hostile = bytes.clone();
        let end = (at + 8).min(bytes.len());
        hostile[at..end].fill(0xff);
        let _ = from_bytes(&sealed(hostile));
    }
}

#[test]
fn a_count_beyond_the_file_names_its_byte() {
    let mut bytes = to_bytes(&small());
    bytes[HEADER..HEADER + 8].fill(0xff);
    let error = from_bytes(&sealed(bytes)).unwrap_err();
    assert!(matches!(error, CacheError::Malformed { byte, .. } if byte == HEADER + 8), "{error}");
    assert!(error.to_string().contains("more than the rest of the file can hold"), "{error}");
}
