//! Characters that the program makes itself, so that it ships no third-party model: [`human`], [`spider`] and [`hand`].
//!
//! ```
//! let spider = armature_character::own::spider()?;
//! assert_eq!(spider.surface.influences.vertex_count(), spider.surface.mesh.vertices.len());
//! # Ok::<(), armature_character::bind::BindError>(())
//! ```

mod bones;
mod field;
mod figure;
mod hand;
mod human;
mod mirror_weights;
mod polygonise;
mod remesh;
mod spider;
mod surface;

use std::ops::ControlFlow;
use std::sync::Arc;

use armature_formats::model::{Material, Model};
use armature_rig::{Skeleton, SkeletonError};
use glam::DVec3;

use crate::bind::{BindError, BindMethod, BindSettings, bind_with_ribs, endpoint_weights};
use crate::character::{Character, Provenance};
use crate::progress::Progress;
use crate::skin_kind::SkinKind;

use field::Field;
use figure::{Detail, figure};
use mirror_weights::mirror_weights;

/// A human figure in a T-pose, 1.75 units tall, with the bone names of Unity's `HumanBodyBones` (and VMC).
pub fn human() -> Result<Character, BindError> {
    make("human", &human::field(), human::DETAIL, human::skeleton(), &human::ribs(), [0.62, 0.36, 0.23, 1.0])
}

/// A spider with eight legs of three segments, about 1.2 units wide.
pub fn spider() -> Result<Character, BindError> {
    make("spider", &spider::field(), spider::DETAIL, spider::skeleton(), &spider::ribs(), [0.17, 0.15, 0.21, 1.0])
}

/// A left hand with a stub of a forearm, 1 unit tall: fingers up, palm towards +Z.
pub fn hand() -> Result<Character, BindError> {
    make("hand", &hand::field(), hand::DETAIL, hand::skeleton(), &hand::ribs(), [0.62, 0.40, 0.27, 1.0])
}

/// The same character with a skin that twists along its limbs. Computes how far along its bones each vertex is, from
/// bounded biharmonic weights of the joints (thesis eq. 6.7).
pub fn twisting(character: Character, progress: Progress<'_>) -> Result<Character, BindError> {
    let (endpoints, _) = endpoint_weights(&character, &BindSettings::default(), progress)?;
    let mut twisting = Character { skin: SkinKind::StretchTwist, ..character };
    Arc::make_mut(&mut twisting.surface).endpoints = Some(endpoints);
    Ok(twisting)
}

/// The bones of [`spider`].
pub(crate) fn spider_skeleton() -> Result<Skeleton, SkeletonError> {
    spider::skeleton()
}

fn make(
    name: &str,
    field: &Field,
    detail: Detail,
    skeleton: Result<Skeleton, SkeletonError>,
    ribs: &[(&str, [DVec3; 2])],
    base_color: [f32; 4],
) -> Result<Character, BindError> {
    let (mesh, normals) = figure(field, detail);
    let materials = vec![Material { base_color: Some(base_color), ..Material::default() }];
    let model = Model { name: name.to_owned(), mesh, normals: Some(normals), materials, ..Model::default() };
    let skeleton = skeleton?;
    let ribs: Vec<_> =
        ribs.iter().filter_map(|(name, ends)| skeleton.find(name).map(|bone| (bone as u16, *ends))).collect();
    let go_on = &mut |_, _| ControlFlow::Continue(());
    let settings = BindSettings { method: BindMethod::BoneHeat, max_influences: 4, ..BindSettings::default() };
    let mut character = bind_with_ribs(model, Some(skeleton), &ribs, &settings, go_on)?;
    if let Provenance::Computed(record) = character.provenance {
        character.provenance = Provenance::Generated(record);
    }
    if field.symmetric {
        let surface = Arc::make_mut(&mut character.surface);
        surface.influences = mirror_weights(&surface.mesh, &character.skeleton, &surface.influences)?;
    }
    // The warnings are for the user's own models; ours have been inspected and are tested.
    character.warnings.clear();
    Ok(character)
}
