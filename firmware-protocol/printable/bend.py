"""The bend joint: a fork of two shells, between which a tongue turns. The axis is z; inlet at -y, outlet at +y.

The sensor board lies on the lid, chip down, over the magnet in the tongue's shaft. The flat cable stands on edge and passes
beside the axle, so that it only bends."""
import math

from plug import lying, sleeve_room, spigot
from shapes import box, cylinder, union

AXLE = 4.0


class Bend:
    def __init__(self, d):
        self.d = d
        c, w = d.clearance, d.wall
        self.half = d.width / 2
        self.floor = w
        """The tongue lies from here ..."""
        self.tongue_bottom = w + c
        self.tongue_top = self.tongue_bottom + d.spigot_height
        """... to here, the lid from here to there."""
        self.lid_bottom = self.tongue_top + c
        self.lid_top = self.lid_bottom + w
        self.round = d.spigot_width / 2
        self.walls_end = -self.stop_depth()
        self.bay_end = self.walls_end - d.post * 2
        self.inlet_end = self.walls_end - d.bay
        self.inlet = self.inlet_end - d.plug_length - w
        self.shoulder = max(d.rim / 2 * math.sqrt(2), self.half + 2) + 2 * c
        """Where the next part begins: beyond the corners of the sensor's frame."""
        self.outlet = self.shoulder + d.plug_length
        self.shaft_top = self.lid_top + 0.5
        self.board_bottom = self.shaft_top + d.air_gap + d.chip_height
        # Sunk a little into the walls: solids that only touch leave slivers.
        sunk = d.post - 0.4
        x = self.half - d.wall - sunk
        self.posts = [(sign * x, y) for sign in (-1, 1) for y in (self.inlet_end + sunk, self.walls_end - d.post - 0.4)]

    def stop_depth(self):
        """How far below the axis the side walls end: there the tongue's edge meets their corner at the stop."""
        d = self.d
        stop = math.radians(d.bend_travel + d.stop_margin / 2)
        low, high = d.spigot_width / 2 + d.clearance, 4 * d.width
        for _ in range(60):
            depth = (low + high) / 2
            corner = math.hypot(self.half, depth)
            met = math.atan2(self.half, -depth) - math.asin(d.spigot_width / 2 / corner)
            low, high = (depth, high) if met < stop else (low, depth)
        return low

    def outline(self, z0, z1):
        return cylinder(self.half, z0, z1) + box(-self.half, self.half, self.inlet, 0, z0, z1)

    def sleeve_opening(self):
        middle = (self.floor + self.lid_bottom) / 2
        return lying(sleeve_room(self.d, self.inlet_end - self.d.wall - self.inlet)).translate((0, self.inlet, middle))

    def shell(self):
        """Fork half with the axle, printed as it lies."""
        d, top = self.d, self.lid_bottom
        body = self.outline(0, top)
        inside = self.half - d.wall
        body -= box(-inside, inside, self.inlet_end, 2 * self.half, self.floor, top + 1)
        body -= box(-d.socket_width / 2, d.socket_width / 2, self.inlet, self.inlet_end + 1, self.floor, top + 1)
        body -= box(-self.half, self.half, self.walls_end, 2 * self.half, self.floor, top + 1)
        opening = self.sleeve_opening()
        body -= opening + opening.translate((0, -1, 0)) + opening.translate((0, -1, 1))
        body += union(cylinder(d.post, 0, top, x, y) for x, y in self.posts)
        body -= union(cylinder(d.thread / 2, self.floor, top + 1, x, y) for x, y in self.posts)
        return body + cylinder(AXLE, 0, self.tongue_bottom + 5.0)

    def lid(self):
        """Fork half that holds the sensor board."""
        d, z0, z1 = self.d, self.lid_bottom, self.lid_top
        body = self.outline(z0, z1)
        frame = d.rim / 2
        room = d.board / 2 + d.clearance
        ledge = d.board / 2 - d.board_ledge
        body += box(-frame, frame, -frame, frame, z0, self.board_bottom + d.board_thickness + 2.0)
        body -= box(-room, room, -room, room, self.board_bottom, self.board_bottom + 10)
        body -= box(-ledge, ledge, -ledge, ledge, z1, self.board_bottom + 1)
        body -= cylinder(d.shaft + d.clearance, z0 - 1, z1 + 1)
        # The sensor's wires leave the frame towards the bay and go down there.
        body -= box(-4, 4, -2 * frame, 0, z1, self.board_bottom + 20)
        body -= box(-4, 4, -frame - 5, -frame - 1, z0 - 1, z1 + 1)
        body -= union(cylinder(d.screw / 2, z0 - 1, z1 + 1, x, y) for x, y in self.posts)
        # A screw that clamps the plug.
        return body - cylinder(d.thread / 2, z0 - 1, z1 + 1, 0, self.inlet + d.plug_length / 2)

    def cap(self):
        """Holds the sensor board down."""
        d = self.d
        frame, lip = d.rim / 2, d.board / 2 - 0.1
        z1 = self.board_bottom + d.board_thickness
        z2 = z1 + 2.0
        body = box(-frame, frame, -frame, frame, z2, z2 + d.wall)
        ring = box(-lip, lip, -lip, lip, z1, z2) - box(-lip + d.wall, lip - d.wall, -lip + d.wall, lip - d.wall, z1 - 1, z2)
        return body + (ring - box(-4.5, 4.5, -2 * frame, 0, z1 - 1, z2))

    def tongue_outline(self, z0, z1):
        r = self.round
        return cylinder(r, z0, z1) + box(-r, r, 0, self.shoulder, z0, z1)

    def tongue(self):
        d = self.d
        z0, z1 = self.tongue_bottom, self.tongue_top
        middle = (z0 + z1) / 2
        body = self.tongue_outline(z0, z1)
        body += lying(spigot(d, self.outlet)).translate((0, 0, middle)) - box(-99, 99, -99, self.shoulder, -99, 99)
        body += cylinder(d.shaft, z1 - 1, self.shaft_top)
        pocket = d.magnet_diameter / 2 + 0.1
        body -= cylinder(pocket, self.shaft_top - d.magnet_height, self.shaft_top + 1)
        # The axle's hole ends in a cone, which prints without support.
        axle = AXLE + d.clearance
        body -= cylinder(axle, z0 - 1, z0 + 5.3) + cylinder(axle, z0 + 5.3, z0 + 5.3 + axle - 0.1, top=0.1)
        # Cable beside the axle, room for the header, and the lid over both.
        channel = (self.round - d.wall - 2.7, self.round - d.wall)
        bottom = z1 - d.wall - d.ribbon
        header = d.header_width / 2 + d.clearance
        behind = self.outlet - d.header_depth
        body -= box(*channel, -1, behind, bottom, z1 + 1)
        body -= box(channel[0], 99, -99, -1, z0 - 1, z1 + 1)
        body -= box(-header, header, behind - 4, self.outlet + 1, middle - d.header_height / 2 - d.clearance, z1 + 1)
        body -= self.lid_room()
        return body - cylinder(d.thread / 2, z0 + d.wall, z1, 0, self.lid_begin + 3.5)

    @property
    def lid_begin(self):
        return self.d.shaft + self.d.wall

    def lid_room(self):
        d = self.d
        return box(-99, 99, self.lid_begin, 99, self.tongue_top - d.wall, self.tongue_top + 1)

    def tongue_lid(self):
        d, z1 = self.d, self.tongue_top
        body = box(-self.round, self.round, self.lid_begin + d.clearance, self.outlet, z1 - d.wall, z1)
        return body - cylinder(d.screw / 2, z1 - 5, z1 + 1, 0, self.lid_begin + 3.5)

    def fixed(self):
        return {"bend-shell": self.shell(), "bend-lid": self.lid(), "bend-cap": self.cap()}

    def moving(self):
        return {"bend-tongue": self.tongue(), "bend-tongue-lid": self.tongue_lid()}

    def bought(self):
        """Magnet, and sensor board with its chip: where they sit, and on which side of the joint."""
        d = self.d
        board = box(-d.board / 2, d.board / 2, -d.board / 2, d.board / 2, self.board_bottom, self.board_bottom + d.board_thickness)
        chip = box(-2.5, 2.5, -3, 3, self.board_bottom - d.chip_height, self.board_bottom)
        magnet = cylinder(d.magnet_diameter / 2, self.shaft_top - d.magnet_height, self.shaft_top)
        return {"board": board, "chip": chip, "magnet": magnet}

    def turn(self, solid, degrees):
        return solid.rotate((0, 0, degrees))

    def printed(self):
        """As they lie on the printer's bed."""
        upside_down = {"bend-cap"}
        for name, solid in {**self.fixed(), **self.moving()}.items():
            yield name, solid.rotate((180, 0, 0)) if name in upside_down else solid
