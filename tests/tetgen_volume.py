"""Times TetGen on a surface and the bones in it, for comparison with `armature volume --conforming`.

    python tetgen_volume.py mesh.obj skeleton.tgf

Needs the `tetgen` package (`pip install tetgen==0.8.4`), whose licence does not allow building it in: it is only run
alongside. Prints one JSON object: seconds, vertices and tetrahedra of TetGen with the switches `pq1.414Y`, on the
surface and points along every bone, two mean edges apart.
"""

import json
import sys
import time

SWITCHES = "pq1.414Y"


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
    return np.array(vertices), np.array(faces, dtype=np.int32)


def read_tgf(path):
    points, edges, section = {}, [], 0
    with open(path, encoding="utf-8") as file:
        for line in file:
            words = line.split()
            if words and words[0].startswith("#"):
                section += 1
            elif words and section == 0:
                points[words[0]] = [float(w) for w in words[1:4]]
            elif words and section == 1:
                edges.append((words[0], words[1]))
    return [(points[a], points[b]) for a, b in edges]


def along(np, bones, spacing):
    """Points along the bones, each once."""
    samples = []
    for head, tail in bones:
        head, tail = np.array(head), np.array(tail)
        count = max(1, int(np.ceil(np.linalg.norm(tail - head) / spacing)))
        samples += [head + (tail - head) * k / count for k in range(count + 1)]
    return np.unique(np.array(samples), axis=0)


def main():
    import numpy as np
    import tetgen

    vertices, faces = read_obj(np, sys.argv[1])
    edges = vertices[faces] - vertices[np.roll(faces, 1, axis=1)]
    samples = along(np, read_tgf(sys.argv[2]), 2 * np.linalg.norm(edges, axis=2).mean())
    generator = tetgen.TetGen(np.vstack([vertices, samples]), faces)
    start = time.perf_counter()
    result = generator.tetrahedralize(switches=SWITCHES)
    seconds = time.perf_counter() - start
    print(json.dumps({"seconds": seconds, "vertices": len(result[0]), "tetrahedra": len(result[1])}))


if __name__ == "__main__":
    main()
