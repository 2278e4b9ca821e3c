"""Times libigl's bounded biharmonic weights, for comparison with `armature-weights`.

    python libigl_bbw.py mesh.mesh b.npy bc.npy [weights.npy]

Needs the `libigl` package (`pip install libigl==2.6.3`). Prints one JSON object: seconds, the sum of the energies of all
handles' weights, and the largest distance of a weight from 0 to 1. The weights are saved if a fourth file is given.
"""

import json
import sys
import time


def read_mesh(np, path):
    """Vertices and tetrahedra of a Medit file."""
    with open(path, encoding="utf-8") as file:
        words = iter(file.read().split())
    vertices, tetrahedra = [], []
    for word in words:
        if word == "Vertices":
            for _ in range(int(next(words))):
                vertices.append([float(next(words)) for _ in range(3)])
                next(words)
        elif word == "Tetrahedra":
            for _ in range(int(next(words))):
                tetrahedra.append([int(next(words)) - 1 for _ in range(4)])
                next(words)
    return np.array(vertices), np.array(tetrahedra, dtype=np.int64)


def energy(igl, np, vertices, tetrahedra, weights):
    """The sum of 1/2 w' L M^-1 L w over all columns."""
    laplacian = igl.cotmatrix(vertices, tetrahedra)
    mass = igl.massmatrix(vertices, tetrahedra, igl.MASSMATRIX_TYPE_BARYCENTRIC).diagonal()
    curvature = laplacian @ weights
    return float(0.5 * np.sum(curvature**2 / mass[:, None]))


def main():
    import igl
    import numpy as np

    vertices, tetrahedra = read_mesh(np, sys.argv[1])
    fixed = np.load(sys.argv[2]).astype(np.int64).ravel()
    given = np.ascontiguousarray(np.load(sys.argv[3]), dtype=np.float64)
    start = time.perf_counter()
    weights = igl.bbw(vertices, tetrahedra, fixed, given)
    seconds = time.perf_counter() - start
    outside = float(max(0.0, -weights.min(), weights.max() - 1.0))
    if len(sys.argv) > 4:
        np.save(sys.argv[4], weights)
    told = {"seconds": seconds, "energy": energy(igl, np, vertices, tetrahedra, weights), "outside": outside}
    print(json.dumps(told))


if __name__ == "__main__":
    main()
