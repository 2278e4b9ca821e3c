//! STL, binary and text. Triangles are not connected in this format: corners at equal positions become one vertex.
//!
//! Many files bend the format: binary headers that begin with `solid`, text without normals or `endsolid`, with
//! colours, with names joined to keywords. Only the triangles are read; the length decides first whether a file is
//! binary.

use armature_geometry::TriangleMesh;

use super::polygon::triangulate;
use crate::FormatError;
use crate::model::Model;
use crate::model::seams::{position_key, weld};
use crate::text::{counted, decode, number, numbered_lines, without_bom};

const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;
/// The normal comes before the corners.
const NORMAL_BYTES: usize = 12;
const EXPORT_AGAIN: &str = "The file may be cut off or damaged; export it again";

/// The contents of either kind.
#[derive(Debug, Default)]
struct Soup {
    /// Three per triangle.
    corners: Vec<[f64; 3]>,
    warnings: Vec<String>,
}

/// Reads either kind: binary if the file has the length that its header announces, otherwise text if it looks like
/// text, otherwise binary.
pub(crate) fn read_stl(file: &str, bytes: &[u8]) -> Result<Model, FormatError> {
    let soup = if announced_length(bytes) != Some(bytes.len()) && is_text_stl(bytes) {
        read_text(file, bytes)?
    } else {
        read_binary(file, bytes)?
    };
    let (firsts, groups) = weld(soup.corners.iter().copied().map(position_key));
    let mesh = TriangleMesh {
        vertices: firsts.iter().map(|&first| soup.corners[first as usize]).collect(),
        triangles: groups.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    };
    Ok(Model { mesh, warnings: soup.warnings, ..Model::default() })
}

/// Whether the file has the length that a binary file's header announces.
pub(crate) fn is_binary_stl(bytes: &[u8]) -> bool {
    announced_length(bytes) == Some(bytes.len())
}

/// Whether it begins with `solid` or `facet`, and `facet` or `endsolid` follows soon.
pub(crate) fn is_text_stl(bytes: &[u8]) -> bool {
    /// Longer than any name after `solid`.
    const LOOK_AHEAD: usize = 2000;
    let start = without_bom(bytes).trim_ascii_start();
    let start = &start[..start.len().min(LOOK_AHEAD)];
    let begins = |word: &[u8]| start.get(..word.len()).is_some_and(|s| s.eq_ignore_ascii_case(word));
    let has = |word: &[u8]| start.windows(word.len()).any(|w| w.eq_ignore_ascii_case(word));
    (begins(b"solid") || begins(b"facet")) && (has(b"facet") || has(b"endsolid"))
}

/// The length of a binary file with this header.
fn announced_length(bytes: &[u8]) -> Option<usize> {
    (announced(bytes)? as usize).checked_mul(TRIANGLE_BYTES)?.checked_add(HEADER_BYTES)
}

/// How many triangles a binary header announces.
fn announced(bytes: &[u8]) -> Option<u32> {
    bytes.get(HEADER_BYTES - 4..HEADER_BYTES)?.first_chunk().map(|b| u32::from_le_bytes(*b))
}

fn read_binary(file: &str, bytes: &[u8]) -> Result<Soup, FormatError> {
    let Some(count) = announced(bytes) else {
        let what = format!("a binary STL file has {HEADER_BYTES} bytes of header, this one has {}", bytes.len());
        return Err(FormatError::byte(file, bytes.len(), what, EXPORT_AGAIN));
    };
    let there = (bytes.len() - HEADER_BYTES) / TRIANGLE_BYTES;
    if count as usize > there {
        let what = format!("{count} triangles are announced, but there are only {there}");
        return Err(FormatError::byte(file, bytes.len(), what, EXPORT_AGAIN));
    }
    let mut soup = Soup::default();
    let after = bytes.len() - HEADER_BYTES - count as usize * TRIANGLE_BYTES;
    if after > 0 {
        soup.warnings.push(format!("{} after the last triangle: ignored.", counted(after, ["byte", "bytes"])));
    }
    let records = bytes[HEADER_BYTES..].chunks_exact(TRIANGLE_BYTES).take(count as usize);
    for (index, record) in records.enumerate() {
        let numbers: Vec<f32> = record[NORMAL_BYTES..TRIANGLE_BYTES - 2]
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        if !numbers.iter().all(|c| c.is_finite()) {
            let what = format!("a corner of triangle {} is not finite", index + 1);
            return Err(FormatError::byte(file, HEADER_BYTES + index * TRIANGLE_BYTES, what, EXPORT_AGAIN));
        }
        soup.corners.extend(numbers.chunks_exact(3).map(|c| [c[0], c[1], c[2]].map(f64::from)));
    }
    Ok(soup)
}

/// The facet that is being read.
struct Facet {
    line: usize,
    corners: Vec<[f64; 3]>,
}

/// Reads words, wherever lines break. An unknown word is skipped with the rest of its line, and counted.
fn read_text(file: &str, bytes: &[u8]) -> Result<Soup, FormatError> {
    let text = decode(bytes);
    let mut soup = Soup::default();
    let mut facet: Option<Facet> = None;
    let (mut unknown, mut ended) = (0_usize, false);
    let mut last_line = 1;
    for (line, content) in numbered_lines(&text) {
        let mut words = content.split_whitespace().peekable();
        if words.peek().is_some() {
            last_line = line;
        }
        while let Some(word) = words.next() {
            match word.to_ascii_lowercase().as_str() {
                "facet" => {
                    close(file, facet.take(), &mut soup)?;
                    facet = Some(Facet { line, corners: Vec::new() });
                }
                "vertex" => {
                    let corner = corner(file, line, &mut words)?;
                    facet.get_or_insert_with(|| Facet { line, corners: Vec::new() }).corners.push(corner);
                }
                "endfacet" => close(file, facet.take(), &mut soup)?,
                // Normals are not needed: the order of the corners says which way a triangle faces.
                "normal" => while words.next_if(|w| !is_keyword(w)).is_some() {},
                "outer" | "loop" | "endloop" => {}
                // The name after it may contain any word.
                "solid" => break,
                "end" => {
                    ended = true;
                    break;
                }
                word if word.starts_with("endsolid") => {
                    ended = true;
                    break;
                }
                _ => {
                    unknown += 1;
                    break;
                }
            }
        }
    }
    if let Some(open) = facet {
        let what = format!("the file ends inside the facet that starts in line {}", open.line);
        return Err(FormatError::line(file, last_line, what, EXPORT_AGAIN));
    }
    if unknown > 0 {
        soup.warnings.push(format!(
            "{} with words that STL does not have, such as colours: ignored.",
            counted(unknown, ["line", "lines"])
        ));
    }
    if !ended {
        soup.warnings.push("There is no \"endsolid\": if the file was cut off, triangles are missing.".to_owned());
    }
    Ok(soup)
}

/// Whether a word may come after the numbers of a normal.
fn is_keyword(word: &str) -> bool {
    ["outer", "loop", "vertex", "endloop", "endfacet"].iter().any(|k| word.eq_ignore_ascii_case(k))
}

fn corner<'w>(file: &str, line: usize, words: &mut impl Iterator<Item = &'w str>) -> Result<[f64; 3], FormatError> {
    let mut corner = [0.0; 3];
    for (have, slot) in corner.iter_mut().enumerate() {
        let word = words.next().ok_or_else(|| {
            FormatError::line(file, line, format!("a vertex needs 3 numbers, but there are only {have}"), EXPORT_AGAIN)
        })?;
        // Single precision, so that text and binary files of one mesh agree.
        *slot = f64::from(number(file, line, word)? as f32);
        if !slot.is_finite() {
            return Err(FormatError::line(
                file,
                line,
                "a coordinate is too large for single precision",
                "Scale the mesh",
            ));
        }
    }
    Ok(corner)
}

/// Adds the triangles of a finished facet.
fn close(file: &str, facet: Option<Facet>, soup: &mut Soup) -> Result<(), FormatError> {
    let Some(facet) = facet else { return Ok(()) };
    let triangles = triangulate(&facet.corners).filter(|t| !t.is_empty()).ok_or_else(|| {
        let what = format!("a facet has {} corners, not 3", facet.corners.len());
        FormatError::line(file, facet.line, what, EXPORT_AGAIN)
    })?;
    soup.corners.extend(triangles.into_iter().flatten().map(|i| facet.corners[i]));
    Ok(())
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
        assert_eq!(fails(TEXT.replace("1e0", "nan").as_bytes()), Place::Line(6));
        assert_eq!(fails(TEXT.replace("1e0", "").as_bytes()), Place::Line(6));
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

    #[test]
    fn text_that_bends_the_format_is_read() {
        let one_line = TEXT.replace("\r\n", " ").replacen("solid ", "", 1).replacen("endsolid  solid b\n", "", 1);
        for (what, text, notes) in [
            ("a byte order mark", format!("\u{FEFF}{TEXT}"), 0),
            ("blanks in front", format!("\n \t\n  {TEXT}"), 0),
            ("a name joined to endsolid", TEXT.replace("endsolid b", "endsolidb"), 0),
            ("two words for endsolid", TEXT.replace("endsolid b", "end solid b"), 0),
            ("no endsolid", TEXT.replace("endsolid b\n", "").replace("endsolid\r\n", ""), 1),
            ("blank lines at the end", format!("{TEXT}\n\n \n"), 0),
            ("colours", TEXT.replace("outer", "color 0.5 0.5 0.5\nouter"), 1),
            ("no normals", TEXT.replace(" NORMAL 0 0 1", "").replace(" normal 0 0 0", ""), 0),
            ("normals that are not finite", TEXT.replace("0 0 1", "nan -nan 1.#IND"), 0),
            ("many words on a line", one_line, 0),
        ] {
            let model = read_stl("a.stl", text.as_bytes()).unwrap_or_else(|error| panic!("{what}: {error}"));
            assert_eq!(model.mesh.triangles.len(), 2, "{what}");
            assert_eq!(model.warnings.len(), notes, "{what}: {:?}", model.warnings);
        }
    }

    #[test]
    fn bytes_after_the_last_triangle_are_named() {
        for header in ["made here", "solid"] {
            let mut bytes = binary(header.as_bytes());
            bytes.extend([0; 7]);
            let model = read_stl("a.stl", &bytes).unwrap();
            assert_eq!(model.mesh.triangles.len(), 2);
            assert_eq!(model.warnings, ["7 bytes after the last triangle: ignored."]);
        }
    }
}
