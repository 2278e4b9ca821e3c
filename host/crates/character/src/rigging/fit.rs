//! Fitting a template's skeleton into a mesh.

use std::ops::ControlFlow;

use armature_geometry::TriangleMesh;
use armature_geometry::planar::plane_of;
use armature_rig::{Bone, Skeleton, Transform};
use glam::DVec3;

use super::certainty::{Doubt, certainties, doubts, outside_of_bones};
use super::error::RigError;
use super::interior::{Interior, bounds};
use super::landmarks::landmarks;
use super::placement::place;
use super::search::search;
use super::settings::RigSettings;
use super::template::Template;
use super::turns::turns;
use crate::progress::Progress;

/// A skeleton in a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The bones, with the names and in the order of the template, in the mesh's unit and place; rest rotations are the
    /// identity.
    pub skeleton: Skeleton,
    /// How sure each bone is, 0 to 1.
    pub certainty: Vec<f64>,
    /// What could not be told.
    pub doubts: Vec<Doubt>,
    /// Which way is up in the mesh; unit vector.
    pub up: [f64; 3],
    /// Which way the figure looks; unit vector.
    pub front: [f64; 3],
    /// How badly the template fits as a whole: 0 for the template itself, about 0.8 more for each limb that is missing.
    pub misfit: f64,
}

/// Fits the skeleton of `template` into `mesh`: joints in the middle of limbs, in the proportions of the template where
/// a limb does not show them, both sides alike where the mesh is symmetric.
///
/// After *Automatic Rigging and Animation of 3D Characters* (Baran and Popović 2007): spheres on the medial axis, a
/// discrete embedding by penalty functions, then joints along the limbs. Differences: the ends of limbs are the persistent
/// maxima of the geodesic distance from the middle; given them, the best places of all hubs are found exactly by dynamic
/// programming, which also bounds the branch and bound search over ends, sizes and stances; and joints along a limb are
/// those of the polygon that fits its medial curve best.
pub fn fit(
    mesh: &TriangleMesh,
    template: &Template,
    settings: &RigSettings,
    progress: Progress<'_>,
) -> Result<Fit, RigError> {
    let mut stage = |name: &'static str, done: f64| match progress(name, done) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(RigError::Cancelled { stage: name }),
    };
    mesh.validate()?;
    if plane_of(mesh)?.is_some() {
        return Err(RigError::Flat);
    }
    stage("finding the inside", 0.0)?;
    let (low, high) = bounds(mesh);
    let (origin, size) = (0.5 * low + 0.5 * high, (0.5 * high - 0.5 * low).max_element() * 2.0);
    if !size.is_finite() || size <= 0.0 {
        return Err(RigError::Flat);
    }
    let unit = |v: &[f64; 3]| ((DVec3::from(*v) - origin) / size).to_array();
    let in_unit_box =
        TriangleMesh { vertices: mesh.vertices.iter().map(unit).collect(), triangles: mesh.triangles.clone() };
    let interior = Interior::sample(&in_unit_box)?;
    stage("finding the ends of limbs", 0.3)?;
    let landmarks = landmarks(&interior);
    let turns = turns(&interior, settings)?;
    stage("searching for the limbs", 0.5)?;
    let mut told = |name: &'static str, done: f64| progress(name, 0.5 + 0.4 * done);
    let found = search(template, &interior, &landmarks, &turns, &mut told)?;
    let placement = place(template, &interior, &landmarks, &found.best, settings.symmetric);
    let joints = &placement.joints;
    let outside = outside_of_bones(template, &interior, joints);
    let certainty = certainties(template, &landmarks, &found, joints, &outside);
    let doubts = doubts(template, &landmarks, &found, &outside, placement.made_alike);
    let turn = found.best.stance.turn;
    let in_mesh: Vec<DVec3> = joints.iter().map(|&joint| origin + size * joint).collect();
    let tail_turn = |way: DVec3| turn * (size * found.best.stance.scale * way);
    Ok(Fit {
        skeleton: skeleton(template, &in_mesh, tail_turn)?,
        certainty,
        doubts,
        up: turn.y_axis.to_array(),
        front: turn.z_axis.to_array(),
        misfit: found.best.misfit(&landmarks),
    })
}

/// The template's bones between these joints. A tail that is at no joint keeps its way from the head.
fn skeleton(template: &Template, joints: &[DVec3], in_mesh: impl Fn(DVec3) -> DVec3) -> Result<Skeleton, RigError> {
    const AT_A_JOINT: f64 = 0.35;
    let segments = template.skeleton.rest_segments();
    let bones = template.skeleton.bones().iter().enumerate().map(|(index, bone)| {
        let origin = bone.parent.map_or(DVec3::ZERO, |parent| joints[parent]);
        let rest = Transform { translation: (joints[index] - origin).as_vec3(), ..Transform::IDENTITY };
        let (head, tail) = (segments[index].0.as_dvec3(), segments[index].1.as_dvec3());
        let end = template.far_joint[index];
        let is_there = end != index && template.joints[end].at.distance(tail) <= AT_A_JOINT * head.distance(tail);
        let way = if is_there { joints[end] - joints[index] } else { in_mesh(tail - head) };
        Bone { name: bone.name.clone(), parent: bone.parent, rest, tail: way.as_vec3() }
    });
    Ok(Skeleton::new(bones.collect())?)
}
