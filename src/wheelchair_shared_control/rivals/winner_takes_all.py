"""Policy `winner_takes_all`: one behaviour drives, the most appropriate one (Philips et al. 2007, [15]).

The person's commands of late give a probability for each of the classes left, ahead, right, back (a brain-computer
interface gives such a distribution directly; a stick's is its recent history). Three behaviours compete:

    the person            p(class of u_H) * (1 - exp(-t_c / T))
    obstacle avoidance    (p(class of u_P) + p(beside it) / 2) * exp(-t_c / T)      the planner's command
    collision avoidance   exp(-t_c / T_near)                                         turns on the spot to the freer side

t_c is the time to collision of the person's command. A behaviour that drives stays until another one's appropriateness
exceeds its own by ``hysteresis``. Commands are never mixed: the share is 0 or 1.

Assumed, the original not being at hand: the three formulae above; the history forgets with a time constant
``window``; the classes' borders lie at 45 and 135 degrees of the stick, and the class of u_P counts the neighbouring
class by half, because a detour begins to the side.
"""
import math

from wheelchair_shared_control.policy import STICK_AT_REST, PolicyResult, at_rest
from wheelchair_shared_control.rivals import sticks, surroundings
from wheelchair_shared_control.values import Twist

LEFT, AHEAD, RIGHT, BACK = "left", "ahead", "right", "back"
BESIDE = {LEFT: (AHEAD,), AHEAD: (LEFT, RIGHT), RIGHT: (AHEAD,), BACK: (LEFT, RIGHT)}
USER, AVOIDANCE, COLLISION = "the person", "obstacle avoidance", "collision avoidance"


def winner_takes_all(tick, memory):
    """The winning behaviour's command; ``memory`` keeps the distribution and who drives."""
    if at_rest(tick.user, tick.settings):
        memory["now"] = tick.now  # a stick at rest says neither yes nor no
        return STICK_AT_REST
    own, limits = tick.settings.winner_takes_all, tick.settings.wheelchair.limits
    asked = class_of(tick.user, limits)
    chances = updated(memory.get("chances"), asked, tick.now - memory.get("now", tick.now), own.window)
    until = surroundings.time_to_collision(tick, tick.user, own.horizon, own.step)
    values = appropriateness(chances, asked, class_of(tick.planner, limits), until, own)
    winner = max(values, key=values.get)
    driver = memory.get("driver", USER)
    if values[winner] <= values[driver] + own.hysteresis:
        winner = driver
    memory.update(chances=chances, now=tick.now, driver=winner)
    return PolicyResult(command_of(winner, tick), 1.0 if winner == USER else 0.0, winner)


def class_of(command, limits):
    """The class of a command, by the stick that asks for it; a command of rest is ahead."""
    degrees = math.degrees(sticks.angle(command, limits))
    if abs(degrees) <= 45.0:
        return AHEAD
    if abs(degrees) >= 135.0:
        return BACK
    return LEFT if degrees > 0.0 else RIGHT


def updated(chances, asked, dt, window):
    """The distribution over the classes after ``asked`` was commanded for ``dt`` [s]."""
    if chances is None:
        return {name: float(name == asked) for name in BESIDE}
    new = 1.0 - math.exp(-max(dt, 0.0) / window)
    return {name: (1.0 - new) * chance + new * (name == asked) for name, chance in chances.items()}


def appropriateness(chances, asked, planned, until, own):
    """Appropriateness of each behaviour in [0, 1]; ``until`` [s] the time to collision of the person's command."""
    danger = math.exp(-until / own.time)
    supported = min(chances[planned] + 0.5 * sum(chances[name] for name in BESIDE[planned]), 1.0)
    return {
        USER: chances[asked] * (1.0 - danger),
        AVOIDANCE: supported * danger,
        COLLISION: math.exp(-until / own.near_time),
    }


def command_of(behaviour, tick):
    """The command that a behaviour gives."""
    if behaviour == USER:
        return tick.user
    if behaviour == AVOIDANCE:
        return tick.planner
    d_l, _, d_r = tick.features
    return Twist(0.0, math.copysign(tick.settings.winner_takes_all.turn_rate, d_l - d_r))
