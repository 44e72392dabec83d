"""Policy `intent`: what the person heads for is guessed, and driven there as long as they agree ([5]).

One hypothesis for each doorway and each free direction. Each has an inverse model, what a good driver would command to
get there, and a confidence that follows the agreement of the person's stick with it:

    agreement = exp(-(angle between the sticks)^2 / (2 spread^2)),   dc/dt = (agreement - c) / time

(Carlson and Demiris 2012: the required states of all tasks are predicted in parallel and compared with the actions).
If the best hypothesis' confidence is above ``threshold``, the chair is led along a short trajectory towards it: an
arc to a waypoint on the door's axis, or a straight line in the free direction, as long as that is free for
``horizon`` and the stick deviates by less than ``deviation``. Else the person drives. The person gives the pace,
always. No planner takes part.

Assumed, the original not being at hand: the constants; the waypoint lies ``lookahead`` further along the door's axis;
free directions are those of a fan of 30 degrees, fixed in odom, whose lane is free for ``reach``; a free direction
is led only where no doorway is as good (their own system knew doorways from its map).
"""
import math

import numpy as np

from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control import se2
from wheelchair_shared_control.policy import STICK_AT_REST, PolicyResult, at_rest
from wheelchair_shared_control.rivals import sticks, surroundings
from wheelchair_shared_control.values import Twist

FAN = np.radians(np.arange(-180.0, 180.0, 30.0))
SAME_DOORWAY = 0.5  # m between two looks at one doorway
TURN_ON_SPOT = math.radians(60.0)  # a waypoint further aside is turned to first


def intent(tick, memory):
    """The trajectory of the task that the person is taken to be at, or their own command."""
    if at_rest(tick.user, tick.settings):
        memory["now"] = tick.now  # a stick at rest says neither yes nor no
        return STICK_AT_REST
    own, limits = tick.settings.intent, tick.settings.wheelchair.limits
    dt = tick.now - memory.get("now", tick.now)
    asked, pace = sticks.angle(tick.user, limits), sticks.size(tick.user, limits)
    found = hypotheses(tick, memory, pace)
    confidences = memory.get("confidences", {})
    memory["now"], memory["confidences"] = tick.now, {
        name: followed(confidences.get(name, 0.0), asked, sticks.angle(command, limits), dt, own)
        for name, command in found.items()
    }
    confidences = memory["confidences"]
    if tick.user.v <= 0.0 or not confidences:
        return PolicyResult(tick.user, 1.0, "no intent known: the person drives")
    # doorways first among equals
    name = max(confidences, key=lambda name: (confidences[name], name[0] == "doorway"))
    command, what = found[name], "%s, confidence %.2f" % (name[0], confidences[name])
    if confidences[name] < own.threshold:
        return PolicyResult(tick.user, 1.0, what + ": the person drives")
    if sticks.between(asked, sticks.angle(command, limits)) > own.deviation:
        return PolicyResult(tick.user, 1.0, what + ", but the stick deviates: the person drives")
    if math.isfinite(surroundings.time_to_collision(tick, command, own.horizon, own.step)):
        return PolicyResult(tick.user, 1.0, what + ", but no safe trajectory: the person drives")
    return PolicyResult(command, None, what)


def followed(confidence, asked, expected, dt, own):
    """The confidence ``dt`` [s] later; ``asked`` and ``expected`` are the sticks' directions [rad]."""
    agreement = math.exp(-0.5 * (sticks.between(asked, expected) / own.spread) ** 2)
    return confidence + (1.0 - math.exp(-max(dt, 0.0) / own.time)) * (agreement - confidence)


def hypotheses(tick, memory, pace):
    """{(kind, number): command of its inverse model}; doorways keep their number for as long as they stay."""
    own, limits = tick.settings.intent, tick.settings.wheelchair.limits
    known, found = memory.setdefault("doorways", []), {}
    seen = tick.doorways if tick.doorway is None else (tick.doorway,) + tuple(tick.doorways)
    for doorway in seen:
        near = [i for i, pose in enumerate(known) if math.hypot(*(pose[:2] - doorway.pose[:2])) < SAME_DOORWAY]
        number = near[0] if near else len(known)
        if ("doorway", number) in found:
            continue
        known[number:number + 1] = [np.asarray(doorway.pose, dtype=float)]
        found["doorway", number] = towards_doorway(tick.pose, doorway.pose, pace, own.lookahead, limits)
    angles = se2.wrap_angle(FAN - tick.pose[2])
    footprint = footprints.from_settings(tick.settings.wheelchair)
    free = surroundings.free_distances(
        surroundings.points_in_base(tick), angles, footprint.half_width, footprint.front, own.reach)
    for number in np.flatnonzero((free >= own.reach) & (np.abs(angles) <= 0.5 * math.pi)):
        found["direction", int(number)] = sticks.pushed(float(angles[number]), pace, limits)
    return found


def towards_doorway(pose, door, pace, lookahead, limits):
    """The command, at ``pace`` (0 to 1), of an arc from ``pose`` (3,) to the waypoint on the axis of ``door`` (3,)."""
    along = se2.compose(se2.inverse(door), pose)[0]
    waypoint = se2.compose(door, np.array([along + lookahead, 0.0, 0.0]))
    x, y, _ = se2.compose(se2.inverse(pose), waypoint)
    aside = math.atan2(y, x)
    if abs(aside) > TURN_ON_SPOT:
        return Twist(0.0, math.copysign(pace * limits.turn_rate, aside))
    v = pace * limits.speed
    w = v * 2.0 * y / (x * x + y * y)
    # no faster than the arc allows
    slower = min(limits.turn_rate / abs(w), 1.0) if w else 1.0
    return Twist(v * slower, w * slower)
