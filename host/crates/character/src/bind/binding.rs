//! From a model and a skeleton to a character that can be posed.

use std::sync::Arc;

use armature_formats::model::{Model, ModelRig};
use armature_geometry::Influences;
use armature_rig::Skeleton;
use armature_weights::finish::limit_influences;

use super::assemble::assemble;
use super::bone_weights::{BoneWeights, Rib, bone_weights};
use super::endpoints::endpoint_weights;
use super::error::BindError;
use super::parts_without_weights::{bind_parts_without_weights, check_names, left_unbound, own_triangles, piece};
use super::prepare::{check, drop_loose_vertices};
use super::settings::BindSettings;
use super::smooth_influences::smooth_influences;
use crate::character::{Character, Provenance};
use crate::progress::Progress;

/// The share of the time that the bones' own weights take where endpoint weights follow.
const WEIGHTS_SHARE: f64 = 0.6;

/// Binds a model.
///
/// A rigged model keeps its own skeleton and weights (a given skeleton is then ignored, with a warning) unless
/// `settings.replace_rig` is set; materials are always kept. Without a rig the weights are computed; with `replace_rig`
/// and no `skeleton` given, the model's own skeleton is used with new weights. Bones without length (hubs) get no
/// weight. Of a rigged model, what comes without weights gets some if `settings.bind_unbound` is set, and parts named in
/// `settings.transfer` take theirs from the others. `progress` receives the current stage and the fraction of the whole
/// that is done, 0 to 1 and never falling; it may stop the work at any report.
pub fn bind(
    model: Model,
    skeleton: Option<Skeleton>,
    settings: &BindSettings,
    progress: Progress<'_>,
) -> Result<Character, BindError> {
    bind_with_ribs(model, skeleton, &[], settings, progress)
}

/// [`bind`], with ribs.
pub(crate) fn bind_with_ribs(
    model: Model,
    skeleton: Option<Skeleton>,
    ribs: &[Rib],
    settings: &BindSettings,
    progress: Progress<'_>,
) -> Result<Character, BindError> {
    if !settings.skin.stretches() {
        let character = bind_rigidly(model, skeleton, ribs, settings, progress)?;
        return Ok(Character { skin: settings.skin, ..character });
    }
    let mut first = |stage: &'static str, done: f64| progress(stage, WEIGHTS_SHARE * done);
    let mut character = bind_rigidly(model, skeleton, ribs, settings, &mut first)?;
    let mut second = |stage: &'static str, done: f64| progress(stage, WEIGHTS_SHARE + (1.0 - WEIGHTS_SHARE) * done);
    let (endpoints, warnings) = endpoint_weights(&character, settings, &mut second)?;
    Arc::make_mut(&mut character.surface).endpoints = Some(endpoints);
    character.warnings.extend(warnings);
    Ok(Character { skin: settings.skin, ..character })
}

/// Everything but how the skin stretches and twists.
fn bind_rigidly(
    model: Model,
    skeleton: Option<Skeleton>,
    ribs: &[Rib],
    settings: &BindSettings,
    progress: Progress<'_>,
) -> Result<Character, BindError> {
    report(progress, "checking the model", 0.0)?;
    check(&model, settings)?;
    check_names(&model, settings)?;
    let mut model = model;
    let provenance = match model.rig.take() {
        Some(rig) if !settings.replace_rig => {
            if skeleton.is_some_and(|given| given != rig.skeleton) {
                let text = "the model has its own skeleton and weights, so the skeleton given was ignored; ask \
                            for the rig to be replaced to use it";
                model.warnings.push(text.to_owned());
            }
            let mut rig = rig;
            if let Some(least) = settings.smooth_weights {
                let bones = rig.skeleton.len();
                let made = smooth_influences(&model.mesh, &rig.influences, bones, least, progress)?;
                rig.influences = made.influences;
                model.warnings.push(made.told);
            }
            if let Some(most) = settings.limit_painted {
                let (limited, lost) = limit_influences(&rig.influences, most, rig.skeleton.len())?;
                rig.influences = limited;
                if lost.truncated_vertices > 0 {
                    model.warnings.push(format!(
                        "{} vertices followed more than {most} bones, up to {}; the strongest stay, and up to {:.1} % of a \
                         vertex's weight was dropped",
                        lost.truncated_vertices,
                        lost.max_influences_before,
                        100.0 * lost.max_dropped
                    ));
                }
            }
            model.rig = Some(rig);
            if !settings.bind_unbound {
                model.warnings.extend(left_unbound(&model));
            }
            let told = bind_parts_without_weights(&mut model, "weights that came with the file", settings, progress)?;
            model.warnings.extend(told);
            Provenance::Artist
        }
        old => {
            let own = old.as_ref().map(|rig| &rig.skeleton);
            let skeleton = skeleton.or_else(|| own.cloned()).ok_or(BindError::NoSkeleton)?;
            drop_loose_vertices(&mut model);
            // The new weights are computed for the surface as it is stored.
            model.parts.iter_mut().for_each(|part| part.skin = None);
            let (weights, unbound) = computed_weights(&mut model, &skeleton, ribs, settings, progress)?;
            model.warnings.extend(weights.warnings);
            if let Some(avatar) = model.avatar.as_mut().filter(|_| own != Some(&skeleton)) {
                // Its numbers are those of the bones that the file had.
                avatar.humanoid.clear();
                avatar.springs.clear();
            }
            model.rig = Some(ModelRig { skeleton, influences: weights.influences, skins: Vec::new(), unbound });
            let told = bind_parts_without_weights(&mut model, "computed weights", settings, progress)?;
            model.warnings.extend(told);
            Provenance::Computed(weights.record)
        }
    };
    report(progress, "putting the character together", 0.97)?;
    let character = assemble(model, provenance)?;
    report(progress, "done", 1.0)?;
    Ok(character)
}

/// Weights of all bones on all parts together, except those that take theirs from the others; and the vertices of these.
fn computed_weights(
    model: &mut Model,
    skeleton: &Skeleton,
    ribs: &[Rib],
    settings: &BindSettings,
    progress: Progress<'_>,
) -> Result<(BoneWeights, Vec<u32>), BindError> {
    if settings.transfer.is_empty() {
        return Ok((bone_weights(&model.mesh, skeleton, ribs, settings, progress)?, Vec::new()));
    }
    *model = model.split_at_seams();
    let triangles = own_triangles(model, settings);
    if triangles.is_empty() {
        return Err(BindError::NothingToTransfer);
    }
    let (mesh, vertices) = piece(&model.mesh, &triangles);
    let weights = bone_weights(&mesh, skeleton, ribs, settings, progress)?;
    let computed = &weights.influences;
    let per_vertex = computed.per_vertex();
    let count = model.mesh.vertices.len();
    // The others follow the first bone until they get theirs.
    let mut bones = vec![0; count * per_vertex];
    let mut values: Vec<f32> = (0..count * per_vertex).map(|k| if k % per_vertex == 0 { 1.0 } else { 0.0 }).collect();
    let mut unbound = vec![true; count];
    for (row, &vertex) in vertices.iter().enumerate() {
        let (from, to) = (row * per_vertex, vertex as usize * per_vertex);
        bones[to..to + per_vertex].copy_from_slice(&computed.bones()[from..from + per_vertex]);
        values[to..to + per_vertex].copy_from_slice(&computed.weights()[from..from + per_vertex]);
        unbound[vertex as usize] = false;
    }
    let influences = Influences::restore(per_vertex, bones, values, skeleton.len())?;
    let unbound = (0..).zip(unbound).filter(|(_, unbound)| *unbound).map(|(vertex, _)| vertex).collect();
    Ok((BoneWeights { influences, ..weights }, unbound))
}

fn report(progress: Progress<'_>, stage: &'static str, done: f64) -> Result<(), BindError> {
    if progress(stage, done).is_break() { Err(BindError::Cancelled { stage }) } else { Ok(()) }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
