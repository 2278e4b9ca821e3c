//! Shared by the examples: reading a MESH file and libigl's `boundary_conditions` arrays (the fixed vertices and their
//! weights), and printing how long each stage of a computation takes.
#![allow(dead_code, unused_imports, reason = "each example uses its own part of this module")]

#[path = "../../tests/support/mod.rs"]
mod files;

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use armature_geometry::operators::{Lumping, SparseMatrix, cotangent_laplacian_tetrahedra, lumped_mass_tetrahedra};
use armature_test_support::{read_npy, read_npy_indices};
use armature_weights::biharmonic::BiharmonicProblem;

pub(crate) use files::{read_obj, read_tgf};

/// A mesh's operators and its fixed weights.
pub(crate) struct GivenOnMesh {
    laplacian: SparseMatrix,
    mass: Vec<f64>,
    fixed: Vec<usize>,
    given: Vec<f64>,
    handles: usize,
}

impl GivenOnMesh {
    /// Reads the files that the command line names and returns the further arguments; exits if files are missing.
    pub(crate) fn from_command_line(example: &str, further: &str) -> (Self, Vec<String>) {
        let arguments: Vec<String> = std::env::args().skip(1).collect();
        let [mesh, fixed, given, rest @ ..] = arguments.as_slice() else {
            eprintln!("usage: {example} mesh.mesh b.npy bc.npy {further}");
            std::process::exit(2);
        };
        (Self::read(mesh, fixed, given), rest.to_vec())
    }

    /// Reads `mesh.mesh`, `b.npy` and `bc.npy`.
    fn read(mesh: &str, fixed: &str, given: &str) -> Self {
        let mesh = files::read_mesh(Path::new(mesh));
        let fixed = read_npy_indices(Path::new(fixed));
        let given = read_npy(Path::new(given));
        println!("{} vertices, {} tetrahedra, {} handles", mesh.vertices.len(), mesh.tetrahedra.len(), given.columns);
        Self {
            laplacian: cotangent_laplacian_tetrahedra(&mesh).expect("a mesh").matrix,
            mass: lumped_mass_tetrahedra(&mesh, Lumping::Barycentric).expect("a mesh"),
            fixed,
            given: given.values,
            handles: given.columns,
        }
    }

    pub(crate) fn problem(&self) -> BiharmonicProblem<'_> {
        BiharmonicProblem {
            laplacian: &self.laplacian,
            mass: &self.mass,
            fixed: &self.fixed,
            fixed_weights: &self.given,
            handles: self.handles,
            shape_preservation: None,
        }
    }
}

/// A progress callback that prints how long each stage took.
pub(crate) fn stopwatch() -> impl FnMut(&'static str, f64) -> ControlFlow<()> {
    let mut last: Option<(&'static str, Instant)> = None;
    move |stage, _| {
        let entered = last.is_none_or(|(before, _)| before != stage);
        if entered && let Some((before, since)) = last.replace((stage, Instant::now())) {
            println!("{before}: {:.1} ms", since.elapsed().as_secs_f64() * 1e3);
        }
        ControlFlow::Continue(())
    }
}
