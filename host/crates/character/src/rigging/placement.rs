//! From an embedding to a place for every joint.

use glam::DVec3;

use super::chains::joints_along;
use super::interior::{Interior, Measure};
use super::landmarks::Landmarks;
use super::search::Embedding;
use super::template::{Chain, Template};

/// Sides that differ by less than this share of the longest way are made alike.
const NEARLY_ALIKE: f64 = 0.06;
/// Meshes that are less symmetric than this have no plane to be alike about.
const SYMMETRIC: f64 = 0.75;

/// A place for each joint of the template.
pub(super) struct Placement {
    pub(super) joints: Vec<DVec3>,
    /// Whether the sides were made alike.
    pub(super) made_alike: bool,
}

/// Places them.
pub(super) fn place(
    template: &Template,
    interior: &Interior,
    landmarks: &Landmarks,
    embedding: &Embedding,
    symmetric: bool,
) -> Placement {
    let mut joints = vec![DVec3::ZERO; template.joints.len()];
    let ways: Vec<_> = embedding.hubs.iter().map(|&hub| interior.ways(hub, Measure::Centred)).collect();
    let lengths = |chain: &Chain| -> Vec<f64> {
        let at = |joint: usize| template.joints[joint].at;
        chain.joints.windows(2).map(|pair| at(pair[0]).distance(at(pair[1]))).collect()
    };
    let mut along = |chain: &Chain, way: &[usize], end: Option<DVec3>| {
        let path: Vec<DVec3> = way.iter().map(|&p| interior.points[p]).chain(end).collect();
        // An end has the radius of the point before it.
        let radii: Vec<f64> = way.iter().chain(way.last()).map(|&p| interior.depth[p]).collect();
        for (&joint, at) in chain.joints.iter().zip(joints_along(&path, &radii[..path.len()], &lengths(chain))) {
            joints[joint] = at;
        }
    };
    for (hub, at) in template.hubs.iter().zip(&embedding.hubs) {
        if let Some((before, chain)) = &hub.before {
            along(chain, &ways[*before].way_to(*at), None);
        }
    }
    for (limb, end) in template.limbs.iter().zip(&embedding.ends) {
        if let Some(end) = end.map(|end| &landmarks.ends[end]) {
            along(&limb.chain, &ways[limb.hub].way_to(interior.nearest(end.at)), Some(end.at));
        }
    }
    for (hub, &at) in template.hubs.iter().zip(&embedding.hubs) {
        joints[hub.joint] = interior.points[at];
    }
    beside_hubs(template, interior, embedding, &mut joints);
    for (limb, _) in template.limbs.iter().zip(&embedding.ends).filter(|(_, end)| end.is_none()) {
        let hub = template.hubs[limb.hub].joint;
        for &joint in limb.chain.joints.iter().skip(1) {
            let way = template.joints[joint].at - template.joints[hub].at;
            let way = embedding.stance.turn * (embedding.stance.scale * way);
            joints[joint] = still_inside(interior, joints[hub], way);
        }
    }
    let made_alike = symmetric && template.is_symmetric() && embedding.stance.symmetry >= SYMMETRIC;
    if made_alike {
        make_alike(template, interior, landmarks.diameter, embedding, &mut joints);
    }
    Placement { joints, made_alike }
}

/// Hips and shoulders are beside the trunk's bones, where no limb leads: halfway between the way of the limb and the
/// template's place.
fn beside_hubs(template: &Template, interior: &Interior, embedding: &Embedding, joints: &mut [DVec3]) {
    let found = template.limbs.iter().zip(&embedding.ends).filter(|(_, end)| end.is_some());
    for (limb, _) in found.filter(|(limb, _)| limb.chain.joints.len() > 2) {
        let (hub, first) = (limb.chain.joints[0], limb.chain.joints[1]);
        let segment = template.skeleton.rest_segments().get(hub).copied();
        let is_bone = segment
            .is_some_and(|(_, tail)| template.joints[first].at.distance(tail.as_dvec3()) < 0.05 * limb.chain.length);
        let way = template.joints[first].at - template.joints[hub].at;
        let wanted = joints[hub] + embedding.stance.turn * (embedding.stance.scale * way);
        let between = 0.5 * (joints[first] + wanted);
        if !is_bone && interior.at(between).is_some() {
            joints[first] = between;
        }
    }
}

/// As far along `way` as the mesh reaches.
fn still_inside(interior: &Interior, from: DVec3, way: DVec3) -> DVec3 {
    const STEPS: usize = 40;
    let at = |k: usize| from + way * (k as f64 / STEPS as f64);
    let farthest = (1..=STEPS).take_while(|&k| interior.at(at(k)).is_some()).last();
    // A joint apart from its parent keeps a direction for its bone.
    at(farthest.unwrap_or(1))
}

fn make_alike(template: &Template, interior: &Interior, diameter: f64, embedding: &Embedding, joints: &mut [DVec3]) {
    let (on, normal) = (interior.centroid(), embedding.stance.turn.x_axis);
    let image = |p: DVec3| p - 2.0 * (p - on).dot(normal) * normal;
    for own in 0..joints.len() {
        let Some(other) = template.joints[own].mirror.filter(|&other| other >= own) else { continue };
        let (a, b) = (joints[own], joints[other]);
        let between = 0.5 * (a + image(b));
        let is_inside = interior.at(between).is_some() && interior.at(image(between)).is_some();
        if is_inside && a.distance(image(b)) <= NEARLY_ALIKE * diameter {
            joints[own] = between;
            joints[other] = image(between);
        }
    }
}
