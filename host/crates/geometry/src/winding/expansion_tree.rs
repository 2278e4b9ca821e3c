//! Distant groups represented by a few moments, several groups at a time, in any dimension (Barill, Dickson, Schmidt,
//! Levin and Jacobson 2018, "Fast winding numbers for soups and clouds").

/// What is below a group: the index of a node or, with [`BLOCK`], of a block of the elements themselves.
pub(super) type Child = u32;
pub(super) const BLOCK: Child = 1 << 31;

/// A node over `G` groups in `D` dimensions.
pub(super) trait Groups<const D: usize, const G: usize> {
    /// The precision of the expansions and of points.
    type Number: Copy + Default + std::ops::AddAssign;

    /// The angles of the groups by their expansions, zero for groups that are too near, and a bit set for each of
    /// those. Always inline.
    fn expand(&self, point: [Self::Number; D]) -> ([Self::Number; G], u32);

    /// What to visit instead of groups that are too near.
    fn children(&self) -> &[Child; G];
}

/// Sums the expansions of all groups that are far enough from a point; `near` receives the blocks of the others.
#[inline(always)]
pub(super) fn visit<const D: usize, const G: usize, N: Groups<D, G>>(
    nodes: &[N],
    point: [N::Number; D],
    stack: &mut Vec<u32>,
    mut near: impl FnMut(usize),
) -> [N::Number; G] {
    let mut far = [N::Number::default(); G];
    stack.clear();
    stack.push(0);
    while let Some(index) = stack.pop() {
        let Some(node) = nodes.get(index as usize) else { continue };
        let (values, mut too_near) = node.expand(point);
        for l in 0..G {
            far[l] += values[l];
        }
        while too_near != 0 {
            let child = node.children()[too_near.trailing_zeros() as usize % G];
            too_near &= too_near - 1;
            if child & BLOCK == 0 {
                stack.push(child);
            } else {
                near((child ^ BLOCK) as usize);
            }
        }
    }
    far
}

/// A usable opening parameter: at least 1, where expansions begin to converge; `usual` for NaN.
pub(super) fn usable_opening(asked: f64, usual: f64) -> f64 {
    if asked.is_nan() { usual } else { asked.clamp(1.0, 1e6) }
}
