//! Mixed finite elements for the Laplacian energy and the Laplacian gradient energy (thesis chapter 3): surfaces that
//! solve `Δ²u = g` or `Δ³u = g`, with piecewise linear elements only.
//!
//! [`Fairing::precompute`] factorises a problem, [`Fairing::solve`] solves it for values of its conditions, again and again
//! while they change. Auxiliary variables stand for the Laplacian, v = Δu, and w = Δv; the full mixed system keeps them
//! (3.11, 3.13, 3.16, 3.18), the reduced one is in u alone (3.12).

mod conditions;
mod elements;
mod error;
mod fairing;
mod mixed_system;
mod problem;
mod reduced_system;
mod two_rows;

pub use conditions::{Conditions, Values};
pub use elements::Elements;
pub use error::FairingError;
pub use fairing::{Fairing, Solution};
pub use problem::{BentCurves, Energy, Form, Mass, Settings};
