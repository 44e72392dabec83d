"""Path search over (x, y, heading) with the true footprint: hybrid A* with turns on the spot and shots to the goal.

States are continuous, one per bin of 0.05 m x 0.05 m x 5 degrees (Dolgov et al. 2010). A shot is a closed-form
end of the path: turn, drive to a point of the goal's axis, turn, drive along the axis; it is what makes the search
fast in the open, and what meets a door square. Costs are seconds of a cautious drive.
"""
from typing import NamedTuple

import numpy as np
from numba import njit

from wheelchair_shared_control.planning.clearance import clearance, field_at, known_at

BIN, HEADINGS = 0.05, 72
COARSE = 0.1
FORWARD, REVERSE, TURN = 0, 1, 2
# ds [m], dtheta [rad] of one primitive, its kind; each is checked in two halves.
_ARC, _TURN = 0.15, np.deg2rad(10.0)
PRIMITIVES = np.array(
    [[_ARC, _ARC * k, FORWARD] for k in (0.0, 0.9, -0.9, 2.0, -2.0)]
    + [[0.0, _TURN, TURN], [0.0, -_TURN, TURN]]
    + [[-_ARC, _ARC * k, REVERSE] for k in (0.0, 1.2, -1.2)]
)
AXIS_POINTS = np.arange(0.3, 4.6, 0.2)


class Weights(NamedTuple):
    """What the search charges; times [s] unless said otherwise."""

    speed: float = 0.45
    turn_rate: float = 0.55
    reverse_factor: float = 1.6
    reversal: float = 1.0
    stop: float = 0.5
    comfortable: float = 0.25
    narrow: float = 3.0
    unknown_factor: float = 1.3


class SearchResult(NamedTuple):
    """``steps`` (n, 2) of (ds [m], dtheta [rad]) from the start, or None; ``reason`` and ``expansions``."""

    steps: object
    cost: float
    expansions: int
    exhausted: bool


@njit(cache=True)
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


@njit(cache=True)
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


@njit(cache=True)
def cost_to_go(distance, frame, rows, cols, goal, radius, keys, items):
    """Lower bound (rows, cols) [m] of the way to the goal on a grid of COARSE cells for a disc of ``radius``."""
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
                step = COARSE * (1.41421356 if di != 0 and dj != 0 else 1.0)
                if out[i, j] + step >= out[a, b]:
                    continue
                d = field_at(distance, frame, frame[0] + (b + 0.5) * COARSE, frame[1] + (a + 0.5) * COARSE)
                # Half a coarse cell of slack: a gap between two coarse centres must stay open.
                if d < radius - 0.07:
                    continue
                # The axle keeps to the middle of narrow places; without this the bound is useless there.
                out[a, b] = out[i, j] + step
                size = _heap_push(keys, items, size, out[a, b], a * cols + b)
    return out


@njit(cache=True)
def _price(ds, dth, kind, c, seen, weights):
    """Cost [s] of a piece of path with clearance ``c`` [m]."""
    speed, turn_rate, reverse_factor, _, _, comfortable, narrow, unknown_factor = weights
    time = max(abs(ds) / speed, abs(dth) / turn_rate)
    if kind == REVERSE:
        time *= reverse_factor
    if c < comfortable:
        x = (comfortable - c) / comfortable
        time *= 1.0 + narrow * x * x
        if c < 0.04:
            time *= 1.0 + 3.0 * (0.04 - c) / 0.04
    if not seen:
        time *= unknown_factor
    return time


@njit(cache=True)
def _move(x, y, th, ds, dth):
    half = 0.5 * dth
    chord = ds * (1.0 - half * half / 6.0 + half ** 4 / 120.0)
    return x + chord * np.cos(th + half), y + chord * np.sin(th + half), th + dth


@njit(cache=True)
def _piece(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor,
           rear, x, y, th, ds, dth, kind, parts, weights):
    """Drive one piece in ``parts``: cost (inf: not allowed) and the end pose."""
    total = 0.0
    for _ in range(parts):
        x, y, th = _move(x, y, th, ds / parts, dth / parts)
        c = clearance(distance, frame, outline, spine, half_width, reach, middle, 0.5, x, y, th) - shrink
        if c < floor:
            return np.inf, x, y, th
        cs, sn = np.cos(th), np.sin(th)
        seen = True
        if kind == REVERSE:
            for side in range(-1, 2):
                px, py = rear, side * half_width
                if not known_at(known, frame, x + cs * px - sn * py, y + sn * px + cs * py):
                    return np.inf, x, y, th
        else:
            for side in range(-1, 2):
                px, py = 2.0 * middle - rear, side * half_width
                if not known_at(known, frame, x + cs * px - sn * py, y + sn * px + cs * py):
                    seen = False
        total += _price(ds / parts, dth / parts, kind, c, seen, weights)
    return total, x, y, th


@njit(cache=True)
def _wrap(a):
    return (a + np.pi) % (2.0 * np.pi) - np.pi


@njit(cache=True)
def _shot(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor, rear,
          x, y, th, kind0, goal, back, direct, weights, best):
    """Cost of turn, drive to the axis point ``back`` [m] before the goal, turn, drive to the goal.

    ``direct``: no turn at the start, the current heading is driven until it meets the axis.
    Returns cost (inf: not possible, or above ``best``), and turn, drive, turn, drive.
    """
    cg, sg = np.cos(goal[2]), np.sin(goal[2])
    if direct:
        cross = np.cos(th) * sg - np.sin(th) * cg
        if abs(cross) < 0.05:
            return np.inf, 0.0, 0.0, 0.0, 0.0
        # x + d cos(th) lies on the axis: its distance beside the axis is zero.
        beside = -(x - goal[0]) * sg + (y - goal[1]) * cg
        d1 = beside / cross
        if d1 < 0.0 or d1 > 4.0:
            return np.inf, 0.0, 0.0, 0.0, 0.0
        px, py = x + d1 * np.cos(th), y + d1 * np.sin(th)
        back = (goal[0] - px) * cg + (goal[1] - py) * sg
        if back < 0.1 or back > 5.0:
            return np.inf, 0.0, 0.0, 0.0, 0.0
        t1 = 0.0
    else:
        px, py = goal[0] - back * cg, goal[1] - back * sg
        d1 = np.hypot(px - x, py - y)
        t1 = _wrap(np.arctan2(py - y, px - x) - th) if d1 > 0.02 else 0.0
    t2 = _wrap(goal[2] - th - t1)
    cost = weights[4] * ((abs(t1) > 0.02) * (kind0 != TURN) + (abs(t1) > 0.02) + 2.0 * (abs(t2) > 0.02))
    if kind0 == REVERSE:
        cost += weights[3]
    if cost + (d1 + back) / weights[0] + (abs(t1) + abs(t2)) / weights[1] >= best:
        return np.inf, 0.0, 0.0, 0.0, 0.0
    for leg in range(4):
        if leg == 0:
            ds, dth, kind, n = 0.0, t1, TURN, int(np.ceil(abs(t1) / 0.1))
        elif leg == 1:
            ds, dth, kind, n = d1, 0.0, FORWARD, int(np.ceil(d1 / 0.1))
        elif leg == 2:
            ds, dth, kind, n = 0.0, t2, TURN, int(np.ceil(abs(t2) / 0.1))
        else:
            ds, dth, kind, n = back, 0.0, FORWARD, int(np.ceil(back / 0.1))
        if n == 0:
            continue
        for _ in range(n):
            price, x, y, th = _piece(distance, known, frame, outline, spine, half_width, reach, middle, shrink,
                                     floor, rear, x, y, th, ds / n, dth / n, kind, 1, weights)
            cost += price
            if cost >= best:
                return np.inf, 0.0, 0.0, 0.0, 0.0
    return cost, t1, d1, t2, back


@njit(cache=True)
def _search(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor, rear,
            start, goal, goal_xy, goal_yaw, allow_reverse, cap, weights, primitives, axis_points,
            table, node_pose, node_g, node_parent, node_primitive, node_kind, keys, items, shot):
    rows, cols = distance.shape
    width, height = cols * frame[2], rows * frame[2]
    bound = cost_to_go(distance, frame, int(height / COARSE), int(width / COARSE), goal, half_width,
                       keys, items)
    nx, ny = int(width / BIN), int(height / BIN)
    table[: nx * ny * HEADINGS] = -1
    capacity = node_g.shape[0]
    node_pose[0, 0], node_pose[0, 1], node_pose[0, 2] = start[0], start[1], start[2]
    node_g[0] = 0.0
    node_parent[0] = -1
    node_primitive[0] = -1
    node_kind[0] = -1
    n_nodes = 1
    size = _heap_push(keys, items, 0, 0.0, 0)
    best, best_node = np.inf, -1
    expansions = 0
    # A start that stands closer than the floor must be able to leave: what the start has is enough near it.
    start_c = clearance(distance, frame, outline, spine, half_width, reach, middle, 0.5,
                        start[0], start[1], start[2]) - shrink
    start_floor = min(floor, start_c - 0.005)
    exhausted = True
    while size > 0:
        f = keys[0]
        if f >= best * 0.9:
            break
        if expansions >= cap or n_nodes + 16 >= capacity:
            exhausted = False
            break
        node, size = _heap_pop(keys, items, size)
        x, y, th = node_pose[node, 0], node_pose[node, 1], node_pose[node, 2]
        ix, iy = int((x - frame[0]) / BIN), int((y - frame[1]) / BIN)
        ih = int(np.floor((th % (2.0 * np.pi)) / (2.0 * np.pi) * HEADINGS)) % HEADINGS
        slot = (ix * ny + iy) * HEADINGS + ih
        if table[slot] >= 0 and table[slot] != node:
            continue  # a better way to this bin was found meanwhile
        table[slot] = node
        g, kind0 = node_g[node], node_kind[node]
        # The goal itself.
        if np.hypot(x - goal[0], y - goal[1]) <= goal_xy and abs(_wrap(th - goal[2])) <= goal_yaw:
            if g < best:
                best, best_node = g, node
                shot[0] = shot[1] = shot[2] = shot[3] = 0.0
            continue
        here_floor = floor
        if np.hypot(x - start[0], y - start[1]) < 0.5:
            here_floor = start_floor
        if expansions % 12 == 0:
            for k in range(-1, axis_points.shape[0]):
                back = 0.0 if k < 0 else axis_points[k]
                cost, t1, d1, t2, d2 = _shot(
                    distance, known, frame, outline, spine, half_width, reach, middle, shrink, here_floor, rear,
                    x, y, th, kind0, goal, back, k < 0, weights, best - g)
                if g + cost < best:
                    best, best_node = g + cost, node
                    shot[0], shot[1], shot[2], shot[3] = t1, d1, t2, d2
        expansions += 1
        for p in range(primitives.shape[0]):
            ds, dth, kind = primitives[p, 0], primitives[p, 1], int(primitives[p, 2])
            if kind == REVERSE and not allow_reverse:
                continue
            price, px, py, pth = _piece(distance, known, frame, outline, spine, half_width, reach, middle,
                                        shrink, here_floor, rear, x, y, th, ds, dth, kind, 2, weights)
            if price == np.inf:
                continue
            if kind0 >= 0 and kind != kind0:
                price += weights[4]
                if kind + kind0 == 1:
                    price += weights[3]
            jx, jy = int((px - frame[0]) / BIN), int((py - frame[1]) / BIN)
            if jx < 0 or jy < 0 or jx >= nx or jy >= ny or px < frame[0] or py < frame[1]:
                continue
            jh = int(np.floor((pth % (2.0 * np.pi)) / (2.0 * np.pi) * HEADINGS)) % HEADINGS
            slot = (jx * ny + jy) * HEADINGS + jh
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
                        h = min(h, bound[a, b] + COARSE)
                if h == np.inf:
                    continue
            h = h / weights[0]
            if h < 0.6:
                h = max(h, abs(_wrap(pth - goal[2])) / weights[1])
            if g2 + h >= best:
                continue
            node_pose[n_nodes, 0], node_pose[n_nodes, 1], node_pose[n_nodes, 2] = px, py, pth
            node_g[n_nodes] = g2
            node_parent[n_nodes] = node
            node_primitive[n_nodes] = p
            node_kind[n_nodes] = kind
            table[slot] = n_nodes
            if size + 1 >= keys.shape[0]:
                continue
            size = _heap_push(keys, items, size, g2 + 1.2 * h, n_nodes)
            n_nodes += 1
    return best, best_node, expansions, exhausted


class PathSearch:
    """Search with its memory kept between calls; nothing of one call is used in the next."""

    def __init__(self, body, rear, cap=3000, weights=Weights()):
        self.body, self.rear, self.cap = body, float(rear), int(cap)
        self.weights = np.array(weights, dtype=np.float64)
        capacity = 12 * self.cap + 64
        self._nodes = (np.empty((capacity, 3)), np.empty(capacity), np.empty(capacity, np.int32),
                       np.empty(capacity, np.int32), np.empty(capacity, np.int32))
        self._heap = (np.empty(capacity + 20000), np.empty(capacity + 20000, np.int64))
        self._table = np.empty(0, np.int32)
        self._shot = np.zeros(4)

    def find(self, field, start, goal, goal_xy, goal_yaw, allow_reverse=True, shrink=0.0, floor=0.005, cap=None):
        """SearchResult from pose ``start`` (3,) to ``goal`` (3,), both in the field's frame.

        ``shrink`` [m]: the body given was shrunk by so much; ``floor`` [m]: smallest clearance of the true
        footprint that a path may have (negative with a shrunk body: a path to be centred later).
        """
        rows, cols = field.distance.shape
        res = field.frame[2]
        bins = int(cols * res / BIN) * int(rows * res / BIN) * HEADINGS
        if self._table.size < bins:
            self._table = np.empty(bins, np.int32)
        start = np.asarray(start, dtype=np.float64)
        goal = np.asarray(goal, dtype=np.float64)
        best, node, expansions, exhausted = _search(
            field.distance, field.known, field.frame, *self.body, float(shrink), float(floor), self.rear,
            start, goal, float(goal_xy), float(goal_yaw), bool(allow_reverse), int(cap or self.cap), self.weights,
            PRIMITIVES, AXIS_POINTS, self._table, *self._nodes, *self._heap, self._shot)
        if node < 0:
            return SearchResult(None, np.inf, expansions, exhausted)
        return SearchResult(self._steps(node), best, expansions, exhausted)

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
        return np.concatenate(pieces) if pieces else np.zeros((0, 2))


@njit(cache=True)
def price_of(distance, known, frame, outline, spine, half_width, reach, middle, rear, start, steps, kinds, weights):
    """Cost [s] of driving ``steps`` (n, 2) of ``kinds`` (n,) from ``start``, on the search's scale; never inf."""
    x, y, th = start[0], start[1], start[2]
    total = 0.0
    for k in range(steps.shape[0]):
        kind = TURN if kinds[k] == 0 else (FORWARD if kinds[k] > 0 else REVERSE)
        price, x, y, th = _piece(distance, known, frame, outline, spine, half_width, reach, middle, 0.0, -1.0, rear,
                                 x, y, th, steps[k, 0], steps[k, 1], kind, 1, weights)
        if price == np.inf:
            price = 1.0
        total += price
        if k > 0 and kinds[k] != kinds[k - 1]:
            total += weights[4]
            if kinds[k] * kinds[k - 1] < 0:
                total += weights[3]
    return total
