//! Stanford PLY, text and binary, through `ply-rs-bw`.

use std::borrow::Cow;
use std::io::Cursor;

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult};

use super::polygon::{MAX_CONCAVE_CORNERS, triangulate};
use crate::model::seams::{position_key, weld};
use crate::model::{Model, Split};
use crate::text::{any_number, quoted};
use crate::{FormatError, Place};

const EXPORT_AGAIN: &str = "The file may be cut off or damaged; export it again";

#[derive(Debug, Default)]
struct Vertex {
    position: [f64; 3],
    normal: [f32; 3],
    texture: [f32; 2],
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let value = match property {
            Property::Char(v) => f64::from(v),
            Property::UChar(v) => f64::from(v),
            Property::Short(v) => f64::from(v),
            Property::UShort(v) => f64::from(v),
            Property::Int(v) => f64::from(v),
            Property::UInt(v) => f64::from(v),
            Property::Float(v) => f64::from(v),
            Property::Double(v) => v,
            _ => return PropertyAccessResult::Ignored,
        };
        if let Some(axis) = ["x", "y", "z"].iter().position(|n| *n == name) {
            self.position[axis] = value;
        } else if let Some(axis) = NORMAL.iter().position(|n| *n == name) {
            self.normal[axis] = value as f32;
        } else if let Some((axis, _)) = texture_axis(name) {
            self.texture[axis] = value as f32;
        } else {
            return PropertyAccessResult::Ignored;
        }
        PropertyAccessResult::Set
    }
}

const NORMAL: [&str; 3] = ["nx", "ny", "nz"];

/// Texture coordinates have several common names.
fn texture_axis(name: &str) -> Option<(usize, usize)> {
    let names = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"]];
    names.iter().enumerate().find_map(|(kind, pair)| pair.iter().position(|n| *n == name).map(|axis| (axis, kind)))
}

/// A face's corners; negative ones count as out of range, like those that are too large.
#[derive(Debug, Default)]
struct Face {
    corners: Vec<i64>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !is_corner_list(name) {
            return PropertyAccessResult::Ignored;
        }
        // Some programs write indices as floats; one that is not whole counts as out of range.
        let whole = |v: f64| if v.fract() == 0.0 && v.abs() < 1e15 { v as i64 } else { i64::MIN };
        self.corners = match property {
            Property::ListChar(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUChar(v) => v.into_iter().map(i64::from).collect(),
            Property::ListShort(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUShort(v) => v.into_iter().map(i64::from).collect(),
            Property::ListInt(v) => v.into_iter().map(i64::from).collect(),
            // The end of a strip, -1, as an unsigned number.
            Property::ListUInt(v) => v.into_iter().map(|i| if i == u32::MAX { -1 } else { i64::from(i) }).collect(),
            Property::ListFloat(v) => v.into_iter().map(|i| whole(f64::from(i))).collect(),
            Property::ListDouble(v) => v.into_iter().map(whole).collect(),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

fn is_corner_list(name: &str) -> bool {
    name == "vertex_indices" || name == "vertex_index"
}

/// An element that is skipped.
#[derive(Debug)]
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

/// The triangles of strips: every second one has the opposite orientation, and -1 ends a strip.
fn triangles_of_strip(corners: &[i64]) -> impl Iterator<Item = Face> {
    let strips = corners.split(|&corner| corner == -1);
    let turned = |(i, w): (usize, &[i64])| if i % 2 == 0 { vec![w[0], w[1], w[2]] } else { vec![w[1], w[0], w[2]] };
    let triangles = strips.flat_map(move |strip| strip.windows(3).enumerate().map(turned));
    // Strips are joined by triangles that repeat a corner.
    triangles.filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]).map(|corners| Face { corners })
}

/// Reads vertices, polygons and triangle strips; other elements and properties are skipped. If vertices have
/// normals or texture coordinates, those at the same place become one vertex of the mesh.
pub(crate) fn read_ply(file: &str, bytes: &[u8]) -> Result<Model, FormatError> {
    let bytes = readable(bytes);
    let mut reader = Reader::new(Cursor::new(bytes.as_ref()));
    let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(|error| {
        let line = error.line().unwrap_or(1);
        FormatError::line(file, line, plain_message(&error), "Export the file again, as PLY 1.0")
    })?;
    check_header(file, &header)?;
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for element in header.elements.values() {
        match element.name.as_str() {
            "vertex" => vertices = read_element::<Vertex>(file, &mut reader, element, &header)?,
            "face" => faces.extend(read_element::<Face>(file, &mut reader, element, &header)?),
            "tristrips" => {
                let strips = read_element::<Face>(file, &mut reader, element, &header)?;
                faces.extend(strips.iter().flat_map(|strip| triangles_of_strip(&strip.corners)));
            }
            _ => drop(read_element::<Skipped>(file, &mut reader, element, &header)?),
        }
    }
    build(file, &header, first_vertex_line(&bytes, &header), &vertices, &faces)
}

/// The line where the vertices of a text file begin, if every element has its own line.
fn first_vertex_line(bytes: &[u8], header: &Header) -> Option<usize> {
    let text = String::from_utf8_lossy(bytes);
    let end = text.lines().position(|line| line.trim() == "end_header")?;
    let before = header.elements.values().take_while(|e| e.name != "vertex").map(|e| e.count).sum::<usize>();
    matches!(header.encoding, Encoding::Ascii).then_some(end + 2 + before)
}

/// The file in the form the crate needs: the header in UTF-8, though its comments may be in any encoding, and numbers
/// with digits on both sides of the decimal point. Line numbers do not change.
fn readable(bytes: &[u8]) -> Cow<'_, [u8]> {
    const END: &[u8] = b"end_header";
    let end = bytes.windows(END.len()).position(|w| w == END).unwrap_or(bytes.len());
    let (header, payload) = bytes.split_at(end);
    let header = String::from_utf8_lossy(header);
    let is_text = header.lines().any(|line| line.trim_start().starts_with("format ascii"));
    let bare_point = |w: &[u8]| w[1] == b'.' && !(w[0].is_ascii_digit() && w[2].is_ascii_digit());
    // Finite numbers have none of these characters; NaN, infinity and `1.#IND` have one.
    let no_number = |b: &u8| matches!(b, b'n' | b'N' | b'#');
    let numbers = payload.get(END.len()..).unwrap_or_default();
    let rewrite =
        is_text && (numbers.windows(3).any(bare_point) || numbers.ends_with(b".") || numbers.iter().any(no_number));
    match (&header, rewrite) {
        (Cow::Borrowed(_), false) => Cow::Borrowed(bytes),
        (_, false) => Cow::Owned([header.as_bytes(), payload].concat()),
        (_, true) => {
            let payload = String::from_utf8_lossy(payload);
            let lines: Vec<String> = payload.split('\n').map(whole_numbers).collect();
            Cow::Owned([header.as_bytes(), lines.join("\n").as_bytes()].concat())
        }
    }
}

/// The line with numbers like `1.` and `-.5e3` written in full. What is not a finite number becomes one that the crate
/// reads as infinite.
fn whole_numbers(line: &str) -> String {
    let whole = |word: &str| match any_number(word) {
        Some(value) if !value.is_finite() => "1e999".to_owned(),
        Some(value) if word.contains('.') => value.to_string(),
        _ => word.to_owned(),
    };
    line.split_whitespace().map(whole).collect::<Vec<_>>().join(" ")
}

fn check_header(file: &str, header: &Header) -> Result<(), FormatError> {
    let fail = |what: String, remedy: &str| Err(FormatError::whole(file, what, remedy));
    for element in header.elements.values() {
        if element.properties.is_empty() && element.count > 0 {
            return fail(format!("the element {} has no properties", quoted(&element.name)), EXPORT_AGAIN);
        }
    }
    let has = |element: &str, property: &dyn Fn(&str) -> bool| {
        header.elements.get(element).is_some_and(|e| e.properties.keys().any(|name| property(name)))
    };
    for axis in ["x", "y", "z"] {
        if !has("vertex", &|name| name == axis) {
            return fail(format!("the vertices have no {axis} coordinate"), EXPORT_AGAIN);
        }
    }
    if !has("face", &is_corner_list) && !has("tristrips", &is_corner_list) {
        let remedy = "Export the surface as polygons; point clouds cannot be posed";
        return fail("there are no faces with vertex_indices".to_owned(), remedy);
    }
    Ok(())
}

fn read_element<E: PropertyAccess>(
    file: &str,
    reader: &mut Reader<Cursor<&[u8]>>,
    element: &ElementDef,
    header: &Header,
) -> Result<Vec<E>, FormatError> {
    Parser::<E>::new().read_payload_for_element(reader, element, header).map_err(|error| {
        let byte = usize::try_from(reader.get_ref().position()).unwrap_or(usize::MAX);
        let what = format!("the element {}: {}", quoted(&element.name), plain_message(&error));
        match (header.encoding, error.line()) {
            (Encoding::Ascii, Some(line)) => FormatError::line(file, line, what, EXPORT_AGAIN),
            _ => FormatError::byte(file, byte, what, EXPORT_AGAIN),
        }
    })
}

/// The crate's message without the lines it quotes.
fn plain_message(error: &ParseError) -> String {
    let text = error.to_string();
    let first = text.lines().next().unwrap_or_default();
    let first = if first.starts_with("Line ") { first.split_once(": ").map_or(first, |(_, rest)| rest) } else { first };
    first.trim_end_matches('.').chars().filter(|c| !c.is_control()).take(120).collect()
}

fn build(
    file: &str,
    header: &Header,
    first_vertex_line: Option<usize>,
    vertices: &[Vertex],
    faces: &[Face],
) -> Result<Model, FormatError> {
    if let Some(bad) = vertices.iter().position(|v| !v.position.iter().all(|c| c.is_finite())) {
        let what = format!("vertex {bad} has a coordinate that is not a finite number");
        let place = first_vertex_line.map_or(Place::Whole, |first| Place::Line(first + bad));
        return Err(FormatError::new(file, place, what, "Repair the mesh or export it again"));
    }
    let mut model = Model::default();
    let positions: Vec<[f64; 3]> = vertices.iter().map(|v| v.position).collect();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for (index, face) in faces.iter().enumerate() {
        let corner = |c: &i64| usize::try_from(*c).ok().filter(|&c| c < positions.len());
        let corners: Option<Vec<usize>> = face.corners.iter().map(corner).collect();
        let corners = corners.ok_or_else(|| {
            let what = format!("face {index} refers to a vertex that is not among the {}", positions.len());
            FormatError::whole(file, what, EXPORT_AGAIN)
        })?;
        let places: Vec<[f64; 3]> = corners.iter().map(|&c| positions[c]).collect();
        let cut = triangulate(&places).ok_or_else(|| {
            let what = format!("face {index} is concave and has more than {MAX_CONCAVE_CORNERS} corners");
            FormatError::whole(file, what, "Triangulate the mesh in your modelling program")
        })?;
        triangles.extend(cut.into_iter().map(|t| t.map(|i| corners[i] as u32)));
    }

    let names = header.elements.get("vertex").map(|e| &e.properties);
    let has = |name: &str| names.is_some_and(|n| n.contains_key(name));
    if NORMAL.iter().all(|n| has(n)) {
        if vertices.iter().all(|v| v.normal.iter().all(|c| c.is_finite())) {
            model.normals = Some(vertices.iter().map(|v| v.normal).collect());
        } else {
            model.warnings.push("The normals are ignored: some are not finite.".to_owned());
        }
    }
    let texture_kinds = names.map_or(0, |n| n.keys().filter(|name| texture_axis(name).is_some()).count());
    if texture_kinds >= 2 {
        if vertices.iter().all(|v| v.texture.iter().all(|c| c.is_finite())) {
            model.texture_coordinates = Some(vertices.iter().map(|v| [v.texture[0], 1.0 - v.texture[1]]).collect());
        } else {
            model.warnings.push("The texture coordinates are ignored: some are not finite.".to_owned());
        }
    }
    weld_drawn(&mut model, positions, triangles);
    Ok(model)
}

/// Joins vertices at the same place if only their attributes may keep them apart.
fn weld_drawn(model: &mut Model, positions: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) {
    let (firsts, groups) = weld(positions.iter().copied().map(position_key));
    let attributes = model.normals.is_some() || model.texture_coordinates.is_some();
    if !attributes || firsts.len() == positions.len() {
        model.mesh.vertices = positions;
        model.mesh.triangles = triangles;
        return;
    }
    model.mesh.vertices = firsts.iter().map(|&first| positions[first as usize]).collect();
    model.mesh.triangles = triangles.iter().map(|t| t.map(|v| groups[v as usize])).collect();
    model.split = Some(Split { mesh_vertex: groups, triangles });
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "ply\nformat ascii 1.0\ncomment hi\nelement vertex 4\nproperty float x\nproperty float y\n\
        property double z\nproperty float s\nproperty float t\nelement odd 1\nproperty list uchar int junk\n\
        element face 2\nproperty uchar red\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 0 0 0.5 0.25\n2 7 7\n9 3 0 1 2\n9 3 3 1 2\n";

    fn binary(big: bool) -> Vec<u8> {
        let order = if big { "big" } else { "little" };
        let mut bytes = format!(
            "ply\r\nformat binary_{order}_endian 1.0\r\ncomment \u{e9}\r\nelement vertex 3\r\nproperty float x\r\n\
             property double y\r\nproperty short z\r\nelement face 1\r\n\
             property list uchar ushort vertex_index\r\nend_header\r\n"
        )
        .into_bytes();
        for (x, y, z) in [(0.0_f32, 0.0_f64, 0_i16), (1.5, 0.0, 0), (0.0, 2.5, -1)] {
            if big {
                bytes.extend([x.to_be_bytes().as_slice(), &y.to_be_bytes(), &z.to_be_bytes()].concat());
            } else {
                bytes.extend([x.to_le_bytes().as_slice(), &y.to_le_bytes(), &z.to_le_bytes()].concat());
            }
        }
        bytes.push(3);
        for corner in [0_u16, 1, 2] {
            bytes.extend(if big { corner.to_be_bytes() } else { corner.to_le_bytes() });
        }
        bytes
    }

    #[test]
    fn text_with_a_seam() {
        let model = read_ply("a.ply", TEXT.as_bytes()).unwrap();
        assert_eq!(model.mesh.vertices.len(), 3);
        assert_eq!(model.mesh.triangles, [[0, 1, 2], [0, 1, 2]]);
        assert_eq!(model.split.unwrap().mesh_vertex, [0, 1, 2, 0]);
        assert_eq!(model.texture_coordinates.unwrap()[3], [0.5, 0.75]);
    }

    #[test]
    fn binary_of_both_orders_and_foreign_comments() {
        for big in [false, true] {
            let mut bytes = binary(big);
            let at = bytes.windows(2).position(|w| w == "\u{e9}".as_bytes()).unwrap();
            bytes[at] = b'\xE9';
            let mesh = read_ply("a.ply", &bytes).unwrap().mesh;
            assert_eq!(mesh.vertices, [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 2.5, -1.0]]);
            assert_eq!(mesh.triangles, [[0, 1, 2]]);
        }
    }

    #[test]
    fn strips_and_indices_with_a_point() {
        let strips = TEXT
            .replace("element face 2\nproperty uchar red\n", "element tristrips 1\n")
            .replace("9 3 0 1 2\n9 3 3 1 2\n", "9 0 1 2 3 -1 1 1 2 0 -1\n");
        let model = read_ply("a.ply", strips.as_bytes()).unwrap();
        assert_eq!(model.mesh.triangles, [[0, 1, 2], [2, 1, 0], [2, 1, 0]]);
        let without_sign = strips.replace("uchar int vertex", "uchar uint vertex").replace("-1", "4294967295");
        assert_eq!(read_ply("a.ply", without_sign.as_bytes()).unwrap().mesh, model.mesh);
        let float = TEXT.replace("uchar int vertex", "uchar float vertex").replace("9 3 0 1 2", "9 3 0 1.0 2");
        assert_eq!(read_ply("", float.as_bytes()).unwrap().mesh, read_ply("", TEXT.as_bytes()).unwrap().mesh);
        assert!(read_ply("", float.replace("1.0 2", "1.5 2").as_bytes()).is_err());
    }

    #[test]
    fn attributes_that_are_no_numbers_are_ignored() {
        for word in ["1.#IND", "nan", "-nan(ind)", "1.#QNAN", "inf"] {
            let model = read_ply("a.ply", TEXT.replace("0.25", word).as_bytes()).unwrap();
            assert_eq!((model.texture_coordinates, model.warnings.len()), (None, 1), "{word}");
            assert_eq!(model.mesh.triangles.len(), 2, "{word}");
        }
    }

    #[test]
    fn faults_name_their_place() {
        let fails = |text: &str| read_ply("a.ply", text.as_bytes()).unwrap_err();
        assert_eq!(fails(&TEXT.replace("1 1 0 1 1", "1 x 0 1 1")).place, Place::Line(18));
        assert_eq!(fails(&TEXT.replace("1 1 0 1 1", "1 nan 0 1 1")).place, Place::Line(18));
        assert_eq!(fails(&TEXT.replace("1 1 0 1 1", "1 1 1.#IND 1 1")).place, Place::Line(18));
        assert_eq!(fails(&TEXT.replace("element vertex 4", "element vertex 99999999999999")).place, Place::Line(20));
        assert_eq!(fails(&TEXT.replace("element vertex 4", "element vertex four")).place, Place::Line(4));
        assert_eq!(fails(&TEXT.replace("3 3 1 2", "3 4 1 2")).place, Place::Whole);
        assert_eq!(fails(&TEXT.replace("3 3 1 2", "3 -1 1 2")).place, Place::Whole);
        assert!(fails(&TEXT.replace("vertex_indices", "tristrips")).what.contains("no faces"));
        let odd = TEXT.replace("1 1 0 1 1", "1. +1.0e0 -.0 .1e1 1.e0");
        assert_eq!(read_ply("", odd.as_bytes()).unwrap().mesh, read_ply("", TEXT.as_bytes()).unwrap().mesh);
        let bytes = binary(false);
        for end in 0..bytes.len() {
            assert!(read_ply("", &bytes[..end]).is_err(), "{end}");
        }
        let mut endless = bytes.clone();
        let at = endless.windows(9).position(|w| w == b"element f").unwrap();
        endless.splice(at..at, b"element nothing 18446744073709551615\r\n".iter().copied());
        assert!(read_ply("", &endless).is_err());
    }
}
