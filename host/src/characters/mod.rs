//! Characters by name or file: our own, saved ones, and models that are bound on the way.

pub mod dynamics;
pub mod filled;
pub mod ground;
pub mod inverse_kinematics;
mod loaded;
pub mod rigging;
pub mod shapes;
pub mod skin;
pub mod targets;
pub mod volumes;

use std::path::{Path, PathBuf};

use armature_character::bind::{BindError, BindSettings};
use armature_character::cache::{CacheError, CacheKey, cache_key};
use armature_character::handle_weights::HandleWeightsError;
use armature_character::volume::MakeError;
use armature_character::{Character, Progress};
use armature_formats::model::{Material, Model};
use armature_geometry::volume::VolumeError;
use armature_rig::Skeleton;
use armature_weights::biharmonic::BiharmonicError;
use armature_weights::monotone::MonotoneError;

use self::volumes::make_failure;
use crate::failure::Failure;
use crate::files::{self, inputs};

pub use loaded::{LoadedCharacter, Shape};

/// The names of the characters the program makes itself.
pub const OWN: [&str; 3] = ["human", "spider", "hand"];

/// Extensions of the files that hold a character, a mesh or a skeleton.
pub const OPENABLE: [&str; 12] =
    ["armature", "fbx", "glb", "gltf", "vrm", "obj", "ply", "stl", "off", "mesh", "bvh", "tgf"];

/// The result of asking for a character.
#[derive(Debug)]
pub struct Found {
    /// The character.
    pub character: LoadedCharacter,
    /// Whole sentences for the user.
    pub warnings: Vec<String>,
}

/// The character for a puppet if none was chosen: the one built like it, else the human.
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
            let read = armature_character::cache::from_bytes(&files::read(path)?);
            let character = read
                .map_err(|e| Failure::input(format!("{source}: {e}"), "bind the model again with `armature bind`"))?;
            Ok(found(source, character))
        }
        "bvh" | "tgf" => {
            let character = LoadedCharacter::bare(&files::name_of(path), source, inputs::skeleton(path)?);
            Ok(Found { character, warnings: Vec::new() })
        }
        "" if !path.exists() => Err(Failure::usage(
            format!("there is no character {source:?}"),
            format!("choose {}, or name a file", OWN.join(", ")),
        )),
        _ => match inputs::figure(path)? {
            inputs::Figure::Bones(bones) => {
                let character = LoadedCharacter::bare(&files::name_of(path), source, bones.skeleton);
                Ok(Found { character, warnings: bones.warnings })
            }
            inputs::Figure::Model(model) => {
                let character =
                    bind_cached(*model, b"", path, None, &BindSettings::default(), true, progress)?.character;
                Ok(found(source, character))
            }
        },
    }
}

/// A character's name as takes hold it: one of our own, or a file's name without its folders, which are private and
/// differ between machines.
pub fn name_in_takes(source: &str) -> String {
    let is_own = OWN.contains(&source);
    if is_own { source.to_owned() } else { files::name_of(Path::new(source)) }
}

/// Finds the character that a take was recorded with: one of our own, or a file in the current folder or next to the
/// take.
pub fn find_for_take(take: &Path, recorded: &str, progress: Progress) -> Result<Found, Failure> {
    let beside = take.with_file_name(name_in_takes(recorded));
    if OWN.contains(&recorded) || Path::new(recorded).exists() || !beside.exists() {
        return find(recorded, progress);
    }
    find(&beside.to_string_lossy(), progress)
}

fn found(source: &str, character: Character) -> Found {
    let mut warnings = character.warnings.clone();
    let (character, undrawn) = LoadedCharacter::bound(source, character);
    warnings.extend(undrawn);
    Found { character, warnings }
}

/// One of our own characters. Shaping one takes seconds, so it is kept for the next time, as long as this is the same
/// program file.
fn own(name: &str, progress: Progress) -> Result<Character, Failure> {
    let cached = program_stamp().zip(cache_folder()).map(|(stamp, folder)| {
        let key = armature_character::cache::cache_key(&[name.as_bytes(), &stamp], &BindSettings::default());
        folder.join(format!("{key}.armature"))
    });
    if let Some(character) = cached.as_deref().and_then(read_cached) {
        return Ok(character);
    }
    if progress("shaping the character", 0.0).is_break() {
        return Err(Failure::usage("cancelled", ""));
    }
    let made = match name {
        "spider" => armature_character::own::spider(),
        "hand" => armature_character::own::hand(),
        _ => armature_character::own::human(),
    };
    let character =
        made.map_err(|e| Failure::not_converged(format!("{name}: {e}"), "this is a defect; please report it"))?;
    keep(cached.as_deref(), &character);
    Ok(character)
}

/// One of our own characters with endpoint weights for its skin, which also take seconds and are kept.
fn own_twisting(name: &str, character: Character, progress: Progress) -> Result<Character, Failure> {
    let cached = program_stamp().zip(cache_folder()).map(|(stamp, folder)| {
        let key = cache_key(&[name.as_bytes(), b"twisting", &stamp], &BindSettings::default());
        folder.join(format!("{key}.armature"))
    });
    if let Some(character) = cached.as_deref().and_then(read_cached) {
        return Ok(character);
    }
    let character = armature_character::own::twisting(character, progress).map_err(|e| match e {
        BindError::Biharmonic(HandleWeightsError::Cancelled { .. }) | BindError::Cancelled { .. } => {
            Failure::usage("cancelled", "")
        }
        e => Failure::not_converged(format!("{name}: {e}"), "this is a defect; please report it"),
    })?;
    keep(cached.as_deref(), &character);
    Ok(character)
}

/// Length and time of the program's own file: another build may shape other characters.
fn program_stamp() -> Option<Vec<u8>> {
    let metadata = std::fs::metadata(std::env::current_exe().ok()?).ok()?;
    let modified = metadata.modified().ok()?.duration_since(std::time::UNIX_EPOCH).ok()?;
    Some([metadata.len().to_le_bytes(), (modified.as_nanos() as u64).to_le_bytes()].concat())
}

/// Keeps a character for the next time; if that fails, only time is lost.
fn keep(path: Option<&Path>, character: &Character) {
    if let Some(path) = path
        && let Err(failure) = files::replace(path, &armature_character::cache::to_bytes(character))
    {
        tracing::warn!("the character could not be cached: {}", failure.what);
    }
}

/// A skeleton to bind to.
#[derive(Clone, Copy, Debug)]
pub enum Given<'a> {
    /// A file.
    File(&'a Path),
    /// One that was fitted into the mesh.
    Fitted(&'a Skeleton),
}

impl Given<'_> {
    /// Equal bytes give equal bones.
    fn bytes(self) -> Result<Vec<u8>, Failure> {
        match self {
            Self::File(path) => files::read(path),
            Self::Fitted(skeleton) => Ok([b"fitted, version 1\n", rigging::as_bvh(skeleton)?.as_bytes()].concat()),
        }
    }

    /// And what of the file was not used.
    fn skeleton(self) -> Result<(Skeleton, Vec<String>), Failure> {
        match self {
            Self::File(path) => inputs::handles(path),
            Self::Fitted(skeleton) => Ok((skeleton.clone(), Vec::new())),
        }
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

/// Binds a model, or takes the result of the same work from the cache. `added` names what was done to the file's mesh
/// before; it is empty for nothing.
pub fn bind_cached(
    model: Model,
    added: &[u8],
    mesh: &Path,
    skeleton: Option<Given<'_>>,
    settings: &BindSettings,
    use_cache: bool,
    progress: Progress,
) -> Result<Bound, Failure> {
    let mut mesh_bytes = files::read(mesh)?;
    mesh_bytes.extend_from_slice(added);
    let skeleton_bytes = skeleton.map(Given::bytes).transpose()?;
    let key = cache_key_of(&model, &mesh_bytes, skeleton_bytes.as_deref().unwrap_or_default(), settings);
    let cached = cache_folder().map(|folder| folder.join(format!("{key}.armature")));
    if let Some(character) = cached.as_deref().filter(|_| use_cache).and_then(read_cached) {
        return Ok(Bound { character, from_cache: true });
    }
    let (given, unused) = skeleton.map(Given::skeleton).transpose()?.unzip();
    let mut character =
        armature_character::bind::bind(model, given, settings, progress).map_err(|e| bind_failure(mesh, &e))?;
    character.warnings.extend(unused.unwrap_or_default());
    keep(cached.as_deref(), &character);
    Ok(Bound { character, from_cache: false })
}

/// Colours and images may come from files beside the mesh, so they are hashed along with the mesh's own bytes.
fn cache_key_of(model: &Model, mesh: &[u8], skeleton: &[u8], settings: &BindSettings) -> CacheKey {
    let plain = [Material::default()];
    let materials = if model.materials.is_empty() { plain.as_slice() } else { &model.materials };
    let color = |material: &Material| material.base_color.unwrap_or_default().map(f32::to_le_bytes).concat();
    let colors: Vec<Vec<u8>> = materials.iter().map(color).collect();
    let mut images = materials.iter().flat_map(Material::maps).map(|map| map.map(|texture| texture.bytes.as_slice()));
    let first_image = images.next().flatten().unwrap_or_default();
    let mut inputs = vec![mesh, first_image, &colors[0], skeleton];
    inputs.extend(images.flatten().chain(colors[1..].iter().map(Vec::as_slice)));
    cache_key(&inputs, settings)
}

fn bind_failure(mesh: &Path, error: &armature_character::bind::BindError) -> Failure {
    let what = format!("{}: {error}", mesh.display());
    match error {
        BindError::NoSkeleton => {
            Failure::input(what, format!("armature bind {0} --skeleton BONES.tgf, or --template human", mesh.display()))
        }
        BindError::Cancelled { .. } => Failure::usage(what, ""),
        BindError::Biharmonic(error) => weights_failure(mesh, error),
        BindError::NoSuchPart { .. } => Failure::usage(what, "--transfer takes the name of one of these"),
        BindError::NoSuchBone { .. } => Failure::usage(what, "--twist-curve takes the name of one of these"),
        BindError::NothingToTransfer => Failure::usage(what, "give --transfer for fewer parts"),
        BindError::Heat(_) | BindError::Sparsify(_) | BindError::Smooth(_) | BindError::Transfer(_) => {
            Failure::not_converged(
                what,
                format!("`armature inspect {}` says what is wrong with the mesh", mesh.display()),
            )
        }
        _ => Failure::input(what, format!("`armature inspect {}` says more", mesh.display())),
    }
}

/// Why bounded biharmonic weights could not be computed, with the mesh's file and what to do about it.
pub fn weights_failure(mesh: &Path, error: &HandleWeightsError) -> Failure {
    use armature_character::handle_weights::HandleWeightsError as E;
    let what = format!("{}: {error}", mesh.display());
    match error {
        E::Volume(MakeError::Solid(VolumeError::Empty | VolumeError::HandleLost)) => {
            Failure::input(what, "`--on surface` and `--method heat` need no inside")
        }
        E::Volume(error) => make_failure(error, mesh),
        E::Cancelled { .. } | E::BoundaryElsewhere | E::JointRelease { .. } => Failure::usage(what, ""),
        E::NothingHeld { .. } | E::Handles(_) | E::CageEdge { .. } | E::CagePoint { .. } | E::CageCrossed { .. } => {
            Failure::input(what, "correct the handles")
        }
        E::Biharmonic(BiharmonicError::Factorisation(_) | BiharmonicError::NotFinite { .. }) => Failure::not_converged(
            what,
            format!("`armature inspect {}` says what is wrong with the mesh", mesh.display()),
        ),
        E::Biharmonic(_) => Failure::input(what, "correct the boundary values"),
        E::Monotone(MonotoneError::Factorisation { .. } | MonotoneError::NotFinite { .. }) => {
            Failure::not_converged(what, "a lower --order is easier on the mesh")
        }
        E::Monotone(_) => Failure::input(what, "`--method bbw` has no conditions on extrema"),
        E::Extrema(_) => Failure::not_converged(what, "this is a defect; please report it"),
    }
}

/// A damaged or outdated cache file counts as none: the work is done again, with a warning that says why.
fn read_cached(path: &Path) -> Option<Character> {
    let bytes = std::fs::read(path).ok()?;
    let told = |e: &CacheError| tracing::warn!("the cache file {} is remade: {e}", path.display());
    armature_character::cache::from_bytes(&bytes).inspect_err(told).ok()
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
