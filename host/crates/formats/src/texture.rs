//! Image bytes that come along with a model.

use crate::{Model, Resolver, Texture};

/// Fetches an image through the resolver; what is missing or unknown becomes a warning.
pub(crate) fn load_texture(name: &str, resolver: Resolver, model: &mut Model) {
    match resolver(name) {
        Ok(bytes) => set_texture(name, bytes, model),
        Err(error) => model.warnings.push(format!("The texture {name} is missing: {error}.")),
    }
}

/// Takes an image if it is of a kind that can be drawn and exported.
pub(crate) fn set_texture(name: &str, bytes: Vec<u8>, model: &mut Model) {
    match image_mime(&bytes) {
        Some(mime) => model.texture = Some(Texture { mime: mime.to_owned(), bytes }),
        None => model.warnings.push(format!("The texture {name} is left out: it is neither PNG nor JPEG.")),
    }
}

/// By the first bytes, whatever the name or the file says.
fn image_mime(bytes: &[u8]) -> Option<&'static str> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Some("image/png")
    } else if bytes.starts_with(b"\xFF\xD8\xFF") {
        Some("image/jpeg")
    } else {
        None
    }
}

/// A file name from a Windows path: slashes go forward.
pub(crate) fn forward_slashes(name: &str) -> String {
    name.replace('\\', "/")
}
