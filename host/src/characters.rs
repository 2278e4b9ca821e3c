//! Characters by name or file: our own, saved ones, and models that are bound on the way.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use armature_character::{BindProgress, BindSettings, CacheError, Character, HandleWeightsError, MakeError};
use armature_formats::Model;
use armature_geometry::VolumeError;
use armature_weights::BiharmonicError;

use crate::engine::actor::Actor;
use crate::failure::Failure;
use crate::volumes::make_failure;
use crate::{files, inputs};

/// The names of the characters the program makes itself.
pub const OWN: [&str; 3] = ["human", "spider", "hand"];

/// Is told how far the work is, and stops it with `Break`.
pub type Progress<'a> = &'a mut dyn FnMut(BindProgress) -> ControlFlow<()>;

/// What came of asking for a character.
#[derive(Debug)]
pub struct Found {
    /// The character.
    pub actor: Actor,
    /// What the user should know, in sentences.
    pub warnings: Vec<String>,
}

/// The character for a puppet when none was chosen: the one that is built like it, else the human.
pub fn default_for(device: &str) -> &str {
    match device.strip_prefix("sim:") {
        Some(own) if OWN.contains(&own) => own,
        Some(file) if Path::new(file).extension().is_some() => file,
        _ => OWN[0],
    }
}

/// Finds a character: `human`, `spider`, `hand`, a `.armature` file, a mesh with a rig, or a file with only a skeleton.
pub fn find(source: &str, progress: Progress) -> Result<Found, Failure> {
    if OWN.contains(&source) {
        return own(source, progress).map(|character| found(source, character));
    }
    let path = Path::new(source);
    match files::extension_of(path).as_str() {
        "armature" => {
            let read = armature_character::from_bytes(&files::read(path)?);
            let character = read
                .map_err(|e| Failure::input(format!("{source}: {e}"), "bind the model again with `armature bind`"))?;
            Ok(found(source, character))
        }
        "bvh" | "tgf" => {
            let actor = Actor::bare(&files::name_of(path), source, inputs::skeleton(path)?);
            Ok(Found { actor, warnings: Vec::new() })
        }
        "" if !path.exists() => Err(Failure::usage(
            format!("there is no character {source:?}"),
            format!("choose {}, or name a file", OWN.join(", ")),
        )),
        _ => {
            let model = inputs::model(path)?;
            let character = bind_cached(model, path, None, &BindSettings::default(), true, progress)?.character;
            Ok(found(source, character))
        }
    }
}

fn found(source: &str, character: Character) -> Found {
    let mut warnings = character.warnings.clone();
    let (actor, warning) = Actor::of_character(source, character);
    warnings.extend(warning);
    Found { actor, warnings }
}

/// One of our own characters. Shaping one takes seconds, so it is kept for the next time, as long as this is the same
/// program file.
fn own(name: &str, progress: Progress) -> Result<Character, Failure> {
    let cached = program_stamp().zip(cache_folder()).map(|(stamp, folder)| {
        let key = armature_character::cache_key(&[name.as_bytes(), &stamp], &BindSettings::default());
        folder.join(format!("{key}.armature"))
    });
    if let Some(character) = cached.as_deref().and_then(read_cached) {
        return Ok(character);
    }
    let report = BindProgress { stage: "shaping the character", done: 0.0 };
    if progress(report).is_break() {
        return Err(Failure::usage("cancelled", ""));
    }
    let made = match name {
        "spider" => armature_character::spider(),
        "hand" => armature_character::hand(),
        _ => armature_character::human(),
    };
    let character =
        made.map_err(|e| Failure::not_converged(format!("{name}: {e}"), "this is a defect; please report it"))?;
    keep(cached.as_deref(), &character);
    Ok(character)
}

/// Length and time of the program's own file: another build may shape other characters.
fn program_stamp() -> Option<Vec<u8>> {
    let metadata = std::fs::metadata(std::env::current_exe().ok()?).ok()?;
    let modified = metadata.modified().ok()?.duration_since(std::time::UNIX_EPOCH).ok()?;
    Some([metadata.len().to_le_bytes(), (modified.as_nanos() as u64).to_le_bytes()].concat())
}

/// Keeps a character for the next time; that it cannot be kept costs time and nothing else.
fn keep(path: Option<&Path>, character: &Character) {
    if let Some(path) = path
        && let Err(failure) = files::write(path, &armature_character::to_bytes(character))
    {
        tracing::warn!("the character is not kept for the next time: {}", failure.what);
    }
}

/// A character and where it came from.
#[derive(Debug)]
pub struct Bound {
    /// The character.
    pub character: Character,
    /// Whether it came out of the cache.
    pub from_cache: bool,
}

/// Binds a model, or takes the result of the same work from the cache.
pub fn bind_cached(
    model: Model,
    mesh: &Path,
    skeleton: Option<&Path>,
    settings: &BindSettings,
    use_cache: bool,
    progress: Progress,
) -> Result<Bound, Failure> {
    let mesh_bytes = files::read(mesh)?;
    let skeleton_bytes = skeleton.map(files::read).transpose()?;
    let texture = model.texture.as_ref().map(|t| t.bytes.as_slice()).unwrap_or_default();
    let color: Vec<u8> = model.base_color.unwrap_or_default().iter().flat_map(|c| c.to_le_bytes()).collect();
    let inputs = [mesh_bytes.as_slice(), texture, &color, skeleton_bytes.as_deref().unwrap_or_default()];
    let key = armature_character::cache_key(&inputs, settings);
    let cached = cache_folder().map(|folder| folder.join(format!("{key}.armature")));
    if let Some(character) = cached.as_deref().filter(|_| use_cache).and_then(read_cached) {
        return Ok(Bound { character, from_cache: true });
    }
    let given = skeleton.map(inputs::skeleton).transpose()?;
    let character = armature_character::bind(model, given, settings, progress).map_err(|e| bind_failure(mesh, &e))?;
    keep(cached.as_deref(), &character);
    Ok(Bound { character, from_cache: false })
}

fn bind_failure(mesh: &Path, error: &armature_character::BindError) -> Failure {
    use armature_character::BindError;
    let what = format!("{}: {error}", mesh.display());
    match error {
        BindError::NoSkeleton => Failure::input(what, format!("armature bind {} --skeleton BONES.tgf", mesh.display())),
        BindError::Cancelled { .. } => Failure::usage(what, ""),
        BindError::Biharmonic(error) => weights_failure(mesh, error),
        BindError::Heat(_) | BindError::Sparsify(_) => Failure::not_converged(
            what,
            format!("`armature inspect {}` says what is wrong with the mesh", mesh.display()),
        ),
        _ => Failure::input(what, format!("`armature inspect {}` says more", mesh.display())),
    }
}

/// Why bounded biharmonic weights could not be computed, with the mesh's file and what to do about it.
pub fn weights_failure(mesh: &Path, error: &HandleWeightsError) -> Failure {
    use armature_character::HandleWeightsError as E;
    let what = format!("{}: {error}", mesh.display());
    match error {
        E::Volume(MakeError::Solid(VolumeError::Empty | VolumeError::HandleLost)) => {
            Failure::input(what, "`--on surface` and `--method heat` need no inside")
        }
        E::Volume(error) => make_failure(error, mesh),
        E::Cancelled { .. } | E::BoundaryElsewhere => Failure::usage(what, ""),
        E::NothingHeld { .. } | E::Handles(_) | E::CageEdge { .. } | E::CagePoint { .. } | E::CageCrossed { .. } => {
            Failure::input(what, "correct the handles")
        }
        E::Biharmonic(BiharmonicError::Factorisation(_) | BiharmonicError::NotFinite { .. }) => Failure::not_converged(
            what,
            format!("`armature inspect {}` says what is wrong with the mesh", mesh.display()),
        ),
        E::Biharmonic(_) => Failure::input(what, "correct the boundary values"),
    }
}

/// A damaged or outdated cache file is as good as none: the work is done again, and the user told why.
fn read_cached(path: &Path) -> Option<Character> {
    let bytes = std::fs::read(path).ok()?;
    let told = |e: &CacheError| tracing::warn!("what was kept in {} is made again: {e}", path.display());
    armature_character::from_bytes(&bytes).inspect_err(told).ok()
}

fn cache_folder() -> Option<PathBuf> {
    directories::ProjectDirs::from("", "", "armature").map(|d| d.cache_dir().join("characters"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_puppet_gets_the_character_built_like_it() {
        assert_eq!(default_for("sim:spider"), "spider");
        assert_eq!(default_for("sim:walk.bvh"), "walk.bvh");
        assert_eq!(default_for("sim:joints:32"), "human");
        assert_eq!(default_for("serial:/dev/ttyACM0"), "human");
        assert_eq!(default_for(""), "human");
    }
}
