//! How sure each bone is, and what cannot be told.

use std::fmt;

use glam::DVec3;

use super::interior::Interior;
use super::landmarks::Landmarks;
use super::search::{Embedding, Found};
use super::template::Template;

/// What is doubtful about a fitted skeleton, in words by [`fmt::Display`].
#[derive(Clone, Debug, PartialEq)]
pub enum Doubt {
    /// A limb of the template was not found in the mesh.
    NoLimb {
        /// The limb's first bone.
        bone: String,
    },
    /// A bone leaves the mesh.
    Outside {
        /// The bone.
        bone: String,
        /// The share of it that is outside.
        share: f64,
    },
    /// Looking the other way fits nearly as well, and left and right change with it.
    FrontUnclear,
    /// Standing another way fits nearly as well.
    UpUnclear,
    /// The template fits badly as a whole.
    OtherFigure,
    /// Limbs of the mesh that no bone is in.
    LimbsLeft {
        /// How many.
        count: usize,
    },
    /// The sides were not made alike: the mesh is not symmetric.
    NotSymmetric,
    /// A hand has no other side.
    LeftOrRightHand,
    /// The search stopped at its limit before all was compared.
    SearchLimit,
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoLimb { bone } => write!(
                f,
                "no limb of the mesh was found for {bone} (one that lies on the body cannot be told from it), so its bones were \
                 placed by the template's proportions alone"
            ),
            Self::Outside { bone, share } => {
                write!(f, "{:.0} % of {bone} is outside the mesh", 100.0 * share)
            }
            Self::FrontUnclear => f.write_str(
                "front and back cannot be told apart by the shape, and left and right change with them; say which way it \
                 looks",
            ),
            Self::UpUnclear => f.write_str("it could stand another way as well; say which way is up"),
            Self::OtherFigure => f.write_str("the template fits badly; the mesh may be another kind of figure"),
            Self::LimbsLeft { count: 1 } => f.write_str("one limb of the mesh has no bones"),
            Self::LimbsLeft { count } => write!(f, "{count} limbs of the mesh have no bones"),
            Self::NotSymmetric => f.write_str("the mesh is not symmetric, so left and right were placed each on its own"),
            Self::LeftOrRightHand => {
                f.write_str("whether it is a left or a right hand cannot be told by the shape; the bones are named as a left hand's")
            }
            Self::SearchLimit => f.write_str("the search stopped at its limit; there may be a better place for some limb"),
        }
    }
}

/// Costs that differ by less than this are as good as equal.
const UNCLEAR: f64 = 0.06;
/// Cosine of the angle between directions that are not the same.
const CLEAR: f64 = 0.7;
/// Cost of each limb from which on the template is for another figure.
const BAD_FIT: f64 = 0.3;
/// Limbs that stick out by this share of the longest way are expected to have bones.
const LIMB: f64 = 0.12;
/// Deviation of a bone's length from the template's, as a logarithm, that is nothing unusual.
const USUAL_DEVIATION: f64 = 0.45;

/// The share of each bone that is outside.
pub(super) fn outside_of_bones(template: &Template, interior: &Interior, joints: &[DVec3]) -> Vec<f64> {
    let share = |bone| outside(interior, joints[bone], joints[template.far_joint[bone]]);
    (0..template.skeleton.len()).map(share).collect()
}

/// How sure each bone is, 0 to 1.
pub(super) fn certainties(
    template: &Template,
    landmarks: &Landmarks,
    found: &Found,
    joints: &[DVec3],
    outside: &[f64],
) -> Vec<f64> {
    let best = &found.best;
    let whole = 1.0 / (1.0 + (misfit(template, landmarks, best) / BAD_FIT).powi(2));
    let mut of_joint = vec![whole; joints.len()];
    for (limb, end) in template.limbs.iter().zip(&best.ends) {
        let found = end.map_or(0.05, |end| {
            let own = &landmarks.ends[end];
            let hub = best.hubs[limb.hub];
            let apart = best.ends.iter().flatten().filter(|&&other| other != end).map(|&other| {
                let other = &landmarks.ends[other];
                0.5 * (own.ways.length[hub] + own.ways.length[other.point] - other.ways.length[hub])
            });
            let wanted = 0.4 * own.ways.length[hub];
            (apart.fold(own.ways.length[hub], f64::min) / wanted.max(f64::MIN_POSITIVE)).clamp(0.1, 1.0)
        });
        limb.chain.joints.iter().skip(1).for_each(|&joint| of_joint[joint] *= found);
    }
    (0..template.skeleton.len())
        .map(|bone| {
            let end = template.far_joint[bone];
            let wanted = best.stance.scale * template.joints[end].at.distance(template.joints[bone].at);
            let length = joints[bone].distance(joints[end]);
            let of_limb = template.limbs.iter().find(|limb| limb.chain.joints.iter().skip(1).any(|&j| j == end));
            let weight = of_limb.map_or(1.0, |limb| limb.manner.length);
            let ratio = if wanted > 0.0 { (length.max(1e-9) / wanted).ln() / USUAL_DEVIATION } else { 0.0 };
            let inside = 1.0 - outside[bone];
            // The bone's far joint decides: an upper arm is as sure as the elbow.
            let sure = of_joint[end].min(of_joint[bone].max(0.05));
            (sure * inside * inside * (-0.5 * weight * ratio * ratio).exp()).clamp(0.0, 1.0)
        })
        .collect()
}

/// What cannot be told.
pub(super) fn doubts(
    template: &Template,
    landmarks: &Landmarks,
    found: &Found,
    outside: &[f64],
    made_alike: bool,
) -> Vec<Doubt> {
    let best = &found.best;
    let mut doubts = Vec::new();
    if misfit(template, landmarks, best) > BAD_FIT {
        doubts.push(Doubt::OtherFigure);
    }
    let name = |joint: usize| {
        let bone = if joint < template.skeleton.len() { Some(joint) } else { template.joints[joint].parent };
        bone.map_or_else(String::new, |bone| template.skeleton.bones()[bone].name.clone())
    };
    for other in found.others.iter().filter(|other| other.cost - best.cost < UNCLEAR) {
        let (a, b) = (&best.stance.turn, &other.stance.turn);
        let doubt = match (a.y_axis.dot(b.y_axis) > CLEAR, a.z_axis.dot(b.z_axis) > CLEAR) {
            (true, true) => continue,
            (true, false) => Doubt::FrontUnclear,
            (false, _) => Doubt::UpUnclear,
        };
        if !doubts.contains(&doubt) {
            doubts.push(doubt);
        }
    }
    for (limb, _) in template.limbs.iter().zip(&best.ends).filter(|(_, end)| end.is_none()) {
        doubts.push(Doubt::NoLimb { bone: name(limb.chain.joints[1]) });
    }
    for (bone, &share) in outside.iter().enumerate().filter(|(_, share)| **share > 0.1) {
        doubts.push(Doubt::Outside { bone: name(bone), share });
    }
    let left = landmarks
        .ends
        .iter()
        .enumerate()
        .filter(|(at, end)| end.persistence > LIMB * landmarks.diameter && !best.ends.contains(&Some(*at)));
    let count = left.count();
    if count > 0 {
        doubts.push(Doubt::LimbsLeft { count });
    }
    if template.is_symmetric() && !made_alike {
        doubts.push(Doubt::NotSymmetric);
    }
    if template.is_hand {
        doubts.push(Doubt::LeftOrRightHand);
    }
    if found.limit_reached {
        doubts.push(Doubt::SearchLimit);
    }
    doubts
}

/// How badly the template fits, for each limb.
fn misfit(template: &Template, landmarks: &Landmarks, best: &Embedding) -> f64 {
    best.misfit(landmarks) / template.limbs.len().max(1) as f64
}

/// The share of a segment that is outside.
fn outside(interior: &Interior, from: DVec3, to: DVec3) -> f64 {
    const SAMPLES: usize = 21;
    let is_outside = |k: &usize| {
        let at = from.lerp(to, *k as f64 / (SAMPLES - 1) as f64);
        // The grid ends up to one step inside the skin.
        interior.at(at).is_none() && interior.points[interior.nearest(at)].distance(at) > 1.5 * interior.step
    };
    (0..SAMPLES).filter(is_outside).count() as f64 / SAMPLES as f64
}
