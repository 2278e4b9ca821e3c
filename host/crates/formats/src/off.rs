//! Object file format (Geomview), in its text forms.

use armature_geometry::TriangleMesh;

use crate::polygon::{MAX_CONCAVE_CORNERS, triangulate};
use crate::text::{count, decode, number, numbered_lines, numbers, quoted, without_comment};
use crate::{FormatError, Model};

/// Which numbers a vertex line holds, from the letters before OFF.
#[derive(Clone, Copy, Debug, Default)]
struct Layout {
    texture: bool,
    normals: bool,
    homogeneous: bool,
}

/// Reads OFF and its variants with normals (N), colours (C, skipped), texture coordinates (ST) and homogeneous
/// positions (4). Polygons are cut into triangles; a file without the word OFF is taken as plain.
pub(crate) fn read_off(file: &str, bytes: &[u8]) -> Result<Model, FormatError> {
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
            .ok_or_else(|| cut_off(format!("{vertex_count} vertices are announced, there are only {have}")))?;
        let mut words = content.split_whitespace();
        let mut position: [f64; 3] = numbers(file, line, &mut words, "a vertex")?;
        if layout.homogeneous {
            let [w] = numbers(file, line, &mut words, "a vertex of 4OFF")?;
            position = position.map(|c| c / w);
            if !position.iter().all(|c| c.is_finite()) {
                let what = format!("the vertex lies at infinity (w = {w})");
                return Err(FormatError::line(file, line, what, "Export the mesh as plain OFF"));
            }
        }
        model.mesh.vertices.push(position);
        if layout.normals {
            normals.push(numbers::<3>(file, line, &mut words, "a normal")?.map(|c| c as f32));
        }
        if layout.texture {
            // Texture coordinates come last, behind colours of whatever length.
            let rest: Vec<&str> = words.collect();
            let [s, t] = rest.last_chunk().copied().ok_or_else(|| {
                FormatError::line(file, line, "the texture coordinates are missing", "Export the mesh as plain OFF")
            })?;
            textures.push([number(file, line, s)? as f32, 1.0 - number(file, line, t)? as f32]);
        }
    }
    for have in 0..face_count {
        let (line, content) =
            lines.next().ok_or_else(|| cut_off(format!("{face_count} faces are announced, there are only {have}")))?;
        face(file, line, content, &mut model.mesh)?;
    }
    model.normals = layout.normals.then_some(normals);
    model.texture_coordinates = layout.texture.then_some(textures);
    Ok(model)
}

/// The layout by the header word, and what follows that word on its line.
fn header<'t>(file: &str, line: usize, first: &'t str) -> Result<(Layout, &'t str), FormatError> {
    let word = first.split_whitespace().next().unwrap_or_default();
    let Some(letters) = word.strip_suffix("OFF") else {
        if word.bytes().all(|b| b.is_ascii_digit()) {
            return Ok((Layout::default(), first));
        }
        let what = format!("an OFF file starts with OFF, this one with {}", quoted(word));
        return Err(FormatError::line(file, line, what, "Choose an OFF file"));
    };
    let rest = first[word.len()..].trim_start();
    if rest.split_whitespace().next().is_some_and(|w| w.eq_ignore_ascii_case("BINARY")) {
        return Err(FormatError::line(file, line, "this is a binary OFF file", "Export it as text"));
    }
    let mut layout = Layout::default();
    let mut left = letters;
    if let Some(after) = left.strip_prefix("ST") {
        layout.texture = true;
        left = after;
    }
    left = left.strip_prefix('C').unwrap_or(left);
    if let Some(after) = left.strip_prefix('N') {
        layout.normals = true;
        left = after;
    }
    if let Some(after) = left.strip_prefix('4') {
        layout.homogeneous = true;
        left = after;
    }
    if !left.is_empty() {
        let what = format!("{} is no kind of OFF in three dimensions", quoted(word));
        return Err(FormatError::line(file, line, what, "Export the mesh as plain OFF"));
    }
    Ok((layout, rest))
}

fn face(file: &str, line: usize, content: &str, mesh: &mut TriangleMesh) -> Result<(), FormatError> {
    let mut words = content.split_whitespace();
    let corner_count = count(file, line, words.next().unwrap_or_default())?;
    // The line's own length bounds what is kept; colours behind the corners are skipped.
    let mut corners: Vec<u32> = Vec::new();
    for word in words.by_ref().take(corner_count) {
        let vertex = count(file, line, word)?;
        if vertex >= mesh.vertices.len() {
            let what = format!("the face names vertex {vertex}, but there are only {}", mesh.vertices.len());
            return Err(FormatError::line(file, line, what, "OFF counts vertices from 0; export the mesh again"));
        }
        corners.push(vertex as u32);
    }
    if corners.len() < corner_count {
        let what = format!("a face of {corner_count} corners names only {}", corners.len());
        return Err(FormatError::line(file, line, what, "The file may be cut off; export it again"));
    }
    let positions: Vec<[f64; 3]> = corners.iter().map(|&v| mesh.vertices[v as usize]).collect();
    let triangles = triangulate(&positions).ok_or_else(|| {
        let what = format!("a face that is not convex has {corner_count} corners, more than {MAX_CONCAVE_CORNERS}");
        FormatError::line(file, line, what, "Triangulate the mesh in your modelling program")
    })?;
    mesh.triangles.extend(triangles.into_iter().map(|t| t.map(|i| corners[i])));
    Ok(())
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
    }

    #[test]
    fn faults_name_their_place() {
        for (text, place) in [
            ("", Place::Whole),
            ("OFF", Place::Whole),
            ("PLY\n", Place::Line(1)),
            ("5OFF\n1 1 1", Place::Line(1)),
            ("OFF BINARY\n", Place::Line(1)),
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
