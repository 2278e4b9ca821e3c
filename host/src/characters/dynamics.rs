//! Options of bones that swing.

use std::str::FromStr;

use armature_formats::model::{Avatar, SpringChain as AvatarChain};
use armature_rig::{Dynamics, Skeleton, SpringBone, SpringChain, SpringCollider};
use clap::Args;
use glam::Vec3;

use super::LoadedCharacter;
use crate::failure::Failure;

/// The chains that the character's file brings.
const OWN: &str = "own";
/// None.
const OFF: &str = "off";
/// VRM's strengths are for bones of about this length in metres; those of named bones grow with their length.
const USUAL_LENGTH: f32 = 0.1;
/// The tip of a bone at the end of a VRM 0.x chain lies so far on, metres.
const OLD_TIP: f32 = 0.07;

/// A velocity of the air.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wind(pub Vec3);

impl FromStr for Wind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} is no wind: write X,Y,Z in model units a second, such as 0,0,-2");
        let numbers: Vec<f32> =
            text.split(',').map(|n| n.trim().parse()).collect::<Result<_, _>>().map_err(|_| wrong())?;
        match numbers.as_slice() {
            &[x, y, z] if numbers.iter().all(|number| number.is_finite()) => Ok(Self(Vec3::new(x, y, z))),
            _ => Err(wrong()),
        }
    }
}

/// Bones that swing.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct DynamicsArgs {
    /// Bones that swing by themselves, with all bones below them, separated by commas: tails, ears, hair. own stands for the
    /// chains that a VRM avatar brings, off for none; without it, own. A bone that a joint drives follows the joint
    #[arg(long, value_name = "BONE|own|off", value_delimiter = ',')]
    pub dynamics: Vec<String>,
    /// How strongly the bones named in --dynamics return to their pose; about 1 for a tail, more for ears
    #[arg(long, value_name = "NUMBER", default_value_t = 1.0, value_parser = strength)]
    pub spring_stiffness: f64,
    /// The share of their speed that the air takes from the bones named in --dynamics in a 60th of a second, 0 to 1
    #[arg(long, value_name = "SHARE", default_value_t = 0.4, value_parser = share)]
    pub spring_drag: f64,
    /// How strongly the bones named in --dynamics hang down, compared with --spring-stiffness
    #[arg(long, value_name = "NUMBER", default_value_t = 0.0, value_parser = strength)]
    pub spring_gravity: f64,
    /// How fast the air moves, X,Y,Z in model units a second (+X to the character's left, +Y up, +Z where it looks)
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub wind: Option<Wind>,
}

impl Default for DynamicsArgs {
    fn default() -> Self {
        Self { dynamics: Vec::new(), spring_stiffness: 1.0, spring_drag: 0.4, spring_gravity: 0.0, wind: None }
    }
}

fn strength(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| format!("{text:?} is not a number"))?;
    if (0.0..=1000.0).contains(&number) { Ok(number) } else { Err("give a number from 0 to 1000".into()) }
}

fn share(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| format!("{text:?} is not a number"))?;
    if (0.0..=1.0).contains(&number) { Ok(number) } else { Err("give a number from 0 to 1".into()) }
}

impl DynamicsArgs {
    /// What swings of a character; `None` if nothing does.
    pub fn for_character(&self, character: &LoadedCharacter) -> Result<Option<Dynamics>, Failure> {
        let is_off = self.dynamics.iter().any(|word| word == OFF);
        if is_off && self.dynamics.len() > 1 {
            return Err(Failure::usage("--dynamics off has bones beside it", "leave out off, or the bones"));
        }
        let skeleton = &character.skeleton;
        let avatar = character.character().and_then(|bound| bound.avatar.as_ref());
        let mut dynamics = Dynamics { wind: self.wind.unwrap_or_default().0, ..Dynamics::default() };
        let mut swings = vec![false; skeleton.len()];
        if !is_off && (self.dynamics.is_empty() || self.dynamics.iter().any(|word| word == OWN)) {
            for chain in avatar.iter().flat_map(|avatar| &avatar.springs) {
                dynamics.chains.extend(own_chain(avatar, chain, skeleton, &mut swings));
            }
            if dynamics.is_empty() && !self.dynamics.is_empty() {
                let what = format!("{} brings no chains that swing", character.name);
                return Err(Failure::usage(what, "name bones with --dynamics instead of own"));
            }
        }
        for name in self.dynamics.iter().filter(|word| *word != OWN && *word != OFF) {
            dynamics.chains.push(self.named_chain(character, name, &mut swings)?);
        }
        if dynamics.is_empty() {
            return Ok(None);
        }
        let checked = dynamics.check(skeleton);
        checked
            .map_err(|error| Failure::usage(error.to_string(), "choose other bones or numbers, or --dynamics off"))?;
        Ok(Some(dynamics))
    }

    /// A bone and all below it.
    fn named_chain(
        &self,
        character: &LoadedCharacter,
        name: &str,
        swings: &mut [bool],
    ) -> Result<SpringChain, Failure> {
        let skeleton = &character.skeleton;
        let first = skeleton.find(name).ok_or_else(|| {
            let names: Vec<&str> = skeleton.bones().iter().map(|bone| bone.name.as_str()).collect();
            let what = format!("{}: there is no bone {name:?} that could swing", character.name);
            Failure::usage(what, format!("name others with --dynamics; its bones are {}", names.join(", ")))
        })?;
        let mut below = vec![false; skeleton.len()];
        let mut bones = Vec::new();
        for (bone, own) in skeleton.bones().iter().enumerate() {
            below[bone] = bone == first || own.parent.is_some_and(|parent| below[parent]);
            let Some(tail) = tip_of(skeleton, bone).filter(|_| below[bone] && !swings[bone]) else { continue };
            swings[bone] = true;
            let size = f64::from(tail.length() / USUAL_LENGTH);
            bones.push(SpringBone {
                bone,
                tail,
                stiffness: self.spring_stiffness * size,
                drag: self.spring_drag,
                gravity: self.spring_gravity * size,
                gravity_direction: Vec3::NEG_Y,
                radius: 0.0,
            });
        }
        Ok(SpringChain { bones, colliders: Vec::new() })
    }
}

/// The end of a bone: its tail, or the first bone on it; `None` where there is no length to swing.
fn tip_of(skeleton: &Skeleton, bone: usize) -> Option<Vec3> {
    let on_it = skeleton.children(bone).map(|child| skeleton.bones()[child].rest.translation);
    std::iter::once(skeleton.bones()[bone].tail).chain(on_it).find(|tip| tip.is_finite() && tip.length() > 0.0)
}

/// A chain of an avatar, with numbers that are none taken as VRM's defaults. Bones that swing already are left out.
fn own_chain(
    avatar: Option<&Avatar>,
    chain: &AvatarChain,
    skeleton: &Skeleton,
    swings: &mut [bool],
) -> Option<SpringChain> {
    let is_old = avatar.is_some_and(|avatar| avatar.version.starts_with('0'));
    let number = |given: f32, low: f64, high: f64, usual: f64| {
        if given.is_finite() { f64::from(given).clamp(low, high) } else { usual }
    };
    let mut bones = Vec::new();
    for (at, joint) in chain.joints.iter().enumerate() {
        let bone = joint.bone as usize;
        if bone >= skeleton.len() || swings[bone] {
            continue;
        }
        // The last joint of VRM 1.0 is only the tip of the one before it.
        let next = chain.joints.get(at + 1).map(|next| next.bone as usize).filter(|&next| next < skeleton.len());
        let tail = match next {
            Some(next) => below(skeleton, bone, next),
            None if is_old => {
                let along = skeleton.bones()[bone].rest.translation.normalize_or(Vec3::NEG_Y);
                Some(tip_of(skeleton, bone).unwrap_or(along * OLD_TIP))
            }
            None => None,
        };
        let Some(tail) = tail.filter(|tail| tail.is_finite() && tail.length() > 0.0) else { continue };
        swings[bone] = true;
        let direction = Vec3::from(joint.gravity_direction);
        bones.push(SpringBone {
            bone,
            tail,
            stiffness: number(joint.stiffness, 0.0, 1000.0, 1.0),
            drag: number(joint.drag, 0.0, 1.0, 0.5),
            gravity: number(joint.gravity, -1000.0, 1000.0, 0.0),
            gravity_direction: if direction.is_finite() { direction.clamp_length_max(1.0) } else { Vec3::NEG_Y },
            radius: number(joint.radius, 0.0, 1000.0, 0.0),
        });
    }
    let colliders = chain.colliders.iter().filter(|collider| (collider.bone as usize) < skeleton.len());
    let colliders = colliders.filter(|collider| {
        collider.offset.iter().chain(collider.tail.iter().flatten()).all(|c| c.abs() <= 1e6) && collider.radius >= 0.0
    });
    let colliders = colliders.map(|collider| SpringCollider {
        bone: collider.bone as usize,
        offset: collider.offset.into(),
        tail: collider.tail.map(Vec3::from),
        radius: number(collider.radius, 0.0, 1000.0, 0.0),
    });
    (!bones.is_empty()).then(|| SpringChain { bones, colliders: colliders.collect() })
}

/// Where a bone further down rests, in the frame of one above it; `None` if it is not below it.
fn below(skeleton: &Skeleton, above: usize, bone: usize) -> Option<Vec3> {
    let way = std::iter::successors(Some(bone), |&bone| skeleton.bones()[bone].parent);
    let way: Vec<usize> = way.take_while(|&bone| bone != above).collect();
    let is_below = way.last().is_some_and(|&first| skeleton.bones()[first].parent == Some(above));
    let place = |at: Vec3, &bone: &usize| skeleton.bones()[bone].rest.to_affine().transform_point3(at);
    is_below.then(|| way.iter().fold(Vec3::ZERO, place))
}

#[cfg(test)]
mod tests {
    use armature_formats::model::SpringJoint;
    use armature_rig::{Bone, Transform};

    use super::*;

    fn cat() -> LoadedCharacter {
        let bone = |name: &str, parent, at: [f32; 3], tail: [f32; 3]| Bone {
            name: name.into(),
            parent,
            rest: Transform { translation: at.into(), ..Transform::IDENTITY },
            tail: tail.into(),
        };
        let back = [0.0, 0.0, -0.2];
        let bones = vec![
            bone("hips", None, [0.0, 1.0, 0.0], [0.0, 0.1, 0.0]),
            bone("tail1", Some(0), back, back),
            bone("tail2", Some(1), back, back),
            bone("end", Some(2), back, [0.0; 3]),
        ];
        LoadedCharacter::bare("cat", "cat", Skeleton::new(bones).unwrap())
    }

    fn args(words: &[&str]) -> DynamicsArgs {
        DynamicsArgs { dynamics: words.iter().map(ToString::to_string).collect(), ..DynamicsArgs::default() }
    }

    #[test]
    fn named_bones_swing_with_all_below_them_that_have_a_length() {
        let dynamics = args(&["tail1", "tail2"]).for_character(&cat()).unwrap().unwrap();
        let bones: Vec<usize> = dynamics.chains.iter().flat_map(|chain| &chain.bones).map(|own| own.bone).collect();
        assert_eq!(bones, [1, 2], "each once, and the end has no length");
        assert!((dynamics.chains[0].bones[0].stiffness - 2.0).abs() < 1e-6, "twice as long, twice as strong");
        assert_eq!(args(&[]).for_character(&cat()).unwrap(), None, "it brings nothing that swings");
        assert_eq!(args(&["off"]).for_character(&cat()).unwrap(), None);
        for (words, why) in [
            (&["mane"][..], "no bone \"mane\""),
            (&["off", "tail1"], "off has bones beside it"),
            (&["own"], "brings no chains"),
        ] {
            let failure = args(words).for_character(&cat()).unwrap_err();
            assert!(failure.what.contains(why) && !failure.remedy.is_empty(), "{failure:?}");
        }
    }

    #[test]
    fn a_wind_is_three_numbers() {
        assert_eq!("1,-2, 0.5".parse(), Ok(Wind(Vec3::new(1.0, -2.0, 0.5))));
        for wrong in ["", "1,2", "1,2,3,4", "1,2,nan", "a,b,c"] {
            assert!(wrong.parse::<Wind>().unwrap_err().contains("X,Y,Z"), "{wrong}");
        }
    }

    #[test]
    fn the_last_joint_of_a_new_avatar_is_a_tip_and_numbers_that_are_none_do_no_harm() {
        let joint = |bone, stiffness| SpringJoint { bone, stiffness, drag: 7.0, ..SpringJoint::default() };
        let chain = AvatarChain {
            joints: vec![joint(1, f32::NAN), joint(2, 0.5), joint(3, 0.5), joint(99, 1.0)],
            ..AvatarChain::default()
        };
        let skeleton = cat().skeleton;
        let of = |version: &str| {
            let avatar = Avatar { version: version.into(), ..Avatar::default() };
            own_chain(Some(&avatar), &chain, &skeleton, &mut [false; 4]).unwrap()
        };
        let new = of("1.0");
        assert_eq!(new.bones.iter().map(|own| own.bone).collect::<Vec<_>>(), [1, 2]);
        assert_eq!((new.bones[0].stiffness, new.bones[0].drag), (1.0, 1.0));
        assert_eq!(new.bones[0].tail, Vec3::new(0.0, 0.0, -0.2));
        Dynamics { chains: vec![new], wind: Vec3::ZERO }.check(&skeleton).unwrap();
    }
}
