//! Object file format (Geomview), binary: big-endian numbers of four bytes in the order of the text form.

use super::off_layout::{Layout, add_face, set_attributes};
use crate::FormatError;
use crate::model::Model;

const EXPORT_AGAIN: &str = "The file may be cut off or damaged; export it again";

/// The rest of the file, and the byte at which it begins.
struct Numbers<'b> {
    file: &'b str,
    at: usize,
    left: &'b [u8],
}

impl Numbers<'_> {
    fn word(&mut self, what: &str) -> Result<[u8; 4], FormatError> {
        let Some((word, left)) = self.left.split_first_chunk() else {
            return Err(self.error(format!("the file ends where {what} should be"), EXPORT_AGAIN));
        };
        self.left = left;
        self.at += word.len();
        Ok(*word)
    }

    fn error(&self, what: impl Into<String>, remedy: &str) -> FormatError {
        FormatError::byte(self.file, self.at, what, remedy)
    }

    fn count(&mut self, what: &str) -> Result<u32, FormatError> {
        self.word(what).map(u32::from_be_bytes)
    }

    fn floats<const N: usize>(&mut self, what: &str) -> Result<[f32; N], FormatError> {
        let mut out = [0.0; N];
        for slot in &mut out {
            *slot = f32::from_be_bytes(self.word(what)?);
        }
        Ok(out)
    }
}

/// Reads what follows the header line; `at` is its first byte in the file. Vertex colours have four numbers; after a
/// face's corners come the number of its colour's components and the components.
pub(super) fn read_binary(file: &str, at: usize, data: &[u8], layout: Layout) -> Result<Model, FormatError> {
    let mut numbers = Numbers { file, at, left: data };
    let vertex_count = numbers.count("the number of vertices")?;
    let face_count = numbers.count("the number of faces")?;
    numbers.count("the number of edges")?;
    let mut model = Model::default();
    let (mut normals, mut textures) = (Vec::new(), Vec::new());
    for _ in 0..vertex_count {
        let mut position = numbers.floats::<3>("a vertex")?.map(f64::from);
        if layout.homogeneous {
            let [w] = numbers.floats("a vertex of 4OFF")?;
            position = position.map(|c| c / f64::from(w));
        }
        if !position.iter().all(|c| c.is_finite()) {
            return Err(
                numbers.error("the vertex before this byte is not finite", "Repair the mesh or export it again")
            );
        }
        model.mesh.vertices.push(position);
        if layout.normals {
            normals.push(numbers.floats("a normal")?);
        }
        if layout.colors {
            numbers.floats::<4>("a colour")?;
        }
        if layout.texture {
            let [s, t] = numbers.floats("a texture coordinate")?;
            textures.push([s, 1.0 - t]);
        }
    }
    for _ in 0..face_count {
        let corner_count = numbers.count("a face")?;
        let mut corners = Vec::new();
        for _ in 0..corner_count {
            corners.push(numbers.count("a corner")?);
        }
        add_face(&corners, &mut model.mesh).map_err(|(what, remedy)| numbers.error(what, remedy))?;
        for _ in 0..numbers.count("the number of a colour's components")? {
            numbers.word("a colour")?;
        }
    }
    set_attributes(layout, normals, textures, &mut model);
    Ok(model)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Place;

    /// A quadrilateral and a triangle, the first coloured.
    fn binary(of_vertex: &[f32]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let whole = |bytes: &mut Vec<u8>, numbers: &[u32]| {
            bytes.extend(numbers.iter().flat_map(|n| n.to_be_bytes()));
        };
        let floats = |bytes: &mut Vec<u8>, numbers: &[f32]| {
            bytes.extend(numbers.iter().flat_map(|n| n.to_be_bytes()));
        };
        whole(&mut bytes, &[4, 2, 0]);
        for [x, y] in [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]] {
            floats(&mut bytes, &[x, y, 1.0]);
            floats(&mut bytes, of_vertex);
        }
        whole(&mut bytes, &[4, 0, 1, 2, 3, 3]);
        floats(&mut bytes, &[0.5, 0.5, 1.0]);
        whole(&mut bytes, &[3, 0, 1, 3, 0]);
        bytes
    }

    #[test]
    fn both_kinds_hold_the_same() {
        let read =
            |letters: &str, bytes: &[u8]| read_binary("", 0, bytes, Layout::of_letters(letters).unwrap()).unwrap();
        let model = read("", &binary(&[]));
        assert_eq!(model.mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 3]]);
        assert_eq!(model.mesh.vertices[2], [2.0, 2.0, 1.0]);
        let model = read("STCN4", &binary(&[2.0, 0.0, 0.0, 1.0, 9.0, 9.0, 9.0, 9.0, 0.25, 0.75]));
        assert_eq!(model.mesh.vertices[2], [1.0, 1.0, 0.5]);
        assert_eq!((model.normals.unwrap()[3], model.texture_coordinates.unwrap()[3]), ([0.0, 0.0, 1.0], [0.25, 0.25]));
        let model = read("N", &binary(&[0.0, f32::NAN, 1.0]));
        assert_eq!((model.normals, model.warnings.len(), model.mesh.triangles.len()), (None, 1, 3));
    }

    #[test]
    fn faults_name_their_byte() {
        let whole = binary(&[]);
        let fails = |bytes: &[u8]| read_binary("", 11, bytes, Layout::default()).unwrap_err();
        for end in 0..whole.len() {
            assert_eq!(fails(&whole[..end]).place, Place::Byte(11 + end / 4 * 4), "{end}");
        }
        let at = whole.len() - 8;
        let mut bad = whole;
        bad[at..at + 4].copy_from_slice(&9_u32.to_be_bytes());
        assert!(fails(&bad).what.contains("vertex 9"));
    }
}
