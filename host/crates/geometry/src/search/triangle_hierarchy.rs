//! A bounding volume hierarchy over triangles, for segment queries and closest points.

use glam::DVec3;

use super::triangle_queries::{closest_on_triangle, segment_meets_triangle};
use crate::{MeshError, TriangleMesh};

/// Triangles per leaf; at about this number, a box test costs as much as the triangles it would save.
const LEAF: usize = 4;
/// Buckets of the surface area heuristic along each axis.
const BUCKETS: usize = 12;

/// A hierarchy of boxes over the triangles of one mesh. It owns copies of the positions; queries borrow it and may
/// run in parallel.
#[derive(Clone, Debug)]
pub struct TriangleHierarchy {
    nodes: Vec<Node>,
    /// Corner positions in leaf order.
    corners: Vec<[DVec3; 3]>,
    /// Index in the mesh of each triangle in leaf order.
    triangles: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// A leaf's first triangle, or an inner node's second child (the first child comes right after the node).
    first: u32,
    /// A leaf's number of triangles; zero for an inner node.
    count: u32,
}

/// Where a segment meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentHit {
    /// Zero-based triangle of the mesh.
    pub triangle: u32,
    /// Position along the segment: 0 at its start, 1 at its end.
    pub along: f64,
}

/// The point of a mesh nearest to a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// Zero-based triangle of the mesh.
    pub triangle: u32,
    /// On the surface, in the mesh's unit.
    pub point: [f64; 3],
    /// Squared distance from the query.
    pub distance_squared: f64,
}

impl TriangleHierarchy {
    /// Builds the hierarchy by the surface area heuristic.
    pub fn new(mesh: &TriangleMesh) -> Result<Self, MeshError> {
        mesh.validate()?;
        let corners: Vec<[DVec3; 3]> =
            mesh.triangles.iter().map(|t| t.map(|v| DVec3::from(mesh.vertices[v as usize]))).collect();
        let mut items: Vec<Item> = corners
            .iter()
            .enumerate()
            .map(|(index, [a, b, c])| {
                let (low, high) = (a.min(*b).min(*c), a.max(*b).max(*c));
                Item { low, high, centre: 0.5 * low + 0.5 * high, triangle: index as u32 }
            })
            .collect();
        let mut nodes = Vec::with_capacity(2 * items.len() / LEAF + 1);
        build(&mut nodes, &mut items, 0);
        let triangles: Vec<u32> = items.iter().map(|item| item.triangle).collect();
        let corners = triangles.iter().map(|&t| corners[t as usize]).collect();
        Ok(Self { nodes, corners, triangles })
    }

    /// Whether the open segment from `from` to `to`, shortened at both ends by `margin` (a fraction of its length),
    /// meets any triangle for which `ignore` is false. Triangles that the segment runs within (in their plane) do not
    /// count.
    pub fn segment_is_blocked(&self, from: [f64; 3], to: [f64; 3], margin: f64, ignore: impl Fn(u32) -> bool) -> bool {
        self.visit_segment(from, to, |hit| {
            (hit.along > margin && hit.along < 1.0 - margin && !ignore(hit.triangle)).then_some(0.0)
        })
    }

    /// The first triangle met on the way from `from` to `to`, both ends included.
    pub fn first_hit(&self, from: [f64; 3], to: [f64; 3]) -> Option<SegmentHit> {
        let mut best: Option<SegmentHit> = None;
        self.visit_segment(from, to, |hit| {
            // Ties go to the smaller index, so that the result does not depend on the hierarchy's shape.
            let nearer =
                best.is_none_or(|b| hit.along < b.along || (hit.along <= b.along && hit.triangle < b.triangle));
            if nearer {
                best = Some(hit);
            }
            None
        });
        best
    }

    /// Calls `visit` for triangles met by the segment, in no particular order, until it returns `Some`; returns whether
    /// it did.
    fn visit_segment(&self, from: [f64; 3], to: [f64; 3], mut visit: impl FnMut(SegmentHit) -> Option<f64>) -> bool {
        let (from, direction) = (DVec3::from(from), DVec3::from(to) - DVec3::from(from));
        let inverse = direction.recip();
        let mut stack = Vec::with_capacity(64);
        stack.push(0_u32);
        while let Some(index) = stack.pop() {
            let Some(node) = self.nodes.get(index as usize) else { continue };
            if !segment_meets_box(from, inverse, node) {
                continue;
            }
            if node.count == 0 {
                stack.push(node.first);
                stack.push(index + 1);
                continue;
            }
            for slot in node.first as usize..(node.first + node.count) as usize {
                if let Some(along) = segment_meets_triangle(from, direction, &self.corners[slot])
                    && visit(SegmentHit { triangle: self.triangles[slot], along }).is_some()
                {
                    return true;
                }
            }
        }
        false
    }

    /// The point of the mesh nearest to `query`; `None` if the query is not finite.
    pub fn closest_point(&self, query: [f64; 3]) -> Option<ClosestPoint> {
        let query = DVec3::from(query);
        let mut best: Option<ClosestPoint> = None;
        let mut stack = vec![(0_u32, 0.0)];
        while let Some((index, bound)) = stack.pop() {
            if best.is_some_and(|b| bound > b.distance_squared) {
                continue;
            }
            let node = self.nodes.get(index as usize)?;
            if node.count == 0 {
                let children = [index + 1, node.first].map(|child| {
                    (child, self.nodes.get(child as usize).map_or(f64::INFINITY, |n| box_distance_squared(query, n)))
                });
                let nearer_last = if children[0].1 <= children[1].1 { [children[1], children[0]] } else { children };
                stack.extend(nearer_last);
                continue;
            }
            for slot in node.first as usize..(node.first + node.count) as usize {
                let point = closest_on_triangle(query, &self.corners[slot]);
                let (distance_squared, triangle) = (point.distance_squared(query), self.triangles[slot]);
                let better = best.is_none_or(|b| {
                    distance_squared < b.distance_squared
                        || (distance_squared <= b.distance_squared && triangle < b.triangle)
                });
                if better && distance_squared.is_finite() {
                    best = Some(ClosestPoint { triangle, point: point.to_array(), distance_squared });
                }
            }
        }
        best
    }
}

/// What other algorithms on the same boxes need.
impl TriangleHierarchy {
    /// Smallest and largest corner of a node's box.
    pub(crate) fn bounds_of(&self, node: usize) -> Option<(DVec3, DVec3)> {
        self.nodes.get(node).map(|n| (n.low, n.high))
    }

    /// The second child of an inner node, whose first child is the next node; `None` for a leaf.
    pub(crate) fn second_child(&self, node: usize) -> Option<usize> {
        self.nodes.get(node).filter(|n| n.count == 0).map(|n| n.first as usize)
    }

    /// The range in leaf order of the triangles under a node.
    pub(crate) fn slots_of(&self, node: usize) -> std::ops::Range<usize> {
        let (mut left, mut right) = (node, node);
        while self.second_child(left).is_some() {
            left += 1;
        }
        while let Some(second) = self.second_child(right) {
            right = second;
        }
        match (self.nodes.get(left), self.nodes.get(right)) {
            (Some(first), Some(last)) => first.first as usize..(last.first + last.count) as usize,
            _ => 0..0,
        }
    }

    /// The triangle of the mesh at a place in leaf order.
    pub(crate) fn triangle_in(&self, slot: usize) -> u32 {
        self.triangles[slot]
    }

    /// Calls `visit` with every triangle whose box overlaps or touches the box around `corners`, until it returns
    /// `false`.
    pub(crate) fn visit_overlapping(&self, corners: [[f64; 3]; 3], mut visit: impl FnMut(u32) -> bool) {
        let around = |[a, b, c]: [DVec3; 3]| (a.min(b).min(c), a.max(b).max(c));
        let (low, high) = around(corners.map(DVec3::from));
        let overlaps = |(l, h): (DVec3, DVec3)| l.cmple(high).all() && h.cmpge(low).all();
        let mut stack = vec![0_usize];
        while let Some(index) = stack.pop() {
            let Some(node) = self.nodes.get(index) else { continue };
            if !overlaps((node.low, node.high)) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first as usize, index + 1]);
                continue;
            }
            for slot in node.first as usize..(node.first + node.count) as usize {
                if overlaps(around(self.corners[slot])) && !visit(self.triangles[slot]) {
                    return;
                }
            }
        }
    }

    /// The corners of the triangle at a place in leaf order.
    pub(crate) fn corners_in(&self, slot: usize) -> [DVec3; 3] {
        self.corners[slot]
    }
}

#[derive(Clone, Copy)]
struct Item {
    low: DVec3,
    high: DVec3,
    centre: DVec3,
    triangle: u32,
}

/// Appends the subtree over `items`, whose first is at `offset` in leaf order, and orders `items` that way.
fn build(nodes: &mut Vec<Node>, items: &mut [Item], offset: usize) {
    let Some(first) = items.first() else { return };
    let (low, high) =
        items.iter().fold((first.low, first.high), |(low, high), item| (low.min(item.low), high.max(item.high)));
    let index = nodes.len();
    nodes.push(Node { low, high, first: offset as u32, count: items.len() as u32 });
    if items.len() <= LEAF {
        return;
    }
    let middle = split(items);
    nodes[index].count = 0;
    let (left, right) = items.split_at_mut(middle);
    build(nodes, left, offset);
    nodes[index].first = nodes.len() as u32;
    build(nodes, right, offset + middle);
}

/// Orders `items` into two non-empty parts and returns where the second begins.
fn split(items: &mut [Item]) -> usize {
    let first = items[0].centre;
    let (low, high) = items.iter().fold((first, first), |(low, high), i| (low.min(i.centre), high.max(i.centre)));
    let extent = high - low;
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
    let bucket_of =
        |item: &Item| (((item.centre[axis] - low[axis]) / extent[axis] * BUCKETS as f64) as usize).min(BUCKETS - 1);
    if let Some(bucket) = best_bucket(items, bucket_of) {
        let mut middle = 0;
        for i in 0..items.len() {
            if bucket_of(&items[i]) <= bucket {
                items.swap(i, middle);
                middle += 1;
            }
        }
        // An unlucky cut would make the tree, and the recursion with it, as deep as the mesh is large.
        if middle.min(items.len() - middle) > items.len() / 64 {
            return middle;
        }
    }
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| {
        a.centre[axis].total_cmp(&b.centre[axis]).then(a.triangle.cmp(&b.triangle))
    });
    middle
}

/// The last bucket of the left part for which box area times triangles is smallest.
fn best_bucket(items: &[Item], bucket_of: impl Fn(&Item) -> usize) -> Option<usize> {
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0_usize);
    let mut buckets = [empty; BUCKETS];
    for item in items {
        let bucket = &mut buckets[bucket_of(item)];
        *bucket = (bucket.0.min(item.low), bucket.1.max(item.high), bucket.2 + 1);
    }
    let join = |a: (DVec3, DVec3, usize), b: (DVec3, DVec3, usize)| (a.0.min(b.0), a.1.max(b.1), a.2 + b.2);
    let cost = |(low, high, count): (DVec3, DVec3, usize)| {
        let e = high - low;
        count as f64 * (e.x * e.y + e.y * e.z + e.z * e.x)
    };
    let mut right_costs = [0.0; BUCKETS];
    let mut right = empty;
    for bucket in (1..BUCKETS).rev() {
        right = join(right, buckets[bucket]);
        right_costs[bucket - 1] = if right.2 == 0 { f64::INFINITY } else { cost(right) };
    }
    let mut best: Option<(usize, f64)> = None;
    let mut left = empty;
    for bucket in 0..BUCKETS - 1 {
        left = join(left, buckets[bucket]);
        let total = if left.2 == 0 { f64::INFINITY } else { cost(left) + right_costs[bucket] };
        if total.is_finite() && best.is_none_or(|(_, least)| total < least) {
            best = Some((bucket, total));
        }
    }
    best.map(|(bucket, _)| bucket)
}

fn segment_meets_box(from: DVec3, inverse: DVec3, node: &Node) -> bool {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for axis in 0..3 {
        // Perpendicular to the axis, where 0·∞ would be NaN.
        if inverse[axis].is_infinite() {
            if from[axis] < node.low[axis] || from[axis] > node.high[axis] {
                return false;
            }
            continue;
        }
        let a = (node.low[axis] - from[axis]) * inverse[axis];
        let b = (node.high[axis] - from[axis]) * inverse[axis];
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    // A little wider than rounding, so that a triangle on a box's face is not lost.
    enter <= leave + 1e-12
}

fn box_distance_squared(query: DVec3, node: &Node) -> f64 {
    query.distance_squared(query.clamp(node.low, node.high))
}
