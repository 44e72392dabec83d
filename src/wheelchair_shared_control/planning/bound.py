"""The search's estimate of the way that is left: Dijkstra's algorithm from the goal, for a disc on a coarse grid."""
import numpy as np
from numba import njit

from wheelchair_shared_control.heap import pop, push
from wheelchair_shared_control.planning.clearance import FAST, field_at

COARSE = 0.1  # m


@njit(**FAST)
def cost_to_go(distance, frame, rows, cols, goal, radius, weights, keys, items):
    """Estimate (rows, cols) [s] of the way to the goal on a grid of COARSE cells, for a disc of ``radius``.

    Where the axle's clearance is small the footprint's is no larger: narrow places are charged as in the search,
    with the benefit of half a cell.
    """
    out = np.full((rows, cols), np.inf)
    gi = int((goal[1] - frame[1]) / COARSE)
    gj = int((goal[0] - frame[0]) / COARSE)
    if gi < 0 or gj < 0 or gi >= rows or gj >= cols:
        return out
    out[gi, gj] = 0.0
    size = push(keys, items, 0, 0.0, gi * cols + gj)
    while size > 0:
        key = keys[0]
        item, size = pop(keys, items, size)
        i, j = item // cols, item % cols
        if key > out[i, j]:
            continue
        for di in range(-1, 2):
            for dj in range(-1, 2):
                a, b = i + di, j + dj
                if (di == 0 and dj == 0) or a < 0 or b < 0 or a >= rows or b >= cols:
                    continue
                step = COARSE * (1.41421356 if di != 0 and dj != 0 else 1.0) / weights[0]
                if out[i, j] + step >= out[a, b]:
                    continue
                d = field_at(distance, frame, frame[0] + (b + 0.5) * COARSE, frame[1] + (a + 0.5) * COARSE)
                # Half a coarse cell of slack: a gap between two coarse centres must stay open.
                if d < radius - 0.07:
                    continue
                c = d - radius + 0.05
                if c < weights[5]:
                    step *= 1.0 + weights[6] * ((weights[5] - max(c, 0.0)) / weights[5]) ** 2
                if out[i, j] + step >= out[a, b]:
                    continue
                out[a, b] = out[i, j] + step
                size = push(keys, items, size, out[a, b], a * cols + b)
    return out
