"""Every dimension of the printable puppet, in millimetres and degrees. All parts follow from these."""
from dataclasses import dataclass, fields, replace


@dataclass(frozen=True)
class Design:
    wall: float = 2.0
    """Thickness of plates and walls. Nothing is thinner than `least_wall`."""
    least_wall: float = 1.2
    clearance: float = 0.3
    """Between parts that move or slide: on each side."""

    board: float = 23.0
    """Edge of the square sensor board."""
    board_thickness: float = 1.6
    board_ledge: float = 1.5
    """Width of the board's edge that rests on the part; no component may sit there."""
    chip_height: float = 1.5
    """From the board to the chip's face, over the middle of the board."""
    magnet_diameter: float = 6.0
    magnet_height: float = 2.5
    air_gap: float = 1.5
    """Magnet to chip: an AS5600 wants 0.5 to 3."""

    header_width: float = 17.8
    header_height: float = 8.9
    header_depth: float = 9.0
    """The box header of an outlet, 2 × 4 pins."""
    socket_width: float = 15.2
    """The ribbon cable's socket at an inlet."""
    plug_length: float = 12.0
    ribbon: float = 10.2
    """Width of the flat cable that runs through a joint."""

    bay: float = 32.0
    """Length of the room for a part's electronics, behind its inlet."""
    screw: float = 3.2
    """Hole through which a screw passes (M3)."""
    thread: float = 2.5
    """Hole into which it cuts its thread."""

    bend_travel: float = 95.0
    """A bend joint goes this far to either side; its stop is `stop_margin` behind that."""
    twist_travel: float = 150.0
    stop_margin: float = 3.0

    overhang: float = 50.0
    """Steepest overhang that prints without support, from the vertical."""

    # What follows from them.

    @property
    def spigot_width(self):
        return self.header_width + 2 * (self.clearance + self.wall)

    @property
    def spigot_height(self):
        return self.header_height + 2 * (self.clearance + self.wall)

    @property
    def key(self):
        """The bevel of one corner, by which a plug goes in only one way round."""
        return 2.0

    @property
    def sleeve_width(self):
        """Inside."""
        return self.spigot_width + 2 * self.clearance

    @property
    def sleeve_height(self):
        return self.spigot_height + 2 * self.clearance

    @property
    def rim(self):
        """Edge of the frame that holds a sensor board."""
        return self.board + 2 * (self.clearance + self.wall)

    @property
    def width(self):
        """Of a joint across its axis."""
        return max(self.sleeve_width + 2 * self.wall, self.rim)

    @property
    def post(self):
        """Radius of a post that takes a screw."""
        return self.thread / 2 + self.wall

    @property
    def shaft(self):
        """Radius of the shaft that carries a magnet."""
        return self.magnet_diameter / 2 + 0.1 + self.wall


def parse(settings):
    """`wall=2.4 clearance=0.25` to a design."""
    known = {field.name for field in fields(Design)}
    values = {}
    for setting in settings:
        name, _, number = setting.partition("=")
        if name not in known:
            raise SystemExit(f"there is no parameter {name}; there are: {', '.join(sorted(known))}")
        try:
            values[name] = float(number)
        except ValueError:
            raise SystemExit(f"{name} is a number, not {number!r}") from None
    return replace(Design(), **values)
