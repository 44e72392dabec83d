"""What rviz shows of a blending tick: the variance triangle of Fig. 4, three arrows, share bar, guard.

Values only, all in ``base_link`` unless ``odom`` is said; the node copies them into messages.
"""
import math
from typing import Any, NamedTuple, Tuple

from wheelchair_shared_control.guard import DEGRADED, FREE, SLOWED, STOPPED

ARROW, CUBE, SPHERE, TEXT, TRIANGLES = 0, 1, 2, 9, 11  # visualization_msgs/Marker types
USER, PLANNER, BLENDED = (0.15, 0.35, 0.95, 1.0), (0.1, 0.65, 0.25, 1.0), (0.95, 0.55, 0.05, 1.0)
TRIANGLE = (0.35, 0.55, 1.0, 0.35)
WRITING = (0.05, 0.05, 0.1, 1.0)  # dark: floor, walls and background are light
GREY = (0.55, 0.55, 0.55, 0.6)
GUARD_COLOURS = {SLOWED: (0.98, 0.75, 0.1, 1.0), STOPPED: (0.9, 0.1, 0.1, 1.0), DEGRADED: (0.7, 0.2, 0.8, 1.0)}
HORIZON = 1.5  # s: length of an arrow over its speed
LEAST = 0.25  # m: an arrow that only turns is drawn this long
HEIGHT = 0.15  # m above the floor, over the costmap and the plans
BAR = 0.6  # m: length of the full share bar


class Shape(NamedTuple):
    """One marker: ``kind`` as in visualization_msgs, ``points`` (x, y, z) or one position, ``scale``, ``colour``."""

    name: str
    kind: int
    points: Tuple[Tuple[float, float, float], ...]
    scale: Tuple[float, float, float]
    colour: Tuple[float, float, float, float]
    text: str = ""
    odom: bool = False


def _direction(command, turn=0.0):
    """Tip of the arrow of a command: where its arc leads within the horizon, as a straight line."""
    length = max(abs(command.v) * HORIZON, LEAST)
    heading = 0.5 * (command.w + turn) * HORIZON
    sign = -1.0 if command.v < -0.01 else 1.0
    return sign * length * math.cos(heading), sign * length * math.sin(heading)


def _arrow(name, command, front, colour, height):
    absent = command is None or not (math.isfinite(command.v) and math.isfinite(command.w))
    if absent or max(abs(command.v), abs(command.w)) < 0.02:
        return Shape(name, ARROW, (), (0.0, 0.0, 0.0), colour)
    x, y = _direction(command)
    return Shape(name, ARROW, ((front, 0.0, height), (front + x, y, height)), (0.05, 0.1, 0.12), colour)


def shapes(state, footprint):
    """All shapes (tuple of Shape) of a ``shared_control.State``; one without points is to be taken away."""
    front = footprint.front
    result = [
        _arrow("user", state.user, front, USER, HEIGHT + 0.02),
        _arrow("planner", state.planner, front, PLANNER, HEIGHT + 0.04),
        _arrow("blended", state.blended, front, BLENDED, HEIGHT + 0.06),
        _triangle(state, front),
    ]
    result += _share_bar(state, footprint)
    result += _guard(state, footprint)
    return tuple(result)


def _triangle(state, front):
    """Width proportional to sigma, centred on the user's velocity (Fig. 4)."""
    user = state.user
    if user is None or not math.isfinite(state.sigma) or not math.isfinite(user.w) or not math.isfinite(user.v):
        return Shape("sigma", TRIANGLES, (), (1.0, 1.0, 1.0), TRIANGLE)
    # never wider than 80 degrees to either side: beyond, it would fold over
    half = min(state.sigma, 2.8 / HORIZON)
    left, right = _direction(user, half), _direction(user, -half)
    tip = (front, 0.0, HEIGHT)
    corners = (tip, (front + right[0], right[1], HEIGHT), (front + left[0], left[1], HEIGHT))
    return Shape("sigma", TRIANGLES, corners, (1.0, 1.0, 1.0), TRIANGLE)


def _share_bar(state, footprint):
    """A bar above the chair, left to right: blue is the user's weight, green the planner's."""
    names = ("share_user", "share_planner", "share_text")
    if state.beta is None or not math.isfinite(state.beta):
        return [Shape(name, CUBE, (), (0.0, 0.0, 0.0), GREY) for name in names]
    x, left, height = 0.5 * (footprint.front + footprint.rear), 0.5 * BAR, 1.5
    beta = min(max(state.beta, 0.0), 1.0)
    user, planner = max(BAR * beta, 1e-3), max(BAR * (1.0 - beta), 1e-3)
    return [
        Shape(names[0], CUBE, ((x, left - 0.5 * user, height),), (0.1, user, 0.1), USER),
        Shape(names[1], CUBE, ((x, left - user - 0.5 * planner, height),), (0.1, planner, 0.1), PLANNER),
        Shape(names[2], TEXT, ((x, 0.0, height + 0.35),), (0.0, 0.0, 0.2), WRITING, "user %.0f %%" % (100.0 * beta)),
    ]


def _guard(state, footprint):
    point: Any = state.guard_point
    if state.guard == FREE:
        return [Shape(name, SPHERE, (), (0.0, 0.0, 0.0), GREY) for name in ("guard", "guard_text")]
    colour = GUARD_COLOURS[state.guard]
    sphere = Shape("guard", SPHERE, (), (0.12, 0.12, 0.12), colour, odom=True)
    if point is not None:
        sphere = sphere._replace(points=((float(point[0]), float(point[1]), 0.3),))
    text = Shape("guard_text", TEXT, ((0.0, 0.0, 2.0),), (0.0, 0.0, 0.14), colour, state.reason)
    return [sphere, text]
