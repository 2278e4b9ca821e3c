//! Medit MESH, the text form: tetrahedral meshes of `TetGen` and similar tools.

use std::fmt::Write as _;

use armature_geometry::{TetrahedralMesh, TriangleMesh};

use super::cells::{CellMesh, Cells};
use crate::FormatError;
use crate::model::Model;
use crate::text::{count, decode, number, numbered_lines, quoted, without_comment};

const EXPORT_AGAIN: &str = "The file may be cut off or damaged; export it again";

/// The file's words, each with its line.
struct Words<'t, I: Iterator<Item = (usize, &'t str)>> {
    file: &'t str,
    left: std::iter::Peekable<I>,
    line: usize,
}

impl<'t, I: Iterator<Item = (usize, &'t str)>> Words<'t, I> {
    fn next(&mut self) -> Option<&'t str> {
        let (line, word) = self.left.next()?;
        self.line = line;
        Some(word)
    }

    fn error(&self, what: String) -> FormatError {
        FormatError::line(self.file, self.line.max(1), what, EXPORT_AGAIN)
    }

    fn expect(&mut self, what: &str) -> Result<&'t str, FormatError> {
        match self.next() {
            Some(word) => Ok(word),
            None => Err(self.error(format!("the file ends where {what} should be"))),
        }
    }

    fn count(&mut self, what: &str) -> Result<usize, FormatError> {
        let word = self.expect(what)?;
        count(self.file, self.line, word)
    }

    /// Skips numbers up to the next keyword.
    fn skip_numbers(&mut self) {
        while self.left.next_if(|(_, word)| !word.starts_with(|c: char| c.is_ascii_alphabetic())).is_some() {}
    }

    /// `K` one-based vertex numbers and the reference after them.
    fn element<const K: usize>(&mut self, vertex_count: usize, what: &str) -> Result<[u32; K], FormatError> {
        let mut corners = [0; K];
        for corner in &mut corners {
            let vertex = self.count(what)?;
            if vertex == 0 || vertex > vertex_count || vertex > u32::MAX as usize {
                return Err(
                    self.error(format!("{what} refers to vertex {vertex}, but the vertices are 1 to {vertex_count}"))
                );
            }
            *corner = vertex as u32 - 1;
        }
        self.expect("a reference number")?;
        Ok(corners)
    }
}

/// Reads vertices, triangles, quadrilaterals (cut in two) and tetrahedra; other sections are skipped. Tetrahedra are
/// returned with positive volume. The surface is the file's, oriented like the volume's boundary where it is part of
/// that, or the boundary itself if the file has none.
pub(crate) fn read_mesh(file: &str, bytes: &[u8]) -> Result<Model, FormatError> {
    let text = decode(bytes);
    let all = numbered_lines(&text)
        .flat_map(|(line, content)| without_comment(content).split_whitespace().map(move |word| (line, word)));
    let mut words = Words { file, left: all.peekable(), line: 0 };
    if words.next().is_none_or(|w| !w.eq_ignore_ascii_case("MeshVersionFormatted")) {
        let what = "a MESH file starts with MeshVersionFormatted";
        return Err(FormatError::line(file, words.line.max(1), what, "Choose a Medit MESH file in its text form"));
    }
    words.expect("the version")?;

    let mut vertices: Vec<[f64; 3]> = Vec::new();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    let mut tetrahedra: Vec<[u32; 4]> = Vec::new();
    while let Some(keyword) = words.next() {
        match keyword.to_ascii_lowercase().as_str() {
            "dimension" => {
                let dimension = words.count("the dimension")?;
                if dimension != 3 {
                    return Err(words.error(format!("the mesh has {dimension} dimensions, not 3")));
                }
            }
            "vertices" => {
                for _ in 0..words.count("the number of vertices")? {
                    let mut vertex = [0.0; 3];
                    for coordinate in &mut vertex {
                        let word = words.expect("a coordinate")?;
                        *coordinate = number(file, words.line, word)?;
                    }
                    words.expect("a reference number")?;
                    vertices.push(vertex);
                }
            }
            "triangles" => {
                for _ in 0..words.count("the number of triangles")? {
                    triangles.push(words.element(vertices.len(), "a triangle")?);
                }
            }
            "quadrilaterals" => {
                for _ in 0..words.count("the number of quadrilaterals")? {
                    let [a, b, c, d] = words.element(vertices.len(), "a quadrilateral")?;
                    triangles.extend([[a, b, c], [a, c, d]]);
                }
            }
            "tetrahedra" => {
                for _ in 0..words.count("the number of tetrahedra")? {
                    tetrahedra.push(words.element(vertices.len(), "a tetrahedron")?);
                }
            }
            "end" => break,
            _ if keyword.starts_with(|c: char| c.is_ascii_alphabetic()) => words.skip_numbers(),
            _ => return Err(words.error(format!("{} is where a keyword should be", quoted(keyword)))),
        }
    }
    Ok(build(vertices, triangles, tetrahedra))
}

fn build(vertices: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>, mut tetrahedra: Vec<[u32; 4]>) -> Model {
    let mut model = Model::default();
    if tetrahedra.is_empty() {
        model.mesh = TriangleMesh { vertices, triangles };
        return model;
    }
    let mut flat = 0_usize;
    for tetrahedron in &mut tetrahedra {
        let volume = six_volumes(tetrahedron.map(|v| vertices[v as usize]));
        if volume < 0.0 {
            tetrahedron.swap(2, 3);
        }
        flat += usize::from(volume == 0.0);
    }
    if flat > 0 {
        model.warnings.push(format!("{flat} tetrahedra have no volume."));
    }
    let boundary = boundary(&tetrahedra);
    let triangles = if triangles.is_empty() {
        boundary.into_iter().map(|(_, oriented)| oriented).collect()
    } else {
        let orient = |t: [u32; 3]| match boundary.binary_search_by_key(&sorted(t), |(key, _)| *key) {
            Ok(at) => boundary[at].1,
            Err(_) => t,
        };
        triangles.into_iter().map(orient).collect()
    };
    model.tetrahedra = Some(TetrahedralMesh { vertices: vertices.clone(), tetrahedra });
    model.mesh = TriangleMesh { vertices, triangles };
    model
}

/// `(b-a)·((c-a)×(d-a))`.
fn six_volumes([a, b, c, d]: [[f64; 3]; 4]) -> f64 {
    let [u, v, w] = [b, c, d].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
    u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0])
}

fn sorted(mut t: [u32; 3]) -> [u32; 3] {
    t.sort_unstable();
    t
}

/// Faces that belong to one tetrahedron only, facing outwards, each after its sorted vertices, and sorted by those.
fn boundary(tetrahedra: &[[u32; 4]]) -> Vec<([u32; 3], [u32; 3])> {
    let faces_of = |&[a, b, c, d]: &[u32; 4]| [[b, c, d], [a, d, c], [a, b, d], [a, c, b]];
    let mut faces: Vec<_> = tetrahedra.iter().flat_map(faces_of).map(|face| (sorted(face), face)).collect();
    faces.sort_by_key(|(key, _)| *key);
    faces.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() == 1).map(|group| group[0]).collect()
}

/// Writes a mesh as Medit MESH text, in double precision: it is read back the same to the last bit. The format cannot
/// store per-cell data.
///
/// ```
/// use armature_formats::mesh::{CellMesh, Cells, write_mesh};
///
/// let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let cells = Cells::Tetrahedra { tetrahedra: &[[0, 1, 2, 3]], surface: &[] };
/// let text = write_mesh(&CellMesh { vertices: &vertices, cells });
/// assert!(text.ends_with("Tetrahedra\n1\n1 2 3 4 0\nEnd\n"));
/// ```
pub fn write_mesh(mesh: &CellMesh) -> String {
    // Readers store the coordinates of version 1 in single precision.
    let mut out = String::from("MeshVersionFormatted 2\nDimension 3\n");
    let _ = writeln!(out, "Vertices\n{}", mesh.vertices.len());
    for [x, y, z] in mesh.vertices {
        let _ = writeln!(out, "{x:?} {y:?} {z:?} 0");
    }
    let triangles = mesh.triangles();
    if !triangles.is_empty() {
        let _ = writeln!(out, "Triangles\n{}", triangles.len());
        triangles.iter().for_each(|t| write_element(&mut out, t));
    }
    if let Cells::Tetrahedra { tetrahedra, .. } = mesh.cells {
        let _ = writeln!(out, "Tetrahedra\n{}", tetrahedra.len());
        tetrahedra.iter().for_each(|t| write_element(&mut out, t));
    }
    out.push_str("End\n");
    out
}

fn write_element(out: &mut String, corners: &[u32]) {
    for &corner in corners {
        let _ = write!(out, "{} ", u64::from(corner) + 1);
    }
    out.push_str("0\n");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Place;

    const TWO: &str = "MeshVersionFormatted 2\n\nDimension\n3\n# five\nVertices 5\n0 0 0 1\n1 0 0 1\n0 1 0 1\n0 0 1 1\n\
        1 1 1 1\nEdges 1\n1 2 0\nTetrahedra\n2\n1 2 3 4 0\n2 3 5 4 0\nEnd\n";

    #[test]
    fn volumes_are_positive_and_the_boundary_faces_outwards() {
        let model = read_mesh("a.mesh", TWO.as_bytes()).unwrap();
        let volume = model.tetrahedra.unwrap();
        for t in &volume.tetrahedra {
            assert!(six_volumes(t.map(|v| volume.vertices[v as usize])) > 0.0);
        }
        assert_eq!(model.mesh.triangles.len(), 6);
        // The divergence theorem: a sixth of the sum over outward faces is the volume.
        let faces = model.mesh.triangles.iter();
        let sum: f64 =
            faces.map(|t| six_volumes([[0.0; 3], v(&volume, t[0]), v(&volume, t[1]), v(&volume, t[2])])).sum();
        let volumes: f64 = volume.tetrahedra.iter().map(|t| six_volumes(t.map(|i| volume.vertices[i as usize]))).sum();
        assert!((sum - volumes).abs() < 1e-12 && volumes > 0.5);
    }

    fn v(mesh: &TetrahedralMesh, index: u32) -> [f64; 3] {
        mesh.vertices[index as usize]
    }

    #[test]
    fn surfaces_of_the_file_are_turned_outwards() {
        let with = TWO.replace("Edges 1\n1 2 0", "Triangles 2\n1 2 3 0\n2 3 4 9");
        let model = read_mesh("", with.as_bytes()).unwrap();
        assert_eq!(model.mesh.triangles, [[0, 2, 1], [1, 2, 3]]);
        let volume = model.tetrahedra.unwrap();
        let text = write_mesh(&CellMesh::of_tetrahedra(&volume, &model.mesh.triangles));
        let again = read_mesh("", text.as_bytes()).unwrap();
        assert_eq!((again.mesh, again.tetrahedra), (model.mesh, Some(volume)));
    }

    #[test]
    fn a_round_trip_keeps_every_bit() {
        let vertices = vec![
            [0.1 + 0.2, -0.0, 5e-324],
            [f64::MAX, f64::MIN_POSITIVE, 1.0 / 3.0],
            [-1e-7, 1e16 + 2.0, 123_456_789.123_456_79],
            [f64::from_bits(0x3FF0_0000_0000_0001), -2.5e-200, 1e300],
        ];
        let bits = |vertices: &[[f64; 3]]| vertices.iter().map(|p| p.map(f64::to_bits)).collect::<Vec<_>>();
        let surface = TriangleMesh { vertices: vertices.clone(), triangles: vec![[2, 0, 1], [3, 1, 0]] };
        let again = read_mesh("", write_mesh(&CellMesh::of_triangles(&surface)).as_bytes()).unwrap();
        assert_eq!(bits(&again.mesh.vertices), bits(&vertices));
        assert_eq!((again.mesh.triangles, again.tetrahedra), (surface.triangles, None));
    }

    #[test]
    fn faults_name_their_line() {
        for (from, to, line) in [
            ("MeshVersionFormatted", "Mesh", 1),
            ("1 2 3 4 0", "1 2 3 6 0", 16),
            ("1 2 3 4 0", "0 2 3 4 0", 16),
            ("1 0 0 1", "1 inf 0 1", 8),
            ("Dimension\n3", "Dimension\n2", 4),
            ("Vertices 5", "Vertices 18446744073709551615", 12),
            ("Tetrahedra\n2", "Tetrahedra\n3", 18),
            ("2 3 5 4 0\nEnd\n", "2 3 5", 17),
        ] {
            let text = TWO.replacen(from, to, 1);
            assert_eq!(read_mesh("", text.as_bytes()).unwrap_err().place, Place::Line(line), "{to}");
        }
    }
}
