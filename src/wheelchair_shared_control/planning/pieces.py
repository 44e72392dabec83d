"""What a piece of a path costs the true footprint, in seconds of a cautious drive; inf where it may not be driven.

The search, its shots to the goal and the comparison of two paths all charge by these prices.
"""
from typing import NamedTuple

import numpy as np
from numba import njit

from wheelchair_shared_control.planning.clearance import DOUBTFUL, FAST, PRESUMED, SEEN, UNKNOWN, clearance, known_at

BESIDE, BLIND_SWING, BLIND_REVERSE = 0.45, 12.0, 4.0  # m, 1, 1: what unseen ground is charged so much more for
FORWARD, REVERSE, TURN = 0, 1, 2


class Weights(NamedTuple):
    """What the search charges; times [s] unless said otherwise."""

    speed: float = 0.45
    turn_rate: float = 0.55
    reverse_factor: float = 1.6
    reversal: float = 1.0
    stop: float = 0.5
    comfortable: float = 0.30
    narrow: float = 8.0
    presumed_factor: float = 1.6
    unknown_factor: float = 3.0  # a short cut through what nobody saw often ends at a wall


@njit(**FAST)
def price(ds, dth, kind, c, ground, weights):
    """Cost [s] of a piece of path with clearance ``c`` [m]."""
    speed, turn_rate, reverse_factor, _, _, comfortable, narrow, presumed_factor, unknown_factor = weights
    time = max(abs(ds) / speed, abs(dth) / turn_rate)
    if kind == REVERSE:
        time *= reverse_factor
    if c < comfortable:
        x = (comfortable - c) / comfortable
        time *= 1.0 + narrow * x * x
        if c < 0.04:
            time *= 1.0 + 3.0 * (0.04 - c) / 0.04
    if ground != SEEN:
        time *= unknown_factor if ground == UNKNOWN else presumed_factor
        # Nobody looks behind. And the rangers see strips: between them a wall of which more is seen farther on can
        # hide from a corner that swings to it. A little way on, they have swept the sides.
        if kind == REVERSE:
            time *= BLIND_REVERSE
        elif kind == TURN and c < BESIDE:
            time *= BLIND_SWING
    return time


@njit(**FAST)
def move(x, y, th, ds, dth):
    half = 0.5 * dth
    chord = ds * (1.0 - half * half / 6.0 + half ** 4 / 120.0)
    return x + chord * np.cos(th + half), y + chord * np.sin(th + half), th + dth


@njit(**FAST)
def _ground(known, frame, x, y, th, edge, half_width):
    """The least that is known of the ground below three points of the edge at x = ``edge`` of a pose."""
    c, s = np.cos(th), np.sin(th)
    worst = SEEN
    for side in range(-1, 2):
        what = known_at(known, frame, x + c * edge - s * side * half_width, y + s * edge + c * side * half_width)
        if what == UNKNOWN:
            return UNKNOWN
        if what == DOUBTFUL or (what == PRESUMED and worst == SEEN):
            worst = what
    return worst


@njit(**FAST)
def drive(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor, turn_floor,
           rear, x, y, th, ds, dth, kind, parts, weights):
    """Drive one piece in ``parts``: cost (inf: not allowed) and the end pose."""
    # A chair that turns swings its corners: what share of its outermost corner's way that is decides the floor.
    swing = (reach + middle) * abs(dth)
    least = floor + (turn_floor - floor) * min(1.0, 2.0 * swing / (abs(ds) + swing + 1e-9))
    total = 0.0
    for _ in range(parts):
        x, y, th = move(x, y, th, ds / parts, dth / parts)
        c = clearance(distance, frame, outline, spine, half_width, reach, middle, 0.5, x, y, th) - shrink
        if c < least:
            return np.inf, x, y, th
        ground = SEEN
        if kind == REVERSE:
            ground = _ground(known, frame, x, y, th, rear, half_width)
            if ground == UNKNOWN or ground == DOUBTFUL:
                return np.inf, x, y, th
        else:
            ground = _ground(known, frame, x, y, th, 2.0 * middle - rear, half_width)
            if ground == SEEN and kind == TURN:
                ground = _ground(known, frame, x, y, th, rear, half_width)
        total += price(ds / parts, dth / parts, kind, c, ground, weights)
    return total, x, y, th


@njit(**FAST)
def wrap(a):
    return (a + np.pi) % (2.0 * np.pi) - np.pi


@njit(**FAST)
def price_of(distance, known, frame, outline, spine, half_width, reach, middle, rear, start, steps, kinds, weights):
    """Cost [s] of driving ``steps`` (n, 2) of ``kinds`` (n,) from ``start``, on the search's scale; never inf."""
    x, y, th = start[0], start[1], start[2]
    total = 0.0
    for k in range(steps.shape[0]):
        kind = TURN if kinds[k] == 0 else (FORWARD if kinds[k] > 0 else REVERSE)
        cost, x, y, th = drive(distance, known, frame, outline, spine, half_width, reach, middle, 0.0, -1.0, -1.0,
                                 rear, x, y, th, steps[k, 0], steps[k, 1], kind, 1, weights)
        if cost == np.inf:
            cost = 1.0
        total += cost
        if k > 0 and kinds[k] != kinds[k - 1]:
            total += weights[4]
            if kinds[k] * kinds[k - 1] < 0:
                total += weights[3]
    return total
