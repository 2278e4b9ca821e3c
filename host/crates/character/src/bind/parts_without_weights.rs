//! Parts of a rigged model that come without weights, or are to get others: from the parts beside them.

use std::ops::Range;

use armature_formats::model::{MeshPart, Model, ModelRig};
use armature_geometry::{Influences, TriangleMesh};
use armature_weights::transfer::{TransferSettings, WeightRow, inpaint_weights, transfer_weights};
use glam::DVec3;

use super::error::BindError;
use super::settings::BindSettings;
use crate::progress::Progress;

/// A part without weights gets those of the parts beside it if at least this share of its vertices lies on them.
const COVERED: f64 = 0.5;
/// Of all the binding, where this work begins and ends.
const FIRST_SHARE: f64 = 0.94;
const LAST_SHARE: f64 = 0.97;
/// Most names listed in one sentence.
const MOST_NAMES: usize = 8;
/// Weights below this are left out; coincident vertices differ by less.
const DUST: f64 = 1e-7;

/// A mesh of the model: all parts of one name, whatever their materials.
struct Named {
    name: String,
    /// Drawn vertices of each of its parts.
    vertices: Vec<Range<u32>>,
    triangles: Vec<Range<u32>>,
    /// Whether a part is bound in a pose of its own.
    posed: bool,
}

impl Named {
    fn vertex_numbers(&self) -> Vec<u32> {
        self.vertices.iter().cloned().flatten().collect()
    }

    fn triangle_numbers(&self) -> impl Iterator<Item = u32> + '_ {
        self.triangles.iter().cloned().flatten()
    }
}

/// Checks that the model has the parts named in the settings.
pub(super) fn check_names(model: &Model, settings: &BindSettings) -> Result<(), BindError> {
    let names: Vec<String> = named_parts(model).into_iter().map(|part| part.name).collect();
    match settings.transfer.iter().find(|name| !names.contains(name)) {
        None => Ok(()),
        Some(name) => Err(BindError::NoSuchPart { name: name.clone(), names }),
    }
}

/// The triangles of the parts that do not take their weights from others.
pub(super) fn own_triangles(model: &Model, settings: &BindSettings) -> Vec<[u32; 3]> {
    let parts = named_parts(model);
    let own = parts.iter().filter(|part| !settings.transfer.contains(&part.name));
    own.flat_map(Named::triangle_numbers).map(|number| model.mesh.triangles[number as usize]).collect()
}

/// What a rigged model's parts without weights do, in a sentence, if they are left as they are.
pub(super) fn left_unbound(model: &Model) -> Option<String> {
    let rig = model.rig.as_ref().filter(|rig| !rig.unbound.is_empty())?;
    let split = model.mesh_vertex_of_drawn();
    let is_unbound = |drawn: u32| rig.unbound.binary_search(&split[drawn as usize]).is_ok();
    let mut parts = named_parts(model);
    parts.retain(|part| part.vertex_numbers().into_iter().all(is_unbound));
    let first = parts.first()?;
    let bone = carrier(rig, &[split[first.vertex_numbers().first().copied()? as usize]]);
    let names: Vec<&str> = parts.iter().take(MOST_NAMES).map(|part| part.name.as_str()).collect();
    let more = if parts.len() > names.len() { ", …" } else { "" };
    Some(format!(
        "no weights come with {}{more}: carried by {bone} as a whole; `armature bind` takes weights from the parts they lie on",
        names.join(", ")
    ))
}

/// Gives weights to the parts that have none, and new ones to those named in the settings; the others keep theirs bit for
/// bit. The model's drawn vertices become its mesh. Returns what happened to each part, in sentences; nothing if all keep
/// their weights. `origin`: where the weights that the model has are from.
pub(super) fn bind_parts_without_weights(
    model: &mut Model,
    origin: &str,
    settings: &BindSettings,
    progress: Progress<'_>,
) -> Result<Vec<String>, BindError> {
    let Some(rig) = &model.rig else { return Ok(Vec::new()) };
    if settings.transfer.is_empty() && (rig.unbound.is_empty() || !settings.bind_unbound) {
        return Ok(Vec::new());
    }
    *model = model.split_at_seams();
    let Some(rig) = model.rig.take() else { return Ok(Vec::new()) };
    let mut unbound = vec![false; model.mesh.vertices.len()];
    rig.unbound.iter().for_each(|&vertex| unbound[vertex as usize] = true);
    let parts = named_parts(model);
    let is_asked = |part: &Named| settings.transfer.contains(&part.name);
    let gives = |part: &&Named| !is_asked(part) && !part.posed;
    let whole = |triangle: &[u32; 3]| !triangle.iter().any(|&vertex| unbound[vertex as usize]);
    let triangles = parts.iter().filter(gives).flat_map(Named::triangle_numbers);
    let triangles = triangles.map(|number| model.mesh.triangles[number as usize]).filter(whole);
    let source = Source::new(&model.mesh, &rig, &triangles.collect::<Vec<_>>())?;
    if source.is_none() && !settings.transfer.is_empty() {
        return Err(BindError::NothingToTransfer);
    }
    let mut new_rows: Vec<Option<WeightRow>> = vec![None; unbound.len()];
    let (mut told, mut kept) = (Vec::new(), Vec::new());
    for (number, part) in parts.iter().enumerate() {
        let vertices = part.vertex_numbers();
        let missing = vertices.iter().filter(|&&vertex| unbound[vertex as usize]).count();
        if missing == 0 && !is_asked(part) {
            kept.push(part.name.as_str());
            continue;
        }
        let (from, share) = (FIRST_SHARE, (LAST_SHARE - FIRST_SHARE) / parts.len() as f64);
        let mut on_the_way = |stage: &'static str, done: f64| progress(stage, from + share * (number as f64 + done));
        let (rows, said) = if !is_asked(part) && missing < vertices.len() {
            fill_in(model, part, &rig, &unbound, &mut on_the_way)?
        } else {
            match &source {
                _ if part.posed => (Vec::new(), left_alone(&rig, &vertices, "it was bound in a pose of its own")),
                None => (Vec::new(), left_alone(&rig, &vertices, "no part has some to take")),
                Some(source) => from_others(model, part, (&rig, source), is_asked(part), &mut on_the_way)?,
            }
        };
        rows.into_iter().for_each(|(vertex, row)| new_rows[vertex as usize] = Some(row));
        told.push(format!("{}: {said}", part.name));
    }
    if !kept.is_empty() {
        told.insert(0, format!("{origin} stay as they are: {}", kept.join(", ")));
    }
    let influences = replaced(&rig.influences, &new_rows, settings.max_influences, rig.skeleton.len())?;
    let still = |vertex: &u32| new_rows[*vertex as usize].is_none();
    let unbound = rig.unbound.iter().copied().filter(still).collect();
    model.rig = Some(ModelRig { influences, unbound, ..rig });
    Ok(told)
}

/// What weights are taken from.
struct Source {
    mesh: TriangleMesh,
    weights: Influences,
}

impl Source {
    /// `None` if there is no triangle with an area.
    fn new(mesh: &TriangleMesh, rig: &ModelRig, triangles: &[[u32; 3]]) -> Result<Option<Self>, BindError> {
        let (mesh, vertices) = piece(mesh, triangles);
        if !has_faces(&mesh) {
            return Ok(None);
        }
        let rows: Vec<WeightRow> = vertices.iter().map(|&v| row_of(&rig.influences, v)).collect();
        let weights = influences_of(&rows, rig.influences.per_vertex(), rig.skeleton.len())?;
        Ok(Some(Self { mesh, weights }))
    }
}

/// Whether there is a triangle with three corners at different places.
fn has_faces(mesh: &TriangleMesh) -> bool {
    let places = |triangle: &[u32; 3]| triangle.map(|vertex| DVec3::from(mesh.vertices[vertex as usize]));
    mesh.triangles.iter().map(places).any(|[a, b, c]| a != b && b != c && c != a)
}

/// What a part does that gets no weights.
fn left_alone(rig: &ModelRig, vertices: &[u32], why: &str) -> String {
    format!("has no weights, and {why}: it follows {} as a whole", carrier(rig, vertices))
}

/// The parts in order of appearance, those of one name together.
fn named_parts(model: &Model) -> Vec<Named> {
    let whole = [MeshPart {
        name: model.name.clone(),
        vertices: 0..model.drawn_vertex_count() as u32,
        triangles: 0..model.mesh.triangles.len() as u32,
        ..MeshPart::default()
    }];
    let parts = if model.parts.is_empty() { &whole[..] } else { &model.parts };
    let mut named: Vec<Named> = Vec::new();
    for (number, part) in parts.iter().enumerate() {
        let name = if part.name.is_empty() { format!("part {}", number + 1) } else { part.name.clone() };
        let at = named.iter().position(|known| known.name == name).unwrap_or_else(|| {
            named.push(Named { name, vertices: Vec::new(), triangles: Vec::new(), posed: false });
            named.len() - 1
        });
        named[at].vertices.push(part.vertices.clone());
        named[at].triangles.push(part.triangles.clone());
        named[at].posed |= part.skin.is_some();
    }
    named
}

type NewRows = Vec<(u32, WeightRow)>;

/// The vertices of a part that the artist left out, from those around them.
fn fill_in(
    model: &Model,
    part: &Named,
    rig: &ModelRig,
    unbound: &[bool],
    progress: Progress<'_>,
) -> Result<(NewRows, String), BindError> {
    let (mesh, vertices) = mesh_of(model, part);
    if !has_faces(&mesh) {
        return Ok((Vec::new(), left_alone(rig, &part.vertex_numbers(), "no triangle of it has an area")));
    }
    let given = vertices.iter().map(|&v| (!unbound[v as usize]).then(|| row_of(&rig.influences, v)));
    let made = inpaint_weights(&mesh, &given.collect::<Vec<_>>(), progress)?;
    let left = made.unreached.len();
    let rest = if left == 0 {
        String::new()
    } else {
        format!("; {left} have none around and follow {}", carrier(rig, &vertices))
    };
    let said = format!("keeps its own weights; {} vertices that have none get those around them{rest}", made.filled);
    let new = vertices.iter().copied().zip(made.rows);
    Ok((new.filter(|(v, row)| unbound[*v as usize] && !row.is_empty()).collect(), said))
}

/// All vertices of a part, from the other parts if it lies on them or is asked for.
fn from_others(
    model: &Model,
    part: &Named,
    (rig, source): (&ModelRig, &Source),
    is_asked: bool,
    progress: Progress<'_>,
) -> Result<(NewRows, String), BindError> {
    let (mesh, vertices) = mesh_of(model, part);
    if !has_faces(&mesh) {
        return Ok((Vec::new(), left_alone(rig, &part.vertex_numbers(), "no triangle of it has an area")));
    }
    let settings = TransferSettings::default();
    let made = transfer_weights(&source.mesh, &source.weights, &mesh, &settings, progress)?;
    let covered = (made.matched + made.carried) as f64 / vertices.len().max(1) as f64;
    if covered < COVERED && !is_asked {
        let share = 100.0 * covered;
        let why = format!("only {share:.0} % of it lies on parts that have some");
        let said = left_alone(rig, &vertices, &why);
        return Ok((Vec::new(), format!("{said}; --transfer {:?} takes weights from them all the same", part.name)));
    }
    let how = [
        (made.inpainted, "filled in between"),
        (made.carried, "in small pieces that follow as one"),
        (made.unreached.len(), "too far away, which stay as they were"),
    ];
    let others = how.iter().filter(|(count, _)| *count > 0).map(|(count, how)| format!(", {count} {how}"));
    let others = others.collect::<Vec<_>>().concat();
    let near = made.matched;
    let said = format!("takes its weights from the parts it lies on: {near} vertices from the nearest place{others}");
    Ok((vertices.into_iter().zip(made.rows).filter(|(_, row)| !row.is_empty()).collect(), said))
}

/// A part as a mesh of its own, and its vertices in the model.
fn mesh_of(model: &Model, part: &Named) -> (TriangleMesh, Vec<u32>) {
    let triangles: Vec<[u32; 3]> = part.triangle_numbers().map(|t| model.mesh.triangles[t as usize]).collect();
    piece(&model.mesh, &triangles)
}

/// Some triangles of a mesh as a mesh of its own, and the numbers that its vertices had.
pub(super) fn piece(mesh: &TriangleMesh, triangles: &[[u32; 3]]) -> (TriangleMesh, Vec<u32>) {
    let mut number = vec![u32::MAX; mesh.vertices.len()];
    let mut vertices = Vec::new();
    let mut renumbered = |vertex: u32| {
        let slot = &mut number[vertex as usize];
        if *slot == u32::MAX {
            *slot = vertices.len() as u32;
            vertices.push(vertex);
        }
        *slot
    };
    let triangles = triangles.iter().map(|triangle| triangle.map(&mut renumbered)).collect();
    let places = vertices.iter().map(|&vertex| mesh.vertices[vertex as usize]).collect();
    (TriangleMesh { vertices: places, triangles }, vertices)
}

fn row_of(influences: &Influences, vertex: u32) -> WeightRow {
    influences.of_vertex(vertex as usize).map(|(bone, weight)| (bone, f64::from(weight))).collect()
}

/// The bone that vertices without weights follow.
fn carrier(rig: &ModelRig, vertices: &[u32]) -> String {
    let unbound = vertices.iter().find(|vertex| rig.unbound.binary_search(vertex).is_ok());
    let bone = unbound.and_then(|&vertex| rig.influences.of_vertex(vertex as usize).next());
    let name = bone.and_then(|(bone, _)| rig.skeleton.bones().get(usize::from(bone))).map(|bone| bone.name.clone());
    name.unwrap_or_else(|| "the first bone".to_owned())
}

fn influences_of(rows: &[WeightRow], per_vertex: usize, bone_count: usize) -> Result<Influences, BindError> {
    let (mut bones, mut weights) = (Vec::new(), Vec::new());
    for row in rows {
        for slot in 0..per_vertex {
            let (bone, weight) = row.get(slot).copied().unwrap_or((0, 0.0));
            bones.push(bone);
            weights.push(weight as f32);
        }
    }
    Ok(Influences::restore(per_vertex, bones, weights, bone_count)?)
}

/// The influences with some rows replaced by the `most` strongest of the new ones; the others stay as they are.
fn replaced(
    influences: &Influences,
    new: &[Option<WeightRow>],
    most: usize,
    bone_count: usize,
) -> Result<Influences, BindError> {
    let strongest = |row: &WeightRow| {
        let mut row: WeightRow = row.iter().copied().filter(|(_, weight)| *weight > DUST).collect();
        row.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        row.truncate(most);
        let sum: f64 = row.iter().map(|(_, weight)| weight).sum();
        row.iter_mut().for_each(|(_, weight)| *weight /= sum);
        row
    };
    let new: Vec<Option<WeightRow>> = new.iter().map(|row| row.as_ref().map(strongest)).collect();
    let widest = new.iter().flatten().map(Vec::len).max().unwrap_or(0);
    let per_vertex = influences.per_vertex().max(widest);
    let rows = (0..).zip(&new).map(|(vertex, row)| row.clone().unwrap_or_else(|| row_of(influences, vertex)));
    influences_of(&rows.collect::<Vec<_>>(), per_vertex, bone_count)
}
