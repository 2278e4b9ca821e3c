//! Smooth surfaces from energies (thesis chapter 3): closing holes, joining rims, and editing with detail kept.
//!
//! A surface that minimises the Laplacian energy is biharmonic and can continue the tangents around it; one that minimises
//! the energy of the Laplacian's gradient is triharmonic and can continue their curvature. Both are solved for with
//! piecewise linear elements on triangles. A hole closed:
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_geometry::TriangleMesh;
//! use armature_geometry::surface::diagnose;
//! use armature_fairing::holes::{FillSettings, fill_holes, find_holes};
//!
//! // An octahedron of radius 1 without one of its faces.
//! let vertices = vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
//! let triangles = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5]];
//! let torn = TriangleMesh { vertices, triangles };
//! let holes = find_holes(&torn)?;
//! assert_eq!(holes.holes.len(), 1);
//! let mut progress = |_stage: &'static str, _done: f64| ControlFlow::Continue(());
//! let filled = fill_holes(&torn, &holes, &[0], &FillSettings::default(), &mut progress)?;
//! assert!(filled.patches[0].outcome.is_filled());
//! assert!(diagnose(&filled.mesh)?.closed);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | verbs |
//! |---|---|
//! | [`mixed`] | [`Fairing::precompute`](mixed::Fairing::precompute), [`Fairing::solve`](mixed::Fairing::solve): the equations, with region, curve and point conditions |
//! | [`holes`] | [`find_holes`](holes::find_holes), [`fill_holes`](holes::fill_holes), [`blend_rims`](holes::blend_rims), [`blend_on_domain`](holes::blend_on_domain) |
//! | [`edit`] | [`RegionEditor`](edit::RegionEditor): smooth displacements that follow dragged vertices |
//! | [`study`] | [`sample`](study::sample): errors on finer and finer meshes |
//!
//! This crate does no I/O, reads no clock and prints nothing. Equal input gives equal output whatever the number of threads.

pub mod edit;
pub mod holes;
pub mod mixed;
mod patch;
mod sparse;
pub mod study;

pub use patch::{Domain, DomainSettings, Join, PatchSettings, RimShape};
