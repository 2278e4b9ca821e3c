//! How far bones can turn against the bones above them.

use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

use armature_rig::Skeleton;
use glam::{Quat, Vec3};

/// Firm limits of a bone against the bone above it, away from rest, radians. The axes are those of a joint that drives the
/// bone ([`Skeleton::bone_from_joint`]): it bends about X, leans about Z and rolls about Y, which runs along it. Bend and
/// lean are the parts of one turn, which moves the bone's tip the shortest way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimit {
    /// Least and greatest; of a knee or an elbow, from straight to wholly bent.
    pub bend: [f64; 2],
    /// Least and greatest.
    pub lean: [f64; 2],
    /// Least and greatest.
    pub roll: [f64; 2],
}

impl JointLimit {
    /// No limit.
    pub const FREE: Self = Self { bend: [-PI, PI], lean: [-PI, PI], roll: [-PI, PI] };

    /// Rest lies within, and every end is a finite angle of at most half a turn.
    pub fn is_sound(&self) -> bool {
        let half = 0.0..=PI + 1e-9;
        [self.bend, self.lean, self.roll].iter().all(|[least, most]| half.contains(&-least) && half.contains(most))
    }

    /// Every end is a finite angle of at most half a turn, and the least is not the greater.
    fn is_readable(&self) -> bool {
        let half = -PI - 1e-9..=PI + 1e-9;
        let readable = |[least, most]: &[f64; 2]| half.contains(least) && half.contains(most) && least <= most;
        [self.bend, self.lean, self.roll].iter().all(readable)
    }
}

/// A bone and its limit; as text `NAME:bend=LEAST..MOST:lean=LEAST..MOST:roll=LEAST..MOST` in degrees, of which any may
/// be missing, to a tenth.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitedBone {
    /// The bone's name.
    pub bone: String,
    /// How far it can turn.
    pub limit: JointLimit,
}

/// Text that is not a bone's limit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{text:?} is no limit; write BONE:bend=LEAST..MOST, BONE:lean=LEAST..MOST or BONE:roll=LEAST..MOST in degrees from the \
     rest pose, or several at once, such as LeftLowerLeg:bend=0..140:roll=-20..20; BONE:free has none"
)]
pub struct UnknownLimit {
    /// The text given.
    pub text: String,
}

impl LimitedBone {
    /// The limit widened so that the rest pose lies within, from where every motion begins; and a sentence about what was
    /// widened, if anything was.
    pub fn around_rest(self) -> (Self, Option<String>) {
        let around = |[least, most]: [f64; 2]| [least.min(0.0), most.max(0.0)];
        let JointLimit { bend, lean, roll } = self.limit;
        let limit = JointLimit { bend: around(bend), lean: around(lean), roll: around(roll) };
        if limit == self.limit {
            return (self, None);
        }
        let wide = Self { bone: self.bone.clone(), limit };
        let note = format!("the rest pose is outside of the limit {self}, so that {wide} holds");
        (wide, Some(note))
    }
}

impl FromStr for LimitedBone {
    type Err = UnknownLimit;

    fn from_str(text: &str) -> Result<Self, UnknownLimit> {
        let unknown = || UnknownLimit { text: text.to_owned() };
        if let Some(bone) = text.strip_suffix(":free").filter(|bone| !bone.is_empty()) {
            return Ok(Self { bone: bone.to_owned(), limit: JointLimit::FREE });
        }
        let (mut bone, mut limit, mut seen) = (text, JointLimit::FREE, [false; 3]);
        while let Some((rest, (key, value))) =
            bone.rsplit_once(':').and_then(|(rest, word)| Some((rest, word.split_once('=')?)))
        {
            let (index, range) = match key {
                "bend" => (0, &mut limit.bend),
                "lean" => (1, &mut limit.lean),
                "roll" => (2, &mut limit.roll),
                _ => return Err(unknown()),
            };
            let (least, most) = value.split_once("..").ok_or_else(unknown)?;
            let ends = [least, most].map(|end| end.trim().parse::<f64>().ok().map(|angle| tenths(angle).to_radians()));
            let [Some(least), Some(most)] = ends else { return Err(unknown()) };
            if std::mem::replace(&mut seen[index], true) {
                return Err(unknown());
            }
            *range = [least, most];
            bone = rest;
        }
        if bone.is_empty() || bone.len() == text.len() || !limit.is_readable() {
            return Err(unknown());
        }
        Ok(Self { bone: bone.to_owned(), limit })
    }
}

impl fmt::Display for LimitedBone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.bone)?;
        let JointLimit { bend, lean, roll } = self.limit;
        let mut is_free = true;
        for (key, [least, most]) in [("bend", bend), ("lean", lean), ("roll", roll)] {
            if least > -PI || most < PI {
                // Adding zero makes minus zero plain.
                let [least, most] = [least, most].map(|end| tenths(end.to_degrees()) + 0.0);
                write!(f, ":{key}={least}..{most}")?;
                is_free = false;
            }
        }
        if is_free { write!(f, ":free") } else { Ok(()) }
    }
}

/// Texts say limits to a tenth of a degree, and mean no more: so a take's text gives the same bits.
fn tenths(degrees: f64) -> f64 {
    (degrees * 10.0).round() / 10.0
}

/// A limit between two handles, prepared for poses.
#[derive(Clone, Copy, Debug)]
pub(super) struct HandleLimit {
    pub(super) above: usize,
    pub(super) own: usize,
    /// In the rest pose.
    model_from_joint: Quat,
    /// Bend, lean, roll.
    ranges: [[f32; 2]; 3],
}

/// Within this of a limit, radians, the way to it is slowed down where a pose is first made to respect it.
const EASE: f32 = 0.03;
/// The change that finds a coordinate's axis, radians.
const TINY: f32 = 1e-2;

impl HandleLimit {
    pub(super) fn new(skeleton: &Skeleton, bone: usize, [above, own]: [usize; 2], limit: &JointLimit) -> Self {
        let frames = skeleton.rest_model_from_bone();
        let model_from_bone = frames[bone].to_scale_rotation_translation().1;
        let model_from_joint = (model_from_bone * skeleton.bone_from_joint(bone, &frames)).normalize();
        let ranges = [limit.bend, limit.lean, limit.roll].map(|range| range.map(|end| end as f32));
        Self { above, own, model_from_joint, ranges }
    }

    /// Bend, lean and roll of a pose, brought within their limits at a slope that never jumps; rest where they are not
    /// finite.
    pub(super) fn eased(&self, turns: &[Quat]) -> [f32; 3] {
        let angles = self.coordinates(turns);
        std::array::from_fn(|index| {
            let [least, most] = self.ranges[index];
            if angles[index].is_finite() { ease(angles[index], least, most) } else { 0.0 }
        })
    }

    /// Turns after which [`eased`](Self::eased) gives the pose that they are in now, where it is within the limits.
    /// `coordinates`: of that pose.
    pub(super) fn uneased(&self, coordinates: &[f32; 3]) -> [f32; 3] {
        std::array::from_fn(|index| {
            let [least, most] = self.ranges[index];
            uneased(coordinates[index].clamp(least, most), least, most)
        })
    }

    /// Bend, lean and roll of a pose.
    pub(super) fn coordinates(&self, turns: &[Quat]) -> [f32; 3] {
        let joint = self.model_from_joint;
        let (swing, roll) = swing_and_roll(joint.inverse() * turns[self.above].inverse() * turns[self.own] * joint);
        [swing.x, swing.z, roll]
    }

    /// The cosine of the least angle between the segments above and below the joint that its bend allows.
    pub(super) fn straightest(&self, above: Vec3, below: Vec3) -> f32 {
        const STEPS: u16 = 256;
        let [least, most] = self.ranges[0];
        let (above, below) = (above.normalize_or_zero(), below.normalize_or_zero());
        let joint = self.model_from_joint;
        let cosine = |step: u16| {
            let bend = least + (most - least) * f32::from(step) / f32::from(STEPS);
            above.dot(joint * from_coordinates(&[bend, 0.0, 0.0]) * joint.inverse() * below)
        };
        (0..=STEPS).map(cosine).fold(-1.0, f32::max)
    }

    /// Turns the bone as its coordinates say.
    pub(super) fn place(&self, coordinates: &[f32; 3], turns: &mut [Quat]) {
        let joint = self.model_from_joint;
        let relative = from_coordinates(coordinates);
        turns[self.own] = (turns[self.above] * joint * relative * joint.inverse()).normalize();
    }

    /// The axis in model space about which one coordinate turns the bone, as long as it says how much a radian of it does.
    pub(super) fn axis(&self, coordinates: &[f32; 3], coordinate: usize, turns: &[Quat]) -> Vec3 {
        let mut further = *coordinates;
        further[coordinate] += TINY;
        let between = from_coordinates(&further) * from_coordinates(coordinates).inverse();
        let sign = if between.w < 0.0 { -1.0 } else { 1.0 };
        turns[self.above] * self.model_from_joint * (between.xyz() * (2.0 * sign / TINY))
    }

    /// A coordinate within its range.
    pub(super) fn within(&self, coordinate: usize, angle: f32) -> f32 {
        let [least, most] = self.ranges[coordinate];
        angle.clamp(least, most)
    }

    /// Whether a coordinate is at an end of its range and pulled beyond it.
    pub(super) fn blocks(&self, coordinates: &[f32; 3], coordinate: usize, pull: f32) -> bool {
        let ([least, most], angle) = (self.ranges[coordinate], coordinates[coordinate]);
        (angle >= most && pull > 0.0) || (angle <= least && pull < 0.0)
    }
}

fn from_coordinates(coordinates: &[f32; 3]) -> Quat {
    from_swing_and_roll(Vec3::new(coordinates[0], 0.0, coordinates[1]), coordinates[2])
}

/// The angle brought within its range, at a slope that falls from 1 to 0 near the ends and never jumps.
fn ease(angle: f32, least: f32, most: f32) -> f32 {
    // Rest stays where it is, however near a limit.
    let rise = |x: f32, width: f32| {
        if width > 0.0 && x < width { (x + width).max(0.0).powi(2) / (4.0 * width) } else { x.max(0.0) }
    };
    let low = least + rise(angle - least, EASE.min(-least));
    (most - rise(most - low, EASE.min(most))).max(least)
}

/// An angle that [`ease`] brings to this one.
fn uneased(angle: f32, least: f32, most: f32) -> f32 {
    let fall = |y: f32, width: f32| {
        if width > 0.0 && y < width { 2.0 * (width * y.max(0.0)).sqrt() - width } else { y }
    };
    let low = most - fall(most - angle, EASE.min(most));
    least + fall(low - least, EASE.min(-least))
}

/// A rotation as a swing that moves +Y the shortest way (a rotation vector without Y), after a turn about +Y.
fn swing_and_roll(rotation: Quat) -> (Vec3, f32) {
    let rotation = if rotation.w < 0.0 { -rotation } else { rotation };
    let roll = 2.0 * libm::atan2f(rotation.y, rotation.w);
    let about = Quat::from_xyzw(0.0, rotation.y, 0.0, rotation.w);
    let about = if about.length_squared() > 1e-12 { about.normalize() } else { Quat::IDENTITY };
    let swing = rotation * about.inverse();
    let half = Vec3::new(swing.x, 0.0, swing.z);
    let length = half.length();
    if length < 1e-9 {
        return (2.0 * half, roll);
    }
    (half * (2.0 * libm::atan2f(length, swing.w) / length), roll)
}

fn from_swing_and_roll(swing: Vec3, roll: f32) -> Quat {
    let angle = swing.length();
    let (sin, cos) = libm::sincosf(0.5 * angle);
    let axis = if angle > 1e-9 { swing * (sin / angle) } else { 0.5 * swing };
    let (sin_roll, cos_roll) = libm::sincosf(0.5 * roll);
    Quat::from_xyzw(axis.x, 0.0, axis.z, cos) * Quat::from_xyzw(0.0, sin_roll, 0.0, cos_roll)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_read_as_they_are_written() {
        for text in ["a:b:bend=-5.6..140:lean=-3..3:roll=-30..30", "Neck:roll=-60..60", "Neck:free"] {
            let limit: LimitedBone = text.parse().unwrap();
            assert_eq!(limit.to_string(), text);
        }
        for wrong in [
            "",
            "Neck",
            "Neck:bend",
            "Neck:bend=1",
            "Neck:bend=9..5",
            "Neck:bend=nan..1",
            ":bend=0..1",
            "Neck:bend=0..1:bend=0..2",
            "Neck:bend=-300..0",
            "Neck:swing=3",
        ] {
            assert!(wrong.parse::<LimitedBone>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn limits_beside_the_rest_pose_are_widened_to_it_and_say_so() {
        let narrow: LimitedBone = "Neck:bend=5..9:roll=-3..3".parse().unwrap();
        assert!(!narrow.limit.is_sound());
        let (wide, note) = narrow.around_rest();
        assert_eq!(wide.to_string(), "Neck:bend=0..9:roll=-3..3");
        assert!(wide.limit.is_sound() && note.unwrap().contains("Neck:bend=5..9"));
        assert_eq!(wide.clone().around_rest(), (wide, None));
    }

    #[test]
    fn swing_and_roll_make_the_rotation_again() {
        for seed in 0..200_u16 {
            let s = f32::from(seed);
            let wild =
                Quat::from_xyzw(libm::sinf(s), libm::cosf(3.0 * s), libm::sinf(7.1 * s), libm::cosf(1.3 * s) + 0.2);
            let rotation = wild.normalize();
            let (swing, roll) = swing_and_roll(rotation);
            let again = from_swing_and_roll(swing, roll);
            assert!(again.dot(rotation).abs() > 1.0 - 1e-5, "{rotation} {again}");
        }
    }

    #[test]
    fn easing_stays_within_and_never_turns_back() {
        let mut before = f32::NEG_INFINITY;
        for step in -200..200_i16 {
            let angle = f32::from(step) * 0.01;
            let eased = ease(angle, -0.1, 0.5);
            assert!((-0.1..=0.5).contains(&eased) && eased >= before, "{angle} {eased}");
            assert!((angle - eased).abs() < 1e-6 || !(-0.06..0.46).contains(&angle), "{angle} {eased}");
            let again = ease(uneased(eased, -0.1, 0.5), -0.1, 0.5);
            assert!((again - eased).abs() < 1e-6, "{eased} {again}");
            before = eased;
        }
    }
}
