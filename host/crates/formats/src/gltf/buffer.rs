//! The binary side of a file that is written: views and accessors grow with the bytes.

use gltf_json::accessor::{Accessor, ComponentType, GenericComponentType, Type};
use gltf_json::buffer::{Target, View};
use gltf_json::validation::{Checked, USize64};
use gltf_json::{Index, Root, Value};

/// Everything in a GLB starts at a multiple of this.
const ALIGNMENT: usize = 4;

/// A binary chunk and the document that describes it.
#[derive(Debug, Default)]
pub(super) struct Builder {
    pub(super) root: Root,
    pub(super) binary: Vec<u8>,
}

impl Builder {
    /// Appends bytes as a view of their own.
    pub(super) fn view(&mut self, bytes: &[u8], target: Option<Target>) -> Index<View> {
        self.binary.resize(self.binary.len().next_multiple_of(ALIGNMENT), 0);
        let view = View {
            buffer: Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64::from(self.binary.len())),
            byte_stride: None,
            name: None,
            target: target.map(Checked::Valid),
            extensions: None,
            extras: gltf_json::Extras::default(),
        };
        self.binary.extend_from_slice(bytes);
        Index::push(&mut self.root.buffer_views, view)
    }

    /// Floats, `N` an element, with their bounds.
    pub(super) fn floats<const N: usize>(
        &mut self,
        values: &[[f32; N]],
        shape: Type,
        target: Option<Target>,
    ) -> Index<Accessor> {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let bound = |pick: fn(f32, f32) -> f32| {
            let first = values.first().copied()?;
            let bound = values.iter().fold(first, |b, v| std::array::from_fn(|k| pick(b[k], v[k])));
            Some(Value::from(bound.map(f64::from).to_vec()))
        };
        let (min, max) = (bound(f32::min), bound(f32::max));
        let view = self.view(&bytes, target);
        let accessor = accessor(view, values.len(), ComponentType::F32, shape, min, max);
        Index::push(&mut self.root.accessors, accessor)
    }

    /// Whole numbers in the given width; each has to fit.
    pub(super) fn integers<const N: usize>(
        &mut self,
        values: &[[u32; N]],
        kind: ComponentType,
        shape: Type,
        target: Target,
    ) -> Index<Accessor> {
        let size = kind.size();
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes().into_iter().take(size)).collect();
        let view = self.view(&bytes, Some(target));
        let count = values.len() * N / shape.multiplicity();
        let accessor = accessor(view, count, kind, shape, None, None);
        Index::push(&mut self.root.accessors, accessor)
    }
}

fn accessor(
    view: Index<View>,
    count: usize,
    kind: ComponentType,
    shape: Type,
    min: Option<Value>,
    max: Option<Value>,
) -> Accessor {
    Accessor {
        buffer_view: Some(view),
        byte_offset: None,
        count: USize64::from(count),
        component_type: Checked::Valid(GenericComponentType(kind)),
        extensions: None,
        extras: gltf_json::Extras::default(),
        type_: Checked::Valid(shape),
        min,
        max,
        name: None,
        normalized: false,
        sparse: None,
    }
}
