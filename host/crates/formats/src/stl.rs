//! STL, binary and text, through `stl_io`. Triangles come loose in this format: corners at equal positions become
//! one vertex.

use std::borrow::Cow;
use std::io::Cursor;

use armature_geometry::TriangleMesh;

use crate::seams::{position_key, weld};
use crate::text::{decode, numbered_lines, quoted};
use crate::{FormatError, Model};

const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;
const EXPORT_AGAIN: &str = "The file may be cut off or damaged; export it again";

/// Reads either kind: text if it starts with `solid` and has no length that only a binary file would have.
pub(crate) fn read_stl(file: &str, bytes: &[u8]) -> Result<Model, FormatError> {
    let says_solid = bytes.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let corners = if says_solid && announced_length(bytes) != Some(bytes.len()) {
        read_text(file, bytes)?
    } else {
        read_binary(file, bytes)?
    };
    let (firsts, groups) = weld(corners.iter().copied().map(position_key));
    let mesh = TriangleMesh {
        vertices: firsts.iter().map(|&first| corners[first as usize]).collect(),
        triangles: groups.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    };
    Ok(Model { mesh, ..Model::default() })
}

/// How long a binary file with this header has to be.
fn announced_length(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER_BYTES - 4..HEADER_BYTES)?.first_chunk().map(|b| u32::from_le_bytes(*b))?;
    (count as usize).checked_mul(TRIANGLE_BYTES)?.checked_add(HEADER_BYTES)
}

fn read_binary(file: &str, bytes: &[u8]) -> Result<Vec<[f64; 3]>, FormatError> {
    let length = announced_length(bytes).filter(|&length| length <= bytes.len()).ok_or_else(|| {
        let what = match bytes.get(HEADER_BYTES - 4..HEADER_BYTES).and_then(|b| b.first_chunk()) {
            Some(count) => {
                let there = (bytes.len() - HEADER_BYTES) / TRIANGLE_BYTES;
                format!("{} triangles are announced, there are only {there}", u32::from_le_bytes(*count))
            }
            None => format!("a binary STL file has {HEADER_BYTES} bytes of header"),
        };
        FormatError::byte(file, bytes.len(), what, EXPORT_AGAIN)
    })?;
    // The crate would take a header that says "solid" for text.
    let mut plain = Cow::Borrowed(&bytes[..length]);
    if bytes[..5].eq_ignore_ascii_case(b"solid") {
        plain.to_mut()[..5].copy_from_slice(b"STL: ");
    }
    collect(plain.as_ref(), |index, what| {
        let byte = HEADER_BYTES + index * TRIANGLE_BYTES;
        FormatError::byte(file, byte, what, EXPORT_AGAIN)
    })
}

fn read_text(file: &str, bytes: &[u8]) -> Result<Vec<[f64; 3]>, FormatError> {
    let text = decode(bytes).to_ascii_lowercase();
    // The crate wants "solid " in front and stops at the first "endsolid", but a file may hold several solids.
    let mut plain = String::from("solid all\n");
    let mut facet_lines = Vec::new();
    let mut closed = false;
    for (line, content) in numbered_lines(&text) {
        match content.split_whitespace().next() {
            None => {}
            Some("solid") => closed = false,
            Some("endsolid") => closed = true,
            Some(first) => {
                if first == "facet" {
                    facet_lines.push(line);
                }
                plain.push_str(content);
                plain.push('\n');
            }
        }
    }
    let last_line = numbered_lines(&text).count();
    if !closed {
        return Err(FormatError::line(file, last_line, "the file ends before \"endsolid\"", EXPORT_AGAIN));
    }
    plain.push_str("endsolid all\n");
    collect(plain.as_bytes(), |index, what| {
        let line = facet_lines.get(index).copied().unwrap_or(last_line);
        FormatError::line(file, line, format!("in or before the facet that starts here: {what}"), EXPORT_AGAIN)
    })
}

/// All corners; `error` makes the error of a triangle.
fn collect(bytes: &[u8], error: impl Fn(usize, String) -> FormatError) -> Result<Vec<[f64; 3]>, FormatError> {
    let mut cursor = Cursor::new(bytes);
    let reader = stl_io::create_stl_reader(&mut cursor).map_err(|e| error(0, quoted(&e.to_string())))?;
    let mut corners = Vec::new();
    for (index, triangle) in reader.enumerate() {
        let triangle = triangle.map_err(|e| error(index, quoted(&e.to_string())))?;
        for vertex in triangle.vertices {
            let position = vertex.0.map(f64::from);
            if !position.iter().all(|c| c.is_finite()) {
                return Err(error(index, format!("a corner of triangle {} is not finite", index + 1)));
            }
            corners.push(position);
        }
    }
    Ok(corners)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Place;

    const TEXT: &str = "solid\r\nFACET NORMAL 0 0 1\r\nouter loop\r\nvertex 0 0 0\r\nvertex 1 0 0\r\nvertex 1 1e0 0\r\n\
        endloop\r\nendfacet\r\nendsolid\r\n\r\nsolid b\nfacet normal 0 0 0\nouter loop\nvertex -0 0 0\n\
        vertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid b\n";

    fn binary(header: &[u8]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(80, 0);
        bytes.extend(2_u32.to_le_bytes());
        let corners = [[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        for triangle in corners.chunks(3) {
            bytes.extend([0; 12]);
            for [x, y] in triangle {
                bytes.extend([*x, *y, 0.0].iter().flat_map(|c| c.to_le_bytes()));
            }
            bytes.extend([0; 2]);
        }
        bytes
    }

    #[test]
    fn corners_are_welded() {
        for bytes in [TEXT.as_bytes().to_vec(), binary(b"made here"), binary(b"solid but binary")] {
            let mesh = read_stl("a.stl", &bytes).unwrap().mesh;
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
            assert_eq!(mesh.vertices[3], [0.0, 1.0, 0.0]);
        }
    }

    #[test]
    fn faults_name_their_place() {
        let fails = |bytes: &[u8]| read_stl("a.stl", bytes).unwrap_err().place;
        assert_eq!(fails(TEXT.replace("1e0", "nan").as_bytes()), Place::Line(2));
        assert_eq!(fails(TEXT.replace("1e0", "").as_bytes()), Place::Line(2));
        assert_eq!(fails(TEXT.replace("vertex -0 0 0", "").as_bytes()), Place::Line(12));
        assert_eq!(fails(&TEXT.as_bytes()[..TEXT.len() - 14]), Place::Line(18));
        let bytes = binary(b"x");
        assert_eq!(fails(&bytes[..bytes.len() - 1]), Place::Byte(bytes.len() - 1));
        assert_eq!(fails(&bytes[..50]), Place::Byte(50));
        let mut huge = bytes.clone();
        huge[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(fails(&huge), Place::Byte(huge.len()));
        let mut nan = bytes.clone();
        nan[84 + 50 + 12..84 + 50 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
        assert_eq!(fails(&nan), Place::Byte(134));
    }
}
