"""Solids that the parts are made of."""
import numpy as np
from manifold3d import CrossSection, Manifold

SEGMENTS = 64


def box(x0, x1, y0, y1, z0, z1):
    return Manifold.cube((x1 - x0, y1 - y0, z1 - z0)).translate((x0, y0, z0))


def cylinder(radius, z0, z1, x=0.0, y=0.0, top=None, segments=SEGMENTS):
    return Manifold.cylinder(z1 - z0, radius, radius if top is None else top, segments).translate((x, y, z0))


def sector(radius, z0, z1, middle, width):
    """A piece of a disc: `width` degrees around the direction `middle`."""
    angles = np.radians(np.linspace(middle - width / 2, middle + width / 2, max(3, int(width / 5))))
    corners = [(0.0, 0.0)] + [(radius * np.cos(a), radius * np.sin(a)) for a in angles]
    return CrossSection([corners]).extrude(z1 - z0).translate((0, 0, z0))


def hull(*solids):
    return Manifold.batch_hull(list(solids))


def diamond(size, x0, x1, y, z):
    """A hole along x that prints without support: a square that stands on its corner."""
    side = CrossSection([[(-size, 0), (0, -size), (size, 0), (0, size)]]).extrude(x1 - x0)
    return side.rotate((90, 0, 90)).translate((x0, y, z))


def union(solids):
    total = Manifold()
    for solid in solids:
        total += solid
    return total
