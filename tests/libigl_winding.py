"""Times libigl's winding numbers on one core, for comparison with `armature-geometry`.

    python libigl_winding.py mesh.obj

Needs the `libigl` package (`pip install libigl==2.6.3`). Prints one JSON object: microseconds per point of
`winding_number` and of `fast_winding_number` (without its precomputation), for random points in a box 1.2
times that of the mesh.
"""

import json
import os
import sys
import time

EXACT_POINTS = 2000
FAST_POINTS = 20000
FAST_RUNS = 5
FAST_RUNS = 5


def read_obj(np, path):
    vertices, faces = [], []
    with open(path, encoding="utf-8") as file:
        for line in file:
            words = line.split()
            if words[:1] == ["v"]:
                vertices.append([float(w) for w in words[1:4]])
            elif words[:1] == ["f"]:
                corners = [int(w.split("/")[0]) - 1 for w in words[1:]]
                faces.extend([corners[0], corners[k - 1], corners[k]] for k in range(2, len(corners)))
    return np.array(vertices), np.array(faces, dtype=np.int64)


def microseconds_a_point(work, points):
    start = time.perf_counter()
    work(points)
    return (time.perf_counter() - start) / len(points) * 1e6


def main():
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    import igl
    import numpy as np

    vertices, faces = read_obj(np, sys.argv[1])
    low, high = vertices.min(0), vertices.max(0)
    points = (low + high) / 2 + (np.random.default_rng(7).random((FAST_POINTS, 3)) - 0.5) * 1.2 * (high - low)
    exact = microseconds_a_point(lambda p: igl.winding_number(vertices, faces, p), points[:EXACT_POINTS])
    # Two sizes, so that one-off costs cancel out.
    few = FAST_POINTS // 10
    fast = lambda p: igl.fast_winding_number(vertices, faces, p)
    once_and_few = microseconds_a_point(fast, points[:few]) * few
    once_and_all = microseconds_a_point(fast, points) * FAST_POINTS
    print(json.dumps({"exact": exact, "fast": (once_and_all - once_and_few) / (FAST_POINTS - few)}))


if __name__ == "__main__":
    main()
