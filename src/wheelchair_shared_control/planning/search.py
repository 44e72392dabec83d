"""Path search over (x, y, heading) with the true footprint: hybrid A* with turns on the spot and shots to the goal.

States are continuous, one per bin of 0.05 m x 0.05 m x 5 degrees (Dolgov et al. 2010). A shot is a closed-form
end of the path: turn, drive to a point of the goal's axis, turn, drive along the axis; it is what makes the search
fast in the open, and what meets a door square. Costs are seconds of a cautious drive.
"""
from typing import NamedTuple

import numpy as np
from numba import njit

from wheelchair_shared_control.planning.clearance import (
    DOUBTFUL,
    FAST,
    PRESUMED,
    SEEN,
    UNKNOWN,
    clearance,
    field_at,
    known_at,
)

BIN, HEADINGS = 0.05, 72
COARSE = 0.1
BESIDE, BLIND_SWING, BLIND_REVERSE = 0.45, 12.0, 4.0  # m, 1, 1: what unseen ground is charged so much more for
FORWARD, REVERSE, TURN = 0, 1, 2
# ds [m], dtheta [rad] of one primitive, its kind; each is checked in two halves.
_ARC, _TURN = 0.15, np.deg2rad(10.0)
PRIMITIVES = np.array(
    [[_ARC, _ARC * k, FORWARD] for k in (0.0, 0.9, -0.9, 2.0, -2.0)]
    + [[0.0, _TURN, TURN], [0.0, -_TURN, TURN]]
    + [[-_ARC, _ARC * k, REVERSE] for k in (0.0, 1.2, -1.2)]
)
AXIS_STEP, AXIS_LENGTH = 0.1, 5.0
AXIS_POINTS = np.arange(0.2, 4.9, 0.2)


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


class SearchResult(NamedTuple):
    """``steps`` (n, 2) of (ds [m], dtheta [rad]) from the start, or None; its cost [s]; whether there is no other."""

    steps: object
    cost: float
    expansions: int
    exhausted: bool


@njit(**FAST)
def _heap_push(keys, items, size, key, item):
    i = size
    while i > 0:
        p = (i - 1) >> 1
        if keys[p] <= key:
            break
        keys[i], items[i] = keys[p], items[p]
        i = p
    keys[i], items[i] = key, item
    return size + 1


@njit(**FAST)
def _heap_pop(keys, items, size):
    item = items[0]
    size -= 1
    key, last = keys[size], items[size]
    i = 0
    while True:
        c = 2 * i + 1
        if c >= size:
            break
        if c + 1 < size and keys[c + 1] < keys[c]:
            c += 1
        if keys[c] >= key:
            break
        keys[i], items[i] = keys[c], items[c]
        i = c
    keys[i], items[i] = key, last
    return item, size


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
    size = _heap_push(keys, items, 0, 0.0, gi * cols + gj)
    while size > 0:
        key = keys[0]
        item, size = _heap_pop(keys, items, size)
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
                size = _heap_push(keys, items, size, out[a, b], a * cols + b)
    return out


@njit(**FAST)
def _price(ds, dth, kind, c, ground, weights):
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
def _move(x, y, th, ds, dth):
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
def _piece(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor, turn_floor,
           rear, x, y, th, ds, dth, kind, parts, weights):
    """Drive one piece in ``parts``: cost (inf: not allowed) and the end pose."""
    # A chair that turns swings its corners: what share of its outermost corner's way that is decides the floor.
    swing = (reach + middle) * abs(dth)
    least = floor + (turn_floor - floor) * min(1.0, 2.0 * swing / (abs(ds) + swing + 1e-9))
    total = 0.0
    for _ in range(parts):
        x, y, th = _move(x, y, th, ds / parts, dth / parts)
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
        total += _price(ds / parts, dth / parts, kind, c, ground, weights)
    return total, x, y, th


@njit(**FAST)
def _wrap(a):
    return (a + np.pi) % (2.0 * np.pi) - np.pi


@njit(**FAST)
def _axis(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor, turn_floor, rear, goal,
          weights, out):
    """Fill ``out`` (n,): cost of driving along the goal's axis from AXIS_STEP * k before the goal to it."""
    out[0] = 0.0
    cg, sg = np.cos(goal[2]), np.sin(goal[2])
    for k in range(1, out.shape[0]):
        back = AXIS_STEP * k
        price, _, _, _ = _piece(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor,
                                turn_floor, rear, goal[0] - back * cg, goal[1] - back * sg, goal[2], AXIS_STEP, 0.0,
                                FORWARD, 1, weights)
        out[k] = out[k - 1] + price


@njit(**FAST)
def _shot(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor, turn_floor, rear,
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
        t1 = _wrap(np.arctan2(py - y, px - x) - th) if d1 > 0.02 else 0.0
    k = int(np.ceil(back / AXIS_STEP - 1e-9))
    if k >= axis.shape[0]:
        return np.inf, 0.0, 0.0, 0.0, 0.0
    t2 = _wrap(goal[2] - th - t1)
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
            price, x, y, th = _piece(distance, known, frame, outline, spine, half_width, reach, middle, shrink,
                                     floor, turn_floor, rear, x, y, th, ds / n, dth / n, kind, 1, weights)
            cost += price
            if cost >= best:
                return np.inf, 0.0, 0.0, 0.0, 0.0
    return cost, t1, d1, t2, back


@njit(**FAST)
def _bin(frame, nx, ny, x, y, th):
    """Index of the bin of a state, -1 outside the window."""
    if not (x >= frame[0] and y >= frame[1]):
        return -1
    i, j = int((x - frame[0]) / BIN), int((y - frame[1]) / BIN)
    if i >= nx or j >= ny:
        return -1
    h = int(np.floor((th % (2.0 * np.pi)) * (HEADINGS / (2.0 * np.pi)))) % HEADINGS
    return (i * ny + j) * HEADINGS + h


@njit(**FAST)
def _begin(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor, turn_floor, rear, start,
           kind, goal, weights, table, node_pose, node_g, node_parent, node_primitive, node_kind, keys, items, axis,
           counts):
    """Set up a search; returns the estimate to the goal."""
    rows, cols = distance.shape
    width, height = cols * frame[2], rows * frame[2]
    bound = cost_to_go(distance, frame, int(height / COARSE), int(width / COARSE), goal, half_width,
                       weights, keys, items)
    _axis(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor, turn_floor, rear, goal,
          weights, axis)
    table[: int(width / BIN) * int(height / BIN) * HEADINGS] = -1
    node_pose[0, 0], node_pose[0, 1], node_pose[0, 2] = start[0], start[1], start[2]
    node_g[0] = 0.0
    node_parent[0] = -1
    node_primitive[0] = -1
    node_kind[0] = kind
    # size of the heap, nodes, expansions, best node
    counts[0], counts[1], counts[2], counts[3] = _heap_push(keys, items, 0, 0.0, 0), 1, 0, -1
    return bound


@njit(**FAST)
def _continue(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor, turn_floor, rear,
              start, goal, goal_xy, goal_yaw, allow_reverse, cap, weights, primitives, axis_points, bound, best,
              table, node_pose, node_g, node_parent, node_primitive, node_kind, keys, items, axis, counts, shot):
    """Expand up to ``cap`` states more. Returns the best cost, and whether the search has come to its end."""
    rows, cols = distance.shape
    nx, ny = int(cols * frame[2] / BIN), int(rows * frame[2] / BIN)
    capacity = node_g.shape[0]
    size, n_nodes, expansions, best_node = counts[0], counts[1], counts[2], counts[3]
    # A start that stands closer than the floor must be able to leave: what the start has is enough near it.
    start_c = clearance(distance, frame, outline, spine, half_width, reach, middle, 0.5,
                        start[0], start[1], start[2]) - shrink
    start_floor, start_turn_floor = min(floor, start_c - 0.002), min(turn_floor, start_c - 0.002)
    ended = True
    last = expansions + cap
    while size > 0:
        if keys[0] >= best * 0.95:
            break
        if expansions >= last or n_nodes + 16 >= capacity:
            ended = n_nodes + 16 >= capacity
            break
        node, size = _heap_pop(keys, items, size)
        x, y, th = node_pose[node, 0], node_pose[node, 1], node_pose[node, 2]
        slot = _bin(frame, nx, ny, x, y, th)
        if slot < 0 or (table[slot] >= 0 and table[slot] != node):
            continue  # a better way to this bin was found meanwhile
        table[slot] = node
        g, kind0 = node_g[node], node_kind[node]
        if np.hypot(x - goal[0], y - goal[1]) <= goal_xy and abs(_wrap(th - goal[2])) <= goal_yaw:
            if g < best:
                best, best_node = g, node
                shot[0] = shot[1] = shot[2] = shot[3] = 0.0
            continue
        here_floor, here_turn_floor = floor, turn_floor
        if np.hypot(x - start[0], y - start[1]) < 0.5:
            here_floor, here_turn_floor = start_floor, start_turn_floor
        if expansions % 10 == 0:
            for k in range(-1, axis_points.shape[0]):
                cost, t1, d1, t2, d2 = _shot(
                    distance, known, frame, outline, spine, half_width, reach, middle, shrink, here_floor,
                    here_turn_floor, rear, x, y, th, kind0, goal, -1.0 if k < 0 else axis_points[k], axis, weights,
                    best - g)
                if g + cost < best:
                    best, best_node = g + cost, node
                    shot[0], shot[1], shot[2], shot[3] = t1, d1, t2, d2
        expansions += 1
        for p in range(primitives.shape[0]):
            ds, dth, kind = primitives[p, 0], primitives[p, 1], int(primitives[p, 2])
            if kind == REVERSE and not allow_reverse:
                continue
            price, px, py, pth = _piece(distance, known, frame, outline, spine, half_width, reach, middle,
                                        shrink, here_floor, here_turn_floor, rear, x, y, th, ds, dth, kind, 2, weights)
            if price == np.inf:
                continue
            if kind0 >= 0 and kind != kind0:
                price += weights[4]
                if kind + kind0 == 1:
                    price += weights[3]
            slot = _bin(frame, nx, ny, px, py, pth)
            if slot < 0:
                continue
            g2 = g + price
            old = table[slot]
            if old >= 0 and node_g[old] <= g2 + 1e-9:
                continue
            ci = min(int((py - frame[1]) / COARSE), bound.shape[0] - 1)
            cj = min(int((px - frame[0]) / COARSE), bound.shape[1] - 1)
            h = bound[ci, cj]
            if h == np.inf:
                # The coarse cell is blocked although the pose is free: take a neighbour's bound.
                for a in range(max(ci - 1, 0), min(ci + 2, bound.shape[0])):
                    for b in range(max(cj - 1, 0), min(cj + 2, bound.shape[1])):
                        h = min(h, bound[a, b] + COARSE / weights[0])
                if h == np.inf:
                    continue
            if h < 0.6:
                h = max(h, abs(_wrap(pth - goal[2])) / weights[1])
            if g2 + h >= best or size + 1 >= keys.shape[0]:
                continue
            node_pose[n_nodes, 0], node_pose[n_nodes, 1], node_pose[n_nodes, 2] = px, py, pth
            node_g[n_nodes] = g2
            node_parent[n_nodes] = node
            node_primitive[n_nodes] = p
            node_kind[n_nodes] = kind
            table[slot] = n_nodes
            size = _heap_push(keys, items, size, g2 + 1.2 * h, n_nodes)
            n_nodes += 1
    counts[0], counts[1], counts[2], counts[3] = size, n_nodes, expansions, best_node
    return best, ended


class PathSearch:
    """A search that can be spread over several calls; nothing of one search is used in the next.

    ``body``: the sampled footprint, smaller than the true one by ``shrink`` [m]; ``rear``: x of the rear edge [m].
    """

    def __init__(self, body, rear, shrink=0.0, cap=3000, weights=Weights()):
        self.body, self.rear, self.shrink, self.cap = body, float(rear), float(shrink), int(cap)
        self.weights = np.array(weights, dtype=np.float64)
        capacity = 8 * self.cap + 64
        self._nodes = (np.empty((capacity, 3)), np.empty(capacity), np.empty(capacity, np.int32),
                       np.empty(capacity, np.int32), np.empty(capacity, np.int32))
        self._heap = (np.empty(capacity + 20000), np.empty(capacity + 20000, np.int64))
        self._table = np.empty(0, np.int32)
        self._shot, self._counts = np.zeros(4), np.zeros(4, np.int64)
        self._axis = np.empty(int(AXIS_LENGTH / AXIS_STEP) + 1)
        self._problem = None

    def begin(self, field, start, goal, goal_xy, goal_yaw, allow_reverse=True, floor=0.005, moving=-1,
              turn_floor=None):
        """Set up a search from pose ``start`` (3,) to ``goal`` (3,), both in the field's frame.

        ``floor`` [m]: smallest clearance of the true footprint that a path may have (negative: it will be centred
        later), and ``turn_floor`` where it turns on the spot (the same if None); ``moving``: FORWARD,
        REVERSE or TURN if the chair is doing that now, else -1.
        """
        rows, cols = field.distance.shape
        bins = int(cols * field.frame[2] / BIN) * int(rows * field.frame[2] / BIN) * HEADINGS
        if self._table.size < bins:
            self._table = np.empty(bins, np.int32)
        start, goal = np.asarray(start, dtype=np.float64), np.asarray(goal, dtype=np.float64)
        self._chair = (field.distance, field.known, field.frame, *self.body, self.shrink, float(floor),
                       float(floor if turn_floor is None else turn_floor), self.rear)
        bound = _begin(*self._chair, start, int(moving), goal, self.weights, self._table, *self._nodes, *self._heap,
                       self._axis, self._counts)
        self._problem = (start, goal, float(goal_xy), float(goal_yaw), bool(allow_reverse))
        self._bound, self._best, self.ended = bound, np.inf, False

    def expand(self, cap):
        """Expand up to ``cap`` states more; returns whether the search has come to its end."""
        cap = min(int(cap), self.cap - int(self._counts[2]))
        if not self.ended:
            self._best, exhausted = _continue(
                *self._chair, *self._problem, cap, self.weights, PRIMITIVES, AXIS_POINTS, self._bound, self._best,
                self._table, *self._nodes, *self._heap, self._axis, self._counts, self._shot)
            self.ended = exhausted or self._counts[2] >= self.cap
            self.exhausted = exhausted
        return self.ended

    def result(self):
        """The best path so far."""
        node = int(self._counts[3])
        expansions = int(self._counts[2])
        if node < 0:
            return SearchResult(None, np.inf, expansions, self.ended and self.exhausted)
        return SearchResult(self._steps(node), self._best, expansions, self.ended and self.exhausted)

    def find(self, field, start, goal, goal_xy, goal_yaw, allow_reverse=True, floor=0.005, moving=-1,
             turn_floor=None):
        """A whole search at once."""
        self.begin(field, start, goal, goal_xy, goal_yaw, allow_reverse, floor, moving, turn_floor)
        self.expand(self.cap)
        return self.result()

    def _steps(self, node):
        _, _, parent, primitive, _ = self._nodes
        chain = []
        while parent[node] >= 0:
            chain.append(PRIMITIVES[primitive[node], :2])
            node = parent[node]
        pieces = [np.repeat(step[None] / 2.0, 2, axis=0) for step in reversed(chain)]
        t1, d1, t2, d2 = self._shot
        for length, turn in ((0.0, t1), (d1, 0.0), (0.0, t2), (d2, 0.0)):
            n = int(np.ceil(max(abs(length) / 0.08, abs(turn) / 0.1)))
            if n and (abs(length) > 1e-4 or abs(turn) > 1e-3):
                pieces.append(np.tile([length / n, turn / n], (n, 1)))
        return np.concatenate(pieces) if pieces else np.zeros((1, 2))


@njit(**FAST)
def price_of(distance, known, frame, outline, spine, half_width, reach, middle, rear, start, steps, kinds, weights):
    """Cost [s] of driving ``steps`` (n, 2) of ``kinds`` (n,) from ``start``, on the search's scale; never inf."""
    x, y, th = start[0], start[1], start[2]
    total = 0.0
    for k in range(steps.shape[0]):
        kind = TURN if kinds[k] == 0 else (FORWARD if kinds[k] > 0 else REVERSE)
        price, x, y, th = _piece(distance, known, frame, outline, spine, half_width, reach, middle, 0.0, -1.0, -1.0,
                                 rear, x, y, th, steps[k, 0], steps[k, 1], kind, 1, weights)
        if price == np.inf:
            price = 1.0
        total += price
        if k > 0 and kinds[k] != kinds[k - 1]:
            total += weights[4]
            if kinds[k] * kinds[k - 1] < 0:
                total += weights[3]
    return total
