//! What is known about the parts, and the samples that wait for more.

use std::collections::VecDeque;

use firmware_protocol::TopologyChunk;

use super::assembly::Assembly;
use super::silence::Silence;
use crate::events::{DeviceProblem, Event, Sample, SessionCounters};
use crate::topology::{Topology, TopologyProblem};

/// Most samples kept while their topology is on its way; at 1,000 Hz the last two seconds.
const MAX_WITHHELD: usize = 2_000;
/// A device whose samples matched none of this many answers cannot be understood.
const MISFITS: u32 = 4;

/// The tree of parts, as far as known.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    known: Option<Topology>,
    assembly: Assembly,
    wanted: bool,
    /// Whether the current trouble with the tree has been reported.
    complained: bool,
    /// Samples of an epoch whose topology is on its way.
    withheld: VecDeque<Sample>,
    /// Answers in a row that matched none of the samples waiting for them.
    misfits: u32,
    silence: Silence,
}

/// What became of a complete description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Description {
    /// The tree is known now.
    Taken,
    /// The same, but it repeatedly matches none of the samples.
    Misfit,
    /// No puppet can be plugged together like that.
    Impossible,
}

impl Tree {
    pub(super) fn known(&self) -> Option<&Topology> {
        self.known.as_ref()
    }

    /// Whether it has to be requested.
    pub(super) fn is_wanted(&self) -> bool {
        self.wanted
    }

    /// It has to be requested.
    pub(super) fn want(&mut self) {
        self.wanted = true;
    }

    /// The device reports that this epoch applies from now on.
    pub(super) fn changed(&mut self, epoch: u16) {
        self.wanted |= self.known.as_ref().is_none_or(|known| known.epoch != epoch);
    }

    /// Takes a message of a description; `None` while more of it is to come.
    pub(super) fn describe(
        &mut self,
        chunk: &TopologyChunk<'_>,
        counters: &mut SessionCounters,
        events: &mut Vec<Event>,
    ) -> Option<Description> {
        Some(match self.assembly.take(chunk)? {
            Ok(topology) => self.take(topology, counters, events),
            Err(problem) => self.complain(problem, events),
        })
    }

    fn take(&mut self, topology: Topology, counters: &mut SessionCounters, events: &mut Vec<Event>) -> Description {
        self.wanted = false;
        self.complained = false;
        if self.known.as_ref() != Some(&topology) {
            events.push(Event::Topology(topology.clone()));
            self.silence.begin(&topology);
            self.known = Some(topology);
        }
        let withheld = std::mem::take(&mut self.withheld);
        let Some(latest) = withheld.back().map(|sample| sample.epoch) else { return Description::Taken };
        let before = counters.samples;
        for sample in withheld {
            self.lay_out(sample, counters, events);
        }
        self.count_misfits(latest, counters.samples == before, events)
    }

    fn complain(&mut self, problem: TopologyProblem, events: &mut Vec<Event>) -> Description {
        if !std::mem::replace(&mut self.complained, true) {
            events.push(Event::Problem(problem.into()));
        }
        Description::Impossible
    }

    /// Samples of this epoch have waited for the tree that has now arrived. If repeatedly none of them matches it, the
    /// tree is requested less often.
    fn count_misfits(&mut self, sample: u16, none_fits: bool, events: &mut Vec<Event>) -> Description {
        let tree = self.known.as_ref().map_or(sample, |known| known.epoch);
        self.misfits = if none_fits && tree != sample { self.misfits.saturating_add(1) } else { 0 };
        if self.misfits == MISFITS {
            events.push(Event::Problem(DeviceProblem::UnknownEpoch { sample, tree }));
        }
        if self.misfits >= MISFITS { Description::Misfit } else { Description::Taken }
    }

    /// Delivers a sample, or keeps it until its tree is known.
    pub(super) fn sample(&mut self, sample: Sample, counters: &mut SessionCounters, events: &mut Vec<Event>) {
        if self.known.as_ref().is_some_and(|known| known.epoch == sample.epoch) {
            self.lay_out(sample, counters, events);
            return;
        }
        self.wanted = true;
        if self.withheld.len() == MAX_WITHHELD
            && let Some(oldest) = self.withheld.pop_front()
        {
            lose(1, oldest.sequence, counters, events);
        }
        self.withheld.push_back(sample);
    }

    /// Delivers a sample if it matches the tree.
    fn lay_out(&mut self, sample: Sample, counters: &mut SessionCounters, events: &mut Vec<Event>) {
        let Some(topology) = &self.known else { return };
        if topology.epoch == sample.epoch && topology.sensor_count == sample.counts.len() {
            counters.samples += 1;
            self.misfits = 0;
            self.silence.observe(topology, &sample, events);
            events.push(Event::Sample(sample));
            return;
        }
        lose(1, sample.sequence, counters, events);
        self.wanted = true;
        if topology.epoch == sample.epoch && !std::mem::replace(&mut self.complained, true) {
            let (expected, found) = (topology.sensor_count, sample.counts.len());
            let problem = DeviceProblem::SampleDoesNotFit { epoch: sample.epoch, expected, found };
            events.push(Event::Problem(problem));
        }
    }

    /// Drops the samples that wait.
    pub(super) fn drop_withheld(&mut self, counters: &mut SessionCounters, events: &mut Vec<Event>) {
        if let Some(latest) = self.withheld.back().map(|sample| sample.sequence) {
            lose(self.withheld.len() as u32, latest, counters, events);
        }
        self.withheld.clear();
    }
}

/// So many samples that arrived cannot be used, this one last.
fn lose(count: u32, latest: u32, counters: &mut SessionCounters, events: &mut Vec<Event>) {
    counters.unusable_samples += u64::from(count);
    counters.lost_samples += u64::from(count);
    events.push(Event::Lost { count, next_sequence: latest.wrapping_add(1) });
}
