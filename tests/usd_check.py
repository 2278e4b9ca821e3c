"""Opens an exported file with USD itself and compares it with what we computed.

    pip install usd-core
    python tests/usd_check.py FILE.usda|FILE.usdz EXPECTED.json

EXPECTED.json is that of tests/blender_check.py; the clips after the first are not compared. Each sample may also have
"skinned": {"mesh": [[x, y, z], ...]}, the vertices of meshes as we skin them.

The file must pass USD's own validators. Exits with 0 if everything agrees, 1 if not, 2 if it could not be run.
"""

import json
import math
import sys

# Largest allowed distance as a fraction of the skeleton's size, angle in degrees, and difference of a weight.
TOLERANCE = 1e-5
ANGLE = 0.01
WEIGHT = 1e-6
# Checks of layers that we do not write.
NOT_OURS = ("usdPhysics", "usdMedia", "usdLux")


def validate(path):
    from pxr import Usd, UsdValidation

    registry = UsdValidation.ValidationRegistry()
    validators = [v for v in registry.GetOrLoadAllValidators() if not v.GetMetadata().name.startswith(NOT_OURS)]
    print(f"{len(validators)} validators")
    context = UsdValidation.ValidationContext(validators)
    errors = context.Validate(Usd.Stage.Open(path))
    return [f"validator: {e.GetName()}: {e.GetMessage()}" for e in errors]


def distance(a, b):
    return sum((p - q) ** 2 for p, q in zip(a, b)) ** 0.5


def check(path, expected):
    from pxr import Gf, Usd, UsdGeom, UsdSkel

    faults = validate(path)
    stage = Usd.Stage.Open(path)
    if UsdGeom.GetStageMetersPerUnit(stage) != 1.0 or UsdGeom.GetStageUpAxis(stage) != "Y":
        faults.append("the stage is not in metres with Y up")
    clip = expected["clips"][0]
    rate = stage.GetTimeCodesPerSecond()
    span = (stage.GetStartTimeCode(), stage.GetEndTimeCode())
    print(f"{rate!r} time codes a second, from {span[0]} to {span[1]}")
    if abs(rate * clip["frame_seconds"] - 1.0) > 1e-15 * 4 or stage.GetFramesPerSecond() != rate:
        faults.append(f"{rate} time codes a second, expected {1 / clip['frame_seconds']}")
    if span != (0.0, clip["frames"] - 1.0):
        faults.append(f"time codes {span}, expected 0 to {clip['frames'] - 1}")
    root = UsdSkel.Root(stage.GetDefaultPrim())
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.TraverseInstanceProxies())
    skeletons = [p for p in stage.Traverse() if p.IsA(UsdSkel.Skeleton)]
    main = UsdSkel.Skeleton(skeletons[0])
    query = cache.GetSkelQuery(main)
    names = list(main.GetJointNamesAttr().Get())
    if names != expected["bones"]:
        faults.append(f"joints {names}, expected {expected['bones']}")
        return faults
    valid, why = UsdSkel.Topology(query.GetJointOrder()).Validate()
    if not valid:
        faults.append(f"the joints are no tree: {why}")
    heads = [h for s in clip["samples"] for h in s["heads"].values()]
    size = max((max(h[k] for h in heads) - min(h[k] for h in heads) for k in range(3)), default=1.0)
    xforms = UsdGeom.XformCache()
    for sample in clip["samples"]:
        at = Usd.TimeCode(sample["frame"])
        worst, turned = 0.0, 0.0
        for name, matrix in zip(names, query.ComputeJointSkelTransforms(at)):
            worst = max(worst, distance(matrix.ExtractTranslation(), sample["heads"][name]))
            if "turns" in sample:
                x, y, z, w = sample["turns"][name]
                ours = Gf.Matrix3d(Gf.Quatd(w, x, y, z))
                theirs = Gf.Matrix3d(matrix.RemoveScaleShear().ExtractRotationMatrix())
                off = sum((theirs[i][j] - ours[i][j]) ** 2 for i in range(3) for j in range(3)) ** 0.5
                turned = max(turned, math.degrees(2 * math.asin(min(1.0, off / 8**0.5))))
        print(f"frame {sample['frame']}: heads off by {worst:.3g} of {size:.4g}, bones turned by {turned:.3g} degrees")
        if not (worst <= TOLERANCE * size and turned <= ANGLE):
            faults.append(f"frame {sample['frame']}: off by {worst} of {size} and {turned} degrees")
    bindings = {}
    for prim in skeletons:
        for binding in cache.ComputeSkelBindings(root, Usd.TraverseInstanceProxies()):
            for target in binding.GetSkinningTargets():
                prim = target.GetPrim()
                bindings[prim.GetDisplayName() or prim.GetName()] = (cache.GetSkelQuery(binding.GetSkeleton()), target)
    for mesh in expected.get("meshes", []):
        faults += check_mesh(mesh, bindings, names, clip, size)
    return faults


def check_mesh(expected, bindings, names, clip, size):
    from pxr import Usd, UsdGeom, UsdSkel

    name = expected["name"]
    if name not in bindings:
        return [f"there is no skinned mesh {name}: {sorted(bindings)}"]
    skeleton, target = bindings[name]
    prim = target.GetPrim()
    points = UsdGeom.PointBased(prim).GetPointsAttr().Get()
    if len(points) != len(expected["vertices"]):
        return [f"{name} has {len(points)} points, expected {len(expected['vertices'])}"]
    faults = []
    off = max(distance(p, q) for p, q in zip(points, expected["vertices"]))
    indices, weights = target.ComputeJointInfluences()
    width = target.GetNumInfluencesPerComponent()
    weight_off = 0.0
    for k, wanted in enumerate(expected["weights"]):
        have = {}
        for index, weight in zip(indices[k * width : (k + 1) * width], weights[k * width : (k + 1) * width]):
            have[names[index]] = have.get(names[index], 0.0) + weight
        for bone in set(have) | set(wanted):
            weight_off = max(weight_off, abs(have.get(bone, 0.0) - wanted.get(bone, 0.0)))
    print(f"{name}: points off by {off:.3g}, weights by {weight_off:.3g}")
    if not (off <= TOLERANCE * size and weight_off <= WEIGHT):
        faults.append(f"{name}: points off by {off}, weights by {weight_off}")
    shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(prim)) if target.HasBlendShapes() else None
    controls = list(target.GetBlendShapeOrder() or [])
    for shape, offsets in expected.get("shapes", {}).items():
        if shape not in controls:
            faults.append(f"{name}: there is no blend shape {shape}: {controls}")
            continue
        blend = UsdSkel.BlendShape(shapes.GetBlendShape(controls.index(shape)).GetPrim())
        moved = {i: o for i, o in zip(blend.GetPointIndicesAttr().Get(), blend.GetOffsetsAttr().Get())}
        off = max(distance(moved.get(k, (0, 0, 0)), o) for k, o in enumerate(offsets))
        print(f"{name}, {shape}: off by {off:.3g}")
        if not off <= TOLERANCE * size:
            faults.append(f"{name}, {shape}: off by {off}")
    for sample in clip["samples"]:
        wanted = sample.get("skinned", {}).get(name)
        if wanted is None:
            continue
        at = Usd.TimeCode(sample["frame"])
        moved = points
        if shapes:
            animation = skeleton.GetAnimQuery()
            mapper = target.GetBlendShapeMapper()
            own = mapper.Remap(animation.ComputeBlendShapeWeights(at)) if mapper else animation.ComputeBlendShapeWeights(at)
            ways = shapes.ComputeSubShapeWeights(own)
            moved = type(points)(points)
            shapes.ComputeDeformedPoints(
                *ways, shapes.ComputeBlendShapePointIndices(), shapes.ComputeSubShapePointOffsets(), moved
            )
        moved = type(points)(moved)
        target.ComputeSkinnedPoints(skeleton.ComputeSkinningTransforms(at), moved, at)
        off = max(distance(p, q) for p, q in zip(moved, wanted))
        print(f"{name}, frame {sample['frame']}: skinned points off by {off:.3g} of {size:.4g}")
        if not off <= TOLERANCE * size:
            faults.append(f"{name}, frame {sample['frame']}: skinned points are off by {off} of {size}")
    return faults


def main():
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        import pxr  # noqa: F401
    except ImportError as error:
        print(f"USD is not installed: {error}; run pip install usd-core", file=sys.stderr)
        return 2
    with open(sys.argv[2], encoding="utf-8") as file:
        expected = json.load(file)
    faults = check(sys.argv[1], expected)
    for fault in faults:
        print(f"FAULT: {fault}")
    print("FAILED" if faults else "all agrees")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
