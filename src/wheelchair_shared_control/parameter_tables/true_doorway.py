"""The true doorway in place of the detector: the simulator's scene, and when it is published."""
from wheelchair_shared_control.parameters import P

INCLUDES = ["wheelchair", "scene"]

TABLE = [
    P("odom_frame", str, "", None, None, "frame of the doorways"),
    P("rate", float, "Hz", 0.5, 30.0, "doorways a second"),
    P("age", float, "s", 0.05, 5.0, "without newer odometry and truth there is no doorway"),
]
