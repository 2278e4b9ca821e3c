//! Skinning weights: how much every vertex of a mesh follows every bone of a skeleton.
//!
//! Three methods compute them: bounded biharmonic weights, on the tetrahedra of a volume or the triangles of a flat
//! figure, smooth and with a proven error bound; monotone weights, on any mesh, which also have no extrema of their own;
//! and bone heat, on the surface alone. A volume with a handle at either end, from mesh to weights:
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_geometry::TetrahedralMesh;
//! use armature_geometry::operators::{Lumping, cotangent_laplacian_tetrahedra, lumped_mass_tetrahedra};
//! use armature_weights::biharmonic::{BiharmonicProblem, BiharmonicSettings, bounded_biharmonic_weights};
//! use armature_weights::finish::normalise;
//! use armature_weights::handles::{Handle, HandleKind, handle_boundary};
//!
//! // Four tetrahedra in a row between the vertices 0 and 6.
//! let vertices = vec![[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [2.0, 0.0, 0.0]];
//! let mesh = TetrahedralMesh { vertices, tetrahedra: vec![[0, 1, 2, 3], [1, 2, 3, 4], [2, 3, 4, 5], [3, 4, 5, 6]] };
//! let laplacian = cotangent_laplacian_tetrahedra(&mesh)?.matrix;
//! let mass = lumped_mass_tetrahedra(&mesh, Lumping::Barycentric)?;
//! let point = |vertex| Handle { kind: HandleKind::Own, vertices: vec![vertex] };
//! let held = handle_boundary(&mesh.vertices, &[point(0), point(6)], &[])?;
//! let problem = BiharmonicProblem::new(&laplacian, &mass, &held);
//! let mut progress = |_stage: &'static str, _done: f64| ControlFlow::Continue(());
//! let mut solved = bounded_biharmonic_weights(&problem, &BiharmonicSettings::interactive(), &mut progress)?;
//! normalise(&mut solved.weights);
//! assert!((solved.weights.vertex(4).sum::<f64>() - 1.0).abs() < 1e-12);
//! assert!(solved.reports.iter().all(|report| report.error_bound < 2e-3));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The crate, module by module:
//!
//! | module | verbs |
//! |---|---|
//! | [`handles`] | [`handle_boundary`](handles::handle_boundary): turns bones, points, regions and cages into fixed vertices; [`free_joints`](handles::free_joints) |
//! | [`biharmonic`] | [`bounded_biharmonic_weights`](biharmonic::bounded_biharmonic_weights), [`exact_partition_weights`](biharmonic::exact_partition_weights), [`shape_preservation`](biharmonic::shape_preservation) |
//! | [`monotone`] | [`monotone_weights`](monotone::monotone_weights), [`monotone_functions`](monotone::monotone_functions): controlled extrema, smoothness of order 2 to 4; [`monotone_interpolation`](monotone::monotone_interpolation), [`smooth_keeping`](monotone::smooth_keeping) |
//! | [`heat`] | [`bone_heat`](heat::bone_heat) |
//! | [`finish`] | [`follow_nearest_handle`](finish::follow_nearest_handle), [`normalise`](finish::normalise), [`sparsify`](finish::sparsify), [`limit_influences`](finish::limit_influences) |
//! | [`transfer`] | [`transfer_weights`](transfer::transfer_weights) from a body to its clothes, [`inpaint_weights`](transfer::inpaint_weights) |
//! | [`endpoints`] | [`endpoint_weights`](endpoints::endpoint_weights), [`joint_weights`](endpoints::joint_weights), [`projected_endpoint_weights`](endpoints::projected_endpoint_weights): for bones that stretch and twist |
//! | [`harmonic`] | [`harmonic_function`](harmonic::harmonic_function), [`positive_conductances`](harmonic::positive_conductances) |
//! | [`extrema`] | [`local_extrema`](extrema::local_extrema), [`spurious_extrema`](extrema::spurious_extrema), [`persistence`](extrema::persistence), [`order_with_extrema`](extrema::order_with_extrema) |
//! | [`quadratic`] | [`constrained_minimum`](quadratic::constrained_minimum): any quadratic energy under linear equalities and inequalities |
//! | [`geodesic`] | [`geodesic_distance`](geodesic::geodesic_distance): along a surface |
//! | [`additional`] | [`additional_weights`](additional::additional_weights): further functions for reduced deformations |
//!
//! This crate does no I/O, reads no clock and prints nothing. Long computations report the current stage, in a few
//! words, and the fraction of the whole that is done to a callback that can stop them. Equal input gives equal weights
//! whatever the number of threads.

pub mod additional;
mod anderson;
pub mod biharmonic;
mod bone_segment;
pub mod endpoints;
pub mod extrema;
pub mod finish;
mod function_domain;
mod gather_reports;
pub mod geodesic;
pub mod handles;
pub mod harmonic;
pub mod heat;
pub mod monotone;
mod progress;
pub mod quadratic;
mod sparse;
pub mod transfer;
mod weight_matrix;

pub use bone_segment::BoneSegment;
pub use function_domain::FunctionDomain;
pub use sparse::cholesky::CholeskyError;
pub use weight_matrix::WeightMatrix;
