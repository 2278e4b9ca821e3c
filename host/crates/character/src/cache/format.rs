//! How a character file begins.

/// File name extension, without the dot.
pub const CACHE_EXTENSION: &str = "armature";
/// The newest layout. It differs from the one before in what it says of monotone weights, and only characters with such
/// weights are written in it.
pub(super) const FORMAT_VERSION: u32 = 7;
/// The first layout with more than parts and materials lit by lights.
pub(super) const COLORS_VERSION: u32 = 6;
/// The layout for one mesh and one material with a colour and its map. Such characters are still written in it: older
/// programs can read them.
pub(super) const SINGLE_MESH_VERSION: u32 = 4;
/// Increased when binding computes something different from the same input, so that the cache is not used.
pub(super) const BINDING_VERSION: u32 = 6;
/// The oldest layout that can still be read; it supports only bone heat.
pub(super) const OLDEST_VERSION: u32 = 1;

pub(super) const MAGIC: [u8; 8] = *b"ARMATURE";
pub(super) const HEADER: usize = 52;
