//! Rotations of point handles that are only translated (thesis section 4.3.4, "Specifying handle transforms").
//!
//! The user connects point handles by pseudo-edges. When handles move, each turns by the average of the smallest
//! rotations that take its edges from their rest directions to their current ones. Fast and predictable;
//! [`ReducedArap`](crate::arap::ReducedArap) finds what the shape itself would do.
//!
//! ```
//! use armature_deform::pseudo_edges::{PseudoEdgeSpace, PseudoEdges};
//! use glam::{Affine3A, Vec3};
//!
//! // One of two handles moves: both turn as the edge between them does.
//! let mut edges = PseudoEdges::new(&[Vec3::ZERO, Vec3::X], &[[0, 1]], PseudoEdgeSpace::Plane)?;
//! let mut transforms = [Affine3A::IDENTITY; 2];
//! edges.transforms(&[Vec3::ZERO, Vec3::Y], &mut transforms)?;
//! assert!(transforms[0].transform_vector3(Vec3::X).distance(Vec3::Y) < 1e-6);
//! # Ok::<(), armature_deform::pseudo_edges::PseudoEdgeError>(())
//! ```

use glam::{Affine3A, DAffine3, DQuat, DVec3, Vec3};

/// Where handles move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PseudoEdgeSpace {
    /// In the plane of x and y (z is ignored): rotations are averaged as signed angles.
    Plane,
    /// In space: rotations are averaged as quaternions.
    Space,
}

/// Point handles at rest and the edges between them.
#[derive(Clone, Debug)]
pub struct PseudoEdges {
    rest: Vec<DVec3>,
    edges: Vec<[usize; 2]>,
    space: PseudoEdgeSpace,
    /// For each handle, the sum over its edges of angles (in `w`) or quaternions, and how many edges counted.
    sums: Vec<(DQuat, u32)>,
}

/// Why pseudo-edges give no rotations.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PseudoEdgeError {
    /// Two arrays that must have matching lengths do not.
    #[error("{what}: {got} given, {expected} needed")]
    Length {
        /// Which array.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The length it must have.
        expected: usize,
    },
    /// An edge refers to a handle that does not exist.
    #[error("pseudo-edge {edge} refers to handle {handle}, but there are only {handle_count} handles")]
    HandleOutOfRange {
        /// Zero-based edge.
        edge: usize,
        /// The offending zero-based handle.
        handle: usize,
        /// How many handles there are.
        handle_count: usize,
    },
    /// A handle is at a point that is NaN or infinite; nothing was written.
    #[error("handle {handle} is at a point that is not finite")]
    NotFinite {
        /// Zero-based handle.
        handle: usize,
    },
}

impl PseudoEdges {
    /// `rest`: m×3 points. `edges`: pairs of zero-based handles.
    pub fn new(rest: &[Vec3], edges: &[[usize; 2]], space: PseudoEdgeSpace) -> Result<Self, PseudoEdgeError> {
        check_points(rest)?;
        let handle_count = rest.len();
        for (edge, ends) in edges.iter().enumerate() {
            if let Some(&handle) = ends.iter().find(|handle| **handle >= handle_count) {
                return Err(PseudoEdgeError::HandleOutOfRange { edge, handle, handle_count });
            }
        }
        Ok(Self {
            rest: rest.iter().map(|point| point.as_dvec3()).collect(),
            edges: edges.to_vec(),
            space,
            sums: vec![(NOTHING, 0); handle_count],
        })
    }

    /// Writes each handle's `model_from_rest`: rotated about its own point, which moves to its place in `posed` (m×3).
    ///
    /// Edges that have no length, at rest or now, are ignored; a handle without any other edge keeps its rotation. An
    /// edge that is reversed turns about a perpendicular axis that depends only on the edge. Allocates nothing.
    pub fn transforms(&mut self, posed: &[Vec3], out: &mut [Affine3A]) -> Result<(), PseudoEdgeError> {
        let expected = self.rest.len();
        for (what, got) in [("posed handles", posed.len()), ("output transforms", out.len())] {
            if got != expected {
                return Err(PseudoEdgeError::Length { what, got, expected });
            }
        }
        check_points(posed)?;
        self.sums.fill((NOTHING, 0));
        for &[a, b] in &self.edges {
            let (rest, now) = (self.rest[b] - self.rest[a], posed[b].as_dvec3() - posed[a].as_dvec3());
            let told = match self.space {
                PseudoEdgeSpace::Plane => signed_angle(rest, now).map(|angle| DQuat::from_xyzw(0.0, 0.0, 0.0, angle)),
                PseudoEdgeSpace::Space => smallest_rotation(rest, now),
            };
            for handle in [a, b].into_iter().filter(|_| a != b) {
                if let Some(told) = told {
                    let (sum, count) = self.sums[handle];
                    self.sums[handle] = (sum + told, count + 1);
                }
            }
        }
        let handles = self.rest.iter().zip(posed).zip(&self.sums);
        for (out, ((rest, posed), (sum, count))) in out.iter_mut().zip(handles) {
            let turn = match self.space {
                _ if *count == 0 => DQuat::IDENTITY,
                PseudoEdgeSpace::Plane => DQuat::from_rotation_z(sum.w / f64::from(*count)),
                PseudoEdgeSpace::Space if sum.length() > 1e-9 => sum.normalize(),
                // Opposite half turns have no average.
                PseudoEdgeSpace::Space => DQuat::IDENTITY,
            };
            let moved = DAffine3::from_rotation_translation(turn, posed.as_dvec3() - turn * *rest);
            *out =
                Affine3A { matrix3: moved.matrix3.as_mat3().into(), translation: moved.translation.as_vec3().into() };
        }
        Ok(())
    }
}

const NOTHING: DQuat = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);

fn check_points(points: &[Vec3]) -> Result<(), PseudoEdgeError> {
    match points.iter().position(|point| !point.is_finite()) {
        Some(handle) => Err(PseudoEdgeError::NotFinite { handle }),
        None => Ok(()),
    }
}

/// From -π to π, about z.
fn signed_angle(from: DVec3, to: DVec3) -> Option<f64> {
    let (cross, dot) = (from.x * to.y - from.y * to.x, from.x * to.x + from.y * to.y);
    (cross != 0.0 || dot != 0.0).then(|| cross.atan2(dot))
}

/// Its scalar part is never negative, so that such rotations can be added.
fn smallest_rotation(from: DVec3, to: DVec3) -> Option<DQuat> {
    let (from, to) = (from.try_normalize()?, to.try_normalize()?);
    // Halfway between the two, or perpendicular if they are opposite.
    let half = (from + to).try_normalize().filter(|_| from.dot(to) > -1.0 + 1e-12);
    let half = half.unwrap_or_else(|| from.any_orthonormal_vector());
    let axis = from.cross(half);
    Some(DQuat::from_xyzw(axis.x, axis.y, axis.z, from.dot(half).max(0.0)).normalize())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn solved(rest: &[Vec3], edges: &[[usize; 2]], posed: &[Vec3], space: PseudoEdgeSpace) -> Vec<Affine3A> {
        let mut out = vec![Affine3A::IDENTITY; rest.len()];
        PseudoEdges::new(rest, edges, space).unwrap().transforms(posed, &mut out).unwrap();
        out
    }

    /// Numbers in [-1, 1), the same in every run.
    fn points(count: usize, seed: u64) -> Vec<Vec3> {
        let mut state = seed;
        let mut roll = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 40) as f32 / (1 << 23) as f32) - 1.0
        };
        (0..count).map(|_| Vec3::new(roll(), roll(), roll())).collect()
    }

    const STAR: [[usize; 2]; 5] = [[0, 1], [2, 0], [0, 3], [3, 4], [4, 1]];

    #[test]
    fn angles_in_the_plane_are_averaged_with_their_signs() {
        let (rest, posed) = (points(5, 1), points(5, 2));
        let transforms = solved(&rest, &STAR, &posed, PseudoEdgeSpace::Plane);
        for handle in 0..5 {
            // By polar angles, one minus the other.
            let mine = STAR.iter().filter(|edge| edge.contains(&handle));
            let angles: Vec<f64> = mine
                .map(|&[a, b]| {
                    let polar = |p: &[Vec3]| f64::from(p[b].y - p[a].y).atan2(f64::from(p[b].x - p[a].x));
                    let turned = polar(&posed) - polar(&rest);
                    (turned + 3.0 * PI).rem_euclid(2.0 * PI) - PI
                })
                .collect();
            let mean = angles.iter().sum::<f64>() / angles.len() as f64;
            let expected = Affine3A::from_rotation_z(mean as f32).matrix3;
            assert!(transforms[handle].matrix3.abs_diff_eq(expected, 1e-5), "{handle}: {angles:?}");
        }
    }

    #[test]
    fn rotations_in_space_are_averaged_as_quaternions() {
        let (rest, posed) = (points(5, 3), points(5, 4));
        let transforms = solved(&rest, &STAR, &posed, PseudoEdgeSpace::Space);
        for handle in 0..5 {
            let mut sum = NOTHING;
            for &[a, b] in STAR.iter().filter(|edge| edge.contains(&handle)) {
                // By axis and angle.
                let (from, to) = ((rest[b] - rest[a]).as_dvec3(), (posed[b] - posed[a]).as_dvec3());
                let axis = from.cross(to).normalize();
                let smallest = DQuat::from_axis_angle(axis, from.angle_between(to));
                assert!((smallest * from.normalize()).distance(to.normalize()) < 1e-9);
                sum += smallest;
            }
            let expected = Affine3A::from_quat(sum.normalize().as_quat()).matrix3;
            assert!(transforms[handle].matrix3.abs_diff_eq(expected, 1e-5), "{handle}");
            assert!(transforms[handle].transform_point3(rest[handle]).distance(posed[handle]) < 1e-6);
        }
    }

    #[test]
    fn a_plane_turned_as_a_whole_turns_every_handle() {
        let rest: Vec<Vec3> = points(5, 5).iter().map(|p| p.with_z(0.0)).collect();
        let motion = Affine3A::from_rotation_translation(glam::Quat::from_rotation_z(2.9), Vec3::new(3.0, 1.0, 0.0));
        let posed: Vec<Vec3> = rest.iter().map(|p| motion.transform_point3(*p)).collect();
        for space in [PseudoEdgeSpace::Plane, PseudoEdgeSpace::Space] {
            for transform in solved(&rest, &STAR, &posed, space) {
                assert!(transform.abs_diff_eq(motion, 1e-5), "{space:?}");
            }
        }
    }

    #[test]
    fn edges_that_tell_nothing_and_half_turns_are_survived() {
        let rest = [Vec3::ZERO, Vec3::X, Vec3::X, Vec3::NEG_X, Vec3::Y];
        let edges = [[0, 1], [1, 2], [0, 3], [2, 2]];
        let posed = [Vec3::ZERO, Vec3::NEG_X, Vec3::Y, Vec3::X, Vec3::Z];
        for space in [PseudoEdgeSpace::Plane, PseudoEdgeSpace::Space] {
            let transforms = solved(&rest, &edges, &posed, space);
            assert!(transforms.iter().all(Affine3A::is_finite));
            // Reversed.
            assert!(transforms[1].matrix3.x_axis.abs_diff_eq(glam::Vec3A::NEG_X, 1e-6), "{space:?}");
            // Without an edge of its own.
            assert!(transforms[4].matrix3.abs_diff_eq(glam::Mat3A::IDENTITY, 1e-9));
            assert_eq!(transforms[4].translation, Vec3::new(0.0, -1.0, 1.0).into());
        }
        let error = PseudoEdges::new(&rest, &[[0, 5]], PseudoEdgeSpace::Space).unwrap_err();
        assert_eq!(error, PseudoEdgeError::HandleOutOfRange { edge: 0, handle: 5, handle_count: 5 });
        let mut edges = PseudoEdges::new(&rest, &edges, PseudoEdgeSpace::Space).unwrap();
        let mut out = [Affine3A::IDENTITY; 5];
        let error = edges.transforms(&[Vec3::splat(f32::NAN); 5], &mut out).unwrap_err();
        assert_eq!(error, PseudoEdgeError::NotFinite { handle: 0 });
        assert!(matches!(edges.transforms(&posed[1..], &mut out), Err(PseudoEdgeError::Length { .. })));
    }
}
