//! Images of roughness and metallic that lie apart in a file, in one image as everything else has them.

use std::sync::Arc;

use armature_formats::model::{GreyMaps, Model, Texture};
use armature_render::{Picture, decode_picture, encode_png};

/// A larger image is a mistake and would only fill memory.
pub const LARGEST_TEXTURE_SIDE: u32 = 16_384;

/// Makes the metallic-roughness maps of a model's materials. What cannot be used becomes a warning, and the material keeps
/// its number.
pub fn join_grey_maps(model: &mut Model) {
    for grey in std::mem::take(&mut model.grey_maps) {
        let Some(material) = model.materials.get_mut(grey.material as usize) else { continue };
        let mut decoded = |texture: &Option<Arc<Texture>>, kind: &str| {
            let texture = texture.as_ref()?;
            let picture = decode_picture(&texture.bytes, LARGEST_TEXTURE_SIDE);
            picture
                .inspect_err(|reason| {
                    model.warnings.push(format!("The {kind} map of {:?} is not used: {reason}.", material.name));
                })
                .ok()
        };
        let (roughness, metallic) = (decoded(&grey.roughness, "roughness"), decoded(&grey.metallic, "metallic"));
        let Some(joined) = joined(roughness.as_ref(), metallic.as_ref()) else { continue };
        let Ok(bytes) = encode_png(&joined) else { continue };
        // The image stands in place of the number.
        material.roughness = if roughness.is_some() { 1.0 } else { material.roughness };
        material.metallic = if metallic.is_some() { 1.0 } else { material.metallic };
        let wrap = wrap(&grey);
        material.metallic_roughness_map = Some(Arc::new(Texture { mime: "image/png".to_owned(), bytes, wrap }));
    }
}

fn wrap(grey: &GreyMaps) -> [armature_formats::model::Wrap; 2] {
    grey.roughness.as_ref().or(grey.metallic.as_ref()).map(|texture| texture.wrap).unwrap_or_default()
}

/// Roughness in the green and metallic in the blue channel, as large as the larger of both; one that is missing leaves
/// its number alone.
fn joined(roughness: Option<&Picture>, metallic: Option<&Picture>) -> Option<Picture> {
    let both = || roughness.into_iter().chain(metallic);
    let width = both().map(|picture| picture.width).max().filter(|side| *side > 0)?;
    let height = both().map(|picture| picture.height).max().filter(|side| *side > 0)?;
    let at = |picture: Option<&Picture>, x: u32, y: u32| {
        let Some(picture) = picture else { return 255 };
        let nearest = |at: u32, of: u32, side: u32| u64::from(at) * u64::from(side) / u64::from(of);
        let pixel = nearest(y, height, picture.height) * u64::from(picture.width) + nearest(x, width, picture.width);
        picture.rgba.get(4 * pixel as usize).copied().unwrap_or(255)
    };
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let rgba = places.flat_map(|(x, y)| [255, at(roughness, x, y), at(metallic, x, y), 255]).collect();
    Some(Picture { width, height, rgba })
}

#[cfg(test)]
mod tests {
    use armature_formats::model::Material;

    use super::*;

    fn grey(width: u32, height: u32, values: &[u8]) -> Arc<Texture> {
        let rgba = values.iter().flat_map(|&v| [v, v, v, 255]).collect();
        let bytes = encode_png(&Picture { width, height, rgba }).unwrap();
        Arc::new(Texture { mime: "image/png".into(), bytes, ..Texture::default() })
    }

    #[test]
    fn both_are_in_one_image_and_stand_for_the_numbers() {
        let material = Material { roughness: 0.3, metallic: 0.2, ..Material::default() };
        let mut model = Model {
            materials: vec![material.clone(), material],
            grey_maps: vec![
                GreyMaps { material: 0, roughness: Some(grey(2, 1, &[10, 20])), metallic: Some(grey(1, 2, &[30, 40])) },
                GreyMaps { material: 1, roughness: None, metallic: Some(grey(1, 1, &[50])) },
                GreyMaps { material: 7, roughness: Some(grey(1, 1, &[1])), metallic: None },
            ],
            ..Model::default()
        };
        join_grey_maps(&mut model);
        let pixels =
            |material: &Material| decode_picture(&material.metallic_roughness_map.as_ref().unwrap().bytes, 9).unwrap();
        let both = pixels(&model.materials[0]);
        assert_eq!((both.width, both.height), (2, 2));
        assert_eq!(both.rgba, [255, 10, 30, 255, 255, 20, 30, 255, 255, 10, 40, 255, 255, 20, 40, 255]);
        let numbers = |material: &Material| [material.roughness, material.metallic].map(f32::to_bits);
        assert_eq!(numbers(&model.materials[0]), [1.0, 1.0].map(f32::to_bits));
        assert_eq!(pixels(&model.materials[1]).rgba, [255, 255, 50, 255]);
        assert_eq!(numbers(&model.materials[1]), [0.3, 1.0].map(f32::to_bits));
        assert!(model.grey_maps.is_empty() && model.warnings.is_empty());
    }

    #[test]
    fn a_damaged_image_leaves_the_number() {
        let broken = Some(Arc::new(Texture { bytes: vec![1, 2, 3], ..Texture::default() }));
        let mut model = Model {
            materials: vec![Material::default()],
            grey_maps: vec![GreyMaps { material: 0, roughness: broken, metallic: None }],
            ..Model::default()
        };
        let before = model.materials[0].clone();
        join_grey_maps(&mut model);
        assert_eq!(model.materials[0], before);
        assert!(model.warnings[0].contains("roughness map"), "{:?}", model.warnings);
    }
}
