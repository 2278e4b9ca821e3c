//! Real models, if they are available.

#![expect(clippy::unwrap_used, reason = "a test may fail by panic")]

use std::ops::ControlFlow;
use std::path::Path;

use armature_character::bind::{BindMethod, BindSettings, bind};
use armature_character::cache::{from_bytes, to_bytes};
use armature_character::handle_weights::WeightsOn;
use armature_character::{Character, Provenance, WeightsRecord};
use armature_formats::model::Model;
use armature_formats::read_model;
use armature_formats::skeleton::{read_tgf, skeleton_from_graph};
use armature_rig::Skeleton;
use armature_test_support::shared;

fn model(folder: &Path, name: &str) -> Model {
    let resolver = |file: &str| std::fs::read(folder.join(file)).map_err(|error| error.to_string());
    read_model(name, &std::fs::read(folder.join(name)).unwrap(), &resolver).unwrap()
}

fn skeleton(folder: &Path, name: &str) -> Skeleton {
    let graph = read_tgf(&std::fs::read(folder.join(name)).unwrap()).unwrap();
    skeleton_from_graph(&graph, None).unwrap().skeleton
}

fn bound(model: Model, skeleton: Option<Skeleton>, settings: &BindSettings) -> Character {
    bind(model, skeleton, settings, &mut |_, _| ControlFlow::Continue(())).unwrap()
}

#[test]
fn a_rigged_fox_keeps_its_rig_and_texture() {
    let Some(folder) = shared("") else { return };
    let fox = model(&folder, "Fox.glb");
    let rig = fox.rig.clone().unwrap();
    let vertices = fox.drawn_vertex_count();
    let character = bound(fox.clone(), None, &BindSettings::default());
    assert_eq!(character.provenance, Provenance::Artist);
    assert_eq!(character.skeleton, rig.skeleton);
    assert_eq!(character.surface.mesh.vertices.len(), vertices);
    assert!(character.materials[0].base_color_map.is_some() && character.surface.texture_coordinates.is_some());
    // In the rest pose the skin is where the mesh is.
    let mut skin = character.linear_skin().unwrap();
    let mut positions = vec![[0.0; 3]; vertices];
    let mut normals = positions.clone();
    skin.solve(&character.skeleton.rest_model_from_bone(), &mut positions, &mut normals).unwrap();
    let (low, high) = character.surface.mesh.bounds().unwrap();
    let size = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    for (skinned, rest) in positions.iter().zip(&character.surface.mesh.vertices) {
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
    let Some(folder) = shared("") else { return };
    let arm = model(&folder, "arm.obj");
    let vertices = arm.mesh.vertices.len();
    let settings = BindSettings { on: WeightsOn::Volume { vertices: 1500 }, ..BindSettings::default() };
    let character = bound(arm, Some(skeleton(&folder, "arm.tgf")), &settings);
    assert!(character.surface.mesh.vertices.len() >= vertices);
    let Provenance::Computed(WeightsRecord::Biharmonic(record)) = character.provenance else { panic!("not so") };
    assert!(record.unconverged == 0 && record.error_bound <= 2e-3, "{record:?}");
    assert_eq!(from_bytes(&to_bytes(&character)), Ok(character));
}

#[test]
fn another_models_skeleton_is_refused_or_warned_of() {
    let Some(folder) = shared("") else { return };
    let bound = bind(
        model(&folder, "arm.obj"),
        Some(skeleton(&folder, "elephant.tgf")),
        &BindSettings::default(),
        &mut |_, _| ControlFlow::Continue(()),
    );
    match bound {
        Err(error) => assert!(error.to_string().contains("does not fit the mesh"), "{error}"),
        Ok(character) => assert!(!character.warnings.is_empty()),
    }
}
