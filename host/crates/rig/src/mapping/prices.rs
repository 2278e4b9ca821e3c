//! The cost of a joint driving a bone, apart from the shapes of the two trees.

use glam::Vec3;

use super::hints::{PuppetHints, PuppetKind};
use super::puppet_plan::PuppetPlan;
use crate::puppet::JointTree;
use crate::recognise::Side;
use crate::recognise::body_plan::BoneTraits;
use crate::recognise::vocabulary::{Limb, Meaning, disagreement, meaning};

/// The cost of a joint on a bone that a person would not choose: a tail, a finger; a joint with a twin on a bone in the
/// middle, a joint without one on a bone of one side.
const ON_TAIL: f64 = 0.4;
const ON_FINGER: f64 = 0.2;
const TWIN_IN_THE_MIDDLE: f64 = 4.5;
const ALONE_ON_A_SIDE: f64 = 4.5;
const ON_COLLARBONE: f64 = 0.9;
/// An eye or an ear; nearly as much as a joint without a bone.
const ON_APPENDAGE: f64 = 2.9;
/// A bone that is no part of what the puppet is said to be.
const OTHER_KIND: f64 = 2.5;
/// A joint of an arm without fingers on a finger, unless it is the last one: that may be a gripper.
const ARM_ON_FINGER: f64 = 1.2;
/// A lone arm is taken for a right one, a lone hand for a left one, as the simulated hand is.
const OTHER_HAND: f64 = 0.05;
/// A part that is known to lie on the other side, or to point elsewhere (for opposite directions), or to be e times as
/// long as the bone beside the rest.
const OTHER_SIDE: f64 = 2.5;
const OTHER_WAY: f64 = 1.5;
const OTHER_LENGTH: f64 = 0.1;
/// A part whose head is no further from the middle than this share of the puppet's width is on no side.
const IN_THE_MIDDLE: f32 = 0.1;

/// The cost of each joint driving each bone, apart from the shapes of the two trees: joints × bones, row-major. `same`: the
/// two trees have the same shape, so nothing has to be guessed about limbs and tails.
pub(super) fn prices(
    tree: &JointTree,
    plan: &PuppetPlan,
    traits: &[BoneTraits],
    hints: &PuppetHints,
    same: bool,
) -> Vec<f64> {
    let figure = Figure::of(traits);
    // A hand needs fingers, an arm an arm.
    let kind = kind_of(plan, tree, hints).filter(|&kind| match kind {
        PuppetKind::Arm => traits.iter().any(is_arm),
        PuppetKind::Hand => traits.iter().filter(|bone| bone.finger).count() > 2,
    });
    let puppet = Puppet::of(kind, plan, hints);
    let mut prices = Vec::with_capacity(plan.part_of_joint.len() * traits.len());
    for (joint, &part) in plan.part_of_joint.iter().enumerate() {
        let uid = tree.parts()[part].uid;
        let own = Joint {
            named: hints.names.get(&uid).map_or_else(Meaning::default, |name| figure.known(meaning(name))),
            segment: hints.segments.get(&uid).copied(),
            has_twin: plan.has_twin[joint],
            is_lone: plan.is_lone[joint],
            is_last: plan.joints.children[joint].is_empty(),
        };
        prices.extend(traits.iter().map(|bone| {
            let known = disagreement(own.named, bone.meaning) + puppet.segment_price(&own, bone, &figure);
            let guessed =
                || build_price(bone) + puppet.symmetry_price(&own, bone, &figure) + puppet.kind_price(&own, bone);
            if same { known } else { known + guessed() }
        }));
    }
    prices
}

/// What is known of a joint.
struct Joint {
    named: Meaning,
    /// From where to where it reaches.
    segment: Option<(Vec3, Vec3)>,
    has_twin: bool,
    is_lone: bool,
    /// Nothing comes after it.
    is_last: bool,
}

/// What is known of the skeleton as a whole.
struct Figure {
    /// All bones that name a side name the same.
    one_sided: bool,
    /// It has bones that face each other.
    has_sides: bool,
    longest: f32,
}

impl Figure {
    fn of(traits: &[BoneTraits]) -> Self {
        let mut named = traits.iter().filter_map(|bone| bone.meaning.side);
        let first = named.next();
        Self {
            one_sided: named.all(|side| Some(side) == first),
            has_sides: traits.iter().any(|bone| bone.mirror.is_some()),
            longest: traits.iter().map(|bone| bone.head.distance(bone.tip)).fold(0.0, f32::max),
        }
    }

    /// Of a figure that is all left hand, no bone is on the other side.
    fn known(&self, named: Meaning) -> Meaning {
        Meaning { side: named.side.filter(|_| !self.one_sided), ..named }
    }
}

/// What is known of the puppet as a whole.
struct Puppet {
    kind: Option<PuppetKind>,
    /// It is an arm and no finger follows it.
    lone_arm: bool,
    /// The side on which all of it lies.
    side: Option<Side>,
    longest: f32,
    /// How far from the middle it reaches.
    widest: f32,
}

impl Puppet {
    fn of(kind: Option<PuppetKind>, plan: &PuppetPlan, hints: &PuppetHints) -> Self {
        let segments = || hints.segments.values();
        let all_on = |side| segments().all(|(head, _)| head.x != 0.0 && side_of(head.x) == side);
        let sides = if hints.segments.is_empty() { &[][..] } else { &[Side::Left, Side::Right][..] };
        Self {
            kind,
            lone_arm: kind == Some(PuppetKind::Arm) && plan.hand_after.is_none(),
            side: sides.iter().copied().find(|&side| all_on(side)),
            longest: segments().map(|(head, tip)| head.distance(*tip)).fold(0.0, f32::max),
            widest: segments().map(|(head, _)| head.x.abs()).fold(0.0, f32::max),
        }
    }

    /// The side on which a joint is known to lie.
    fn side_of(&self, joint: &Joint) -> Option<Side> {
        let x = joint.segment?.0.x;
        match self.kind {
            None => (x.abs() > IN_THE_MIDDLE * self.widest).then_some(side_of(x)),
            Some(_) => self.side,
        }
    }

    /// A joint that has a twin belongs on a side, one that has none in the middle.
    fn symmetry_price(&self, joint: &Joint, bone: &BoneTraits, figure: &Figure) -> f64 {
        let in_the_middle = figure.has_sides && bone.side.is_none() && !bone.has_twin;
        if joint.has_twin {
            return if in_the_middle { TWIN_IN_THE_MIDDLE } else { 0.0 };
        }
        let alone = joint.is_lone && bone.paired && self.kind.is_none() && self.side_of(joint).is_none();
        if alone { ALONE_ON_A_SIDE } else { 0.0 }
    }

    /// A hand takes a hand, an arm takes an arm.
    fn kind_price(&self, joint: &Joint, bone: &BoneTraits) -> f64 {
        let is_hand = bone.finger || (bone.arm && bone.meaning.segment == meaning("hand").segment);
        let (own, other_side) = match self.kind {
            None => return 0.0,
            Some(PuppetKind::Arm) => (is_arm(bone), Side::Left),
            Some(PuppetKind::Hand) => (is_hand, Side::Right),
        };
        let side = bone.side.or(bone.meaning.side);
        let other = if side == Some(other_side) { OTHER_HAND } else { 0.0 };
        let finger = if self.lone_arm && bone.finger && !joint.is_last { ARM_ON_FINGER } else { 0.0 };
        other + finger + if own { 0.0 } else { OTHER_KIND }
    }

    /// What a joint's place, direction and length say.
    fn segment_price(&self, joint: &Joint, bone: &BoneTraits, figure: &Figure) -> f64 {
        let Some((head, tip)) = joint.segment else { return 0.0 };
        let mut price = match (self.side_of(joint), bone.side) {
            (Some(own), Some(other)) if own != other => OTHER_SIDE,
            _ => 0.0,
        };
        let (way, other_way) = ((tip - head).normalize_or_zero(), (bone.tip - bone.head).normalize_or_zero());
        // An arm or a hand by itself may be held any way.
        if self.kind.is_none() && way != Vec3::ZERO {
            // A bone without length points nowhere in particular.
            price += OTHER_WAY * f64::from(1.0 - way.dot(other_way)) / 2.0;
        }
        let lengths = [tip.distance(head) / self.longest, bone.tip.distance(bone.head) / figure.longest];
        if lengths.iter().all(|length| length.is_finite() && *length > 0.0) {
            price += OTHER_LENGTH * libm::fabs(libm::log(f64::from(lengths[0] / lengths[1]))).min(3.0);
        }
        price
    }
}

fn is_arm(bone: &BoneTraits) -> bool {
    bone.arm || bone.meaning.limb == Some(Limb::Arm)
}

/// A tail, a finger, an eye and a collarbone go without a joint before others do.
fn build_price(bone: &BoneTraits) -> f64 {
    let prices = [
        (bone.tail, ON_TAIL),
        (bone.finger, ON_FINGER),
        (bone.collarbone, ON_COLLARBONE),
        (bone.appendage, ON_APPENDAGE),
    ];
    prices.iter().filter(|(is_so, _)| *is_so).map(|(_, price)| price).sum()
}

/// What the puppet is: what is said of it, or what it looks like.
pub(super) fn kind_of(plan: &PuppetPlan, tree: &JointTree, hints: &PuppetHints) -> Option<PuppetKind> {
    let looks_like = match plan.hand_after {
        Some(1) => Some(PuppetKind::Hand),
        Some(_) => Some(PuppetKind::Arm),
        None => None,
    };
    // Five limbs of a star point every way, fingers point one way.
    let ways = plan.part_of_joint.iter().filter_map(|&part| hints.segments.get(&tree.parts()[part].uid));
    let ways: Vec<Vec3> = ways.map(|(head, tip)| (*tip - *head).normalize_or_zero()).collect();
    let mean = ways.iter().copied().sum::<Vec3>().normalize_or_zero();
    let is_star = ways.iter().any(|way| way.dot(mean) < 0.0);
    hints.kind.or(looks_like.filter(|_| !is_star))
}

fn side_of(x: f32) -> Side {
    if x > 0.0 { Side::Left } else { Side::Right }
}
