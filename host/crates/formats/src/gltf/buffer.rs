//! The binary side of a file being written: views and accessors grow with the bytes.

use gltf_json::accessor::sparse::{Indices, Sparse, Values};
use gltf_json::accessor::{Accessor, ComponentType, GenericComponentType, IndexComponentType, Type};
use gltf_json::buffer::{Target, View};
use gltf_json::validation::{Checked, USize64};
use gltf_json::{Index, Root, Value};

/// Everything in a GLB is aligned to this.
const ALIGNMENT: usize = 4;

/// A binary chunk and the document that describes it.
#[derive(Debug, Default)]
pub(super) struct Builder {
    pub(super) root: Root,
    pub(super) binary: Vec<u8>,
}

impl Builder {
    /// Appends bytes as a new view.
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

    /// Floats, `N` per element, with their bounds.
    pub(super) fn floats<const N: usize>(
        &mut self,
        values: &[[f32; N]],
        shape: Type,
        target: Option<Target>,
    ) -> Index<Accessor> {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes, target);
        let accessor = accessor(Some(view), values.len(), ComponentType::F32, shape, bounds(values));
        Index::push(&mut self.root.accessors, accessor)
    }

    /// Offsets of a morph target; where most are zero, only the others are stored.
    pub(super) fn offsets(&mut self, values: &[[f32; 3]]) -> Index<Accessor> {
        let moved: Vec<usize> = (0..values.len()).filter(|&k| values[k].iter().any(|c| *c != 0.0)).collect();
        // An index and three numbers against three numbers.
        if moved.is_empty() || 4 * moved.len() > 3 * values.len() {
            return self.floats(values, Type::Vec3, Some(Target::ArrayBuffer));
        }
        let numbers: Vec<u8> = moved.iter().flat_map(|&k| (k as u32).to_le_bytes()).collect();
        let stored: Vec<u8> = moved.iter().flat_map(|&k| values[k]).flat_map(f32::to_le_bytes).collect();
        let (numbers, stored) = (self.view(&numbers, None), self.view(&stored, None));
        let [min, max] = bounds(values);
        let sparse = Sparse {
            count: USize64::from(moved.len()),
            indices: Indices {
                buffer_view: numbers,
                byte_offset: USize64(0),
                component_type: Checked::Valid(IndexComponentType(ComponentType::U32)),
                extensions: None,
                extras: gltf_json::Extras::default(),
            },
            values: Values {
                buffer_view: stored,
                byte_offset: USize64(0),
                extensions: None,
                extras: gltf_json::Extras::default(),
            },
            extensions: None,
            extras: gltf_json::Extras::default(),
        };
        let plain = accessor(None, values.len(), ComponentType::F32, Type::Vec3, [min, max]);
        Index::push(&mut self.root.accessors, Accessor { sparse: Some(sparse), ..plain })
    }

    /// Whole numbers of the given width; each must fit.
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
        let accessor = accessor(Some(view), count, kind, shape, [None, None]);
        Index::push(&mut self.root.accessors, accessor)
    }
}

/// The least and the greatest of each component.
fn bounds<const N: usize>(values: &[[f32; N]]) -> [Option<Value>; 2] {
    [f32::min, f32::max].map(|pick: fn(f32, f32) -> f32| {
        let first = values.first().copied()?;
        let bound = values.iter().fold(first, |b, v| std::array::from_fn(|k| pick(b[k], v[k])));
        Some(Value::from(bound.map(f64::from).to_vec()))
    })
}

fn accessor(
    view: Option<Index<View>>,
    count: usize,
    kind: ComponentType,
    shape: Type,
    [min, max]: [Option<Value>; 2],
) -> Accessor {
    Accessor {
        buffer_view: view,
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
