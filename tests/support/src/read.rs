//! Minimal readers for OBJ, OFF, MESH and TGF.

use std::path::Path;
use std::str::FromStr;

/// Vertices (n×3, the file's unit) and triangles (m×3, zero-based).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// n×3.
    pub vertices: Vec<[f64; 3]>,
    /// m×3.
    pub triangles: Vec<[u32; 3]>,
}

/// Vertices (n×3, the file's unit) and tetrahedra (m×4, zero-based).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Volume {
    /// n×3.
    pub vertices: Vec<[f64; 3]>,
    /// m×4.
    pub tetrahedra: Vec<[u32; 4]>,
}

/// Positions and faces of an OBJ file; a face of more than three corners becomes a fan.
pub fn read_obj(path: &Path) -> Surface {
    let mut surface = Surface::default();
    for line in text(path).lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => surface.vertices.push(std::array::from_fn(|_| next(&mut words))),
            Some("f") => {
                let index = |word: &str| next::<u32>(&mut word.split('/')) - 1;
                let corners: Vec<u32> = words.map(index).collect();
                surface.triangles.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
            }
            _ => {}
        }
    }
    surface
}

/// Positions and triangles of an OFF file; other faces are not read.
pub fn read_off(path: &Path) -> Surface {
    let text = text(path);
    let words = &mut text.split_whitespace().skip(1);
    let [vertices, triangles, _]: [usize; 3] = std::array::from_fn(|_| next(words));
    let vertices = (0..vertices).map(|_| std::array::from_fn(|_| next(words))).collect();
    let mut triangle = || {
        assert_eq!(words.next(), Some("3"), "{}: a face that is not a triangle", path.display());
        std::array::from_fn(|_| next(words))
    };
    Surface { vertices, triangles: (0..triangles).map(|_| triangle()).collect() }
}

/// Positions and tetrahedra of a MESH file (Medit); its triangles are not read.
pub fn read_mesh(path: &Path) -> Volume {
    let text = text(path);
    let words = &mut text.split_whitespace();
    let mut volume = Volume::default();
    while let Some(word) = words.next() {
        match word {
            "Vertices" => {
                for _ in 0..next::<usize>(words) {
                    volume.vertices.push(std::array::from_fn(|_| next(words)));
                    words.next();
                }
            }
            "Tetrahedra" => {
                for _ in 0..next::<usize>(words) {
                    volume.tetrahedra.push(std::array::from_fn(|_| next::<u32>(words) - 1));
                    words.next();
                }
            }
            _ => {}
        }
    }
    volume
}

/// The bones of a TGF file, head and tail of each edge in the file's order.
pub fn read_tgf(path: &Path) -> Vec<[[f64; 3]; 2]> {
    let text = text(path);
    let mut parts = text.split('#');
    let lines = |part: Option<&str>| -> Vec<Vec<String>> {
        let lines = part.unwrap_or_default().lines().filter(|line| !line.trim().is_empty());
        lines.map(|line| line.split_whitespace().map(str::to_string).collect()).collect()
    };
    let (nodes, edges) = (lines(parts.next()), lines(parts.next()));
    let joint = |number: &String| {
        let node = nodes.iter().find(|node| node[0] == *number);
        let node = node.unwrap_or_else(|| panic!("{}: an edge refers to missing node {number}", path.display()));
        std::array::from_fn(|k| next(&mut std::iter::once(node[1 + k].as_str())))
    };
    edges.iter().map(|edge| [joint(&edge[0]), joint(&edge[1])]).collect()
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn next<'a, T: FromStr>(words: &mut impl Iterator<Item = &'a str>) -> T {
    let word = words.next().unwrap_or_else(|| panic!("the file ends too early"));
    word.parse().unwrap_or_else(|_| panic!("{word:?} is not a number"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f64; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.5, -2e3]];

    fn file(name: &str, text: &str) -> std::path::PathBuf {
        let path = std::env::temp_dir().join(format!("armature-test-support-{}-{name}", std::process::id()));
        std::fs::write(&path, text).unwrap_or_else(|error| panic!("{error}"));
        path
    }

    #[test]
    fn each_reader_reads_its_format() {
        let obj = file("a.obj", "# four\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 .5 -2e3\nvt 1 1\nf 1/1 2/1/1 3//1 4\n");
        let expected = Surface { vertices: CORNERS.to_vec(), triangles: vec![[0, 1, 2], [0, 2, 3]] };
        assert_eq!(read_obj(&obj), expected);
        let off = file("a.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 .5 -2e3\n3 0 1 2\n3 0 2 3\n");
        assert_eq!(read_off(&off), expected);
        let mesh = file(
            "a.mesh",
            "MeshVersionFormatted 1\nDimension 3\nVertices\n4\n0 0 0 7\n1 0 0 0\n1 1 0 0\n0 .5 -2e3 0\nTriangles\n1\n\
             1 2 3 0\nTetrahedra\n1\n1 2 3 4 9\nEnd\n",
        );
        assert_eq!(read_mesh(&mesh), Volume { vertices: CORNERS.to_vec(), tetrahedra: vec![[0, 1, 2, 3]] });
        let tgf = file("a.tgf", "1 0 0 0\n2 1 0 0\n7 1 1 0\n#\n1 2\n2 7 1 0 0\n#\n1\n");
        assert_eq!(read_tgf(&tgf), [[CORNERS[0], CORNERS[1]], [CORNERS[1], CORNERS[2]]]);
        [obj, off, mesh, tgf].iter().for_each(|path| drop(std::fs::remove_file(path)));
    }
}
