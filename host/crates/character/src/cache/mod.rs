//! A bound character as bytes ([`to_bytes`]) and back ([`from_bytes`]), its name in the cache ([`cache_key`]),
//! and what takes know it by ([`content_hash`]).
//!
//! ```
//! use armature_character::cache::{from_bytes, to_bytes};
//!
//! let hand = armature_character::own::hand()?;
//! assert_eq!(from_bytes(&to_bytes(&hand))?, hand, "bit for bit");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod avatar;
mod bytes;
mod content_hash;
mod error;
mod file;
mod format;
mod key;
mod parts;
mod provenance;
mod skin;

pub use content_hash::{content_hash, content_hash_of};
pub use error::CacheError;
pub use file::{from_bytes, to_bytes};
pub use format::CACHE_EXTENSION;
pub use key::{CacheKey, cache_key};
