"""The printable puppet: builds every part as an STL file.

    parts.py FOLDER [NAME=MILLIMETRES ...]      parameters: design.py
"""
import struct
import sys
from pathlib import Path

import numpy as np

from bend import Bend
from design import parse
from hubs import Base, Clip, Splitter
from twist import Twist


def everything(d):
    """All parts as they lie on the bed: name to solid."""
    makers = [Bend(d), Twist(d), *(Splitter(d, n) for n in range(2, 6)), Base(d), Clip(d)]
    return {name: on_the_bed(solid) for maker in makers for name, solid in maker.printed()}


def on_the_bed(solid):
    solid = solid.as_original().simplify(0.002)
    low = solid.bounding_box()
    return solid.translate((-(low[0] + low[3]) / 2, -(low[1] + low[4]) / 2, -low[2]))


def write_stl(path, solid):
    mesh = solid.to_mesh()
    corners = np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    record = np.zeros(len(corners), dtype=[("normal", "<3f4"), ("corners", "<9f4"), ("unused", "<u2")])
    record["normal"], record["corners"] = normals, corners.reshape(-1, 9)
    path.write_bytes(b"Armature: a part of a puppet, in millimetres".ljust(80) + struct.pack("<I", len(corners)) + record.tobytes())


def main():
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, solid in everything(parse(sys.argv[2:])).items():
        write_stl(folder / f"{name}.stl", solid)
        size = " × ".join(f"{high - low:.0f}" for low, high in zip(solid.bounding_box()[:3], solid.bounding_box()[3:]))
        print(f"{name:20} {size} mm, {solid.volume() / 1000:.1f} cm³")


if __name__ == "__main__":
    main()
