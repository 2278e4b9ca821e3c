//! Rust's tokens, as far as the module reader needs them: comments are removed, groups are nested.

use std::iter::Peekable;
use std::str::Chars;

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Token {
    /// A name, keyword or number.
    Word(String),
    /// The content of a string or character, with its escapes as written.
    Text(String),
    /// One punctuation character; a lifetime is `'` and a word.
    Mark(char),
    /// What is between brackets, by the opening bracket.
    Group(char, Vec<Token>),
}

impl Token {
    pub(crate) fn word(&self) -> Option<&str> {
        match self {
            Self::Word(word) => Some(word),
            _ => None,
        }
    }
}

/// The tokens of a file.
pub(crate) fn tokens(text: &str) -> Vec<Token> {
    group(&mut text.chars().peekable())
}

/// Tokens up to the bracket that closes, or to the end.
fn group(rest: &mut Peekable<Chars>) -> Vec<Token> {
    let mut tokens = Vec::new();
    while let Some(letter) = rest.next() {
        match letter {
            ')' | ']' | '}' => break,
            '(' | '[' | '{' => tokens.push(Token::Group(letter, group(rest))),
            '/' if rest.peek() == Some(&'/') => drop(rest.find(|c| *c == '\n')),
            '/' if rest.peek() == Some(&'*') => skip_comment(rest),
            '"' => tokens.push(Token::Text(quoted(rest, '"'))),
            '\'' => tokens.push(after_tick(rest)),
            c if c.is_whitespace() => {}
            c if c.is_alphanumeric() || c == '_' => {
                let mut word = String::from(c);
                while let Some(c) = rest.next_if(|c| c.is_alphanumeric() || *c == '_') {
                    word.push(c);
                }
                tokens.push(after_word(word, rest));
            }
            mark => tokens.push(Token::Mark(mark)),
        }
    }
    tokens
}

/// `r"`, `br#"` and the like start a string; everything else is a word.
fn after_word(word: String, rest: &mut Peekable<Chars>) -> Token {
    let is_prefix = ["r", "b", "c", "br", "cr"].contains(&word.as_str());
    match rest.peek() {
        Some('"' | '#') if is_prefix && word.ends_with('r') => {
            let mut hashes = 0;
            while rest.next_if_eq(&'#').is_some() {
                hashes += 1;
            }
            if rest.next_if_eq(&'"').is_none() {
                // A raw name: `r#type`.
                return Token::Word(word);
            }
            let end: String = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect();
            let mut text = String::new();
            while !text.ends_with(&end) {
                let Some(c) = rest.next() else { break };
                text.push(c);
            }
            text.truncate(text.len().saturating_sub(end.len()));
            Token::Text(text)
        }
        Some('"') if is_prefix => {
            rest.next();
            Token::Text(quoted(rest, '"'))
        }
        Some('\'') if word == "b" => {
            rest.next();
            Token::Text(quoted(rest, '\''))
        }
        _ => Token::Word(word),
    }
}

/// A character, or the mark of a lifetime or label.
fn after_tick(rest: &mut Peekable<Chars>) -> Token {
    let mut ahead = rest.clone();
    let is_escape = ahead.next() == Some('\\');
    if is_escape || ahead.next() == Some('\'') { Token::Text(quoted(rest, '\'')) } else { Token::Mark('\'') }
}

fn quoted(rest: &mut Peekable<Chars>, end: char) -> String {
    let mut text = String::new();
    while let Some(c) = rest.next() {
        if c == end {
            break;
        }
        text.push(c);
        if c == '\\' {
            text.extend(rest.next());
        }
    }
    text
}

/// Comments nest.
fn skip_comment(rest: &mut Peekable<Chars>) {
    let (mut depth, mut before) = (0, '/');
    for c in rest.by_ref() {
        match (before, c) {
            ('/', '*') => depth += 1,
            ('*', '/') => depth -= 1,
            _ => {
                before = c;
                continue;
            }
        }
        if depth == 0 {
            return;
        }
        before = ' ';
    }
}
