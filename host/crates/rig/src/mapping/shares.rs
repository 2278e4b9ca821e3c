//! One joint that turns several bones: the bones of a spine, neck or tail together, or all bones of fingers.

use crate::puppet::PartUid;
use crate::skeleton::Skeleton;

use super::error::MappingError;

/// How far the shares of a chain may be from 1 in sum; they are then scaled to it.
const SUM_TOLERANCE: f64 = 1e-3;
/// A bone curls by at most so many times its joint's rotation, either way round.
pub const MOST_CURL: f64 = 4.0;

/// How the rotation of a joint is divided among bones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sharing {
    /// Bones that lie one below another turn about the joint's own axis, each by its share, so that the last one turns by
    /// the whole rotation. The shares sum to 1.
    Chain,
    /// Every bone turns by its share about its own axes, as if it had a joint of its own that reads the same. Shares may
    /// be anything up to [`MOST_CURL`] either way round.
    Curl,
}

/// A joint that turns several bones, beside its [`MappingEntry`](crate::MappingEntry), which says how it sits: in the joint frame of the bone
/// named there.
#[derive(Clone, Debug, PartialEq)]
pub struct SharedJoint {
    /// The part, by its unique number.
    pub part: PartUid,
    /// How its rotation is divided.
    pub sharing: Sharing,
    /// The bones by their names, and each one's share; a bone at most once. The bone of the joint's own entry is among them.
    pub bones: Vec<(String, f64)>,
}

impl SharedJoint {
    /// The bones by their numbers and their shares, parents before children, checked; the shares of a chain sum to 1.
    /// `own_bone`: that of the joint's own entry.
    pub(crate) fn resolve(&self, own_bone: &str, skeleton: &Skeleton) -> Result<Vec<(usize, f64)>, MappingError> {
        let bad = |what: String| MappingError::BadShares { part: self.part, what };
        let mut bones = Vec::with_capacity(self.bones.len());
        for (name, share) in &self.bones {
            let Some(bone) = skeleton.find(name) else {
                return Err(bad(format!("the skeleton has no bone {name:?}")));
            };
            let fits = match self.sharing {
                Sharing::Chain => *share > 0.0 && *share <= 1.0,
                Sharing::Curl => share.abs() <= MOST_CURL,
            };
            if !fits {
                let range = match self.sharing {
                    Sharing::Chain => "a share is more than 0 and at most 1".to_owned(),
                    Sharing::Curl => format!("a curl is a number from -{MOST_CURL} to {MOST_CURL}"),
                };
                return Err(bad(format!("the bone {name:?} has the share {share}; {range}")));
            }
            bones.push((bone, *share));
        }
        bones.sort_by_key(|(bone, _)| *bone);
        if let Some(twice) = bones.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(bad(format!("the bone {:?} has two shares", skeleton.bones()[twice[0].0].name)));
        }
        if !self.bones.iter().any(|(name, _)| name == own_bone) {
            return Err(bad(format!("its own bone {own_bone:?} has no share; give it one")));
        }
        if self.sharing == Sharing::Curl {
            return Ok(bones);
        }
        for pair in bones.windows(2) {
            let (above, below) = (pair[0].0, pair[1].0);
            if !std::iter::successors(skeleton.bones()[below].parent, |&bone| skeleton.bones()[bone].parent)
                .any(|bone| bone == above)
            {
                let [above, below] = [above, below].map(|bone| skeleton.bones()[bone].name.as_str());
                return Err(bad(format!(
                    "the bone {below:?} does not hang below {above:?}; shares are for bones in one line, curls for others"
                )));
            }
        }
        let sum: f64 = bones.iter().map(|(_, share)| share).sum();
        if (sum - 1.0).abs() > SUM_TOLERANCE {
            return Err(bad(format!("its shares sum to {sum}; they must sum to 1")));
        }
        bones.iter_mut().for_each(|(_, share)| *share /= sum);
        Ok(bones)
    }
}
