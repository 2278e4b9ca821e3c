//! Weights of a mirrored mesh, made exact mirror images of each other.

use std::collections::BTreeMap;

use armature_geometry::{Influences, InfluencesError, TriangleMesh};
use armature_rig::Skeleton;

/// The weights of x ≥ 0 for both sides; on the middle itself the mean of both. Bones named `Left…` and `Right…` are
/// each other's images, all others their own. `mesh` is its own mirror image in x, bit for bit.
pub(super) fn mirror_weights(
    mesh: &TriangleMesh,
    skeleton: &Skeleton,
    influences: &Influences,
) -> Result<Influences, InfluencesError> {
    let image_of_bone: Vec<u16> = skeleton
        .bones()
        .iter()
        .enumerate()
        .map(|(b, bone)| {
            let image = other_side(&bone.name).and_then(|name| skeleton.find(&name));
            image.unwrap_or(b) as u16
        })
        .collect();
    let place = |[x, y, z]: [f64; 3]| [x, y, z].map(f64::to_bits);
    let vertex_at: BTreeMap<[u64; 3], usize> =
        mesh.vertices.iter().enumerate().map(|(vertex, &p)| (place(p), vertex)).collect();

    let slots = influences.per_vertex();
    let mut bones = Vec::with_capacity(influences.bones().len());
    let mut weights = Vec::with_capacity(influences.weights().len());
    for (vertex, &[x, y, z]) in mesh.vertices.iter().enumerate() {
        let mirrored = |v: usize| influences.of_vertex(v).map(|(bone, w)| (image_of_bone[usize::from(bone)], w));
        let mut row: Vec<(u16, f32)> = if x > 0.0 {
            influences.of_vertex(vertex).collect()
        } else if x < 0.0 {
            // A vertex without an image keeps its own weights.
            vertex_at
                .get(&place([-x, y, z]))
                .map_or_else(|| influences.of_vertex(vertex).collect(), |&v| mirrored(v).collect())
        } else {
            on_the_middle(influences.of_vertex(vertex), &image_of_bone, slots)
        };
        row.resize(slots, (0, 0.0));
        bones.extend(row.iter().map(|i| i.0));
        weights.extend(row.iter().map(|i| i.1));
    }
    Influences::new(slots, bones, weights, skeleton.len())
}

/// The mean of a row and its image: the heaviest bones that fit, keeping left-right pairs complete.
fn on_the_middle(row: impl Iterator<Item = (u16, f32)>, image_of_bone: &[u16], slots: usize) -> Vec<(u16, f32)> {
    let mut mean: BTreeMap<u16, f32> = BTreeMap::new();
    for (bone, weight) in row {
        *mean.entry(bone).or_default() += 0.5 * weight;
        *mean.entry(image_of_bone[usize::from(bone)]).or_default() += 0.5 * weight;
    }
    // Each pair once, by its smaller bone.
    let mut pairs: Vec<(u16, f32)> =
        mean.into_iter().filter(|(bone, _)| *bone <= image_of_bone[usize::from(*bone)]).collect();
    pairs.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut kept = Vec::with_capacity(slots);
    for (bone, weight) in pairs {
        let image = image_of_bone[usize::from(bone)];
        let needed = if image == bone { 1 } else { 2 };
        if kept.len() + needed <= slots {
            kept.push((bone, weight));
            if image != bone {
                kept.push((image, weight));
            }
        }
    }
    kept
}

fn other_side(name: &str) -> Option<String> {
    let right = name.strip_prefix("Left").map(|rest| format!("Right{rest}"));
    right.or_else(|| name.strip_prefix("Right").map(|rest| format!("Left{rest}")))
}
