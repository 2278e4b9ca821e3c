//! What an item of a module contains: its name, the paths in it, the types that it changes.

use std::collections::BTreeSet;

use crate::tokens::Token;

/// Where the item after the attributes at `at` begins, whether it is only for tests, and the file that `path` names.
pub(crate) fn after_attributes(tokens: &[Token], mut at: usize) -> (usize, bool, Option<String>) {
    let (mut is_test, mut moved) = (false, None);
    while is_mark(tokens.get(at), '#') {
        let inner = usize::from(is_mark(tokens.get(at + 1), '!'));
        if let Some(Token::Group(_, attribute)) = tokens.get(at + 1 + inner) {
            let text = flattened(attribute).concat();
            is_test |= inner == 0 && (text == "cfg(test)" || text == "test");
            match attribute.as_slice() {
                [Token::Word(path), _, Token::Text(file)] if path == "path" => moved = Some(file.clone()),
                _ => {}
            }
        }
        at += 2 + inner;
    }
    (at, is_test, moved)
}

/// An item ends with a semicolon or a group in braces; what follows a macro's braces is a separate item.
pub(crate) fn end_of_item(tokens: &[Token], begin: usize) -> usize {
    let words = |count: usize| tokens[begin..].iter().take(count).filter_map(Token::word);
    // In these, a group in braces is part of something longer.
    let to_semicolon = words(3).any(|word| word == "use")
        || words(4).any(|word| ["const", "static", "type"].contains(&word)) && !words(6).any(|word| word == "fn");
    for (offset, token) in tokens[begin..].iter().enumerate() {
        let closes = match token {
            Token::Mark(mark) => *mark == ';',
            Token::Group(open, _) => *open == '{' && !to_semicolon,
            _ => false,
        };
        if closes {
            return begin + offset + 1;
        }
    }
    tokens.len()
}

/// `pub`, `pub(super)` and the like.
pub(crate) fn visibility_length(item: &[Token]) -> usize {
    match (item.first().and_then(Token::word), item.get(1)) {
        (Some("pub"), Some(Token::Group('(', _))) => 2,
        (Some("pub"), _) => 1,
        _ => 0,
    }
}

/// The paths of a `use` and the names they get here; no name if it ends in `*`.
pub(crate) fn leaves_of_use(tokens: &[Token], before: &[String], leaves: &mut Vec<(Vec<String>, Option<String>)>) {
    let mut path = before.to_vec();
    let mut alias = None;
    let mut is_renaming = false;
    let mut finish = |path: &[String], alias: Option<String>| {
        let path: Vec<String> = match path.split_last() {
            Some((last, front)) if last == "self" && !front.is_empty() => front.to_vec(),
            _ => path.to_vec(),
        };
        let name = alias.or_else(|| path.last().cloned());
        leaves.push((path, name));
    };
    let mut nested: Vec<(Vec<String>, &[Token])> = Vec::new();
    let mut globs: Vec<Vec<String>> = Vec::new();
    let mut is_open = false;
    for token in tokens {
        match token {
            Token::Word(word) if word == "as" => is_renaming = true,
            Token::Word(word) if is_renaming => alias = Some(word.clone()),
            Token::Word(word) => {
                path.push(word.clone());
                is_open = true;
            }
            Token::Group(_, inner) => {
                nested.push((path.clone(), inner));
                is_open = false;
            }
            Token::Mark('*') => {
                globs.push(path.clone());
                is_open = false;
            }
            Token::Mark(',' | ';') => {
                if is_open {
                    finish(&path, alias.take());
                }
                path = before.to_vec();
                (is_renaming, is_open) = (false, false);
            }
            _ => {}
        }
    }
    if is_open {
        finish(&path, alias.take());
    }
    leaves.extend(globs.into_iter().map(|glob| (glob, None)));
    for (before, tokens) in nested {
        leaves_of_use(tokens, &before, leaves);
    }
}

pub(crate) fn name_of_item(item: &[Token]) -> Option<String> {
    const KINDS: [&str; 9] = ["fn", "struct", "enum", "trait", "type", "const", "static", "union", "macro_rules"];
    let words: Vec<&str> = item
        .iter()
        .map_while(|token| match token {
            Token::Group(..) => None,
            other => Some(other.word().unwrap_or_default()),
        })
        .collect();
    if words.first() == Some(&"impl") {
        return None;
    }
    let kind = words.iter().rposition(|word| KINDS.contains(word))?;
    words[kind + 1..].iter().find(|word| !word.is_empty()).map(ToString::to_string)
}

/// How many fields of a struct are `pub(super)`.
pub(crate) fn open_fields(item: &[Token]) -> usize {
    let is_struct = item.iter().find_map(Token::word) == Some("struct");
    if is_struct { flattened(item).concat().matches("pub(super)").count() } else { 0 }
}

/// Paths anywhere in an item, including in macros: a first word `crate`, `self` or `super`, and what follows by `::`.
pub(crate) fn mentions_in(tokens: &[Token], mentions: &mut Vec<Vec<String>>) {
    let mut at = 0;
    while at < tokens.len() {
        match &tokens[at] {
            Token::Group(_, inner) => {
                uses_in(inner, mentions);
                mentions_in(inner, mentions);
            }
            Token::Word(word) if ["crate", "self", "super"].contains(&word.as_str()) => {
                let mut path = vec![word.clone()];
                while is_mark(tokens.get(at + 1), ':') && is_mark(tokens.get(at + 2), ':') {
                    let Some(next) = tokens.get(at + 3).and_then(Token::word) else { break };
                    path.push(next.to_string());
                    at += 3;
                }
                if path.len() > 1 {
                    mentions.push(path);
                }
            }
            _ => {}
        }
        at += 1;
    }
}

/// `use` inside a function.
fn uses_in(tokens: &[Token], mentions: &mut Vec<Vec<String>>) {
    for (at, token) in tokens.iter().enumerate() {
        if token.word() == Some("use") {
            let end = tokens[at..].iter().position(|t| is_mark(Some(t), ';')).map_or(tokens.len(), |end| at + end);
            let mut leaves = Vec::new();
            leaves_of_use(&tokens[at + 1..end], &[], &mut leaves);
            mentions.extend(leaves.into_iter().map(|(path, _)| path));
        }
    }
}

/// Types behind `&mut`, and those whose `impl` has a method that takes `&mut self`.
pub(crate) fn changes_in(item: &[Token], changes: &mut BTreeSet<String>) {
    let flat = flattened(item);
    let mut of_impl = None;
    if flat.first().is_some_and(|word| word == "impl") {
        // The type is the last name before the braces that is not a parameter.
        let head = flat.iter().take_while(|word| *word != "{");
        let mut depth = 0;
        for word in head.skip(1) {
            match word.as_str() {
                "<" => depth += 1,
                ">" => depth -= 1,
                "where" => break,
                word if depth == 0 && word.chars().all(|c| c.is_alphanumeric() || c == '_') => {
                    of_impl = Some(word.to_string());
                }
                _ => {}
            }
        }
    }
    for (at, word) in flat.iter().enumerate() {
        if word != "&" {
            continue;
        }
        let mut next = at + 1;
        if flat.get(next).is_some_and(|word| word == "'") {
            next += 2;
        }
        if flat.get(next).is_none_or(|word| word != "mut") {
            continue;
        }
        next += 1;
        // The last name of a path.
        while flat.get(next + 1).is_some_and(|word| word == ":") && flat.get(next + 2).is_some_and(|word| word == ":") {
            next += 3;
        }
        match flat.get(next) {
            Some(word) if word == "self" => changes.extend(of_impl.clone()),
            Some(word) => {
                changes.insert(word.clone());
            }
            None => {}
        }
    }
}

fn is_mark(token: Option<&Token>, letter: char) -> bool {
    matches!(token, Some(Token::Mark(mark)) if *mark == letter)
}

/// The tokens of an item and of its groups, in order; strings are skipped.
fn flattened(tokens: &[Token]) -> Vec<String> {
    let mut flat = Vec::new();
    for token in tokens {
        match token {
            Token::Group(open, inner) => {
                flat.push(open.to_string());
                flat.extend(flattened(inner));
                flat.push(
                    match open {
                        '{' => "}",
                        '(' => ")",
                        _ => "]",
                    }
                    .to_string(),
                );
            }
            Token::Mark(mark) => flat.push(mark.to_string()),
            Token::Word(word) => flat.push(word.clone()),
            Token::Text(_) => {}
        }
    }
    flat
}
