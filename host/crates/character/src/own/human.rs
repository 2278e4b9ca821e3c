//! A human figure: about 1.75 units tall and seven and a half heads, in a T-pose, palms down, feet forward.

use armature_rig::{Skeleton, SkeletonError};
use glam::DVec3;

use super::bones::Bones;
use super::field::{Field, Group, Loft};
use super::figure::Detail;
use super::hand::{Hand, finger_groups, palm_parts};
use super::remesh::Sizes;

const RIGHT_FRONT: [DVec3; 2] = [DVec3::X, DVec3::Z];
const SHOULDER: DVec3 = DVec3::new(0.172, 1.425, -0.014);
const ELBOW: DVec3 = DVec3::new(0.441, 1.425, -0.020);
const WRIST: DVec3 = DVec3::new(0.692, 1.425, -0.010);
const HIP: DVec3 = DVec3::new(0.094, 0.905, 0.0);
const KNEE: DVec3 = DVec3::new(0.104, 0.490, 0.008);
const ANKLE: DVec3 = DVec3::new(0.110, 0.085, -0.024);

pub(super) const DETAIL: Detail = Detail { spacing: 0.0042, sizes: Sizes { broad: 0.12, min: 0.0056, max: 0.0275 } };

fn at(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// The left hand's frame: fingers towards +x, palm down, thumb forward.
pub(super) fn left_hand() -> Hand {
    Hand { wrist: WRIST, fingers: DVec3::X, palm: DVec3::NEG_Y, thumb: DVec3::Z, scale: 1.0 }
}

pub(super) fn field() -> Field {
    let hand = left_hand();
    let mut groups = vec![trunk(), head(), arm(&hand)];
    groups.extend(finger_groups(&hand, true));
    groups.push(leg());
    groups.push(foot());
    Field { groups, symmetric: true, floor: Some((0.0, 0.012)) }
}

pub(super) fn skeleton() -> Result<Skeleton, SkeletonError> {
    let spine = [0.955, 1.045, 1.165, 1.285, 1.465, 1.545, 1.735];
    let depth = [0.0, -0.008, -0.012, -0.016, -0.018, 0.0, 0.004];
    let names = ["Hips", "Spine", "Chest", "UpperChest", "Neck", "Head"];
    let mut bones = Bones::default();
    for (k, name) in names.into_iter().enumerate() {
        let parent = k.checked_sub(1).map(|p| names[p]);
        bones.add(name, parent, [at(0.0, spine[k], depth[k]), at(0.0, spine[k + 1], depth[k + 1])]);
    }
    let hand = left_hand();
    let ball = at(0.122, 0.022, 0.122);
    let left = [
        ("Shoulder", "UpperChest", [at(0.025, 1.428, -0.014), SHOULDER]),
        ("UpperArm", "Shoulder", [SHOULDER, ELBOW]),
        ("LowerArm", "UpperArm", [ELBOW, WRIST]),
        ("Hand", "LowerArm", [WRIST, hand.middle_knuckle()]),
        ("UpperLeg", "Hips", [HIP, KNEE]),
        ("LowerLeg", "UpperLeg", [KNEE, ANKLE]),
        ("Foot", "LowerLeg", [ANKLE, ball]),
        ("Toes", "Foot", [ball, at(0.124, 0.016, 0.172)]),
    ];
    for side in ["Left", "Right"] {
        for (name, parent, ends) in left {
            bones.add_on_side(side, name, parent, ends);
        }
        for (name, parent, ends) in hand.finger_bones() {
            bones.add_on_side(side, &name, &parent, ends);
        }
    }
    bones.finish()
}

/// What moves with the spine, the hips and the hands although it is far from those bones.
pub(super) fn ribs() -> Vec<(&'static str, [DVec3; 2])> {
    let across = |y: f64, half: f64, z: f64| [at(-half, y, z), at(half, y, z)];
    let mut ribs = vec![
        ("Hips", across(0.965, 0.105, -0.005)),
        ("Hips", across(0.895, 0.045, -0.045)),
        ("Hips", across(0.885, 0.035, 0.015)),
        ("Spine", across(1.085, 0.075, -0.004)),
        ("Chest", across(1.205, 0.090, -0.004)),
        ("Chest", across(1.265, 0.105, -0.004)),
        ("UpperChest", across(1.320, 0.105, -0.006)),
    ];
    let palm = left_hand().palm_ribs();
    ribs.extend(palm.map(|ends| ("LeftHand", ends)));
    ribs.extend(palm.map(|ends| ("RightHand", ends.map(|p| at(-p.x, p.y, p.z)))));
    ribs
}

/// Sections given by height rather than by position on the axis.
fn upright(low: f64, high: f64, z: f64, sections: &[(f64, f64, f64, f64)], caps: [f64; 2]) -> Loft {
    let stations: Vec<(f64, [f64; 4])> = sections
        .iter()
        .map(|&(y, half_width, front, back)| ((y - low) / (high - low), [half_width, half_width, front, back]))
        .collect();
    Loft::new([at(0.0, low, z), at(0.0, high, z)], RIGHT_FRONT, &stations, caps)
}

fn trunk() -> Group {
    let sections = [
        (0.930, 0.153, 0.095, 0.094),
        (0.990, 0.149, 0.096, 0.092),
        (1.065, 0.132, 0.093, 0.082),
        (1.120, 0.127, 0.093, 0.082),
        (1.190, 0.138, 0.100, 0.093),
        (1.270, 0.157, 0.107, 0.108),
        (1.330, 0.164, 0.107, 0.113),
    ];
    let torso = upright(0.930, 1.330, 0.0, &sections, [0.085, 0.140]);
    let girdle_section = [0.040, 0.055, 0.055, 0.058];
    let girdle = Loft::new(
        [at(-0.150, 1.405, -0.018), at(0.150, 1.405, -0.018)],
        [DVec3::Y, DVec3::Z],
        &[(0.0, girdle_section), (1.0, girdle_section)],
        [0.05; 2],
    );
    let mut group = Group::new(0.03).add(torso, 0.01).add(girdle, 0.10);
    for side in [1.0, -1.0] {
        let chest = Loft::ellipsoid(at(side * 0.078, 1.318, 0.042), at(0.078, 0.064, 0.055));
        let seat = Loft::ellipsoid(at(side * 0.075, 0.905, -0.046), at(0.080, 0.088, 0.070));
        let trapezius = Loft::cone([at(side * 0.018, 1.500, -0.030), at(side * 0.150, 1.440, -0.024)], [0.040, 0.032]);
        let collar = Loft::cone([at(side * 0.022, 1.437, 0.036), at(side * 0.150, 1.452, 0.004)], [0.008, 0.008]);
        group = group.add(chest, 0.09).add(seat, 0.07).add(trapezius, 0.07).add(collar, 0.03);
    }
    let spine = Loft::cone([at(0.0, 1.000, -0.104), at(0.0, 1.360, -0.132)], [0.012, 0.014]);
    group.carve(spine, 0.06)
}

fn head() -> Group {
    let neck = upright(
        1.420,
        1.560,
        -0.012,
        &[(1.420, 0.066, 0.060, 0.066), (1.480, 0.055, 0.056, 0.056), (1.560, 0.053, 0.056, 0.058)],
        [0.03; 2],
    );
    let cranium = Loft::ellipsoid(at(0.0, 1.660, -0.010), at(0.076, 0.090, 0.097));
    let face = upright(
        1.540,
        1.668,
        0.018,
        &[
            (1.540, 0.036, 0.056, 0.040),
            (1.562, 0.049, 0.064, 0.056),
            (1.590, 0.058, 0.067, 0.066),
            (1.630, 0.065, 0.067, 0.070),
            (1.668, 0.069, 0.066, 0.070),
        ],
        [0.022, 0.05],
    );
    let nose = Loft::cone([at(0.0, 1.656, 0.078), at(0.0, 1.618, 0.095)], [0.0065, 0.0100]);
    let chin = Loft::ellipsoid(at(0.0, 1.543, 0.054), at(0.022, 0.016, 0.016));
    let mouth = Loft::ellipsoid(at(0.0, 1.579, 0.070), at(0.028, 0.015, 0.0165));
    let upper_lip = Loft::ellipsoid(at(0.0, 1.5845, 0.0800), at(0.0210, 0.0050, 0.0075));
    let lower_lip = Loft::ellipsoid(at(0.0, 1.5735, 0.0785), at(0.0180, 0.0055, 0.0080));
    let mut group = Group::new(0.035).add(neck, 0.01).add(cranium, 0.04).add(face, 0.04);
    group = group.add(nose, 0.018).add(chin, 0.03).add(mouth, 0.03).add(upper_lip, 0.008).add(lower_lip, 0.008);
    for side in [1.0, -1.0] {
        let wing = Loft::ellipsoid(at(side * 0.0095, 1.6155, 0.0885), at(0.0065, 0.0060, 0.0080));
        let socket = Loft::ellipsoid(at(side * 0.034, 1.646, 0.0930), at(0.023, 0.0125, 0.0165));
        let ear = Loft::ellipsoid(at(side * 0.0755, 1.640, -0.006), at(0.008, 0.029, 0.017));
        group = group.add(wing, 0.010).carve(socket, 0.026).add(ear, 0.012);
    }
    group
}

fn arm(hand: &Hand) -> Group {
    let up_front = [DVec3::Y, DVec3::Z];
    let whole = Loft::new(
        [SHOULDER, WRIST],
        up_front,
        &[
            (0.00, [0.054, 0.062, 0.058, 0.058]),
            (0.12, [0.052, 0.056, 0.054, 0.053]),
            (0.28, [0.045, 0.047, 0.051, 0.046]),
            (0.44, [0.036, 0.037, 0.041, 0.039]),
            (0.53, [0.034, 0.034, 0.037, 0.038]),
            (0.64, [0.037, 0.035, 0.043, 0.041]),
            (0.78, [0.030, 0.029, 0.037, 0.035]),
            (0.92, [0.0215, 0.0215, 0.0285, 0.0275]),
            (1.00, [0.0195, 0.0195, 0.0275, 0.0265]),
        ],
        [0.05, 0.02],
    );
    let deltoid = Loft::ellipsoid(SHOULDER + at(0.020, 0.008, 0.0), at(0.074, 0.056, 0.062));
    let mut group = Group::mirrored(0.08, 0.01).add(whole, 0.01).add(deltoid, 0.05);
    for (loft, blend) in palm_parts(hand) {
        group = group.add(loft, blend);
    }
    group
}

fn leg() -> Group {
    let whole = Loft::new(
        [HIP.lerp(ANKLE, 0.03), ANKLE],
        RIGHT_FRONT,
        &[
            (0.00, [0.072, 0.066, 0.080, 0.076]),
            (0.09, [0.074, 0.070, 0.086, 0.082]),
            (0.27, [0.067, 0.065, 0.079, 0.073]),
            (0.42, [0.053, 0.053, 0.062, 0.056]),
            (0.50, [0.049, 0.048, 0.052, 0.050]),
            (0.57, [0.047, 0.046, 0.043, 0.055]),
            (0.66, [0.050, 0.048, 0.041, 0.067]),
            (0.78, [0.041, 0.040, 0.038, 0.053]),
            (0.92, [0.031, 0.030, 0.034, 0.036]),
            (1.00, [0.032, 0.030, 0.036, 0.036]),
        ],
        [0.09, 0.03],
    );
    let knee_cap = Loft::ellipsoid(KNEE + at(-0.002, 0.004, 0.014), at(0.028, 0.038, 0.022));
    Group::mirrored(0.08, 0.02).add(whole, 0.01).add(knee_cap, 0.04)
}

fn foot() -> Group {
    let up = [DVec3::X, DVec3::Y];
    let sole = Loft::new(
        [at(0.110, 0.036, -0.046), at(0.124, 0.020, 0.130)],
        up,
        &[
            (0.00, [0.030, 0.030, 0.044, 0.040]),
            (0.30, [0.031, 0.030, 0.052, 0.038]),
            (0.60, [0.040, 0.037, 0.036, 0.030]),
            (0.85, [0.046, 0.042, 0.020, 0.024]),
            (1.00, [0.043, 0.040, 0.013, 0.022]),
        ],
        [0.030, 0.012],
    );
    let mut group = Group::mirrored(0.03, 0.005).add(sole, 0.01);
    let toes = [
        (0.092, 0.188, 0.0150),
        (0.1125, 0.184, 0.0108),
        (0.1300, 0.176, 0.0102),
        (0.1465, 0.164, 0.0096),
        (0.1610, 0.150, 0.0092),
    ];
    for (x, tip, radius) in toes {
        let toe =
            Loft::cone([at(x - 0.004, 0.017, 0.120), at(x, radius * 0.95, tip - radius)], [radius * 1.05, radius]);
        group = group.add(toe, 0.008);
    }
    group
}
