//! One entry point for all mesh files.

use armature_geometry::MeshError;

use crate::FormatError;
use crate::fbx::is_fbx;
use crate::mesh::stl::{is_binary_stl, is_text_stl};
use crate::model::{Model, Resolver};
use crate::text::without_bom;

/// The kinds of mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Fbx,
    Gltf,
    Mesh,
    Obj,
    Off,
    Ply,
    Stl,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Fbx => "FBX",
            Self::Gltf => "glTF",
            Self::Mesh => "Medit MESH",
            Self::Obj => "OBJ",
            Self::Off => "OFF",
            Self::Ply => "PLY",
            Self::Stl => "STL",
        }
    }
}

const KNOWN: &str = "Meshes are read from FBX, glTF, GLB, OBJ, PLY, STL, OFF and MESH files; export as one of these";

/// Reads a mesh with everything that comes with it. The content determines the format if it is unmistakable, otherwise
/// the file name's extension does. The mesh has triangles, its indices are in range and its positions are finite.
pub fn read_model(file_name: &str, bytes: &[u8], resolver: Resolver) -> Result<Model, FormatError> {
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(FormatError::whole(file_name, "the file is empty", "Choose another file, or export it again"));
    }
    if bytes.trim_ascii_start().starts_with(b"HIERARCHY") {
        let what = "this is a BVH motion without a mesh";
        return Err(FormatError::whole(file_name, what, "Give it as the motion, and a mesh as the character"));
    }
    let kind = kind_of(file_name, bytes)
        .ok_or_else(|| FormatError::whole(file_name, "this is not a mesh file that can be read", KNOWN))?;
    let named = by_extension(file_name);
    let mut model = match kind {
        Kind::Fbx => crate::fbx::read_fbx(file_name, bytes, resolver),
        Kind::Gltf => crate::gltf::read_gltf(file_name, bytes, resolver),
        Kind::Mesh => crate::mesh::medit::read_mesh(file_name, bytes),
        Kind::Obj => crate::mesh::obj::read_obj(file_name, bytes, resolver),
        Kind::Off => crate::mesh::off::read_off(file_name, bytes),
        Kind::Ply => crate::mesh::ply::read_ply(file_name, bytes),
        Kind::Stl => crate::mesh::stl::read_stl(file_name, bytes),
    }?;
    check(file_name, &mut model)?;
    if named.is_some_and(|named| named != kind) {
        model.warnings.insert(0, format!("The contents are {}, though the file's name says otherwise.", kind.name()));
    }
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
    by_content(bytes).or_else(|| by_extension(file_name))
}

fn by_extension(file_name: &str) -> Option<Kind> {
    let extension = file_name.rsplit_once('.').map(|(_, e)| e.to_ascii_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "fbx" => Some(Kind::Fbx),
        "gltf" | "glb" | "vrm" => Some(Kind::Gltf),
        "mesh" => Some(Kind::Mesh),
        "obj" => Some(Kind::Obj),
        "off" | "coff" | "noff" => Some(Kind::Off),
        "ply" => Some(Kind::Ply),
        "stl" => Some(Kind::Stl),
        _ => None,
    }
}

/// What the first bytes identify beyond doubt.
fn by_content(bytes: &[u8]) -> Option<Kind> {
    let start = without_bom(bytes).trim_ascii_start();
    let word = start.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    if word.len() <= 7 && word.ends_with(b"OFF") {
        return Some(Kind::Off);
    }
    match word {
        _ if is_fbx(bytes) => Some(Kind::Fbx),
        _ if start.starts_with(b"glTF") || start.starts_with(b"{") => Some(Kind::Gltf),
        b"ply" if start[3..].starts_with(b"\n") || start[3..].starts_with(b"\r") => Some(Kind::Ply),
        _ if word.eq_ignore_ascii_case(b"MeshVersionFormatted") => Some(Kind::Mesh),
        _ if is_text_stl(bytes) || is_binary_stl(bytes) => Some(Kind::Stl),
        _ if is_obj(start) => Some(Kind::Obj),
        _ => None,
    }
}

/// Whether the first lines are all OBJ statements, up to a vertex.
fn is_obj(start: &[u8]) -> bool {
    const LOOK_AHEAD: usize = 4000;
    const STATEMENTS: [&str; 9] = ["v", "vt", "vn", "f", "o", "g", "s", "mtllib", "usemtl"];
    let text = String::from_utf8_lossy(&start[..start.len().min(LOOK_AHEAD)]);
    for line in text.lines().map(|line| line.split_once('#').map_or(line, |(before, _)| before)) {
        let mut words = line.split_whitespace();
        match words.next() {
            None => {}
            Some("v") => return words.take(3).filter(|w| w.parse::<f64>().is_ok()).count() == 3,
            Some(word) if STATEMENTS.contains(&word) => {}
            Some(_) => return false,
        }
    }
    false
}

/// What every reader must guarantee, checked once for all of them.
fn check(file: &str, model: &mut Model) -> Result<(), FormatError> {
    model.mesh.validate().map_err(|error| match error {
        MeshError::Empty => FormatError::whole(
            file,
            "it contains no triangles",
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
        assert_eq!(kind_of("a.stl", b"# made by hand\no cube\nv 1 2 3\n"), Some(Kind::Obj));
        assert_eq!(kind_of("a.stl", b"v w x\n"), Some(Kind::Stl));
        assert_eq!(kind_of("a.stl", b"o v 1 2 3"), Some(Kind::Stl));
        assert_eq!(kind_of("a.obj", b"\xEF\xBB\xBF \n Solid\nfacet"), Some(Kind::Stl));
        let mut binary = vec![b'v'; 84 + 50];
        binary[80..84].copy_from_slice(&[1, 0, 0, 0]);
        assert_eq!(kind_of("a.obj", &binary), Some(Kind::Stl));
    }
}
