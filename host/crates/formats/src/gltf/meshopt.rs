//! Views compressed by `EXT_meshopt_compression` or `KHR_meshopt_compression`.

use gltf_json::Index;
use meshoptimizer_rs::Workspace;
use meshoptimizer_rs::codec::{
    decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat, decode_index_buffer,
    decode_index_sequence, decode_vertex_buffer,
};
use serde::Deserialize;

use super::container::{Document, EXPORT_AGAIN};
use crate::FormatError;
use crate::text::quoted;

/// The second is the same with more filters.
const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
/// All unpacked views together; more would only fill memory.
const MOST_BYTES: usize = 1 << 30;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Packed {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: usize,
    count: usize,
    mode: String,
    #[serde(default)]
    filter: Option<String>,
}

/// Gives every compressed view a buffer of its own with the plain bytes.
pub(super) fn unpack_views(document: &mut Document) -> Result<(), FormatError> {
    let mut workspace = Workspace::default();
    let mut left = MOST_BYTES;
    for index in 0..document.root.buffer_views.len() {
        let extensions = document.root.buffer_views[index].extensions.as_ref();
        let found = extensions.and_then(|e| NAMES.iter().find_map(|&name| Some((name, e.others.get(name)?.clone()))));
        let Some((name, value)) = found else { continue };
        let wrong = |document: &Document, why: &str| {
            FormatError::whole(document.file, format!("buffer view {index}, {name}: {why}"), EXPORT_AGAIN)
        };
        let packed: Packed = serde_json::from_value(value).map_err(|error| wrong(document, &error.to_string()))?;
        let size = packed.count.checked_mul(packed.byte_stride).filter(|&size| size <= left);
        left -= size.ok_or_else(|| wrong(document, "it is too large"))?;
        let end = packed.byte_offset.checked_add(packed.byte_length);
        let source = document.buffers.get(packed.buffer).zip(end);
        let source = source.and_then(|(buffer, end)| buffer.get(packed.byte_offset..end));
        let source = source.ok_or_else(|| wrong(document, "its bytes are outside its buffer"))?;
        let bytes = unpack(&packed, source, &mut workspace).map_err(|why| wrong(document, &why))?;
        let stride = document.root.buffer_views[index].byte_stride;
        let plain = document.add_view(bytes, stride.map(|stride| stride.0));
        document.root.buffer_views.swap(index, plain.value());
        document.root.buffer_views.truncate(plain.value());
        debug_assert_eq!(document.view(Index::new(index as u32)).map(|(bytes, _)| bytes.len()).ok(), size);
    }
    Ok(())
}

fn unpack(packed: &Packed, source: &[u8], workspace: &mut Workspace) -> Result<Vec<u8>, String> {
    let Packed { count, byte_stride: stride, .. } = *packed;
    let damaged = |error: meshoptimizer_rs::Error| format!("its bytes are damaged ({error})");
    let unpacked = match packed.mode.as_str() {
        "ATTRIBUTES" => decode_vertex_buffer(count, stride, source, workspace),
        "TRIANGLES" => decode_index_buffer(count, stride, source, workspace),
        "INDICES" => decode_index_sequence(count, stride, source, workspace),
        other => return Err(format!("the mode {} is unknown", quoted(other))),
    };
    let mut bytes = unpacked.map_err(damaged)?;
    match packed.filter.as_deref().unwrap_or("NONE") {
        "NONE" => Ok(()),
        "OCTAHEDRAL" => decode_filter_oct(&mut bytes, count, stride, workspace),
        "QUATERNION" => decode_filter_quat(&mut bytes, count, stride, workspace),
        "EXPONENTIAL" => decode_filter_exp(&mut bytes, count, stride, workspace),
        "COLOR" => decode_filter_color(&mut bytes, count, stride, workspace),
        other => return Err(format!("the filter {} is unknown", quoted(other))),
    }
    .map_err(damaged)?;
    Ok(bytes)
}
