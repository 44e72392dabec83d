"""Policy `minimax`: the user's share that makes the worst of three indices best (Li, Chen, Wang 2011, [13]).

    u(k) = k u_H + (1 - k) u_P,   k = argmax min(safety, comfort, obedience)

    safety      1 - exp(-a t_c)           t_c: time to collision of u(k), held
    comfort     exp(-b |du|)              du: change from the last command, both axes over their maxima
    obedience   exp(-c angle(u, u_H))     angle between the sticks of the two commands

The user drives where that is safe and smooth; the planner comes in as far as the worst index gains by it.

Assumed, the original not being at hand: the share is searched on a grid of ``minimax/shares`` values (the original
optimises it); the comfort compares with the last command of this policy; of shares that are equally good in the worst
index the one with the larger sum of indices counts, then the larger share.
"""
import math

from wheelchair_shared_control.policy import STICK_AT_REST, PolicyResult, at_rest
from wheelchair_shared_control.rivals import sticks, surroundings
from wheelchair_shared_control.values import Twist


def minimax(tick, memory):
    """The command of the best share; ``memory["last"]`` is the command before."""
    if at_rest(tick.user, tick.settings):
        memory.pop("last", None)
        return STICK_AT_REST
    own, last = tick.settings.minimax, memory.get("last", tick.twist)
    best = None
    for step in range(own.shares):
        share = step / (own.shares - 1.0)
        command = Twist(*(share * h + (1.0 - share) * p for h, p in zip(tick.user, tick.planner)))
        indices = indices_of(tick, command, last)
        rank = (round(min(indices), 9), round(sum(indices), 9), share)
        if best is None or rank > best[0]:
            best = rank, command, share, indices
    _, command, share, indices = best
    memory["last"] = command
    return PolicyResult(command, share, "safety %.2f, comfort %.2f, obedience %.2f" % indices)


def indices_of(tick, command, last):
    """Safety, comfort and obedience of a command, each in [0, 1]."""
    own, limits = tick.settings.minimax, tick.settings.wheelchair.limits
    until = surroundings.time_to_collision(tick, command, own.horizon, own.step)
    change = math.hypot((command.v - last.v) / limits.speed, (command.w - last.w) / limits.turn_rate)
    turned = sticks.between(sticks.angle(command, limits), sticks.angle(tick.user, limits))
    return 1.0 - math.exp(-own.safety * until), math.exp(-own.comfort * change), math.exp(-own.obedience * turned)
