//! How inverse kinematics reduces a character to its bones, and the words for it in takes.

use armature_deform::arap::{ArapSettings, GlobalStep};

/// How the shape is reduced, and what becomes of the result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IkSettings {
    /// What resists deformation.
    pub energy: IkEnergy,
    /// Number of rotation clusters; `None` means two per solved group of bones.
    pub clusters: Option<usize>,
    /// What bones may do.
    pub bones: IkBones,
    /// Whether a root goes where the shape takes it if nothing in its tree is driven or pinned; otherwise it stays.
    pub free_roots: bool,
    /// More groups of bones than this are solved by a sparse factorisation, whose time grows with their number; fewer by
    /// an inverse, which is quicker for few. `None`: always by an inverse, as takes were solved that do not say.
    pub factor_above: Option<usize>,
}

/// What resists deformation (thesis figure 7.10).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum IkEnergy {
    /// The surface, like a thin shell.
    #[default]
    Surface,
    /// The volume inside it, like flesh.
    Volume,
}

/// What bones may do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum IkBones {
    /// They turn and keep their lengths, as rigs expect.
    #[default]
    Rigid,
    /// They also move and grow as the energy has it.
    Loose,
}

/// Beyond this many groups of bones, factors are quicker to apply than inverses, and much quicker to prepare.
const FACTOR_ABOVE: usize = 64;

impl Default for IkSettings {
    fn default() -> Self {
        Self { factor_above: Some(FACTOR_ABOVE), ..Self::of_older_takes() }
    }
}

/// Words that are no settings of inverse kinematics.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{word:?} is no setting of inverse kinematics that this program knows")]
pub struct UnknownIkSetting {
    /// The word.
    pub word: String,
}

impl IkSettings {
    fn of_older_takes() -> Self {
        Self { energy: IkEnergy::Surface, clusters: None, bones: IkBones::Rigid, free_roots: false, factor_above: None }
    }

    /// As takes keep them; `bones`: of the skeleton. Empty for what was usual before takes said anything of it.
    pub fn words(&self, bones: usize) -> Vec<String> {
        let energy = (self.energy == IkEnergy::Volume).then(|| "energy=volume".to_owned());
        let clusters = self.clusters.map(|count| format!("clusters={count}"));
        let loose = (self.bones == IkBones::Loose).then(|| "bones=loose".to_owned());
        let roots = self.free_roots.then(|| "roots=free".to_owned());
        let factor = self.factor_above.filter(|&above| bones > above).map(|above| format!("factor={above}"));
        [energy, clusters, loose, roots, factor].into_iter().flatten().collect()
    }

    /// The settings of a take that says this.
    pub fn from_words(words: &[String]) -> Result<Self, UnknownIkSetting> {
        let mut settings = Self::of_older_takes();
        for word in words {
            let unknown = || UnknownIkSetting { word: word.clone() };
            match word.split_once('=').ok_or_else(unknown)? {
                ("energy", "volume") => settings.energy = IkEnergy::Volume,
                ("bones", "loose") => settings.bones = IkBones::Loose,
                ("roots", "free") => settings.free_roots = true,
                ("clusters", count) => settings.clusters = Some(count.parse().map_err(|_| unknown())?),
                ("factor", above) => settings.factor_above = Some(above.parse().map_err(|_| unknown())?),
                _ => return Err(unknown()),
            }
        }
        Ok(settings)
    }

    /// For this many handles.
    pub(super) fn reduction(&self, handles: usize) -> ArapSettings {
        let many = self.factor_above.is_some_and(|above| handles > above);
        let global_step = if many { GlobalStep::Factor } else { GlobalStep::Inverse };
        ArapSettings { clusters: self.clusters, global_step, ..ArapSettings::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_say_what_differs_from_older_takes() {
        assert!(IkSettings::default().words(64).is_empty());
        assert_eq!(IkSettings::default().words(65), ["factor=64"]);
        let all = IkSettings {
            energy: IkEnergy::Volume,
            clusters: Some(50),
            bones: IkBones::Loose,
            free_roots: true,
            factor_above: Some(10),
        };
        assert_eq!(IkSettings::from_words(&all.words(600)), Ok(all));
        let old = IkSettings::of_older_takes();
        assert_eq!((old.words(600), IkSettings::from_words(&[])), (Vec::new(), Ok(old)));
        for word in ["clusters", "clusters=x", "speed=3", "energy=surface!"] {
            assert!(IkSettings::from_words(&[word.to_owned()]).is_err(), "{word}");
        }
    }
}
