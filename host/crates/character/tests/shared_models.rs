//! Real models, where they are at hand.

#![expect(clippy::unwrap_used, reason = "a test may fail by panic")]

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use armature_character::{
    BindMethod, BindSettings, Character, Provenance, WeightsOn, WeightsRecord, bind, from_bytes, to_bytes,
};
use armature_formats::{Model, read_model, read_tgf, skeleton_from_graph};
use armature_rig::Skeleton;

/// The folder with shared models beside the repository.
fn shared_data() -> Option<PathBuf> {
    let found = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().map(|p| p.join("shared/data")).find(|p| p.is_dir());
    if found.is_none() {
        assert!(std::env::var_os("ARMATURE_REQUIRE_SHARED_DATA").is_none(), "shared/data is required but absent");
        println!("SKIPPED: there is no shared/data beside the repository");
    }
    found
}

fn model(folder: &Path, name: &str) -> Model {
    let resolver = |file: &str| std::fs::read(folder.join(file)).map_err(|error| error.to_string());
    read_model(name, &std::fs::read(folder.join(name)).unwrap(), &resolver).unwrap()
}

fn skeleton(folder: &Path, name: &str) -> Skeleton {
    let graph = read_tgf(&std::fs::read(folder.join(name)).unwrap()).unwrap();
    skeleton_from_graph(&graph, None).unwrap().skeleton
}

fn bound(model: Model, skeleton: Option<Skeleton>, settings: &BindSettings) -> Character {
    bind(model, skeleton, settings, &mut |_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn a_rigged_fox_keeps_its_rig_and_texture() {
    let Some(folder) = shared_data() else { return };
    let fox = model(&folder, "Fox.glb");
    let rig = fox.rig.clone().unwrap();
    let vertices = fox.drawn_vertex_count();
    let character = bound(fox.clone(), None, &BindSettings::default());
    assert_eq!(character.provenance, Provenance::Artist);
    assert_eq!(character.skeleton, rig.skeleton);
    assert_eq!(character.mesh.vertices.len(), vertices);
    assert!(character.texture.is_some() && character.texture_coordinates.is_some());
    // In the rest pose the skin lies where the mesh does.
    let mut skin = character.skin().unwrap();
    let mut positions = vec![[0.0; 3]; vertices];
    let mut normals = positions.clone();
    skin.solve(&character.skeleton.rest_model_from_bone(), &mut positions, &mut normals).unwrap();
    let (low, high) = character.mesh.bounds().unwrap();
    let size = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    for (skinned, rest) in positions.iter().zip(&character.mesh.vertices) {
        assert!((0..3).all(|k| (f64::from(skinned[k]) - rest[k]).abs() < 1e-5 * size));
    }
    assert_eq!(from_bytes(&to_bytes(&character)), Ok(character));

    let method = BindMethod::BoneHeat;
    let replace = BindSettings { replace_rig: true, max_influences: 8, method, ..BindSettings::default() };
    let heated = bound(fox, None, &replace);
    assert!(
        matches!(heated.provenance, Provenance::Computed(WeightsRecord::BoneHeat(r)) if r.residual < 1e-9),
        "{:?}",
        heated.provenance
    );
    assert_eq!(heated.skeleton, rig.skeleton);
}

#[test]
fn an_arm_binds_to_its_graph() {
    let Some(folder) = shared_data() else { return };
    let arm = model(&folder, "arm.obj");
    let vertices = arm.mesh.vertices.len();
    let settings = BindSettings { on: WeightsOn::Volume { vertices: 1500 }, ..BindSettings::default() };
    let character = bound(arm, Some(skeleton(&folder, "arm.tgf")), &settings);
    assert!(character.mesh.vertices.len() >= vertices);
    let Provenance::Computed(WeightsRecord::Biharmonic(record)) = character.provenance else { panic!("not so") };
    assert!(record.unconverged == 0 && record.error_bound <= 2e-3, "{record:?}");
    assert_eq!(from_bytes(&to_bytes(&character)), Ok(character));
}

#[test]
fn another_models_skeleton_is_refused_or_warned_of() {
    let Some(folder) = shared_data() else { return };
    let bound =
        bind(model(&folder, "arm.obj"), Some(skeleton(&folder, "elephant.tgf")), &BindSettings::default(), &mut |_| {
            ControlFlow::Continue(())
        });
    match bound {
        Err(error) => assert!(error.to_string().contains("does not fit the mesh"), "{error}"),
        Ok(character) => assert!(!character.warnings.is_empty()),
    }
}
