//! Weights from one mesh to another: clothes over a body (after Abdrashitov, Raichstat, Monsen and Hill, *Robust Skin
//! Weights Transfer via Weight Inpainting*, 2023).
//!
//! - [`transfer_weights`] takes weights from the nearest place of a mesh that has them, where it is near and faces the same
//!   way, and fills in the rest;
//! - [`inpaint_weights`] fills in the vertices of a mesh that have none, as smoothly as those around allow.
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_geometry::{Influences, TriangleMesh};
//! use armature_weights::transfer::{TransferSettings, transfer_weights};
//!
//! // A strip of skin whose ends follow two bones, and a patch of cloth over its middle.
//! let strip = |from: f64, to: f64, height: f64| {
//!     let vertices = vec![[from, 0.0, height], [to, 0.0, height], [to, 1.0, height], [from, 1.0, height]];
//!     TriangleMesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }
//! };
//! let (skin, cloth) = (strip(0.0, 4.0, 0.0), strip(1.0, 3.0, 0.05));
//! let weights = Influences::new(1, vec![0, 1, 1, 0], vec![1.0; 4], 2)?;
//! let go_on = &mut |_: &'static str, _: f64| ControlFlow::Continue(());
//! let made = transfer_weights(&skin, &weights, &cloth, &TransferSettings::default(), go_on)?;
//! assert_eq!(made.matched, 4);
//! assert!(made.rows[0].iter().any(|&(bone, weight)| bone == 1 && (weight - 0.25).abs() < 1e-12));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod inpaint_weights;
mod transfer_weights;

pub use error::TransferError;
pub use inpaint_weights::{Inpainted, WeightRow, inpaint_weights};
pub use transfer_weights::{TransferSettings, Transferred, transfer_weights};
