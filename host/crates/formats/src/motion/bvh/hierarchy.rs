//! The HIERARCHY part of a BVH file: joints, offsets, channels.

use std::iter::Peekable;

use armature_rig::Skeleton;

use crate::FormatError;
use crate::text::{count, number, numbered_lines, quoted};

const EXPORT_AGAIN: &str = "The file may be cut off or damaged; export it again";

/// Most channels of one joint: three positions and three rotations, plus spare ones for repeated rotations.
const MAX_CHANNELS: usize = 12;

/// What a channel moves; the number is the axis, x = 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Channel {
    Position(usize),
    Rotation(usize),
}

/// One joint as in the file.
#[derive(Debug)]
pub(super) struct Joint {
    pub(super) name: String,
    pub(super) parent: Option<usize>,
    pub(super) offset: [f64; 3],
    pub(super) channels: Vec<Channel>,
    /// Offset of its End Site.
    pub(super) end_site: Option<[f64; 3]>,
}

/// The lines of a file with the rest of the current one, word by word.
pub(super) struct Words<'t, L: Iterator<Item = (usize, &'t str)>> {
    lines: Peekable<L>,
    rest: &'t str,
    line: usize,
}

impl<'t> Words<'t, std::vec::IntoIter<(usize, &'t str)>> {
    pub(super) fn new(text: &'t str) -> Self {
        Self { lines: numbered_lines(text).collect::<Vec<_>>().into_iter().peekable(), rest: "", line: 0 }
    }
}

impl<'t, L: Iterator<Item = (usize, &'t str)>> Words<'t, L> {
    /// The next word, on whichever line; braces are words of their own.
    pub(super) fn next(&mut self) -> Option<&'t str> {
        loop {
            self.rest = self.rest.trim_start();
            if !self.rest.is_empty() {
                let end = match self.rest.find(|c: char| c.is_whitespace() || c == '{' || c == '}') {
                    Some(0) => 1,
                    Some(end) => end,
                    None => self.rest.len(),
                };
                let (word, rest) = self.rest.split_at(end);
                self.rest = rest;
                return Some(word);
            }
            (self.line, self.rest) = self.lines.next()?;
        }
    }

    /// The rest of the current line up to a brace: a name, which may contain spaces.
    fn name(&mut self) -> &'t str {
        let end = self.rest.find(['{', '}']).unwrap_or(self.rest.len());
        let (name, rest) = self.rest.split_at(end);
        self.rest = rest;
        name.trim()
    }

    /// The rest of the current line.
    pub(super) fn rest_of_line(&mut self) -> &'t str {
        std::mem::take(&mut self.rest).trim()
    }

    /// The next line that is not empty.
    pub(super) fn next_line(&mut self) -> Option<&'t str> {
        loop {
            let line = self.rest_of_line();
            if !line.is_empty() {
                return Some(line);
            }
            (self.line, self.rest) = self.lines.next()?;
        }
    }

    /// One-based line of the last word.
    pub(super) fn line(&self) -> usize {
        self.line.max(1)
    }

    pub(super) fn error(&self, what: impl Into<String>, remedy: impl Into<String>) -> FormatError {
        FormatError::line("", self.line(), what, remedy)
    }

    fn expect(&mut self, what: &str) -> Result<&'t str, FormatError> {
        match self.next() {
            Some(word) => Ok(word),
            None => Err(self.error(format!("the file ends where {what} should be"), EXPORT_AGAIN)),
        }
    }

    fn three(&mut self, what: &str) -> Result<[f64; 3], FormatError> {
        let mut out = [0.0; 3];
        for slot in &mut out {
            let word = self.expect(what)?;
            *slot = number("", self.line(), word)?;
        }
        Ok(out)
    }
}

/// What an open brace belongs to.
enum Open {
    Joint(usize),
    EndSite(usize),
}

/// Reads from HIERARCHY up to and including MOTION; joints come parents first, in the file's order.
pub(super) fn read_hierarchy<'t, L: Iterator<Item = (usize, &'t str)>>(
    words: &mut Words<'t, L>,
) -> Result<Vec<Joint>, FormatError> {
    let first = words.next().unwrap_or_default();
    if !first.eq_ignore_ascii_case("HIERARCHY") {
        let what = format!("a BVH file starts with HIERARCHY, but this one with {}", quoted(first));
        return Err(words.error(what, "Choose a BVH motion file"));
    }
    let mut joints: Vec<Joint> = Vec::new();
    let mut open: Vec<Open> = Vec::new();
    loop {
        let word = words.expect("MOTION or the rest of the hierarchy")?;
        match (word.to_ascii_uppercase().as_str(), open.last()) {
            ("MOTION", None) if joints.is_empty() => {
                return Err(words.error("the hierarchy has no ROOT", EXPORT_AGAIN));
            }
            ("MOTION", None) => return Ok(joints),
            ("ROOT", None) => open_joint(words, &mut joints, &mut open, None)?,
            ("JOINT", Some(&Open::Joint(parent))) => open_joint(words, &mut joints, &mut open, Some(parent))?,
            ("END", Some(&Open::Joint(joint))) => {
                words.name();
                open_brace(words, "End Site")?;
                open.push(Open::EndSite(joint));
            }
            ("OFFSET", Some(&Open::Joint(joint))) => {
                joints[joint].offset = words.three("three numbers of an OFFSET")?;
            }
            ("OFFSET", Some(&Open::EndSite(joint))) => {
                joints[joint].end_site = Some(words.three("three numbers of an OFFSET")?);
            }
            ("CHANNELS", Some(&Open::Joint(joint))) => joints[joint].channels = channels(words)?,
            ("}", Some(_)) => {
                open.pop();
            }
            _ => {
                let what = format!("{} does not belong here in the hierarchy", quoted(word));
                return Err(words.error(what, "Check the braces above this line, or export the file again"));
            }
        }
    }
}

fn open_brace<'t, L: Iterator<Item = (usize, &'t str)>>(words: &mut Words<'t, L>, of: &str) -> Result<(), FormatError> {
    match words.expect("a {")? {
        "{" => Ok(()),
        other => Err(words.error(format!("{of} is followed by {} instead of {{", quoted(other)), EXPORT_AGAIN)),
    }
}

fn open_joint<'t, L: Iterator<Item = (usize, &'t str)>>(
    words: &mut Words<'t, L>,
    joints: &mut Vec<Joint>,
    open: &mut Vec<Open>,
    parent: Option<usize>,
) -> Result<(), FormatError> {
    if joints.len() == Skeleton::MAX_BONES {
        let what = format!("there are more than {} joints", Skeleton::MAX_BONES);
        return Err(words.error(what, "Split the motion into several files"));
    }
    let name = words.name().to_owned();
    open_brace(words, "a joint's name")?;
    open.push(Open::Joint(joints.len()));
    joints.push(Joint { name, parent, offset: [0.0; 3], channels: Vec::new(), end_site: None });
    Ok(())
}

fn channels<'t, L: Iterator<Item = (usize, &'t str)>>(words: &mut Words<'t, L>) -> Result<Vec<Channel>, FormatError> {
    let word = words.expect("the number of channels")?;
    let announced = count("", words.line(), word)?;
    if announced > MAX_CHANNELS {
        let what = format!("a joint has {announced} channels");
        return Err(words.error(what, "A joint has at most three position and three rotation channels"));
    }
    let mut out = Vec::with_capacity(announced);
    for _ in 0..announced {
        let word = words.expect("the name of a channel")?;
        let lower = word.to_ascii_lowercase();
        let axis = lower.bytes().next().and_then(|b| b"xyz".iter().position(|&axis| axis == b));
        let channel = match (axis, lower.get(1..)) {
            (Some(axis), Some("position")) => Channel::Position(axis),
            (Some(axis), Some("rotation")) => Channel::Rotation(axis),
            _ => {
                let what = format!("{} is not a channel", quoted(word));
                let remedy = "Channels are Xposition, Yposition, Zposition, Xrotation, Yrotation and Zrotation; \
                              export without others";
                return Err(words.error(what, remedy));
            }
        };
        if matches!(channel, Channel::Position(_)) && out.contains(&channel) {
            let what = format!("the channel {word} occurs twice");
            return Err(words.error(what, EXPORT_AGAIN));
        }
        out.push(channel);
    }
    Ok(out)
}
