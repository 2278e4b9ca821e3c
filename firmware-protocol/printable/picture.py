"""Pictures of the parts: one of all parts as they are printed, and one of each joint, put together and taken apart along its axis.

    picture.py FOLDER [NAME=MILLIMETRES ...]      parameters: design.py
    picture.py --compare FOLDER                   whether the pictures in FOLDER are those that this draws
"""
import math
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from bend import Bend
from design import parse
from parts import everything
from twist import Twist

COLORS = {"fixed": (0.36, 0.52, 0.72), "moving": (0.86, 0.52, 0.30), "board": (0.25, 0.55, 0.35), "chip": (0.2, 0.2, 0.22), "magnet": (0.75, 0.75, 0.78)}
LIGHT = np.array([0.35, -0.5, 0.8]) / np.linalg.norm([0.35, -0.5, 0.8])


def triangles(solid):
    mesh = solid.to_mesh()
    return np.asarray(mesh.vert_properties)[:, :3].astype(float)[np.asarray(mesh.tri_verts)]


def view(turn, tilt):
    """From the front right and above: x to the right, y up, z towards the eye."""
    a, b = math.radians(turn), math.radians(tilt)
    about_z = np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, math.sin(b), math.cos(b)], [0, -math.cos(b), math.sin(b)]])
    return about_x @ about_z


def draw(bodies, width, turn=30, tilt=35, margin=12, side=0):
    """Triangles, colour and name of each body to a picture. Twice as large inside, for smooth edges. A name is written beside its
    body: below it, or, where there is room for them at the right, `side` pixels wide, level with its middle."""
    rotation = view(turn, tilt)
    seen = [(corners @ rotation.T, color, corners) for corners, color, _ in bodies]
    points = np.concatenate([corners.reshape(-1, 3) for corners, _, _ in seen])
    width, below = width - side, 0 if side else LETTERS + 6
    low, high = points.min(axis=0), points.max(axis=0)
    scale = 2 * (width - 2 * margin) / (high[0] - low[0])
    height = math.ceil((high[1] - low[1]) * scale / 2) + 2 * margin
    image = np.ones((2 * height, 2 * width, 3))
    depth = np.full((2 * height, 2 * width), -np.inf)
    for corners, color, solid in seen:
        normals = np.cross(solid[:, 1] - solid[:, 0], solid[:, 2] - solid[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        shades = 0.45 + 0.55 * np.clip(normals @ LIGHT, 0, 1)
        flat = (corners - low) * scale + 2 * margin
        flat[:, :, 1] = 2 * height - flat[:, :, 1]
        for corner, shade in zip(flat, shades):
            fill(image, depth, corner, np.array(color) * shade)
    smooth = image.reshape(height, 2, width, 2, 3).mean(axis=(1, 3))
    picture = Image.new("RGB", (width + side, height + below), "white")
    picture.paste(Image.fromarray(np.round(np.clip(smooth, 0, 1) * 255).astype(np.uint8)))
    write_names(ImageDraw.Draw(picture), [(flattened(corners, low, scale, height, margin), name) for (corners, _, _), (_, _, name) in zip(seen, bodies)], width if side else None)
    return picture


LETTERS = 13


def flattened(corners, low, scale, height, margin):
    """Where a body lies in the picture: left, top, right, bottom."""
    flat = (corners.reshape(-1, 3)[:, :2] - low[:2]) * scale / 2 + margin
    (left, bottom), (right, top) = flat.min(axis=0), flat.max(axis=0)
    return left, height - top, right, height - bottom


def write_names(pen, places, right):
    """Each name below its body, or at `right` with a line to it."""
    font = ImageFont.load_default(LETTERS)
    if right is None:
        for (left, _, end, bottom), name in places:
            room = pen.textlength(name, font) / 2 + 3
            middle = min(max((left + end) / 2, room), pen.im.size[0] - room)
            pen.text((middle, bottom + 3), name, fill=INK, font=font, anchor="ma")
        return
    last = -math.inf
    for (_, top, end, bottom), name in sorted(places, key=lambda place: place[0][1] + place[0][3]):
        y = max((top + bottom) / 2, last + LETTERS + 3)
        last = y
        pen.line([(end + 3, (top + bottom) / 2), (right, y), (right + 6, y)], fill=(150, 150, 150))
        pen.text((right + 9, y), name, fill=INK, font=font, anchor="lm")


INK = (40, 50, 56)


def fill(image, depth, corner, color):
    x, y, z = corner.T
    area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    if area >= -1e-9:
        return  # turned away
    x0, x1 = max(0, math.floor(x.min())), min(image.shape[1], math.ceil(x.max()) + 1)
    y0, y1 = max(0, math.floor(y.min())), min(image.shape[0], math.ceil(y.max()) + 1)
    if x0 >= x1 or y0 >= y1:
        return
    px, py = np.meshgrid(np.arange(x0, x1) + 0.5, np.arange(y0, y1) + 0.5)
    one = ((x[1] - px) * (y[2] - py) - (x[2] - px) * (y[1] - py)) / area
    two = ((x[2] - px) * (y[0] - py) - (x[0] - px) * (y[2] - py)) / area
    three = 1 - one - two
    here = one * z[0] + two * z[1] + three * z[2]
    window = (slice(y0, y1), slice(x0, x1))
    inside = (one >= 0) & (two >= 0) & (three >= 0) & (here > depth[window])
    depth[window][inside] = here[inside]
    image[window][inside] = color


def apart(joint, order, spread):
    """A joint's bodies, moved apart along its axis: `order` names them from below, with their heights in units of `spread`."""
    kinds = {**{name: "fixed" for name in joint.fixed()}, **{name: "moving" for name in joint.moving()}}
    solids = {**joint.fixed(), **joint.moving(), **joint.bought()}
    names = {"board": "sensor board"}
    return [(triangles(solids[name].translate((0, 0, spread * place))), COLORS[kinds.get(name, name)], names.get(name, name)) for name, place in order.items()]


BEND = {"bend-shell": 0, "bend-tongue": 1.2, "magnet": 2.1, "bend-tongue-lid": 2.3, "bend-lid": 3.6, "chip": 4.5, "board": 5, "bend-cap": 5.7}
TWIST = {"twist-stator": 0, "board": 1.8, "chip": 2.3, "magnet": 2.9, "twist-shaft": 3.3, "twist-rotor": 4.1, "twist-collar": 5.8}


def laid_out(parts, width, gap=16):
    """Parts in rows, as on a bed, with room for their names."""
    bodies, x, y, deep = [], 0.0, 0.0, 0.0
    for name, solid in parts.items():
        low = solid.bounding_box()
        wide, long, tall = low[3] - low[0], low[4] - low[1], low[5] - low[2]
        if x + wide > width:
            x, y, deep = 0.0, y - deep - 1.5 * gap, 0.0
        # What is tall reaches over what lies behind it.
        bodies.append((triangles(solid.translate((x - low[0], y - low[4] - tall / 2, 0))), COLORS["fixed"], name))
        x, deep = x + wide + gap, max(deep, long + tall / 2)
    return bodies


def pictures(d):
    return {
        "bend.png": draw(apart(Bend(d), BEND, 22), 640, turn=35, tilt=25, side=150),
        "twist.png": draw(apart(Twist(d), TWIST, 16), 560, turn=35, tilt=25, side=150),
        "parts.png": draw(laid_out(everything(d), 460), 1000, turn=0, tilt=55),
    }


def compare(folder):
    """Pictures that differ from those drawn here by more than rounding does."""
    wrong = []
    for name, drawn in pictures(parse([])).items():
        with Image.open(folder / name) as shown:
            alike = shown.size == drawn.size and np.abs(np.asarray(shown.convert("RGB"), float) - np.asarray(drawn, float)).mean() < 0.5
        if not alike:
            wrong.append(f"{folder / name} shows something else: picture.py draws it again")
    return wrong


def main():
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    if sys.argv[1] == "--compare":
        wrong = compare(Path(sys.argv[2]))
        if wrong:
            raise SystemExit("\n".join(wrong))
        print("the pictures show the parts")
        return
    folder, d = Path(sys.argv[1]), parse(sys.argv[2:])
    folder.mkdir(parents=True, exist_ok=True)
    for name, picture in pictures(d).items():
        picture.save(folder / name, optimize=True)


if __name__ == "__main__":
    main()
