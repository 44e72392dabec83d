"""From a joystick's axes to the user's command."""
from wheelchair_shared_control.parameters import P

INCLUDES = ["wheelchair"]

TABLE = [
    P("axis/speed", int, "", 0, 63, "axis that drives, forward positive"),
    P("axis/turn", int, "", 0, 63, "axis that turns, left positive"),
    P("dead_zone", float, "", 0.0, 0.9, "deflection that counts as rest; the rest of the travel is stretched"),
    P("curve", float, "", 1.0, 4.0, "exponent: 1 straight, more is finer about the middle"),
    P("share/forward", float, "", 0.0, 1.0, "of the chair's highest speed at full deflection"),
    P("share/reverse", float, "", 0.0, 1.0, "of the chair's highest speed at full deflection backward"),
    P("share/turn", float, "", 0.0, 1.0, "of the chair's highest turn rate at full deflection"),
    P("button/dead_man", int, "", -1, 63, "button to be held while driving; -1: none"),
]
