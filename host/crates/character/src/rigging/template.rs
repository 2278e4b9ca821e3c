//! The skeleton that is fitted, and what of it the search needs: where limbs meet, where they end, and the chains of
//! bones between.

use armature_rig::{Figure, HumanoidPart, Skeleton, recognise};
use glam::{DVec3, Vec3};

use super::error::RigError;

/// Limbs that the search can place.
pub(super) const MOST_LIMBS: usize = 12;

/// A skeleton to be fitted into meshes.
#[derive(Clone, Debug)]
pub struct Template {
    pub(super) skeleton: Skeleton,
    pub(super) figure: Figure,
    /// Whether it is a hand without a body.
    pub(super) is_hand: bool,
    /// The bones' heads in their order, then the tails of bones without children.
    pub(super) joints: Vec<Joint>,
    /// The joint at each bone's far end: that of its tail, or the nearest child's; the bone's own where there is none.
    pub(super) far_joint: Vec<usize>,
    /// Joints where chains meet; each comes after the one nearer to the first.
    pub(super) hubs: Vec<Hub>,
    pub(super) limbs: Vec<Limb>,
}

/// A place of the skeleton.
#[derive(Clone, Copy, Debug)]
pub(super) struct Joint {
    pub(super) at: DVec3,
    pub(super) parent: Option<usize>,
    /// Its mirror image in x; itself for a joint of the middle.
    pub(super) mirror: Option<usize>,
}

/// Where chains meet.
#[derive(Clone, Debug)]
pub(super) struct Hub {
    pub(super) joint: usize,
    /// The hub before it, and the chain from there.
    pub(super) before: Option<(usize, Chain)>,
}

/// A chain from a hub to an end.
#[derive(Clone, Debug)]
pub(super) struct Limb {
    pub(super) hub: usize,
    pub(super) chain: Chain,
    /// Its mirror image among the limbs; itself for one of the middle.
    pub(super) mirror: Option<usize>,
    /// Whether it stands on the ground in the template.
    pub(super) is_foot: bool,
    /// How telling it is.
    pub(super) manner: Manner,
}

/// How telling a limb is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Manner {
    /// Its direction: arms point anywhere, legs down.
    pub(super) aim: f64,
    /// Its length: tails have any.
    pub(super) length: f64,
    /// What its absence costs.
    pub(super) absence: f64,
}

/// Joints from one hub to another or to an end, both included.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub(super) joints: Vec<usize>,
    pub(super) length: f64,
    /// From the first joint to the last.
    pub(super) way: DVec3,
    /// Direction of the last bone.
    pub(super) last: DVec3,
}

impl Template {
    /// Any skeleton in its rest pose (+Y up, looking along +Z, in any unit) as a template.
    pub fn new(skeleton: Skeleton) -> Result<Self, RigError> {
        let joint = |(at, parent): (Vec3, Option<usize>)| Joint { at: at.as_dvec3(), parent, mirror: None };
        let joints: Vec<Joint> = skeleton.rest_joints().into_iter().map(joint).collect();
        let size = joints.iter().flat_map(|a| joints.iter().map(|b| a.at.distance(b.at))).fold(0.0, f64::max);
        if size <= 0.0 {
            return Err(RigError::NoBones);
        }
        let recognition = recognise(&skeleton);
        let has = |is: fn(HumanoidPart) -> bool| recognition.bones.iter().flatten().any(|found| is(found.bone.part));
        let is_hand =
            has(|part| matches!(part, HumanoidPart::Finger(..))) && !has(|part| part == HumanoidPart::UpperArm);
        let figure = recognition.figure;
        let joints = mirrored(joints, size);
        let far_joint = far_joints(&skeleton, &joints);
        let mut template = Self { joints, far_joint, skeleton, figure, is_hand, hubs: Vec::new(), limbs: Vec::new() };
        template.find_chains();
        if template.limbs.len() > MOST_LIMBS {
            return Err(RigError::TooManyLimbs { limbs: template.limbs.len(), most: MOST_LIMBS });
        }
        Ok(template)
    }

    /// The bones that are fitted.
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// What it is.
    pub fn figure(&self) -> Figure {
        self.figure
    }

    /// Whether it has two sides.
    pub(super) fn is_symmetric(&self) -> bool {
        self.limbs.iter().enumerate().any(|(own, limb)| limb.mirror.is_some_and(|other| other != own))
    }

    fn find_chains(&mut self) {
        let neighbours: Vec<Vec<usize>> = (0..self.joints.len()).map(|joint| self.neighbours(joint)).collect();
        // A root in the middle of a body is a hub although only two chains leave it.
        let is_root = |joint: usize| self.joints[joint].parent.is_none();
        let is_hub = |joint: usize| neighbours[joint].len() > 2 || is_root(joint) && neighbours[joint].len() == 2;
        let first = (0..self.joints.len()).find(|&joint| is_hub(joint)).unwrap_or_else(|| {
            // A single chain is hung up in its middle, if it has one.
            let inner = (0..self.joints.len()).filter(|&joint| neighbours[joint].len() == 2);
            let inner: Vec<usize> = inner.collect();
            inner.get(inner.len() / 2).copied().unwrap_or_default()
        });
        let recognition = recognise(&self.skeleton);
        let mut hubs = vec![Hub { joint: first, before: None }];
        let mut at = 0;
        while at < hubs.len() {
            let hub = hubs[at].joint;
            for &next in &neighbours[hub] {
                let came = hubs[at].before.as_ref().and_then(|(_, chain)| chain.joints.iter().rev().nth(1).copied());
                if came == Some(next) {
                    continue;
                }
                let mut joints = vec![hub, next];
                while let [.., before, last] = joints[..]
                    && !is_hub(last)
                    && let Some(&onward) = neighbours[last].iter().find(|&&joint| joint != before)
                {
                    joints.push(onward);
                }
                let last = joints.last().copied().unwrap_or(hub);
                let chain = self.chain(joints);
                if is_hub(last) {
                    hubs.push(Hub { joint: last, before: Some((at, chain)) });
                } else {
                    let part = |&joint: &usize| recognition.bones.get(joint).copied().flatten().map(|b| b.bone.part);
                    let parts: Vec<HumanoidPart> = chain.joints.iter().filter_map(part).collect();
                    let manner = manner(self.figure, &parts);
                    let is_foot = self.is_foot(last);
                    self.limbs.push(Limb { hub: at, chain, mirror: None, is_foot, manner });
                }
            }
            at += 1;
        }
        self.hubs = hubs;
        let end = |limb: &Limb| limb.chain.joints.last().copied();
        let mirror = |limb: &Limb| {
            let image = end(limb).and_then(|joint| self.joints[joint].mirror);
            self.limbs.iter().position(|other| image.is_some() && end(other) == image)
        };
        let mirrors: Vec<Option<usize>> = self.limbs.iter().map(mirror).collect();
        self.limbs.iter_mut().zip(mirrors).for_each(|(limb, mirror)| limb.mirror = mirror);
    }

    /// Legs end at the lowest height of the template; so does a hand's arm and whatever else it stands on.
    fn is_foot(&self, joint: usize) -> bool {
        const NEAR_GROUND: f64 = 0.06;
        let heights = || self.joints.iter().map(|joint| joint.at.y);
        let (low, high) = (heights().fold(f64::INFINITY, f64::min), heights().fold(f64::NEG_INFINITY, f64::max));
        self.joints[joint].at.y <= low + NEAR_GROUND * (high - low)
    }

    fn neighbours(&self, joint: usize) -> Vec<usize> {
        let below = (0..self.joints.len()).filter(|&other| self.joints[other].parent == Some(joint));
        self.joints[joint].parent.into_iter().chain(below).collect()
    }

    fn chain(&self, joints: Vec<usize>) -> Chain {
        let at = |k: usize| self.joints[joints[k]].at;
        let last = joints.len() - 1;
        let length = (0..last).map(|k| at(k).distance(at(k + 1))).sum();
        let way = at(last) - at(0);
        // A last bone without length points where the one before it does.
        let bones = (0..last).rev().map(|k| (at(k + 1) - at(k)).normalize_or_zero());
        let tip = bones.into_iter().find(|way| *way != DVec3::ZERO).unwrap_or_default();
        Chain { length, way, last: tip, joints }
    }
}

/// How telling a limb is, by what is recognised in it.
fn manner(figure: Figure, parts: &[HumanoidPart]) -> Manner {
    const SURE: Manner = Manner { aim: 1.0, length: 1.0, absence: 0.8 };
    const ARM: Manner = Manner { aim: 0.35, length: 1.0, absence: 0.8 };
    const TAIL: Manner = Manner { aim: 0.5, length: 0.15, absence: 0.3 };
    const ANY: Manner = Manner { aim: 0.5, length: 1.0, absence: 0.8 };
    let is_arm = |part: &HumanoidPart| matches!(part, HumanoidPart::LowerArm | HumanoidPart::Hand);
    match figure {
        Figure::Human if parts.iter().any(is_arm) => ARM,
        // The chain of a tail begins at the hips and has no other part of a body.
        Figure::Human | Figure::Quadruped if parts.iter().all(|part| *part == HumanoidPart::Hips) => TAIL,
        Figure::Other => ANY,
        _ => SURE,
    }
}

fn far_joints(skeleton: &Skeleton, joints: &[Joint]) -> Vec<usize> {
    let far = |(bone, (_, tail)): (usize, &(Vec3, Vec3))| {
        let below = (0..joints.len()).filter(|&joint| joints[joint].parent == Some(bone));
        let away = |joint: usize| joints[joint].at.distance_squared(tail.as_dvec3());
        below.min_by(|&a, &b| away(a).total_cmp(&away(b))).unwrap_or(bone)
    };
    skeleton.rest_segments().iter().enumerate().map(far).collect()
}

/// Finds each joint's mirror image.
fn mirrored(mut joints: Vec<Joint>, size: f64) -> Vec<Joint> {
    const NEAR: f64 = 0.02;
    const MOSTLY: f64 = 0.75;
    let middle = joints.iter().map(|joint| joint.at.x).sum::<f64>() / joints.len() as f64;
    let image = |p: DVec3| DVec3::new(2.0 * middle - p.x, p.y, p.z);
    let mirrors: Vec<Option<usize>> = joints
        .iter()
        .enumerate()
        .map(|(own, joint)| {
            if (joint.at.x - middle).abs() <= 0.25 * NEAR * size {
                return Some(own);
            }
            let away = |other: usize| joints[other].at.distance(image(joint.at));
            let nearest = (0..joints.len()).filter(|&other| other != own).min_by(|&a, &b| away(a).total_cmp(&away(b)));
            nearest.filter(|&other| away(other) <= NEAR * size)
        })
        .collect();
    // Two joints that have the same image have none.
    let image_of = |own: usize| mirrors[own].filter(|&other| mirrors[other] == Some(own));
    let with_image = (0..joints.len()).filter(|&own| image_of(own).is_some()).count();
    // The fingers of a hand have images among each other by chance.
    if with_image as f64 >= MOSTLY * joints.len() as f64 {
        joints.iter_mut().enumerate().for_each(|(own, joint)| joint.mirror = image_of(own));
    }
    joints
}
