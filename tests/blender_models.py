"""Makes characters in a real Blender, exports them, and says how Blender poses them.

    pip install bpy
    python tests/blender_models.py FOLDER [NODE_MODULES]

With NODE_MODULES, a folder that has the npm package gltfpack, files that it quantised and compressed are there too. For every file NAME it writes NAME.json beside it, in our own axes (+Y up) and in metres:

    {"frames_per_second": 24, "bones": ["hips", ...], "targets": ["Smile", ...], "materials": ["cloth", ...],
     "meshes": [{"rest": [[x, y, z], ...], "posed": {"1": [[x, y, z], ...], "9": ...}}, ...]}

where the numbers of "posed" are frames, the first key being at frame 1. Shape keys are at their own values.
"""

import json
import math
import os
import shutil
import subprocess
import sys

FRAMES = [1, 5, 9]
FRAMES_PER_SECOND = 24


def our_axes(v, metres):
    """Blender is Z-up."""
    return [v[0] * metres, v[2] * metres, -v[1] * metres]


def material(bpy, name, color, folder, maps=False, alpha=None):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = color
    shader.inputs["Roughness"].default_value = 0.25
    if maps:
        for kind in ("color", "normal", "Roughness", "Metallic"):
            image = bpy.data.images.new(f"{name}_{kind}", 4, 4)
            image.pixels = [0.5, 0.5, 1.0 if kind in ("color", "normal") else 0.5, 1.0] * 16
            image.filepath_raw = os.path.join(folder, f"{name}_{kind}.png")
            image.file_format = "PNG"
            image.save()
            if kind != "color":
                image.colorspace_settings.name = "Non-Color"
            texture = nodes.new("ShaderNodeTexImage")
            texture.image = image
            if kind == "color":
                links.new(texture.outputs["Color"], shader.inputs["Base Color"])
            elif kind != "normal":
                links.new(texture.outputs["Color"], shader.inputs[kind])
            else:
                bump = nodes.new("ShaderNodeNormalMap")
                links.new(texture.outputs["Color"], bump.inputs["Color"])
                links.new(bump.outputs["Normal"], shader.inputs["Normal"])
    if alpha is not None:
        shader.inputs["Alpha"].default_value = alpha
    return made


def tube(name, bottom, top, radius, rings, sides, ngon):
    """Rings of quadrilaterals, closed by a polygon at each end."""
    import bpy

    vertices, faces = [], []
    for ring in range(rings + 1):
        t = ring / rings
        center = [bottom[k] + t * (top[k] - bottom[k]) for k in range(3)]
        for side in range(sides):
            angle = 2 * math.pi * (side + 0.3 * t) / sides
            vertices.append(
                (center[0] + radius * math.cos(angle), center[1] + radius * math.sin(angle), center[2] + 0.01 * side * t)
            )
    for ring in range(rings):
        for side in range(sides):
            a, b = ring * sides + side, ring * sides + (side + 1) % sides
            faces.append((a, b, b + sides, a + sides))
    if ngon:
        faces.append(tuple(reversed(range(sides))))
        faces.append(tuple(range(rings * sides, (rings + 1) * sides)))
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    layer = mesh.uv_layers.new(name="UVMap")
    for loop in mesh.loops:
        x, y, z = mesh.vertices[loop.vertex_index].co
        layer.data[loop.index].uv = (0.5 + 0.3 * x, 0.2 + 0.3 * z)
    made = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(made)
    return made


def skeleton(bpy, scale):
    data = bpy.data.armatures.new("rig")
    rig = bpy.data.objects.new("rig", data)
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    places = {
        "hips": (None, (0, 0, 0), (0, 0.05, 1), 0.0),
        "spine": ("hips", (0, 0.05, 1), (0, 0, 2), 0.4),
        "mixamorig:Head": ("spine", (0, 0, 2), (0.1, -0.1, 2.8), -0.7),
        "arm.L": ("spine", (0, 0, 1.9), (1, 0, 1.7), 1.2),
        "hand.L": ("arm.L", (1, 0, 1.7), (1.6, -0.2, 1.7), 0.1),
        "arm.R": ("spine", (0, 0, 1.9), (-1, 0, 1.7), -1.2),
    }
    for name, (parent, head, tail, roll) in places.items():
        bone = data.edit_bones.new(name)
        bone.head, bone.tail, bone.roll = [c * scale for c in head], [c * scale for c in tail], roll
        if parent:
            bone.parent = data.edit_bones[parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    return rig, places


def weigh(made, rig, places, scale, most):
    """Weights that fall off with the distance from the bones, for the nearest ones."""
    groups = {name: made.vertex_groups.new(name=name) for name in places}
    for vertex in made.data.vertices:
        p = made.matrix_world @ vertex.co
        near = []
        for name, (_, head, tail, _) in places.items():
            middle = [0.5 * (head[k] + tail[k]) * scale for k in range(3)]
            near.append((sum((p[k] - middle[k]) ** 2 for k in range(3)) / scale**2, name))
        near = sorted(near)[:most]
        shares = [1 / (0.05 + d) ** 2 for d, _ in near]
        for share, (_, name) in zip(shares, near):
            groups[name].add([vertex.index], share / sum(shares), "REPLACE")
    modifier = made.modifiers.new("rig", "ARMATURE")
    modifier.object = rig
    made.parent = rig


def animate(bpy, rig, prefix=""):
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = FRAMES_PER_SECOND, 1.0
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    turns = {
        "hips": (0.2, 0.1, -0.3),
        "spine": (0.3, -0.4, 0.2),
        "mixamorig:Head": (-0.5, 0.3, 0.6),
        "arm.L": (0.7, 0.2, -0.9),
        "hand.L": (0.4, 1.0, 0.2),
        "arm.R": (-0.3, 0.5, 0.8),
    }
    for frame in range(FRAMES[0], FRAMES[-1] + 1):
        share = (frame - FRAMES[0]) / (FRAMES[-1] - FRAMES[0])
        for name, turn in turns.items():
            bone = rig.pose.bones[prefix + name]
            bone.rotation_mode = "XYZ"
            bone.rotation_euler = [share * angle for angle in turn]
            bone.keyframe_insert("rotation_euler", frame=frame)
        hips = rig.pose.bones[prefix + "hips"]
        hips.location = (0.1 * share, 0.2 * share, 0)
        hips.keyframe_insert("location", frame=frame)


def scene(bpy, folder, scale=1.0, hats=True, most=6, colors=False, twin=False, turned=False):
    """A body, a coat with two materials and shape keys, whose vertices follow up to `most` bones, and, if asked, a hat on
    a bone and its mirror image, colours of vertices, a second armature with a body of its own, and a first one that is
    turned and scaled to a hundredth as an object. Returns the armatures."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if turned:
        scale *= 100
    rig, places = skeleton(bpy, scale)
    body = tube("body", (0, 0, -0.2 * scale), (0, 0, 2.6 * scale), 0.3 * scale, 14, 9, True)
    body.data.materials.append(material(bpy, "skin", (0.8, 0.5, 0.4, 1), folder, maps=True))
    weigh(body, rig, places, scale, 4)
    coat = tube("coat", (0.02 * scale, 0, 0.4 * scale), (0, 0.03 * scale, 1.9 * scale), 0.42 * scale, 8, 12, False)
    coat.data.materials.append(material(bpy, "cloth", (0.1, 0.2, 0.7, 1), folder))
    coat.data.materials.append(material(bpy, "glass", (0.9, 0.9, 1, 1), folder, alpha=0.5))
    for polygon in coat.data.polygons:
        polygon.material_index = polygon.index % 2
    coat.shape_key_add(name="Basis")
    for name, value, axis in (("Smile", 0.5, 0), ("Frown", 0.0, 2)):
        key = coat.shape_key_add(name=name)
        for index, point in enumerate(key.data):
            if index % 3 == 0:
                point.co[axis] += 0.1 * scale * (1 + index % 5)
        key.value = value
    weigh(coat, rig, places, scale, most)
    for name, mirror in (("hat", 1), ("mirrored hat", -1)) if hats else ():
        hat = tube(name, (0, 0, 0), (0.1 * scale, 0, 0.4 * scale), 0.2 * scale, 3, 7, True)
        hat.data.materials.append(bpy.data.materials["skin"])
        hat.parent, hat.parent_type, hat.parent_bone = rig, "BONE", "mixamorig:Head"
        hat.location = (0.3 * scale * mirror, 0.1 * scale, 0)
        hat.rotation_euler = (0.3, 0.2, 0.1)
        hat.scale = (mirror, 1.2, 0.9)
    if colors:
        layer = body.data.color_attributes.new("painted", "FLOAT_COLOR", "POINT")
        for vertex, color in zip(body.data.vertices, layer.data):
            color.color = (0.5 + 0.5 * math.sin(9 * vertex.co.z), 0.25, 0.75, 1.0)
    animate(bpy, rig)
    rigs = [rig]
    if twin:
        other, places = skeleton(bpy, 0.5 * scale)
        other.name = other.data.name = "twin"
        for bone in other.data.bones:
            bone.name = f"twin {bone.name}"
        places = {f"twin {name}": place for name, place in places.items()}
        legs = tube("twin body", (0, 0, 0), (0, 0, 1.3 * scale), 0.2 * scale, 9, 7, True)
        legs.data.materials.append(bpy.data.materials["skin"])
        weigh(legs, other, places, 0.5 * scale, 4)
        other.location, other.rotation_euler = (2.5 * scale, 0.3, 0), (0.2, 0, 0.5)
        animate(bpy, other, "twin ")
        rigs.append(other)
    if turned:
        rig.scale, rig.rotation_euler, rig.location = (0.01, 0.01, 0.01), (math.pi / 2, 0, 0.3), (0.5, 0.2, 0.1)
    return rigs


def evaluated(bpy, made, metres):
    made = made.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = made.to_mesh()
    points = [our_axes(made.matrix_world @ vertex.co, metres) for vertex in mesh.vertices]
    made.to_mesh_clear()
    return points


def describe(bpy, rigs, path, metres):
    meshes = [o for o in bpy.data.objects if o.type == "MESH"]
    for rig in rigs:
        rig.data.pose_position = "REST"
    bpy.context.view_layer.update()
    told = [{"rest": evaluated(bpy, made, metres), "posed": {}} for made in meshes]
    for rig in rigs:
        rig.data.pose_position = "POSE"
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        bpy.context.view_layer.update()
        for made, mesh in zip(meshes, told):
            mesh["posed"][str(frame)] = evaluated(bpy, made, metres)
    bpy.context.scene.frame_set(FRAMES[0])
    keys = [key.name for made in meshes if made.data.shape_keys for key in made.data.shape_keys.key_blocks[1:]]
    expected = {
        "frames_per_second": FRAMES_PER_SECOND,
        "bones": [bone.name for rig in rigs for bone in rig.data.bones],
        "targets": keys,
        "materials": sorted({slot.material.name for made in meshes for slot in made.material_slots}),
        "meshes": told,
    }
    with open(path + ".json", "w", encoding="utf-8") as file:
        json.dump(expected, file)


def pack(folder, node_modules):
    """Rewrites a file with quantised numbers, and once more compressed. Of a vertex's bones gltfpack keeps four."""
    tool = os.path.join(node_modules, "gltfpack", "cli.js")
    exact = ["-kn", "-km", "-ke", "-vp", "16", "-af", str(FRAMES_PER_SECOND), "-ar", "16", "-at", "24"]
    for name, options in (("quantised.glb", []), ("meshopt.glb", ["-c"])):
        files = ["-i", os.path.join(folder, "four.glb"), "-o", os.path.join(folder, name)]
        subprocess.run(["node", tool, *files, *exact, *options], check=True)
        shutil.copy(os.path.join(folder, "four.glb.json"), os.path.join(folder, name + ".json"))
        print(f"wrote {name}")


def main():
    if len(sys.argv) not in (2, 3):
        print(__doc__, file=sys.stderr)
        return 2
    try:
        import bpy
    except ImportError as error:
        print(f"Blender's module is not installed: {error}; run pip install bpy", file=sys.stderr)
        return 2
    folder = os.path.abspath(sys.argv[1])
    gltf = {"export_format": "GLB", "export_all_influences": True, "export_morph": True}
    packed = {"export_draco_mesh_compression_enable": True, "export_draco_position_quantization": 20}
    fbx = {"add_leaf_bones": False, "bake_anim_simplify_factor": 0.0, "path_mode": "COPY", "embed_textures": True}
    y_down = {"axis_up": "Z", "axis_forward": "Y"}
    axes = {"add_leaf_bones": True, "primary_bone_axis": "X", "secondary_bone_axis": "-Y"}
    # Each action would be a clip of its own, on one of the armatures.
    together = {"bake_anim_use_all_actions": False, "bake_anim_use_nla_strips": False}
    colored = {"export_vertex_color": "ACTIVE", "export_all_vertex_colors": False}
    # File, what is in it, metres to a unit, and how it is exported.
    files = [
        ("whole.glb", {}, 1.0, gltf),
        ("large.glb", {"scale": 100.0}, 1.0, gltf),
        ("packed.glb", {}, 1.0, {**gltf, **packed}),
        ("beside.gltf", {}, 1.0, {**gltf, "export_format": "GLTF_SEPARATE"}),
        ("colors.glb", {"colors": True}, 1.0, {**gltf, **colored}),
        ("two_rigs.glb", {"twin": True}, 1.0, {**gltf, "export_animation_mode": "ACTIVE_ACTIONS"}),
        ("turned.glb", {"turned": True, "hats": False}, 1.0, gltf),
        ("posed.glb", {}, 1.0, {**gltf, "export_rest_position_armature": False}),
        ("four.glb", {"most": 4}, 1.0, gltf),
        ("metres.fbx", {}, 1.0, fbx),
        ("z_up.fbx", {}, 1.0, {**fbx, **y_down}),
        ("centimetres.fbx", {"scale": 100.0}, 0.01, fbx),
        ("units.fbx", {}, 1.0, {**fbx, "apply_scale_options": "FBX_SCALE_UNITS"}),
        ("all_scaled.fbx", {}, 1.0, {**fbx, "apply_scale_options": "FBX_SCALE_ALL", "embed_textures": False}),
        # Blender's exporter puts what hangs on a bone elsewhere if it turns the bones' axes.
        ("leaves.fbx", {"hats": False}, 1.0, {**fbx, **axes}),
        ("colors.fbx", {"colors": True}, 1.0, fbx),
        ("two_rigs.fbx", {"twin": True}, 1.0, {**fbx, **together}),
        ("turned.fbx", {"turned": True, "hats": False}, 1.0, fbx),
    ]
    for name, contents, metres, options in files:
        rigs = scene(bpy, folder, **contents)
        bpy.context.scene.unit_settings.scale_length = metres
        path = os.path.join(folder, name)
        describe(bpy, rigs, path, metres)
        if name == "posed.glb":
            bpy.context.scene.frame_set(FRAMES[1])
        if name.endswith(".fbx"):
            bpy.ops.export_scene.fbx(filepath=path, **options)
        else:
            bpy.ops.export_scene.gltf(filepath=path, **options)
        print(f"wrote {name}")
    if len(sys.argv) > 2:
        pack(folder, sys.argv[2])
    return 0


if __name__ == "__main__":
    sys.exit(main())
