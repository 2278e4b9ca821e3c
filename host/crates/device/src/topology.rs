//! The tree of parts, checked.

use std::collections::BTreeSet;

use firmware_protocol::{MAX_SENSORS, PartKind, PartRecord as Part, PartUid};

/// Most parts a puppet may have; far beyond any real one, and few enough to be checked in no time.
pub const MAX_PARTS: usize = 4_096;

/// The tree of parts in one epoch.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    /// Number of this state of the tree; samples carry it.
    pub epoch: u16,
    /// The parts, parents before children; the first is the root. A puppet may have none.
    pub parts: Vec<Part>,
    /// Number of sensors of all parts: the length of a sample. They are numbered part by part, inlet to outlet.
    pub sensor_count: usize,
}

/// Why a list of parts is not a puppet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TopologyProblem {
    /// The first part has a parent.
    #[error("the first part is plugged into another one and so cannot be the root")]
    NoRoot,
    /// A part other than the first has no parent.
    #[error("part {part} is not plugged into anything, but only the first part may be the root")]
    SecondRoot {
        /// Zero-based part.
        part: usize,
    },
    /// A parent does not come before its child.
    #[error("part {part} is plugged into part {parent}, which does not come before it")]
    ParentAfterChild {
        /// Zero-based part.
        part: usize,
        /// The parent it states.
        parent: usize,
    },
    /// An outlet that the parent does not have.
    #[error("part {part} is in outlet {outlet} of part {parent}, which has {outlet_count} outlets")]
    NoSuchOutlet {
        /// Zero-based part.
        part: usize,
        /// The parent it states.
        parent: usize,
        /// The outlet it states.
        outlet: u8,
        /// Outlets of the parent.
        outlet_count: u8,
    },
    /// Two parts in the same outlet.
    #[error("part {part} is in outlet {outlet} of part {parent}, which is already taken")]
    OutletTaken {
        /// Zero-based part.
        part: usize,
        /// The parent it states.
        parent: usize,
        /// The outlet it states.
        outlet: u8,
    },
    /// Two parts with the same number.
    #[error("two parts have the number {uid}")]
    DuplicateUid {
        /// The number.
        uid: PartUid,
    },
    /// A part of a known kind with a number of sensors or outlets that this kind does not have.
    #[error("part {part} ({kind:?}) states {sensor_count} sensors and {outlet_count} outlets")]
    WrongShape {
        /// Zero-based part.
        part: usize,
        /// Its kind.
        kind: PartKind,
        /// The sensors it states.
        sensor_count: u8,
        /// The outlets it states.
        outlet_count: u8,
    },
    /// An impossible resolution.
    #[error("part {part} has {counts_per_turn} counts per turn; 2 to 65536 are possible")]
    BadResolution {
        /// Zero-based part.
        part: usize,
        /// What it states.
        counts_per_turn: u32,
    },
    /// More parts than anyone can have plugged together.
    #[error("it claims to have {part_count} parts; {MAX_PARTS} are possible")]
    TooManyParts {
        /// How many.
        part_count: usize,
    },
    /// More sensors than a sample holds.
    #[error("the parts have {sensor_count} sensors in total; a sample holds {MAX_SENSORS}")]
    TooManySensors {
        /// How many.
        sensor_count: usize,
    },
}

impl Topology {
    /// Checks a list of parts.
    pub fn new(epoch: u16, parts: Vec<Part>) -> Result<Self, TopologyProblem> {
        if parts.len() > MAX_PARTS {
            return Err(TopologyProblem::TooManyParts { part_count: parts.len() });
        }
        let mut uids = BTreeSet::new();
        let mut outlets = BTreeSet::new();
        let mut sensor_count = 0;
        for (index, part) in parts.iter().enumerate() {
            check_shape(index, part)?;
            match part.parent.map(usize::from) {
                None if index > 0 => return Err(TopologyProblem::SecondRoot { part: index }),
                None => {}
                Some(_) if index == 0 => return Err(TopologyProblem::NoRoot),
                Some(parent) if parent >= index => {
                    return Err(TopologyProblem::ParentAfterChild { part: index, parent });
                }
                Some(parent) => {
                    let (outlet, outlet_count) = (part.outlet, parts[parent].outlet_count);
                    if outlet >= outlet_count {
                        return Err(TopologyProblem::NoSuchOutlet { part: index, parent, outlet, outlet_count });
                    }
                    if !outlets.insert((parent, outlet)) {
                        return Err(TopologyProblem::OutletTaken { part: index, parent, outlet });
                    }
                }
            }
            if !uids.insert(part.uid) {
                return Err(TopologyProblem::DuplicateUid { uid: part.uid });
            }
            sensor_count += usize::from(part.sensor_count);
        }
        if sensor_count > MAX_SENSORS {
            return Err(TopologyProblem::TooManySensors { sensor_count });
        }
        Ok(Self { epoch, parts, sensor_count })
    }
}

/// What each known kind has; an unknown one may have anything.
fn check_shape(index: usize, part: &Part) -> Result<(), TopologyProblem> {
    let outlets_fit = match part.kind {
        PartKind::Bend | PartKind::Twist | PartKind::TwistBendTwist => part.outlet_count == 1,
        PartKind::Splitter => (1..=5).contains(&part.outlet_count),
        PartKind::Other(_) => true,
    };
    if !outlets_fit || part.kind.sensor_count().is_some_and(|count| count != part.sensor_count) {
        let Part { kind, sensor_count, outlet_count, .. } = *part;
        return Err(TopologyProblem::WrongShape { part: index, kind, sensor_count, outlet_count });
    }
    if part.sensor_count > 0 && !(2..=65_536).contains(&part.counts_per_turn) {
        return Err(TopologyProblem::BadResolution { part: index, counts_per_turn: part.counts_per_turn });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(kind: PartKind, parent: Option<u16>, outlet: u8, number: u8) -> Part {
        let outlet_count = if kind == PartKind::Splitter { 3 } else { 1 };
        let sensor_count = kind.sensor_count().unwrap_or(7);
        Part { kind, sensor_count, outlet, outlet_count, parent, uid: PartUid([number; 12]), counts_per_turn: 4_096 }
    }

    fn tree() -> Vec<Part> {
        vec![
            part(PartKind::Splitter, None, 0, 0),
            part(PartKind::TwistBendTwist, Some(0), 0, 1),
            part(PartKind::Other(77), Some(0), 2, 2),
            part(PartKind::Bend, Some(2), 0, 3),
        ]
    }

    #[test]
    fn sensors_of_unknown_kinds_count_too() {
        assert_eq!(Topology::new(1, tree()).map(|tree| tree.sensor_count), Ok(3 + 7 + 1));
        assert_eq!(Topology::new(1, vec![]), Ok(Topology { epoch: 1, parts: vec![], sensor_count: 0 }));
    }

    #[test]
    fn trees_that_cannot_be_are_named() {
        let spoilt = |spoil: fn(&mut Vec<Part>)| {
            let mut parts = tree();
            spoil(&mut parts);
            Topology::new(0, parts).expect_err("spoilt")
        };
        assert_eq!(spoilt(|p| p[0].parent = Some(0)), TopologyProblem::NoRoot);
        assert_eq!(spoilt(|p| p[2].parent = None), TopologyProblem::SecondRoot { part: 2 });
        assert_eq!(spoilt(|p| p[2].parent = Some(2)), TopologyProblem::ParentAfterChild { part: 2, parent: 2 });
        assert_eq!(spoilt(|p| p[2].outlet = 0), TopologyProblem::OutletTaken { part: 2, parent: 0, outlet: 0 });
        assert_eq!(spoilt(|p| p[3].uid = p[1].uid), TopologyProblem::DuplicateUid { uid: PartUid([1; 12]) });
        assert_eq!(
            spoilt(|p| p[2].outlet = 3),
            TopologyProblem::NoSuchOutlet { part: 2, parent: 0, outlet: 3, outlet_count: 3 }
        );
        assert!(matches!(spoilt(|p| p[1].sensor_count = 2), TopologyProblem::WrongShape { part: 1, .. }));
        assert!(matches!(spoilt(|p| p[0].outlet_count = 6), TopologyProblem::WrongShape { part: 0, .. }));
        assert!(matches!(spoilt(|p| p[3].counts_per_turn = 1), TopologyProblem::BadResolution { part: 3, .. }));
        let many = spoilt(|p| {
            p[2].sensor_count = 255;
            p[3] = Part { sensor_count: 255, ..part(PartKind::Other(9), Some(2), 0, 3) };
        });
        assert_eq!(many, TopologyProblem::TooManySensors { sensor_count: 513 });
    }
}
