//! The shapes that our own characters are made of: a signed distance field of smoothly blended lofts.
//!
//! A loft is a straight axis with an egg-shaped cross-section that changes along it, closed by rounded caps; a capsule,
//! an ellipsoid, a thigh and a rib cage are all lofts. Lofts are joined by a smooth minimum. The field is negative
//! inside, close to the true distance near the surface, and never much steeper than one.

use glam::DVec3;

/// An upper bound on the field's slope: the sections of a loft may widen this much along its axis.
pub(super) const STEEPEST: f64 = 1.6;

/// A cross-section: where on the axis (0 to 1) and how far it reaches towards +u, -u, +v and -v.
#[derive(Clone, Copy, Debug)]
struct Station {
    at: f64,
    reach: [f64; 4],
    slope: [f64; 4],
}

/// A straight axis with a changing egg-shaped section and rounded ends.
#[derive(Clone, Debug)]
pub(super) struct Loft {
    start: DVec3,
    axis: DVec3,
    length: f64,
    u: DVec3,
    v: DVec3,
    stations: Vec<Station>,
    caps: [f64; 2],
    /// No section or cap reaches further than this from the axis.
    widest: f64,
}

impl Loft {
    /// A loft from `start` to `end`; `u` and `v` are made perpendicular to the axis (v first). Each station is
    /// `(at, [+u, -u, +v, -v])` with `at` rising from 0 to 1; `caps` is how far the rounded ends stick out.
    pub(super) fn new(
        [start, end]: [DVec3; 2],
        [u, v]: [DVec3; 2],
        stations: &[(f64, [f64; 4])],
        caps: [f64; 2],
    ) -> Self {
        let length = start.distance(end).max(1e-9);
        let axis = (end - start).normalize_or(DVec3::Y);
        let v = (v - axis * v.dot(axis)).normalize_or(axis.any_orthonormal_vector());
        let across = axis.cross(v);
        let u = if across.dot(u) < 0.0 { -across } else { across };
        let widest = stations.iter().flat_map(|s| s.1).chain(caps).fold(0.0, f64::max);
        Self { start, axis, length, u, v, stations: with_slopes(stations), caps, widest }
    }

    /// A cone with rounded ends.
    pub(super) fn cone(ends: [DVec3; 2], radii: [f64; 2]) -> Self {
        let side = (ends[1] - ends[0]).normalize_or(DVec3::Y).any_orthonormal_pair();
        Self::new(ends, [side.0, side.1], &[(0.0, [radii[0]; 4]), (1.0, [radii[1]; 4])], radii)
    }

    /// An ellipsoid with its axes along x, y and z.
    pub(super) fn ellipsoid(centre: DVec3, reach: DVec3) -> Self {
        let half = DVec3::new(0.0, 1e-6, 0.0);
        let section = [reach.x, reach.x, reach.z, reach.z];
        Self::new([centre - half, centre + half], [DVec3::X, DVec3::Z], &[(0.0, section), (1.0, section)], [reach.y; 2])
    }

    fn distance(&self, p: DVec3) -> f64 {
        let relative = p - self.start;
        let (s, u, v) = (relative.dot(self.axis), relative.dot(self.u), relative.dot(self.v));
        let along = s.clamp(0.0, self.length);
        let reach = self.reach_at(along / self.length);
        let beyond = s - along;
        let ru = if u >= 0.0 { reach[0] } else { reach[1] };
        let rv = if v >= 0.0 { reach[2] } else { reach[3] };
        let rw = if beyond < 0.0 { self.caps[0] } else { self.caps[1] };
        let scaled = DVec3::new(u / ru, v / rv, beyond / rw);
        let k0 = scaled.length();
        let k1 = DVec3::new(scaled.x / ru, scaled.y / rv, scaled.z / rw).length();
        if k1 < 1e-9 { -ru.min(rv) } else { k0 * (k0 - 1.0) / k1 }
    }

    fn reach_at(&self, at: f64) -> [f64; 4] {
        let next = self.stations.iter().position(|s| s.at >= at).unwrap_or(self.stations.len() - 1).max(1);
        let (a, b) = (&self.stations[next - 1], &self.stations[next]);
        let width = b.at - a.at;
        let t = ((at - a.at) / width).clamp(0.0, 1.0);
        let (t2, t3) = (t * t, t * t * t);
        let hermite = [2.0 * t3 - 3.0 * t2 + 1.0, (t3 - 2.0 * t2 + t) * width, 3.0 * t2 - 2.0 * t3, (t3 - t2) * width];
        std::array::from_fn(|k| {
            hermite[0] * a.reach[k] + hermite[1] * a.slope[k] + hermite[2] * b.reach[k] + hermite[3] * b.slope[k]
        })
    }

    /// Whether the distance can be below `limit`; cheap.
    fn can_be_below(&self, p: DVec3, limit: f64) -> bool {
        let relative = p - self.start;
        let nearest = self.axis * relative.dot(self.axis).clamp(0.0, self.length);
        let reach = limit + self.widest;
        reach > 0.0 && relative.distance_squared(nearest) < reach * reach
    }

    /// A box around it.
    fn bounds(&self) -> (DVec3, DVec3) {
        let end = self.start + self.axis * self.length;
        (self.start.min(end) - self.widest, self.start.max(end) + self.widest)
    }
}

/// Slopes of the monotone cubic interpolant (Fritsch and Carlson, in Brodlie's harmonic form): no overshoot between
/// stations; level at both ends, where the caps continue without a crease.
fn with_slopes(stations: &[(f64, [f64; 4])]) -> Vec<Station> {
    let secant = |i: usize, k: usize| (stations[i + 1].1[k] - stations[i].1[k]) / (stations[i + 1].0 - stations[i].0);
    let last = stations.len() - 1;
    let slope = |i: usize, k: usize| {
        if i == 0 || i == last {
            return 0.0;
        }
        let (before, after) = (secant(i - 1, k), secant(i, k));
        if before * after <= 0.0 {
            return 0.0;
        }
        let (h0, h1) = (stations[i].0 - stations[i - 1].0, stations[i + 1].0 - stations[i].0);
        let share = (h0 + 2.0 * h1) / (3.0 * (h0 + h1));
        before * after / (share * after + (1.0 - share) * before)
    };
    let station = |(i, &(at, reach)): (usize, &(f64, [f64; 4]))| Station {
        at,
        reach,
        slope: std::array::from_fn(|k| slope(i, k)),
    };
    stations.iter().enumerate().map(station).collect()
}

/// How a part combines with the parts before it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Join {
    Add,
    Carve,
}

/// Parts that belong together, joined one after the other.
#[derive(Clone, Debug)]
pub(super) struct Group {
    parts: Vec<(Loft, Join, f64)>,
    blend: f64,
    /// Blend between the group and its mirror image.
    twin_blend: Option<f64>,
    /// A box around the added parts.
    bounds: (DVec3, DVec3),
}

impl Group {
    /// A group joined to everything before it with the given blend width.
    pub(super) fn new(blend: f64) -> Self {
        Self { parts: Vec::new(), blend, twin_blend: None, bounds: (DVec3::INFINITY, DVec3::NEG_INFINITY) }
    }

    /// A group whose parts, given for +x, also exist for -x, blended with their twins over `twin_blend`.
    pub(super) fn mirrored(blend: f64, twin_blend: f64) -> Self {
        Self { twin_blend: Some(twin_blend), ..Self::new(blend) }
    }

    /// Adds a part, blended over `blend` with the group's earlier parts.
    pub(super) fn add(mut self, loft: Loft, blend: f64) -> Self {
        let (low, high) = loft.bounds();
        self.bounds = (self.bounds.0.min(low), self.bounds.1.max(high));
        self.parts.push((loft, Join::Add, blend));
        self
    }

    /// Subtracts a part from the group's earlier parts.
    pub(super) fn carve(mut self, loft: Loft, blend: f64) -> Self {
        self.parts.push((loft, Join::Carve, blend));
        self
    }

    /// The group without any parts.
    fn shell(&self) -> Self {
        Self { parts: Vec::new(), ..*self }
    }

    /// The group's own field, exact only below `limit`.
    fn distance(&self, p: DVec3, limit: f64) -> f64 {
        let mut d = f64::INFINITY;
        let outside = (self.bounds.0 - p).max(p - self.bounds.1).max(DVec3::ZERO);
        if outside.length_squared() > limit.max(0.0).powi(2) {
            return d;
        }
        for (loft, join, blend) in &self.parts {
            match join {
                Join::Add if loft.can_be_below(p, d.min(limit) + blend) => d = smooth_min(d, loft.distance(p), *blend),
                Join::Carve if loft.can_be_below(p, blend - d) => d = -smooth_min(-d, loft.distance(p), *blend),
                _ => {}
            }
        }
        d
    }
}

/// The whole shape.
#[derive(Clone, Debug, Default)]
pub(super) struct Field {
    /// Joined one after the other.
    pub(super) groups: Vec<Group>,
    /// Whether the shape is its own mirror image in x; then only x ≥ 0 is polygonised.
    pub(super) symmetric: bool,
    /// Cuts off everything below a height, rounded over a width: `(y, blend)`.
    pub(super) floor: Option<(f64, f64)>,
}

impl Field {
    /// Signed distance, negative inside.
    pub(super) fn distance(&self, p: DVec3) -> f64 {
        let twin = DVec3::new(-p.x, p.y, p.z);
        let mut d = f64::INFINITY;
        for group in &self.groups {
            let limit = d + group.blend;
            let mut own = group.distance(p, limit);
            if let Some(blend) = group.twin_blend {
                own = smooth_min(own, group.distance(twin, limit), blend);
            }
            d = smooth_min(d, own, group.blend);
        }
        self.floor.map_or(d, |(y, blend)| -smooth_min(-d, p.y - y, blend))
    }

    /// The same field for points within `radius` of `centre`, without the parts that are too far away to matter close
    /// to the surface.
    pub(super) fn near(&self, centre: DVec3, radius: f64) -> Self {
        let twin = DVec3::new(-centre.x, centre.y, centre.z);
        let highest = self.distance(centre).max(0.0) + STEEPEST * radius;
        let group = |group: &Group| {
            let counts = |(loft, _, blend): &(Loft, Join, f64)| {
                let limit = highest + STEEPEST * radius + group.blend + blend;
                loft.can_be_below(centre, limit) || group.twin_blend.is_some() && loft.can_be_below(twin, limit)
            };
            let parts = group.parts.iter().filter(|part| counts(part)).cloned().collect();
            Group { parts, ..group.shell() }
        };
        let groups = self.groups.iter().map(group).filter(|g| !g.parts.is_empty()).collect();
        Self { groups, ..*self }
    }

    /// Gradient by central differences over a tetrahedron of the given size.
    pub(super) fn gradient(&self, p: DVec3, size: f64) -> DVec3 {
        const CORNERS: [DVec3; 4] = [
            DVec3::new(1.0, -1.0, -1.0),
            DVec3::new(-1.0, -1.0, 1.0),
            DVec3::new(-1.0, 1.0, -1.0),
            DVec3::new(1.0, 1.0, 1.0),
        ];
        CORNERS.iter().map(|&c| c * self.distance(p + c * size)).sum::<DVec3>() / (4.0 * size)
    }

    /// Moves a point close to the surface onto it.
    pub(super) fn project(&self, mut p: DVec3, size: f64) -> DVec3 {
        for _ in 0..4 {
            let d = self.distance(p);
            if d.abs() < 1e-5 * size {
                break;
            }
            let g = self.gradient(p, 0.1 * size);
            // Away from the surface the field may be flat; a step there goes no further than one size.
            let step = g * (d / g.length_squared().max(0.1));
            p -= step.clamp_length_max(size);
        }
        p
    }

    /// A box around everything, `(min, max)`.
    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        let mut bounds = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for group in &self.groups {
            bounds = (bounds.0.min(group.bounds.0), bounds.1.max(group.bounds.1));
        }
        if self.symmetric {
            bounds.1.x = bounds.1.x.max(-bounds.0.x);
            bounds.0.x = -bounds.1.x;
        }
        bounds
    }
}

/// The smaller of two numbers, rounded off (by at most a sixth of `width`) where they differ by less than `width`.
fn smooth_min(a: f64, b: f64, width: f64) -> f64 {
    let near = (width - (a - b).abs()).max(0.0) / width;
    a.min(b) - near * near * near * width / 6.0
}
