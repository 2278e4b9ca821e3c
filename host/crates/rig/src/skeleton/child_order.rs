//! The order in which a bone's children are counted, so that a skeleton and a puppet's outlets can be compared.

use glam::Vec3;

use super::bones::Skeleton;

/// A child no further from its parent's sagittal plane than this fraction of the widest sibling's distance is in the
/// middle.
const MIDDLE: f32 = 0.15;
/// The same relative to the distance between siblings, where all of them are near the plane.
const MIDDLE_OF_SPREAD: f32 = 0.05;

/// The convention by which outlets of a splitter and children of a bone are matched when their shapes are the same:
/// **from the character's left (+X) to its right, and on each side from front (+Z) to back.**
///
/// Precisely: children are compared by the mean position of their subtrees (the bones' midpoints, rest pose). Children
/// left of, on and right of the plane x = the parent's head (for several roots: x = 0) come in this order. On one side
/// they run from front to back if they differ more in z than in x, as the legs of a spider do, otherwise from left to
/// right, as the fingers of a hand do. Remaining ties run from top to bottom, then in the skeleton's own order.
#[derive(Clone, Debug)]
pub struct ChildOrder {
    children: Vec<Vec<usize>>,
    roots: Vec<usize>,
    head_x: Vec<f32>,
    subtree_mean: Vec<Vec3>,
}

impl ChildOrder {
    /// Orders all children of all bones.
    pub fn new(skeleton: &Skeleton) -> Self {
        let segments = skeleton.rest_segments();
        let mut sums: Vec<(Vec3, f32)> = segments.iter().map(|(head, tail)| (0.5 * (*head + *tail), 1.0)).collect();
        let mut children = vec![Vec::new(); skeleton.len()];
        let mut roots = Vec::new();
        for (index, bone) in skeleton.bones().iter().enumerate().rev() {
            let (sum, count) = sums[index];
            let siblings = bone.parent.map_or(&mut roots, |parent| {
                sums[parent].0 += sum;
                sums[parent].1 += count;
                &mut children[parent]
            });
            siblings.push(index);
        }
        let subtree_mean = sums.iter().map(|(sum, count)| *sum / *count).collect();
        let head_x = segments.iter().map(|(head, _)| head.x).collect();
        let order = Self { children: Vec::new(), roots: Vec::new(), head_x, subtree_mean };
        for (parent, siblings) in children.iter_mut().enumerate() {
            order.sort(siblings, Some(parent));
        }
        order.sort(&mut roots, None);
        Self { children, roots, ..order }
    }

    /// The children of a bone.
    pub fn children(&self, bone: usize) -> &[usize] {
        &self.children[bone]
    }

    /// The bones without a parent.
    pub fn roots(&self) -> &[usize] {
        &self.roots
    }

    /// Sorts bones as if all were children of `parent` (`None`: roots).
    pub(crate) fn sort(&self, siblings: &mut [usize], parent: Option<usize>) {
        if siblings.len() < 2 {
            return;
        }
        let plane = parent.map_or(0.0, |bone| self.head_x[bone]);
        let mean = |bone: usize| self.subtree_mean[bone];
        let widest = siblings.iter().map(|&b| (mean(b).x - plane).abs()).fold(0.0, f32::max);
        let spread = siblings.iter().map(|&b| mean(b).distance(mean(siblings[0]))).fold(0.0, f32::max);
        let tolerance = (MIDDLE * widest).max(MIDDLE_OF_SPREAD * spread);
        let side = |bone: usize| match mean(bone).x - plane {
            x if x > tolerance => 0_usize,
            x if x < -tolerance => 2,
            _ => 1,
        };
        let front_to_back = [0, 1, 2].map(|which| {
            let group = || siblings.iter().filter(|&&bone| side(bone) == which).map(|&bone| mean(bone));
            let least = group().fold(Vec3::INFINITY, Vec3::min);
            let most = group().fold(Vec3::NEG_INFINITY, Vec3::max);
            most.z - least.z > most.x - least.x
        });
        siblings.sort_by(|&a, &b| {
            let (ma, mb) = (mean(a), mean(b));
            let by_x = mb.x.total_cmp(&ma.x);
            let by_z = mb.z.total_cmp(&ma.z);
            let within = if front_to_back[side(a)] { by_z.then(by_x) } else { by_x.then(by_z) };
            side(a).cmp(&side(b)).then(within).then(mb.y.total_cmp(&ma.y)).then(a.cmp(&b))
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::bones::Bone;
    use super::super::transforms::Transform;
    use super::*;

    fn star(directions: &[[f32; 3]]) -> Skeleton {
        let bone =
            |name: String, parent, tail: [f32; 3]| Bone { name, parent, rest: Transform::IDENTITY, tail: tail.into() };
        let mut bones = vec![bone("body".into(), None, [0.0; 3])];
        bones.extend(directions.iter().enumerate().map(|(i, &d)| bone(format!("{i}"), Some(0), d)));
        Skeleton::new(bones).unwrap()
    }

    #[test]
    fn legs_run_left_front_to_back_then_right() {
        let mut legs = Vec::new();
        for degrees in [-50_i16, -17, 17, 50] {
            let (sin, cos) = libm::sincosf(f32::from(degrees).to_radians());
            legs.push([cos, 0.2, sin]);
            legs.push([-cos, 0.2, sin]);
        }
        let order = ChildOrder::new(&star(&legs));
        assert_eq!(order.children(0), [7, 5, 3, 1, 8, 6, 4, 2]);
    }

    #[test]
    fn fingers_run_across_and_the_spine_is_between_the_legs() {
        let fingers = [[-0.4, 1.0, 0.0], [0.5, 0.6, 0.1], [0.2, 1.1, 0.0], [0.0, 1.2, 0.0], [-0.2, 1.1, 0.0]];
        assert_eq!(ChildOrder::new(&star(&fingers)).children(0), [2, 3, 4, 5, 1]);
        let hips = [[0.01, 1.0, -0.1], [-0.2, -1.0, 0.0], [0.2, -1.0, 0.0]];
        assert_eq!(ChildOrder::new(&star(&hips)).children(0), [3, 1, 2]);
    }

    #[test]
    fn the_tail_of_a_fox_comes_after_its_neck() {
        let fox = [[0.0, 0.1, -1.0], [1e-7, 0.3, 1.0]];
        assert_eq!(ChildOrder::new(&star(&fox)).children(0), [2, 1]);
    }
}
