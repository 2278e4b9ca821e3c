use super::*;
use crate::{BiharmonicRecord, BiharmonicTier, DomainKind, HeatRecord, Provenance, WeightsRecord};

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
    Character {
        name: "tetra \u{e4}".into(),
        mesh: TriangleMesh { vertices, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]] },
        normals: vec![[0.0, 0.6, 0.8]; 4],
        texture_coordinates: Some(vec![[0.25, 0.5]; 4]),
        base_color: [0.1, 0.2, 0.3, 1.0],
        texture: Some(Texture { mime: "image/png".into(), bytes: vec![1, 2, 3] }),
        skeleton: Skeleton::new(vec![bone("a", None, 0.0), bone("b", Some(0), 0.5), bone("c", Some(1), 0.5)]).unwrap(),
        influences: Influences::new(3, vec![0, 1, 2, 2, 0, 0, 0, 1, 0, 2, 1, 0], weights, 3).unwrap(),
        provenance: Provenance::Computed(WeightsRecord::Biharmonic(BiharmonicRecord {
            tier: BiharmonicTier::Certified,
            domain: DomainKind::Surface,
            domain_vertices: 4,
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

/// Puts a right length and checksum over a changed body, so that the parser itself is reached.
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
    character.texture = None;
    character.texture_coordinates = None;
    character.provenance = Provenance::Artist;
    let bytes = to_bytes(&character);
    assert_eq!(from_bytes(&bytes), Ok(character.clone()));
    assert_eq!(to_bytes(&from_bytes(&bytes).unwrap()), bytes);
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
fn other_files_and_other_versions_are_named() {
    assert_eq!(from_bytes(b""), Err(CacheError::NotACharacter));
    assert_eq!(from_bytes(b"solid cube, or some other text"), Err(CacheError::NotACharacter));
    let mut bytes = to_bytes(&small());
    bytes[8] = 9;
    assert_eq!(from_bytes(&bytes), Err(CacheError::Version { found: 9 }));
}

#[test]
fn every_truncation_is_an_error() {
    let bytes = to_bytes(&small());
    for length in 0..bytes.len() {
        assert!(from_bytes(&bytes[..length]).is_err(), "{length} bytes");
        if length >= HEADER {
            assert!(from_bytes(&sealed(bytes[..length].to_vec())).is_err(), "{length} bytes, sealed");
        }
    }
    let mut longer = bytes.clone();
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
    let bytes = to_bytes(&small());
    for at in HEADER..bytes.len() {
        for value in [0x00, 0x01, 0x7f, 0x80, 0xff, bytes[at] ^ 0x01, bytes[at] ^ 0x40] {
            let mut hostile = bytes.clone();
            hostile[at] = value;
            if let Ok(character) = from_bytes(&sealed(hostile)) {
                assert_eq!(character.mesh.validate(), Ok(()));
                assert_eq!(character.influences.vertex_count(), character.mesh.vertices.len());
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
