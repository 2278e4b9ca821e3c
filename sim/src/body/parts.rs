//! The puppet's parts and how they are plugged together.

use firmware_protocol::{MAX_SENSORS, PartKind, PartUid};

use crate::random::{Random, hash};

/// One part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BodyPart {
    /// What it represents: "`left_knee`". Not sent; motions and faults find parts by it.
    pub label: String,
    /// What it is.
    pub kind: PartKind,
    /// Number of outlets; 1 for joints.
    pub outlets: u8,
    /// Index of the part it is plugged into, smaller than its own; `None` for the root.
    pub parent: Option<usize>,
    /// The parent's outlet it is plugged into.
    pub outlet: u8,
    /// Its unique number.
    pub uid: PartUid,
}

/// A whole puppet: parents before children, and the first part is the root.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Body {
    name: String,
    parts: Vec<BodyPart>,
    first_sensor: Vec<usize>,
    sensor_count: usize,
}

/// Why a list of parts is not a puppet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BodyError {
    /// A parent that does not come before its child, or a second root.
    BadParent {
        /// Zero-based part.
        part: usize,
    },
    /// An outlet that the parent does not have, or that is taken.
    BadOutlet {
        /// Zero-based part.
        part: usize,
    },
    /// A kind that this protocol version does not know, or a joint without exactly one outlet.
    BadKind {
        /// Zero-based part.
        part: usize,
    },
    /// More sensors than a sample can hold.
    TooManySensors {
        /// Sensors of all parts.
        count: usize,
    },
    /// There is no preset of this name.
    UnknownPreset {
        /// The name given.
        name: String,
        /// The names there are.
        known: String,
    },
}

impl std::fmt::Display for BodyError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::BadParent { part } => write!(f, "part {part} must be plugged into an earlier part"),
            Self::BadOutlet { part } => write!(f, "part {part} sits in an outlet that is taken or does not exist"),
            Self::BadKind { part } => write!(f, "part {part} has an unknown kind or an impossible number of outlets"),
            Self::TooManySensors { count } => {
                write!(f, "{count} sensors do not fit in a sample, which holds at most {MAX_SENSORS}; use fewer joints")
            }
            Self::UnknownPreset { name, known } => write!(f, "there is no puppet called {name:?}; choose {known}"),
        }
    }
}

impl std::error::Error for BodyError {}

impl Body {
    /// Checks the parts and builds the puppet.
    pub fn new(name: impl Into<String>, parts: Vec<BodyPart>) -> Result<Self, BodyError> {
        let mut first_sensor = Vec::with_capacity(parts.len());
        let mut sensor_count = 0;
        for (index, part) in parts.iter().enumerate() {
            let outlets_fit =
                if part.kind == PartKind::Splitter { (1..=5).contains(&part.outlets) } else { part.outlets == 1 };
            let sensors = part.kind.sensor_count().filter(|_| outlets_fit).ok_or(BodyError::BadKind { part: index })?;
            match part.parent {
                None if index == 0 => {}
                Some(parent) if parent < index => {
                    let taken = parts[..index].iter().any(|p| p.parent == Some(parent) && p.outlet == part.outlet);
                    if taken || part.outlet >= parts[parent].outlets {
                        return Err(BodyError::BadOutlet { part: index });
                    }
                }
                _ => return Err(BodyError::BadParent { part: index }),
            }
            first_sensor.push(sensor_count);
            sensor_count += usize::from(sensors);
        }
        if sensor_count > MAX_SENSORS {
            return Err(BodyError::TooManySensors { count: sensor_count });
        }
        Ok(Self { name: name.into(), parts, first_sensor, sensor_count })
    }

    /// The preset's name, or what the puppet was made from.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// All parts.
    pub fn parts(&self) -> &[BodyPart] {
        &self.parts
    }

    /// Sensors of all parts.
    pub fn sensor_count(&self) -> usize {
        self.sensor_count
    }

    /// The sensors of a part, from the inlet outwards, in the order of a sample of the whole puppet.
    pub fn sensors(&self, part: usize) -> std::ops::Range<usize> {
        let first = self.first_sensor[part];
        first..first + usize::from(self.parts[part].kind.sensor_count().unwrap_or(0))
    }

    /// Index of the part with this label, if there is one.
    pub fn find(&self, label: &str) -> Option<usize> {
        self.parts.iter().position(|p| p.label == label)
    }

    /// Whether `part` is `ancestor` or is attached below it.
    pub fn is_below(&self, part: usize, ancestor: usize) -> bool {
        std::iter::successors(Some(part), |&p| self.parts[p].parent).any(|p| p == ancestor)
    }
}

/// Builds a body part by part; part numbers are derived from name and seed.
#[derive(Clone, Debug)]
pub struct BodyBuilder {
    name: String,
    uids: Random,
    parts: Vec<BodyPart>,
}

impl BodyBuilder {
    /// An empty body.
    pub fn new(name: impl Into<String>, seed: u64) -> Self {
        let name = name.into();
        let uids = Random::new(seed, hash(&name));
        Self { name, uids, parts: Vec::new() }
    }

    /// Plugs a joint into the next free outlet of `parent` and returns its index.
    pub fn joint(&mut self, label: impl Into<String>, kind: PartKind, parent: Option<usize>) -> usize {
        self.add(label.into(), kind, 1, parent)
    }

    /// Plugs in a splitter and returns its index.
    pub fn splitter(&mut self, label: impl Into<String>, outlets: u8, parent: Option<usize>) -> usize {
        self.add(label.into(), PartKind::Splitter, outlets, parent)
    }

    fn add(&mut self, label: String, kind: PartKind, outlets: u8, parent: Option<usize>) -> usize {
        let outlet = self.parts.iter().filter(|p| parent.is_some() && p.parent == parent).count();
        let mut uid = PartUid::default();
        uid.0[..8].copy_from_slice(&self.uids.next_u64().to_be_bytes());
        uid.0[8..].copy_from_slice(&(self.parts.len() as u32).to_be_bytes());
        self.parts.push(BodyPart { label, kind, outlets, parent, outlet: outlet.min(255) as u8, uid });
        self.parts.len() - 1
    }

    /// The body.
    pub fn finish(self) -> Result<Body, BodyError> {
        Body::new(self.name, self.parts)
    }
}
