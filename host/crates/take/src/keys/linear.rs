//! The fewest keys for straight lines between them.

use glam::DVec3;

use super::curve::Curve;
use super::path::fewest_steps;

/// The frames that become keys: as few as any choice of frames allows with which every frame is within `bound` of the
/// line (or arc) between its neighbours, as long as keys are at most [`LONGEST`](super::path::LONGEST) frames apart.
pub(super) fn fewest_linear_keys(curve: &impl Curve, bound: f64) -> Vec<usize> {
    fewest_steps(curve.len(), &mut |steps| {
        let (from, mut corridor) = (steps.from, Corridor::default());
        let mut worst = from + 1;
        for to in steps.candidates() {
            if steps.is_new(to) && stays_near(curve, from, to, bound, &mut worst) {
                steps.reach(to);
            }
            if corridor.narrow(curve, from, to, bound).is_none() {
                return;
            }
        }
    })
}

/// Whether all frames between two keys are near enough; the one that was not is asked first the next time.
fn stays_near(curve: &impl Curve, from: usize, to: usize, bound: f64, worst: &mut usize) -> bool {
    let near = |frame: usize| curve.distance(curve.between(from, to, curve.part(from, to, frame)), frame) <= bound;
    if (from + 1..to).contains(worst) && !near(*worst) {
        return false;
    }
    match (from + 1..to).find(|&frame| !near(frame)) {
        Some(far) => {
            *worst = far;
            false
        }
        None => true,
    }
}

/// Velocities with which a line from the first key could still pass all frames so far: once there are none, no later
/// key can be reached. A box, which is never too small.
#[derive(Debug)]
struct Corridor {
    low: DVec3,
    high: DVec3,
}

impl Default for Corridor {
    fn default() -> Self {
        Self { low: DVec3::NEG_INFINITY, high: DVec3::INFINITY }
    }
}

impl Corridor {
    fn narrow(&mut self, curve: &impl Curve, from: usize, to: usize, bound: f64) -> Option<()> {
        let Some((step, slack)) = curve.step(from, to, bound) else { return Some(()) };
        let time = curve.times()[to] - curve.times()[from];
        self.low = self.low.max((step - DVec3::splat(slack)) / time);
        self.high = self.high.min((step + DVec3::splat(slack)) / time);
        // A little more than nothing, for what is lost in rounding.
        let room = self.high - self.low + DVec3::splat(1e-9);
        room.cmpge(DVec3::ZERO).all().then_some(())
    }
}
