# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses from Armature's JSON link, and what they do to an armature.

A pose says for each streamed bone how it is turned compared with its rest pose, and how far its head has moved, in the
model's space: right-handed, Y up, metres. An armature whose bones have other axes and lengths follows all the same.
"""

import json
import math
import socket

import bpy
from mathutils import Matrix, Quaternion, Vector

DEFAULT_PORT = 54321
VERSION = 1
MOST_DATAGRAM_BYTES = 65_507
# Armature's model space is Y up, Blender's world Z up.
BLENDER_FROM_MODEL = Matrix(((1, 0, 0), (0, 0, -1), (0, 1, 0)))


class Pose:
    """A received pose: `seconds` of the puppet's clock, and bones by name."""

    def __init__(self, subject, seconds, bones):
        self.subject = subject
        self.seconds = seconds
        self.bones = bones

    @classmethod
    def read(cls, data):
        """Raises ValueError, with the reason, for anything that is no pose."""
        try:
            message = json.loads(data)
        except (UnicodeDecodeError, json.JSONDecodeError) as error:
            raise ValueError(f"no JSON: {error}") from error
        if not isinstance(message, dict) or len(message) != 1:
            raise ValueError("no subject")
        (name, content), = message.items()
        try:
            if content["Version"] != VERSION:
                raise ValueError(f"version {content['Version']} of the link; this extension knows {VERSION}")
            bones = {bone["Name"]: StreamedBone(bone) for bone in content["Bone"]}
            return cls(name, float(content["Time"]), bones)
        except (KeyError, TypeError) as error:
            raise ValueError(f"an incomplete pose: {error}") from error

    def blend(self, later, share):
        """The pose in between: this one at 0, the later one at 1."""
        bones = {}
        for name, bone in self.bones.items():
            other = later.bones.get(name, bone)
            turn = bone.turn.slerp(other.turn, share)
            bones[name] = StreamedBone.of(bone, turn, bone.shift.lerp(other.shift, share))
        seconds = self.seconds + share * (later.seconds - self.seconds)
        return Pose(self.subject, seconds, bones)


class StreamedBone:
    """How a bone is turned and shifted compared with its rest pose, in Blender's axes."""

    def __init__(self, bone):
        x, y, z, w = numbers(bone["Turn"], 4)
        axis = BLENDER_FROM_MODEL @ Vector((x, y, z))
        self.turn = Quaternion((w, *axis))
        if self.turn.magnitude < 1e-6:
            raise ValueError("a turn of no length")
        self.turn.normalize()
        self.shift = BLENDER_FROM_MODEL @ Vector(numbers(bone["Shift"], 3))
        self.humanoid = bone.get("Humanoid")

    @classmethod
    def of(cls, other, turn, shift):
        made = cls.__new__(cls)
        made.turn, made.shift, made.humanoid = turn, shift, other.humanoid
        return made


def numbers(values, count):
    values = [float(value) for value in values]
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise ValueError(f"{values} are not {count} numbers")
    return values


class Receiver:
    """Listens at a port and keeps the poses that came."""

    def __init__(self, port=DEFAULT_PORT, host="127.0.0.1"):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self.socket.bind((host, port))
        except OSError:
            self.socket.close()
            raise
        self.socket.setblocking(False)
        self.port = self.socket.getsockname()[1]
        self.fault = None

    def close(self):
        self.socket.close()

    def poses(self):
        """What has come since the last call, oldest first."""
        poses = []
        while True:
            try:
                data = self.socket.recv(MOST_DATAGRAM_BYTES)
            except (BlockingIOError, ConnectionResetError):
                return poses
            try:
                poses.append(Pose.read(data))
                self.fault = None
            except ValueError as error:
                self.fault = str(error)


def plain(name):
    """A name without the prefix of its rig, capitals and marks: `mixamorig:LeftArm` and `left_arm` are the same."""
    return "".join(letter for letter in name.rsplit(":", 1)[-1].lower() if letter.isalnum())


def follow(armature, pose):
    """For each pose bone that follows, the name of the streamed bone: chosen by hand, else of the same name, else the same
    bone of a humanoid."""
    exact = {name: name for name in pose.bones}
    by_plain = {plain(name): name for name in pose.bones}
    by_humanoid = {plain(bone.humanoid): name for name, bone in pose.bones.items() if bone.humanoid}
    followed = {}
    for bone in armature.pose.bones:
        chosen = getattr(bone, "armature_link_source", "")
        if chosen:
            if chosen in pose.bones:
                followed[bone.name] = chosen
            continue
        found = exact.get(bone.name) or by_plain.get(plain(bone.name)) or by_humanoid.get(plain(bone.name))
        if found and found not in followed.values():
            followed[bone.name] = found
    return followed


def armature_axes(armature):
    """From Blender's axes to those of the armature's data. Importers of FBX files keep the file's Y up and turn the
    object instead; an object that is turned otherwise was turned by hand, and its armature's data are Z up."""
    turned = armature.matrix_world.to_quaternion()
    if (turned @ Vector((0, 1, 0))).z > 0.9:
        return BLENDER_FROM_MODEL.inverted().to_quaternion()
    return Quaternion()


def apply(armature, pose, followed, scale=1.0):
    """Poses the armature. Nothing but the pose of the bones that follow is changed."""
    axes = armature_axes(armature)
    placed = {}
    for bone in ordered(armature.pose.bones):
        rest = bone.bone.matrix_local
        parent = bone.parent
        above = {}
        if parent:
            above = {"parent_matrix": placed[parent.name], "parent_matrix_local": parent.bone.matrix_local}
        source = followed.get(bone.name)
        if source is None or source not in pose.bones:
            placed[bone.name] = bone.bone.convert_local_to_pose(bone.matrix_basis, rest, **above)
            continue
        streamed = pose.bones[source]
        base = bone.bone.convert_local_to_pose(Matrix.Identity(4), rest, **above)
        turn = axes @ streamed.turn @ axes.inverted()
        head = base.to_translation()
        if is_top(bone, followed):
            size = max(armature.matrix_world.median_scale, 1e-9)
            head = head + axes @ streamed.shift * (scale / size)
        wanted = Matrix.LocRotScale(head, turn @ rest.to_quaternion(), None)
        placed[bone.name] = wanted
        basis = bone.bone.convert_local_to_pose(wanted, rest, invert=True, **above)
        set_basis(bone, basis, is_top(bone, followed))


def ordered(bones):
    """Parents before children."""
    waiting = [bone for bone in bones if bone.parent is None]
    while waiting:
        bone = waiting.pop()
        yield bone
        waiting.extend(bone.children)


def is_top(bone, followed):
    """Whether no bone above follows: then it moves, too."""
    return not any(above.name in followed for above in bone.parent_recursive)


def set_basis(bone, basis, moves):
    """Sets rotation (and location), near the values that were there, so that curves do not leap by a whole turn."""
    if moves:
        bone.location = basis.to_translation()
    turn = basis.to_quaternion()
    if bone.rotation_mode == "QUATERNION":
        turn.make_compatible(bone.rotation_quaternion)
        bone.rotation_quaternion = turn
    elif bone.rotation_mode == "AXIS_ANGLE":
        axis, angle = turn.to_axis_angle()
        bone.rotation_axis_angle = (angle, *axis)
    else:
        bone.rotation_euler = turn.to_euler(bone.rotation_mode, bone.rotation_euler)


ROTATIONS = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}


class Recorder:
    """Writes poses into a new action, a key for each whole frame. The puppet's clock decides which frame it is, so that
    the scene's timeline can play, stand still or lag meanwhile."""

    def __init__(self, armature, scene, name):
        data = armature.animation_data or armature.animation_data_create()
        if data.action:
            # What was there stays in the file, even when nothing uses it.
            data.action.use_fake_user = True
        data.action = bpy.data.actions.new(name)
        self.action = data.action
        self.frames_per_second = scene.render.fps / scene.render.fps_base
        self.first_frame = scene.frame_current
        self.began = None
        self.former = None
        self.next_frame = self.first_frame

    def feed(self, armature, pose, followed, scale):
        """Keys the whole frames up to this pose, each with what lies between the poses around it."""
        if self.former is None:
            self.began = pose.seconds
            self.former = pose
        if pose.seconds < self.former.seconds:
            # The puppet restarted: go on from here.
            self.began += pose.seconds - self.former.seconds
            self.former = pose
        while self.time_of(self.next_frame) <= pose.seconds + 1e-9:
            span = pose.seconds - self.former.seconds
            share = (self.time_of(self.next_frame) - self.former.seconds) / span if span > 0 else 1.0
            apply(armature, self.former.blend(pose, min(max(share, 0.0), 1.0)), followed, scale)
            self.key(armature, followed)
            self.next_frame += 1
        self.former = pose

    def time_of(self, frame):
        return self.began + (frame - self.first_frame) / self.frames_per_second

    def key(self, armature, followed):
        for name in followed:
            bone = armature.pose.bones.get(name)
            if bone is None:
                continue
            path = ROTATIONS.get(bone.rotation_mode, "rotation_euler")
            bone.keyframe_insert(path, frame=self.next_frame, group=name)
            if is_top(bone, followed):
                bone.keyframe_insert("location", frame=self.next_frame, group=name)
