//! Pictures without a window: a character in a pose, moments of a motion, a skeleton in a mesh, weights or other functions on a mesh, a slice
//! through a volume.

mod character;
mod filmstrip;
pub mod function;
mod ink;
pub mod rig;
mod scene;
pub mod slice;
pub mod text;
pub mod weights;

pub use character::{Skinned, draw, skin_once, write_picture};
pub use filmstrip::write_filmstrip;
pub use scene::{DrawnBy, View, draw_mesh, draw_scene};
