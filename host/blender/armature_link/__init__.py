# SPDX-License-Identifier: GPL-3.0-or-later
"""Armature Link: an armature in Blender follows the puppet in your hands.

In the sidebar of the 3D view (N), tab Armature: choose the armature, press Receive, and start
`armature run --stream json` or any other sender of the same link.
"""

import time

import bpy
from bpy.app.handlers import persistent

from . import link

TICK_SECONDS = 1 / 60
SILENT_SECONDS = 1.0


class Session:
    """What goes on while poses are received. Blender's data are looked up by name each time: undo replaces them."""

    def __init__(self, armature, port):
        self.receiver = link.Receiver(port)
        self.armature_name = armature.name
        self.recorder = None
        self.pose = None
        self.followed = {}
        self.names = None
        self.arrivals = []

    def armature(self):
        return bpy.data.objects.get(self.armature_name)

    def tick(self):
        armature = self.armature()
        if armature is None or armature.type != "ARMATURE":
            return
        poses = self.receiver.poses()
        now = time.monotonic()
        self.arrivals = [at for at in self.arrivals if now - at < 1.0] + [now] * len(poses)
        for pose in poses:
            self.pose = pose
            names = (tuple(pose.bones), tuple(bone.armature_link_source for bone in armature.pose.bones))
            if names != self.names:
                self.names = names
                self.followed = link.follow(armature, pose)
            if self.recorder:
                self.recorder.feed(armature, pose, self.followed, self.scale())
        if poses:
            self.show(armature)

    def show(self, armature):
        link.apply(armature, self.pose, self.followed, self.scale())
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type in {"VIEW_3D", "DOPESHEET_EDITOR", "GRAPH_EDITOR"}:
                    area.tag_redraw()

    @staticmethod
    def scale():
        return bpy.context.scene.armature_link.scale

    def words(self):
        """The state, in a line."""
        if self.receiver.fault:
            return f"Not understood: {self.receiver.fault}"
        if self.pose is None:
            return f"Waiting for poses at port {self.receiver.port}"
        if not self.arrivals or time.monotonic() - self.arrivals[-1] > SILENT_SECONDS:
            return f"{self.pose.subject}: silent"
        return f"{self.pose.subject}: {len(self.followed)} bones follow, {len(self.arrivals)} poses a second"


session = None


def tick():
    if session is None:
        return None
    session.tick()
    return TICK_SECONDS


@persistent
def after_frame_change(scene, depsgraph=None):
    """An action that plays would show its own pose until the next one comes."""
    armature = session.armature() if session and session.pose else None
    if armature:
        link.apply(armature, session.pose, session.followed, session.scale())


@persistent
def before_load(*_):
    stop()


def start(armature, port):
    global session
    stop()
    session = Session(armature, port)
    bpy.app.handlers.frame_change_post.append(after_frame_change)
    if not bpy.app.timers.is_registered(tick):
        bpy.app.timers.register(tick, first_interval=0.0, persistent=True)


def stop():
    global session
    if session:
        session.receiver.close()
        session = None
    if after_frame_change in bpy.app.handlers.frame_change_post:
        bpy.app.handlers.frame_change_post.remove(after_frame_change)


class ArmatureLinkSettings(bpy.types.PropertyGroup):
    armature: bpy.props.PointerProperty(
        name="Armature",
        description="The armature that follows",
        type=bpy.types.Object,
        poll=lambda _, candidate: candidate.type == "ARMATURE",
    )
    port: bpy.props.IntProperty(
        name="Port", description="Where poses arrive, on this computer", default=link.DEFAULT_PORT, min=1, max=65535
    )
    scale: bpy.props.FloatProperty(
        name="Scale",
        description="How far the armature travels for a metre of the streamed character",
        default=1.0,
        min=1e-4,
        soft_max=100.0,
    )


class ARMATURE_LINK_OT_receive(bpy.types.Operator):
    bl_idname = "armature_link.receive"
    bl_label = "Receive"
    bl_description = "Let the armature follow the poses that arrive"

    def execute(self, context):
        settings = context.scene.armature_link
        active = context.object
        armature = settings.armature or (active if active and active.type == "ARMATURE" else None)
        if armature is None:
            self.report({"ERROR"}, "Choose an armature first")
            return {"CANCELLED"}
        if armature.library and not armature.override_library:
            self.report({"ERROR"}, "A linked armature cannot be posed: make a library override of it first")
            return {"CANCELLED"}
        try:
            start(armature, settings.port)
        except OSError as error:
            self.report({"ERROR"}, f"Port {settings.port}: {error.strerror}; choose another one here and in Armature")
            return {"CANCELLED"}
        return {"FINISHED"}


class ARMATURE_LINK_OT_stop(bpy.types.Operator):
    bl_idname = "armature_link.stop"
    bl_label = "Stop"
    bl_description = "Stop receiving; the armature keeps its last pose"

    def execute(self, _context):
        stop()
        return {"FINISHED"}


class ARMATURE_LINK_OT_record(bpy.types.Operator):
    bl_idname = "armature_link.record"
    bl_label = "Record"
    bl_description = "Record into a new action from the current frame on; press again to stop"

    @classmethod
    def poll(cls, _context):
        return session is not None

    def execute(self, context):
        armature = session.armature()
        if session.recorder:
            frames = session.recorder.next_frame - session.recorder.first_frame
            name = session.recorder.action.name
            session.recorder = None
            self.report({"INFO"}, f"{frames} frames in the action {name}")
        elif armature:
            session.recorder = link.Recorder(armature, context.scene, f"{armature.name} take")
        return {"FINISHED"}


class ARMATURE_LINK_PT_panel(bpy.types.Panel):
    bl_label = "Armature Link"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Armature"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        settings = context.scene.armature_link
        chosen = layout.column()
        chosen.enabled = session is None
        chosen.prop(settings, "armature")
        chosen.prop(settings, "port")
        layout.prop(settings, "scale")
        if session is None:
            layout.operator("armature_link.receive", icon="PLAY")
            return
        layout.operator("armature_link.stop", icon="CANCEL")
        records = session.recorder is not None
        layout.operator("armature_link.record", text="Stop Recording" if records else "Record", icon="REC", depress=records)
        layout.label(text=session.words())
        bone = context.active_pose_bone
        if bone and session.pose:
            layout.prop(bone, "armature_link_source")
            layout.label(text=f"{bone.name} follows {session.followed.get(bone.name, 'nothing')}")


CLASSES = (
    ArmatureLinkSettings,
    ARMATURE_LINK_OT_receive,
    ARMATURE_LINK_OT_stop,
    ARMATURE_LINK_OT_record,
    ARMATURE_LINK_PT_panel,
)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.armature_link = bpy.props.PointerProperty(type=ArmatureLinkSettings)
    bpy.types.PoseBone.armature_link_source = bpy.props.StringProperty(
        name="Follows", description="Name of the streamed bone; empty: found by name"
    )
    bpy.app.handlers.load_pre.append(before_load)


def unregister():
    stop()
    bpy.app.handlers.load_pre.remove(before_load)
    del bpy.types.PoseBone.armature_link_source
    del bpy.types.Scene.armature_link
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
