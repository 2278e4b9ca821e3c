//! From a model and a skeleton to a character that can be posed.

use armature_formats::model::{Model, ModelRig};
use armature_rig::Skeleton;

use super::assemble::assemble;
use super::bone_weights::{Rib, bone_weights};
use super::error::BindError;
use super::prepare::{check, drop_loose_vertices};
use super::settings::BindSettings;
use super::smooth_influences::smooth_influences;
use crate::character::{Character, Provenance};
use crate::progress::Progress;

/// Binds a model.
///
/// A rigged model keeps its own skeleton and weights (a given skeleton is then ignored, with a warning) unless
/// `settings.replace_rig` is set; materials are always kept. Without a rig the weights are computed; with `replace_rig`
/// and no `skeleton` given, the model's own skeleton is used with new weights. Bones without length (hubs) get no
/// weight. `progress` receives the current stage and the fraction of the whole that is done, 0 to 1 and never falling;
/// it may stop the work at any report.
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
    report(progress, "checking the model", 0.0)?;
    check(&model, settings)?;
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
            model.rig = Some(rig);
            Provenance::Artist
        }
        old => {
            let own = old.as_ref().map(|rig| &rig.skeleton);
            let skeleton = skeleton.or_else(|| own.cloned()).ok_or(BindError::NoSkeleton)?;
            drop_loose_vertices(&mut model);
            // The new weights are computed for the surface as it is stored.
            model.parts.iter_mut().for_each(|part| part.skin = None);
            let weights = bone_weights(&model.mesh, &skeleton, ribs, settings, progress)?;
            model.warnings.extend(weights.warnings);
            if let Some(avatar) = model.avatar.as_mut().filter(|_| own != Some(&skeleton)) {
                // Its numbers are those of the bones that the file had.
                avatar.humanoid.clear();
                avatar.springs.clear();
            }
            model.rig = Some(ModelRig { skeleton, influences: weights.influences, skins: Vec::new() });
            Provenance::Computed(weights.record)
        }
    };
    report(progress, "putting the character together", 0.97)?;
    let character = assemble(model, provenance)?;
    report(progress, "done", 1.0)?;
    Ok(character)
}

fn report(progress: Progress<'_>, stage: &'static str, done: f64) -> Result<(), BindError> {
    if progress(stage, done).is_break() { Err(BindError::Cancelled { stage }) } else { Ok(()) }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
