//! One door for all mesh files.

use armature_geometry::MeshError;

use crate::{FormatError, Model};

/// Gives the bytes of a file that a file names (a glTF buffer, a texture, a material library), by the name written
/// there. The error is a sentence for the user.
pub type Resolver<'a> = &'a dyn Fn(&str) -> Result<Vec<u8>, String>;

/// The kinds of mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Gltf,
    Mesh,
    Obj,
    Off,
    Ply,
    Stl,
}

const KNOWN: &str = "Meshes are read from OBJ, PLY, STL, OFF, glTF, GLB and MESH files; export as one of these";

/// Reads a mesh with whatever comes along with it. The content decides what it is where it says so itself, else the
/// file name's extension. The mesh has triangles, its indices are in range and its positions are finite.
pub fn read_model(file_name: &str, bytes: &[u8], resolver: Resolver) -> Result<Model, FormatError> {
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(FormatError::whole(file_name, "the file is empty", "Choose another file, or export it again"));
    }
    if bytes.trim_ascii_start().starts_with(b"HIERARCHY") {
        let what = "this is a BVH motion and holds no mesh";
        return Err(FormatError::whole(file_name, what, "Give it as the motion, and a mesh as the character"));
    }
    let kind = kind_of(file_name, bytes)
        .ok_or_else(|| FormatError::whole(file_name, "this is no mesh file that can be read", KNOWN))?;
    let mut model = match kind {
        Kind::Gltf => crate::gltf::read_gltf(file_name, bytes, resolver),
        Kind::Mesh => crate::medit::read_mesh(file_name, bytes),
        Kind::Obj => crate::obj::read_obj(file_name, bytes, resolver),
        Kind::Off => crate::off::read_off(file_name, bytes),
        Kind::Ply => crate::ply::read_ply(file_name, bytes),
        Kind::Stl => crate::stl::read_stl(file_name, bytes),
    }?;
    check(file_name, &mut model)?;
    if model.name.is_empty() {
        stem(file_name).clone_into(&mut model.name);
    }
    Ok(model)
}

/// File name without folders and extension.
fn stem(file_name: &str) -> &str {
    let name = file_name.rsplit(['/', '\\']).next().unwrap_or(file_name);
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

fn kind_of(file_name: &str, bytes: &[u8]) -> Option<Kind> {
    let extension = file_name.rsplit_once('.').map(|(_, e)| e.to_ascii_lowercase()).unwrap_or_default();
    by_content(bytes).or(match extension.as_str() {
        "gltf" | "glb" => Some(Kind::Gltf),
        "mesh" => Some(Kind::Mesh),
        "obj" => Some(Kind::Obj),
        "off" | "coff" | "noff" => Some(Kind::Off),
        "ply" => Some(Kind::Ply),
        "stl" => Some(Kind::Stl),
        _ => None,
    })
}

/// What the first bytes say beyond doubt.
fn by_content(bytes: &[u8]) -> Option<Kind> {
    let start = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes).trim_ascii_start();
    let word = start.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    if word.len() <= 7 && word.ends_with(b"OFF") {
        return Some(Kind::Off);
    }
    match word {
        _ if start.starts_with(b"glTF") || start.starts_with(b"{") => Some(Kind::Gltf),
        b"ply" if start[3..].starts_with(b"\n") || start[3..].starts_with(b"\r") => Some(Kind::Ply),
        _ if word.eq_ignore_ascii_case(b"solid") && has_word(start, b"facet") => Some(Kind::Stl),
        _ if word.eq_ignore_ascii_case(b"MeshVersionFormatted") => Some(Kind::Mesh),
        _ => None,
    }
}

/// Whether a word stands in the first bytes, in either case.
fn has_word(bytes: &[u8], word: &[u8]) -> bool {
    bytes[..bytes.len().min(500)].windows(word.len()).any(|w| w.eq_ignore_ascii_case(word))
}

/// What every reader must have established, checked once for all of them.
fn check(file: &str, model: &mut Model) -> Result<(), FormatError> {
    model.mesh.validate().map_err(|error| match error {
        MeshError::Empty => FormatError::whole(
            file,
            "there are no triangles in it",
            "Choose a file with a surface; point clouds and curves cannot be posed",
        ),
        other => FormatError::whole(file, other.to_string(), "Repair the mesh or export it again"),
    })?;
    let mut used = vec![false; model.mesh.vertices.len()];
    model.mesh.triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
    if let Some(tetrahedra) = &model.tetrahedra {
        tetrahedra.tetrahedra.iter().flatten().for_each(|&v| used[v as usize] = true);
    }
    let unused = used.iter().filter(|used| !**used).count();
    if unused > 0 {
        model.warnings.push(format!("{unused} of {} vertices belong to no triangle.", used.len()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_kinds() {
        assert_eq!(stem("/a/b.c/cow.old.off"), "cow.old");
        assert_eq!(stem("C:\\x\\cow"), "cow");
        assert_eq!(kind_of("a.OBJ", b"v 0 0 0"), Some(Kind::Obj));
        assert_eq!(kind_of("a.obj", b"COFF\n1 2"), Some(Kind::Off));
        assert_eq!(kind_of("a.txt", b"hello"), None);
        assert_eq!(kind_of("a.obj", b"solid x\n  FACET normal"), Some(Kind::Stl));
        assert_eq!(kind_of("a.stl", b"ply made this binary"), Some(Kind::Stl));
        assert_eq!(kind_of("a.stl", b"ply\r\nformat"), Some(Kind::Ply));
    }
}
