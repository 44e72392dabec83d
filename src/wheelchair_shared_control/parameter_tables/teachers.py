"""How the scripted teachers drive: what their demonstrations show (Goil 2013, IV-C and V-B)."""
from wheelchair_shared_control.parameters import P

INCLUDES = ["wheelchair"]

TABLE = [
    P("teachers_per_scene", int, "", 1, 100, "demonstrations of each scene (the paper: 6)"),
    P("command_rate", float, "Hz", 5.0, 50.0, "stick"),
    P("look_rate", float, "Hz", 1.0, 30.0, "depth frames, range readings and features"),
    P("odometry_rate", float, "Hz", 10.0, 100.0, "odometry and tf"),
    P("longest", float, "s", 5.0, 300.0, "a demonstration ends at the latest"),
    P("slow", float, "m/s", 0.05, 0.6, "the slow pace"),
    P("moderate", float, "m/s", 0.05, 0.6, "the moderate pace"),
    P("pace_spread", float, "", 0.0, 0.5, "teachers' paces differ by this share, either way"),
    P("start/distance_low", float, "m", 1.0, 6.0, "nearest start of base_link before the door plane"),
    P("start/distance_high", float, "m", 1.0, 6.0, "farthest start"),
    P("start/offset", float, "m", 0.0, 2.0, "start beside the door's axis, either side"),
    P("start/heading", float, "rad", 0.0, 1.5, "start turned off the door's normal, either way"),
    P("aim/lookahead", float, "m", 0.3, 3.0, "how far ahead on the axis a teacher looks"),
    P("aim/gain", float, "1/s", 0.2, 5.0, "turn rate per angle off the aim"),
    P("aim/slew", float, "rad/s2", 0.2, 10.0, "how fast the stick changes the turn rate"),
    P("hand/noise", float, "rad/s", 0.0, 0.3, "unsteadiness of the hand"),
    P("hand/time", float, "s", 0.05, 5.0, "how long an unsteadiness lasts"),
    P("doorway/weave_slow", float, "rad/s", 0.0, 0.5, "turn rate of the weave in the doorway at the slow pace"),
    P("doorway/weave_moderate", float, "rad/s", 0.0, 0.5, "the same at the moderate pace"),
    P("doorway/period", float, "s", 0.5, 10.0, "of the weave"),
    P("exit/turn_slow", float, "rad/s", 0.0, 1.0, "largest turn rate beyond the door at the slow pace"),
    P("exit/turn_moderate", float, "rad/s", 0.0, 1.0, "the same at the moderate pace"),
    P("exit/swing", float, "rad", 0.0, 2.0, "how far teachers turn off the normal beyond the door"),
    P("exit/period", float, "s", 1.0, 20.0, "of the swings beyond the door"),
    P("exit/begin", float, "m", 0.36, 1.5, "base_link this far beyond the plane, the turn begins"),
    P("exit/end", float, "m", 1.0, 3.5, "base_link this far from the door, the demonstration ends"),
    P("range/distance", float, "m", 2.0, 5.5, "full set: starts this far before the plane, to show the range"),
    P("range/nearest", float, "m", 1.0, 3.0, "full set: the range is shown down to this distance"),
    P("range/turn_slow", float, "rad/s", 0.0, 1.0, "full set: largest turn rate before the door at the slow pace"),
    P("range/turn_moderate", float, "rad/s", 0.0, 1.0, "the same at the moderate pace"),
    P("range/swing", float, "rad", 0.0, 2.0, "full set: how far teachers turn off the normal before the door"),
    P("range/period", float, "s", 1.0, 20.0, "of these swings"),
]
