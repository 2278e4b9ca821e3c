//! A spider: about 1.4 units wide, standing on the ground, looking along +z.

use armature_rig::{Skeleton, SkeletonError};
use glam::DVec3;

use super::bones::Bones;
use super::field::{Field, Group, Loft};
use super::figure::Detail;
use super::remesh::Sizes;

pub(super) const DETAIL: Detail = Detail { spacing: 0.0065, sizes: Sizes { broad: 0.12, min: 0.0118, max: 0.030 } };

/// Thickness of a leg at its joints, body first.
const THICKNESS: [f64; 4] = [0.029, 0.026, 0.019, 0.0095];

const JAW: [DVec3; 2] = [DVec3::new(0.028, 0.275, 0.205), DVec3::new(0.026, 0.205, 0.236)];
const PALP: [DVec3; 3] =
    [DVec3::new(0.062, 0.270, 0.195), DVec3::new(0.088, 0.268, 0.275), DVec3::new(0.074, 0.195, 0.317)];

fn at(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Joints of the four left legs, front leg first: at the body, knee, ankle, tip.
fn legs() -> [[DVec3; 4]; 4] {
    // Direction seen from above, radians from +z towards +x; distances outward to knee, ankle and tip; height of the
    // knee.
    let leg = |angle: f64, hip: [f64; 2], out: [f64; 3], knee: f64| {
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let base = at(hip[0], 0.290, hip[1]);
        let point = |way: f64, y: f64| at(base.x + sin * way, y, base.z + cos * way);
        [base, point(out[0], knee), point(out[1], 0.235), point(out[2], 0.010)]
    };
    [
        leg(0.50, [0.070, 0.175], [0.215, 0.430, 0.560], 0.480),
        leg(1.13, [0.092, 0.115], [0.200, 0.385, 0.500], 0.490),
        leg(1.82, [0.092, 0.050], [0.195, 0.370, 0.485], 0.485),
        leg(2.50, [0.072, -0.005], [0.235, 0.470, 0.610], 0.490),
    ]
}

pub(super) fn field() -> Field {
    let mut groups = vec![body()];
    for joints in legs() {
        let mut group = Group::mirrored(0.03, 0.01);
        for k in 0..3 {
            // Slightly bulging in the middle of each segment, slightly narrowed at each joint.
            let ends = [joints[k], joints[k + 1]];
            let (thick, thin) = (THICKNESS[k], THICKNESS[k + 1]);
            let middle = 0.55 * thick + 0.45 * thin;
            let side = (ends[1] - ends[0]).normalize_or(DVec3::Y).any_orthonormal_pair();
            let stations = [
                (0.0, [0.92 * thick; 4]),
                (0.3, [1.08 * middle; 4]),
                (0.75, [0.97 * middle; 4]),
                (1.0, [0.95 * thin; 4]),
            ];
            group = group.add(Loft::new(ends, [side.0, side.1], &stations, [0.92 * thick, 0.95 * thin]), 0.012);
        }
        groups.push(group);
    }
    groups.push(face());
    Field { groups, symmetric: true, floor: None }
}

fn body() -> Group {
    let along =
        |ends: [DVec3; 2], stations: &[(f64, [f64; 4])], caps| Loft::new(ends, [DVec3::X, DVec3::Y], stations, caps);
    let front = along(
        [at(0.0, 0.295, 0.060), at(0.0, 0.300, 0.140)],
        &[(0.0, [0.104, 0.104, 0.070, 0.066]), (1.0, [0.090, 0.090, 0.072, 0.060])],
        [0.125, 0.095],
    );
    let waist = Loft::cone([at(0.0, 0.305, -0.100), at(0.0, 0.300, 0.010)], [0.030, 0.036]);
    let rear = along(
        [at(0.0, 0.342, -0.330), at(0.0, 0.332, -0.220)],
        &[(0.0, [0.140, 0.140, 0.132, 0.116]), (1.0, [0.134, 0.134, 0.124, 0.108])],
        [0.165, 0.115],
    );
    let mut group = Group::new(0.03).add(front, 0.01).add(waist, 0.03).add(rear, 0.025);
    for side in [1.0, -1.0] {
        let spinneret = Loft::cone([at(side * 0.016, 0.325, -0.455), at(side * 0.020, 0.319, -0.500)], [0.017, 0.010]);
        group = group.add(spinneret, 0.012);
    }
    group
}

fn face() -> Group {
    let mut group = Group::mirrored(0.012, 0.004);
    let eyes = [
        (0.024, 0.340, 0.216, 0.021),
        (0.062, 0.341, 0.190, 0.015),
        (0.030, 0.367, 0.180, 0.012),
        (0.072, 0.352, 0.140, 0.011),
    ];
    for (x, y, z, radius) in eyes {
        group = group.add(Loft::ellipsoid(at(x, y, z), DVec3::splat(radius)), 0.004);
    }
    let jaw = Loft::cone(JAW, [0.030, 0.019]);
    let fang = Loft::cone([at(0.025, 0.200, 0.236), at(0.016, 0.170, 0.222)], [0.012, 0.006]);
    let palp = PALP;
    group
        .add(jaw, 0.015)
        .add(fang, 0.008)
        .add(Loft::cone([palp[0], palp[1]], [0.020, 0.017]), 0.012)
        .add(Loft::cone([palp[1], palp[2]], [0.017, 0.014]), 0.008)
}

/// Jaws and palps have no bones of their own and move with the body.
pub(super) fn ribs() -> Vec<(&'static str, [DVec3; 2])> {
    let left = [JAW, [PALP[0], PALP[1]], [PALP[1], PALP[2]]];
    let both = left.into_iter().flat_map(|ends| [ends, ends.map(|p| at(-p.x, p.y, p.z))]);
    both.map(|ends| ("Body", ends)).collect()
}

pub(super) fn skeleton() -> Result<Skeleton, SkeletonError> {
    let mut bones = Bones::default();
    bones.add("Body", None, [at(0.0, 0.300, -0.020), at(0.0, 0.300, 0.200)]);
    bones.add("Abdomen", Some("Body"), [at(0.0, 0.305, -0.085), at(0.0, 0.340, -0.430)]);
    for side in ["Left", "Right"] {
        for (number, joints) in legs().into_iter().enumerate() {
            let mut parent = "Body".to_owned();
            for (k, segment) in ["Femur", "Tibia", "Tarsus"].into_iter().enumerate() {
                let name = format!("Leg{}{segment}", number + 1);
                bones.add_on_side(side, &name, &parent, [joints[k], joints[k + 1]]);
                parent = name;
            }
        }
    }
    bones.finish()
}
