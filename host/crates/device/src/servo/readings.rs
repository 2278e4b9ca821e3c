//! Which readings of a servo's position are trusted.

use std::f64::consts::TAU;
use std::time::Duration;

use firmware_protocol::SensorState;

use crate::arm::COUNTS_PER_TURN;

/// Faster than a hand turns a joint, radians per second; a faster movement is trusted only when it is read twice. The
/// checksum byte of a Feetech status lets one damaged reading in 256 through.
const FASTEST_TURN: f64 = 40.0;
/// Additional allowed deviation of a reading, counts.
const UNLIKELY_MARGIN: f64 = 64.0;
/// After this long without a reading, any value is trusted.
const FORGOTTEN: Duration = Duration::from_millis(500);

#[derive(Clone, Copy, Debug, Default)]
struct Reading {
    /// The last trusted reading.
    last: Option<(Duration, u16)>,
    /// The reading since then that was not trusted.
    unlikely: Option<(Duration, u16)>,
}

/// The readings of each servo.
#[derive(Clone, Debug)]
pub(super) struct Readings {
    servos: Vec<Reading>,
}

impl Readings {
    pub(super) fn new(servos: usize) -> Self {
        Self { servos: vec![Reading::default(); servos] }
    }

    pub(super) fn len(&self) -> usize {
        self.servos.len()
    }

    /// Earlier readings of this servo no longer cast doubt on new ones.
    pub(super) fn forget_doubt(&mut self, servo: usize) {
        self.servos[servo].unlikely = None;
    }

    pub(super) fn forget_doubts(&mut self) {
        (0..self.servos.len()).for_each(|servo| self.forget_doubt(servo));
    }

    /// The last trusted reading, counts.
    pub(super) fn last(&self, servo: usize) -> Option<u16> {
        self.servos[servo].last.map(|(_, counts)| counts)
    }

    /// Marks a reading that no hand could have caused, unless the next one confirms it.
    pub(super) fn judge(&mut self, servo: usize, now: Duration, counts: u16) -> SensorState {
        let turn = f64::from(COUNTS_PER_TURN);
        let reachable = |from: &(Duration, u16)| {
            let seconds = now.saturating_sub(from.0);
            let apart = (f64::from(counts) - f64::from(from.1)).rem_euclid(turn);
            let allowed = UNLIKELY_MARGIN + FASTEST_TURN / TAU * turn * seconds.as_secs_f64();
            seconds > FORGOTTEN || apart.min(turn - apart) <= allowed
        };
        let known = &mut self.servos[servo];
        let believed = known.last.as_ref().is_none_or(reachable) || known.unlikely.as_ref().is_some_and(reachable);
        if believed {
            *known = Reading { last: Some((now, counts)), unlikely: None };
            SensorState::Ok
        } else {
            known.unlikely = Some((now, counts));
            SensorState::Outlier
        }
    }
}
