//! Wavefront OBJ, with materials from MTL.
//!
//! Positions keep the file's order and double precision, because weights and skeletons made elsewhere refer to them;
//! this is why only the material library is read by `tobj`, which renumbers and rounds positions.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::polygon::{MAX_CONCAVE_CORNERS, triangulate};
use crate::FormatError;
use crate::model::seams::{Corner, NONE, draw_corners};
use crate::model::texture::{forward_slashes, load_texture};
use crate::model::{Model, Resolver};
use crate::text::{any_number, counted, decode, numbered_lines, numbers, quoted, without_comment};

/// The contents of a file, before corners become drawn vertices.
#[derive(Default)]
struct Raw {
    positions: Vec<[f64; 3]>,
    textures: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    triangles: Vec<[Corner; 3]>,
    /// Triangles drawn with each material, by name.
    triangles_of_material: BTreeMap<String, usize>,
    libraries: Vec<String>,
    name: Option<String>,
    bad_normal_line: Option<usize>,
    ignored: Ignored,
}

/// What faces refer to that is missing, and faces that have no area; ignored and counted.
#[derive(Default)]
struct Ignored {
    /// Faces of one or two corners.
    thin_faces: usize,
    /// Corners whose texture coordinate is missing or not a finite number.
    textures: usize,
    /// Corners whose normal is missing.
    normals: usize,
}

impl Ignored {
    fn warn(&self, warnings: &mut Vec<String>) {
        for (count, faces, what) in [
            (self.thin_faces, ["face has", "faces have"], "fewer than three corners: ignored"),
            (
                self.textures,
                ["corner refers", "corners refer"],
                "to a texture coordinate that is missing or not a finite number: drawn without",
            ),
            (self.normals, ["corner refers", "corners refer"], "to a normal that is missing: all normals are ignored"),
        ] {
            if count > 0 {
                warnings.push(format!("{} {what}.", counted(count, faces)));
            }
        }
    }
}

/// Reads all objects of a file as one mesh.
pub(crate) fn read_obj(file: &str, bytes: &[u8], resolver: Resolver) -> Result<Model, FormatError> {
    let text = decode(bytes);
    let raw = parse(file, &text)?;
    let mut model = Model { name: raw.name.clone().unwrap_or_default(), ..Model::default() };
    raw.ignored.warn(&mut model.warnings);
    if let Some(line) = raw.bad_normal_line {
        model.warnings.push(format!("The normals are ignored: the one in line {line} has no direction."));
    }
    let mut triangles = raw.triangles.clone();
    // A shape with some wrong normals looks worse than one whose normals are computed.
    if raw.bad_normal_line.is_some() || raw.ignored.normals > 0 {
        triangles.iter_mut().flatten().for_each(|corner| corner.normal = NONE);
    }
    let drawn = draw_corners(raw.positions.len(), &triangles, &raw.textures, &raw.normals);
    model.mesh.triangles = triangles.iter().map(|t| t.map(|c| c.vertex)).collect();
    model.split = drawn.split;
    model.texture_coordinates = drawn.texture_coordinates;
    model.normals = drawn.normals;
    read_materials(&raw, resolver, &mut model);
    model.mesh.vertices = raw.positions;
    Ok(model)
}

fn parse(file: &str, text: &str) -> Result<Raw, FormatError> {
    let mut raw = Raw::default();
    let mut material = String::new();
    let mut joined = String::new();
    for (line, content) in numbered_lines(text) {
        let content = without_comment(content).trim_end();
        // A backslash continues the line; errors then name the last of the joined lines.
        if let Some(start) = content.strip_suffix('\\') {
            joined.push_str(start);
            joined.push(' ');
            continue;
        }
        let whole = if joined.is_empty() {
            content
        } else {
            &{
                joined.push_str(content);
                std::mem::take(&mut joined)
            }
        };
        statement(file, line, whole, &mut raw, &mut material)?;
    }
    Ok(raw)
}

fn statement(file: &str, line: usize, content: &str, raw: &mut Raw, material: &mut String) -> Result<(), FormatError> {
    let mut words = content.split_whitespace();
    let rest = || content.trim_start().split_once(char::is_whitespace).map_or("", |(_, rest)| rest.trim());
    match words.next() {
        Some("v") => raw.positions.push(numbers(file, line, &mut words, "a vertex")?),
        Some("vt") => {
            // One-dimensional textures have no second coordinate.
            let value = |word: Option<&str>| word.map_or(Some(0.0), any_number).unwrap_or(f64::NAN);
            let u = words.next().and_then(any_number).unwrap_or(f64::NAN);
            raw.textures.push([u as f32, 1.0 - value(words.next()) as f32]);
        }
        Some("vn") => {
            // Modelling programs write NaN normals at faces without area: they are not essential for drawing.
            let parsed = words.map(|w| any_number(w).unwrap_or(f64::NAN) as f32).collect::<Vec<_>>();
            let normal = <[f32; 3]>::try_from(parsed).ok().and_then(unit);
            if normal.is_none() && raw.bad_normal_line.is_none() {
                raw.bad_normal_line = Some(line);
            }
            raw.normals.push(normal.unwrap_or([0.0, 1.0, 0.0]));
        }
        Some("f") => {
            let before = raw.triangles.len();
            face(file, line, words, raw)?;
            *raw.triangles_of_material.entry(material.clone()).or_default() += raw.triangles.len() - before;
        }
        Some("usemtl") => rest().clone_into(material),
        Some("mtllib") => raw.libraries.push(rest().to_owned()),
        Some("o" | "g") if raw.name.is_none() && !rest().is_empty() => raw.name = Some(rest().to_owned()),
        // Lines, points, smoothing groups, free-form surfaces: nothing we draw.
        _ => {}
    }
    Ok(())
}

fn unit(n: [f32; 3]) -> Option<[f32; 3]> {
    let length = n.iter().map(|c| f64::from(*c) * f64::from(*c)).sum::<f64>().sqrt();
    (length.is_finite() && length > 0.0).then(|| n.map(|c| (f64::from(c) / length) as f32))
}

fn face<'w>(file: &str, line: usize, words: impl Iterator<Item = &'w str>, raw: &mut Raw) -> Result<(), FormatError> {
    let mut corners = Vec::new();
    for word in words {
        let mut parts = word.split('/');
        let mut index = |len: usize| match parts.next() {
            None | Some("") => Ok(Index::None),
            Some(part) => resolve(file, line, part, len),
        };
        let vertex = match index(raw.positions.len())? {
            Index::At(vertex) => vertex,
            Index::None => {
                let what = format!("the corner {} has no vertex", quoted(word));
                return Err(FormatError::line(file, line, what, "Export the mesh again"));
            }
            Index::Missing(index) => {
                let what =
                    format!("the face refers to vertex {index}, but there are only {} above it", raw.positions.len());
                let remedy = "The file may be cut off or damaged; export the mesh again";
                return Err(FormatError::line(file, line, what, remedy));
            }
        };
        let texture = match index(raw.textures.len())? {
            Index::At(at) if raw.textures[at as usize].iter().all(|c| c.is_finite()) => at,
            Index::None => NONE,
            Index::At(_) | Index::Missing(_) => {
                raw.ignored.textures += 1;
                NONE
            }
        };
        let normal = match index(raw.normals.len())? {
            Index::At(at) => at,
            Index::None => NONE,
            Index::Missing(_) => {
                raw.ignored.normals += 1;
                NONE
            }
        };
        corners.push(Corner { vertex, texture, normal });
    }
    if corners.len() < 3 {
        raw.ignored.thin_faces += 1;
        return Ok(());
    }
    let positions: Vec<[f64; 3]> = corners.iter().map(|c| raw.positions[c.vertex as usize]).collect();
    let triangles = triangulate(&positions).ok_or_else(|| {
        let what = format!("a concave face has {} corners, more than {MAX_CONCAVE_CORNERS}", corners.len());
        FormatError::line(file, line, what, "Triangulate the mesh in your modelling program")
    })?;
    raw.triangles.extend(triangles.into_iter().map(|t| t.map(|i| corners[i])));
    Ok(())
}

/// What a corner refers to: a vertex, texture coordinate or normal.
enum Index {
    /// Nothing.
    None,
    /// A zero-based index that exists.
    At(u32),
    /// An index, as written, that nothing above it has.
    Missing(i64),
}

/// A one-based index, or a negative one that counts back from the last.
fn resolve(file: &str, line: usize, word: &str, len: usize) -> Result<Index, FormatError> {
    let index: i64 = word.parse().map_err(|_| {
        FormatError::line(file, line, format!("{} is not an index", quoted(word)), "Export the mesh again")
    })?;
    let zero_based = if index < 0 { index + len as i64 } else { index - 1 };
    let at = u32::try_from(zero_based).ok().filter(|&i| (i as usize) < len && i != NONE);
    Ok(at.map_or(Index::Missing(index), Index::At))
}

/// Colour and texture of the material with the most triangles; anything missing is only a warning, as the shape is
/// complete.
fn read_materials(raw: &Raw, resolver: Resolver, model: &mut Model) {
    let Some((material, _)) = raw.triangles_of_material.iter().max_by_key(|(_, triangles)| **triangles) else { return };
    let used = raw.triangles_of_material.values().filter(|n| **n > 0).count();
    let mut found = None;
    for library in &raw.libraries {
        let bytes = match resolver(library) {
            Ok(bytes) => bytes,
            Err(error) => {
                model.warnings.push(format!("The material library {library} is missing: {error}."));
                continue;
            }
        };
        match tobj::load_mtl_buf(&mut decode(&bytes).as_bytes()) {
            Ok((materials, _)) => found = found.or_else(|| materials.into_iter().find(|m| m.name == *material)),
            Err(error) => model.warnings.push(format!("The material library {library} cannot be read: {error}.")),
        }
    }
    let Some(found) = found else { return };
    if used > 1 {
        model
            .warnings
            .push(format!("Of {used} materials, only {} is used, the one with the most triangles.", quoted(material)));
    }
    if let Some(diffuse) = found.diffuse.filter(|c| c.iter().all(|v| v.is_finite())) {
        let opacity = found.dissolve.filter(|d| d.is_finite()).unwrap_or(1.0);
        model.first_material().base_color =
            Some([diffuse[0], diffuse[1], diffuse[2], opacity].map(|c| c.clamp(0.0, 1.0)));
    }
    // Options like "-s 1 1 1" come before the name, which is last.
    if let Some(image) = found.diffuse_texture.as_deref().and_then(|t| t.split_whitespace().last()) {
        load_texture(&forward_slashes(image), resolver, model);
    }
}

/// Writes a surface as OBJ text, with normals and texture coordinates if the model has them.
///
/// ```
/// use armature_formats::mesh::write_obj;
/// use armature_formats::model::Model;
///
/// let mut model = Model::default();
/// model.mesh.vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.5, 0.0]];
/// model.mesh.triangles = vec![[0, 1, 2]];
/// assert_eq!(write_obj(&model), "v 0 0 0\nv 1 0 0\nv 0 0.5 0\nf 1 2 3\n");
/// ```
pub fn write_obj(model: &Model) -> String {
    let mut out = String::new();
    for [x, y, z] in &model.mesh.vertices {
        let _ = writeln!(out, "v {x} {y} {z}");
    }
    for [u, v] in model.texture_coordinates.iter().flatten() {
        let _ = writeln!(out, "vt {u} {}", 1.0 - v);
    }
    for [x, y, z] in model.normals.iter().flatten() {
        let _ = writeln!(out, "vn {x} {y} {z}");
    }
    for (triangle, drawn) in model.mesh.triangles.iter().zip(model.drawn_triangles()) {
        out.push('f');
        for (vertex, corner) in triangle.iter().zip(drawn) {
            let (vertex, corner) = (u64::from(*vertex) + 1, u64::from(*corner) + 1);
            let _ = match (&model.texture_coordinates, &model.normals) {
                (None, None) => write!(out, " {vertex}"),
                (Some(_), None) => write!(out, " {vertex}/{corner}"),
                (None, Some(_)) => write!(out, " {vertex}//{corner}"),
                (Some(_), Some(_)) => write!(out, " {vertex}/{corner}/{corner}"),
            };
        }
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Place;

    fn none(name: &str) -> Result<Vec<u8>, String> {
        Err(format!("no {name} here"))
    }

    #[test]
    fn seams_negative_indices_and_continued_lines() {
        let text = "o thing\nv 0 0 0\nv 1 0 0 1\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt .5 .5\n\
                    f 1/1 2/2 \\\n 3/3\nf -4/5 -2/-3 4/4\n";
        let model = read_obj("a.obj", text.as_bytes(), &none).unwrap();
        assert_eq!(model.name, "thing");
        assert_eq!(model.mesh.vertices.len(), 4);
        assert_eq!(model.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        let split = model.split.as_ref().unwrap();
        assert_eq!(split.mesh_vertex, [0, 1, 2, 0, 3]);
        assert_eq!(model.texture_coordinates.as_ref().unwrap()[3], [0.5, 0.5]);
        assert_eq!(model.texture_coordinates.as_ref().unwrap()[2], [1.0, 0.0]);
        let flat = model.split_at_seams();
        assert_eq!(flat.mesh.vertices.len(), 5);
        assert_eq!(flat.mesh.vertices[3], [0.0; 3]);
        let again = read_obj("thing.obj", write_obj(&model).as_bytes(), &none).unwrap();
        assert_eq!(Model { name: model.name.clone(), ..again }, model);
    }

    #[test]
    fn materials_come_through_the_resolver() {
        let text = "mtllib a b.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl skin\nf 1 2 3\n";
        let resolver = |name: &str| match name {
            "a b.mtl" => {
                Ok(b"newmtl other\nKd 1 0 0\nnewmtl skin\nKd 0.25 0.5 1\nd 0.5\nmap_Kd -clamp on t.png\n".to_vec())
            }
            "t.png" => Ok(b"\x89PNG\r\n\x1a\nrest".to_vec()),
            other => Err(other.to_owned()),
        };
        let model = read_obj("a.obj", text.as_bytes(), &resolver).unwrap();
        assert_eq!(model.materials[0].base_color, Some([0.25, 0.5, 1.0, 0.5]));
        assert_eq!(model.materials[0].base_color_map.as_ref().unwrap().mime, "image/png");
        assert!(model.warnings.is_empty(), "{:?}", model.warnings);
        let model = read_obj("a.obj", text.as_bytes(), &none).unwrap();
        assert_eq!((model.materials.len(), model.warnings.len()), (0, 1));
    }

    #[test]
    fn bad_normals_are_left_out_with_a_warning() {
        let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvn 0 0 2\nvn nan 0 0\nf 1//1 2//2 3//1\n";
        let model = read_obj("", text.as_bytes(), &none).unwrap();
        assert_eq!(model.normals, None);
        assert!(model.warnings[0].contains("line 5"));
        let model = read_obj("", text.replace("nan", "0.1").as_bytes(), &none).unwrap();
        assert_eq!(model.normals.unwrap(), [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    }

    #[test]
    fn faults_name_their_line() {
        for (text, line) in [
            ("v 0 0\n", 1),
            ("v 0 0 inf\n", 1),
            ("\n\nv 0 x 0\n", 3),
            ("v 0 0 0\nf 1 1 2\n", 2),
            ("v 0 0 0\nf 1 1 0\n", 2),
            ("v 0 0 0\nf 1 1 -2\n", 2),
            ("v 0 0 0\nf 1 1 /1\n", 2),
            ("v 0 0 0\nf 1 1 99999999999999999999\n", 2),
            ("v 0 0 0\nf 1 1 -9223372036854775808\n", 2),
        ] {
            assert_eq!(read_obj("", text.as_bytes(), &none).unwrap_err().place, Place::Line(line), "{text:?}");
        }
    }

    #[test]
    fn geometry_survives_what_is_wrong_beside_it() {
        let points = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
        let read = |text: &str| read_obj("a.obj", format!("{points}{text}").as_bytes(), &none).unwrap();
        let thin = read("f 1 2\nf 1 2 3\nf 4\nf\n");
        assert_eq!(thin.mesh.triangles, [[0, 1, 2]]);
        assert_eq!(thin.warnings, ["3 faces have fewer than three corners: ignored."]);

        // Two of six corners have a usable texture coordinate.
        let textures = read("vt 0.25 0\nvt 1.#IND 0\nf 1/1 2/9 3/2\nf 1/1 3/-7 4/0\n");
        assert_eq!(textures.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(textures.texture_coordinates.unwrap()[0], [0.25, 1.0]);
        let warning = "4 corners refer to a texture coordinate that is missing or not a finite number: drawn without.";
        assert_eq!(textures.warnings, [warning]);

        let normals = read("vn 0 0 1\nf 1//1 2//1 3//2\n");
        assert_eq!((normals.normals, normals.mesh.triangles.len()), (None, 1));
        assert_eq!(normals.warnings, ["1 corner refers to a normal that is missing: all normals are ignored."]);

        let neither = read("f 1/1/1 2/2/2 3/3/3\n");
        assert_eq!((neither.normals, neither.texture_coordinates, neither.split), (None, None, None));
        assert_eq!(neither.warnings.len(), 2);
    }
}
