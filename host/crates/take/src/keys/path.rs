//! The shortest way through the frames.

/// Keys are at most this many frames apart, so that a long rest does not cost the square of its length.
pub(super) const LONGEST: usize = 1024;

/// The steps from one frame.
#[derive(Debug)]
pub(super) struct Steps<'a> {
    /// The frame they start from.
    pub(super) from: usize,
    before: &'a mut [Option<usize>],
    next: &'a mut Vec<usize>,
}

impl Steps<'_> {
    /// The frames that one step may lead to.
    pub(super) fn candidates(&self) -> std::ops::RangeInclusive<usize> {
        self.from + 1..=(self.from + LONGEST).min(self.before.len() - 1)
    }

    /// Whether no step has led to this frame yet.
    pub(super) fn is_new(&self, to: usize) -> bool {
        self.before[to].is_none()
    }

    /// A step leads to this frame.
    pub(super) fn reach(&mut self, to: usize) {
        self.before[to] = Some(self.from);
        self.next.push(to);
    }
}

/// The fewest steps from the first frame to the last one: breadth first, so each frame is reached by as few steps as
/// possible before any is tried with more. `each` reports where single steps lead; the next frame must be among them.
pub(super) fn fewest_steps(frames: usize, each: &mut dyn FnMut(&mut Steps<'_>)) -> Vec<usize> {
    let Some(last) = frames.checked_sub(1) else { return Vec::new() };
    let mut before: Vec<Option<usize>> = vec![None; frames];
    let mut level = vec![0];
    while before[last].is_none() && last > 0 && !level.is_empty() {
        let mut next = Vec::new();
        // The frame that is furthest already needs the shortest steps.
        for &from in level.iter().rev() {
            each(&mut Steps { from, before: &mut before, next: &mut next });
        }
        next.sort_unstable();
        level = next;
    }
    let mut way = vec![last];
    while let Some(from) = before[way[way.len() - 1]] {
        way.push(from);
    }
    way.reverse();
    way
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_is_as_short_as_can_be_even_where_longer_steps_lead_nowhere() {
        // From 0 one can reach 1, 3 and 7; only from 1 to 8, and from there to the end.
        let edges = [(0, 1), (0, 3), (0, 7), (7, 9), (1, 8), (8, 12), (3, 5), (5, 6), (6, 12), (9, 10), (10, 12)];
        let way = fewest_steps(13, &mut |steps| {
            let from = steps.from;
            edges.iter().filter(|(a, _)| *a == from).for_each(|&(_, to)| {
                if steps.is_new(to) {
                    steps.reach(to);
                }
            });
        });
        assert_eq!(way, [0, 1, 8, 12]);
        assert!(fewest_steps(0, &mut |_| {}).is_empty());
        assert_eq!(fewest_steps(1, &mut |_| {}), [0]);
    }
}
