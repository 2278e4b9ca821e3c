//! The weights of every bone of a skeleton, by either method, made sparse.

use armature_formats::skeleton::POINT_PREFIX;
use armature_geometry::{Influences, MeshError, TriangleMesh};
use armature_rig::Skeleton;
use armature_weights::BoneSegment;
use armature_weights::finish::{Sparsification, sparsify};
use armature_weights::heat::{BoneHeat, bone_heat};
use glam::{DVec3, Vec3};

use super::error::BindError;
use super::misfit::Misfit;
use super::settings::{BindMethod, BindSettings};
use crate::character::{HeatRecord, MonotoneRecord, SolvedRecord, WeightsRecord};
use crate::handle_weights::{
    BiharmonicTier, HandlePlace, HandleShape, HandleWeightsSettings, Held, Partition, SpuriousExtrema, WeightMethod,
    handle_weights,
};
use crate::progress::Progress;

/// Dropping more than this fraction of a vertex's weight is worth a warning.
const MUCH_DROPPED: f64 = 0.05;
/// More influences are not proposed: engines take no more.
const PROPOSED_INFLUENCES: usize = 8;
/// A point further outside the mesh's box than this share of its diagonal is no handle.
const POINT_MARGIN: f64 = 0.1;
/// Most names listed in one sentence.
const MOST_NAMES: usize = 8;

/// A further segment, in model space, that counts as part of a bone when weights are computed: ribs keep a broad chest
/// with its spine.
pub(crate) type Rib = (u16, [DVec3; 2]);

/// Weights of all bones.
pub(crate) struct BoneWeights {
    pub(crate) influences: Influences,
    pub(crate) record: WeightsRecord,
    /// What the user should know, in sentences.
    pub(crate) warnings: Vec<String>,
}

/// Weights for every bone with a length, as sparse as requested; how well it went; and what the user should know.
pub(crate) fn bone_weights(
    mesh: &TriangleMesh,
    skeleton: &Skeleton,
    ribs: &[Rib],
    settings: &BindSettings,
    progress: Progress<'_>,
) -> Result<BoneWeights, BindError> {
    let bones = LongBones::find(mesh, skeleton, ribs, settings.method)?;
    let (mut weights, sparse) = match settings.method {
        BindMethod::BoneHeat => heat_weights(mesh, &bones, settings, progress)?,
        BindMethod::Biharmonic(tier) => smooth_weights(mesh, &bones, tier, None, settings, progress)?,
        BindMethod::Monotone { order } => {
            smooth_weights(mesh, &bones, BiharmonicTier::Interactive, Some(order), settings, progress)?
        }
    };
    if sparse.max_dropped > MUCH_DROPPED {
        let more = if settings.max_influences < PROPOSED_INFLUENCES { "; 8 would keep more" } else { "" };
        weights.warnings.push(format!(
            "keeping {} influences per vertex dropped up to {:.0} % of a vertex's weight, {:.1} % on average{more}",
            settings.max_influences,
            100.0 * sparse.max_dropped,
            100.0 * sparse.mean_dropped
        ));
    }
    Ok(weights)
}

/// The bones that have a length, with all their segments, and points: roots without length that carry no other bone and are called so.
struct LongBones<'a> {
    skeleton: &'a Skeleton,
    /// Zero-based bones, ascending.
    bones: Vec<u16>,
    /// For each of them, its own segment.
    segments: Vec<[DVec3; 2]>,
    ribs: &'a [Rib],
    warnings: Vec<String>,
}

impl<'a> LongBones<'a> {
    fn find(
        mesh: &TriangleMesh,
        skeleton: &'a Skeleton,
        ribs: &'a [Rib],
        method: BindMethod,
    ) -> Result<Self, BindError> {
        let segments = skeleton.rest_segments();
        let is_long = |bone: &usize| skeleton.bones()[*bone].tail.length_squared() > 0.0;
        let long: Vec<usize> = (0..segments.len()).filter(is_long).collect();
        if skeleton.is_empty() {
            return Err(BindError::NoSkeleton);
        }
        if long.is_empty() {
            return Err(BindError::NoBoneWithLength { bones: skeleton.len() });
        }
        let long_segments: Vec<_> = long.iter().map(|&bone| segments[bone]).collect();
        let box_of_mesh = mesh.bounds().ok_or(BindError::Mesh(MeshError::Empty))?;
        let outside = Misfit::check(box_of_mesh, &long_segments).map_err(BindError::Misfit)?;
        let mut warnings = Vec::new();
        // A point away from the mesh, such as a mark on the floor, moves nothing.
        let (low, high) = (DVec3::from(box_of_mesh.0), DVec3::from(box_of_mesh.1));
        let margin = POINT_MARGIN * (high - low).length();
        let is_near = |point: DVec3| point.cmpge(low - margin).all() && point.cmple(high + margin).all();
        let is_point = |bone: &usize| {
            let root = &skeleton.bones()[*bone];
            root.parent.is_none()
                && root.tail == Vec3::ZERO
                && root.name.starts_with(POINT_PREFIX)
                && skeleton.bones().iter().all(|other| other.parent != Some(*bone))
                && is_near(segments[*bone].0.as_dvec3())
                && !matches!(method, BindMethod::BoneHeat)
        };
        if outside > 0 {
            warnings.push(format!("{outside} of {} bones are outside the mesh's bounding box", long.len()));
        }
        // A hub exists to carry other bones; one that carries none was meant to be a bone.
        let carries = |bone: usize| skeleton.bones().iter().any(|other| other.parent == Some(bone));
        let short: Vec<&str> = (0..segments.len())
            .filter(|bone| !is_long(bone) && !carries(*bone) && !is_point(bone))
            .map(|bone| skeleton.bones()[bone].name.as_str())
            .collect();
        if !short.is_empty() {
            let named = short[..short.len().min(MOST_NAMES)].join(", ");
            let more = short.len().saturating_sub(MOST_NAMES);
            let and_more = if more > 0 { format!(" and {more} more") } else { String::new() };
            warnings.push(format!("these bones have no length, so they move nothing: {named}{and_more}"));
        }
        let held: Vec<usize> = (0..segments.len()).filter(|bone| is_long(bone) || is_point(bone)).collect();
        let ends = |&bone: &usize| [segments[bone].0, segments[bone].1].map(glam::Vec3::as_dvec3);
        Ok(Self {
            skeleton,
            segments: held.iter().map(ends).collect(),
            bones: held.into_iter().map(|bone| bone as u16).collect(),
            ribs,
            warnings,
        })
    }

    fn name(&self, bone: u16) -> &str {
        &self.skeleton.bones()[usize::from(bone)].name
    }
}

/// Bounded biharmonic weights, or monotone ones of this order.
fn smooth_weights(
    mesh: &TriangleMesh,
    bones: &LongBones<'_>,
    tier: BiharmonicTier,
    monotone: Option<u8>,
    settings: &BindSettings,
    progress: Progress<'_>,
) -> Result<(BoneWeights, Sparsification), BindError> {
    let shape = |(&bone, segment): (&u16, &[DVec3; 2])| {
        if segment[0] == segment[1] {
            let place = HandlePlace::Point(segment[0].to_array());
            return HandleShape { name: bones.name(bone).to_owned(), place };
        }
        let own = bones.ribs.iter().filter(|rib| rib.0 == bone).map(|rib| rib.1);
        let all = [*segment].into_iter().chain(own).map(|ends| ends.map(|p| p.to_array()));
        HandleShape { name: bones.name(bone).to_owned(), place: HandlePlace::Segments(all.collect()) }
    };
    let shapes: Vec<HandleShape> = bones.bones.iter().zip(&bones.segments).map(shape).collect();
    let method = match monotone {
        None => WeightMethod::BoundedBiharmonic,
        Some(order) => WeightMethod::Monotone { order: usize::from(order) },
    };
    let how = HandleWeightsSettings {
        method,
        tier,
        on: settings.on,
        partition: Partition::Normalised,
        joint_release: settings.joint_release,
    };
    let held = Held::Shapes { shapes: &shapes, cage: &[] };
    let mut told = |stage: &'static str, done: f64| progress(stage, 0.02 + 0.92 * done.clamp(0.0, 1.0));
    let made = handle_weights(mesh, None, held, &how, &mut told)?;
    let (influences, sparse) = sparsify(&made.weights, settings.max_influences, &bones.bones, bones.skeleton.len())?;
    let solved = SolvedRecord {
        tier,
        domain: made.domain,
        domain_vertices: made.domain_vertices,
        joint_release: settings.joint_release,
        flat_elements: Some(made.flat_elements),
        error_bound: made.error_bound(),
        energy: made.energy(),
        unconverged: made.unconverged(),
        largest_deviation: made.normalisation.as_ref().map_or(0.0, |n| n.largest_deviation),
        max_influences: settings.max_influences,
        max_dropped: sparse.max_dropped,
        mean_dropped: sparse.mean_dropped,
    };
    let record = match monotone {
        None => WeightsRecord::Biharmonic(solved),
        Some(order) => {
            let spurious = SpuriousExtrema::total(made.spurious.last()).0;
            WeightsRecord::Monotone(MonotoneRecord { order, spurious, solved })
        }
    };
    let warnings = bones.warnings.iter().cloned().chain(made.warnings).collect();
    Ok((BoneWeights { influences, record, warnings }, sparse))
}

fn heat_weights(
    mesh: &TriangleMesh,
    bones: &LongBones<'_>,
    settings: &BindSettings,
    progress: Progress<'_>,
) -> Result<(BoneWeights, Sparsification), BindError> {
    let segments: Vec<BoneSegment> = bones
        .segments
        .iter()
        .copied()
        .chain(bones.ribs.iter().map(|rib| rib.1))
        .map(|[head, tail]| BoneSegment { head: head.to_array(), tail: tail.to_array() })
        .collect();
    let columns: Vec<u16> = bones.bones.iter().copied().chain(bones.ribs.iter().map(|rib| rib.0)).collect();
    let heat = bone_heat(mesh, &segments, &settings.heat, &mut |stage, done| progress(stage, 0.02 + 0.92 * done))?;
    let (influences, sparse) = sparsify(&heat.weights, settings.max_influences, &columns, bones.skeleton.len())?;
    let record = HeatRecord {
        heat: settings.heat.heat,
        max_influences: settings.max_influences,
        residual: heat.residual,
        max_dropped: sparse.max_dropped,
    };
    let mut warnings = heat_warnings(&heat, bones, &columns);
    warnings.extend(bones.warnings.iter().cloned());
    Ok((BoneWeights { influences, record: WeightsRecord::BoneHeat(record), warnings }, sparse))
}

fn heat_warnings(heat: &BoneHeat, bones: &LongBones<'_>, columns: &[u16]) -> Vec<String> {
    let report = &heat.report;
    let mut warnings = Vec::new();
    if !report.cold_bones.is_empty() {
        let name = |&column: &usize| columns.get(column).map(|&bone| bones.name(bone));
        let names: Vec<&str> = report.cold_bones.iter().filter_map(name).collect();
        warnings.push(format!("these bones move no part of the mesh: {}", names.join(", ")));
    }
    let mut count = |number: usize, text: &str| {
        if number > 0 {
            warnings.push(format!("{number} {text}"));
        }
    };
    count(report.blind_components.len(), "pieces of the mesh see no bone and follow their nearest ones");
    count(report.isolated_vertices, "vertices are in no face with an area and follow their nearest bones");
    count(report.collapsed_triangles, "triangles have two corners at one place and were ignored");
    count(report.duplicate_triangles, "triangles are duplicates and were ignored");
    warnings
}
