//! Primitives compressed by `KHR_draco_mesh_compression`.

use std::collections::BTreeMap;

use draco_core::{DecodeLimits, DecoderBuffer, FaceIndex, Mesh, MeshDecoder, PointAttribute};
use gltf_json::accessor::{Accessor, ComponentType, GenericComponentType, Type};
use gltf_json::buffer::View;
use gltf_json::mesh::Semantic;
use gltf_json::validation::{Checked, USize64};
use gltf_json::{Index, Value};
use serde::Deserialize;

use super::accessor::MAX_ELEMENTS;
use super::container::{Document, EXPORT_AGAIN};
use crate::FormatError;

const NAME: &str = "KHR_draco_mesh_compression";

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Packed {
    buffer_view: u32,
    /// The number of each attribute in the compressed data.
    attributes: BTreeMap<String, u32>,
}

/// Gives the accessors of every compressed primitive views with the plain values.
pub(super) fn unpack_primitives(document: &mut Document) -> Result<(), FormatError> {
    for mesh in 0..document.root.meshes.len() {
        for primitive in 0..document.root.meshes[mesh].primitives.len() {
            let found = &document.root.meshes[mesh].primitives[primitive];
            let Some(value) = found.extensions.as_ref().and_then(|e| e.others.get(NAME)).cloned() else { continue };
            unpack(document, [mesh, primitive], value)?;
        }
    }
    Ok(())
}

fn unpack(document: &mut Document, [mesh, primitive]: [usize; 2], value: Value) -> Result<(), FormatError> {
    let wrong = |document: &Document, why: &str| {
        let what = format!("mesh {mesh}, primitive {primitive}, {NAME}: {why}");
        FormatError::whole(document.file, what, EXPORT_AGAIN)
    };
    let packed: Packed = serde_json::from_value(value).map_err(|error| wrong(document, &error.to_string()))?;
    let (bytes, _) = document.view(Index::new(packed.buffer_view))?;
    let limits = DecodeLimits::default().with_max_points(MAX_ELEMENTS as u64).with_max_faces(2 * MAX_ELEMENTS as u64);
    let mut decoded = Mesh::new();
    let outcome = MeshDecoder::new().decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut decoded);
    outcome.map_err(|error| wrong(document, &format!("its bytes are damaged ({error})")))?;

    let corners = (0..decoded.num_faces()).flat_map(|face| decoded.face(FaceIndex(face as u32)));
    let indices: Vec<u8> = corners.flat_map(|point| point.0.to_le_bytes()).collect();
    let view = document.add_view(indices, None);
    let indices = plain_accessor(view, 3 * decoded.num_faces(), ComponentType::U32, Type::Scalar);
    let indices = Index::push(&mut document.root.accessors, indices);
    document.root.meshes[mesh].primitives[primitive].indices = Some(indices);

    let attributes: Vec<(Checked<Semantic>, Index<Accessor>)> =
        document.root.meshes[mesh].primitives[primitive].attributes.iter().map(|(s, i)| (s.clone(), *i)).collect();
    for (semantic, index) in attributes {
        let Checked::Valid(known) = &semantic else { continue };
        let Some(&number) = packed.attributes.get(&known.to_string()) else { continue };
        let attribute = decoded.attribute_by_unique_id(number);
        let attribute = attribute.ok_or_else(|| wrong(document, &format!("it holds no {}", known.to_string())))?;
        let like = document.get(&document.root.accessors, index, "accessor")?;
        let plain = values(attribute, decoded.num_points(), like);
        let (bytes, kind, shape) = plain.map_err(|why| wrong(document, &format!("{} {why}", known.to_string())))?;
        let normalized = like.normalized;
        let view = document.add_view(bytes, None);
        let accessor = Accessor { normalized, ..plain_accessor(view, decoded.num_points(), kind, shape) };
        let accessor = Index::push(&mut document.root.accessors, accessor);
        document.root.meshes[mesh].primitives[primitive].attributes.insert(semantic, accessor);
    }
    Ok(())
}

/// The values of an attribute, one per point, packed as the accessor says.
fn values(
    attribute: &PointAttribute,
    points: usize,
    like: &Accessor,
) -> Result<(Vec<u8>, ComponentType, Type), &'static str> {
    let (Checked::Valid(kind), Checked::Valid(shape)) = (like.component_type, like.type_) else {
        return Err("has no valid type");
    };
    let kind = kind.0;
    let width = shape.multiplicity();
    if usize::from(attribute.num_components()) != width {
        return Err("has elements of another size than its accessor");
    }
    // All types up to 24 bits survive single precision.
    if kind == ComponentType::U32 {
        return Err("has whole numbers of 32 bits");
    }
    let numbers = attribute.read_f32s(points, width);
    let mut bytes = Vec::with_capacity(numbers.len() * kind.size());
    for number in numbers {
        match kind {
            ComponentType::F32 => bytes.extend(number.to_le_bytes()),
            _ => bytes.extend((number as i32).to_le_bytes().into_iter().take(kind.size())),
        }
    }
    Ok((bytes, kind, shape))
}

fn plain_accessor(view: Index<View>, count: usize, kind: ComponentType, shape: Type) -> Accessor {
    Accessor {
        buffer_view: Some(view),
        byte_offset: None,
        count: USize64::from(count),
        component_type: Checked::Valid(GenericComponentType(kind)),
        extensions: None,
        extras: gltf_json::Extras::default(),
        type_: Checked::Valid(shape),
        min: None,
        max: None,
        name: None,
        normalized: false,
        sparse: None,
    }
}
