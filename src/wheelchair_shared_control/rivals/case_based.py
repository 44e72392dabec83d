"""Policy `case_based`: the nearest demonstrated situations give the command that a person gave there (Urdiales [14]).

The situation x = (d_l, d_f, d_r, v, distance and bearing of the goal) is compared with the cases x_i of the
demonstrations (``cases.py``), each number over its scale:

    D_i = |(x - x_i) / scale|,   u_C = sum w_i u_i / sum w_i over the nearest few,   w_i = 1 / (D_i + blur)
    u = f u_C + (1 - f) u_H,     f = exp(-(min D_i / familiar)^2 / 2)

So the chair drives as a person like the teachers would, and where nothing like it was shown, the person drives. No
planner takes part.

Assumed, the original not being at hand: the features (theirs are the readings of a ring of sensors, and the goal),
their scales, and f in place of the original's weighting by efficiencies, which has its own row; both sides are taken
for equal, so every case counts mirrored, too.
"""
import functools
import math

import numpy as np

from wheelchair_shared_control import cases as files
from wheelchair_shared_control.policy import STICK_AT_REST, PolicyResult, at_rest
from wheelchair_shared_control.rivals import surroundings
from wheelchair_shared_control.values import Twist


def case_based(tick, memory):
    """The command of the nearest cases, as far as they are near."""
    if at_rest(tick.user, tick.settings):
        return STICK_AT_REST
    if tick.goal is None:
        return PolicyResult(tick.user, 1.0, "no goal: the person drives")
    own = tick.settings.case_based
    situations, commands = _base(own.cases, _scales(own))
    away = tick.goal[:2] - tick.pose[:2]
    situation = np.array([
        *tick.features, min(abs(tick.twist.v), tick.settings.wheelchair.limits.speed),
        math.hypot(*away), surroundings.bearing(tick.pose, tick.goal),
    ])
    retrieved, nearest = retrieve(situations, commands, situation / _scales(own), own.neighbours, own.blur)
    familiar = math.exp(-0.5 * (nearest / own.familiar) ** 2)
    command = Twist(*(familiar * c + (1.0 - familiar) * h for c, h in zip(retrieved, tick.user)))
    return PolicyResult(command, 1.0 - familiar, "nearest case at %.2f" % nearest)


def prepare(settings):
    """Read the cases before the first tick. Raises CasesError."""
    _base(settings.case_based.cases, _scales(settings.case_based))


case_based.prepare = prepare


def retrieve(situations, commands, situation, neighbours, blur):
    """Mean command (2,) of the nearest cases, weighted by 1 / (distance + blur), and the distance of the nearest.

    ``situations`` (n, 6) and ``situation`` (6,) in units of their scales; ``commands`` (n, 2).
    """
    squares = ((situations - situation) ** 2).sum(axis=1)
    few = min(neighbours, len(squares))
    nearest = np.argpartition(squares, few - 1)[:few]
    distances = np.sqrt(squares[nearest])
    weights = 1.0 / (distances + blur)
    return weights @ commands[nearest] / weights.sum(), float(distances.min())


def _scales(own):
    return (own.distance_scale,) * 3 + (own.speed_scale, own.goal_scale, own.bearing_scale)


@functools.lru_cache(maxsize=4)
def _base(path, scales):
    cases = files.mirrored(files.load(path))
    return cases.situations / np.array(scales), cases.commands.astype(float)
