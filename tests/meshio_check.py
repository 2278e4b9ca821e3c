"""Reads meshes that we wrote with other people's readers, and compares every number with ours.

    pip install meshio
    python tests/meshio_check.py EXPECTED.json FILE.mesh FILE.msh FILE.vtu ...

EXPECTED.json has the mesh: {"vertices": [[x, y, z], ...], "kind": "tetra" or "triangle", "cells": [[a, b, ...], ...],
"data": {"winding": [...]}}. A `.mesh` file carries no data. If the `gmsh` package is installed, it reads the `.msh`
files too, and if `vtk` is, it reads the `.vtu` files.

Exits with 0 if everything agrees to the last bit, 1 if not, 2 if it could not be run.
"""

import json
import sys


def differences(np, what, points, cells, data, expected, with_data):
    """All differences, as sentences."""
    faults = []
    if not np.array_equal(points, expected["vertices"]):
        faults.append(f"{what}: the vertices are not ours ({len(points)}, {len(expected['vertices'])} expected)")
    if not np.array_equal(cells, expected["cells"]):
        faults.append(f"{what}: the cells are not ours ({len(cells)}, {len(expected['cells'])} expected)")
    for name, values in expected["data"].items() if with_data else ():
        if name not in data:
            faults.append(f"{what}: there is no {name!r}, only {sorted(data)}")
        elif not np.array_equal(np.ravel(data[name]), values):
            faults.append(f"{what}: the numbers of {name!r} are not ours")
    return faults


def by_meshio(np, path, expected):
    import meshio

    mesh = meshio.read(path)
    kind = expected["kind"]
    cells = [block.data for block in mesh.cells if block.type == kind]
    data = {name: blocks[-1] for name, blocks in mesh.cell_data.items()}
    with_data = not path.endswith(".mesh")
    if len(cells) != 1:
        return [f"meshio, {path}: there are {len(cells)} blocks of kind {kind}"]
    return differences(np, f"meshio, {path}", mesh.points, cells[0], data, expected, with_data)


def by_gmsh(np, path, expected):
    import gmsh

    gmsh.initialize(["-v", "0"])
    gmsh.open(path)
    tags, points, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    kind, size = {"triangle": (2, 3), "tetra": (4, 4)}[expected["kind"]]
    element_tags, nodes = gmsh.model.mesh.getElementsByType(kind)
    cells = nodes.reshape(-1, size).astype(np.int64) - 1
    data = {}
    for view in gmsh.view.getTags():
        _, tags_of_data, values, _, _ = gmsh.view.getModelData(view, 0)
        name = gmsh.view.option.getString(view, "Name")
        data[name] = values if np.array_equal(tags_of_data, element_tags) else []
    gmsh.finalize()
    return differences(np, f"gmsh, {path}", points.reshape(-1, 3)[order], cells, data, expected, True)


def by_vtk(np, path, expected):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    grid = reader.GetOutput()
    points = vtk_to_numpy(grid.GetPoints().GetData())
    size = {"triangle": 3, "tetra": 4}[expected["kind"]]
    cells = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, size)
    arrays = grid.GetCellData()
    data = {arrays.GetArrayName(k): vtk_to_numpy(arrays.GetArray(k)) for k in range(arrays.GetNumberOfArrays())}
    return differences(np, f"vtk, {path}", points, cells, data, expected, True)


def main():
    if len(sys.argv) < 3:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        import meshio  # noqa: F401
        import numpy as np
    except ImportError as error:
        print(f"meshio is not installed: {error}; run pip install meshio", file=sys.stderr)
        return 2
    with open(sys.argv[1], encoding="utf-8") as file:
        expected = json.load(file)
    faults = []
    for path in sys.argv[2:]:
        readers = [by_meshio]
        readers += [by_gmsh] if path.endswith(".msh") and installed("gmsh") else []
        readers += [by_vtk] if path.endswith(".vtu") and installed("vtkmodules") else []
        for reader in readers:
            found = reader(np, path, expected)
            print(f"{reader.__name__}: {path}: {'FAILED' if found else 'agrees'}")
            faults += found
    for fault in faults:
        print(f"FAULT: {fault}")
    return 1 if faults else 0


def installed(module):
    import importlib.util

    return importlib.util.find_spec(module) is not None


if __name__ == "__main__":
    sys.exit(main())
