//! A bone and what it prefers, as a user writes it.

use std::str::FromStr;

use super::comfort::Comfort;

/// A bone and how it prefers to turn relative to the bone above.
#[derive(Clone, Debug, PartialEq)]
pub struct PreferredBone {
    /// The bone's name.
    pub bone: String,
    /// What it prefers.
    pub comfort: Comfort,
}

/// Text that is not a bone's preference.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{text:?} says nothing that a bone could prefer; write BONE:stiff=NUMBER, BONE:swing=DEGREES or \
     BONE:twist=LEAST..MOST, or several at once, such as Neck:stiff=0.5:swing=40:twist=-60..60"
)]
pub struct UnknownPreference {
    /// The text given.
    pub text: String,
}

impl FromStr for PreferredBone {
    type Err = UnknownPreference;

    /// A name may contain colons (`mixamorig:Hips`). Angles are in degrees.
    fn from_str(text: &str) -> Result<Self, UnknownPreference> {
        let unknown = || UnknownPreference { text: text.to_owned() };
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
        let (mut bone, mut stiffness, mut swing, mut twist) = (text, None, None, None);
        while let Some((rest, (key, value))) =
            bone.rsplit_once(':').and_then(|(rest, word)| Some((rest, word.split_once('=')?)))
        {
            let twice = match key {
                "stiff" => stiffness.replace(number(value).ok_or_else(unknown)?).is_some(),
                "swing" => swing.replace(number(value).ok_or_else(unknown)?.to_radians()).is_some(),
                "twist" => {
                    let (least, most) = value.split_once("..").ok_or_else(unknown)?;
                    let both = [least, most].map(|end| number(end).map(f64::to_radians));
                    let [Some(least), Some(most)] = both else { return Err(unknown()) };
                    twist.replace([least, most]).is_some()
                }
                _ => return Err(unknown()),
            };
            if twice {
                return Err(unknown());
            }
            bone = rest;
        }
        if bone.is_empty() || bone.len() == text.len() {
            return Err(unknown());
        }
        let half = std::f64::consts::PI;
        let limit =
            (swing.is_some() || twist.is_some()).then(|| (swing.unwrap_or(half), twist.unwrap_or([-half, half])));
        Ok(Self { bone: bone.to_owned(), comfort: Comfort { stiffness: stiffness.unwrap_or(0.0), limit } })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Option<PreferredBone> {
        text.parse().ok()
    }

    #[test]
    fn words_in_any_order_after_a_name_that_may_have_colons() {
        let half = std::f64::consts::PI;
        let preferred = |bone: &str, stiffness, limit| {
            Some(PreferredBone { bone: bone.into(), comfort: Comfort { stiffness, limit } })
        };
        assert_eq!(read("Neck:stiff=0.5"), preferred("Neck", 0.5, None));
        let both = read("mixamorig:Neck:twist=-90..90:swing=180:stiff=2");
        assert_eq!(both, preferred("mixamorig:Neck", 2.0, Some((half, [-half / 2.0, half / 2.0]))));
        assert_eq!(read("Neck:swing=90"), preferred("Neck", 0.0, Some((half / 2.0, [-half, half]))));
        for wrong in
            ["Neck", "", ":stiff=1", "Neck:stiff", "Neck:stiff=x", "Neck:stiff=nan", "Neck:twist=3", "Neck:bend=3"]
        {
            assert_eq!(read(wrong), None, "{wrong}");
        }
        assert_eq!(read("Neck:stiff=1:stiff=2"), None, "which of the two?");
        assert!("Neck".parse::<PreferredBone>().unwrap_err().to_string().contains("Neck:stiff=0.5:swing=40"));
    }
}
