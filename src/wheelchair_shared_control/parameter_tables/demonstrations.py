"""Which parts of a bag are demonstrations, and how its messages are put beside each other."""
from wheelchair_shared_control.parameters import P

TABLE = [
    P("rate", float, "Hz", 0.5, 100.0, "most samples a second: closer ones say nothing new"),
    P("odometry_gap", float, "s", 0.01, 2.0, "longest gap between the odometry messages that a sample lies between"),
    P("command_memory", float, "s", 0.1, 10.0, "how long the chair may still follow an earlier command"),
    P("command_tolerance", float, "m/s, rad/s", 0.0, 1.0, "difference from the user's commands that limits explain"),
    P("standing_speed", float, "m/s", 0.0, 0.5, "slower, and turning slower than the next, the chair stands"),
    P("standing_turn_rate", float, "rad/s", 0.0, 0.5, "slower the chair does not turn"),
    P("largest_speed", float, "m/s", 0.1, 10.0, "faster odometry is a fault"),
    P("largest_turn_rate", float, "rad/s", 0.1, 20.0, "faster odometry is a fault"),
]
