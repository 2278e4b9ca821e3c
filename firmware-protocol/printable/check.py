"""Checks the printable puppet: every part is closed and of one piece, has no wall thinner than `least_wall`, prints without support;
joints turn freely as far as they say and stop behind that; magnet, chip and plug sit where they should.

    check.py [NAME=MILLIMETRES ...]      parameters: design.py
"""
import math
import sys

import numpy as np
from manifold3d import Error

from bend import Bend
from design import parse
from parts import everything
from plug import outline, sleeve_room, spigot
from shapes import union
from twist import Twist

LAYER = 0.3
"""Height of the layers in which overhangs are looked for."""
SPECK = 0.15
"""Slivers narrower than this come from facets and are no overhang."""
SPACING = 2.5
"""Distance between the places where a wall's thickness is measured."""
OPPOSITE = 0.85
"""Two faces are a wall if their normals point apart by more than this cosine."""
TOUCH = 1e-3
"""Volume in mm³ in which two bodies may meet by rounding."""


def pieces(solid):
    if solid.status() != Error.NoError or solid.volume() <= 0:
        return [f"is not sound: {solid.status()}"]
    found = len(solid.decompose())
    return [] if found == 1 else [f"falls into {found} pieces"]


def overhangs(solid, degrees):
    """Layers that reach further over the layer below than the printer can, given as height and area."""
    low, high = solid.bounding_box()[2], solid.bounding_box()[5]
    reach = LAYER * math.tan(math.radians(degrees)) + 1e-3
    below, found = None, []
    for i in range(int((high - low) / LAYER)):
        layer = solid.slice(low + (i + 0.5) * LAYER)
        if below is not None:
            free = (layer - below.offset(reach)).offset(-SPECK)
            if free.area() > 0.05:
                found.append((low + (i + 0.5) * LAYER, free.area()))
        below = layer
    return [f"hangs over by {area:.1f} mm² at a height of {z:.1f}" for z, area in found[:3]]


def thinnest(solid):
    """The thinnest wall: its thickness, and where."""
    mesh = solid.refine_to_length(SPACING).to_mesh()
    corners = np.asarray(mesh.vert_properties)[:, :3].astype(float)[np.asarray(mesh.tri_verts)]
    middles = corners.mean(axis=1)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    least = (math.inf, None)
    for middle, normal, length in zip(middles, normals, lengths):
        if length < 1e-4:
            continue
        normal = normal / length
        start, end = middle - 1e-4 * normal, middle - 20 * normal
        hits = solid.ray_cast(tuple(start), tuple(end))
        if hits and np.dot(hits[0].normal, -normal) > OPPOSITE:
            thickness = float(np.linalg.norm(np.asarray(hits[0].position) - middle))
            if thickness < least[0]:
                least = (thickness, middle)
    return least


def walls(solid, least):
    thickness, place = thinnest(solid)
    if thickness >= least - 1e-3:
        return []
    return [f"has a wall of {thickness:.2f} mm at {', '.join(f'{x:.1f}' for x in place)}"]


def meet(one, other):
    return (one ^ other).volume()


def movement(name, joint, travel, neighbour=None):
    """What turns, with what is plugged into it, meets nothing up to the travel, and something soon behind it."""
    d = joint.d
    bought = joint.bought()
    fixed = union(joint.fixed().values()) + bought["board"] + bought["chip"]
    moving = union(joint.moving().values()) + bought["magnet"]
    if neighbour is not None:
        moving += neighbour
    wrong = []
    for name_fixed, solid in joint.fixed().items():
        for other, its in joint.fixed().items():
            if name_fixed < other and meet(solid, its) > TOUCH:
                wrong.append(f"{name_fixed} and {other} are in each other's way")
    for degrees in np.arange(-travel, travel + 1e-6, 2.5):
        met = meet(fixed, joint.turn(moving, degrees))
        if met > TOUCH:
            wrong.append(f"{name} meets itself at {degrees:.1f} degrees ({met:.2f} mm³)")
            break
    for side in (-1, 1):
        stop = side * (travel + d.stop_margin)
        if meet(fixed, joint.turn(moving, stop)) < 0.01:
            wrong.append(f"{name} has no stop at {stop:.0f} degrees")
    return wrong


def sensors(name, joint):
    """The magnet is in front of the chip, at the data sheet's distance; all that is bought has room."""
    bought = joint.bought()
    gap = bought["chip"].min_gap(bought["magnet"], 10)
    wrong = [] if 0.5 <= gap <= 3 else [f"{name}: {gap:.2f} mm from magnet to chip"]
    for body, solid in {**joint.fixed(), **joint.moving()}.items():
        for what, it in bought.items():
            if meet(solid, it) > TOUCH:
                wrong.append(f"{body} leaves no room for the {what}")
    return wrong


def plug(d):
    """A plug goes in, and only one way round."""
    inside = spigot(d, d.plug_length)
    outside = outline(d.sleeve_width + 2 * d.wall, d.sleeve_height + 2 * d.wall, 0.01).extrude(d.plug_length) - sleeve_room(d, d.plug_length)
    wrong = [] if meet(inside, outside) < TOUCH else ["a plug does not fit into its sleeve"]
    if meet(inside.rotate((0, 0, 180)), outside) < 1:
        wrong.append("a plug can be put in the wrong way round")
    return wrong


def check(d):
    """What is wrong, in words. Walls, which take longest, are measured when all else is right."""
    bend, twist = Bend(d), Twist(d)
    wrong = plug(d) + sensors("bend", bend) + sensors("twist", twist)
    wrong += movement("bend with a bend", bend, d.bend_travel, on_a_tongue(bend, bend.fixed()))
    wrong += movement("bend with a twist", bend, d.bend_travel, on_a_tongue(bend, twist.fixed()))
    wrong += movement("twist with a bend", twist, d.twist_travel, on_a_rotor(twist, bend.fixed()))
    parts = everything(d).items()
    wrong += [f"{name} {what}" for name, solid in parts for what in pieces(solid) + overhangs(solid, d.overhang)]
    return wrong or [f"{name} {what}" for name, solid in parts for what in walls(solid, d.least_wall)]


def on_a_tongue(bend, fixed):
    """What is plugged into a bend joint's outlet: another one, or a twist joint, which stands along z."""
    if "bend-shell" in fixed:
        return union(fixed.values()).translate((0, bend.shoulder - bend.inlet, 0))
    middle = (bend.tongue_bottom + bend.tongue_top) / 2
    return union(fixed.values()).rotate((-90, 0, 0)).translate((0, bend.shoulder, middle))


def on_a_rotor(twist, fixed):
    """A bend joint in a twist joint's outlet, which stands along z."""
    bend = Bend(twist.d)
    middle = (bend.floor + bend.lid_bottom) / 2
    return union(fixed.values()).translate((0, -bend.inlet, -middle)).rotate((90, 0, 0)).translate((0, 0, twist.neck_top))


def main():
    wrong = check(parse(sys.argv[1:]))
    for line in wrong:
        print(line)
    if wrong:
        raise SystemExit(1)
    print("every part is of one piece, thick enough and prints without support; joints turn and stop; magnets and plugs fit")


if __name__ == "__main__":
    main()
