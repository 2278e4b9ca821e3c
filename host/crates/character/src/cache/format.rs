//! How a character file begins.

/// File name extension, without the dot.
pub const CACHE_EXTENSION: &str = "armature";
/// The newest layout.
pub(super) const FORMAT_VERSION: u32 = SKIN_VERSION;
/// The first layout that knows monotone weights.
pub(super) const MONOTONE_VERSION: u32 = 7;
/// The first layout with more than parts and materials lit by lights.
pub(super) const COLORS_VERSION: u32 = 6;
/// The first layout that says what is beside the images of maps, and what a VRM avatar says of itself.
pub(super) const AVATAR_VERSION: u32 = 8;
/// The first layout that says how the skin follows the bones.
pub(super) const SKIN_VERSION: u32 = 9;
/// The layout for one mesh and one material with a colour and its map. Such characters are still written in it: older
/// programs can read them.
pub(super) const SINGLE_MESH_VERSION: u32 = 4;
/// Increased when binding computes something different from the same input, so that the cache is not used.
pub(super) const BINDING_VERSION: u32 = 6;
/// The oldest layout that can still be read; it supports only bone heat.
pub(super) const OLDEST_VERSION: u32 = 1;

pub(super) const MAGIC: [u8; 8] = *b"ARMATURE";
pub(super) const HEADER: usize = 52;
