//! Delaunay tetrahedra of points.
//!
//! Points are inserted one by one into a triangulation of all of space; every sign is exact, so grids, layers and
//! points on a sphere are handled like any others.
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_geometry::delaunay::delaunay_tetrahedra;
//!
//! let points = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [0.2, 0.2, 0.2]];
//! let delaunay = delaunay_tetrahedra(&points, &mut |_stage, _fraction| ControlFlow::Continue(()))?;
//! assert_eq!(delaunay.tetrahedra.len(), 4, "the last point is inside the tetrahedron of the others");
//! # Ok::<(), armature_geometry::delaunay::DelaunayError>(())
//! ```

mod cavity;
#[cfg(test)]
mod change_tests;
mod flips;
mod insertion;
mod location;
mod order;
mod region;
mod restore;
mod triangulation;
mod walk;

use std::ops::ControlFlow;

use crate::predicates::{collinear, orientation, same_place};
use crate::progress::{Progress, stage};
pub(crate) use cavity::Refusal;
use insertion::Inserted;
use order::insertion_order;
pub(crate) use triangulation::{INFINITE, NONE as NO_TETRAHEDRON, Triangulation};
pub(crate) use walk::Crossing;

/// Insertions between two progress reports.
const REPORT_EVERY: usize = 4096;
/// Insertions are counted in steps of two in 32 bits.
const MOST_POINTS: usize = i32::MAX as usize / 2;
/// Points spread in a volume have 7 tetrahedra each, those of surfaces about as many, those of a cylinder 21.
const MOST_PER_POINT: usize = 32;
const MOST_FOR_FEW_POINTS: usize = 4_000_000;
/// The largest coordinate is scaled into [2¹⁸⁰, 2¹⁸¹): fifth powers of differences, which the sphere test needs, stay
/// below 2¹⁰²³.
const LARGEST_EXPONENT: i32 = 180;
/// 2⁻¹⁶²: from here up, the last bit of a coordinate is at least 2⁻²¹⁴, whose fifth power f64 can still distinguish
/// from zero. Between the two limits no sign is ever lost to overflow or underflow.
const SMALLEST_COORDINATE: f64 = f64::from_bits((1023 - 162) << 52);

/// The Delaunay tetrahedra of points: together they fill the convex hull, and the sphere around each contains no point.
/// If more than four points lie on such a sphere, one of the possible choices is made.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DelaunayTetrahedra {
    /// m×4 zero-based indices of points, `(b-a)·((c-a)×(d-a)) > 0` exactly.
    pub tetrahedra: Vec<[u32; 4]>,
    /// m×4: the tetrahedron across the facet opposite each corner, [`Self::OUTSIDE`] for a facet of the hull.
    pub neighbours: Vec<[u32; 4]>,
    /// For each point, the first point at the same place, which is itself if there is none before it. Only these first
    /// points are corners, and all of them are.
    pub first_at_place: Vec<u32>,
}

impl DelaunayTetrahedra {
    /// The neighbour of a facet of the hull.
    pub const OUTSIDE: u32 = u32::MAX;
}

/// Why points have no Delaunay tetrahedra.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DelaunayError {
    /// Fewer than four places.
    #[error("a volume needs at least 4 points at different places, but there are only {distinct}")]
    TooFewPoints {
        /// How many different places there are.
        distinct: usize,
    },
    /// All points are on one line.
    #[error("all points are exactly on one line; a volume needs points off it")]
    Collinear,
    /// All points are in one plane.
    #[error("all points are exactly in one plane; a volume needs points off it")]
    Coplanar,
    /// A coordinate is NaN or infinite.
    #[error("point {point} has a coordinate that is not a finite number")]
    NotFinite {
        /// Zero-based point.
        point: usize,
    },
    /// A coordinate is so close to zero, compared to the largest, that signs could not be exact.
    #[error(
        "point {point} has a coordinate that is not zero but 1e-103 times smaller than the largest; set it to zero"
    )]
    TooFine {
        /// Zero-based point.
        point: usize,
    },
    /// More points than 32-bit indices can address.
    #[error("{points} points are more than 32-bit indices can address; use fewer")]
    TooManyPoints {
        /// How many points there are.
        points: usize,
    },
    /// The number of tetrahedra can grow with the square of the number of points, and would fill the memory.
    #[error("the points, perhaps on a few lines, need more than {most} tetrahedra; use fewer points")]
    TooManyTetrahedra {
        /// How many tetrahedra are allowed for this number of points.
        most: usize,
    },
    /// The progress callback asked to stop.
    #[error("the Delaunay tetrahedralisation was cancelled")]
    Cancelled,
}

/// The Delaunay tetrahedra of n×3 `points`, in any unit.
///
/// The same points give the same tetrahedra, on any number of threads. `progress` receives the fraction of points done
/// every few thousand points; see [`Progress`]. Time is near-linear for points of surfaces and volumes; points on a few
/// lines can need a number of tetrahedra that grows with the square of the number of points, and more than 32 per point
/// plus four million are refused.
pub fn delaunay_tetrahedra(points: &[[f64; 3]], progress: Progress<'_>) -> Result<DelaunayTetrahedra, DelaunayError> {
    let Bulk { triangulation, name, first_at_place, .. } =
        triangulate(points, &mut stage(progress, "connecting points"))?;
    let (tetrahedra, neighbours) = inside(&triangulation, &name);
    Ok(DelaunayTetrahedra { tetrahedra, neighbours, first_at_place })
}

/// A triangulation of many points that can still grow and change.
pub(crate) struct Bulk {
    /// Numbers its points in the order of insertion.
    pub(crate) triangulation: Triangulation,
    /// For each point of the triangulation, the first given point at its place.
    pub(crate) name: Vec<u32>,
    /// As in [`DelaunayTetrahedra`].
    pub(crate) first_at_place: Vec<u32>,
    /// Its coordinates are the given ones times two to this power.
    pub(crate) shift: i32,
}

/// As [`delaunay_tetrahedra`].
pub(crate) fn triangulate(
    points: &[[f64; 3]],
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Bulk, DelaunayError> {
    if points.len() > MOST_POINTS {
        return Err(DelaunayError::TooManyPoints { points: points.len() });
    }
    let most =
        (MOST_PER_POINT.saturating_mul(points.len()).saturating_add(MOST_FOR_FEW_POINTS)).min(u32::MAX as usize - 1);
    let (scaled, shift) = scaled_into_range(points)?;
    let mut order = insertion_order(&scaled);
    put_tetrahedron_first(&mut order, &scaled)?;
    let sorted: Vec<[f64; 3]> = order.iter().map(|&index| scaled[index as usize]).collect();
    drop(scaled);
    let mut triangulation = Triangulation::new(sorted, [0, 1, 2, 3], most);
    let mut first_at_place: Vec<u32> = (0..points.len() as u32).collect();
    // Of points at the same place, the one with the lowest index is used, whichever was inserted first.
    let mut name = order.clone();
    for position in 4..order.len() {
        if position % REPORT_EVERY == 0 && progress(position as f64 / order.len() as f64).is_break() {
            return Err(DelaunayError::Cancelled);
        }
        match triangulation.insert(position as u32) {
            Inserted::Yes => {}
            Inserted::DuplicateOf(twin) => {
                let twin = twin as usize;
                first_at_place[order[position] as usize] = order[twin];
                name[twin] = name[twin].min(order[position]);
            }
            Inserted::Full => return Err(DelaunayError::TooManyTetrahedra { most }),
        }
    }
    let mut name_of = vec![0; points.len()];
    for (position, &index) in order.iter().enumerate() {
        name_of[index as usize] = name[position];
    }
    for first in &mut first_at_place {
        *first = name_of[*first as usize];
    }
    Ok(Bulk { triangulation, name, first_at_place, shift })
}

/// Times a power of two, so that nothing is rounded, to where all signs are exact.
fn scaled_into_range(points: &[[f64; 3]]) -> Result<(Vec<[f64; 3]>, i32), DelaunayError> {
    if let Some(point) = points.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        return Err(DelaunayError::NotFinite { point });
    }
    let largest = points.iter().flatten().fold(0.0, |most: f64, c| most.max(c.abs()));
    if largest == 0.0 {
        return Err(DelaunayError::TooFewPoints { distinct: points.len().min(1) });
    }
    let shift = LARGEST_EXPONENT - libm::ilogb(largest);
    let scaled: Vec<[f64; 3]> = points.iter().map(|p| p.map(|c| libm::scalbn(c, shift))).collect();
    let too_fine = |(p, s): (&[f64; 3], &[f64; 3])| (0..3).any(|k| p[k] != 0.0 && s[k].abs() < SMALLEST_COORDINATE);
    match points.iter().zip(&scaled).position(too_fine) {
        Some(point) => Err(DelaunayError::TooFine { point }),
        None => Ok((scaled, shift)),
    }
}

/// Moves four points that make a positively oriented tetrahedron to the front of the order.
fn put_tetrahedron_first(order: &mut [u32], points: &[[f64; 3]]) -> Result<(), DelaunayError> {
    let at = |index: u32| &points[index as usize];
    let flat = |order: &[u32], why: DelaunayError| {
        let mut places: Vec<&[f64; 3]> = Vec::new();
        for &index in order {
            if places.len() < 4 && !places.contains(&at(index)) {
                places.push(at(index));
            }
        }
        if places.len() < 4 { DelaunayError::TooFewPoints { distinct: places.len() } } else { why }
    };
    for found in 1..4 {
        let more = (found..order.len()).find(|&k| match found {
            1 => !same_place(at(order[k]), at(order[0])),
            2 => !collinear(at(order[0]), at(order[1]), at(order[k])),
            _ => orientation(at(order[0]), at(order[1]), at(order[2]), at(order[k])) != 0.0,
        });
        let why = if found == 3 { DelaunayError::Coplanar } else { DelaunayError::Collinear };
        let Some(more) = more else { return Err(flat(order, why)) };
        order[found..=more].rotate_right(1);
    }
    if orientation(at(order[0]), at(order[1]), at(order[2]), at(order[3])) < 0.0 {
        order.swap(0, 1);
    }
    Ok(())
}

/// The tetrahedra without a corner at infinity, and what lies across their facets.
fn inside(triangulation: &Triangulation, name: &[u32]) -> (Vec<[u32; 4]>, Vec<[u32; 4]>) {
    let mut index_of = vec![DelaunayTetrahedra::OUTSIDE; triangulation.slots() as usize];
    let mut kept = Vec::new();
    for tet in 0..triangulation.slots() {
        if triangulation.is_alive(tet) && triangulation.infinite_slot(tet).is_none() {
            index_of[tet as usize] = kept.len() as u32;
            kept.push(tet);
        }
    }
    let corners = |&tet: &u32| triangulation.corners(tet).map(|corner| name[corner as usize]);
    let across = |&tet: &u32| triangulation.neighbours(tet).map(|other| index_of[other as usize]);
    (kept.iter().map(corners).collect(), kept.iter().map(across).collect())
}
