"""Parts without a joint: splitters, the base with the controller, and a clip at the end of an arm."""
import math

from bend import Bend
from plug import clamp_hole, lying, outline, sleeve_room, spigot
from shapes import box, cylinder, hull, union


def outlet(d, radius):
    """A lying spigot along +y from `radius` on, on the printer's bed: its tray, and what lies open in it."""
    middle = d.spigot_height / 2
    end = radius + d.plug_length
    solid = lying(spigot(d, d.plug_length + 6)).translate((0, radius - 6, middle))
    w, h = d.header_width / 2 + d.clearance, d.header_height / 2 + d.clearance
    inside = box(-w, w, end - d.header_depth, end + 1, middle - h, d.spigot_height + 1)
    inside += box(-w + 2, w - 2, radius - 20, end, middle - h, d.spigot_height + 1)
    return solid, inside


def marks(d, count, radius):
    """Dimples that number an outlet, from one on."""
    top = d.spigot_height
    return union(cylinder(0.9, top - 0.6, top + 1, 3.2 * (i - (count - 1) / 2), radius, segments=16) for i in range(count))


class Splitter:
    """Outlets around a round room for the electronics; the inlet is a sleeve at -y."""

    def __init__(self, d, outlets):
        self.d, self.outlets = d, outlets
        self.apart = 360 / (outlets + 1)
        self.radius = max(24.0, (d.width / 2 + 1) / math.tan(math.radians(self.apart / 2)))
        """Far enough out for the parts that are plugged in side by side."""
        self.sleeve_begin = -self.radius - 2
        """The inlet's sleeve lies beyond this; it is higher than the rest."""
        between = [self.apart * (i + 0.5) - 90 for i in range(outlets + 1)]
        r = self.radius - d.post
        self.posts = [(r * math.cos(math.radians(a)), r * math.sin(math.radians(a))) for a in between]

    def turned(self, solid, i):
        """From +y to the place of an outlet. They count from the left, seen with the inlet towards you."""
        return solid.rotate((0, 0, self.apart * ((self.outlets - 1) / 2 - i)))

    def sleeve(self):
        """The inlet without its cover."""
        d, joint = self.d, Bend(self.d)
        half, end = d.sleeve_width / 2 + d.wall, self.sleeve_begin - d.plug_length - d.wall - 2
        body = box(-half, half, end, self.sleeve_begin, 0, joint.lid_bottom)
        body += box(-half, half, self.sleeve_begin - 1, -self.radius / 2, 0, d.spigot_height - d.wall) - cylinder(self.radius - d.wall, -1, 99)
        room = lying(sleeve_room(d, d.plug_length)).translate((0, end, (d.wall + joint.lid_bottom) / 2))
        body -= room + room.translate((0, -1, 0)) + room.translate((0, -1, 1))
        body -= box(-d.socket_width / 2, d.socket_width / 2, end, 0, d.wall, 99)
        cover = box(-half, half, end, self.sleeve_begin, joint.lid_bottom, joint.lid_top)
        return body, cover - cylinder(d.thread / 2, 0, 99, 0, end + d.plug_length / 2)

    def printed(self):
        d = self.d
        line, half = d.spigot_height - d.wall, d.sleeve_width / 2 + d.wall + d.clearance
        outlets = [tuple(self.turned(solid, i) for solid in outlet(d, self.radius)) for i in range(self.outlets)]
        hub = cylinder(self.radius, 0, d.spigot_height) + union(solid for solid, _ in outlets)
        sleeve, cover = self.sleeve()
        tray = hub.trim_by_plane((0, 0, -1), -line) - cylinder(self.radius - d.wall, d.wall, 99)
        tray -= union(inside for _, inside in outlets) + box(-d.socket_width / 2, d.socket_width / 2, -99, 0, d.wall, 99)
        tray += sleeve + union(cylinder(d.post, 0, line, x, y) for x, y in self.posts)
        tray -= union(cylinder(d.thread / 2, d.wall, 99, x, y) for x, y in self.posts)
        lid = hub.trim_by_plane((0, 0, 1), line) - box(-half, half, -99, self.sleeve_begin + d.clearance, 0, 99)
        lid -= union(cylinder(d.screw / 2, 0, 99, x, y) for x, y in self.posts)
        lid -= union(self.turned(marks(d, i + 1, self.radius - 4), i) for i in range(self.outlets))
        yield f"splitter-{self.outlets}-tray", tray
        yield f"splitter-{self.outlets}-lid", lid
        yield f"splitter-{self.outlets}-cover", cover


class Base:
    """The root: stands on the table, holds the controller, five outlets."""

    def __init__(self, d):
        self.d = d
        self.length, self.depth = 96.0, 2 * (d.width + 4)
        x, y, step = self.length / 2, self.depth / 2, d.width / 2 + 1.5
        self.places = [(90, -x, -step), (90, -x, step), (0, 0, y), (-90, x, step), (-90, x, -step)]
        """How each outlet is turned from +y, and where it is. They count from the left, seen with the cable to the computer towards you."""

    def printed(self):
        d = self.d
        x, y, w, top = self.length / 2, self.depth / 2, d.wall, d.spigot_height
        outlets = []
        for degrees, px, py in self.places:
            outlets.append(tuple(s.rotate((0, 0, degrees)).translate((px, py, 0)) for s in outlet(d, 0)))
        hub = box(-x, x, -y, y, 0, top) + union(solid for solid, _ in outlets)
        posts = [(sx * (x - d.post - 0.1), sy * (y - d.post - 0.1)) for sx in (-1, 1) for sy in (-1, 1)]
        tray = hub - box(-x + w, x - w, -y + w, y - w, w, 99)
        tray -= union(inside for _, inside in outlets)
        # The controller's socket, and feet for screws into the table.
        tray -= box(-7, 7, -y - 1, -y + w + 1, w + 1, 99)
        feet = [(sx * (x - 14), sy * y) for sx in (-1, 1) for sy in (-1,)]
        tray += union(box(px - 6, px + 6, py - 11, py + 1, 0, w + 1) for px, py in feet)
        tray -= union(cylinder(d.screw / 2 + 0.4, -1, 99, px, py - 6) for px, py in feet)
        tray += union(cylinder(d.post, 0, top, px, py) for px, py in posts)
        tray -= union(cylinder(d.thread / 2, w, 99, px, py) for px, py in posts)
        line = top - w
        lid = hub.trim_by_plane((0, 0, 1), line) - union(cylinder(d.screw / 2, 0, 99, px, py) for px, py in posts)
        for i, (degrees, px, py) in enumerate(self.places):
            lid -= marks(d, i + 1, -4).rotate((0, 0, degrees)).translate((px, py, 0))
        yield "base-tray", tray.trim_by_plane((0, 0, -1), -line)
        yield "base-lid", lid


class Clip:
    """For the end of an arm: holds a stick of `stick` millimetres, along the arm."""

    stick = 8.0

    def __init__(self, d):
        self.d = d

    def printed(self):
        d, w = self.d, self.d.wall
        outside = outline(d.sleeve_width + 2 * w, d.sleeve_height + 2 * w, 0.01)
        roof = d.plug_length + d.sleeve_height / 2
        top = roof + w
        room = sleeve_room(d, d.plug_length)
        body = outside.extrude(top) - room - room.translate((0, 0, -1))
        half = d.sleeve_width / 2
        ridge = box(-half + d.sleeve_height / 2, half - d.sleeve_height / 2, -0.2, 0.2, d.plug_length, roof - 0.2)
        body -= hull(room.trim_by_plane((0, 0, 1), d.plug_length - 0.1), ridge.trim_by_plane((0, 0, 1), roof - 0.5))
        body -= clamp_hole(d, d.plug_length / 2)
        r = self.stick / 2
        jaws = cylinder(r + w, top - 0.1, top + 16) - cylinder(r, top, top + 17)
        jaws -= box(-r * 0.75, r * 0.75, 0, 99, top, top + 17)
        yield "hand-clip", body + jaws
