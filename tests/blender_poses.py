"""Imports files that we exported into a real Blender and compares how it poses their vertices with how we do.

    pip install bpy
    python tests/blender_poses.py FOLDER

For every NAME.glb in the folder that has a NAME.points beside it: 4-byte little-endian floats, for each of the frames 0,
LAST / 2 and LAST of the clip `take` at 30 a second the positions of all vertices in our axes (+Y up). NAME.frames holds
the three numbers and how many vertices there are, separated by spaces. Vertices are told apart by where they are in the
first of these frames; where several are at one place, any of them may be meant.

Prints a line for each file, and exits with 0 if all vertices agree to a thousandth of the size, 1 if not, 2 if it could
not be run.
"""

import os
import sys

from blender_check import action_of, use_action

TOLERANCE = 1e-3
FRAMES_PER_SECOND = 30


def evaluated(bpy, numpy):
    """All vertices of all meshes, in our axes."""
    graph = bpy.context.evaluated_depsgraph_get()
    found = []
    for made in (o for o in bpy.context.scene.objects if o.type == "MESH" and not o.hide_get()):
        made = made.evaluated_get(graph)
        mesh = made.to_mesh()
        points = numpy.empty(3 * len(mesh.vertices), numpy.float32)
        mesh.vertices.foreach_get("co", points)
        matrix = numpy.array(made.matrix_world)
        points = points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
        found.append(numpy.stack([points[:, 0], points[:, 2], -points[:, 1]], 1))
        made.to_mesh_clear()
    return numpy.concatenate(found) if found else numpy.empty((0, 3), numpy.float32)


def check(bpy, numpy, path):
    """How far a vertex is off at most, as a share of the size, and how many of ours are nowhere."""
    from mathutils.kdtree import KDTree

    with open(path[: -len(".glb")] + ".frames", encoding="utf-8") as file:
        *frames, count = map(int, file.read().split())
    ours = numpy.fromfile(path[: -len(".glb")] + ".points", "<f4").reshape(len(frames), count, 3)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps, bpy.context.scene.render.fps_base = FRAMES_PER_SECOND, 1.0
    bpy.ops.import_scene.gltf(filepath=path)
    # The importer makes a ball that shows bones.
    shapes = {bone.custom_shape for o in bpy.data.objects if o.type == "ARMATURE" for bone in o.pose.bones}
    for shape in shapes - {None}:
        bpy.data.objects.remove(shape)
    armatures = [o for o in bpy.data.objects if o.type == "ARMATURE"]
    action = action_of(bpy, {"name": "take"}, "glb")
    if len(armatures) != 1 or action is None:
        return float("inf"), f"{len(armatures)} armatures, actions {[a.name for a in bpy.data.actions]}"
    use_action(armatures[0], action)
    theirs = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        bpy.context.view_layer.update()
        theirs.append(evaluated(bpy, numpy))
    if len(theirs[0]) == 0:
        return float("inf"), "no vertices"
    size = float((ours[0].max(0) - ours[0].min(0)).max())
    tree = KDTree(len(theirs[0]))
    for index, point in enumerate(theirs[0]):
        tree.insert(point, index)
    tree.balance()
    worst = 0.0
    for vertex in range(count):
        same = [index for _, index, _ in tree.find_range(ours[0, vertex], TOLERANCE * size)]
        if not same:
            return float("inf"), f"vertex {vertex} at {ours[0, vertex]} is nowhere"
        max_over_frames = numpy.zeros(len(same))
        for k in range(len(frames)):
            off = numpy.linalg.norm(theirs[k][same] - ours[k, vertex], axis=1)
            max_over_frames = numpy.maximum(max_over_frames, off)
        worst = max(worst, float(max_over_frames.min()))
    moved = float(numpy.linalg.norm(ours[-1] - ours[0], axis=1).max()) / size
    return worst / size, f"{count} vertices, moved by up to {moved:.2f} of the size"


def main():
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        import bpy
        import numpy
    except ImportError as error:
        print(f"Blender's module is not installed: {error}; run pip install bpy", file=sys.stderr)
        return 2
    folder = os.path.abspath(sys.argv[1])
    names = sorted(n[: -len(".points")] for n in os.listdir(folder) if n.endswith(".points"))
    faults = 0
    for name in names:
        off, said = check(bpy, numpy, os.path.join(folder, name + ".glb"))
        faults += not off <= TOLERANCE
        print(f"{'FAULT' if not off <= TOLERANCE else 'agrees'}: {name}: off by {off:.2e}; {said}")
    print(f"{len(names)} files, {faults} do not agree")
    return 1 if faults or not names else 0


if __name__ == "__main__":
    sys.exit(main())
