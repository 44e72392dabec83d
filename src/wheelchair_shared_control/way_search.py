"""Search of a way over poses of the chair: straight moves in 16 directions, turns on the spot between them.

Dijkstra backward from a set of ends, on a lattice of about 0.1 m whose two steps are chosen so that both a given pose
and the axis lie on it; numba. Frames and units as in ``ground``.
"""
from typing import NamedTuple

import numpy as np
from numba import njit

from wheelchair_shared_control.ground import RESOLUTION, probes
from wheelchair_shared_control.heap import pop, push

STEP = 0.1  # m
HEADINGS = 16
# Moves on the lattice of one heading each: on equal steps atan2(1, 2) = 26.6 degrees in place of 22.5.
_MOVES = np.array([
    [1, 0], [2, 1], [1, 1], [1, 2], [0, 1], [-1, 2], [-1, 1], [-2, 1],
    [-1, 0], [-2, -1], [-1, -1], [-1, -2], [0, -1], [1, -2], [1, -1], [2, -1],
])
FORWARD, REVERSE, LEFT, RIGHT, END, NONE = 0, 1, 2, 3, 4, 5
_TURN_COST = 0.2  # m of way for one step of heading
_REVERSE_COST = 3.0


class Lattice(NamedTuple):
    """Corner ``low`` (2,) [m], ``steps`` (2,) [m] and the ``shape`` (x, y) of the lattice's points."""

    low: np.ndarray
    steps: np.ndarray
    shape: tuple

    @property
    def yaws(self):
        """Directions (16,) [rad] of the straight moves."""
        return np.arctan2(_MOVES[:, 1] * self.steps[1], _MOVES[:, 0] * self.steps[0])

    def points(self):
        """x (n,) and y (m,) [m] of the points."""
        return tuple(self.low[k] + self.steps[k] * np.arange(self.shape[k]) for k in range(2))


def lattice_through(point, low, high):
    """A lattice over the rectangle ``low``-``high`` (2,) with ``point`` (2,) and the x axis on it."""
    beside = abs(point[1])
    steps = np.array([STEP, beside / round(beside / STEP) if beside >= 0.5 * STEP else STEP])
    origin = np.array([point[0], 0.0])
    first = np.floor((np.asarray(low) - origin) / steps + 1e-6)
    last = np.ceil((np.asarray(high) - origin) / steps - 1e-6)
    return Lattice(origin + first * steps, steps, tuple((last - first).astype(int) + 1))


class Search(NamedTuple):
    """``cost`` (x, y, heading) [m] to the nearest end (inf: no way), ``action`` the next move."""

    cost: np.ndarray
    action: np.ndarray
    lattice: Lattice


def search(ground, chair, lattice, ends, wanted, minimum):
    """Ways to ``ends`` (n, 4) [index x, index y, index of heading, cost].

    The chair keeps ``minimum`` [m] of room and pays for less than ``wanted``.
    """
    edge, inside = probes(chair)
    (low_x, low_y), (step_x, step_y), (nx, ny) = lattice
    table = _rooms(ground.distance, ground.origin[0], ground.origin[1], RESOLUTION, edge, inside,
                   low_x, low_y, step_x, step_y, nx, ny, lattice.yaws, minimum)
    lengths = np.hypot(*(_MOVES * lattice.steps).T)
    cost, action = _dijkstra(table, np.asarray(ends, dtype=float), _MOVES, lengths, wanted, minimum)
    return Search(cost, action, lattice)


def warm_up(ground, chair):
    """Compile (once on a machine, then from the cache) what a search uses, before anybody waits for a way."""
    lattice = lattice_through(np.array([-1.0, 0.0]), np.array([-1.2, -0.2]), np.array([-0.8, 0.2]))
    search(ground, chair, lattice, [(0, 0, 0, 0.0)], 0.1, 0.0)


def descend(result, pose):
    """Corner points of the way from ``pose`` (3,): list of [x, y, yaw, reverse], one a straight piece's end.

    None where there is no way. The first point is the lattice's pose nearest to ``pose``.
    """
    state = _nearest(result, pose)
    if state is None:
        return None
    i, j, h = state
    lattice, yaws = result.lattice, result.lattice.yaws
    points = [(*(lattice.low + lattice.steps * np.array([i, j])), yaws[h], False)]
    previous = NONE
    while result.action[i, j, h] != END:
        action = result.action[i, j, h]
        if action in (FORWARD, REVERSE):
            sign = 1 if action == FORWARD else -1
            i, j = i + sign * _MOVES[h, 0], j + sign * _MOVES[h, 1]
            point = (*(lattice.low + lattice.steps * np.array([i, j])), yaws[h], action == REVERSE)
            if previous == action:
                points[-1] = point
            else:
                points.append(point)
        else:
            h = (h + (1 if action == LEFT else -1)) % HEADINGS
        previous = action
    return points


def _nearest(result, pose):
    """The lattice state nearest to ``pose`` from which there is a way; within 0.15 m and 30 degrees."""
    lattice, yaws = result.lattice, result.lattice.yaws
    middle = (pose[:2] - lattice.low) / lattice.steps
    best, lowest = None, np.inf
    for i in range(int(middle[0]) - 1, int(middle[0]) + 3):
        for j in range(int(middle[1]) - 1, int(middle[1]) + 3):
            if not (0 <= i < lattice.shape[0] and 0 <= j < lattice.shape[1]):
                continue
            apart = np.hypot(*(lattice.steps * (np.array([i, j]) - middle)))
            for h in range(HEADINGS):
                turn = abs((yaws[h] - pose[2] + np.pi) % (2.0 * np.pi) - np.pi)
                if apart > 0.15 or turn > 0.53 or not np.isfinite(result.cost[i, j, h]):
                    continue
                cost = result.cost[i, j, h] + 6.0 * apart + turn
                if cost < lowest:
                    best, lowest = (i, j, h), cost
    return best


@njit(cache=True)
def _rooms(distance, x0, y0, resolution, edge, inside, low_x, low_y, step_x, step_y, nx, ny, yaws, minimum):
    """Room (x, y, 2 * heading) at every lattice pose and half-way to the next heading; -1 where below minimum."""
    nh = 2 * len(yaws)
    table = np.full((nx, ny, nh), -1.0, dtype=np.float32)
    rows, columns = distance.shape
    n = len(edge) + len(inside)
    px, py = np.empty(n), np.empty(n)
    for h in range(nh):
        yaw = yaws[h // 2]
        if h % 2:
            yaw += 0.5 * ((yaws[(h // 2 + 1) % len(yaws)] - yaw + np.pi) % (2.0 * np.pi) - np.pi)
        cos, sin = np.cos(yaw), np.sin(yaw)
        for k in range(n):
            if k < len(edge):
                ex, ey = edge[k, 0], edge[k, 1]
            else:
                ex, ey = inside[k - len(edge), 0], inside[k - len(edge), 1]
            px[k], py[k] = cos * ex - sin * ey, sin * ex + cos * ey
        for i in range(nx):
            for j in range(ny):
                x, y = low_x + step_x * i, low_y + step_y * j
                least = 2.0
                for k in range(n):
                    column = int(np.round((x + px[k] - x0) / resolution))
                    row = int(np.round((y + py[k] - y0) / resolution))
                    if row < 0 or column < 0 or row >= rows or column >= columns:
                        least = -1.0
                        break
                    d = distance[row, column]
                    if k >= len(edge):
                        d -= 0.075
                    if d < least:
                        least = d
                        if least < minimum:
                            least = -1.0
                            break
                table[i, j, h] = least
    return table


@njit(cache=True)
def _price(room, wanted):
    """Cost of a metre at a pose with so much room."""
    if room >= wanted:
        return 1.0
    lack = (wanted - room) / wanted
    return 1.0 + 4.0 * lack * lack


@njit(cache=True)
def _dijkstra(table, seeds, moves, lengths, wanted, minimum):
    nx, ny, _ = table.shape
    nh = len(moves)
    cost = np.full((nx, ny, nh), np.inf)
    action = np.full((nx, ny, nh), NONE, dtype=np.int8)
    capacity = 5 * nx * ny * nh + len(seeds) + 1
    heap_cost, heap_state = np.empty(capacity), np.empty(capacity, dtype=np.int64)
    size = 0
    for s in range(len(seeds)):
        i, j, h = int(seeds[s, 0]), int(seeds[s, 1]), int(seeds[s, 2])
        if 0 <= i < nx and 0 <= j < ny and table[i, j, 2 * h] >= minimum and seeds[s, 3] < cost[i, j, h]:
            cost[i, j, h], action[i, j, h] = seeds[s, 3], END
            size = push(heap_cost, heap_state, size, seeds[s, 3], (i * ny + j) * nh + h)
    while size > 0:
        here = heap_cost[0]
        state, size = pop(heap_cost, heap_state, size)
        h, j, i = state % nh, (state // nh) % ny, state // (nh * ny)
        if here > cost[i, j, h]:
            continue
        length = lengths[h]
        # Backward: the pose from which this action leads here.
        for act in range(4):
            if act == 0 or act == 1:
                sign = -1 if act == 0 else 1
                ii, jj, hh = i + sign * moves[h, 0], j + sign * moves[h, 1], h
            else:
                ii, jj, hh = i, j, (h + (-1 if act == 2 else 1)) % nh
            if ii < 0 or jj < 0 or ii >= nx or jj >= ny or table[ii, jj, 2 * hh] < minimum:
                continue
            price = _price(table[ii, jj, 2 * hh], wanted)
            if act == 0:
                step = length * price
            elif act == 1:
                step = _REVERSE_COST * length * price
            else:
                half = (2 * hh + 1) if act == 2 else (2 * h + 1)
                if table[ii, jj, half] < minimum:
                    continue
                step = _TURN_COST * max(price, _price(table[ii, jj, half], wanted))
            if here + step < cost[ii, jj, hh] - 1e-9:
                cost[ii, jj, hh], action[ii, jj, hh] = here + step, act
                size = push(heap_cost, heap_state, size, here + step, (ii * ny + jj) * nh + hh)
    return cost, action
