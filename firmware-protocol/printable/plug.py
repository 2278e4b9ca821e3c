"""The plug between two parts. The outlet has a spigot with a box header in it, the inlet a sleeve over that, with the ribbon
cable's socket at its end. One corner is bevelled: it goes in only one way round."""
from manifold3d import CrossSection

from shapes import box, diamond


def outline(width, height, key):
    """Across the plug: u to the right, v up, outwards from the outlet seen from behind; the upper right corner is bevelled."""
    w, h = width / 2, height / 2
    return CrossSection([[(-w, -h), (w, -h), (w, h - key), (w - key, h), (-w, h)]])


def spigot(d, length):
    """Along +z, from 0."""
    return outline(d.spigot_width, d.spigot_height, d.key).extrude(length)


def sleeve_room(d, length):
    """What a sleeve leaves open, along +z."""
    return outline(d.sleeve_width, d.sleeve_height, d.key).extrude(length)


def lying(solid):
    """Turns a plug along z into one along +y that prints on its side: v goes down."""
    return solid.rotate((-90, 0, 0))


def header_pocket(d, z0, z1):
    w, h = d.header_width / 2 + d.clearance, d.header_height / 2 + d.clearance
    return box(-w, w, -h, h, z0, z1)


def clamp_hole(d, z):
    """For a screw that clamps the spigot, through one wall of an upright sleeve."""
    return diamond(d.screw / 2, d.sleeve_width / 2 - 0.5, d.sleeve_width / 2 + 3 * d.wall, 0, z)
