//! Where the surface is, and what it encloses.

use crate::search::TriangleHierarchy;
use crate::winding::FastWindingNumber;

/// What the winding number and distances are taken from.
pub(super) struct Field {
    pub(super) surface: TriangleHierarchy,
    pub(super) winding: FastWindingNumber,
}
