//! Tracking the sequence numbers and the clock of samples.

/// A sample at most this far behind the last one is a repeat; one further behind means the device restarted.
const DUPLICATES_WITHIN: u32 = 64;
/// The same by its clock, µs.
const DUPLICATES_WITHIN_MICROS: u64 = 1_000_000;

/// What a sample's sequence number means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Followed {
    /// It is the expected one.
    Next,
    /// This many are missing before it.
    After(u32),
    /// It arrived before.
    Duplicate,
    /// The device has restarted.
    Restarted,
}

/// The expected number, and the clock of the last sample.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SequenceFollower {
    awaited: u32,
    last_micros: Option<u64>,
}

impl SequenceFollower {
    /// Classifies the next sample.
    pub(super) fn follow(&mut self, sequence: u32, device_micros: u64) -> Followed {
        let ahead = sequence.wrapping_sub(self.awaited);
        let behind = self.awaited.wrapping_sub(sequence);
        let Some(last) = self.last_micros else {
            return self.accept(sequence, device_micros, ahead);
        };
        let came_before = (1..=DUPLICATES_WITHIN).contains(&behind) && device_micros <= last;
        if came_before && last - device_micros < DUPLICATES_WITHIN_MICROS {
            Followed::Duplicate
        } else if device_micros < last || ahead > u32::MAX / 2 {
            Followed::Restarted
        } else {
            self.accept(sequence, device_micros, ahead)
        }
    }

    fn accept(&mut self, sequence: u32, device_micros: u64, ahead: u32) -> Followed {
        self.awaited = sequence.wrapping_add(1);
        self.last_micros = Some(device_micros);
        if ahead == 0 { Followed::Next } else { Followed::After(ahead) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_counted_and_numbers_wrap() {
        let mut follower = SequenceFollower::default();
        assert_eq!(follower.follow(2, 100), Followed::After(2), "the first number after a start is 0");
        assert_eq!(follower.follow(3, 200), Followed::Next);
        assert_eq!(follower.follow(10, 900), Followed::After(6));
        let mut follower = SequenceFollower { awaited: u32::MAX, last_micros: Some(5) };
        assert_eq!(follower.follow(u32::MAX, 6), Followed::Next);
        assert_eq!(follower.follow(0, 7), Followed::Next);
        assert_eq!(follower.follow(2, 8), Followed::After(1));
    }

    #[test]
    fn a_sample_come_again_is_no_restart_and_a_restart_is_no_repetition() {
        let mut follower = SequenceFollower { awaited: 1_000, last_micros: Some(9_000_000) };
        assert_eq!(follower.follow(999, 9_000_000), Followed::Duplicate);
        assert_eq!(follower.follow(990, 8_991_000), Followed::Duplicate);
        assert_eq!(follower.follow(1_000, 9_001_000), Followed::Next);
        assert_eq!(follower.follow(0, 2_000), Followed::Restarted);
        assert_eq!(follower.follow(1_001, 100), Followed::Restarted, "its clock alone has gone back");
        let mut young = SequenceFollower { awaited: 5, last_micros: Some(9_000_000) };
        assert_eq!(young.follow(0, 3_000), Followed::Restarted);
    }
}
