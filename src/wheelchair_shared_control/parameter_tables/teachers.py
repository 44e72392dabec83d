"""How the scripted teachers drive: what their demonstrations show (Goil 2013, IV-C and V-B)."""
from wheelchair_shared_control.parameters import P

INCLUDES = ["wheelchair"]
PACES = ("slow", "moderate")


def pace(name):
    """The rows of one of the two paces: slowly more is possible, and more is shown."""
    key = name + "/"
    return [
        P(key + "speed", float, "m/s", 0.05, 0.6, "forward speed"),
        P(key + "start_low", float, "m", 1.0, 6.0, "nearest start of base_link before the door plane"),
        P(key + "start_high", float, "m", 1.0, 6.0, "farthest start"),
        P(key + "range_distance", float, "m", 2.0, 5.5, "full set: start before the plane, to show the range"),
        P(key + "range_end", float, "m", 1.0, 3.0, "full set: the range is shown down to this distance of the plane"),
    ]


def swings(set_name):
    """The rows of the swings by which a set's teachers show what is possible where there is room."""
    key = set_name + "/"
    rows = [
        P(key + "reach", float, "rad", 0.0, 2.0, "how far teachers turn off the normal beyond the door"),
        P(key + "time", float, "s", 0.5, 10.0, "from one swing to the next"),
        P(key + "gain", float, "1/s", 0.5, 10.0, "turn rate per angle off the swing's end, up to the pace's turn"),
        P(key + "least", float, "", 0.0, 1.0, "the smallest swing, as a share of the largest"),
        P(key + "slowest", float, "", 0.0, 1.0, "turn rate of the slowest swing, as a share of the largest"),
        P(key + "narrowest", float, "m", 0.7, 2.0, "the narrowest door that is driven"),
        P(key + "widest", float, "m", 0.7, 2.0, "the widest; a third of the teachers drive one between"),
    ]
    for name in PACES:
        rows += [
            P(key + name + "/turn", float, "rad/s", 0.0, 1.0, "largest turn rate where there is room"),
            P(key + name + "/weave", float, "rad/s", 0.0, 0.5,
              "turn rate of the weave in the doorway; of set full with weave_room beside the chair"),
            P(key + name + "/end", float, "m", 1.0, 3.5,
              "base_link this far from the door, beyond it, the demonstration ends"),
        ]
    return rows


TABLE = [
    P("teachers_per_scene", int, "", 1, 100, "demonstrations of each scene (the paper: 6)"),
    P("command_rate", float, "Hz", 5.0, 50.0, "stick"),
    P("look_rate", float, "Hz", 1.0, 30.0, "depth frames, range readings and features"),
    P("odometry_rate", float, "Hz", 10.0, 100.0, "odometry and tf"),
    P("longest", float, "s", 5.0, 300.0, "a demonstration ends at the latest"),
    P("pace_spread", float, "", 0.0, 0.5, "teachers' speeds differ by this share, either way"),
    P("offset", float, "m", 0.0, 2.0, "starts lie beside the door's axis, either side"),
    P("heading", float, "rad", 0.0, 1.5, "starts are turned off the way to the door's axis, either way"),
    P("turn_first", float, "rad", 0.0, 2.0, "full set: so far off the way some start, and turn on the spot"),
    P("aim/lookahead", float, "m", 0.3, 3.0, "how far ahead on the axis a teacher looks"),
    P("aim/gain", float, "1/s", 0.2, 5.0, "turn rate per angle off the aim"),
    P("aim/slew", float, "rad/s2", 0.2, 10.0, "how fast the stick changes the turn rate"),
    P("hand/noise", float, "rad/s", 0.0, 0.3, "unsteadiness of the hand"),
    P("hand/time", float, "s", 0.05, 5.0, "how long an unsteadiness lasts"),
    P("weave_period", float, "s", 0.5, 10.0, "of the weave in the doorway"),
    P("weave_room", float, "m", 0.01, 1.0, "full set: the weave grows with the room at each side; its unit"),
    P("hallway_begin", float, "m", 0.36, 1.5, "full set: from this far beyond the plane the hallway is the room"),
    P("range_reach", float, "rad", 0.0, 2.0, "full set: how far they turn off the way before the door"),
    P("hallway_end", float, "m", 1.0, 3.9, "the same, of both sets and paces, where the way goes on between walls"),
    P("exit_begin", float, "m", 0.36, 1.5, "base_link this far beyond the plane, the turn begins"),
]
TABLE += [row for name in PACES for row in pace(name)] + swings("paper") + swings("full")


def contradiction(settings):
    """What the parameters contradict each other in, in words; "" if in nothing."""
    chair = settings.wheelchair.footprint.width
    for name in ("paper", "full"):
        shown = getattr(settings, name)
        if not chair < shown.narrowest <= shown.widest:
            text = "parameter '%s/narrowest' is %g, but must be above the chair's width, %g, and at most 'widest', %g"
            return text % (name, shown.narrowest, chair, shown.widest)
    return ""
