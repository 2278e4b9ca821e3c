"""Imports an exported file into a real Blender and compares it with what we computed.

    pip install bpy
    python tests/blender_check.py FILE.glb|FILE.bvh EXPECTED.json

EXPECTED.json has the names of the bones and, for every clip, the number of frames, their duration and the positions
of the bones' heads at some frames, in our own axes (+Y up):

    {"bones": ["hips", ...],
     "clips": [{"name": "walk", "frames": 100, "frame_seconds": 0.04,
                "samples": [{"frame": 0, "heads": {"hips": [0, 1, 0], ...}}, ...]}]}

A clip with uneven keys has "seconds": [t0, t1, ...] instead of "frame_seconds". For a BVH file the first clip is used.
Bone names are compared as written in a BVH file (spaces and braces as underscores).

Exits with 0 if everything agrees, 1 if not, 2 if it could not be run.
"""

import json
import os
import re
import sys

# Largest allowed distance of a bone's head from ours, as a fraction of the skeleton's size.
TOLERANCE = 1e-3
FRAMES_PER_SECOND = 60


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


def use_action(armature, action):
    """Blender 5 keeps the channels of an action in slots."""
    data = armature.animation_data or armature.animation_data_create()
    for track in data.nla_tracks:
        track.mute = True
    data.action = action
    if getattr(action, "slots", None):
        data.action_slot = action.slots[0]


def action_of(bpy, clip, only):
    actions = list(bpy.data.actions)
    if only:
        return actions[0] if len(actions) == 1 else None
    named = [a for a in actions if a.name == clip["name"] or a.name.startswith(clip["name"] + "_")]
    return named[0] if named else None


def frame_numbers(clip, is_bvh):
    """Blender's frame of every frame of ours."""
    if is_bvh:
        return [1.0 + k for k in range(clip["frames"])]
    seconds = clip.get("seconds") or [k * clip["frame_seconds"] for k in range(clip["frames"])]
    return [t * FRAMES_PER_SECOND for t in seconds]


def plain(name):
    return re.sub(r"[\s{}]", "_", name)


def check(bpy, path, expected):
    """All differences, as sentences."""
    is_bvh = path.lower().endswith(".bvh")
    (import_bvh if is_bvh else import_glb)(bpy, path)
    armatures = [o for o in bpy.data.objects if o.type == "ARMATURE"]
    if len(armatures) != 1:
        return [f"there are {len(armatures)} armatures, expected 1"]
    armature = armatures[0]
    ours = [plain(n) if is_bvh else n for n in expected["bones"]]
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
        action = action_of(bpy, clip, is_bvh)
        if action is None:
            faults.append(f"there is no action for the clip {clip['name']}: {[a.name for a in bpy.data.actions]}")
            continue
        faults += check_clip(bpy, armature, action, clip, is_bvh, size)
    return faults


def check_clip(bpy, armature, action, clip, is_bvh, size):
    faults = []
    use_action(armature, action)
    numbers = frame_numbers(clip, is_bvh)
    first, last = action.frame_range
    print(f"{clip['name']}: frames {first:.3f} to {last:.3f}, expected {numbers[0]:.3f} to {numbers[-1]:.3f}")
    if abs(first - numbers[0]) > 1e-2 or abs(last - numbers[-1]) > 1e-2:
        faults.append(f"{clip['name']}: frames {first} to {last}, expected {numbers[0]} to {numbers[-1]}")
    if is_bvh and "frame_seconds" in clip:
        render = bpy.context.scene.render
        rate = render.fps / render.fps_base
        print(f"{clip['name']}: {rate:.4f} frames per second, expected {1 / clip['frame_seconds']:.4f}")
        if abs(rate * clip["frame_seconds"] - 1.0) > 1e-3:
            faults.append(f"{clip['name']}: {rate} frames per second, expected {1 / clip['frame_seconds']}")
    for sample in clip["samples"]:
        number = numbers[sample["frame"]]
        bpy.context.scene.frame_set(int(number), subframe=number - int(number))
        bpy.context.view_layer.update()
        evaluated = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        worst, worst_bone = 0.0, ""
        for name, head in sample["heads"].items():
            bone = evaluated.pose.bones[plain(name) if is_bvh else name]
            there = our_axes(evaluated.matrix_world @ bone.head)
            distance = sum((a - b) ** 2 for a, b in zip(there, head)) ** 0.5
            if not distance <= worst:
                worst, worst_bone = distance, name
        print(f"{clip['name']}, frame {sample['frame']}: heads off by {worst:.3g} of {size:.4g} at most ({worst_bone})")
        if not worst <= TOLERANCE * size:
            faults.append(f"{clip['name']}, frame {sample['frame']}: {worst_bone} is off by {worst} of {size}")
    return faults


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
