//! From a file's bytes to its JSON and buffers.

use std::borrow::Cow;

use gltf_json::buffer::{Buffer, Stride, View};
use gltf_json::validation::USize64;
use gltf_json::{Index, Root, Value};
use serde::Deserialize;

use crate::FormatError;
use crate::model::Resolver;
use crate::text::quoted;

pub(super) const EXPORT_AGAIN: &str = "The file may be cut off or damaged; export it again";

/// The first bytes of a GLB file.
pub(crate) const GLB_MAGIC: &[u8] = b"glTF";
const GLB_HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;

/// Extensions that change the shape and are not read.
const GEOMETRY_EXTENSIONS: [&str; 2] = ["EXT_mesh_gpu_instancing", "KHR_gaussian_splatting"];

/// Extensions that are read, or that do not affect anything we read: no warning.
const COVERED_EXTENSIONS: [&str; 21] = [
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_lights_punctual",
    "KHR_materials_unlit",
    "KHR_materials_specular",
    "KHR_materials_ior",
    "KHR_materials_emissive_strength",
    "KHR_materials_variants",
    "KHR_animation_pointer",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "VRM",
    "VRMC_vrm",
    "VRMC_springBone",
    "VRMC_node_constraint",
    "VRMC_materials_mtoon",
    "VRMC_materials_hdr_emissiveMultiplier",
    "KHR_node_visibility",
];

/// Whether an extension says only how a surface looks or what else is in the scene, so that the shape is whole without
/// it.
fn is_about_looks(extension: &str) -> bool {
    let (_, name) = extension.split_once('_').unwrap_or_default();
    ["materials_", "texture_", "lights_"].iter().any(|about| name.starts_with(about))
}

/// Enough of a file to tell its version; glTF 1.0 has little else in common.
#[derive(Deserialize)]
struct Head {
    asset: Option<AssetHead>,
}

#[derive(Deserialize)]
struct AssetHead {
    version: Option<serde_json::Value>,
}

/// The version that a file states, as text or (in old files) as a number.
fn version_of(json: &[u8]) -> Option<String> {
    match serde_json::from_slice::<Head>(json).ok()?.asset?.version? {
        serde_json::Value::String(version) => Some(version),
        serde_json::Value::Number(version) => Some(version.to_string()),
        _ => None,
    }
}

fn other_version(file: &str, version: &str) -> FormatError {
    let what = format!("this is glTF {}, not 2.0", version.trim_matches('"'));
    FormatError::whole(
        file,
        what,
        "Convert it to glTF 2.0: import it into a program that reads it, and export it again",
    )
}

/// A file taken apart.
#[derive(Debug)]
pub(super) struct Document<'b> {
    pub(super) file: &'b str,
    pub(super) root: Root,
    pub(super) buffers: Vec<Cow<'b, [u8]>>,
}

impl<'b> Document<'b> {
    /// Parses either form and fetches the buffers.
    pub(super) fn read(file: &'b str, bytes: &'b [u8], resolver: Resolver) -> Result<Self, FormatError> {
        let (json, json_at, binary) =
            if bytes.starts_with(GLB_MAGIC) { split_glb(file, bytes)? } else { (bytes, 0, None) };
        let json = json.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(json);
        if let Some(version) = version_of(json).filter(|version| !version.starts_with("2.")) {
            return Err(other_version(file, &quoted(&version)));
        }
        let root = Root::from_slice(json).map_err(|error| {
            let what = format!("the JSON is not valid glTF 2.0: {}", quoted(&error.to_string()));
            if json_at == 0 {
                return FormatError::line(file, error.line().max(1), what, EXPORT_AGAIN);
            }
            let before: usize =
                json.split_inclusive(|b| *b == b'\n').take(error.line().saturating_sub(1)).map(<[u8]>::len).sum();
            FormatError::byte(file, json_at + before + error.column(), what, EXPORT_AGAIN)
        })?;
        let unknown = |e: &&String| !COVERED_EXTENSIONS.contains(&e.as_str()) && !is_about_looks(e);
        if let Some(extension) = root.extensions_required.iter().find(unknown) {
            let (what, remedy) = if GEOMETRY_EXTENSIONS.contains(&extension.as_str()) {
                ("the shape needs the extension", "Export it without compression and special extensions")
            } else {
                ("the file requires the unknown extension", "Export it as plain glTF 2.0, without that extension")
            };
            return Err(FormatError::whole(file, format!("{what} {}", quoted(extension)), remedy));
        }
        let mut document = Self { file, root, buffers: Vec::new() };
        let mut binary = binary;
        for (index, buffer) in document.root.buffers.iter().enumerate() {
            let data = match (&buffer.uri, index) {
                (Some(uri), _) => Cow::Owned(fetch(file, uri, resolver)?),
                (None, 0) => Cow::Borrowed(binary.take().unwrap_or_default()),
                (None, _) => Cow::Borrowed([].as_slice()),
            };
            if (data.len() as u64) < buffer.byte_length.0 && !is_placeholder(buffer) {
                let what =
                    format!("buffer {index} announces {} bytes, but there are {}", buffer.byte_length.0, data.len());
                return Err(FormatError::whole(file, what, EXPORT_AGAIN));
            }
            document.buffers.push(data);
        }
        Ok(document)
    }

    /// Warns of required extensions that are not read: colours, textures and the like.
    pub(super) fn warn_of_extensions(&self, warnings: &mut Vec<String>) {
        let unknown = self.root.extensions_required.iter().filter(|e| !COVERED_EXTENSIONS.contains(&e.as_str()));
        let names: Vec<String> = unknown.map(|extension| quoted(extension)).collect();
        if !names.is_empty() {
            let (s, them) = if names.len() == 1 { ("", "it") } else { ("s", "them") };
            warnings.push(format!(
                "The file requires the unknown extension{s} {}: the shape is read without {them}.",
                names.join(", ")
            ));
        }
    }

    /// Appends bytes as a buffer with one view.
    pub(super) fn add_view(&mut self, bytes: Vec<u8>, byte_stride: Option<usize>) -> Index<View> {
        let view = View {
            buffer: Index::new(self.buffers.len() as u32),
            byte_length: USize64::from(bytes.len()),
            byte_offset: None,
            byte_stride: byte_stride.map(Stride),
            name: None,
            target: None,
            extensions: None,
            extras: gltf_json::Extras::default(),
        };
        self.buffers.push(Cow::Owned(bytes));
        Index::push(&mut self.root.buffer_views, view)
    }

    pub(super) fn error(&self, what: impl Into<String>) -> FormatError {
        FormatError::whole(self.file, what, EXPORT_AGAIN)
    }

    /// The item at an index, or an error that names the index.
    pub(super) fn get<'a, T>(&self, list: &'a [T], index: Index<T>, what: &str) -> Result<&'a T, FormatError> {
        list.get(index.value()).ok_or_else(|| {
            self.error(format!("{what} {} is referenced, but there are only {}", index.value(), list.len()))
        })
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, index: Index<View>) -> Result<(&[u8], &View), FormatError> {
        let view = self.get(&self.root.buffer_views, index, "buffer view")?;
        let start = view.byte_offset.unwrap_or_default().0;
        let bytes = usize::try_from(start)
            .ok()
            .zip(start.checked_add(view.byte_length.0).and_then(|end| usize::try_from(end).ok()))
            .and_then(|(start, end)| self.buffers.get(view.buffer.value())?.get(start..end));
        let bytes = bytes.ok_or_else(|| self.error(format!("buffer view {} is outside its buffer", index.value())))?;
        Ok((bytes, view))
    }

    /// A file that the document references.
    pub(super) fn fetch(&self, uri: &str, resolver: Resolver) -> Result<Vec<u8>, FormatError> {
        fetch(self.file, uri, resolver)
    }
}

/// Whether a buffer holds nothing: it only says how long the data of compressed views is.
fn is_placeholder(buffer: &Buffer) -> bool {
    let extensions = buffer.extensions.iter().flat_map(|extensions| &extensions.others);
    buffer.uri.is_none()
        && extensions.into_iter().any(|(name, value)| {
            name.ends_with("_meshopt_compression") && value.get("fallback").and_then(Value::as_bool) == Some(true)
        })
}

/// The JSON chunk, the byte where it starts, and the binary chunk.
type GlbParts<'b> = (&'b [u8], usize, Option<&'b [u8]>);

fn split_glb<'b>(file: &str, bytes: &'b [u8]) -> Result<GlbParts<'b>, FormatError> {
    let word = |at: usize| bytes.get(at..at + 4).and_then(|b| b.first_chunk()).map(|b| u32::from_le_bytes(*b));
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(FormatError::byte(file, bytes.len(), "a GLB file has 12 bytes of header", EXPORT_AGAIN));
    };
    if version != 2 {
        return Err(other_version(file, &format!("{version}.0")));
    }
    if length as usize > bytes.len() {
        let what = format!("the header announces {length} bytes, but there are {}", bytes.len());
        return Err(FormatError::byte(file, bytes.len(), what, EXPORT_AGAIN));
    }
    let bytes = &bytes[..length as usize];
    let (mut json, mut binary) = (None, None);
    let mut at = GLB_HEADER_BYTES;
    while at < bytes.len() {
        let data_at = at + CHUNK_HEADER_BYTES;
        let chunk = word(at).and_then(|length| bytes.get(data_at..data_at.checked_add(length as usize)?));
        let (Some(chunk), Some(kind)) = (chunk, bytes.get(at + 4..data_at)) else {
            return Err(FormatError::byte(file, at, "a chunk is longer than the file", EXPORT_AGAIN));
        };
        match kind {
            b"JSON" if json.is_none() => json = Some((chunk, data_at)),
            b"BIN\0" if binary.is_none() => binary = Some(chunk),
            // Chunks of other types must be ignored.
            _ => {}
        }
        at = data_at + chunk.len();
    }
    let (json, json_at) =
        json.ok_or_else(|| FormatError::byte(file, GLB_HEADER_BYTES, "there is no JSON chunk", EXPORT_AGAIN))?;
    Ok((json, json_at, binary))
}

fn fetch(file: &str, uri: &str, resolver: Resolver) -> Result<Vec<u8>, FormatError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let base64 = data.split_once(";base64,").and_then(|(_, text)| decode_base64(text));
        return base64.ok_or_else(|| FormatError::whole(file, "an embedded buffer is not base64", EXPORT_AGAIN));
    }
    let name = decode_percent(uri);
    resolver(&name).map_err(|error| {
        let what = format!("the file {} that belongs to it cannot be read: {error}", quoted(&name));
        FormatError::whole(file, what, "Keep a .gltf file together with its .bin and images, or export as .glb")
    })
}

fn decode_percent(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let hex = uri.get(at + 1..at + 3).filter(|_| bytes[at] == b'%').and_then(|h| u8::from_str_radix(h, 16).ok());
        out.push(hex.unwrap_or(bytes[at]));
        at += if hex.is_some() { 3 } else { 1 };
    }
    String::from_utf8_lossy(&out).into_owned()
}

fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0_u32, 0);
    for byte in text.bytes().filter(|b| !b.is_ascii_whitespace()) {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b'=' => continue,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_and_percent() {
        assert_eq!(decode_base64("AAEC/w==").unwrap(), [0, 1, 2, 255]);
        assert_eq!(decode_base64("TWFu IGlz\n").unwrap(), b"Man is");
        assert_eq!(decode_base64("A*"), None);
        assert_eq!(decode_percent("a%20b%zz%C3%A9%"), "a b%zzé%");
    }
}
