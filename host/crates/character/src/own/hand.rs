//! A left hand: the one at the end of our human's arm, and the same on its own with a stub of a forearm.

use armature_rig::{Skeleton, SkeletonError};
use glam::DVec3;

use super::bones::Bones;
use super::field::{Field, Group, Loft};
use super::figure::Detail;
use super::remesh::Sizes;

/// The hand on its own is 1 unit tall, a quarter of which is forearm.
const ALONE: Hand =
    Hand { wrist: DVec3::new(0.0, 0.29, 0.0), fingers: DVec3::Y, palm: DVec3::Z, thumb: DVec3::NEG_X, scale: 3.95 };

pub(super) const DETAIL: Detail = Detail { spacing: 0.009, sizes: Sizes { broad: 0.10, min: 0.0086, max: 0.0175 } };

pub(super) fn field() -> Field {
    let at = |x, y, z| ALONE.place(DVec3::new(x, y, z));
    let section = |sizes: [f64; 4]| sizes.map(|r| r * ALONE.scale);
    let forearm = Loft::new(
        [at(0.0, -0.100, 0.0), at(0.0, 0.004, 0.0)],
        [ALONE.thumb, ALONE.palm],
        &[
            (0.00, section([0.036, 0.036, 0.029, 0.029])),
            (0.50, section([0.031, 0.031, 0.024, 0.024])),
            (0.85, section([0.0268, 0.0262, 0.019, 0.0185])),
            (1.00, section([0.0265, 0.0258, 0.0178, 0.0178])),
        ],
        [0.02 * ALONE.scale; 2],
    );
    let hollow = Loft::ellipsoid(at(0.002, 0.052, 0.031), DVec3::new(0.016, 0.028, 0.014) * ALONE.scale);
    let mut body = Group::new(0.02 * ALONE.scale).add(forearm, 0.01);
    for (loft, blend) in palm_parts(&ALONE) {
        body = body.add(loft, blend);
    }
    let mut groups = vec![body.carve(hollow, 0.018 * ALONE.scale)];
    groups.extend(finger_groups(&ALONE, false));
    Field { groups, symmetric: false, floor: Some((0.0, 0.04)) }
}

/// What moves with the palm.
pub(super) fn ribs() -> Vec<(&'static str, [DVec3; 2])> {
    ALONE.palm_ribs().map(|ends| ("LeftHand", ends)).to_vec()
}

pub(super) fn skeleton() -> Result<Skeleton, SkeletonError> {
    let mut bones = Bones::default();
    bones.add("LeftLowerArm", None, [DVec3::new(0.0, 0.03, 0.0), ALONE.wrist]);
    bones.add("LeftHand", Some("LeftLowerArm"), [ALONE.wrist, ALONE.middle_knuckle()]);
    for (name, parent, ends) in ALONE.finger_bones() {
        bones.add(&format!("Left{name}"), Some(&format!("Left{parent}")), ends);
    }
    bones.finish()
}

/// A hand's position and size. Lengths below are those of an adult's hand in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hand {
    /// The wrist's centre.
    pub(super) wrist: DVec3,
    /// Where straight fingers point; unit vector.
    pub(super) fingers: DVec3,
    /// Where the palm faces; unit vector, perpendicular to `fingers`.
    pub(super) palm: DVec3,
    /// The thumb's side; unit vector, perpendicular to both.
    pub(super) thumb: DVec3,
    /// Scale relative to life size.
    pub(super) scale: f64,
}

/// One finger: its joints, knuckle first, tip last, in the hand's own frame (thumb side, fingers, palm), and its
/// thickness at each.
pub(super) struct Finger {
    pub(super) name: &'static str,
    pub(super) joints: [DVec3; 4],
    radii: [f64; 4],
}

impl Hand {
    /// A point in the hand's own frame: towards the thumb, along the fingers, out of the palm.
    pub(super) fn place(&self, p: DVec3) -> DVec3 {
        self.wrist + self.turn(p) * self.scale
    }

    fn turn(&self, d: DVec3) -> DVec3 {
        self.thumb * d.x + self.fingers * d.y + self.palm * d.z
    }

    /// Where the hand bone ends.
    pub(super) fn middle_knuckle(&self) -> DVec3 {
        self.place(fingers()[2].joints[0])
    }

    /// Name without side, parent and ends of every finger bone.
    pub(super) fn finger_bones(&self) -> Vec<(String, String, [DVec3; 2])> {
        let mut bones = Vec::new();
        for finger in fingers() {
            let mut parent = "Hand".to_owned();
            for (k, segment) in ["Proximal", "Intermediate", "Distal"].into_iter().enumerate() {
                let name = format!("{}{segment}", finger.name);
                let ends = [self.place(finger.joints[k]), self.place(finger.joints[k + 1])];
                bones.push((name.clone(), std::mem::replace(&mut parent, name), ends));
            }
        }
        bones
    }

    /// From the wrist to the outer knuckles: the palm is one piece.
    pub(super) fn palm_ribs(&self) -> [[DVec3; 2]; 2] {
        let knuckle = |finger: usize| self.place(fingers()[finger].joints[0]);
        [1, 4].map(|finger| [self.wrist, self.wrist.lerp(knuckle(finger), 0.95)])
    }

    fn cone(&self, [a, b]: [DVec3; 2], [ra, rb]: [f64; 2]) -> Loft {
        Loft::cone([self.place(a), self.place(b)], [ra * self.scale, rb * self.scale])
    }
}

/// Thumb first, little finger last.
pub(super) fn fingers() -> [Finger; 5] {
    // Knuckle; spread away from the middle finger towards the thumb, radians; lengths of the three segments; radii.
    let long = |name, knuckle: DVec3, spread: f64, length: f64, radius: f64| {
        let (sin, cos) = (libm::sin(spread), libm::cos(spread));
        let mut joints = [knuckle; 4];
        let mut bend = 0.0;
        for (k, (share, more)) in [(0.46, 0.07), (0.30, 0.14), (0.24, 0.12)].into_iter().enumerate() {
            bend += more;
            let along = DVec3::new(sin, cos, 0.0) * libm::cos(bend) + DVec3::Z * libm::sin(bend);
            joints[k + 1] = joints[k] + along * (share * length);
        }
        Finger { name, joints, radii: [1.01, 1.0, 0.92, 0.80].map(|r| r * radius) }
    };
    let thumb = [(0.020, 0.022, 0.008), (0.044, 0.053, 0.014), (0.0585, 0.080, 0.0155), (0.0670, 0.101, 0.0155)];
    [
        Finger {
            name: "Thumb",
            joints: thumb.map(|(x, y, z)| DVec3::new(x, y, z)),
            radii: [0.0135, 0.0112, 0.0100, 0.0084],
        },
        long("Index", DVec3::new(0.0312, 0.0910, 0.0), 0.17, 0.074, 0.0084),
        long("Middle", DVec3::new(0.0102, 0.0940, 0.0), 0.035, 0.082, 0.0086),
        long("Ring", DVec3::new(-0.0110, 0.0900, 0.0), -0.105, 0.076, 0.0081),
        long("Little", DVec3::new(-0.0308, 0.0820, 0.0), -0.26, 0.060, 0.0074),
    ]
}

/// Palm, the balls of thumb and little finger, with their blends.
pub(super) fn palm_parts(hand: &Hand) -> Vec<(Loft, f64)> {
    let at = |x, y, z| hand.place(DVec3::new(x, y, z));
    let section = |sizes: [f64; 4]| sizes.map(|r| r * hand.scale);
    let palm = Loft::new(
        [at(0.0, 0.0, 0.0), at(0.0, 0.086, 0.0)],
        [hand.thumb, hand.palm],
        &[
            (0.00, section([0.027, 0.026, 0.017, 0.017])),
            (0.35, section([0.034, 0.034, 0.017, 0.016])),
            (0.80, section([0.041, 0.039, 0.013, 0.013])),
            (1.00, section([0.039, 0.037, 0.0115, 0.0105])),
        ],
        [0.015 * hand.scale, 0.013 * hand.scale],
    );
    let cone = |a: [f64; 3], b: [f64; 3], r: [f64; 2]| hand.cone([a.into(), b.into()], r);
    let blend = |width: f64| width * hand.scale;
    vec![
        (palm, blend(0.02)),
        (cone([0.016, 0.016, 0.009], [0.036, 0.048, 0.013], [0.015, 0.0135]), blend(0.018)),
        (cone([-0.020, 0.016, 0.008], [-0.0245, 0.060, 0.003], [0.013, 0.0105]), blend(0.018)),
    ]
}

/// One group per finger, so that neighbours hardly blend.
pub(super) fn finger_groups(hand: &Hand, mirrored: bool) -> Vec<Group> {
    let group = |finger: &Finger| {
        let blend = (if finger.name == "Thumb" { 0.018 } else { 0.012 }) * hand.scale;
        let mut group = if mirrored { Group::mirrored(blend, blend) } else { Group::new(blend) };
        for k in 0..3 {
            let ends = [finger.joints[k], finger.joints[k + 1]];
            group = group.add(hand.cone(ends, [finger.radii[k], finger.radii[k + 1]]), 0.0015 * hand.scale);
        }
        group
    };
    fingers().iter().map(group).collect()
}
