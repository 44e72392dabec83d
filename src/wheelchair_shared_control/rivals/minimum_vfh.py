"""Policy `minimum_vfh`: the direction where obstacles and the person's wish together cost least (NavChair [6]).

    cost(a) = h(a) + q (a - a_H)^2

h is a polar histogram of the obstacles about the chair, in [0, 1]: 1 where the lane in direction a is closed at the
bumper, 0 where it is free for ``reach``, with the square of what is missing in between. The parabola q (a - a_H)^2 has
its minimum in the stick's direction a_H. The lowest sum gives the direction, the free distance there the speed. No
planner takes part. In door mode, near a doorway, the lane's margin shrinks, so that a door is a way at all.

Assumed, the original not being at hand: the lane is the chair's width with a margin about a ray from the drive axle
(NavChair's cells weigh by certainty and distance, and it has the chair's shape in its safety clearance); the nearest
obstacle of a lane fills it, since a sum over cells would depend on their size; door mode comes by itself within
``door_distance`` of a doorway that the assistance latched, where NavChair chose its modes by a Bayesian network.
Backwards and while turning on the spot NavChair has no histogram: there the command is the user's.
"""
import math

import numpy as np

from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control.policy import STICK_AT_REST, PolicyResult, at_rest
from wheelchair_shared_control.rivals import sticks, surroundings
from wheelchair_shared_control.values import Twist

QUARTER = 0.5 * math.pi


def minimum_vfh(tick, memory):
    """The stick turned to the direction of the lowest cost, and slowed by what is ahead there."""
    if at_rest(tick.user, tick.settings):
        return STICK_AT_REST
    own, limits = tick.settings.minimum_vfh, tick.settings.wheelchair.limits
    if tick.user.v < tick.settings.stick.dead_zone_v:
        return PolicyResult(tick.user, 1.0, "turns or reverses: the user's command")
    asked = sticks.angle(tick.user, limits)
    door_mode = near_doorway(tick, own.door_distance)
    # the person's own direction is among the candidates: in free space the command is theirs to the last digit
    grid = np.arange(-QUARTER, QUARTER + 0.5 * own.sector, own.sector)
    angles = np.append(grid, asked)
    free = free_lanes(tick, angles, own.door_margin if door_mode else own.margin)
    cost = histogram(free, own.reach) + own.parabola * (angles - asked) ** 2
    best = len(angles) - 1 - int(np.argmin(cost[::-1]))  # the person's own among equals
    command = sticks.pushed(float(angles[best]), sticks.size(tick.user, limits), limits)
    slowed = min(float(free[best]) / own.slow_distance, 1.0)
    reason = "%s, %.0f degrees beside the stick" % (
        "door mode" if door_mode else "obstacle avoidance", math.degrees(angles[best] - asked))
    return PolicyResult(Twist(command.v * slowed, command.w), None, reason)


def near_doorway(tick, distance):
    """Whether the middle of the latched doorway is within ``distance`` [m] of the chair."""
    return tick.doorway is not None and math.hypot(*(tick.doorway.pose[:2] - tick.pose[:2])) < distance


def free_lanes(tick, angles, margin):
    """Free distance [m] of the lanes towards ``angles`` (n,)."""
    footprint = footprints.from_settings(tick.settings.wheelchair)
    return surroundings.free_distances(
        surroundings.points_in_base(tick), angles, footprint.half_width + margin, footprint.front,
        tick.settings.minimum_vfh.reach,
    )


def histogram(free, reach):
    """h (n,) in [0, 1] of lanes that are free for ``free`` (n,) [m]."""
    return (1.0 - free / reach) ** 2
