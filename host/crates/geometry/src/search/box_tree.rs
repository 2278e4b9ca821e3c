//! A tree of boxes whose items may grow in place, for surfaces that change while they are searched.

use glam::DVec3;

/// Items per leaf, and children per node.
const WAYS: usize = 4;
/// Bits of a Morton code along each axis.
const BITS: u32 = 21;

/// Boxes over items in Morton order. Building it takes as long as a sort and needs only the items' boxes.
#[derive(Clone, Debug, Default)]
pub(crate) struct BoxTree {
    /// From the leaves up to a single root; the parent of box `i` is box `i / WAYS` of the next level.
    levels: Vec<Vec<Bounds>>,
    /// Items in Morton order.
    items: Vec<u32>,
    /// Leaf of every item, by the item's number.
    leaf_of: Vec<u32>,
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) low: DVec3,
    pub(crate) high: DVec3,
}

impl Bounds {
    pub(crate) const NONE: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    pub(crate) fn around(points: &[DVec3]) -> Self {
        points.iter().fold(Self::NONE, |b, &p| Self { low: b.low.min(p), high: b.high.max(p) })
    }

    pub(crate) fn join(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Touching counts.
    #[inline]
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        (self.low.cmple(other.high) & other.low.cmple(self.high)).all()
    }

    fn holds(&self, other: &Self) -> bool {
        (self.low.cmple(other.low) & other.high.cmple(self.high)).all()
    }
}

impl BoxTree {
    /// A tree over `items`, whose numbers are below `names`.
    pub(crate) fn new(items: Vec<u32>, names: usize, bounds_of: impl Fn(u32) -> Bounds) -> Self {
        let items = morton_order(items, |item| {
            let bounds = bounds_of(item);
            0.5 * bounds.low + 0.5 * bounds.high
        });
        let mut leaf_of = vec![u32::MAX; names];
        for (slot, &item) in items.iter().enumerate() {
            leaf_of[item as usize] = (slot / WAYS) as u32;
        }
        let leaves = items.chunks(WAYS).map(|of_leaf| {
            let joined = of_leaf.iter().fold(Bounds::NONE, |b, &item| b.join(bounds_of(item)));
            Bounds { low: joined.low, high: joined.high }
        });
        let mut levels: Vec<Vec<Bounds>> = vec![leaves.collect()];
        while let Some(below) = levels.last().filter(|level| level.len() > 1) {
            let above = below.chunks(WAYS).map(|few| few.iter().fold(Bounds::NONE, |b, &child| b.join(child)));
            let above = above.collect();
            levels.push(above);
        }
        Self { levels, items, leaf_of }
    }

    /// Enlarges the boxes of an item that now reaches further.
    pub(crate) fn grow(&mut self, item: u32, bounds: &Bounds) {
        let mut index = self.leaf_of[item as usize] as usize;
        for level in &mut self.levels {
            let Some(node) = level.get_mut(index).filter(|node| !node.holds(bounds)) else { return };
            *node = node.join(*bounds);
            index /= WAYS;
        }
    }

    /// Calls `visit` with the items of every leaf for which `keep` holds, both for its box and for all boxes around it.
    /// The order depends only on the tree's shape.
    pub(crate) fn visit(&self, keep: impl Fn(&Bounds) -> bool, mut visit: impl FnMut(u32)) {
        let mut stack = [(0_u32, 0_u32); 64];
        let mut height = 1;
        stack[0] = ((self.levels.len() as u32).wrapping_sub(1), 0);
        while height > 0 {
            height -= 1;
            let (level, index) = stack[height];
            let Some(node) = self.levels.get(level as usize).and_then(|nodes| nodes.get(index as usize)) else {
                continue;
            };
            if !keep(node) {
                continue;
            }
            let first = index as usize * WAYS;
            if level == 0 {
                let end = (first + WAYS).min(self.items.len());
                self.items[first..end].iter().for_each(|&item| visit(item));
                continue;
            }
            // Each level adds three more than it takes: 64 places are enough for twenty levels, and 4¹⁶ items fill
            // sixteen.
            for child in 0..WAYS {
                stack[height] = (level - 1, (first + child) as u32);
                height += 1;
            }
        }
    }
}

/// Items along a space-filling curve, so that neighbours in the list are neighbours in space.
pub(crate) fn morton_order(items: Vec<u32>, centre_of: impl Fn(u32) -> DVec3) -> Vec<u32> {
    let bounds = items.iter().fold(Bounds::NONE, |b, &item| b.join(Bounds::around(&[centre_of(item)])));
    let extent = (bounds.high - bounds.low).max_element();
    let cells = if extent > 0.0 { f64::from((1_u32 << BITS) - 1) / extent } else { 0.0 };
    let mut keyed: Vec<(u64, u32)> = items
        .into_iter()
        .map(|item| {
            let cell = (centre_of(item) - bounds.low) * cells;
            (spread(cell.x as u64) | spread(cell.y as u64) << 1 | spread(cell.z as u64) << 2, item)
        })
        .collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, item)| item).collect()
}

/// Puts two zeros between the bits of a number.
fn spread(x: u64) -> u64 {
    let mut x = x & ((1 << BITS) - 1);
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(item: u32) -> Bounds {
        let k = f64::from(item);
        let low = DVec3::new((7.0 * k) % 11.0, (5.0 * k) % 13.0, (3.0 * k) % 17.0);
        Bounds { low, high: low + 0.5 }
    }

    #[test]
    fn finds_what_overlaps_and_what_has_grown() {
        for count in [0, 1, 4, 5, 17, 1000_u32] {
            let mut tree = BoxTree::new((0..count).collect(), count as usize, at);
            let mut bounds: Vec<Bounds> = (0..count).map(at).collect();
            if let Some(last) = bounds.last_mut() {
                last.high = DVec3::splat(40.0);
                tree.grow(count - 1, &last.clone());
            }
            for query in [Bounds { low: DVec3::splat(3.0), high: DVec3::splat(6.0) }, at(3)] {
                let mut found = Vec::new();
                tree.visit(|b| b.overlaps(&query), |item| found.push(item));
                found.retain(|&item| bounds[item as usize].overlaps(&query));
                found.sort_unstable();
                let expected: Vec<u32> = (0..count).filter(|&i| bounds[i as usize].overlaps(&query)).collect();
                assert_eq!(found, expected);
            }
        }
    }

    #[test]
    fn spreading_keeps_every_bit() {
        let mut gathered = 0_u64;
        for bit in 0..BITS {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
            gathered |= spread(1 << bit);
        }
        assert_eq!(gathered, spread(u64::MAX));
    }
}
