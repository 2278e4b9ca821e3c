//! VTK XML unstructured grids, as read by `ParaView` and similar tools.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::cells::{CellData, CellDataLength, CellMesh, Cells};

/// VTK's numbers for cell types.
const TRIANGLE: u8 = 5;
const TETRAHEDRON: u8 = 10;

/// Writes the cells of a mesh as a VTK unstructured grid (`.vtu`), with `data` as cell arrays, the first of which is
/// shown initially. Numbers are stored in binary, so they are read back the same to the last bit. The surface of a
/// volume is omitted: other tools can extract it.
///
/// ```
/// use armature_formats::mesh::{CellMesh, Cells, write_vtu};
///
/// let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let text = write_vtu(&CellMesh { vertices: &vertices, cells: Cells::Triangles(&[[0, 1, 2]]) }, &[])?;
/// assert!(text.contains("NumberOfPoints=\"3\" NumberOfCells=\"1\""));
/// # Ok::<(), armature_formats::mesh::CellDataLength>(())
/// ```
pub fn write_vtu(mesh: &CellMesh, data: &[CellData]) -> Result<String, CellDataLength> {
    mesh.check(data)?;
    let count = mesh.cell_count();
    let (corners, size, kind): (&[u32], _, _) = match mesh.cells {
        Cells::Triangles(triangles) => (triangles.as_flattened(), 3, TRIANGLE),
        Cells::Tetrahedra { tetrahedra, .. } => (tetrahedra.as_flattened(), 4, TETRAHEDRON),
    };
    let mut out = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\">\n<UnstructuredGrid>\n",
    );
    let _ = writeln!(out, "<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{count}\">", mesh.vertices.len());
    out.push_str("<Points>\n");
    let coordinates = mesh.vertices.as_flattened().iter().flat_map(|c| c.to_le_bytes());
    array(&mut out, "Points", "Float64", 3, coordinates);
    out.push_str("</Points>\n<Cells>\n");
    array(&mut out, "connectivity", "Int64", 1, corners.iter().flat_map(|&c| i64::from(c).to_le_bytes()));
    array(&mut out, "offsets", "Int64", 1, (1..=count as i64).flat_map(|i| (size * i).to_le_bytes()));
    array(&mut out, "types", "UInt8", 1, std::iter::repeat_n(kind, count));
    out.push_str("</Cells>\n");
    let shown = data.first().map(|d| format!(" Scalars=\"{}\"", escape_xml(d.name))).unwrap_or_default();
    let _ = writeln!(out, "<CellData{shown}>");
    for numbers in data {
        array(&mut out, numbers.name, "Float64", 1, numbers.values.iter().flat_map(|v| v.to_le_bytes()));
    }
    out.push_str("</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n");
    Ok(out)
}

/// One array: its length in bytes and its bytes, in base64.
fn array(out: &mut String, name: &str, kind: &str, components: usize, bytes: impl Iterator<Item = u8>) {
    let mut block = vec![0; size_of::<u64>()];
    block.extend(bytes);
    let length = (block.len() - size_of::<u64>()) as u64;
    block[..size_of::<u64>()].copy_from_slice(&length.to_le_bytes());
    let name = escape_xml(name);
    let _ = write!(out, "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" ");
    out.push_str("format=\"binary\">");
    STANDARD.encode_string(&block, out);
    out.push_str("</DataArray>\n");
}

fn escape_xml(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use armature_geometry::TetrahedralMesh;

    /// The bytes of the array with this name.
    fn array_of(text: &str, name: &str) -> Vec<u8> {
        let start = text.find(&format!("Name=\"{name}\"")).unwrap();
        let content = text[start..].split_once('>').unwrap().1.split_once('<').unwrap().0;
        let block = STANDARD.decode(content).unwrap();
        let (length, bytes) = block.split_first_chunk::<8>().unwrap();
        assert_eq!(u64::from_le_bytes(*length), bytes.len() as u64);
        bytes.to_vec()
    }

    #[test]
    fn arrays_hold_what_they_say() {
        let mesh = TetrahedralMesh {
            vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.1], [1.0; 3]],
            tetrahedra: vec![[0, 1, 2, 3], [1, 2, 3, 4]],
        };
        let winding = CellData { name: "a<b", values: &[0.75, -1e-300] };
        let text = write_vtu(&CellMesh::of_tetrahedra(&mesh, &[]), &[winding]).unwrap();
        let doubles = |name: &str| -> Vec<f64> {
            array_of(&text, name).chunks(8).map(|c| f64::from_le_bytes(c.try_into().unwrap())).collect()
        };
        let whole = |name: &str| -> Vec<i64> {
            array_of(&text, name).chunks(8).map(|c| i64::from_le_bytes(c.try_into().unwrap())).collect()
        };
        assert_eq!(doubles("Points"), mesh.vertices.as_flattened());
        assert_eq!(doubles("a&lt;b"), winding.values);
        assert_eq!(whole("connectivity"), [0, 1, 2, 3, 1, 2, 3, 4]);
        assert_eq!(whole("offsets"), [4, 8]);
        assert_eq!(array_of(&text, "types"), [10, 10]);
        assert!(text.contains("NumberOfPoints=\"5\" NumberOfCells=\"2\""), "{text}");
    }
}
