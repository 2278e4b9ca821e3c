"""Lets a real Blender follow a live stream through our extension, and records it.

    python tests/blender_link.py EXTENSION_FOLDER CHARACTER.glb RESULT.json

Prints "port N" when it listens, and ends when no pose has come for two seconds. RESULT.json has, in Blender's axes, for
every pose the puppet's time and how each bone is turned compared with its rest (w, x, y, z) and where its head is; the
same from the recorded action for every frame; and whether the rig itself is as before.
"""

import json
import os
import sys
import time

import bpy

FRAMES_PER_SECOND = 30
SILENT_SECONDS = 2.0
PATIENCE_SECONDS = 120.0
FIRST_FRAME = 5


def state(armature):
    bpy.context.view_layer.update()
    bones = {}
    for bone in armature.pose.bones:
        turn = bone.matrix.to_quaternion() @ bone.bone.matrix_local.to_quaternion().inverted()
        bones[bone.name] = {"turn": list(turn), "head": list(bone.matrix.to_translation())}
    return bones


def rig(armature):
    return [(bone.name, [list(row) for row in bone.matrix_local], bone.use_deform) for bone in armature.data.bones]


def main(extension, character, result):
    sys.path.insert(0, os.path.dirname(extension))
    import armature_link
    from armature_link import link

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = FRAMES_PER_SECOND, 1.0
    bpy.ops.import_scene.gltf(filepath=character)
    armature = next(o for o in bpy.data.objects if o.type == "ARMATURE")
    if armature.animation_data:
        armature.animation_data.action = None
    for bone in armature.pose.bones:
        bone.matrix_basis.identity()
    before = rig(armature)
    armature_link.register()
    scene.frame_set(FIRST_FRAME)
    scene.armature_link.armature = armature
    # The tests' own choice: any free port.
    receiver = link.Receiver(0)
    port = receiver.port
    receiver.close()
    scene.armature_link.port = port
    assert bpy.ops.armature_link.receive() == {"FINISHED"}
    assert bpy.ops.armature_link.record() == {"FINISHED"}
    session = armature_link.session
    print(f"port {port}", flush=True)

    began = time.monotonic()
    heard = None
    poses = []
    while True:
        session.tick()
        now = time.monotonic()
        if session.pose and (not poses or session.pose.seconds != poses[-1]["seconds"]):
            heard = now
            poses.append({"seconds": session.pose.seconds, "bones": state(armature)})
        if heard is None and now - began > PATIENCE_SECONDS:
            sys.exit("no pose came")
        if heard is not None and now - heard > SILENT_SECONDS:
            break
        time.sleep(0.002)
    words, followed = session.words(), len(session.followed)
    recorder = session.recorder
    assert bpy.ops.armature_link.record() == {"FINISHED"}
    assert bpy.ops.armature_link.stop() == {"FINISHED"}
    assert scene.frame_current == FIRST_FRAME, "the timeline is the animator's"
    frames = []
    for frame in range(recorder.first_frame, recorder.next_frame):
        scene.frame_set(frame)
        frames.append({"seconds": recorder.time_of(frame), "bones": state(armature)})
    armature_link.unregister()
    content = {
        "poses": poses, "frames": frames, "followed": followed, "words": words, "same_rig": rig(armature) == before,
        "action": recorder.action.name,
    }
    with open(result, "w", encoding="utf-8") as file:
        json.dump(content, file)


if __name__ == "__main__":
    main(*sys.argv[1:])
