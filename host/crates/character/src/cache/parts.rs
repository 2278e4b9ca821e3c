//! What a character has beyond one mesh and one colour with its map, as bytes and back. In the file it follows the end
//! of the older layout.

use std::sync::Arc;

use armature_formats::model::{AlphaMode, Material, MeshPart, MorphTarget, Skin, Texture, Wrap};
use glam::{Affine3A, Mat3A, Vec3, Vec3A};

use super::bytes::{Reader, Writer};
use super::error::CacheError;
use crate::character::{Character, Surface};

const OPAQUE: u8 = 0;
const MASK: u8 = 1;
const BLEND: u8 = 2;

const REPEAT: u8 = 0;
const MIRROR: u8 = 1;
const CLAMP: u8 = 2;

pub(super) fn write_parts(w: &mut Writer, character: &Character) {
    let Character { surface, materials, skins, .. } = character;
    let images = images_of(materials);
    w.list(&images, |w, image| {
        w.bytes(image.mime.as_bytes());
        w.bytes(&image.bytes);
    });
    w.list(materials, |w, material| write_material(w, material, &images));
    w.list(&surface.parts, |w, part| {
        // Destructured, so that a new field cannot be forgotten here.
        let MeshPart { name, vertices, triangles, material, skin } = part;
        w.bytes(name.as_bytes());
        [vertices.start, vertices.end, triangles.start, triangles.end].into_iter().for_each(|number| w.u32(number));
        w.option(*material, Writer::u32);
        w.option(*skin, Writer::u32);
    });
    w.list(&surface.morph_targets, |w, target| {
        let MorphTarget { name, part, default_weight, positions, normals } = target;
        w.bytes(name.as_bytes());
        w.u32(*part);
        w.f32s([*default_weight]);
        w.list(positions, |w, p| w.f32s(*p));
        w.list(normals, |w, n| w.f32s(*n));
    });
    w.list(skins, |w, skin| {
        let Skin { name, bound_model_from_bone } = skin;
        w.bytes(name.as_bytes());
        w.list(bound_model_from_bone, |w, frame| {
            let [x, y, z] = [frame.matrix3.x_axis, frame.matrix3.y_axis, frame.matrix3.z_axis];
            [x, y, z, frame.translation].into_iter().for_each(|column| w.f32s(column.to_array()));
        });
    });
}

/// What a later layout added: colours of vertices, and which materials are unlit.
pub(super) fn write_colors(w: &mut Writer, character: &Character) {
    w.option(character.surface.vertex_colors.as_ref(), |w, colors| w.list(colors, |w, c| w.f32s(*c)));
    w.list(&character.materials, |w, material| w.byte(u8::from(material.unlit)));
}

pub(super) fn read_colors(r: &mut Reader, character: &mut Character) -> Result<(), CacheError> {
    let colors = r.option(|r| r.list(16, Reader::f32s::<4>))?;
    if colors.as_ref().is_some_and(|colors| colors.len() != character.surface.mesh.vertices.len()) {
        return Err(r.bad("colours and vertices differ in number"));
    }
    let unlit = r.list(1, |r| match r.byte()? {
        flag @ (0 | 1) => Ok(flag == 1),
        flag => Err(r.bad(format!("a flag that is {flag}, neither 0 nor 1"))),
    })?;
    if unlit.len() != character.materials.len() {
        return Err(r.bad("materials differ in number"));
    }
    for (material, unlit) in character.materials.iter_mut().zip(unlit) {
        material.unlit = unlit;
    }
    Arc::make_mut(&mut character.surface).vertex_colors = colors;
    Ok(())
}

/// An image that repeats.
pub(super) fn read_image(r: &mut Reader) -> Result<Arc<Texture>, CacheError> {
    Ok(Arc::new(Texture { mime: r.text()?, bytes: r.bytes()?.to_vec(), wrap: [Wrap::Repeat; 2] }))
}

/// Whether any image does something else than repeat.
pub(super) fn has_wraps(materials: &[Material]) -> bool {
    materials.iter().flat_map(Material::maps).flatten().any(|map| map.wrap != [Wrap::Repeat; 2])
}

/// What a still later layout added: what is beside each image on the surface.
pub(super) fn write_wraps(w: &mut Writer, materials: &[Material]) {
    w.list(&images_of(materials), |w, image| {
        for wrap in image.wrap {
            w.byte(match wrap {
                Wrap::Repeat => REPEAT,
                Wrap::Mirror => MIRROR,
                Wrap::Clamp => CLAMP,
            });
        }
    });
}

pub(super) fn read_wraps(r: &mut Reader, materials: &mut [Material]) -> Result<(), CacheError> {
    let images = images_of(materials);
    let wraps = r.list(2, |r| Ok([read_wrap(r)?, read_wrap(r)?]))?;
    if wraps.len() != images.len() {
        return Err(r.bad("images differ in number"));
    }
    set_wraps(materials, &wraps);
    Ok(())
}

/// Replaces what is beside each image; images stay shared. `wraps`: one for each of [`images_of`].
fn set_wraps(materials: &mut [Material], wraps: &[[Wrap; 2]]) {
    let images = images_of(materials);
    let wrapped: Vec<Arc<Texture>> =
        images.iter().zip(wraps).map(|(image, &wrap)| Arc::new(Texture { wrap, ..(**image).clone() })).collect();
    for map in materials.iter_mut().flat_map(Material::maps_mut).flatten() {
        if let Some(at) = images.iter().position(|image| Arc::ptr_eq(image, map)) {
            *map = wrapped[at].clone();
        }
    }
}

/// Makes all images repeat.
pub(super) fn drop_wraps(materials: &mut [Material]) {
    let count = images_of(materials).len();
    set_wraps(materials, &vec![[Wrap::Repeat; 2]; count]);
}

fn read_wrap(r: &mut Reader) -> Result<Wrap, CacheError> {
    match r.byte()? {
        REPEAT => Ok(Wrap::Repeat),
        MIRROR => Ok(Wrap::Mirror),
        CLAMP => Ok(Wrap::Clamp),
        kind => Err(r.bad(format!("an unknown way to wrap an image, {kind}"))),
    }
}

/// Each image once, in order of appearance.
fn images_of(materials: &[Material]) -> Vec<Arc<Texture>> {
    let mut images: Vec<Arc<Texture>> = Vec::new();
    for map in materials.iter().flat_map(Material::maps).flatten() {
        if !images.iter().any(|known| Arc::ptr_eq(known, map)) {
            images.push(map.clone());
        }
    }
    images
}

fn write_material(w: &mut Writer, material: &Material, images: &[Arc<Texture>]) {
    let [base_color_map, metallic_roughness_map, normal_map, emissive_map] = material
        .maps()
        .map(|map| map.and_then(|map| images.iter().position(|image| Arc::ptr_eq(image, map))).map(|at| at as u32));
    // Destructured, so that a new field cannot be forgotten here.
    let Material {
        name,
        base_color,
        base_color_map: _,
        metallic,
        roughness,
        metallic_roughness_map: _,
        normal_map: _,
        normal_scale,
        emissive,
        emissive_map: _,
        alpha,
        double_sided,
        // Written by `write_colors`, in a later layout.
        unlit: _,
    } = material;
    w.bytes(name.as_bytes());
    w.option(*base_color, Writer::f32s);
    for map in [base_color_map, metallic_roughness_map, normal_map, emissive_map] {
        w.option(map, Writer::u32);
    }
    w.f32s([*metallic, *roughness, *normal_scale]);
    w.f32s(*emissive);
    let (kind, cutoff) = match alpha {
        AlphaMode::Opaque => (OPAQUE, 0.0),
        AlphaMode::Mask { cutoff } => (MASK, *cutoff),
        AlphaMode::Blend => (BLEND, 0.0),
    };
    w.byte(kind);
    w.f32s([cutoff]);
    w.byte(u8::from(*double_sided));
}

/// Replaces the single part and material of the older layout.
pub(super) fn read_parts(r: &mut Reader, character: &mut Character) -> Result<(), CacheError> {
    let images = r.list(16, read_image)?;
    character.materials = r.list(42, |r| read_material(r, &images))?;
    let parts = r.list(26, |r| {
        let name = r.text()?;
        let [first, end, first_triangle, end_triangle] = [r.u32()?, r.u32()?, r.u32()?, r.u32()?];
        let (material, skin) = (r.option(Reader::u32)?, r.option(Reader::u32)?);
        Ok(MeshPart { name, vertices: first..end, triangles: first_triangle..end_triangle, material, skin })
    })?;
    let morph_targets = r.list(32, |r| {
        Ok(MorphTarget {
            name: r.text()?,
            part: r.u32()?,
            default_weight: r.f32s::<1>()?[0],
            positions: r.list(12, Reader::f32s::<3>)?,
            normals: r.list(12, Reader::f32s::<3>)?,
        })
    })?;
    let bones = character.skeleton.len();
    character.skins = r.list(16, |r| {
        let skin = Skin { name: r.text()?, bound_model_from_bone: r.list(48, read_frame)? };
        if skin.bound_model_from_bone.len() == bones {
            Ok(skin)
        } else {
            Err(r.bad(format!("a skin of {} bones for a skeleton of {bones}", skin.bound_model_from_bone.len())))
        }
    })?;
    // Nothing else shares this surface yet, so nothing is copied.
    let surface: &mut Surface = Arc::make_mut(&mut character.surface);
    (surface.parts, surface.morph_targets) = (parts, morph_targets);
    if character.surface.parts.is_empty() || character.materials.is_empty() {
        return Err(r.bad("there are no parts or no materials"));
    }
    character.check_parts().map_err(|error| r.bad(error.to_string()))
}

fn read_frame(r: &mut Reader) -> Result<Affine3A, CacheError> {
    let column = |r: &mut Reader| Ok::<_, CacheError>(Vec3A::from(Vec3::from_array(r.f32s()?)));
    let [x, y, z] = [column(r)?, column(r)?, column(r)?];
    Ok(Affine3A { matrix3: Mat3A::from_cols(x, y, z), translation: column(r)? })
}

fn read_material(r: &mut Reader, images: &[Arc<Texture>]) -> Result<Material, CacheError> {
    let map = |r: &mut Reader| {
        let number = r.option(Reader::u32)?;
        let image = |number: u32| {
            images.get(number as usize).cloned().ok_or_else(|| r.bad(format!("image {number} of {}", images.len())))
        };
        number.map(image).transpose()
    };
    let (name, base_color) = (r.text()?, r.option(Reader::f32s::<4>)?);
    let (base_color_map, metallic_roughness_map) = (map(r)?, map(r)?);
    let (normal_map, emissive_map) = (map(r)?, map(r)?);
    let [metallic, roughness, normal_scale] = r.f32s()?;
    let emissive = r.f32s()?;
    let (kind, [cutoff]) = (r.byte()?, r.f32s()?);
    let alpha = match kind {
        OPAQUE => AlphaMode::Opaque,
        MASK => AlphaMode::Mask { cutoff },
        BLEND => AlphaMode::Blend,
        _ => return Err(r.bad(format!("an unknown kind of opacity, {kind}"))),
    };
    let double_sided = match r.byte()? {
        flag @ (0 | 1) => flag == 1,
        flag => return Err(r.bad(format!("a flag that is {flag}, neither 0 nor 1"))),
    };
    Ok(Material {
        name,
        base_color,
        base_color_map,
        metallic,
        roughness,
        metallic_roughness_map,
        normal_map,
        normal_scale,
        emissive,
        emissive_map,
        alpha,
        double_sided,
        unlit: false,
    })
}
