//! From skinned meshes, skeleton and clips to USD.

use super::identifiers::Identifiers;
use super::layer::{Layer, text};
use super::stage::Stage;
use super::write_clip::{Timed, frames_per_second, time_codes, write_clip, write_shapes_alone};
use super::write_material::{Images, write_materials};
use super::write_mesh::write_surface;
use super::write_skeleton::write_skeletons;
use crate::FormatError;
use crate::archive::store;
use crate::gltf::scene::bad;
use crate::gltf::{GlbScene, GlbTimes};

/// Data of files in a package begin at multiples of this many bytes.
const ALIGNMENT: usize = 64;
/// The rate of a scene without clips of even frames.
const USUAL_RATE: f64 = 24.0;
/// The animation of a scene without clips: the weights of its blend shapes.
const SHAPES_ALONE: &str = "shapes";

/// A USD file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UsdFile {
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// What the format has no place for, in sentences.
    pub left_out: Vec<String>,
}

/// Writes a scene as a USD layer of text: metres, +Y up, facing +Z. Below a `SkelRoot` named after the character are a
/// `Skeleton` with its joints' bind and rest transforms, the parts of the surface as skinned meshes with their blend
/// shapes, `UsdPreviewSurface` materials without images, and a `SkelAnimation` for each clip, of which the first is
/// played. Time codes count frames of the first clip, and `timeCodesPerSecond` is their exact rate. `properties`: names
/// and texts for the layer's custom data.
///
/// ```
/// use armature_formats::gltf::{GlbClip, GlbScene};
/// use armature_formats::usd::write_usda;
/// use armature_rig::{Bone, Motion, Skeleton, Transform};
///
/// let bone = Bone { name: "arm".into(), parent: None, rest: Transform::IDENTITY, tail: [0.0, 1.0, 0.0].into() };
/// let skeleton = Skeleton::new(vec![bone]).unwrap();
/// let frames = vec![skeleton.rest_pose(); 2];
/// let motion = Motion::new(skeleton, 1001.0 / 24_000.0, frames).unwrap();
/// let clips = vec![GlbClip::of_motion("wave", &motion)];
/// let file = write_usda(&GlbScene { name: "robot", skeleton: &motion.skeleton, mesh: None, clips }, &[])?;
/// assert!(String::from_utf8_lossy(&file.bytes).contains("timeCodesPerSecond = 23.976023976023978"));
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn write_usda(scene: &GlbScene, properties: &[(String, String)]) -> Result<UsdFile, FormatError> {
    let (layer, left_out) = layer_of(scene, properties, &mut Images::none()).map_err(|error| error.in_file("USD"))?;
    Ok(UsdFile { bytes: layer.into_bytes(), left_out })
}

/// Writes a scene as a USD package: the layer of [`write_usda`] and the images of its materials, uncompressed and aligned.
pub fn write_usdz(scene: &GlbScene, properties: &[(String, String)]) -> Result<UsdFile, FormatError> {
    let mut images = Images::packed();
    let (layer, left_out) = layer_of(scene, properties, &mut images).map_err(|error| error.in_file("USD"))?;
    let name = format!("{}.usda", Identifiers::default().give(scene.name, "character"));
    let files = std::iter::once((name.as_str(), layer.as_bytes())).chain(images.files());
    let bytes = store(files, ALIGNMENT).map_err(|error| bad(error, "Export fewer or shorter clips").in_file("USD"))?;
    Ok(UsdFile { bytes, left_out })
}

fn layer_of(
    scene: &GlbScene,
    properties: &[(String, String)],
    images: &mut Images,
) -> Result<(String, Vec<String>), FormatError> {
    if scene.skeleton.is_empty() && scene.mesh.is_none() {
        return Err(bad("there is neither a mesh nor a skeleton to write", "Export a character"));
    }
    let mut left_out = Vec::new();
    let mut layer = Layer::default();
    let root = Identifiers::default().give(scene.name, "character");
    let even = scene.clips.iter().find_map(|clip| match clip.times {
        GlbTimes::EverySeconds(seconds) => Some(frames_per_second(seconds)),
        GlbTimes::At(_) => None,
    });
    let rate = even.unwrap_or(USUAL_RATE);
    head(&mut layer, &root, scene, rate, properties)?;
    let mut stage = Stage::new(layer, root, scene.skeleton);
    let animations = stage.name("Animations", "Animations");
    let clip_names: Vec<String> = {
        let mut names = Identifiers::default();
        scene.clips.iter().map(|clip| names.give(clip.name, "clip")).collect()
    };
    let (kind, schemas): (_, &[&str]) =
        if scene.skeleton.is_empty() { ("def Xform", &[]) } else { ("def SkelRoot", &["SkelBindingAPI"]) };
    let root = stage.root().to_owned();
    stage.layer().open(kind, &root, schemas, scene.name);
    let first = clip_names.first().map_or(SHAPES_ALONE, String::as_str);
    let played = stage.path(&format!("{animations}/{first}"));
    let skeletons = write_skeletons(&mut stage, scene, &played)?;
    let materials = write_materials(&mut stage, scene.mesh.map_or(&[], |mesh| mesh.materials), images, &mut left_out);
    let shapes = write_surface(&mut stage, scene, &skeletons, &materials, &mut left_out)?;
    if !scene.skeleton.is_empty() {
        stage.layer().open("def Scope", &animations, &[], "");
        for (clip, name) in scene.clips.iter().zip(&clip_names) {
            let (layer, joints) = stage.layer_and_joints();
            left_out.extend(write_clip(
                layer,
                scene.skeleton,
                joints,
                &Timed { clip, surface: scene.mesh.as_ref(), name, rate },
                &shapes,
            )?);
        }
        if clip_names.is_empty() {
            write_shapes_alone(stage.layer(), SHAPES_ALONE, &shapes);
        }
        stage.layer().close();
    }
    if let [first, _, ..] = &clip_names[..] {
        left_out
            .push(format!("USD plays one animation of a skeleton: that is {first}; the others are only in the file"));
    }
    stage.layer().close();
    Ok((stage.finish(), left_out))
}

fn head(
    layer: &mut Layer,
    root: &str,
    scene: &GlbScene,
    rate: f64,
    properties: &[(String, String)],
) -> Result<(), FormatError> {
    layer.line("#usda 1.0\n(");
    layer.line(format_args!("    defaultPrim = \"{root}\""));
    layer.line(concat!("    doc = \"Armature ", env!("CARGO_PKG_VERSION"), "\""));
    layer.line("    metersPerUnit = 1\n    upAxis = \"Y\"");
    let mut end = None;
    for clip in &scene.clips {
        let last = time_codes(clip, rate)?.last().copied().unwrap_or(0.0);
        end = Some(last.max(end.unwrap_or(0.0)));
    }
    if let Some(end) = end {
        layer.line(format_args!("    startTimeCode = 0\n    endTimeCode = {end}"));
        layer.line(format_args!("    framesPerSecond = {rate}"));
        layer.line(format_args!("    timeCodesPerSecond = {rate}"));
    }
    if !properties.is_empty() {
        layer.line("    customLayerData = {");
        let mut names = Identifiers::default();
        for (name, value) in properties {
            layer.line(format_args!("        string {} = {}", names.give(name, "property"), text(value)));
        }
        layer.line("    }");
    }
    layer.line(")\n");
    Ok(())
}
