//! What happens when, without the host's doing.

use crate::faults::Faults;

/// Something that happens at a set time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Event {
    NoiseBegins,
    NoiseEnds,
    Unplug(usize),
    PlugIn(usize),
    Restart,
}

/// Events in order, by microseconds since the emulation's first step.
#[derive(Clone, Debug)]
pub(super) struct Timeline {
    /// Latest first.
    events: Vec<(u64, Event)>,
}

impl Timeline {
    pub(super) fn new(faults: &Faults) -> Self {
        let mut events = Vec::new();
        // Bursts that touch or overlap are one.
        let mut bursts: Vec<(u64, u64)> =
            faults.noise.iter().map(|n| (n.start_micros, n.start_micros.saturating_add(n.duration_micros))).collect();
        bursts.sort_unstable();
        let mut merged: Vec<(u64, u64)> = Vec::new();
        for (start, end) in bursts {
            match merged.last_mut() {
                Some(last) if start <= last.1 => last.1 = last.1.max(end),
                _ => merged.push((start, end)),
            }
        }
        for (start, end) in merged {
            events.push((start, Event::NoiseBegins));
            events.push((end, Event::NoiseEnds));
        }
        for unplugging in &faults.unplugged {
            events.push((unplugging.at_micros, Event::Unplug(unplugging.part)));
            if let Some(duration) = unplugging.for_micros {
                events.push((unplugging.at_micros.saturating_add(duration), Event::PlugIn(unplugging.part)));
            }
        }
        events.extend(faults.restarts.iter().map(|&at| (at, Event::Restart)));
        // Of events at the same time, the first listed comes last here, so that it is taken first.
        events.reverse();
        events.sort_by_key(|(at, _)| std::cmp::Reverse(*at));
        Self { events }
    }

    pub(super) fn next_micros(&self) -> Option<u64> {
        self.events.last().map(|(at, _)| *at)
    }

    pub(super) fn take(&mut self) -> Option<Event> {
        self.events.pop().map(|(_, event)| event)
    }
}
