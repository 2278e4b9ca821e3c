//! Roots that follow the foot on the floor.

use glam::{Affine3A, DVec2, DVec3, Vec3, Vec3Swizzles as _};

use super::settings::{Ground, GroundError, GroundMode, groups};
use crate::skeleton::{Pose, Skeleton};

/// A foot no higher above the floor than this share of the character's height, and slow, carries it.
pub const GROUND_TOUCHED: f64 = 0.012;
/// A foot that carries does so until it is higher than this share of the height.
pub const GROUND_LEFT: f64 = 0.02;
/// A foot that is slower than this carries, heights a second; one that carries does so up to three times this.
const SLOW: f64 = 0.5;
/// The point of a foot that stays in place changes when another is lower by this share of the height.
const LOWER: f64 = 0.003;
/// A foot that has come to carry takes over after this time, seconds: the next step leads away from it.
const TAKES_OVER: f64 = 0.03;
/// A foot that carries gives way to another one that does and is lower by this share of [`GROUND_TOUCHED`].
const GIVES_WAY: f64 = 0.25;
/// Speeds are averaged over this time, seconds.
const SPEED_SECONDS: f64 = 0.02;
/// Gaps between samples count as no longer than this, seconds.
const LONGEST_STEP: f64 = 0.05;
/// A standing character is on its spot within this share of its height.
const SPOT: f64 = 0.02;
/// How quickly a standing character glides back, 1/seconds (a critically damped spring).
const RETURN_RATE: f64 = 4.0;

/// One contact and what it does.
#[derive(Clone, Debug, Default)]
struct Foot {
    /// Its points among all.
    points: Vec<usize>,
    /// The lowest of them, which stays in place.
    point: usize,
    /// Above the floor, mesh units.
    height: f64,
    /// Of that point over the floor, mesh units a second.
    speed: f64,
    carries: bool,
    /// Since when, seconds.
    carried: f64,
}

/// Moves the roots of poses so that the foot that carries stays where it is and the lowest point is on the floor. Uses
/// the device's clock only, so that a replay repeats it; begins anew with [`restart`](Self::restart).
///
/// Places are continuous by construction: the height is that of the lowest point, and where another foot or another point
/// of it takes over, it stays where it is at that moment.
#[derive(Clone, Debug)]
pub struct GroundContact {
    ground: Ground,
    height: f64,
    roots: Vec<usize>,
    feet: Vec<Foot>,
    frames: Vec<Affine3A>,
    /// All points in model space, before the roots are moved.
    places: Vec<DVec3>,
    rest: Vec<DVec2>,
    /// Of each point over the floor, smoothed.
    averages: Vec<DVec2>,
    state: State,
}

/// What later poses depend on, besides the feet.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    micros: Option<u64>,
    offset: DVec3,
    /// The foot that the roots follow, and where its point stays.
    anchor: Option<(usize, DVec2)>,
    gliding: DVec2,
}

impl GroundContact {
    /// Prepares for a skeleton.
    pub fn new(skeleton: &Skeleton, ground: Ground) -> Result<Self, GroundError> {
        ground.check(skeleton)?;
        let groups = groups(skeleton, &ground.contacts)?;
        let of = |contact: usize| {
            let points = (0..ground.points.len()).filter(|&p| groups[ground.points[p].bone] == Some(contact));
            points.collect::<Vec<_>>()
        };
        let feet = (0..ground.contacts.len()).map(of).filter(|points| !points.is_empty());
        let feet = feet.map(|points| Foot { point: points[0], points, ..Foot::default() }).collect();
        let mut contact = Self {
            height: 1.0,
            roots: (0..skeleton.len()).filter(|&bone| skeleton.bones()[bone].parent.is_none()).collect(),
            feet,
            frames: vec![Affine3A::IDENTITY; skeleton.len()],
            places: vec![DVec3::ZERO; ground.points.len()],
            rest: Vec::new(),
            averages: vec![DVec2::ZERO; ground.points.len()],
            state: State::default(),
            ground,
        };
        contact.locate(skeleton, &skeleton.rest_pose());
        contact.rest = contact.places.iter().map(|place| place.xz()).collect();
        let floor = f64::from(contact.ground.floor);
        let highest = contact.places.iter().fold(floor, |high, place| high.max(place.y));
        contact.height = if highest > floor { highest - floor } else { 1.0 };
        Ok(contact)
    }

    /// How the character stands.
    pub fn ground(&self) -> &Ground {
        &self.ground
    }

    /// By how much the roots are moved now, mesh units.
    pub fn offset(&self) -> Vec3 {
        self.state.offset.as_vec3()
    }

    /// The bone whose point stays in place now, and that point among [`Ground::points`]; `None` while no foot carries.
    pub fn anchor(&self) -> Option<(usize, usize)> {
        let (foot, _) = self.state.anchor?;
        let point = self.feet[foot].point;
        Some((self.ground.points[point].bone, point))
    }

    /// Forgets where it is: the next pose is the first.
    pub fn restart(&mut self) {
        self.state = State::default();
        self.feet
            .iter_mut()
            .for_each(|foot| *foot = Foot { points: std::mem::take(&mut foot.points), ..Foot::default() });
        self.feet.iter_mut().for_each(|foot| foot.point = foot.points[0]);
    }

    /// Moves the roots of the next pose. `micros`: the device's clock. A pose that is not finite is moved like the one
    /// before it. Allocates nothing.
    pub fn follow(&mut self, micros: u64, skeleton: &Skeleton, pose: &mut Pose) {
        let is_first = self.state.micros.is_none();
        let passed = self.state.micros.map_or(0, |before| micros.saturating_sub(before));
        let seconds = (passed as f64 * 1e-6).min(LONGEST_STEP);
        self.locate(skeleton, pose);
        if self.places.iter().all(|place| place.is_finite()) {
            self.state.micros = Some(micros);
            self.stand();
            if is_first {
                let offset = self.state.offset.xz();
                self.averages.iter_mut().zip(&self.places).for_each(|(average, place)| *average = place.xz() + offset);
            }
            self.measure(seconds);
            self.choose(seconds);
            if self.ground.mode == GroundMode::Stand {
                self.glide(seconds);
            }
        }
        let offset = self.state.offset.as_vec3();
        for &root in &self.roots {
            pose.parent_from_bone[root].translation += offset;
        }
    }

    fn locate(&mut self, skeleton: &Skeleton, pose: &Pose) {
        pose.forward_kinematics(skeleton, &mut self.frames);
        for (place, point) in self.places.iter_mut().zip(&self.ground.points) {
            *place = self.frames[point.bone].transform_point3(point.at).as_dvec3();
        }
    }

    /// The lowest point is on the floor, and the foot that carries is where it was.
    fn stand(&mut self) {
        let lowest = self.places.iter().fold(f64::INFINITY, |low, place| low.min(place.y));
        self.state.offset.y = f64::from(self.ground.floor) - lowest;
        if let Some((foot, place)) = self.state.anchor {
            let moved = place - self.places[self.feet[foot].point].xz();
            (self.state.offset.x, self.state.offset.z) = (moved.x, moved.y);
        }
        for foot in &mut self.feet {
            let low = foot.points.iter().copied().min_by(|&a, &b| self.places[a].y.total_cmp(&self.places[b].y));
            let Some(low) = low else { continue };
            foot.height = self.places[low].y - lowest;
            if self.places[foot.point].y - self.places[low].y > LOWER * self.height {
                foot.point = low;
            }
        }
        if let Some((foot, place)) = &mut self.state.anchor {
            // Another point of the same foot stays where it is now.
            *place = self.places[self.feet[*foot].point].xz() + self.state.offset.xz();
        }
    }

    /// How fast the feet move over the floor.
    fn measure(&mut self, seconds: f64) {
        let share = -libm::expm1(-seconds / SPEED_SECONDS);
        let offset = self.state.offset.xz();
        for (average, place) in self.averages.iter_mut().zip(&self.places) {
            *average += (place.xz() + offset - *average) * share;
        }
        for foot in &mut self.feet {
            let off = self.places[foot.point].xz() + offset - self.averages[foot.point];
            foot.speed = off.length() / SPEED_SECONDS;
        }
    }

    /// Which foot carries, and which of those the roots follow.
    fn choose(&mut self, seconds: f64) {
        let [touched, left, slow] = [GROUND_TOUCHED, GROUND_LEFT, SLOW].map(|share| share * self.height);
        let anchor = self.state.anchor.map(|(foot, _)| foot);
        for (index, foot) in self.feet.iter_mut().enumerate() {
            foot.carries = if foot.carries {
                foot.height <= left && (anchor == Some(index) || foot.speed <= 3.0 * slow)
            } else {
                foot.height <= touched && foot.speed <= slow
            };
            foot.carried = if foot.carries { foot.carried + seconds } else { 0.0 };
        }
        let lower = |a: &usize, b: &usize| self.feet[*a].height.total_cmp(&self.feet[*b].height);
        let carrying = (0..self.feet.len()).filter(|&foot| self.feet[foot].carries).min_by(lower);
        let newest = (0..self.feet.len())
            .filter(|&foot| self.feet[foot].carries && self.feet[foot].carried >= TAKES_OVER)
            .min_by(|&a, &b| self.feet[a].carried.total_cmp(&self.feet[b].carried));
        let lowest = || (0..self.feet.len()).min_by(lower).filter(|&foot| self.feet[foot].height <= touched);
        let stays = anchor.filter(|&foot| {
            let higher = |by: f64| carrying.is_some_and(|other| self.feet[other].height < self.feet[foot].height - by);
            self.feet[foot].carries && !higher(GIVES_WAY * touched)
        });
        let takes_over =
            newest.filter(|&new| stays.is_some_and(|foot| self.feet[new].carried < self.feet[foot].carried));
        // With no foot that carries nothing says how fast the lowest one is, so it is taken as it is.
        let chosen = takes_over.or(stays).or(carrying).or_else(lowest);
        if let Some(foot) = chosen {
            self.feet[foot].carries = true;
        }
        if chosen != anchor {
            let offset = self.state.offset.xz();
            self.state.anchor = chosen.map(|foot| (foot, self.places[self.feet[foot].point].xz() + offset));
        }
    }

    /// With all feet on the floor a standing character goes back until they are, on average, where they rest.
    fn glide(&mut self, seconds: f64) {
        let offset = self.state.offset.xz();
        let all = self.feet.iter().all(|foot| foot.carries);
        let away = |foot: &Foot| self.places[foot.point].xz() + offset - self.rest[foot.point];
        let away = self.feet.iter().map(away).sum::<DVec2>() / self.feet.len().max(1) as f64;
        let beyond = (1.0 - SPOT * self.height / away.length().max(f64::MIN_POSITIVE)).max(0.0);
        let pull = if all { -RETURN_RATE * RETURN_RATE * beyond * away } else { DVec2::ZERO };
        self.state.gliding += (pull - 2.0 * RETURN_RATE * self.state.gliding) * seconds;
        let step = self.state.gliding * seconds;
        if let Some((_, place)) = &mut self.state.anchor {
            *place += step;
            self.state.offset += DVec3::new(step.x, 0.0, step.y);
        }
    }
}
