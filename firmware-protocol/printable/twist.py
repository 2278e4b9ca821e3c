"""The twist joint: a cup in which a rotor turns, held by a collar. The axis is z; inlet below, outlet above.

The sensor board lies in the cup, chip up, under the magnet on the rotor's shaft. The flat cable comes up through the floor, passes
beside the board, lies around the shaft like the spring of a clock and goes out through the rotor."""
import math

from plug import clamp_hole, header_pocket, outline, sleeve_room, spigot
from shapes import box, cylinder, hull, sector, union

FUNNEL = 45.0
TENON = 3.0


class Twist:
    def __init__(self, d):
        self.d = d
        c, w = d.clearance, d.wall
        room = d.board / 2 + c
        corner = math.hypot(d.spigot_width, d.spigot_height) / 2
        self.cup = max(room * math.sqrt(2) + 0.2, corner + 2.6 + c)
        """Radius inside: room for the board, and for a neck that is as wide as the spigot."""
        self.step = self.cup + 1.5
        """The rotor's flange lies on this step."""
        self.outer = self.step + c + w
        slot = (d.ribbon / 2 + 1, 1.5)
        narrowing = max(d.sleeve_width / 2 - slot[0], d.sleeve_height / 2 - slot[1])
        self.slot = slot
        self.sleeve_end = d.plug_length
        self.funnel_end = self.sleeve_end + narrowing / math.tan(math.radians(FUNNEL))
        self.cone_begin = 4.0
        self.cone_end = self.cone_begin + (self.outer - d.sleeve_height / 2 - w) / math.tan(math.radians(FUNNEL + 3))
        self.cup_floor = max(self.funnel_end, self.cone_end) + w
        self.board_bottom = self.cup_floor + 6.0
        self.chip_top = self.board_bottom + d.board_thickness + d.chip_height
        self.flange_bottom = self.chip_top + d.ribbon + 5.0
        self.flange_top = self.flange_bottom + 2.6
        self.collar_bottom = self.flange_top + c
        self.collar_top = self.collar_bottom + w
        self.neck_top = self.collar_top + 2 * c
        self.opening = self.step - 1.8
        """Inner radius of the collar; its tooth and the neck's lug stop the rotor."""
        self.tooth = self.opening - 2.0
        self.neck = self.tooth - c
        self.stop_width = 180 - d.twist_travel - d.stop_margin / 2
        self.ears = [60.0, 180.0, 300.0]

    def ear(self, z0, z1, angle, radius):
        d = self.d
        a = math.radians(angle)
        return cylinder(radius, z0, z1, (self.outer + d.post - 1) * math.cos(a), (self.outer + d.post - 1) * math.sin(a), segments=24)

    def stator(self):
        d, c, w = self.d, self.d.clearance, self.d.wall
        top = self.collar_bottom
        foot = outline(d.sleeve_width + 2 * w, d.sleeve_height + 2 * w, 0.01)
        body = foot.extrude(self.cone_begin + 0.1)
        body += hull(foot.extrude(0.1).translate((0, 0, self.cone_begin)), cylinder(self.outer, self.cone_end, self.cone_end + 0.1))
        body += cylinder(self.outer, self.cone_end, top)
        # Sleeve, funnel and the cable's slot.
        room = sleeve_room(d, self.sleeve_end)
        end = box(-self.slot[0], self.slot[0], -self.slot[1], self.slot[1], self.funnel_end, self.funnel_end + 0.1)
        body -= room + room.translate((0, 0, -1)) + hull(room.trim_by_plane((0, 0, 1), self.sleeve_end - 0.1), end)
        body -= box(-self.slot[0], self.slot[0], -self.slot[1], self.slot[1], self.funnel_end, self.cup_floor + 1)
        body -= clamp_hole(d, self.sleeve_end / 2)
        # The cup: a ledge for the board's corners, a frame around it, and a way for the cable on one side.
        frame, ledge = d.board / 2 + c, d.board / 2 - d.board_ledge
        above = self.board_bottom + d.board_thickness + 1
        cable = box(-self.slot[0], self.slot[0], 0, self.cup - 0.3, self.cup_floor, above + 1)
        room = cylinder(self.cup, above, top + 1) + cylinder(self.step + c, self.flange_bottom, top + 1)
        room += box(-frame, frame, -frame, frame, self.board_bottom, above + 1)
        room += box(-ledge, ledge, -ledge, ledge, self.cup_floor, above + 1) + (cable ^ cylinder(self.cup, 0, top))
        body -= room
        # Ears for the collar's screws, on slopes.
        for angle in self.ears:
            high = self.ear(top - 8, top, angle, d.post)
            low = self.ear(top - 8 - 3 * d.post, top - 8 - 3 * d.post + 0.1, angle, 0.5)
            inwards = -2 * d.post
            a = math.radians(angle)
            ear = hull(high, low.translate((inwards * math.cos(a), inwards * math.sin(a), 0))) - cylinder(self.outer - 0.5, 0, top + 1)
            body += ear
            body -= self.ear(top - 7, top + 1, angle, d.thread / 2)
        return body

    def collar(self):
        d = self.d
        z0, z1 = self.collar_bottom, self.collar_top
        body = cylinder(self.outer, z0, z1) + union(self.ear(z0, z1, angle, d.post) for angle in self.ears)
        body -= cylinder(self.opening, z0 - 1, z1 + 1)
        body += sector(self.outer - 0.5, z0, z1, -90, self.stop_width) - cylinder(self.tooth, z0 - 1, z1 + 1)
        return body - union(self.ear(z0 - 1, z1 + 1, angle, d.screw / 2) for angle in self.ears)

    def rotor(self):
        d = self.d
        z0, end = self.flange_bottom, self.neck_top + d.plug_length
        body = cylinder(self.step, z0, self.flange_top) + cylinder(self.neck, z0, self.neck_top)
        body += sector(self.opening - d.clearance, z0, self.neck_top, 90, self.stop_width)
        body += spigot(d, d.plug_length).translate((0, 0, self.neck_top))
        pocket = end - d.header_depth
        body -= header_pocket(d, pocket, end + 1)
        # The cable's way, and the hole for the shaft's tenon.
        x = d.header_width / 2 + d.clearance
        body -= box(x - 3, x, -4.5, 4.5, z0 - 1, pocket + 1)
        hole = TENON + 0.1
        body -= box(-hole, hole, -hole, hole, z0 - 1, z0 + TENON)
        body -= hull(box(-hole, hole, -hole, hole, z0 + TENON - 0.1, z0 + TENON), box(-0.3, 0.3, -0.3, 0.3, z0 + TENON, z0 + TENON + hole - 0.3))
        return body

    def shaft(self):
        """Glued into the rotor; the magnet sits at its end, over the chip."""
        d = self.d
        magnet = self.chip_top + d.air_gap
        tenon = box(-TENON, TENON, -TENON, TENON, self.flange_bottom, self.flange_bottom + TENON - 0.2)
        foot = tenon.trim_by_plane((0, 0, -1), -self.flange_bottom - 0.1)
        wide = self.flange_bottom - (d.shaft - TENON) * 1.05
        body = tenon + hull(foot, cylinder(d.shaft, wide - 0.1, wide)) + cylinder(d.shaft, magnet, wide)
        return body - cylinder(d.magnet_diameter / 2 + 0.1, magnet - 1, magnet + d.magnet_height)

    def fixed(self):
        return {"twist-stator": self.stator(), "twist-collar": self.collar()}

    def moving(self):
        return {"twist-rotor": self.rotor(), "twist-shaft": self.shaft()}

    def bought(self):
        d = self.d
        board = box(-d.board / 2, d.board / 2, -d.board / 2, d.board / 2, self.board_bottom, self.board_bottom + d.board_thickness)
        chip = box(-2.5, 2.5, -3, 3, self.chip_top - d.chip_height, self.chip_top)
        magnet = self.chip_top + d.air_gap
        return {"board": board, "chip": chip, "magnet": cylinder(d.magnet_diameter / 2, magnet, magnet + d.magnet_height)}

    def turn(self, solid, degrees):
        return solid.rotate((0, 0, degrees))

    def printed(self):
        upside_down = {"twist-shaft"}
        for name, solid in {**self.fixed(), **self.moving()}.items():
            yield name, solid.rotate((180, 0, 0)) if name in upside_down else solid
