//! The parts of a surface as meshes with skins and blend shapes.
//!
//! A vertex of the file is one of [`Points`]; normals, texture coordinates and colours belong to corners.

use super::identifiers::Identifiers;
use super::layer::{Layer, list, text, tuple, tuples};
use super::stage::Stage;
use super::write_material::Materials;
use super::write_skeleton::Skeletons;
use crate::FormatError;
use crate::gltf::GlbScene;
use crate::gltf::pieces::{Cut, Piece};
use crate::gltf::points::Points;
use crate::gltf::scene::bad;
use crate::gltf::write_skin::whole_row;
use crate::text::names::UniqueNames;

/// A control of blend shapes, and its weight unless something sets another.
pub(super) struct Shape {
    pub(super) name: String,
    pub(super) weight: f32,
    /// The first morph target of the surface that it moves.
    pub(super) target: usize,
    /// Its name in the scene.
    of: String,
}

/// Writes the surface of a scene; returns the controls of its blend shapes.
pub(super) fn write_surface(
    stage: &mut Stage,
    scene: &GlbScene,
    skeletons: &Skeletons,
    materials: &Materials,
    left_out: &mut Vec<String>,
) -> Result<Vec<Shape>, FormatError> {
    let mut shapes = Shapes { known: Vec::new(), names: UniqueNames::default() };
    let Some(surface) = &scene.mesh else { return Ok(shapes.known) };
    let cut = Cut::of(surface)?;
    for group in cut.pieces.chunk_by(Piece::goes_with) {
        let part = &group[0].part;
        let shown = if part.name.is_empty() { scene.name } else { &part.name };
        let name = stage.name(shown, "mesh");
        let mut points = Points::of(&cut, group);
        let targets = &group[0].targets;
        let skeleton = skeletons.path(part.skin);
        if skeleton.is_none() && !targets.is_empty() {
            show_as_they_are(&mut points, group);
            left_out.push(format!("USD has blend shapes only with a skeleton: those of {name} are left out"));
        }
        let mut schemas = vec!["MaterialBindingAPI"];
        schemas.extend(skeleton.map(|_| "SkelBindingAPI"));
        let path = stage.path(&name);
        let layer = stage.layer();
        layer.open("def Mesh", &name, &schemas, shown);
        write_geometry(layer, &cut, group, &points, materials)?;
        if let Some(skeleton) = skeleton {
            layer.line(format_args!("rel skel:skeleton = <{skeleton}>"));
            write_skin(layer, &cut, scene.skeleton.len(), &points)?;
            write_shapes(layer, &path, &cut, group, &points, &mut shapes);
        }
        layer.close();
    }
    Ok(shapes.known)
}

/// Moves points to where their blend shapes' default weights put them.
fn show_as_they_are(points: &mut Points, group: &[Piece]) {
    for (k, target) in group[0].targets.iter().enumerate() {
        let moved = points.moved_by(group, k);
        for (position, (offset, _)) in points.position.iter_mut().zip(moved) {
            let weight = f64::from(target.default_weight);
            position.iter_mut().zip(offset).for_each(|(c, o)| *c += weight * f64::from(o));
        }
    }
}

fn write_geometry(
    layer: &mut Layer,
    cut: &Cut,
    group: &[Piece],
    points: &Points,
    materials: &Materials,
) -> Result<(), FormatError> {
    let positions: Vec<[f32; 3]> = points.position.iter().map(|p| p.map(|c| c as f32)).collect();
    if !positions.iter().flatten().all(|c| c.is_finite()) {
        return Err(bad("a position is too large for single precision", "Scale the mesh"));
    }
    let mut corners = Vec::new();
    // Corners name drawn vertices, counted over all pieces of the group.
    let mut drawn_corners = Vec::new();
    let mut faces_of_piece = Vec::new();
    let (mut first_drawn, mut first_face) = (0_u32, 0);
    for (piece, of_drawn) in group.iter().zip(&points.of_drawn) {
        let first = piece.part.vertices.start;
        for triangle in &cut.triangles[piece.triangles()] {
            let local = triangle.map(|corner| corner - first);
            corners.extend(local.map(|corner| of_drawn[corner as usize]));
            drawn_corners.extend(local.map(|corner| first_drawn + corner));
        }
        first_drawn += of_drawn.len() as u32;
        let count = piece.triangles().len();
        faces_of_piece.push(first_face..first_face + count);
        first_face += count;
    }
    if i32::try_from(first_drawn).is_err() {
        return Err(bad("a mesh has too many vertices", "Simplify it"));
    }
    layer.line("uniform token subdivisionScheme = \"none\"");
    let low = positions.iter().fold([f32::INFINITY; 3], |a, p| std::array::from_fn(|k| a[k].min(p[k])));
    let high = positions.iter().fold([f32::NEG_INFINITY; 3], |a, p| std::array::from_fn(|k| a[k].max(p[k])));
    layer.line(format_args!("float3[] extent = [{}, {}]", tuple(low), tuple(high)));
    layer.line(format_args!("int[] faceVertexCounts = {}", list(std::iter::repeat_n(3, corners.len() / 3))));
    layer.line(format_args!("int[] faceVertexIndices = {}", list(&corners)));
    layer.line(format_args!("point3f[] points = {}", tuples(positions)));
    let surface = cut.surface;
    if let Some(normals) = surface.normals {
        let base = |piece: &Piece| -> Vec<[f32; 3]> {
            normals[piece.drawn()].iter().enumerate().map(|(k, normal)| piece.base_normal(*normal, k)).collect()
        };
        let of_drawn: Vec<[f32; 3]> = group.iter().flat_map(base).collect();
        let values = tuples(drawn_corners.iter().map(|&corner| of_drawn[corner as usize]));
        layer.line(format_args!("normal3f[] normals = {values} (interpolation = \"faceVarying\")"));
    }
    let by_corner = |layer: &mut Layer, kind: &str, name: &str, values: String| {
        layer.line(format_args!("{kind}[] primvars:{name} = {values} (interpolation = \"faceVarying\")"));
        layer.line(format_args!("int[] primvars:{name}:indices = {}", list(&drawn_corners)));
    };
    if let Some(textures) = surface.texture_coordinates {
        let all = group.iter().flat_map(|piece| &textures[piece.drawn()]);
        by_corner(layer, "texCoord2f", "st", tuples(all.map(|[u, v]| [*u, 1.0 - v])));
    }
    if let Some(colors) = surface.vertex_colors {
        let all = || group.iter().flat_map(|piece| &colors[piece.drawn()]);
        by_corner(layer, "color3f", "displayColor", tuples(all().map(|[r, g, b, _]| [*r, *g, *b])));
        if all().any(|color| color[3] < 1.0) {
            by_corner(layer, "float", "displayOpacity", list(all().map(|color| color[3])));
        }
    }
    let of_piece = |piece: &Piece| piece.part.material.and_then(|material| materials.get(material));
    let double_sided = group.iter().all(|piece| of_piece(piece).is_none_or(|material| material.double_sided));
    layer.line(format_args!("uniform bool doubleSided = {}", u8::from(double_sided)));
    let first = of_piece(&group[0]).map(|material| &material.path);
    if group.iter().all(|piece| of_piece(piece).map(|material| &material.path) == first) {
        if let Some(path) = first {
            layer.line(format_args!("rel material:binding = <{path}>"));
        }
        return Ok(());
    }
    let mut names = Identifiers::default();
    let mut bound: Vec<(&str, Vec<usize>)> = Vec::new();
    for (piece, faces) in group.iter().zip(faces_of_piece) {
        let Some(material) = of_piece(piece) else { continue };
        match bound.iter_mut().find(|(path, _)| *path == material.path) {
            Some((_, known)) => known.extend(faces),
            None => bound.push((&material.path, faces.collect())),
        }
    }
    layer.line("uniform token subsetFamily:materialBind:familyType = \"nonOverlapping\"");
    for (path, faces) in bound {
        let name = names.give(path.rsplit('/').next().unwrap_or_default(), "faces");
        layer.open("def GeomSubset", &format!("faces_{name}"), &["MaterialBindingAPI"], "");
        layer.line("uniform token elementType = \"face\"");
        layer.line("uniform token familyName = \"materialBind\"");
        layer.line(format_args!("int[] indices = {}", list(faces)));
        layer.line(format_args!("rel material:binding = <{path}>"));
        layer.close();
    }
    Ok(())
}

fn write_skin(layer: &mut Layer, cut: &Cut, bones: usize, points: &Points) -> Result<(), FormatError> {
    let Some(influences) = cut.surface.influences else {
        return Err(bad("the mesh follows no bones", "Bind the character first"));
    };
    if let Some(bone) = influences.bones().iter().find(|&&bone| usize::from(bone) >= bones) {
        return Err(bad(format!("a vertex follows bone {bone} of {bones}"), "Bind the character again"));
    }
    let rows: Vec<Vec<(u16, f32)>> =
        points.vertex.iter().map(|&vertex| whole_row(influences, vertex as usize)).collect();
    let width = rows.iter().map(Vec::len).max().unwrap_or(0).max(1);
    let slots = || rows.iter().flat_map(|row| (0..width).map(|k| row.get(k).copied().unwrap_or((0, 0.0))));
    let each = format!("(elementSize = {width}; interpolation = \"vertex\")");
    layer.line("matrix4d primvars:skel:geomBindTransform = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))");
    layer.line(format_args!("int[] primvars:skel:jointIndices = {} {each}", list(slots().map(|slot| slot.0))));
    layer.line(format_args!("float[] primvars:skel:jointWeights = {} {each}", list(slots().map(|slot| slot.1))));
    Ok(())
}

/// The controls of blend shapes that were written.
struct Shapes {
    known: Vec<Shape>,
    names: UniqueNames,
}

impl Shapes {
    /// The control for a target; targets with one name and one default weight share it.
    fn control(&mut self, of: &str, weight: f32, target: usize) -> String {
        if let Some(shape) = self.known.iter().find(|shape| shape.of == of && shape.weight.total_cmp(&weight).is_eq()) {
            return shape.name.clone();
        }
        let name = self.names.give(of, "shape");
        self.known.push(Shape { name: name.clone(), weight, target, of: of.to_owned() });
        name
    }
}

fn write_shapes(layer: &mut Layer, mesh: &str, cut: &Cut, group: &[Piece], points: &Points, shapes: &mut Shapes) {
    let targets = &group[0].targets;
    if targets.is_empty() {
        return;
    }
    let mut names = Identifiers::default();
    let prims: Vec<String> = targets.iter().map(|target| names.give(&target.name, "shape")).collect();
    let mut controls = Vec::with_capacity(targets.len());
    let mut here = UniqueNames::default();
    for (target, place) in targets.iter().zip(group[0].targets_in(cut.surface)) {
        // A mesh may have two targets of one name; each needs a control.
        let own = here.give(&target.name, "shape");
        controls.push(text(&shapes.control(&own, target.default_weight, place)));
    }
    layer.line(format_args!("uniform token[] skel:blendShapes = {}", list(controls)));
    let paths = prims.iter().map(|prim| format!("<{mesh}/{prim}>"));
    layer.line(format_args!("rel skel:blendShapeTargets = {}", list(paths)));
    for (k, (target, prim)) in targets.iter().zip(&prims).enumerate() {
        let moved = points.moved_by(group, k);
        let is_moved = |&point: &usize| {
            let (offset, normal) = &moved[point];
            offset.iter().any(|c| *c != 0.0) || *normal != glam::DVec3::ZERO
        };
        let indices: Vec<usize> = (0..moved.len()).filter(is_moved).collect();
        layer.open("def BlendShape", prim, &[], &target.name);
        layer.line(format_args!("uniform vector3f[] offsets = {}", tuples(indices.iter().map(|&i| moved[i].0))));
        let turns = if target.normals.is_empty() {
            "[]".to_owned()
        } else {
            tuples(indices.iter().map(|&i| moved[i].1.as_vec3().to_array()))
        };
        layer.line(format_args!("uniform vector3f[] normalOffsets = {turns}"));
        layer.line(format_args!("uniform int[] pointIndices = {}", list(&indices)));
        layer.close();
    }
}
