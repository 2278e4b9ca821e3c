//! Roots that follow the foot on the floor.

use glam::{Affine3A, DQuat, DVec2, DVec3, Vec3, Vec3Swizzles as _};

use super::leg::{Leg, turn_of};
use super::placed::{PlacedFeet, PlacedFoot, heading, wrapped};
use super::settings::{Footing, Ground, GroundError, GroundMode, groups};
use crate::recognise::recognise;
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
/// It does so no sooner than it is slower than this share of [`SLOW`] and on the floor, or what is left of its swing would
/// drag the other foot along.
const STILL: f64 = 0.25;
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
/// It faces as it should within this, radians.
const FACING: f64 = 0.03;
/// A foot whose points on the floor reach this far from the one that stays, as shares of the height, begins to say where it
/// faces, and says so surely: not the tip of a spider's leg, nor toes of which the heel is up.
const SOLE: [f64; 2] = [0.05, 0.09];
/// With no foot that carries, the last one that did still leads the roots up to this share of the height: another foot
/// scuffs the floor while it swings.
const SCUFFED: f64 = 0.08;

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
    /// Its bone, and how that was turned in the last pose, before the roots were moved.
    bone: usize,
    turn: DQuat,
    /// The inverse of how it is turned at rest.
    rest_turn: DQuat,
    /// Where its point was when it came to stand beside the foot that carries.
    beside: Option<(usize, DVec2)>,
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
    /// The inverse of how the first root is turned at rest.
    rest_turn: DQuat,
    frames: Vec<Affine3A>,
    /// All points in model space, before the roots are moved.
    places: Vec<DVec3>,
    rest: Vec<DVec2>,
    /// Of each point over the floor, smoothed.
    averages: Vec<DVec2>,
    /// Feet whose legs can bend.
    placed: Option<PlacedFeet>,
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
    /// How the roots are turned about +Y through the model's origin, radians, before they are moved by the offset.
    heading: f64,
    turning: f64,
    /// How far a foot was dragged that stood beside the one that carries, mesh units.
    dragged: f64,
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
        let bone_of = |point: usize| ground.contacts[groups[ground.points[point].bone].unwrap_or(0)];
        let foot = |points: Vec<usize>| Foot { point: points[0], bone: bone_of(points[0]), points, ..Foot::default() };
        let feet: Vec<Foot> = feet.map(foot).collect();
        let mut contact = Self {
            height: 1.0,
            roots: (0..skeleton.len()).filter(|&bone| skeleton.bones()[bone].parent.is_none()).collect(),
            feet,
            rest_turn: DQuat::IDENTITY,
            frames: vec![Affine3A::IDENTITY; skeleton.len()],
            places: vec![DVec3::ZERO; ground.points.len()],
            rest: Vec::new(),
            averages: vec![DVec2::ZERO; ground.points.len()],
            placed: None,
            state: State::default(),
            ground,
        };
        contact.locate(skeleton, &skeleton.rest_pose());
        contact.rest = contact.places.iter().map(|place| place.xz()).collect();
        let floor = f64::from(contact.ground.floor);
        let highest = contact.places.iter().fold(floor, |high, place| high.max(place.y));
        contact.height = if highest > floor { highest - floor } else { 1.0 };
        contact.rest_turn =
            contact.roots.first().map_or(DQuat::IDENTITY, |&root| turn_of(&contact.frames[root]).inverse());
        for foot in &mut contact.feet {
            foot.rest_turn = turn_of(&contact.frames[foot.bone]).inverse();
        }
        contact.placed = contact.placed_feet(skeleton);
        Ok(contact)
    }

    /// The feet, if each of them ends a leg that can bend. The skeleton is at rest.
    fn placed_feet(&self, skeleton: &Skeleton) -> Option<PlacedFeet> {
        if self.ground.footing == Footing::Point {
            return None;
        }
        let (recognition, floor) = (recognise(skeleton), f64::from(self.ground.floor));
        let placed = self.feet.iter().map(|foot| {
            let leg = Leg::above(skeleton, &recognition, foot.bone)?;
            Some(PlacedFoot::new(foot.bone, leg, &foot.points, &self.places, &self.frames, floor))
        });
        let bones: Vec<usize> = self.ground.points.iter().map(|point| point.bone).collect();
        Some(PlacedFeet::new(placed.collect::<Option<Vec<_>>>()?, skeleton, &bones, self.height, floor))
    }

    /// How the character stands.
    pub fn ground(&self) -> &Ground {
        &self.ground
    }

    /// By how much the roots are moved now, mesh units.
    pub fn offset(&self) -> Vec3 {
        self.state.offset.as_vec3()
    }

    /// The points among [`Ground::points`] that stay in place now: one of the foot that the roots follow, or of every foot
    /// where no joint turns the legs. None where something else places the roots and joints turn the legs.
    pub fn standing(&self) -> impl Iterator<Item = usize> + '_ {
        let anchor = self.state.anchor.map(|(foot, _)| self.feet[foot].point);
        anchor.into_iter().chain(self.placed.iter().flat_map(PlacedFeet::standing))
    }

    /// How far the puppet's legs dragged a foot over the floor that stood beside the one that stays, mesh units: both could
    /// only stay if the legs did not do what their joints say.
    pub fn dragged(&self) -> f32 {
        self.state.dragged as f32
    }

    /// Forgets where it is: the next pose is the first.
    pub fn restart(&mut self) {
        self.state = State::default();
        self.feet.iter_mut().for_each(|foot| {
            let (points, bone, rest_turn) = (std::mem::take(&mut foot.points), foot.bone, foot.rest_turn);
            *foot = Foot { points, bone, rest_turn, ..Foot::default() };
        });
        self.feet.iter_mut().for_each(|foot| foot.point = foot.points[0]);
        self.placed.iter_mut().for_each(PlacedFeet::restart);
    }

    /// Moves the roots of the next pose, and bends legs that no joint turns. `micros`: the device's clock; `driven`: for each
    /// bone, whether a joint turns it. A pose that is not finite is moved like the one before it. Allocates nothing.
    pub fn follow(&mut self, micros: u64, skeleton: &Skeleton, driven: &[bool], pose: &mut Pose) {
        let is_first = self.state.micros.is_none();
        let passed = self.state.micros.map_or(0, |before| micros.saturating_sub(before));
        let seconds = (passed as f64 * 1e-6).min(LONGEST_STEP);
        self.locate(skeleton, pose);
        if !self.places.iter().all(|place| place.is_finite()) {
            self.move_roots(pose);
            return;
        }
        self.state.micros = Some(micros);
        let placed = self.placed.as_mut().map_or(0.0, |feet| feet.settle(feet.are_free(driven), is_first, seconds));
        if self.ground.is_held {
            self.lift();
        } else if placed < 1.0 {
            if self.ground.footing == Footing::Sole {
                self.face(is_first);
            }
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
        } else {
            self.state.anchor = None;
        }
        if placed > 0.0 {
            self.bend_legs(placed, skeleton, driven, pose);
        } else {
            self.move_roots(pose);
        }
    }

    fn move_roots(&self, pose: &mut Pose) {
        let State { offset, heading, .. } = self.state;
        let turn = (heading != 0.0).then(|| DQuat::from_rotation_y(heading));
        for &root in &self.roots {
            let root = &mut pose.parent_from_bone[root];
            if let Some(turn) = turn {
                root.translation = (turn * root.translation.as_dvec3()).as_vec3();
                root.rotation = (turn * root.rotation.as_dquat()).normalize().as_quat();
            }
            root.translation += offset.as_vec3();
        }
    }

    /// Roots that something else places are only raised, as far as the lowest point needs.
    fn lift(&mut self) {
        let lowest = self.places.iter().fold(f64::INFINITY, |low, place| low.min(place.y));
        self.state.offset = DVec3::new(0.0, (f64::from(self.ground.floor) - lowest).max(0.0), 0.0);
    }

    /// Legs that no joint turns bend, and the roots sink as far as those must. `share`: how far they have come to do so.
    fn bend_legs(&mut self, share: f64, skeleton: &Skeleton, driven: &[bool], pose: &mut Pose) {
        let by_joints = std::mem::replace(&mut self.state.offset.y, 0.0);
        self.move_roots(pose);
        self.locate(skeleton, pose);
        let Some(feet) = &mut self.placed else { return };
        let facing = self.roots.first().map_or(0.0, |&root| heading(turn_of(&self.frames[root]) * self.rest_turn));
        feet.aim(&self.places, &self.frames, driven, facing);
        let rise = if self.ground.is_held { feet.raised(&self.places) } else { feet.rise(&self.places, &self.frames) };
        self.state.offset.y = by_joints + (rise - by_joints) * share;
        let up = Vec3::new(0.0, self.state.offset.y as f32, 0.0);
        for &root in &self.roots {
            pose.parent_from_bone[root].translation += up;
        }
        self.frames.iter_mut().for_each(|frame| frame.translation += glam::Vec3A::from(up));
        feet.bend(skeleton, pose, &mut self.frames);
    }

    /// The foot that carries faces where it did, as far as its sole is on the floor; turns all places.
    fn face(&mut self, is_first: bool) {
        for (index, foot) in self.feet.iter_mut().enumerate() {
            let now = turn_of(&self.frames[foot.bone]);
            if self.state.anchor.is_some_and(|(anchor, _)| anchor == index) && !is_first {
                let lowest = foot.points.iter().fold(f64::INFINITY, |low, &point| low.min(self.places[point].y));
                let touched = GROUND_TOUCHED * self.height;
                let reach = |&point: &usize| {
                    let near = 1.0 - (self.places[point].y - lowest) / touched;
                    near.max(0.0) * self.places[point].xz().distance(self.places[foot.point].xz())
                };
                let furthest = foot.points.iter().map(reach).fold(0.0, f64::max) / self.height;
                let flat = ((furthest - SOLE[0]) / (SOLE[1] - SOLE[0])).clamp(0.0, 1.0);
                self.state.heading -= flat * heading(now * foot.turn.inverse());
            }
            foot.turn = now;
        }
        if self.state.heading != 0.0 {
            let turn = DQuat::from_rotation_y(self.state.heading);
            self.places.iter_mut().for_each(|place| *place = turn * *place);
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
        let is_down = |foot: &Foot| {
            self.ground.footing == Footing::Point || (foot.height <= LOWER * self.height && foot.speed <= STILL * slow)
        };
        let newest = (0..self.feet.len())
            .filter(|&foot| self.feet[foot].carries && self.feet[foot].carried >= TAKES_OVER)
            .filter(|&foot| is_down(&self.feet[foot]))
            .min_by(|&a, &b| self.feet[a].carried.total_cmp(&self.feet[b].carried));
        let lowest = || (0..self.feet.len()).min_by(lower).filter(|&foot| self.feet[foot].height <= touched);
        let stays = anchor.filter(|&foot| {
            let higher = |by: f64| carrying.is_some_and(|other| self.feet[other].height < self.feet[foot].height - by);
            self.feet[foot].carries && !higher(GIVES_WAY * touched)
        });
        let takes_over =
            newest.filter(|&new| stays.is_some_and(|foot| self.feet[new].carried < self.feet[foot].carried));
        let scuffed = anchor
            .filter(|&foot| self.ground.footing == Footing::Sole && self.feet[foot].height <= SCUFFED * self.height);
        // With no foot that carries nothing says how fast the lowest one is, so it is taken as it is.
        let chosen = takes_over.or(stays).or(carrying).or(scuffed).or_else(lowest);
        if let Some(foot) = chosen {
            self.feet[foot].carries = true;
        }
        if chosen != anchor {
            let offset = self.state.offset.xz();
            self.state.anchor = chosen.map(|foot| (foot, self.places[self.feet[foot].point].xz() + offset));
        }
        self.see_what_is_dragged(chosen);
    }

    fn see_what_is_dragged(&mut self, anchor: Option<usize>) {
        let offset = self.state.offset.xz();
        for (index, foot) in self.feet.iter_mut().enumerate() {
            let stands = foot.carries && anchor != Some(index) && foot.height <= LOWER * self.height;
            let place = self.places[foot.point].xz() + offset;
            foot.beside = match foot.beside.filter(|(point, _)| *point == foot.point) {
                Some((_, since)) if stands => {
                    self.state.dragged = self.state.dragged.max(place.distance(since));
                    foot.beside
                }
                _ => stands.then_some((foot.point, place)),
            };
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
        if self.ground.footing == Footing::Sole {
            self.turn_back(all, seconds);
        }
    }

    /// The same for where it faces: the feet turn about their middle until they are as at rest.
    fn turn_back(&mut self, all: bool, seconds: f64) {
        let offset = self.state.offset.xz();
        let count = self.feet.len().max(1) as f64;
        let middle = self.feet.iter().map(|foot| self.places[foot.point].xz() + offset).sum::<DVec2>() / count;
        let facing = |foot: &Foot| wrapped(self.state.heading + heading(foot.turn * foot.rest_turn));
        let away = self.feet.iter().map(facing).sum::<f64>() / count;
        let beyond = away - away.clamp(-FACING, FACING);
        let pull = if all { -RETURN_RATE * RETURN_RATE * beyond } else { 0.0 };
        self.state.turning += (pull - 2.0 * RETURN_RATE * self.state.turning) * seconds;
        let step = self.state.turning * seconds;
        let Some((foot, place)) = &mut self.state.anchor else { return };
        if step == 0.0 {
            return;
        }
        let turn = DQuat::from_rotation_y(step);
        let turned = |v: DVec2| (turn * DVec3::new(v.x, 0.0, v.y)).xz();
        *place = middle + turned(*place - middle);
        self.places.iter_mut().for_each(|place| *place = turn * *place);
        let moved = *place - self.places[self.feet[*foot].point].xz();
        (self.state.offset.x, self.state.offset.z) = (moved.x, moved.y);
        self.state.heading = wrapped(self.state.heading + step);
    }
}
