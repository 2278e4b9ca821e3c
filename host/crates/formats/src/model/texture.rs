//! Image bytes that come with a model.

use std::sync::Arc;

use super::contents::Model;
use super::material::{Texture, Wrap};
use super::resolver::Resolver;

/// Fetches an image through the resolver; a missing or unknown image becomes a warning.
pub(crate) fn load_texture(name: &str, resolver: Resolver, model: &mut Model) {
    match resolver(name) {
        Ok(bytes) => set_texture(name, bytes, model),
        Err(error) => model.warnings.push(format!("The texture {name} is missing: {error}.")),
    }
}

/// Takes an image for the first material if its format can be drawn and exported.
fn set_texture(name: &str, bytes: Vec<u8>, model: &mut Model) {
    if let Some(texture) = texture(name, bytes, [Wrap::Repeat; 2], &mut model.warnings) {
        model.first_material().base_color_map = Some(texture);
    }
}

/// An image, if its format can be drawn and exported.
pub(crate) fn texture(name: &str, bytes: Vec<u8>, wrap: [Wrap; 2], warnings: &mut Vec<String>) -> Option<Arc<Texture>> {
    let Some(mime) = image_mime(&bytes) else {
        warnings.push(format!("The texture {name} is ignored: it is neither PNG nor JPEG."));
        return None;
    };
    Some(Arc::new(Texture { mime: mime.to_owned(), bytes, wrap }))
}

/// Determined by the first bytes, whatever the name or the file says.
fn image_mime(bytes: &[u8]) -> Option<&'static str> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Some("image/png")
    } else if bytes.starts_with(b"\xFF\xD8\xFF") {
        Some("image/jpeg")
    } else {
        None
    }
}

/// A file name from a Windows path, with forward slashes.
pub(crate) fn forward_slashes(name: &str) -> String {
    name.replace('\\', "/")
}
