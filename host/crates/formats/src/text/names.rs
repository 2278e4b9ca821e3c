//! Names that a skeleton accepts: not empty, and unique.

use std::collections::{BTreeMap, BTreeSet};

/// Hands out names, changing those already handed out.
#[derive(Debug, Default)]
pub(crate) struct UniqueNames {
    taken: BTreeSet<String>,
    /// The number to try next for a name, so that a thousand equal names do not take a million attempts.
    next_number: BTreeMap<String, usize>,
}

impl UniqueNames {
    /// The wanted name, or `fallback` if it is empty, followed by `_2`, `_3`, … if it is taken.
    pub(crate) fn give(&mut self, wanted: &str, fallback: &str) -> String {
        let base = if wanted.trim().is_empty() { fallback } else { wanted };
        let mut name = base.to_owned();
        while !self.taken.insert(name.clone()) {
            let number = self.next_number.entry(base.to_owned()).or_insert(2);
            name = format!("{base}_{number}");
            *number += 1;
        }
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_name_once() {
        let mut names = UniqueNames::default();
        let given: Vec<String> = ["a", "a", "", "a_2", "a"].iter().map(|n| names.give(n, "bone")).collect();
        assert_eq!(given, ["a", "a_2", "bone", "a_2_2", "a_3"]);
    }
}
