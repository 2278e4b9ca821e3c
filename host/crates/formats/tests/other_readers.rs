//! Meshes that we write, read by other programs.
//!
//! `ARMATURE_MESHIO_PYTHON` names a Python that has the package `meshio` (and optionally `gmsh` and `vtk`). Without it
//! a check prints that it is skipped; in CI it fails.

use std::path::{Path, PathBuf};
use std::process::Command;

use armature_formats::mesh::{CellData, CellMesh, Cells, write_mesh, write_msh, write_vtu};
use armature_formats::model::Model;
use armature_formats::read_model;
use armature_formats::tables::{NumberTable, read_npy, write_npy};
use armature_geometry::TriangleMesh;
use armature_test_support::shared_bytes;
use serde_json::{Value, json};

fn meshio() -> Option<PathBuf> {
    let python = std::env::var_os("ARMATURE_MESHIO_PYTHON").filter(|value| !value.is_empty()).map(PathBuf::from);
    if python.is_none() {
        let in_ci = ["CI", "ARMATURE_REQUIRE_SHARED_DATA"].iter().all(|name| std::env::var_os(name).is_some());
        assert!(!in_ci, "ARMATURE_MESHIO_PYTHON must be set in CI: meshio was not run");
        println!("SKIPPED: ARMATURE_MESHIO_PYTHON is not set, so meshio was not run");
    }
    python
}

fn none(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name} does not exist"))
}

fn shared_model(name: &str) -> Option<Model> {
    Some(read_model(name, &shared_bytes(name)?, &none).unwrap_or_else(|error| panic!("{error}")))
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

/// We read our own `.mesh` files back bit for bit.
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

/// Saves one table with many number types, and checks that our file is the same table.
const NUMPY: &str = "
import sys, numpy as np
folder = sys.argv[1]
table = np.array([[1, 2, 3], [4, 5, 60]])
for kind in ['<f8', '>f8', '<f4', '<i8', '>i4', '<i2', 'u1', '<u4']:
    np.save(f'{folder}/c-{kind[-2:]}{kind[0] == chr(62)}.npy', table.astype(kind))
    np.save(f'{folder}/f-{kind[-2:]}{kind[0] == chr(62)}.npy', np.asfortranarray(table.astype(kind)))
np.save(f'{folder}/one.npy', np.array([7, 8, 9]))
np.save(f'{folder}/none.npy', np.zeros((0, 3)))
ours = np.load(f'{folder}/ours.npy')
assert ours.dtype == np.float64 and ours.shape == (2, 3) and (ours == table / 7).all(), ours
";

/// `NumPy`, which meshio needs, writes what we read and reads what we write.
#[test]
fn arrays_of_numpy() {
    let Some(python) = meshio() else { return };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("numpy");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).expect("the folder of an earlier run can be removed");
    }
    std::fs::create_dir_all(&folder).expect("a folder for the test");
    let columns = [1.0, 4.0, 2.0, 5.0, 3.0, 60.0];
    let ours = NumberTable { rows: 2, columns: 3, values: columns.iter().map(|v| v / 7.0).collect() };
    std::fs::write(folder.join("ours.npy"), write_npy(&ours)).expect("a file can be written");
    let output = Command::new(&python).args(["-c", NUMPY]).arg(&folder).output();
    let output = output.unwrap_or_else(|e| panic!("{}: {e}", python.display()));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |file: &Path| read_npy(&std::fs::read(file).expect("a file")).unwrap_or_else(|e| panic!("{e}"));
    let mut seen = 0;
    for entry in std::fs::read_dir(&folder).expect("the folder") {
        let file = entry.expect("an entry").path();
        if file.file_name().is_some_and(|name| name.to_string_lossy().contains('-')) {
            assert_eq!(
                read(&file),
                NumberTable { rows: 2, columns: 3, values: columns.to_vec() },
                "{}",
                file.display()
            );
            seen += 1;
        }
    }
    assert_eq!(seen, 16, "each kind in both orders");
    assert_eq!(read(&folder.join("one.npy")).indices(), Some(vec![7, 8, 9]));
    assert_eq!(read(&folder.join("none.npy")).rows, 0);
}
