//! Boxes around parts of a mesh, each with a closure of the part (thesis 8.4.3, algorithm 2), in any dimension.

use std::cmp::Ordering;
use std::ops::Range;

/// Boxes are widened by this fraction of their diagonal: a point outside is then far enough from the closure that
/// rounding cannot flip a closing element.
pub(super) const MARGIN: f64 = 1e-9;

/// A box, and what to do for points outside and inside it. `C` says where the closure of its part is stored.
#[derive(Clone, Debug)]
pub(super) struct Node<const D: usize, C> {
    pub(super) low: [f64; D],
    pub(super) high: [f64; D],
    /// `None` if the closure is no shorter than the part itself.
    pub(super) closure: Option<C>,
    pub(super) inside: Inside,
}

#[derive(Clone, Debug)]
pub(super) enum Inside {
    /// Sum these blocks of the part itself.
    Blocks(Range<usize>),
    /// Visit both children: the node after this one, and this one.
    Children { second: u32 },
}

/// Finds what must be summed for a point: closures of the boxes that it is outside of, and blocks.
#[inline(always)]
pub(super) fn visit<const D: usize, C>(
    nodes: &[Node<D, C>],
    p: [f64; D],
    stack: &mut Vec<u32>,
    mut part: impl FnMut(Part<'_, C>),
) {
    stack.clear();
    stack.push(0);
    while let Some(index) = stack.pop() {
        let Some(node) = nodes.get(index as usize) else { continue };
        let is_outside = (0..D).any(|k| p[k] < node.low[k] || p[k] > node.high[k]);
        if let Some(closure) = node.closure.as_ref().filter(|_| is_outside) {
            part(Part::Closure(closure));
            continue;
        }
        match &node.inside {
            Inside::Blocks(blocks) => part(Part::Blocks(blocks.clone())),
            Inside::Children { second } => stack.extend([*second, index + 1]),
        }
    }
}

/// Something to sum.
pub(super) enum Part<'a, C> {
    Closure(&'a C),
    Blocks(Range<usize>),
}

/// The exterior of a part, and how many more times the part passes each element one way than the other: edges of
/// triangles, or ends of segments. Ascending, none with a count of zero.
pub(super) type Exterior<K> = Vec<(K, i64)>;

/// Adds up the counts of each key.
pub(super) fn summed<K: Ord + Copy>(mut sides: Exterior<K>) -> Exterior<K> {
    sides.sort_unstable();
    sides.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        kept.1 += if same { next.1 } else { 0 };
        same
    });
    sides.retain(|&(_, count)| count != 0);
    sides
}

/// The combined exterior of two parts.
pub(super) fn merged<K: Ord + Copy>(left: &[(K, i64)], right: &[(K, i64)]) -> Exterior<K> {
    let mut merged = Vec::with_capacity(left.len() + right.len());
    let (mut i, mut j) = (0, 0);
    while i < left.len() && j < right.len() {
        let ((a, m), (b, n)) = (left[i], right[j]);
        match a.cmp(&b) {
            Ordering::Equal => {
                merged.extend((m + n != 0).then_some((a, m + n)));
                (i, j) = (i + 1, j + 1);
            }
            Ordering::Less => {
                merged.push((a, m));
                i += 1;
            }
            Ordering::Greater => {
                merged.push((b, n));
                j += 1;
            }
        }
    }
    merged.extend_from_slice(&left[i..]);
    merged.extend_from_slice(&right[j..]);
    merged
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_cancel_when_summed_and_when_merged() {
        let sides = vec![(3, 1), (1, 1), (3, -1), (2, -1), (1, 1)];
        assert_eq!(summed(sides.clone()), [(1, 2), (2, -1)]);
        let (left, right) = sides.split_at(2);
        assert_eq!(merged(&summed(left.to_vec()), &summed(right.to_vec())), summed(sides));
    }
}
