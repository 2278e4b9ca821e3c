//! What is known about a hole.

/// A closed rim that passes no vertex twice.
#[derive(Clone, Debug, PartialEq)]
pub struct Hole {
    /// Its vertices (the first of those at one place), in the order in which triangles that close it run along it.
    pub rim: Vec<u32>,
    /// Length of the rim, mesh unit.
    pub length: f64,
    /// Mean of the rim's vertices.
    pub centre: [f64; 3],
    /// Vertices that it shares with other holes.
    pub touches: Vec<u32>,
    /// Why an artist may have meant it to be open; `None` if nothing speaks for that.
    pub meant: Option<Meant>,
}

/// Edges with one triangle that form no closed rim, because three or more triangles meet at an edge nearby.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BrokenRim {
    /// The vertices along it.
    pub vertices: Vec<u32>,
}

/// The openings of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Holes {
    /// Closed rims, the longest first.
    pub holes: Vec<Hole>,
    /// What cannot be filled.
    pub broken: Vec<BrokenRim>,
}

/// What speaks for leaving a hole open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Meant {
    /// It is the outer edge of a sheet, such as a cape or a leaf: its rim encloses about as much area as the sheet has.
    Sheet,
    /// The sheet whose outer edge it is lies in another hole, as an island.
    Island {
        /// Index of that hole.
        inside: usize,
    },
    /// Another hole is its mirror image, as the two sleeves of a coat or the eyes of a mask.
    Mirrored {
        /// Index of that hole.
        twin: usize,
    },
    /// Its rim is longer than the diagonal of its part's box, as the hem of a dress is.
    Large,
}

impl std::fmt::Display for Meant {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Sheet => write!(f, "the outer edge of an open sheet"),
            Self::Island { inside } => write!(f, "the edge of an island in hole {}", inside + 1),
            Self::Mirrored { twin } => write!(f, "the mirror image of hole {}", twin + 1),
            Self::Large => write!(f, "large for its part of the mesh"),
        }
    }
}
