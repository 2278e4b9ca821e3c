//! A part that comes back blends its bone from the current rotation to its reading, instead of jumping.

use glam::{DQuat, Quat};

/// The blend of one part. It runs on the device's clock, so that a replay does the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Engagement {
    from: Quat,
    /// How long it takes, microseconds, where that is not the same as for all.
    own_micros: Option<u32>,
    /// The device's clock at the first sample with good readings since the part came back.
    since: Option<u64>,
}

impl Engagement {
    /// Starts with the next sample whose readings are good.
    pub(super) fn from(shown: Quat) -> Self {
        Self { from: shown, own_micros: None, since: None }
    }

    /// Takes this long, microseconds.
    pub(super) fn over(self, micros: u32) -> Self {
        Self { own_micros: Some(micros), ..self }
    }

    /// The rotation to show instead of the measured one at this time of the device's clock; `None` when the blend is
    /// over. `is_good`: whether every reading of the part is good.
    pub(super) fn shown(&mut self, measured: Quat, is_good: bool, micros: u64, over_micros: u32) -> Option<Quat> {
        if self.since.is_none() && !is_good {
            return Some(self.from);
        }
        let since = *self.since.get_or_insert(micros);
        // A clock that has gone back means that the device restarted.
        let elapsed = micros.checked_sub(since).unwrap_or_else(|| {
            self.since = Some(micros);
            0
        });
        let at = elapsed as f64 / f64::from(self.own_micros.unwrap_or(over_micros));
        (at < 1.0).then(|| between(self.from, measured, at * at * (3.0 - 2.0 * at)))
    }
}

/// The rotation at the fraction `at` of the shortest path from one rotation to another.
fn between(from: Quat, to: Quat, at: f64) -> Quat {
    let (a, mut b) = (from.as_dquat(), to.as_dquat());
    if a.dot(b) < 0.0 {
        b = -b;
    }
    // The angle between the two, well conditioned at both ends.
    let half = libm::atan2((b - a).length(), (b + a).length());
    let whole = 2.0 * half;
    let sin = libm::sin(whole);
    if sin < 1e-9 {
        return to;
    }
    let mixed = a * (libm::sin((1.0 - at) * whole) / sin) + b * (libm::sin(at * whole) / sin);
    DQuat::normalize(mixed).as_quat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_begins_at_one_end_and_ends_at_the_other() {
        let (from, to) = (Quat::from_rotation_x(0.2), Quat::from_rotation_y(1.4));
        let mut way = Engagement::from(from);
        let first = way.shown(to, true, 5_000, 250_000).unwrap();
        assert!(first.angle_between(from) < 1e-3);
        let mut before = first;
        let mut way_gone = 0.0;
        for micros in (10_000..255_000).step_by(5_000) {
            let shown = way.shown(to, true, micros, 250_000).unwrap();
            let step = shown.angle_between(before);
            assert!(step < 1.6 * from.angle_between(to) * 5.0 / 250.0 + 1e-3, "{step}");
            (way_gone, before) = (way_gone + step, shown);
        }
        assert!(before.angle_between(to) < 2e-3);
        assert!((way_gone - from.angle_between(to)).abs() < 0.05, "the shortest path");
        assert_eq!(way.shown(to, true, 255_000, 250_000), None);
    }

    #[test]
    fn the_same_rotation_written_the_other_way_is_no_way_at_all() {
        let (from, to) = (Quat::from_rotation_x(0.7), -Quat::from_rotation_x(0.7));
        let mut way = Engagement::from(from);
        way.shown(to, true, 0, 100);
        let shown = way.shown(to, true, 50, 100).unwrap();
        assert!(shown.dot(from).abs() > 1.0 - 1e-6);
    }

    #[test]
    fn a_clock_that_starts_anew_starts_the_way_anew() {
        let mut way = Engagement::from(Quat::IDENTITY);
        let to = Quat::from_rotation_x(1.0);
        way.shown(to, true, 9_000_000, 250_000);
        assert!(way.shown(to, true, 100, 250_000).is_some());
        assert_eq!(way.shown(to, true, 300_000, 250_000), None);
    }
}
