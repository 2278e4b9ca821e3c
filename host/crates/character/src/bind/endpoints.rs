//! How far along its bones each vertex is (endpoint weights, thesis 6.2.3), from weights of the joints.

use std::collections::BTreeSet;

use armature_geometry::TriangleMesh;
use armature_weights::endpoints::{
    endpoint_weights_from_joints, endpoint_weights_of_influences, inverse_distance_weights, projected_endpoint_weights,
};
use armature_weights::heat::bone_heat;
use armature_weights::{BoneSegment, WeightMatrix};
use glam::DVec3;

use super::error::BindError;
use super::settings::{BindMethod, BindSettings};
use crate::character::{Character, Provenance, WeightsRecord};
use crate::handle_weights::{
    BiharmonicTier, HandlePlace, HandleShape, HandleWeightsSettings, Held, Partition, WeightMethod, handle_weights,
};
use crate::progress::Progress;
use crate::skin_kind::{EndpointMethod, Endpoints};

/// Bone ends within this part of the skeleton's size of one another are one joint.
const ONE_JOINT: f64 = 1e-6;
/// Most names listed in one sentence.
const MOST_NAMES: usize = 8;

/// Endpoint weights for a bound character, and what the user should know.
///
/// By default they are of the same kind as the bones' weights; for an artist's, bounded biharmonic. Bones with an end
/// that moves nothing, because it is away from the mesh, get the projection (thesis eq. 6.8) and are named.
pub fn endpoint_weights(
    character: &Character,
    settings: &BindSettings,
    progress: Progress<'_>,
) -> Result<(Endpoints, Vec<String>), BindError> {
    let method = settings.endpoints.unwrap_or(match character.provenance {
        Provenance::Computed(WeightsRecord::BoneHeat(_)) => EndpointMethod::BoneHeat,
        _ => EndpointMethod::Biharmonic,
    });
    let curves = settings.twist_curves.iter().map(|curve| {
        let missing = || BindError::NoSuchBone {
            name: curve.bone.clone(),
            names: character.skeleton.bones().iter().map(|bone| bone.name.clone()).take(MOST_NAMES).collect(),
        };
        Ok((character.skeleton.find(&curve.bone).ok_or_else(missing)?, &curve.curve))
    });
    let curves = curves.collect::<Result<Vec<_>, BindError>>()?;
    let positions = character.positions_in_rest_pose()?;
    let vertices: Vec<[f64; 3]> = positions.iter().map(|p| p.map(f64::from)).collect();
    let mesh = TriangleMesh { vertices, triangles: character.surface.mesh.triangles.clone() };
    let bones = character.rest_bone_segments();
    let joints = Joints::of(&bones);
    let mut warnings = Vec::new();
    let mut ends = match method {
        EndpointMethod::Projection => projected_endpoint_weights(&mesh.vertices, &bones),
        EndpointMethod::InverseDistance => joints.ends(&inverse_distance_weights(&mesh.vertices, &joints.places))?,
        EndpointMethod::BoneHeat => {
            let points: Vec<BoneSegment> =
                joints.places.iter().map(|&place| BoneSegment { head: place, tail: place }).collect();
            let heat = bone_heat(&mesh, &points, &settings.heat, &mut |_, done| {
                progress("finding how far along its bones each vertex is", done)
            })?;
            let cold = heat.report.cold_bones.clone();
            projected_where_idle(character, joints.ends(&heat.weights)?, &joints, &cold, &mesh, &bones, &mut warnings)?
        }
        EndpointMethod::Biharmonic => {
            let (weights, idle) = biharmonic_joints(&mesh, &joints, settings, progress)?;
            projected_where_idle(character, joints.ends(&weights)?, &joints, &idle, &mesh, &bones, &mut warnings)?
        }
    };
    for (bone, curve) in curves {
        curve.apply(&mut ends, bone);
    }
    let of_slots = endpoint_weights_of_influences(&ends, &character.surface.influences);
    let weights = of_slots.ok_or(BindError::Inconsistent { what: "endpoint weights" })?;
    Ok((Endpoints { method, weights }, warnings))
}

/// The places where bones begin and end, each once.
struct Joints {
    places: Vec<[f64; 3]>,
    /// For each bone, the joints at its head and tail.
    ends: Vec<[usize; 2]>,
}

impl Joints {
    fn of(bones: &[BoneSegment]) -> Self {
        let all = || bones.iter().flat_map(|bone| [bone.head, bone.tail]).map(DVec3::from);
        let low = all().fold(DVec3::INFINITY, DVec3::min);
        let high = all().fold(DVec3::NEG_INFINITY, DVec3::max);
        let near = ONE_JOINT * (high - low).length();
        let mut places: Vec<[f64; 3]> = Vec::new();
        let mut joint = |place: [f64; 3]| {
            let same = |known: &[f64; 3]| DVec3::from(*known).distance(place.into()) <= near;
            places.iter().position(same).unwrap_or_else(|| {
                places.push(place);
                places.len() - 1
            })
        };
        let ends = bones.iter().map(|bone| [joint(bone.head), joint(bone.tail)]).collect();
        Self { places, ends }
    }

    /// Thesis eq. 6.7.
    fn ends(&self, joints: &WeightMatrix) -> Result<WeightMatrix, BindError> {
        endpoint_weights_from_joints(joints, &self.ends).ok_or(BindError::Inconsistent { what: "endpoint weights" })
    }
}

/// Bounded biharmonic weights of the joints as points, and the joints that move nothing.
fn biharmonic_joints(
    mesh: &TriangleMesh,
    joints: &Joints,
    settings: &BindSettings,
    progress: Progress<'_>,
) -> Result<(WeightMatrix, Vec<usize>), BindError> {
    let shape = |(joint, &place): (usize, &[f64; 3])| HandleShape {
        name: format!("joint {}", joint + 1),
        place: HandlePlace::Point(place),
    };
    let shapes: Vec<HandleShape> = joints.places.iter().enumerate().map(shape).collect();
    let tier = match settings.method {
        BindMethod::Biharmonic(tier) => tier,
        BindMethod::Monotone { .. } | BindMethod::BoneHeat => BiharmonicTier::Interactive,
    };
    let how = HandleWeightsSettings {
        method: WeightMethod::BoundedBiharmonic,
        tier,
        on: settings.on,
        partition: Partition::Left,
        joint_release: 0.0,
    };
    let held = Held::Shapes { shapes: &shapes, cage: &[] };
    let made = handle_weights(mesh, None, held, &how, progress)?;
    Ok((made.weights, made.idle))
}

/// The projection in place of the weights of bones with an idle end, which are named.
fn projected_where_idle(
    character: &Character,
    ends: WeightMatrix,
    joints: &Joints,
    idle: &[usize],
    mesh: &TriangleMesh,
    bones: &[BoneSegment],
    warnings: &mut Vec<String>,
) -> Result<WeightMatrix, BindError> {
    let is_idle = |bone: &usize| joints.ends[*bone].iter().any(|end| idle.contains(end));
    let follows: BTreeSet<u16> = character.surface.influences.bones().iter().copied().collect();
    let lost: Vec<usize> = (0..bones.len()).filter(|bone| is_idle(bone) && follows.contains(&(*bone as u16))).collect();
    if lost.is_empty() {
        return Ok(ends);
    }
    let named: Vec<&str> =
        lost.iter().take(MOST_NAMES).map(|&bone| character.skeleton.bones()[bone].name.as_str()).collect();
    let more = lost.len().saturating_sub(MOST_NAMES);
    let and_more = if more > 0 { format!(" and {more} more") } else { String::new() };
    warnings.push(format!(
        "an end of these bones is away from the mesh, so how far along them a vertex is was found by projection: {}{and_more}",
        named.join(", ")
    ));
    let chosen: Vec<BoneSegment> = lost.iter().map(|&bone| bones[bone]).collect();
    let projected = projected_endpoint_weights(&mesh.vertices, &chosen);
    let column = |bone: usize| match lost.binary_search(&bone) {
        Ok(at) => projected.bone(at),
        Err(_) => ends.bone(bone),
    };
    let columns: Vec<f64> = (0..bones.len()).flat_map(column).collect();
    let inconsistent = BindError::Inconsistent { what: "endpoint weights" };
    WeightMatrix::from_columns(mesh.vertices.len(), bones.len(), &columns).ok_or(inconsistent)
}
