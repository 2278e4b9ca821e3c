//! Object file format (Geomview), in its text forms; `off_binary` reads the binary one.

use super::off_binary::read_binary;
use super::off_layout::{Layout, add_face, set_attributes};
use crate::FormatError;
use crate::model::Model;
use crate::text::{any_number, count, decode, numbered_lines, numbers, quoted, without_bom, without_comment};

/// Reads OFF and its variants with normals (N), colours (C, skipped), texture coordinates (ST) and homogeneous
/// positions (4). Polygons are cut into triangles; a file without the word OFF is taken as plain. If a normal
/// is not finite, all normals are ignored; likewise texture coordinates.
pub(crate) fn read_off(file: &str, bytes: &[u8]) -> Result<Model, FormatError> {
    if let Some((layout, data)) = binary_part(bytes) {
        return read_binary(file, bytes.len() - data.len(), data, layout);
    }
    let text = decode(bytes);
    let mut lines = numbered_lines(&text)
        .map(|(line, content)| (line, without_comment(content).trim()))
        .filter(|(_, content)| !content.is_empty());
    let cut_off = |what: String| FormatError::whole(file, what, "The file is cut off; export it again");

    let (line, first) = lines.next().ok_or_else(|| cut_off("the file is empty".to_owned()))?;
    let (layout, rest) = header(file, line, first)?;
    let (line, counts) = if rest.is_empty() {
        lines.next().ok_or_else(|| cut_off("the file ends before its counts".to_owned()))?
    } else {
        (line, rest)
    };
    let mut words = counts.split_whitespace();
    let mut next_count = |what: &str| {
        let word = words.next().ok_or_else(|| {
            FormatError::line(file, line, format!("the number of {what} is missing"), "Write \"vertices faces edges\"")
        })?;
        count(file, line, word)
    };
    let (vertex_count, face_count) = (next_count("vertices")?, next_count("faces")?);

    let mut model = Model::default();
    let (mut normals, mut textures) = (Vec::new(), Vec::new());
    for have in 0..vertex_count {
        let (line, content) = lines
            .next()
            .ok_or_else(|| cut_off(format!("{vertex_count} vertices are announced, but there are only {have}")))?;
        let mut words = content.split_whitespace();
        let mut position: [f64; 3] = numbers(file, line, &mut words, "a vertex")?;
        if layout.homogeneous {
            let [w] = numbers(file, line, &mut words, "a vertex of 4OFF")?;
            position = position.map(|c| c / w);
            if !position.iter().all(|c| c.is_finite()) {
                let what = format!("the vertex is at infinity (w = {w})");
                return Err(FormatError::line(file, line, what, "Export the mesh as plain OFF"));
            }
        }
        let attribute = |word: Option<&str>| word.and_then(any_number).map_or(f32::NAN, |value| value as f32);
        model.mesh.vertices.push(position);
        if layout.normals {
            normals.push([attribute(words.next()), attribute(words.next()), attribute(words.next())]);
        }
        if layout.texture {
            // Texture coordinates come last, after colours of any length.
            let rest: Vec<&str> = words.collect();
            let [s, t] = rest.last_chunk().copied().ok_or_else(|| {
                FormatError::line(file, line, "the texture coordinates are missing", "Export the mesh as plain OFF")
            })?;
            textures.push([attribute(Some(s)), 1.0 - attribute(Some(t))]);
        }
    }
    for have in 0..face_count {
        let (line, content) = lines
            .next()
            .ok_or_else(|| cut_off(format!("{face_count} faces are announced, but there are only {have}")))?;
        face(file, line, content, &mut model)?;
    }
    set_attributes(layout, normals, textures, &mut model);
    Ok(model)
}

/// What follows the header line of a binary file.
fn binary_part(bytes: &[u8]) -> Option<(Layout, &[u8])> {
    let bytes = without_bom(bytes);
    let end = bytes.iter().take(80).position(|b| *b == b'\n')?;
    let mut words = std::str::from_utf8(&bytes[..end]).ok()?.split_whitespace();
    let layout = Layout::of_letters(words.next()?.strip_suffix("OFF")?)?;
    let binary = words.next()?.eq_ignore_ascii_case("BINARY") && words.next().is_none();
    binary.then_some((layout, &bytes[end + 1..]))
}

/// The layout from the header word, and the rest of its line.
fn header<'t>(file: &str, line: usize, first: &'t str) -> Result<(Layout, &'t str), FormatError> {
    let word = first.split_whitespace().next().unwrap_or_default();
    let Some(letters) = word.strip_suffix("OFF") else {
        if word.bytes().all(|b| b.is_ascii_digit()) {
            return Ok((Layout::default(), first));
        }
        let what = format!("an OFF file starts with OFF, but this one with {}", quoted(word));
        return Err(FormatError::line(file, line, what, "Choose an OFF file"));
    };
    let rest = first[word.len()..].trim_start();
    let layout = Layout::of_letters(letters).ok_or_else(|| {
        let what = format!("{} is not a three-dimensional kind of OFF", quoted(word));
        FormatError::line(file, line, what, "Export the mesh as plain OFF")
    })?;
    Ok((layout, rest))
}

fn face(file: &str, line: usize, content: &str, model: &mut Model) -> Result<(), FormatError> {
    let mut words = content.split_whitespace();
    let corner_count = count(file, line, words.next().unwrap_or_default())?;
    // The line's own length limits what is kept; colours after the corners are skipped.
    let mut corners: Vec<u32> = Vec::new();
    for word in words.by_ref().take(corner_count) {
        // An index too large for 32 bits is out of range anyway.
        corners.push(u32::try_from(count(file, line, word)?).unwrap_or(u32::MAX));
    }
    if corners.len() < corner_count {
        let what = format!("a face of {corner_count} corners lists only {}", corners.len());
        return Err(FormatError::line(file, line, what, "The file may be cut off; export it again"));
    }
    add_face(&corners, &mut model.mesh).map_err(|(what, remedy)| FormatError::line(file, line, what, remedy))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Place;

    #[test]
    fn variants() {
        let plain = "OFF\n# comment\n4 1 0\n0 0 0\n1 0 0\n1 1 0 # c\n\n0 1 0\n4 0 1 2 3 255 0 0\n";
        let model = read_off("a.off", plain.as_bytes()).unwrap();
        assert_eq!(model.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        for text in ["OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2", "3 1\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2"] {
            assert_eq!(read_off("", text.as_bytes()).unwrap().mesh.triangles, [[0, 1, 2]]);
        }
        let rich = "STCN4OFF\n3 1 0\n0 0 0 2 0 0 1 9 9 9 9 .25 .5\n2 0 0 2 0 0 1 9 9 9 9 0 0\n\
                    0 4 0 2 0 0 1 9 9 9 9 1 1\n3 0 1 2 0.5 0.5 0.5\n";
        let model = read_off("", rich.as_bytes()).unwrap();
        assert_eq!(model.mesh.vertices[2], [0.0, 2.0, 0.0]);
        assert_eq!(model.normals.unwrap()[0], [0.0, 0.0, 1.0]);
        assert_eq!(model.texture_coordinates.unwrap()[0], [0.25, 0.5]);
        let colours = "COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 255 0 0 255\n0 1 0 255 0 0 255\n3 0 1 2\n";
        assert_eq!(read_off("", colours.as_bytes()).unwrap().mesh.vertices.len(), 3);
        let mut binary = b"OFF BINARY\r\n".to_vec();
        binary.extend([0, 0, 0, 3, 0, 0, 0, 1, 0, 0, 0, 0]);
        binary.extend([0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|c| c.to_be_bytes()));
        binary.extend([0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 0]);
        assert_eq!(read_off("", &binary).unwrap().mesh.triangles, [[0, 1, 2]]);
        let spoilt = "NOFF\n3 1 0\n0 0 0 1.#IND 0 1\n1 0 0 nan 0 1\n0 1 0\n3 0 1 2\n";
        let model = read_off("", spoilt.as_bytes()).unwrap();
        assert_eq!((model.normals, model.warnings.len()), (None, 1));
    }

    #[test]
    fn faults_name_their_place() {
        for (text, place) in [
            ("", Place::Whole),
            ("OFF", Place::Whole),
            ("PLY\n", Place::Line(1)),
            ("5OFF\n1 1 1", Place::Line(1)),
            ("OFF BINARY\n", Place::Byte(11)),
            ("OFF BINARY", Place::Line(1)),
            ("OFF\n3\n", Place::Line(2)),
            ("OFF\n18446744073709551615 9 9\n0 0 0\n", Place::Whole),
            ("OFF\n3 1 0\n0 0 0\n0 0 nan\n0 0 0\n3 0 1 2", Place::Line(4)),
            ("OFF\n3 1 0\n0 0 0\n0 0 1\n0 1 0\n3 0 1 3", Place::Line(6)),
            ("OFF\n3 1 0\n0 0 0\n0 0 1\n0 1 0\n3 0 1 -1", Place::Line(6)),
            ("OFF\n3 1 0\n0 0 0\n0 0 1\n0 1 0\n99999999999 0 1 2", Place::Line(6)),
            ("OFF\n3 2 0\n0 0 0\n0 0 1\n0 1 0\n3 0 1 2", Place::Whole),
            ("4OFF\n1 0 0\n0 0 0 0", Place::Line(3)),
        ] {
            assert_eq!(read_off("x.off", text.as_bytes()).unwrap_err().place, place, "{text:?}");
        }
    }
}
