//! Whether a skeleton is in a mesh, or was made for another unit or place.

use std::fmt;

use glam::{DVec3, Vec3};

/// A skeleton that cannot belong to the mesh: both bounding boxes, and what is probably wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Misfit {
    /// Smallest and largest corner of the mesh's box.
    pub mesh: [[f64; 3]; 2],
    /// Smallest and largest corner of the skeleton's box.
    pub skeleton: [[f64; 3]; 2],
    /// Bones with no end inside the mesh's box.
    pub bones_outside: usize,
    /// All bones.
    pub bone_count: usize,
}

/// A skeleton this many times as large as the mesh is in another unit.
const TOO_LARGE: f64 = 5.0;
/// A skeleton this small relative to the mesh is in another unit; a few bones of a larger figure are still well above
/// this.
const TOO_SMALL: f64 = 1.0 / 30.0;

impl Misfit {
    /// Compares a mesh's bounding box with bones given by head and tail. `Err` if at least half of the bones are
    /// outside the box (widened by a tenth of its diagonal) or the sizes differ too much; otherwise the number of bones
    /// outside.
    pub fn check(mesh: ([f64; 3], [f64; 3]), segments: &[(Vec3, Vec3)]) -> Result<usize, Self> {
        let (low, high) = (DVec3::from(mesh.0), DVec3::from(mesh.1));
        let margin = 0.1 * (high - low).length();
        let inside = |p: Vec3| {
            let p = p.as_dvec3();
            p.cmpge(low - margin).all() && p.cmple(high + margin).all()
        };
        let bones_outside = segments.iter().filter(|(head, tail)| !inside(*head) && !inside(*tail)).count();
        let ends = || segments.iter().flat_map(|(head, tail)| [head.as_dvec3(), tail.as_dvec3()]);
        let bones_low = ends().reduce(DVec3::min).unwrap_or(DVec3::ZERO);
        let bones_high = ends().reduce(DVec3::max).unwrap_or(DVec3::ZERO);
        let misfit = Self {
            mesh: [mesh.0, mesh.1],
            skeleton: [bones_low.to_array(), bones_high.to_array()],
            bones_outside,
            bone_count: segments.len(),
        };
        let other_unit = misfit.times_larger() > TOO_LARGE || misfit.times_larger() < TOO_SMALL;
        let elsewhere = bones_outside > 0 && 2 * bones_outside >= segments.len();
        if other_unit || elsewhere { Err(misfit) } else { Ok(bones_outside) }
    }

    /// The skeleton's size as a multiple of the mesh's.
    pub fn times_larger(&self) -> f64 {
        let diagonal = |[low, high]: [[f64; 3]; 2]| DVec3::from(low).distance(DVec3::from(high));
        diagonal(self.skeleton) / diagonal(self.mesh).max(f64::MIN_POSITIVE)
    }
}

impl fmt::Display for Misfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let corner = |[x, y, z]: [f64; 3]| format!("({x:.4}, {y:.4}, {z:.4})");
        write!(
            f,
            "the mesh reaches from {} to {}, the skeleton from {} to {}, and {} of {} bones are outside: ",
            corner(self.mesh[0]),
            corner(self.mesh[1]),
            corner(self.skeleton[0]),
            corner(self.skeleton[1]),
            self.bones_outside,
            self.bone_count
        )?;
        let times = self.times_larger();
        if times > TOO_LARGE {
            write!(f, "the skeleton is {times:.3} times as large; scale one of them to the other's unit")
        } else if times < 1.0 / TOO_LARGE {
            write!(f, "the mesh is {:.3} times as large; scale one of them to the other's unit", 1.0 / times)
        } else {
            write!(f, "move or turn the skeleton into the mesh (+Y is up, the character looks along +Z)")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: ([f64; 3], [f64; 3]) = ([0.0; 3], [1.0, 2.0, 1.0]);

    fn bones(scale: f32, offset: f32) -> Vec<(Vec3, Vec3)> {
        (0..4)
            .map(|k| {
                let at = |y: f32| Vec3::new(0.5, y, 0.5) * scale + offset;
                (at(0.4 * k as f32), at(0.4 * (k + 1) as f32))
            })
            .collect()
    }

    #[test]
    fn a_skeleton_inside_fits() {
        assert_eq!(Misfit::check(BOX, &bones(1.0, 0.0)), Ok(0));
        assert_eq!(Misfit::check(BOX, &bones(0.1, 0.5)), Ok(0));
    }

    #[test]
    fn metres_in_centimetres_are_noticed_even_inside_the_box() {
        let inside = Misfit::check(([-100.0; 3], [100.0; 3]), &bones(1.0, 0.0)).unwrap_err();
        assert!(inside.to_string().contains("the mesh is"), "{inside}");
    }

    #[test]
    fn another_unit_and_another_place_are_told_apart() {
        let large = Misfit::check(BOX, &bones(100.0, 0.0)).unwrap_err();
        assert!(large.to_string().contains("times as large; scale"), "{large}");
        let small = Misfit::check(BOX, &bones(0.01, -3.0)).unwrap_err();
        assert!(small.to_string().contains("the mesh is"), "{small}");
        let away = Misfit::check(BOX, &bones(1.0, 9.0)).unwrap_err();
        assert!(away.to_string().contains("move or turn"), "{away}");
        assert!(away.to_string().contains("(9.5000, 9.0000, 9.5000)"), "{away}");
    }
}
