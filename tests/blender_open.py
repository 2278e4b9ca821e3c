"""Measures how long a real Blender takes to import a glTF file.

    pip install bpy
    python tests/blender_open.py FILE.glb

Prints one JSON object with the median of three imports, after one that loads the importer:

    {"program": "Blender 5.0.1", "seconds": 1.2, "triangles": 60000, "shapes": 40}
"""

import json
import os
import statistics
import sys
import time


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    import bpy

    # Blender reports on standard output; keep that for the one JSON object.
    kept = os.dup(1)
    os.dup2(2, 1)
    seconds = []
    for _ in range(4):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        start = time.perf_counter()
        bpy.ops.import_scene.gltf(filepath=os.path.abspath(sys.argv[1]))
        seconds.append(time.perf_counter() - start)
    meshes = [o.data for o in bpy.context.scene.objects if o.type == "MESH"]
    for mesh in meshes:
        mesh.calc_loop_triangles()
    os.dup2(kept, 1)
    print(
        json.dumps(
            {
                "program": f"Blender {bpy.app.version_string}",
                "seconds": statistics.median(seconds[1:]),
                "triangles": sum(len(mesh.loop_triangles) for mesh in meshes),
                "shapes": sum(len(mesh.shape_keys.key_blocks) - 1 for mesh in meshes if mesh.shape_keys),
            }
        )
    )


if __name__ == "__main__":
    main()
