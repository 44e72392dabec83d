"""Path search over (x, y, heading) with the true footprint: hybrid A* with turns on the spot and shots to the goal.

States are continuous, one per bin of 0.05 m x 0.05 m x 5 degrees (Dolgov et al. 2010). Costs are seconds of a
cautious drive (`pieces`), the estimate of what is left comes from a coarse grid (`bound`), and every tenth state is
tried for an end in closed form (`shots`).
"""
from typing import NamedTuple

import numpy as np
from numba import njit

from wheelchair_shared_control.heap import pop, push
from wheelchair_shared_control.planning.bound import COARSE, cost_to_go
from wheelchair_shared_control.planning.clearance import FAST, clearance
from wheelchair_shared_control.planning.pieces import FORWARD, REVERSE, TURN, Weights, drive, wrap
from wheelchair_shared_control.planning.shots import AXIS_LENGTH, AXIS_POINTS, AXIS_STEP, axis_costs, shoot

BIN, HEADINGS = 0.05, 72
# ds [m], dtheta [rad] of one primitive, its kind; each is checked in two halves.
_ARC, _TURN = 0.15, np.deg2rad(10.0)
PRIMITIVES = np.array(
    [[_ARC, _ARC * k, FORWARD] for k in (0.0, 0.9, -0.9, 2.0, -2.0)]
    + [[0.0, _TURN, TURN], [0.0, -_TURN, TURN]]
    + [[-_ARC, _ARC * k, REVERSE] for k in (0.0, 1.2, -1.2)]
)


class SearchResult(NamedTuple):
    """``steps`` (n, 2) of (ds [m], dtheta [rad]) from the start, or None; its cost [s]; whether there is no other."""

    steps: object
    cost: float
    expansions: int
    exhausted: bool


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
    axis_costs(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor, turn_floor, rear, goal,
          weights, axis)
    table[: int(width / BIN) * int(height / BIN) * HEADINGS] = -1
    node_pose[0, 0], node_pose[0, 1], node_pose[0, 2] = start[0], start[1], start[2]
    node_g[0] = 0.0
    node_parent[0] = -1
    node_primitive[0] = -1
    node_kind[0] = kind
    # size of the heap, nodes, expansions, best node
    counts[0], counts[1], counts[2], counts[3] = push(keys, items, 0, 0.0, 0), 1, 0, -1
    return bound


@njit(**FAST)
def _continue(distance, known, frame, outline, spine, half_width, reach, middle, shrink, floor, turn_floor, rear,
              start, goal, goal_xy, goal_yaw, allow_reverse, cap, weights, primitives, axis_points, bound, best,
              table, node_pose, node_g, node_parent, node_primitive, node_kind, keys, items, axis, counts, shot):
    """Expand up to ``cap`` states more. Returns the best cost, whether the search has come to its end, and whether that
    is because nothing better is left: where the memory is full there may be."""
    rows, cols = distance.shape
    nx, ny = int(cols * frame[2] / BIN), int(rows * frame[2] / BIN)
    capacity = node_g.shape[0]
    size, n_nodes, expansions, best_node = counts[0], counts[1], counts[2], counts[3]
    # A start that stands closer than the floor must be able to leave: what the start has is enough near it.
    start_c = clearance(distance, frame, outline, spine, half_width, reach, middle, 0.5,
                        start[0], start[1], start[2]) - shrink
    start_floor, start_turn_floor = min(floor, start_c - 0.002), min(turn_floor, start_c - 0.002)
    ended = exhausted = True
    last = expansions + cap
    while size > 0:
        if keys[0] >= best * 0.95:
            break
        if expansions >= last or n_nodes + 16 >= capacity:
            ended, exhausted = n_nodes + 16 >= capacity, False
            break
        node, size = pop(keys, items, size)
        x, y, th = node_pose[node, 0], node_pose[node, 1], node_pose[node, 2]
        slot = _bin(frame, nx, ny, x, y, th)
        if slot < 0 or (table[slot] >= 0 and table[slot] != node):
            continue  # a better way to this bin was found meanwhile
        table[slot] = node
        g, kind0 = node_g[node], node_kind[node]
        if np.hypot(x - goal[0], y - goal[1]) <= goal_xy and abs(wrap(th - goal[2])) <= goal_yaw:
            if g < best:
                best, best_node = g, node
                shot[0] = shot[1] = shot[2] = shot[3] = 0.0
            continue
        here_floor, here_turn_floor = floor, turn_floor
        if np.hypot(x - start[0], y - start[1]) < 0.5:
            here_floor, here_turn_floor = start_floor, start_turn_floor
        if expansions % 10 == 0:
            for k in range(-1, axis_points.shape[0]):
                cost, t1, d1, t2, d2 = shoot(
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
            price, px, py, pth = drive(distance, known, frame, outline, spine, half_width, reach, middle,
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
                h = max(h, abs(wrap(pth - goal[2])) / weights[1])
            if g2 + h >= best or size + 1 >= keys.shape[0]:
                continue
            node_pose[n_nodes, 0], node_pose[n_nodes, 1], node_pose[n_nodes, 2] = px, py, pth
            node_g[n_nodes] = g2
            node_parent[n_nodes] = node
            node_primitive[n_nodes] = p
            node_kind[n_nodes] = kind
            table[slot] = n_nodes
            size = push(keys, items, size, g2 + 1.2 * h, n_nodes)
            n_nodes += 1
    counts[0], counts[1], counts[2], counts[3] = size, n_nodes, expansions, best_node
    return best, ended, exhausted


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
            self._best, ended, self.exhausted = _continue(
                *self._chair, *self._problem, cap, self.weights, PRIMITIVES, AXIS_POINTS, self._bound, self._best,
                self._table, *self._nodes, *self._heap, self._axis, self._counts, self._shot)
            self.ended = ended or self._counts[2] >= self.cap
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
