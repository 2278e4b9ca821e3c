//! Names of prims, which USD restricts.

use crate::text::names::UniqueNames;

/// Hands out names of prims that are different from each other.
#[derive(Debug, Default)]
pub(super) struct Identifiers {
    names: UniqueNames,
}

impl Identifiers {
    /// The name with letters, digits and underscores alone; `fallback` if nothing of it is left.
    pub(super) fn give(&mut self, name: &str, fallback: &str) -> String {
        let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        if !plain.contains(|c: char| c.is_ascii_alphanumeric()) {
            return self.names.give(fallback, fallback);
        }
        // Not every program reads the letters of all scripts that newer versions of the format allow.
        let begins_with_digit = plain.starts_with(|c: char| c.is_ascii_digit());
        self.names.give(&if begins_with_digit { format!("_{plain}") } else { plain }, fallback)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_identifiers_and_differ() {
        let mut identifiers = Identifiers::default();
        let given: Vec<String> = ["mixamorig:Hips", "1st", "腕", "", "mixamorig Hips", "a"]
            .iter()
            .map(|n| identifiers.give(n, "bone_3"))
            .collect();
        assert_eq!(given, ["mixamorig_Hips", "_1st", "bone_3", "bone_3_2", "mixamorig_Hips_2", "a"]);
    }
}
