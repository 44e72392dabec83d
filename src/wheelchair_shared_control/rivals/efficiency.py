"""Policy `efficiency`: both commands count by how well they are driven (Fernandez-Carmona et al. 2009, [11]).

    u = K_H n_H u_H + K_P n_P u_P

n is the mean of three local efficiencies of a command, with a = atan2(w, v) its direction:

    smoothness   exp(-C |a|)
    directness   exp(-C |a_goal - a|)
    safety       1 - exp(-C (d + |sin(a_obs - a)|)^2),   d = d_min / max_range

C one steepness for all three, a_goal and a_obs the bearings of the goal and of the nearest obstacle. Both drive,
always; neither is ever given the whole command, and a pair that drives badly drives slowly. The original has the
potential field of [12] for the planner: ``--planner potential_field`` is that pair.

Assumed, the original not being at hand: the form of the safety term and C; that w enters the angle in rad/s and v in
m/s; that without a goal the directness is left out of the mean.
"""
import math

from wheelchair_shared_control.policy import STICK_AT_REST, PolicyResult, at_rest
from wheelchair_shared_control.rivals import sticks, surroundings
from wheelchair_shared_control.values import Twist


def efficiency(tick, memory):
    """The sum of both commands, each weighted by its efficiency."""
    if at_rest(tick.user, tick.settings):
        return STICK_AT_REST
    own = tick.settings.efficiency
    goal = None if tick.goal is None else surroundings.bearing(tick.pose, tick.goal)
    obstacle = surroundings.nearest_bearing(tick)
    distance = min(tick.clearance / tick.settings.max_range, 1.0)
    weights = [
        share * efficiency_of(command, goal, obstacle, distance, own.steepness)
        for share, command in ((own.user, tick.user), (own.planner, tick.planner))
    ]
    command = Twist(*(weights[0] * h + weights[1] * p for h, p in zip(tick.user, tick.planner)))
    total = sum(weights)
    beta = weights[0] / total if total > 0.0 else None
    return PolicyResult(command, beta, "weights %.2f and %.2f" % tuple(weights))


def efficiency_of(command, goal, obstacle, distance, steepness):
    """n in [0, 1] of a command; ``goal`` and ``obstacle`` bearings [rad] or None, ``distance`` d in [0, 1]."""
    direction = math.atan2(command.w, command.v)
    parts = [math.exp(-steepness * abs(direction))]
    if goal is not None:
        parts.append(math.exp(-steepness * sticks.between(goal, direction)))
    beside = 1.0 if obstacle is None else abs(math.sin(obstacle - direction))
    parts.append(1.0 - math.exp(-steepness * (distance + beside) ** 2))
    return sum(parts) / len(parts)
