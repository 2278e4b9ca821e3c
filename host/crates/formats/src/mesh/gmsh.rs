//! Gmsh MSH 4.1, the text form.

use std::fmt::Write as _;

use super::cells::{CellData, CellDataLength, CellMesh, Cells};

/// Gmsh's numbers for element types.
const TRIANGLE: u32 = 2;
const TETRAHEDRON: u32 = 4;
/// The number of the single surface or volume that everything belongs to.
const ENTITY: u32 = 1;

/// Writes the cells of a mesh as Gmsh MSH 4.1 text, with `data` as views on them. Coordinates and numbers are read back
/// the same to the last bit. The surface of a volume is omitted: other readers expect data for all elements of a file,
/// and other tools can extract it.
///
/// ```
/// use armature_formats::mesh::{CellData, CellMesh, Cells, write_msh};
///
/// let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let mesh = CellMesh { vertices: &vertices, cells: Cells::Triangles(&[[0, 1, 2]]) };
/// let text = write_msh(&mesh, &[CellData { name: "area", values: &[0.5] }])?;
/// assert!(text.contains("$ElementData\n1\n\"area\"\n"));
/// # Ok::<(), armature_formats::mesh::CellDataLength>(())
/// ```
pub fn write_msh(mesh: &CellMesh, data: &[CellData]) -> Result<String, CellDataLength> {
    mesh.check(data)?;
    let mut out = String::from("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n");
    let dimension = if matches!(mesh.cells, Cells::Triangles(_)) { 2 } else { 3 };
    write_entity(&mut out, mesh.vertices, dimension);
    write_nodes(&mut out, mesh.vertices, dimension);
    let count = mesh.cell_count();
    let _ = writeln!(out, "$Elements\n1 {count} {} {count}", count.min(1));
    match mesh.cells {
        Cells::Triangles(triangles) => write_block(&mut out, dimension, TRIANGLE, triangles),
        Cells::Tetrahedra { tetrahedra, .. } => write_block(&mut out, dimension, TETRAHEDRON, tetrahedra),
    }
    out.push_str("$EndElements\n");
    data.iter().for_each(|numbers| write_data(&mut out, numbers));
    Ok(out)
}

/// The single surface or volume that everything belongs to.
fn write_entity(out: &mut String, vertices: &[[f64; 3]], dimension: usize) {
    let first = vertices.first().copied().unwrap_or_default();
    let (low, high) = vertices.iter().fold((first, first), |(low, high), p| {
        (std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k])))
    });
    let [a, b, c] = low;
    let [d, e, f] = high;
    let counts = if dimension == 2 { "0 0 1 0" } else { "0 0 0 1" };
    let _ = writeln!(out, "$Entities\n{counts}\n{ENTITY} {a:?} {b:?} {c:?} {d:?} {e:?} {f:?} 0 0\n$EndEntities");
}

fn write_nodes(out: &mut String, vertices: &[[f64; 3]], dimension: usize) {
    let count = vertices.len();
    let _ = writeln!(out, "$Nodes\n1 {count} {} {count}\n{dimension} {ENTITY} 0 {count}", count.min(1));
    for tag in 1..=count {
        let _ = writeln!(out, "{tag}");
    }
    for [x, y, z] in vertices {
        let _ = writeln!(out, "{x:?} {y:?} {z:?}");
    }
    out.push_str("$EndNodes\n");
}

fn write_block<const K: usize>(out: &mut String, dimension: usize, kind: u32, elements: &[[u32; K]]) {
    let _ = writeln!(out, "{dimension} {ENTITY} {kind} {}", elements.len());
    for (index, corners) in elements.iter().enumerate() {
        let _ = write!(out, "{}", index + 1);
        for &corner in corners {
            let _ = write!(out, " {}", u64::from(corner) + 1);
        }
        out.push('\n');
    }
}

fn write_data(out: &mut String, data: &CellData) {
    // Quotes and line breaks would end the name early.
    let name: String = data.name.chars().map(|c| if c == '"' || c.is_control() { '_' } else { c }).collect();
    let _ = writeln!(out, "$ElementData\n1\n\"{name}\"\n1\n0.0\n3\n0\n1\n{}", data.values.len());
    for (index, value) in data.values.iter().enumerate() {
        let _ = writeln!(out, "{} {value:?}", index + 1);
    }
    out.push_str("$EndElementData\n");
}

#[cfg(test)]
mod tests {
    use super::*;
    use armature_geometry::TetrahedralMesh;

    #[test]
    fn every_section_is_there() {
        let mesh = TetrahedralMesh {
            vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.1]],
            tetrahedra: vec![[0, 1, 2, 3]],
        };
        let winding = CellData { name: "wind\"ing", values: &[0.75] };
        let text = write_msh(&CellMesh::of_tetrahedra(&mesh, &[[0, 2, 1]]), &[winding]).unwrap();
        let expected = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 0 1\n1 0.0 0.0 0.0 1.0 1.0 0.1 0 0\n\
            $EndEntities\n$Nodes\n1 4 1 4\n3 1 0 4\n1\n2\n3\n4\n0.0 0.0 0.0\n1.0 0.0 0.0\n0.0 1.0 0.0\n0.0 0.0 0.1\n\
            $EndNodes\n$Elements\n1 1 1 1\n3 1 4 1\n1 1 2 3 4\n$EndElements\n$ElementData\n1\n\"wind_ing\"\n1\n0.0\n3\n\
            0\n1\n1\n1 0.75\n$EndElementData\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn numbers_of_other_cells_are_refused() {
        let mesh = CellMesh { vertices: &[], cells: Cells::Triangles(&[]) };
        let error = write_msh(&mesh, &[CellData { name: "w", values: &[1.0] }]).unwrap_err();
        assert_eq!(error, CellDataLength { name: "w".into(), values: 1, cells: 0 });
    }
}
