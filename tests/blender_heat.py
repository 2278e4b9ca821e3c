"""Times Blender's automatic (bone heat) weights, for comparison with `armature-weights`.

    python blender_heat.py mesh.obj skeleton.tgf [weights.f64]

Needs the `bpy` module (`pip install bpy==5.0.1`, Python 3.11). Prints one JSON object: `seconds` is the time of the
one operator that computes the weights, without reading the files or building the scene. The optional third file
receives the weights as little-endian f64, vertices x bones, column-major, one bone for every edge of the TGF file.
"""

import array
import json
import os
import sys
import time


def read_obj(path):
    vertices, faces = [], []
    with open(path, encoding="utf-8") as file:
        for line in file:
            words = line.split()
            if not words:
                continue
            if words[0] == "v":
                vertices.append(tuple(float(w) for w in words[1:4]))
            elif words[0] == "f":
                corners = [int(w.split("/")[0]) for w in words[1:]]
                corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
                faces.extend((corners[0], corners[k - 1], corners[k]) for k in range(2, len(corners)))
    return vertices, faces


def read_tgf(path):
    joints, edges, in_edges = {}, [], False
    with open(path, encoding="utf-8") as file:
        for line in file:
            words = line.split()
            if words and words[0].startswith("#"):
                if in_edges:
                    break
                in_edges = True
            elif in_edges and len(words) >= 2:
                edges.append((joints[int(words[0])], joints[int(words[1])]))
            elif len(words) >= 4:
                joints[int(words[0])] = tuple(float(w) for w in words[1:4])
    return edges


def build_scene(bpy, vertices, faces, bones):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("mesh")
    mesh.from_pydata(vertices, [], faces)
    body = bpy.data.objects.new("body", mesh)
    rig = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    for thing in (body, rig):
        bpy.context.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for index, (head, tail) in enumerate(bones):
        bone = rig.data.edit_bones.new(f"bone{index}")
        bone.head, bone.tail = head, tail
    bpy.ops.object.mode_set(mode="OBJECT")
    body.select_set(True)
    rig.select_set(True)
    return body


def read_weights(body, bone_count):
    count = len(body.data.vertices)
    weights = array.array("d", bytes(8 * count * bone_count))
    columns = {group.index: int(group.name.removeprefix("bone")) for group in body.vertex_groups}
    for vertex in body.data.vertices:
        for element in vertex.groups:
            weights[columns[element.group] * count + vertex.index] = element.weight
    return weights


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    import bpy

    vertices, faces = read_obj(sys.argv[1])
    bones = read_tgf(sys.argv[2])
    body = build_scene(bpy, vertices, faces, bones)
    # Blender reports on standard output; keep that for the one JSON object.
    kept = os.dup(1)
    os.dup2(2, 1)
    start = time.perf_counter()
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")
    seconds = time.perf_counter() - start
    os.dup2(kept, 1)
    weights = read_weights(body, len(bones))
    if len(sys.argv) == 4:
        if sys.byteorder == "big":
            weights.byteswap()
        with open(sys.argv[3], "wb") as file:
            weights.tofile(file)
    weighted = sum(1 for vertex in body.data.vertices if vertex.groups)
    print(
        json.dumps(
            {
                "program": f"Blender {bpy.app.version_string}",
                "seconds": seconds,
                "vertices": len(vertices),
                "triangles": len(faces),
                "bones": len(bones),
                "weighted_vertices": weighted,
            }
        )
    )


if __name__ == "__main__":
    main()
