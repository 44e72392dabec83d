"""Ends of a path in closed form: turn, drive to a point of the goal's axis, turn, drive along the axis.

They make the search fast in the open, and meet a door square.
"""
import numpy as np
from numba import njit

from wheelchair_shared_control.planning.clearance import FAST
from wheelchair_shared_control.planning.pieces import FORWARD, REVERSE, TURN, drive, wrap

AXIS_STEP, AXIS_LENGTH = 0.1, 5.0
AXIS_POINTS = np.arange(0.2, 4.9, 0.2)


@njit(**FAST)
def axis_costs(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor, turn_floor, rear, goal,
          weights, out):
    """Fill ``out`` (n,): cost of driving along the goal's axis from AXIS_STEP * k before the goal to it."""
    out[0] = 0.0
    cg, sg = np.cos(goal[2]), np.sin(goal[2])
    for k in range(1, out.shape[0]):
        back = AXIS_STEP * k
        price, _, _, _ = drive(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor,
                                turn_floor, rear, goal[0] - back * cg, goal[1] - back * sg, goal[2], AXIS_STEP, 0.0,
                                FORWARD, 1, weights)
        out[k] = out[k - 1] + price


@njit(**FAST)
def shoot(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor, turn_floor, rear,
          x, y, th, kind0, goal, back, axis, weights, best):
    """Cost of turn, drive to the axis point ``back`` [m] before the goal, turn, drive to the goal.

    ``back`` < 0: no turn at the start, the present heading is driven until it meets the axis.
    Returns cost (inf: not possible, or not below ``best``), and turn, drive, turn, drive.
    """
    cg, sg = np.cos(goal[2]), np.sin(goal[2])
    if back < 0.0:
        cross = np.cos(th) * sg - np.sin(th) * cg
        if abs(cross) < 0.05:
            return np.inf, 0.0, 0.0, 0.0, 0.0
        # x + d cos(th) lies on the axis: its distance beside the axis is zero.
        beside = -(x - goal[0]) * sg + (y - goal[1]) * cg
        d1 = beside / cross
        if d1 < 0.0 or d1 > 4.0:
            return np.inf, 0.0, 0.0, 0.0, 0.0
        back = (goal[0] - x - d1 * np.cos(th)) * cg + (goal[1] - y - d1 * np.sin(th)) * sg
        if back < 0.1:
            return np.inf, 0.0, 0.0, 0.0, 0.0
        t1 = 0.0
    else:
        px, py = goal[0] - back * cg, goal[1] - back * sg
        d1 = np.hypot(px - x, py - y)
        t1 = wrap(np.arctan2(py - y, px - x) - th) if d1 > 0.02 else 0.0
    k = int(np.ceil(back / AXIS_STEP - 1e-9))
    if k >= axis.shape[0]:
        return np.inf, 0.0, 0.0, 0.0, 0.0
    t2 = wrap(goal[2] - th - t1)
    cost = axis[k]
    cost += weights[4] * ((abs(t1) > 0.02) * (kind0 != TURN) + (abs(t1) > 0.02) + 2.0 * (abs(t2) > 0.02))
    if kind0 == REVERSE:
        cost += weights[3]
    if cost + d1 / weights[0] + (abs(t1) + abs(t2)) / weights[1] >= best:
        return np.inf, 0.0, 0.0, 0.0, 0.0
    for leg in range(3):
        if leg == 0:
            ds, dth, kind, n = 0.0, t1, TURN, int(np.ceil(abs(t1) / 0.12))
        elif leg == 1:
            ds, dth, kind, n = d1, 0.0, FORWARD, int(np.ceil(d1 / 0.1))
        else:
            ds, dth, kind, n = 0.0, t2, TURN, int(np.ceil(abs(t2) / 0.12))
        if n == 0:
            continue
        for _ in range(n):
            price, x, y, th = drive(distance, known, frame, outline, spine, half_width, reach, middle, shrink,
                                     floor, turn_floor, rear, x, y, th, ds / n, dth / n, kind, 1, weights)
            cost += price
            if cost >= best:
                return np.inf, 0.0, 0.0, 0.0, 0.0
    return cost, t1, d1, t2, back
