//! Meshes that we write, in the readers of others.
//!
//! `ARMATURE_MESHIO_PYTHON` names a Python that has the package `meshio` (and, if one likes, `gmsh` and `vtk`). Without
//! it a check says loudly that it is skipped; in CI that is a failure.

mod common;

use std::path::{Path, PathBuf};
use std::process::Command;

use armature_formats::{CellData, CellMesh, Cells, Model, read_model, write_mesh, write_msh, write_vtu};
use armature_geometry::TriangleMesh;
use serde_json::{Value, json};

fn meshio() -> Option<PathBuf> {
    let python = std::env::var_os("ARMATURE_MESHIO_PYTHON").filter(|value| !value.is_empty()).map(PathBuf::from);
    if python.is_none() {
        let in_ci = ["CI", "ARMATURE_REQUIRE_SHARED_DATA"].iter().all(|name| std::env::var_os(name).is_some());
        assert!(!in_ci, "ARMATURE_MESHIO_PYTHON has to be set in CI: meshio is not asked");
        println!("SKIPPED: ARMATURE_MESHIO_PYTHON is not set, so meshio is not asked");
    }
    python
}

fn none(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name} is not there"))
}

fn shared_model(name: &str) -> Option<Model> {
    Some(read_model(name, &common::shared(name)?, &none).unwrap_or_else(|error| panic!("{error}")))
}

/// Writes a mesh in every format and has it read again.
fn check(name: &str, mesh: &CellMesh) {
    let Some(python) = meshio() else { return };
    let (kind, cells): (_, Value) = match mesh.cells {
        Cells::Triangles(triangles) => ("triangle", json!(triangles)),
        Cells::Tetrahedra { tetrahedra, .. } => ("tetra", json!(tetrahedra)),
    };
    let count = cells.as_array().map_or(0, Vec::len);
    let winding: Vec<f64> = (0..count).map(|i| 1.0 + 1e-3 * (i as f64).sin()).collect();
    let expected = json!({"vertices": mesh.vertices, "kind": kind, "cells": cells, "data": {"winding": winding}});
    let data = [CellData { name: "winding", values: &winding }];
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).expect("a folder for the test");
    let mut files = Vec::new();
    for (extension, text) in [
        ("json", expected.to_string()),
        ("mesh", write_mesh(mesh)),
        ("msh", write_msh(mesh, &data).expect("a number for every cell")),
        ("vtu", write_vtu(mesh, &data).expect("a number for every cell")),
    ] {
        let file = folder.join(format!("a.{extension}"));
        std::fs::write(&file, text).expect("a file can be written");
        files.push(file);
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests/meshio_check.py");
    let output = Command::new(&python).arg(script).args(&files).output();
    let output = output.unwrap_or_else(|e| panic!("{}: {e}", python.display()));
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    println!("{said}");
    assert!(output.status.success(), "{name}: {said}");
}

#[test]
fn a_volume_and_its_surface() {
    let Some(model) = shared_model("hand.mesh") else { return };
    let volume = model.tetrahedra.as_ref().expect("it is a volume");
    check("hand", &CellMesh::of_tetrahedra(volume, &model.mesh.triangles));
}

#[test]
fn a_volume_alone() {
    let Some(model) = shared_model("octopus-low.mesh") else { return };
    check("octopus", &CellMesh::of_tetrahedra(model.tetrahedra.as_ref().expect("it is a volume"), &[]));
}

#[test]
fn a_flat_domain() {
    let Some(model) = shared_model("woody.obj") else { return };
    check("woody", &CellMesh::of_triangles(&model.mesh));
}

/// Numbers at the ends of the double range, for which text needs all its digits.
#[test]
fn awkward_numbers() {
    let third = 1.0 / 3.0;
    let vertices = vec![[1e-300, -0.0, third], [1e300, 1e-5, 123_456_789.123_456_79], [-third, 1e16 + 2.0, 0.1 + 0.2]];
    check("awkward", &CellMesh::of_triangles(&TriangleMesh { vertices, triangles: vec![[2, 0, 1]] }));
}

/// What is written as `.mesh` is read by us as it was, bit for bit.
#[test]
fn our_own_reader_gives_the_volume_back() {
    for name in ["hand.mesh", "octopus-low.mesh"] {
        let Some(model) = shared_model(name) else { return };
        let volume = model.tetrahedra.as_ref().expect("it is a volume");
        let text = write_mesh(&CellMesh::of_tetrahedra(volume, &model.mesh.triangles));
        let again = read_model(name, text.as_bytes(), &none).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((&again.mesh, &again.tetrahedra), (&model.mesh, &model.tetrahedra), "{name}");
    }
}
