//! The tree of parts, assembled from its messages.

use std::collections::BTreeMap;

use firmware_protocol::{PartRecord as Part, TopologyChunk};

use crate::topology::{MAX_PARTS, Topology, TopologyProblem};

/// Assembles the messages of one description. What one answer lacks may come with the next, so that a long tree gets
/// through noise. Memory is only used for parts that have arrived.
#[derive(Clone, Debug, Default)]
pub(super) struct Assembly {
    epoch: u16,
    part_count: u16,
    parts: BTreeMap<u16, Part>,
}

impl Assembly {
    /// Takes a message; returns the checked tree if it was the last one. Another epoch or length starts over.
    pub(super) fn take(&mut self, chunk: &TopologyChunk<'_>) -> Option<Result<Topology, TopologyProblem>> {
        let part_count = usize::from(chunk.part_count);
        if part_count > MAX_PARTS {
            // The rest of this description is not worth keeping.
            *self = Self::default();
            return Some(Err(TopologyProblem::TooManyParts { part_count }));
        }
        if (chunk.epoch, chunk.part_count) != (self.epoch, self.part_count) {
            *self = Self { epoch: chunk.epoch, part_count: chunk.part_count, parts: BTreeMap::new() };
        }
        let numbered = (chunk.first_index..chunk.part_count).zip(chunk.records());
        self.parts.extend(numbered);
        if self.parts.len() < usize::from(self.part_count) {
            return None;
        }
        let parts = std::mem::take(&mut self.parts).into_values().collect();
        Some(Topology::new(self.epoch, parts))
    }
}
