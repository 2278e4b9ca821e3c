"""Makes figures in a real Blender as animators have them: dressed people at rest in a T, in an A and with their arms up,
an avatar of VRM 1.0, and a dog with its motion, and exports them.

    pip install bpy
    python tests/blender_figures.py FOLDER

Bodies come from Blender's skin modifier and weights from its bone heat. Clothes are copies of the skin, pushed out. For
every file NAME it writes NAME.json beside it, as `blender_models.py` does.
"""

import json
import math
import os
import struct
import sys

import blender_models
from blender_models import describe, material

# Where joints are, in metres, +Z up, looking along -Y: parent, head, tail, and how thick the body is at the tail.
TRUNK = {
    "Hips": (None, (0, 0, 0.96), (0, 0, 1.06), (0.135, 0.10)),
    "Spine": ("Hips", (0, 0, 1.06), (0, 0.01, 1.2), (0.135, 0.10)),
    "Chest": ("Spine", (0, 0.01, 1.2), (0, 0.01, 1.4), (0.155, 0.11)),
    "Neck": ("Chest", (0, 0.01, 1.42), (0, -0.01, 1.52), (0.055, 0.055)),
    "Head": ("Neck", (0, -0.01, 1.52), (0, -0.02, 1.74), (0.095, 0.10)),
}
LEG = {
    "UpperLeg": ("Hips", (0.095, 0, 0.94), (0.10, 0, 0.50), (0.062, 0.065)),
    "LowerLeg": ("UpperLeg", (0.10, 0, 0.50), (0.10, 0.02, 0.09), (0.042, 0.045)),
    "Foot": ("LowerLeg", (0.10, 0.02, 0.09), (0.10, -0.12, 0.03), (0.042, 0.028)),
    "Toes": ("Foot", (0.10, -0.12, 0.03), (0.10, -0.19, 0.025), (0.036, 0.022)),
}
# Lengths along the arm, from the shoulder, and thickness.
ARM = [("UpperArm", 0.27, (0.045, 0.045)), ("LowerArm", 0.25, (0.034, 0.030)), ("Hand", 0.17, (0.038, 0.018))]
SHOULDER = (0.17, 0.01, 1.40)
# How far the arms point down.
RESTS = {"t": 0.0, "a": 45.0, "up": -65.0}

NAMES = {
    "mixamo": {
        "Hips": "mixamorig:Hips", "Spine": "mixamorig:Spine", "Chest": "mixamorig:Spine2", "Neck": "mixamorig:Neck",
        "Head": "mixamorig:Head", "Shoulder": "mixamorig:{side}Shoulder", "UpperArm": "mixamorig:{side}Arm",
        "LowerArm": "mixamorig:{side}ForeArm", "Hand": "mixamorig:{side}Hand", "UpperLeg": "mixamorig:{side}UpLeg",
        "LowerLeg": "mixamorig:{side}Leg", "Foot": "mixamorig:{side}Foot", "Toes": "mixamorig:{side}ToeBase",
    },
    "rigify": {
        "Hips": "spine", "Spine": "spine.001", "Chest": "spine.003", "Neck": "spine.004", "Head": "spine.006",
        "Shoulder": "shoulder.{letter}", "UpperArm": "upper_arm.{letter}", "LowerArm": "forearm.{letter}",
        "Hand": "hand.{letter}", "UpperLeg": "thigh.{letter}", "LowerLeg": "shin.{letter}", "Foot": "foot.{letter}",
        "Toes": "toe.{letter}",
    },
    "unreal": {
        "Hips": "pelvis", "Spine": "spine_01", "Chest": "spine_03", "Neck": "neck_01", "Head": "head",
        "Shoulder": "clavicle_{small}", "UpperArm": "upperarm_{small}", "LowerArm": "lowerarm_{small}",
        "Hand": "hand_{small}", "UpperLeg": "thigh_{small}", "LowerLeg": "calf_{small}", "Foot": "foot_{small}",
        "Toes": "ball_{small}",
    },
}
# What lies between a bone's ends: how far along, and how thick.
MIDDLE = {"Head": [(0.35, (0.095, 0.11)), (0.7, (0.105, 0.125))], "UpperLeg": [(0.5, (0.072, 0.078))]}
# VRM's humanoid bones for the parts of a figure.
VRM = {
    "Hips": "hips", "Spine": "spine", "Chest": "chest", "Neck": "neck", "Head": "head", "Shoulder": "{small}Shoulder",
    "UpperArm": "{small}UpperArm", "LowerArm": "{small}LowerArm", "Hand": "{small}Hand", "UpperLeg": "{small}UpperLeg",
    "LowerLeg": "{small}LowerLeg", "Foot": "{small}Foot", "Toes": "{small}Toes",
}
# A dog, looking along -Y.
DOG = {
    "Hips": (None, (0, 0.32, 0.55), (0, 0.15, 0.57), (0.085, 0.10)),
    "Spine": ("Hips", (0, 0.15, 0.57), (0, -0.08, 0.56), (0.08, 0.095)),
    "Chest": ("Spine", (0, -0.08, 0.56), (0, -0.27, 0.57), (0.085, 0.10)),
    "Neck": ("Chest", (0, -0.27, 0.57), (0, -0.42, 0.76), (0.055, 0.06)),
    "Skull": ("Neck", (0, -0.42, 0.76), (0, -0.55, 0.78), (0.055, 0.055)),
    "Muzzle": ("Skull", (0, -0.55, 0.78), (0, -0.66, 0.74), (0.030, 0.028)),
    "Tail": ("Hips", (0, 0.36, 0.58), (0, 0.50, 0.62), (0.022, 0.022)),
    "TailTip": ("Tail", (0, 0.50, 0.62), (0, 0.64, 0.70), (0.012, 0.012)),
}
DOG_LEGS = {
    "Fore{}Upper": ("Chest", (0.075, -0.28, 0.52), (0.08, -0.24, 0.36), (0.038, 0.045)),
    "Fore{}Lower": ("Fore{}Upper", (0.08, -0.24, 0.36), (0.08, -0.26, 0.06), (0.022, 0.022)),
    "Fore{}Paw": ("Fore{}Lower", (0.08, -0.26, 0.06), (0.08, -0.32, 0.02), (0.028, 0.020)),
    "Hind{}Upper": ("Hips", (0.075, 0.30, 0.52), (0.085, 0.24, 0.34), (0.045, 0.055)),
    "Hind{}Lower": ("Hind{}Upper", (0.085, 0.24, 0.34), (0.085, 0.36, 0.18), (0.026, 0.026)),
    "Hind{}Cannon": ("Hind{}Lower", (0.085, 0.36, 0.18), (0.085, 0.33, 0.05), (0.022, 0.022)),
    "Hind{}Paw": ("Hind{}Cannon", (0.085, 0.33, 0.05), (0.085, 0.26, 0.02), (0.028, 0.020)),
}


def person(rest):
    """The bones of a person, by part and side (0 for the middle)."""
    bones = {(name, 0): (parent and (parent, 0), head, tail, size) for name, (parent, head, tail, size) in TRUNK.items()}
    for side in (1, -1):
        mirror = lambda p: (side * p[0], p[1], p[2])
        for name, (parent, head, tail, size) in LEG.items():
            above = (parent, 0) if parent == "Hips" else (parent, side)
            bones[name, side] = (above, mirror(head), mirror(tail), size)
        bones["Shoulder", side] = (("Chest", 0), mirror((0.03, 0.01, 1.40)), mirror(SHOULDER), (0.058, 0.058))
        angle = math.radians(RESTS[rest])
        at, above = SHOULDER, ("Shoulder", side)
        for number, (name, length, size) in enumerate(ARM):
            # Elbows are bent a little, as in nature.
            way = (math.cos(angle), -0.12 if number else 0.04, -math.sin(angle))
            to = tuple(at[k] + length * way[k] for k in range(3))
            bones[name, side] = (above, mirror(at), mirror(to), size)
            at, above = to, (name, side)
    return bones


def dog():
    bones = {(name, 0): (parent and (parent, 0), head, tail, size) for name, (parent, head, tail, size) in DOG.items()}
    for side in (1, -1):
        mirror = lambda p: (side * p[0], p[1], p[2])
        for name, (parent, head, tail, size) in DOG_LEGS.items():
            above = (parent.format(""), side) if "{}" in parent else (parent, 0)
            bones[name.format(""), side] = (above, mirror(head), mirror(tail), size)
    return bones


def bone_name(part, side, names):
    words = {"side": "Left" if side > 0 else "Right", "letter": "L" if side > 0 else "R", "small": "l" if side > 0 else "r"}
    if names is None:
        return part + {1: "Left", -1: "Right", 0: ""}[side]
    return names[part].format(**words)


def body(bpy, bones):
    """A closed skin around the bones: a bone begins at the nearer end of its parent."""
    vertices, edges, sizes, ends = [], [], [], {}

    def vertex(place, size):
        vertices.append(place)
        sizes.append(size)
        return len(vertices) - 1

    for key, (parent, head, tail, size) in bones.items():
        if parent is None:
            start = vertex(head, size)
        else:
            start = min(ends[parent], key=lambda v: math.dist(vertices[v], head))
            if math.dist(vertices[start], head) > 0.03:
                start, above = vertex(head, [1.15 * s for s in size]), start
                edges.append((above, start))
        end = start
        for share, thick in MIDDLE.get(key[0], ()):
            middle = vertex([head[k] + share * (tail[k] - head[k]) for k in range(3)], thick)
            edges.append((end, middle))
            end = middle
        edges.append((end, vertex(tail, size)))
        ends[key] = (start, edges[-1][1])
    mesh = bpy.data.meshes.new("body")
    mesh.from_pydata(vertices, edges, [])
    made = bpy.data.objects.new("body", mesh)
    bpy.context.collection.objects.link(made)
    bpy.context.view_layer.objects.active = made
    skin = made.modifiers.new("skin", "SKIN")
    skin.branch_smoothing = 0.6
    for index, (size, point) in enumerate(zip(sizes, mesh.skin_vertices[0].data)):
        point.radius = size
        point.use_root = index == 0
    made.modifiers.new("smooth", "SUBSURF").levels = 2
    for modifier in list(made.modifiers):
        bpy.ops.object.modifier_apply(modifier=modifier.name)
    made.data.validate()
    layer = made.data.uv_layers.new(name="UVMap")
    for loop in made.data.loops:
        x, y, z = made.data.vertices[loop.vertex_index].co
        layer.data[loop.index].uv = (0.5 + 0.4 * x, 0.2 + 0.4 * z)
    for polygon in made.data.polygons:
        polygon.use_smooth = True
    return made


def armature(bpy, bones, names, scale):
    data = bpy.data.armatures.new("rig")
    rig = bpy.data.objects.new("rig", data)
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for (part, side), (parent, head, tail, _) in bones.items():
        bone = data.edit_bones.new(bone_name(part, side, names))
        bone.head, bone.tail = [c * scale for c in head], [c * scale for c in tail]
        if parent:
            bone.parent = data.edit_bones[bone_name(*parent, names)]
    bpy.ops.object.mode_set(mode="OBJECT")
    return rig


def heat(bpy, made, rig):
    """Blender's bone heat."""
    bpy.ops.object.select_all(action="DESELECT")
    made.select_set(True)
    rig.select_set(True)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")


def garment(bpy, made, name, color, inside, cuts, out, folder):
    """A copy of the skin's faces that are inside, with their weights, cut along planes (a point and the normal of each)
    and pushed out along the normals."""
    import bmesh

    copy = made.copy()
    copy.data = made.data.copy()
    copy.name = copy.data.name = name
    bpy.context.collection.objects.link(copy)
    edited = bmesh.new()
    edited.from_mesh(copy.data)
    for point, normal in cuts:
        geometry = edited.verts[:] + edited.edges[:] + edited.faces[:]
        bmesh.ops.bisect_plane(edited, geom=geometry, plane_co=point, plane_no=normal, dist=1e-5)
    bmesh.ops.delete(edited, geom=[f for f in edited.faces if not inside(f.calc_center_median())], context="FACES")
    for vertex in edited.verts:
        vertex.co += vertex.normal * out
    edited.to_mesh(copy.data)
    edited.free()
    copy.data.materials.clear()
    copy.data.materials.append(material(bpy, name, color, folder))
    return copy


def face(bpy, rig, head_bone, scale, folder):
    """Eyes and a nose that hang on the head bone, the left ones being the right ones mirrored."""
    white, dark = material(bpy, "eye", (0.9, 0.9, 0.9, 1), folder), material(bpy, "pupil", (0.02, 0.02, 0.03, 1), folder)
    for side in (1, -1):
        for name, paint, radius, at in (
            ("eye", white, 0.020, (0.036, -0.108, 1.645)),
            ("pupil", dark, 0.011, (0.037, -0.122, 1.645)),
        ):
            bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=8, radius=radius * scale)
            made = bpy.context.object
            made.name = made.data.name = f"{name} {'left' if side > 0 else 'right'}"
            made.data.materials.append(paint)
            for polygon in made.data.polygons:
                polygon.use_smooth = True
            made.parent, made.parent_type, made.parent_bone = rig, "BONE", head_bone
            bpy.context.view_layer.update()
            made.matrix_world = rig.matrix_world @ placed(side, [c * scale for c in at])


def placed(side, at):
    from mathutils import Matrix

    return Matrix.Translation((side * at[0], at[1], at[2])) @ Matrix.Diagonal((side, 1, 1, 1))


def smile(made, scale):
    """Shape keys of the face."""
    made.shape_key_add(name="Basis")
    for name, lift in (("Smile", 0.012), ("Frown", -0.012)):
        key = made.shape_key_add(name=name)
        for point in key.data:
            x, y, z = (c / scale for c in point.co)
            near = math.exp(-(((abs(x) - 0.035) / 0.02) ** 2) - ((z - 1.58) / 0.02) ** 2)
            if y < -0.05:
                point.co.z += lift * near * scale
                point.co.x += 0.4 * lift * near * math.copysign(1, x) * scale


def dress(bpy, made, folder, scale, color):
    """Hair, trousers, a shirt with sleeves, and shoes."""
    up, across, ahead = (0, 0, 1), (1, 0, 0), (0, 1, 0)

    def wear(name, color, inside, cuts, out):
        cuts = [([scale * at * c for c in way], way) for at, way in cuts]
        return garment(bpy, made, name, color, lambda p: inside(*(c / scale for c in p)), cuts, out * scale, folder)

    hair = lambda x, y, z: abs(x) < 0.15 and (z > 1.69 or (z > 1.56 and y > 0.02))
    shirt = lambda x, y, z: 0.95 < z < 1.47 and abs(x) < 0.30
    trousers = lambda x, y, z: 0.08 < z < 1.03 and abs(x) < 0.22
    return [
        wear("hair", (0.10, 0.05, 0.03, 1), hair, [(1.69, up), (1.56, up), (0.02, ahead)], 0.012),
        wear("trousers", (0.05, 0.08, 0.20, 1), trousers, [(0.08, up), (1.03, up)], 0.008),
        wear("shirt", color, shirt, [(0.95, up), (1.47, up), (0.30, across), (-0.30, across)], 0.014),
        wear("shoes", (0.06, 0.05, 0.05, 1), lambda x, y, z: z < 0.10, [(0.10, up)], 0.010),
    ]


def animate(bpy, rig, turns):
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = blender_models.FRAMES_PER_SECOND, 1.0
    frames = blender_models.FRAMES
    scene.frame_start, scene.frame_end = frames[0], frames[-1]
    for frame in range(frames[0], frames[-1] + 1):
        share = (frame - frames[0]) / (frames[-1] - frames[0])
        for name, turn in turns.items():
            bone = rig.pose.bones[name]
            bone.rotation_mode = "XYZ"
            bone.rotation_euler = [share * angle for angle in turn]
            bone.keyframe_insert("rotation_euler", frame=frame)


def make_person(bpy, folder, rest="t", names="mixamo", scale=1.0, loose=(), shirt=(0.55, 0.12, 0.10, 1)):
    """`loose`: clothes that get no weights."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bones, names = person(rest), NAMES[names]
    made = body(bpy, bones)
    made.data.materials.append(material(bpy, "skin", (0.80, 0.52, 0.40, 1), folder))
    for vertex in made.data.vertices:
        vertex.co *= scale
    rig = armature(bpy, bones, names, scale)
    heat(bpy, made, rig)
    for cloth in dress(bpy, made, folder, scale, shirt):
        if cloth.name in loose:
            cloth.vertex_groups.clear()
            cloth.modifiers.clear()
            cloth.parent = None
    smile(made, scale)
    made.data.shape_keys.key_blocks["Smile"].value = 0.5
    face(bpy, rig, bone_name("Head", 0, names), scale, folder)
    turns = {"Spine": (0.2, 0.3, 0.0), "Neck": (0.1, -0.3, 0.1), "Hips": (0.0, 0.2, 0.0)}
    turns = {bone_name(part, 0, names): turn for part, turn in turns.items()}
    for part, turn in {"UpperArm": (0.3, 0.2, -0.6), "LowerArm": (0.9, 0.0, 0.2), "UpperLeg": (0.5, 0.1, 0.0), "LowerLeg": (-0.6, 0.0, 0.0)}.items():
        turns[bone_name(part, 1, names)] = turn
        turns[bone_name(part, -1, names)] = [0.5 * angle for angle in turn]
    animate(bpy, rig, turns)
    return rig


def make_dog(bpy, folder):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bones = dog()
    made = body(bpy, bones)
    made.data.materials.append(material(bpy, "fur", (0.45, 0.25, 0.10, 1), folder))
    rig = armature(bpy, bones, None, 1.0)
    heat(bpy, made, rig)
    # Across the neck.
    way = (0, -0.6, 0.8)
    along = lambda p: way[1] * p.y + way[2] * p.z
    cuts = [([at * c for c in way], way) for at in (0.72, 0.76)]
    collar = lambda p: 0.72 < along(p) < 0.76 and p.y < -0.25
    garment(bpy, made, "collar", (0.6, 0.05, 0.05, 1), collar, cuts, 0.006, folder)
    turns = {"Spine": (0.1, 0.0, 0.2), "Neck": (-0.3, 0.0, 0.3), "Tail": (0.6, 0.0, 0.3)}
    turns |= {"ForeUpperLeft": (0.5, 0, 0), "HindUpperRight": (-0.4, 0, 0), "HindLowerRight": (0.3, 0, 0)}
    animate(bpy, rig, turns)
    return rig


def make_vrm(path, out, names):
    """A GLB with what makes it an avatar of VRM 1.0: bones, expressions, its name and licence."""
    with open(path, "rb") as file:
        bytes_ = file.read()
    length = struct.unpack_from("<I", bytes_, 12)[0]
    gltf = json.loads(bytes_[20 : 20 + length])
    rest = bytes_[20 + length :]
    node_of = {node.get("name"): index for index, node in enumerate(gltf["nodes"])}
    bones = {}
    for part, vrm in VRM.items():
        for side in (1, -1) if "{" in vrm else (0,):
            small = "left" if side > 0 else "right"
            bones[vrm.format(small=small)] = {"node": node_of[bone_name(part, side, names)]}
    body_node = next(i for i, node in enumerate(gltf["nodes"]) if node.get("name") == "body")
    bind = lambda index: {"morphTargetBinds": [{"node": body_node, "index": index, "weight": 1.0}]}
    avatar = {
        "specVersion": "1.0",
        "meta": {"name": "Figure", "authors": ["a script"], "licenseUrl": "https://vrm.dev/licenses/1.0/"},
        "humanoid": {"humanBones": bones},
        "expressions": {"preset": {"happy": bind(0), "sad": bind(1)}},
    }
    gltf.setdefault("extensions", {})["VRMC_vrm"] = avatar
    gltf.setdefault("extensionsUsed", []).append("VRMC_vrm")
    text = json.dumps(gltf, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    with open(out, "wb") as file:
        file.write(struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest)


GLTF = {"export_format": "GLB", "export_all_influences": True, "export_morph": True}
FBX = {"add_leaf_bones": False, "bake_anim_simplify_factor": 0.0}


def export(bpy, rig, path, metres=1.0, **options):
    bpy.context.scene.unit_settings.scale_length = metres
    describe(bpy, [rig], path, metres)
    if path.endswith(".fbx"):
        bpy.ops.export_scene.fbx(filepath=path, **{**FBX, **options})
    else:
        bpy.ops.export_scene.gltf(filepath=path, **{**GLTF, **options})
    print(f"wrote {os.path.basename(path)}")


def export_motion(bpy, rig, path):
    """The motion as BVH, which Blender writes with its own axes: the bones are laid down first."""
    for made in bpy.data.objects:
        made.select_set(made == rig)
    bpy.context.view_layer.objects.active = rig
    rig.rotation_euler = (-math.pi / 2, 0, 0)
    bpy.ops.object.transform_apply(rotation=True, location=False, scale=False)
    frames = blender_models.FRAMES
    bpy.ops.export_anim.bvh(filepath=path, frame_start=frames[0], frame_end=frames[-1], rotate_mode="NATIVE")


def make_all(bpy, folder):
    at = lambda name: os.path.join(folder, name)
    rig = make_person(bpy, folder, "t", "mixamo", 100.0)
    export(bpy, rig, at("person_t.fbx"), 0.01)
    rig = make_person(bpy, folder, "a", "unreal", shirt=(0.10, 0.35, 0.30, 1))
    export(bpy, rig, at("person_a.glb"))
    rig = make_person(bpy, folder, "up", "rigify", shirt=(0.60, 0.40, 0.08, 1))
    export(bpy, rig, at("person_up.fbx"), axis_up="Z", axis_forward="Y")
    rig = make_person(bpy, folder, "t", "rigify", loose=("shirt", "trousers"), shirt=(0.25, 0.15, 0.45, 1))
    export(bpy, rig, at("loose_clothes.glb"))
    rig = make_person(bpy, folder, "a", "mixamo", shirt=(0.12, 0.25, 0.55, 1))
    export(bpy, rig, at("avatar.glb"))
    make_vrm(at("avatar.glb"), at("avatar.vrm"), NAMES["mixamo"])
    os.rename(at("avatar.glb.json"), at("avatar.vrm.json"))
    os.remove(at("avatar.glb"))
    rig = make_dog(bpy, folder)
    export(bpy, rig, at("dog.glb"))
    export_motion(bpy, rig, at("dog.bvh"))


def main():
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        import bpy
    except ImportError as error:
        print(f"Blender's module is not installed: {error}; run pip install bpy", file=sys.stderr)
        return 2
    make_all(bpy, os.path.abspath(sys.argv[1]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
