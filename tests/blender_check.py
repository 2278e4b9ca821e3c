"""Imports an exported file into a real Blender and compares it with what we computed.

    pip install bpy
    python tests/blender_check.py FILE.glb|FILE.bvh|FILE.fbx|FILE.usda|FILE.usdz EXPECTED.json

EXPECTED.json has the names of the bones and, for every clip, the number of frames, their duration and the positions
of the bones' heads at some frames, in our own axes (+Y up):

    {"bones": ["hips", ...],
     "clips": [{"name": "walk", "frames": 100, "frame_seconds": 0.04,
                "samples": [{"frame": 0, "heads": {"hips": [0, 1, 0], ...}}, ...]}]}

A clip with uneven keys has "seconds": [t0, t1, ...] instead of "frame_seconds". For a BVH file the first clip is used.
Bone names are compared as written in a BVH file (spaces and braces as underscores), and as USD allows them (letters,
digits and underscores). An FBX file must also bring the scene's rate along; of USD, Blender reads whole frames and leaves
the scene's rate as it is. Two things may be added, and are then compared: in a sample, "turns", the rotations of the
bones' frames as (x, y, z, w); and "meshes", each with the vertices in the file's order:

    [{"name": "body", "vertices": [[x, y, z], ...], "weights": [{"hips": 1.0}, ...],
      "shapes": {"smile": [[dx, dy, dz], ...]}}]

Exits with 0 if everything agrees, 1 if not, 2 if it could not be run.
"""

import json
import math
import os
import re
import sys

# Largest allowed distance of a bone's head from ours, as a fraction of the skeleton's size.
TOLERANCE = 1e-3
FRAMES_PER_SECOND = 60
# Largest allowed angle between a bone's frame and ours, in degrees.
ANGLE = 0.01
# Largest allowed difference of a weight, and of a vertex as a fraction of the mesh's size.
WEIGHT = 1e-4


def our_axes(v):
    """Blender is Z-up: its importers turn (x, y, z) into (x, -z, y)."""
    return (v[0], v[2], -v[1])


def import_glb(bpy, path):
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = FRAMES_PER_SECOND, 1.0
    bpy.ops.import_scene.gltf(filepath=path)


def import_bvh(bpy, path):
    bpy.ops.import_anim.bvh(
        filepath=path, axis_forward="-Z", axis_up="Y", frame_start=1, update_scene_fps=True, update_scene_duration=True
    )


def import_fbx(bpy, path):
    bpy.ops.preferences.addon_enable(module="io_scene_fbx")
    bpy.ops.import_scene.fbx(filepath=path, ignore_leaf_bones=False)


def import_usd(bpy, path):
    bpy.ops.wm.usd_import(filepath=path, set_frame_range=True)


def use_action(armature, action):
    """Blender 5 keeps the channels of an action in slots."""
    data = armature.animation_data or armature.animation_data_create()
    for track in data.nla_tracks:
        track.mute = True
    data.action = action
    if getattr(action, "slots", None):
        data.action_slot = action.slots[0]


def kind_of(path):
    extension = path.lower().rsplit(".", 1)[-1]
    return "usd" if extension in ("usda", "usdz") else extension


def action_of(bpy, clip, kind):
    actions = list(bpy.data.actions)
    if kind == "bvh":
        return actions[0] if len(actions) == 1 else None
    if kind == "usd":
        # Blend shapes have actions of their own.
        named = [a for a in actions if any(c.data_path.startswith("pose.") for c in curves_of(a))]
        return named[0] if len(named) == 1 else None
    if kind == "fbx":
        # The importer names an action after the armature, the stack and the layer.
        named = [a for a in actions if clip["name"] in a.name.split("|")]
        return named[0] if named else None
    named = [a for a in actions if a.name == clip["name"] or a.name.startswith(clip["name"] + "_")]
    return named[0] if named else None


def curves_of(action):
    return [c for layer in action.layers for strip in layer.strips for bag in strip.channelbags for c in bag.fcurves]


def frame_numbers(bpy, clip, kind):
    """Blender's frame of every frame of ours."""
    if kind == "bvh":
        return [1.0 + k for k in range(clip["frames"])]
    if kind == "usd":
        return [float(k) for k in range(clip["frames"])]
    seconds = clip.get("seconds") or [k * clip["frame_seconds"] for k in range(clip["frames"])]
    if kind == "fbx":
        # The importer counts with the whole number of frames a second, although it sets the true rate: a clip at 29.97
        # has its keys at the frames of 30.
        return [1.0 + t * bpy.context.scene.render.fps for t in seconds]
    return [t * FRAMES_PER_SECOND for t in seconds]


def plain(name):
    return re.sub(r"[\s{}]", "_", name)


def usd_names(names, fallback):
    """Our names of prims."""
    given = {}
    for index, name in enumerate(names):
        base = re.sub(r"[^A-Za-z0-9]", "_", name)
        base = base if base.strip("_") else f"{fallback}_{index + 1}"
        base = "_" + base if base[0].isdigit() else base
        unique, number = base, 2
        while unique in given.values():
            unique, number = f"{base}_{number}", number + 1
        given[name] = unique
    return given


def check(bpy, path, expected):
    """All differences, as sentences."""
    kind = kind_of(path)
    is_bvh = kind == "bvh"
    in_file = usd_names(expected["bones"], "bone") if kind == "usd" else {}
    in_file = in_file or {n: plain(n) if is_bvh else n for n in expected["bones"]}
    {"bvh": import_bvh, "glb": import_glb, "fbx": import_fbx, "usd": import_usd}[kind](bpy, path)
    armatures = [o for o in bpy.data.objects if o.type == "ARMATURE"]
    if len(armatures) != 1:
        return [f"there are {len(armatures)} armatures, expected 1"]
    armature = armatures[0]
    ours = [in_file[n] for n in expected["bones"]]
    theirs = [b.name for b in armature.data.bones]
    print(f"bones: {len(theirs)} in Blender, {len(ours)} expected")
    faults = []
    if len(theirs) != len(ours):
        faults.append(f"Blender has {len(theirs)} bones, we have {len(ours)}")
    if missing := sorted(set(ours) - set(theirs)):
        faults.append(f"bones missing in Blender: {', '.join(missing)}")
        return faults
    heads = [h for c in expected["clips"] for s in c["samples"] for h in s["heads"].values()]
    size = max((max(h[k] for h in heads) - min(h[k] for h in heads) for k in range(3)), default=0.0)
    for clip in expected["clips"][:1] if is_bvh else expected["clips"]:
        action = action_of(bpy, clip, kind)
        if action is None:
            faults.append(f"there is no action for the clip {clip['name']}: {[a.name for a in bpy.data.actions]}")
            continue
        faults += check_clip(bpy, armature, action, clip, kind, size, in_file)
    for mesh in expected.get("meshes", []):
        faults += check_mesh(bpy, armature, mesh, in_file)
    return faults


def check_mesh(bpy, armature, expected, in_file):
    """Vertices, weights and shape keys of one mesh."""
    name = expected["name"]
    found = [o for o in bpy.data.objects if o.type == "MESH" and o.name == name]
    if len(found) != 1:
        return [f"there is no mesh {name}: {[o.name for o in bpy.data.objects]}"]
    mesh = found[0]
    faults = []
    if not any(m.type == "ARMATURE" and m.object == armature for m in mesh.modifiers):
        faults.append(f"{name} does not follow the armature")
    if len(mesh.data.vertices) != len(expected["vertices"]):
        return faults + [f"{name} has {len(mesh.data.vertices)} vertices, expected {len(expected['vertices'])}"]
    size = max(max(v[k] for v in expected["vertices"]) - min(v[k] for v in expected["vertices"]) for k in range(3))
    keys = mesh.data.shape_keys.key_blocks if mesh.data.shape_keys else {}
    basis = [v.co for v in (keys[0].data if keys else mesh.data.vertices)]

    def furthest(points, wanted):
        there = [our_axes(mesh.matrix_world @ p) for p in points]
        return max((max(abs(a - b) for a, b in zip(p, q)) for p, q in zip(there, wanted)), default=0.0)

    off = furthest(basis, expected["vertices"])
    groups = {g.index: g.name for g in mesh.vertex_groups}
    weight_off = 0.0
    for vertex, wanted in zip(mesh.data.vertices, expected["weights"]):
        have = {groups[g.group]: g.weight for g in vertex.groups}
        wanted = {in_file[bone]: weight for bone, weight in wanted.items()}
        for bone in set(have) | set(wanted):
            weight_off = max(weight_off, abs(have.get(bone, 0.0) - wanted.get(bone, 0.0)))
    print(f"{name}: vertices off by {off:.3g} of {size:.4g}, weights by {weight_off:.3g}")
    if not off <= WEIGHT * size:
        faults.append(f"{name}: a vertex is off by {off} of {size}")
    if not weight_off <= WEIGHT:
        faults.append(f"{name}: a weight is off by {weight_off}")
    for shape, offsets in expected.get("shapes", {}).items():
        if shape not in keys:
            faults.append(f"{name}: there is no shape key {shape}: {[k.name for k in keys]}")
            continue
        wanted = [[a + b for a, b in zip(v, d)] for v, d in zip(expected["vertices"], offsets)]
        off = furthest([v.co for v in keys[shape].data], wanted)
        print(f"{name}, {shape}: vertices off by {off:.3g}")
        if not off <= WEIGHT * size:
            faults.append(f"{name}, {shape}: a vertex is off by {off} of {size}")
    return faults


def check_clip(bpy, armature, action, clip, kind, size, in_file):
    faults = []
    is_bvh = kind == "bvh"
    use_action(armature, action)
    numbers = frame_numbers(bpy, clip, kind)
    first, last = action.frame_range
    print(f"{clip['name']}: frames {first:.3f} to {last:.3f}, expected {numbers[0]:.3f} to {numbers[-1]:.3f}")
    if abs(first - numbers[0]) > 1e-2 or abs(last - numbers[-1]) > 1e-2:
        faults.append(f"{clip['name']}: frames {first} to {last}, expected {numbers[0]} to {numbers[-1]}")
    if kind in ("bvh", "fbx") and "frame_seconds" in clip:
        render = bpy.context.scene.render
        rate = render.fps / render.fps_base
        print(f"{clip['name']}: {rate:.4f} frames per second, expected {1 / clip['frame_seconds']:.4f}")
        if abs(rate * clip["frame_seconds"] - 1.0) > (1e-3 if is_bvh else 1e-6):
            faults.append(f"{clip['name']}: {rate} frames per second, expected {1 / clip['frame_seconds']}")
    for sample in clip["samples"]:
        number = numbers[sample["frame"]]
        bpy.context.scene.frame_set(int(number), subframe=number - int(number))
        bpy.context.view_layer.update()
        evaluated = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        worst, worst_bone = 0.0, ""
        for name, head in sample["heads"].items():
            bone = evaluated.pose.bones[in_file[name]]
            there = our_axes(evaluated.matrix_world @ bone.head)
            distance = sum((a - b) ** 2 for a, b in zip(there, head)) ** 0.5
            if not distance <= worst:
                worst, worst_bone = distance, name
        worst_turn = max((turned_by(armature, evaluated, in_file[name], q) for name, q in sample.get("turns", {}).items()), default=0)
        if not worst_turn <= ANGLE:
            faults.append(f"{clip['name']}, frame {sample['frame']}: a bone is turned by {worst_turn} degrees from ours")
        print(f"{clip['name']}, frame {sample['frame']}: bones turned by {worst_turn:.3g} degrees at most")
        print(f"{clip['name']}, frame {sample['frame']}: heads off by {worst:.3g} of {size:.4g} at most ({worst_bone})")
        if not worst <= TOLERANCE * size:
            faults.append(f"{clip['name']}, frame {sample['frame']}: {worst_bone} is off by {worst} of {size}")
    return faults


def turned_by(armature, evaluated, name, ours):
    """Degrees between a bone's frame and ours."""
    from mathutils import Matrix, Quaternion

    to_ours = Matrix(((1, 0, 0), (0, 0, 1), (0, -1, 0)))
    frame = to_ours @ (evaluated.matrix_world @ evaluated.pose.bones[name].matrix).to_3x3().normalized()
    x, y, z, w = ours
    wanted = Quaternion((w, x, y, z)).to_matrix()
    # The sine of half the angle from the distance of the matrices: exact for small angles in single precision.
    distance = sum((a - b) ** 2 for p, q in zip(frame, wanted) for a, b in zip(p, q)) ** 0.5
    return math.degrees(2 * math.asin(min(1.0, distance / 8**0.5)))


def main():
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    path, expected = os.path.abspath(sys.argv[1]), sys.argv[2]
    try:
        import bpy
    except ImportError as error:
        print(f"Blender's module is not installed: {error}; run pip install bpy", file=sys.stderr)
        return 2
    with open(expected, encoding="utf-8") as file:
        expected = json.load(file)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    faults = check(bpy, path, expected)
    for fault in faults:
        print(f"FAULT: {fault}")
    print("FAILED" if faults else "all agrees")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
