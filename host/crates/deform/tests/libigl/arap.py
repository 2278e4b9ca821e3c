"""Deforms small shapes with libigl 2.6.3 (`pip install libigl==2.6.3 numpy`), every vertex free but a few that are held.

Writes the fixtures beside it: for each shape its vertices at rest (v), elements (e), held vertices and where they go
(h), and where libigl takes all of them (p).
"""

import pathlib

import igl
import numpy as np


def bar(n):
    """A bar along x of cubes of six tetrahedra each, somewhat crooked."""
    rng = np.random.default_rng(12)
    at = lambda x, y, z: (x * (n[1] + 1) + y) * (n[2] + 1) + z
    grid = np.stack(np.meshgrid(*(np.arange(k + 1) for k in n), indexing="ij"), -1).reshape(-1, 3)
    vertices = grid + rng.uniform(-0.1, 0.1, grid.shape)
    tetrahedra = []
    for x, y, z in np.ndindex(*n):
        corner = lambda bits: at(x + (bits >> 2 & 1), y + (bits >> 1 & 1), z + (bits & 1))
        for a, b in [(4, 6), (6, 2), (2, 3), (3, 1), (1, 5), (5, 4)]:
            tetrahedra.append([corner(0), corner(a), corner(b), corner(7)])
    tetrahedra = np.array(tetrahedra)
    p = vertices[tetrahedra]
    volume = np.einsum("ij,ij->i", np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), p[:, 3] - p[:, 0])
    tetrahedra[volume < 0] = tetrahedra[volume < 0][:, [1, 0, 2, 3]]
    return vertices, tetrahedra


def skin(vertices, tetrahedra):
    """The surface of a volume, facing outwards."""
    faces = tetrahedra[:, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, 1), axis=0, return_index=True, return_counts=True)
    faces = faces[np.sort(first[count == 1])]
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


def strip(n):
    """A crooked strip of triangles in the plane."""
    rng = np.random.default_rng(5)
    grid = np.stack(np.meshgrid(*(np.arange(k + 1) for k in n), indexing="ij"), -1).reshape(-1, 2)
    at = lambda x, y: x * (n[1] + 1) + y
    triangles = []
    for x, y in np.ndindex(*n):
        a, b, c, d = at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)
        triangles += [[a, b, c], [a, c, d]]
    return grid + rng.uniform(-0.15, 0.15, grid.shape), np.array(triangles)


def solve(name, vertices, elements, energy, turn, shift):
    """Holds both ends, one where it is, the other turned and shifted."""
    near = np.flatnonzero(vertices[:, 0] < 0.5)
    far = np.flatnonzero(vertices[:, 0] > vertices[:, 0].max() - 0.7)
    middle = vertices[far].mean(0)
    held = np.concatenate([near, far])
    to = np.concatenate([vertices[near], (vertices[far] - middle) @ turn.T + middle + shift])
    data = igl.ARAPData()
    data.energy = energy
    data.max_iter = 500
    igl.arap_precomputation(vertices, elements, vertices.shape[1], held.astype(np.int32), data)
    posed = vertices.copy()
    for _ in range(40):
        before = posed
        posed = igl.arap_solve(to, data, before)
        if np.abs(posed - before).max() < 1e-6:
            break
    else:
        raise SystemExit(f"{name} did not settle")
    wide = lambda p: np.column_stack([p, np.zeros((len(p), 3 - p.shape[1]))])
    with open(pathlib.Path(__file__).with_name(f"{name}.txt"), "w") as out:
        rows = lambda key, rows, form: [print(key, *(form % c for c in row), file=out) for row in rows]
        rows("v", wide(vertices), "%.9f")
        rows("e", elements, "%d")
        for vertex, point in zip(held, wide(to)):
            print("h", vertex, *("%.9f" % c for c in point), file=out)
        rows("p", wide(posed), "%.9f")
    print(name, len(vertices), len(elements))


def swing(name, vertices, tetrahedra, stiffness, length, steps, gravity):
    """Holds one end and lets the rest fall for a few implicit steps from rest (`with_dynamics`)."""
    held = np.flatnonzero(vertices[:, 0] < 0.5)
    data = igl.ARAPData()
    data.energy = igl.ARAP_ENERGY_TYPE_ELEMENTS
    data.with_dynamics = True
    data.h, data.ym, data.max_iter = length, stiffness, 500
    igl.arap_precomputation(vertices, tetrahedra, 3, held.astype(np.int32), data)
    mass = igl.massmatrix(vertices, tetrahedra, igl.MASSMATRIX_TYPE_BARYCENTRIC).diagonal()
    data.f_ext = mass[:, None] * gravity
    posed = vertices.copy()
    for _ in range(steps):
        posed = igl.arap_solve(vertices[held], data, posed)
    with open(pathlib.Path(__file__).with_name(f"{name}.txt"), "w") as out:
        print("d", stiffness, length, steps, *gravity, file=out)
        for key, rows, form in [("v", vertices, "%.9f"), ("e", tetrahedra, "%d")]:
            for row in rows:
                print(key, *(form % c for c in row), file=out)
        for vertex in held:
            print("h", vertex, *("%.9f" % c for c in vertices[vertex]), file=out)
        for row in posed:
            print("p", *("%.9f" % c for c in row), file=out)
    print(name, np.abs(posed - vertices).max())


def about_z(angle):
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])


def about_x(angle):
    return np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])


volume = bar([6, 2, 2])
surface = skin(*volume)
bend = about_z(0.8) @ about_x(0.4)
shift = np.array([-0.8, 1.5, 0.3])
solve("spokes", *surface, igl.ARAP_ENERGY_TYPE_SPOKES, bend, shift)
solve("spokes-and-rims", *surface, igl.ARAP_ENERGY_TYPE_SPOKES_AND_RIMS, bend, shift)
solve("tetrahedra", *volume, igl.ARAP_ENERGY_TYPE_ELEMENTS, bend, shift)
solve("planar", *strip([8, 2]), igl.ARAP_ENERGY_TYPE_ELEMENTS, about_z(0.9)[:2, :2], np.array([-1.2, 2.0]))
swing("swing", *volume, 4.0, 1.04**-105, 30, np.array([0.5, -10.0, 0.0]))
swing("hang", *volume, 40.0, 1.04**-59, 400, np.array([0.5, -10.0, 0.0]))
