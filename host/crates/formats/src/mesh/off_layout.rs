//! What text and binary OFF share.

use armature_geometry::TriangleMesh;

use super::polygon::{MAX_CONCAVE_CORNERS, triangulate};
use crate::model::Model;

/// Which numbers a vertex has, from the letters before OFF.
#[derive(Clone, Copy, Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "one for each letter that may come before OFF")]
pub(super) struct Layout {
    pub(super) texture: bool,
    pub(super) colors: bool,
    pub(super) normals: bool,
    pub(super) homogeneous: bool,
}

impl Layout {
    /// `None` for letters of a kind that is not three-dimensional.
    pub(super) fn of_letters(letters: &str) -> Option<Self> {
        let mut left = letters;
        let mut take = |prefix: &str| {
            let after = left.strip_prefix(prefix);
            left = after.unwrap_or(left);
            after.is_some()
        };
        let layout = Self { texture: take("ST"), colors: take("C"), normals: take("N"), homogeneous: take("4") };
        left.is_empty().then_some(layout)
    }
}

/// Cuts a face into triangles and adds them. An error is what is wrong and the remedy.
pub(super) fn add_face(corners: &[u32], mesh: &mut TriangleMesh) -> Result<(), (String, &'static str)> {
    if let Some(bad) = corners.iter().find(|&&v| v as usize >= mesh.vertices.len()) {
        let what = format!("the face refers to vertex {bad}, but there are only {}", mesh.vertices.len());
        return Err((what, "OFF counts vertices from 0; export the mesh again"));
    }
    let positions: Vec<[f64; 3]> = corners.iter().map(|&v| mesh.vertices[v as usize]).collect();
    let triangles = triangulate(&positions).ok_or_else(|| {
        let count = corners.len();
        let what = format!("a concave face has {count} corners, more than {MAX_CONCAVE_CORNERS}");
        (what, "Triangulate the mesh in your modelling program")
    })?;
    mesh.triangles.extend(triangles.into_iter().map(|t| t.map(|i| corners[i])));
    Ok(())
}

/// Keeps the normals and texture coordinates of the layout, unless some are not finite.
pub(super) fn set_attributes(layout: Layout, normals: Vec<[f32; 3]>, textures: Vec<[f32; 2]>, model: &mut Model) {
    let normals_are_finite = normals.iter().flatten().all(|c| c.is_finite());
    let textures_are_finite = textures.iter().flatten().all(|c| c.is_finite());
    if layout.normals && !normals_are_finite {
        model.warnings.push("The normals are ignored: some are not finite.".to_owned());
    }
    if layout.texture && !textures_are_finite {
        model.warnings.push("The texture coordinates are ignored: some are not finite.".to_owned());
    }
    model.normals = (layout.normals && normals_are_finite).then_some(normals);
    model.texture_coordinates = (layout.texture && textures_are_finite).then_some(textures);
}
