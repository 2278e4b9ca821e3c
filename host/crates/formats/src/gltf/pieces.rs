//! A surface cut into its parts, checked, as writers of meshes need it.

use std::borrow::Cow;
use std::ops::Range;

use armature_geometry::Influences;
use armature_rig::Skeleton;
use glam::{DAffine3, DVec3};

use super::scene::{GlbMesh, bad};
use super::write_skin::rest_frames;
use crate::FormatError;
use crate::model::{Material, MeshPart, MorphTarget, check_parts};

/// A part and its morph targets.
pub(crate) struct Piece<'a> {
    pub(crate) part: MeshPart,
    pub(crate) targets: Vec<&'a MorphTarget>,
}

impl Piece<'_> {
    /// Whether both can be one mesh with two materials: these share name, skin and morph targets.
    pub(crate) fn goes_with(&self, other: &Self) -> bool {
        let shape = |target: &MorphTarget| (target.name.clone(), target.normals.is_empty(), target.default_weight);
        (&self.part.name, self.part.skin) == (&other.part.name, other.part.skin)
            && self.targets.iter().map(|t| shape(t)).eq(other.targets.iter().map(|t| shape(t)))
    }

    /// Where its morph targets are in the surface's list.
    pub(crate) fn targets_in(&self, surface: &GlbMesh) -> Vec<usize> {
        let place = |own: &&MorphTarget| surface.morph_targets.iter().position(|target| std::ptr::eq(target, *own));
        self.targets.iter().filter_map(place).collect()
    }

    /// Its drawn vertices.
    pub(crate) fn drawn(&self) -> Range<usize> {
        self.part.vertices.start as usize..self.part.vertices.end as usize
    }

    /// Its triangles.
    pub(crate) fn triangles(&self) -> Range<usize> {
        self.part.triangles.start as usize..self.part.triangles.end as usize
    }

    /// The position of a drawn vertex, counted in the part, without the morph targets, which are at their default
    /// weights in the surface.
    pub(crate) fn base_position(&self, shown: [f64; 3], drawn: usize) -> [f64; 3] {
        let mut position = shown;
        for target in self.targets.iter().filter(|target| target.default_weight != 0.0) {
            for (c, offset) in position.iter_mut().zip(target.positions[drawn]) {
                *c -= f64::from(target.default_weight) * f64::from(offset);
            }
        }
        position
    }

    /// The same for its unit normal.
    pub(crate) fn base_normal(&self, shown: [f32; 3], drawn: usize) -> [f32; 3] {
        let mut normal = DVec3::from(shown.map(f64::from));
        for target in self.targets.iter().filter(|target| target.default_weight != 0.0 && !target.normals.is_empty()) {
            normal -= f64::from(target.default_weight) * DVec3::from(target.normals[drawn].map(f64::from));
        }
        normal.try_normalize().unwrap_or(DVec3::Y).as_vec3().to_array()
    }
}

/// A surface whose arrays are known to fit each other.
pub(crate) struct Cut<'a> {
    pub(crate) surface: &'a GlbMesh<'a>,
    /// The mesh vertex of each drawn vertex.
    pub(crate) vertex_of: Cow<'a, [u32]>,
    /// Over drawn vertices.
    pub(crate) triangles: &'a [[u32; 3]],
    /// The parts that have triangles, or the whole surface as one.
    pub(crate) pieces: Vec<Piece<'a>>,
}

impl<'a> Cut<'a> {
    /// Checks a surface and cuts it.
    pub(crate) fn of(surface: &'a GlbMesh<'a>) -> Result<Self, FormatError> {
        surface.mesh.validate().map_err(|error| bad(error.to_string(), "Repair the mesh"))?;
        let vertex_of: Cow<[u32]> = match surface.split {
            Some(split) => Cow::Borrowed(&split.mesh_vertex),
            None => Cow::Owned((0..surface.mesh.vertices.len() as u32).collect()),
        };
        let triangles = surface.split.map_or(&surface.mesh.triangles, |split| &split.triangles);
        check_lengths(surface, &vertex_of, triangles)?;
        let pieces = pieces(surface, vertex_of.len(), triangles)?;
        Ok(Self { surface, vertex_of, triangles, pieces })
    }
}

/// The frames in which the parts of a skin were bound, and its name; the rest pose without one.
pub(crate) fn bound_frames<'a>(
    surface: &GlbMesh<'a>,
    skeleton: &Skeleton,
    skin: Option<u32>,
) -> Result<(Vec<DAffine3>, &'a str), FormatError> {
    let Some(own) = skin.and_then(|skin| surface.skins.get(skin as usize)) else {
        return Ok((rest_frames(skeleton), ""));
    };
    let frames: Vec<DAffine3> = own
        .bound_model_from_bone
        .iter()
        .map(|frame| DAffine3 {
            matrix3: glam::Mat3::from(frame.matrix3).as_dmat3(),
            translation: glam::Vec3::from(frame.translation).as_dvec3(),
        })
        .collect();
    let usable = |frame: &DAffine3| frame.is_finite() && frame.inverse().is_finite();
    if frames.len() != skeleton.len() || !frames.iter().all(usable) {
        return Err(bad("a bind pose does not fit the skeleton", "Bind the character again"));
    }
    Ok((frames, &own.name))
}

/// The parts that have triangles, or the whole surface as one.
fn pieces<'a>(surface: &GlbMesh<'a>, vertices: usize, triangles: &[[u32; 3]]) -> Result<Vec<Piece<'a>>, FormatError> {
    if !surface.materials.iter().all(Material::is_finite) {
        return Err(bad("a number of a material is not finite", "Repair the materials"));
    }
    if surface.parts.is_empty() {
        let (vertices, triangles) = (0..vertices as u32, 0..triangles.len() as u32);
        let part = MeshPart { vertices, triangles, material: Some(0), ..MeshPart::default() };
        return Ok(vec![Piece { part, targets: Vec::new() }]);
    }
    let counts = [surface.materials.len(), surface.skins.len()];
    check_parts(surface.parts, surface.morph_targets, vertices, triangles, counts)
        .map_err(|error| bad(error.to_string(), "Bind the character again"))?;
    let piece = |(number, part): (u32, &MeshPart)| Piece {
        part: part.clone(),
        targets: surface.morph_targets.iter().filter(|target| target.part == number).collect(),
    };
    let has_triangles = |(_, part): &(u32, &MeshPart)| !Range::is_empty(&part.triangles);
    Ok((0..).zip(surface.parts).filter(has_triangles).map(piece).collect())
}

fn check_lengths(surface: &GlbMesh, vertex_of: &[u32], triangles: &[[u32; 3]]) -> Result<(), FormatError> {
    let drawn = vertex_of.len();
    let lengths = [
        ("normals", surface.normals.map(<[_]>::len), drawn),
        ("texture coordinates", surface.texture_coordinates.map(<[_]>::len), drawn),
        ("colours", surface.vertex_colors.map(<[_]>::len), drawn),
        ("rows of weights", surface.influences.map(Influences::vertex_count), surface.mesh.vertices.len()),
    ];
    for (what, have, need) in lengths {
        if let Some(have) = have.filter(|&have| have != need) {
            return Err(bad(format!("there are {have} {what} for {need} vertices"), "Bind the character again"));
        }
    }
    let out_of_range = |index: &u32, count: usize| *index as usize >= count;
    if vertex_of.iter().any(|v| out_of_range(v, surface.mesh.vertices.len()))
        || triangles.iter().flatten().any(|v| out_of_range(v, drawn))
    {
        return Err(bad("the drawn vertices do not match the mesh", "Bind the character again"));
    }
    let finite = surface.normals.is_none_or(|n| n.iter().flatten().all(|c| c.is_finite()))
        && surface.texture_coordinates.is_none_or(|t| t.iter().flatten().all(|c| c.is_finite()))
        && surface.vertex_colors.is_none_or(|t| t.iter().flatten().all(|c| c.is_finite()));
    if !finite {
        return Err(bad("a normal, texture coordinate or colour is not finite", "Repair the mesh"));
    }
    Ok(())
}
