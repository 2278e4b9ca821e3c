//! Typed arrays in buffers: every component type, normalised integers, strides, sparse overrides.

use gltf_json::accessor::{Accessor, ComponentType, Type};
use gltf_json::validation::Checked;
use gltf_json::{Index, accessor::sparse::Sparse};

use super::container::Document;
use crate::FormatError;

/// Most elements of an array without bytes of its own (a sparse one).
pub(super) const MAX_ELEMENTS: usize = 1 << 24;

impl Document<'_> {
    /// An array of `N` floats per element; integers are normalised if the accessor says so. All values are finite.
    pub(super) fn floats<const N: usize>(&self, index: Index<Accessor>) -> Result<Vec<[f32; N]>, FormatError> {
        let values = self.any_floats::<N>(index)?;
        if let Some(bad) = values.iter().position(|element| !element.iter().all(|v| v.is_finite())) {
            let what = format!("accessor {}, element {bad}: not a finite number", index.value());
            return Err(FormatError::whole(self.file, what, "Repair the model or export it again"));
        }
        Ok(values)
    }

    /// Likewise, but the numbers need not be finite: for attributes that the shape does not depend on.
    pub(super) fn any_floats<const N: usize>(&self, index: Index<Accessor>) -> Result<Vec<[f32; N]>, FormatError> {
        let accessor = self.get(&self.root.accessors, index, "accessor")?;
        let values = self.components(index, accessor, N, |kind, bytes| float(kind, bytes, accessor.normalized))?;
        Ok(values.chunks_exact(N).map(|c| std::array::from_fn(|k| c[k])).collect())
    }

    /// An array of `N` whole numbers per element.
    pub(super) fn integers<const N: usize>(&self, index: Index<Accessor>) -> Result<Vec<[u32; N]>, FormatError> {
        let accessor = self.get(&self.root.accessors, index, "accessor")?;
        if let Checked::Valid(kind) = accessor.component_type
            && !matches!(kind.0, ComponentType::U8 | ComponentType::U16 | ComponentType::U32)
        {
            return Err(self.error(format!("accessor {} must hold whole numbers", index.value())));
        }
        let values = self.components(index, accessor, N, integer)?;
        Ok(values.chunks_exact(N).map(|c| std::array::from_fn(|k| c[k])).collect())
    }

    /// Number of elements an accessor announces.
    pub(super) fn count(&self, index: Index<Accessor>) -> Result<usize, FormatError> {
        let accessor = self.get(&self.root.accessors, index, "accessor")?;
        usize::try_from(accessor.count.0).map_err(|_| self.error("an accessor is too long"))
    }

    fn components<T: Copy + Default>(
        &self,
        index: Index<Accessor>,
        accessor: &Accessor,
        width: usize,
        read: impl Fn(ComponentType, &[u8]) -> T,
    ) -> Result<Vec<T>, FormatError> {
        let error = |what: &str| self.error(format!("accessor {} {what}", index.value()));
        let (Checked::Valid(kind), Checked::Valid(shape)) = (accessor.component_type, accessor.type_) else {
            return Err(error("has no valid type"));
        };
        let kind = kind.0;
        // Columns of small 2×2 and 3×3 matrices are padded; nothing we read is one.
        if shape.multiplicity() != width || matches!(shape, Type::Mat2 | Type::Mat3) {
            return Err(error(&format!("has elements of the wrong size: {width} numbers are needed")));
        }
        let count = usize::try_from(accessor.count.0).map_err(|_| error("is too long"))?;
        let element = kind.size() * width;
        let mut out;
        if let Some(view_index) = accessor.buffer_view {
            let (bytes, view) = self.view(view_index)?;
            let stride = view.byte_stride.map_or(element, |s| s.0).max(1);
            let start = usize::try_from(accessor.byte_offset.unwrap_or_default().0).unwrap_or(usize::MAX);
            let end = count
                .checked_sub(1)
                .map_or(Some(start), |last| last.checked_mul(stride)?.checked_add(element)?.checked_add(start));
            let bytes = end
                .and_then(|end| bytes.get(start..end))
                .ok_or_else(|| error(&format!("needs {count} elements, more than its buffer view holds")))?;
            out = Vec::with_capacity(count * width);
            for at in 0..count {
                let element = &bytes[at * stride..at * stride + element];
                out.extend(element.chunks_exact(kind.size()).map(|component| read(kind, component)));
            }
        } else {
            if count > MAX_ELEMENTS {
                return Err(error(&format!("announces {count} elements but has no bytes")));
            }
            out = vec![T::default(); count * width];
        }
        if let Some(sparse) = &accessor.sparse {
            self.override_elements(sparse, &mut out, width, kind, &read).map_err(|what| error(&what))?;
        }
        Ok(out)
    }

    /// Replaces the elements that a sparse accessor lists.
    fn override_elements<T: Copy>(
        &self,
        sparse: &Sparse,
        out: &mut [T],
        width: usize,
        kind: ComponentType,
        read: &impl Fn(ComponentType, &[u8]) -> T,
    ) -> Result<(), String> {
        let Checked::Valid(index_kind) = sparse.indices.component_type else {
            return Err("has sparse indices of an invalid type".to_owned());
        };
        let (indices, _) = self.view(sparse.indices.buffer_view).map_err(|e| e.what)?;
        let (values, _) = self.view(sparse.values.buffer_view).map_err(|e| e.what)?;
        let cut = |bytes: &'_ [u8], offset: u64, size: usize| {
            let start = usize::try_from(offset).ok()?;
            let length = usize::try_from(sparse.count.0).ok()?.checked_mul(size)?;
            Some((start, start.checked_add(length).filter(|&end| end <= bytes.len())?))
        };
        let short = || "has fewer sparse values than it announces".to_owned();
        let (start, end) = cut(indices, sparse.indices.byte_offset.0, index_kind.0.size()).ok_or_else(short)?;
        let indices = indices[start..end].chunks_exact(index_kind.0.size());
        let (start, end) = cut(values, sparse.values.byte_offset.0, kind.size() * width).ok_or_else(short)?;
        let values = values[start..end].chunks_exact(kind.size() * width);
        for (index, value) in indices.zip(values) {
            let index = integer(index_kind.0, index) as usize;
            let element = index.checked_mul(width).and_then(|at| out.get_mut(at..at + width));
            let element = element.ok_or_else(|| format!("overrides element {index}, which does not exist"))?;
            for (slot, component) in element.iter_mut().zip(value.chunks_exact(kind.size())) {
                *slot = read(kind, component);
            }
        }
        Ok(())
    }
}

/// Little-endian bytes of a component, padded with zeros.
fn word(bytes: &[u8]) -> [u8; 4] {
    std::array::from_fn(|k| bytes.get(k).copied().unwrap_or(0))
}

fn integer(_: ComponentType, bytes: &[u8]) -> u32 {
    u32::from_le_bytes(word(bytes))
}

fn float(kind: ComponentType, bytes: &[u8], normalized: bool) -> f32 {
    let raw = u32::from_le_bytes(word(bytes));
    let (value, full) = match kind {
        ComponentType::F32 => return f32::from_le_bytes(word(bytes)),
        ComponentType::I8 => (f64::from(raw as u8 as i8), f64::from(i8::MAX)),
        ComponentType::U8 => (f64::from(raw), f64::from(u8::MAX)),
        ComponentType::I16 => (f64::from(raw as u16 as i16), f64::from(i16::MAX)),
        ComponentType::U16 => (f64::from(raw), f64::from(u16::MAX)),
        ComponentType::U32 => (f64::from(raw), f64::from(u32::MAX)),
    };
    if normalized { (value / full).max(-1.0) as f32 } else { value as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_of_every_type() {
        assert_eq!(float(ComponentType::I8, &[0x80], true), -1.0);
        assert_eq!(float(ComponentType::I8, &[0x80], false), -128.0);
        assert_eq!(float(ComponentType::U8, &[255], true), 1.0);
        assert_eq!(float(ComponentType::I16, &[0xFF, 0x7F], true), 1.0);
        assert_eq!(float(ComponentType::U16, &[0, 1], false), 256.0);
        assert_eq!(float(ComponentType::F32, &1.5_f32.to_le_bytes(), false), 1.5);
        assert_eq!(integer(ComponentType::U16, &[1, 2]), 513);
    }
}
