//! The modules of a crate and which of them mention which, read from the sources without compiling them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::items::{
    after_attributes, changes_in, end_of_item, leaves_of_use, mentions_in, name_of_item, open_fields, visibility_length,
};
use crate::tokens::{Token, tokens};

/// Following `use` declarations stops after this many steps.
const MOST_ALIASES: usize = 16;

/// A module: its place in the tree, what it declares and what it mentions. Unit tests are skipped.
#[derive(Debug, Default)]
struct Module {
    /// Like `["pictures", "slice"]`; the crate's root is empty.
    path: Vec<String>,
    file: PathBuf,
    /// Items it defines itself.
    items: BTreeSet<String>,
    /// Names that `use` brings in, and from where, as written.
    aliases: BTreeMap<String, Vec<String>>,
    /// Modules all of whose items `use` brings in.
    globs: Vec<Vec<String>>,
    /// Every path that begins with `crate`, `self` or `super`, as written.
    mentions: Vec<Vec<String>>,
    /// The number of fields in each struct that the parent module, and what is in it, may touch.
    open_structs: BTreeMap<String, usize>,
    /// Types that it changes through `&mut`, as an argument or as `self`.
    changes: BTreeSet<String>,
}

/// The modules of one crate.
#[derive(Debug)]
pub(crate) struct Modules {
    modules: BTreeMap<Vec<String>, Module>,
}

/// A folder whose modules use each other in a circle.
#[derive(Debug)]
pub(crate) struct Circle {
    /// The module that contains them, like `pictures::slice`; empty for the crate's root.
    pub(crate) within: String,
    /// The modules, in the order of their names.
    pub(crate) members: Vec<String>,
    /// For each pair of members that use each other: who, whom, and in which file.
    pub(crate) mentions: Vec<(String, String, PathBuf)>,
}

impl Modules {
    /// Reads the modules below `root`, a crate's `lib.rs` or `main.rs`.
    pub(crate) fn read(root: &Path) -> Self {
        let mut modules = Self { modules: BTreeMap::new() };
        let folder = root.parent().expect("a source is in a folder");
        modules.read_file(root, folder, Vec::new());
        modules
    }

    /// `folder` contains the files of the module's children.
    fn read_file(&mut self, file: &Path, folder: &Path, path: Vec<String>) {
        let text = std::fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        self.read_module(file, folder, path, &tokens(&text));
    }

    fn read_module(&mut self, file: &Path, folder: &Path, path: Vec<String>, tokens: &[Token]) {
        let mut module = Module { path: path.clone(), file: file.to_path_buf(), ..Module::default() };
        let mut at = 0;
        while at < tokens.len() {
            let (begin, is_test, moved) = after_attributes(tokens, at);
            let end = end_of_item(tokens, begin);
            let item = &tokens[begin..end];
            at = end.max(at + 1);
            if is_test {
                continue;
            }
            let item = &item[visibility_length(item)..];
            let kind = item.first().and_then(Token::word).unwrap_or_default();
            let name = item.get(1).and_then(Token::word).unwrap_or_default();
            if kind == "mod" {
                module.items.insert(name.to_string());
                self.read_child(&module, folder, name, item.get(2), moved);
                continue;
            }
            if kind == "use" {
                let mut leaves = Vec::new();
                leaves_of_use(&item[1..], &[], &mut leaves);
                for (leaf, alias) in leaves {
                    match alias {
                        Some(alias) => drop(module.aliases.insert(alias, leaf.clone())),
                        None => module.globs.push(leaf.clone()),
                    }
                    module.mentions.push(leaf);
                }
                continue;
            }
            if let Some(name) = name_of_item(item) {
                let open = open_fields(item);
                if open > 0 {
                    module.open_structs.insert(name.clone(), open);
                }
                module.items.insert(name);
            }
            mentions_in(item, &mut module.mentions);
            changes_in(item, &mut module.changes);
        }
        self.modules.insert(path, module);
    }

    /// A module that `parent` declares: its body, or a file in `folder`.
    fn read_child(&mut self, parent: &Module, folder: &Path, name: &str, body: Option<&Token>, moved: Option<String>) {
        let path: Vec<String> = parent.path.iter().cloned().chain([name.to_string()]).collect();
        let inside = folder.join(name);
        if let Some(Token::Group(_, body)) = body {
            return self.read_module(&parent.file, &inside, path, body);
        }
        let sources = [folder.join(format!("{name}.rs")), inside.join("mod.rs")];
        let source = moved.map(|moved| folder.join(moved));
        let source = source.or_else(|| sources.into_iter().find(|source| source.exists()));
        let source = source.unwrap_or_else(|| panic!("{}: mod {name} has no file", parent.file.display()));
        self.read_file(&source, &inside, path);
    }

    /// The module that contains what a path mentions, if it is in this crate.
    fn owner(&self, from: &[String], written: &[String], steps: usize) -> Option<Vec<String>> {
        let mut here = from.to_vec();
        let mut rest = written;
        match written.first()?.as_str() {
            "crate" => here.clear(),
            "self" => {}
            "super" => drop(here.pop()),
            // A child, or a name in scope; otherwise another crate.
            first => {
                let module = self.modules.get(from)?;
                let child: Vec<String> = from.iter().cloned().chain([first.to_string()]).collect();
                if !self.modules.contains_key(&child) && !module.aliases.contains_key(first) {
                    return None;
                }
                return self.descend(here, written, steps);
            }
        }
        rest = &rest[1..];
        while rest.first().is_some_and(|segment| segment == "super") {
            here.pop();
            rest = &rest[1..];
        }
        self.descend(here, rest, steps)
    }

    fn descend(&self, mut here: Vec<String>, mut rest: &[String], steps: usize) -> Option<Vec<String>> {
        while let Some((segment, further)) = rest.split_first() {
            let child: Vec<String> = here.iter().cloned().chain([segment.clone()]).collect();
            if self.modules.contains_key(&child) {
                here = child;
                rest = further;
                continue;
            }
            let module = self.modules.get(&here)?;
            if module.items.contains(segment) || steps == 0 {
                return Some(here);
            }
            if let Some(target) = module.aliases.get(segment) {
                let target: Vec<String> = target.iter().chain(further).cloned().collect();
                // A name from another crate belongs to the module that brings it in.
                return self.owner(&here, &target, steps - 1).or(Some(here));
            }
            for glob in &module.globs {
                let target: Vec<String> = glob.iter().chain(rest).cloned().collect();
                let found = self.owner(&here, &target, steps - 1);
                if found.as_ref().is_some_and(|owner| self.modules[owner].items.contains(segment)) {
                    return found;
                }
            }
            return Some(here);
        }
        Some(here)
    }

    /// For each module with children: which child mentions which, and in which file.
    fn edges(&self) -> BTreeMap<Vec<String>, BTreeMap<(String, String), PathBuf>> {
        let mut edges: BTreeMap<Vec<String>, BTreeMap<(String, String), PathBuf>> = BTreeMap::new();
        for module in self.modules.values() {
            for mention in &module.mentions {
                let Some(owner) = self.owner(&module.path, mention, MOST_ALIASES) else { continue };
                let shared = module.path.iter().zip(&owner).take_while(|(a, b)| a == b).count();
                if let (Some(who), Some(whom)) = (module.path.get(shared), owner.get(shared)) {
                    let pairs = edges.entry(module.path[..shared].to_vec()).or_default();
                    pairs.entry((who.clone(), whom.clone())).or_insert_with(|| module.file.clone());
                }
            }
        }
        edges
    }

    /// Every circle among sibling modules, files and folders alike. What a module shares with its own children belongs
    /// to them together and makes no circle.
    pub(crate) fn circles(&self) -> Vec<Circle> {
        let mut circles = Vec::new();
        for (within, pairs) in self.edges() {
            let mut reach: BTreeMap<&String, BTreeSet<&String>> = BTreeMap::new();
            for (who, whom) in pairs.keys() {
                reach.entry(who).or_default().insert(whom);
            }
            loop {
                let mut grown = reach.clone();
                for (who, whom) in &reach {
                    let further = whom.iter().filter_map(|next| reach.get(*next)).flatten();
                    grown.entry(who).or_default().extend(further.copied());
                }
                if grown == reach {
                    break;
                }
                reach = grown;
            }
            let mutual = |a: &String, b: &String| {
                let reaches = |a, b| reach.get(a).is_some_and(|whom: &BTreeSet<&String>| whom.contains(b));
                reaches(a, b) && reaches(b, a)
            };
            let mut seen = BTreeSet::new();
            for first in reach.keys() {
                let members: Vec<String> =
                    reach.keys().filter(|other| mutual(first, other)).map(|m| (*m).clone()).collect();
                if members.is_empty() || !seen.insert(members.clone()) {
                    continue;
                }
                let inner = pairs.iter().filter(|((who, whom), _)| members.contains(who) && members.contains(whom));
                let mentions = inner.map(|((who, whom), file)| (who.clone(), whom.clone(), file.clone())).collect();
                circles.push(Circle { within: within.join("::"), members, mentions });
            }
        }
        circles
    }

    /// Every struct with more than `fields` fields open to its parent module, and the files that change it.
    pub(crate) fn open_structs(&self, fields: usize) -> Vec<(String, BTreeSet<PathBuf>)> {
        let mut found = Vec::new();
        for module in self.modules.values() {
            for (name, _) in module.open_structs.iter().filter(|(_, open)| **open > fields) {
                let parent = &module.path[..module.path.len().saturating_sub(1)];
                let family = self.modules.values().filter(|other| other.path.starts_with(parent));
                let changing = family.filter(|other| other.changes.contains(name));
                found.push((name.clone(), changing.map(|other| other.file.clone()).collect()));
            }
        }
        found
    }
}
