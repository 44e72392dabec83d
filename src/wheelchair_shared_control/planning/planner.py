"""A path for the true footprint: searched with a slimmer chair, centred by refinement, checked with the true one.

Doors only centimetres wider than the chair fall between the search's bins. The search is therefore done with a chair
that is a little slimmer, the refinement centres its path, and the path counts only if the true footprint is clear all
along it; if not, the search is repeated with the true footprint.
"""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control.planning import clearance, pieces, refinement, search
from wheelchair_shared_control.planning.following import kinds_of, seen_ahead

SLIMMER = 0.04
TURN_SLACK = 0.005  # m: so much more is asked of a turn when it is searched than when it is checked
SLIM_FLOOR, SLIM_TURN_FLOOR = -0.03, 0.02
GOAL_XY, GOAL_YAW = 0.05, 0.1  # m, rad: how near to the goal a search ends
# comfortable [m], near [m], then weights: spine, outline, near, pose xy, pose yaw, end xy, end yaw,
# change of ds, change of dtheta, bending; narrow [m], straight [m]: from so far before what is narrow bending costs
# so much [1] more.
REFINEMENT = np.array([0.30, 0.05, 1000.0, 300.0, 10000.0, 2.0, 0.3, 100.0, 60.0, 1000.0, 20.0, 8.0,
                       0.15, 0.25, 300.0])
STEP, STEP_TURN = 0.08, 0.12  # m, rad: length of a step of a path
COMFORTABLE = 0.08  # m: a path with so much room is taken as it is
ROUND_BEFORE, ROOM = 1.0, 0.2  # m: a turn so far before a clearance below that stays a turn
ROUND = 0.6  # rad: turns on the spot between two drives up to this are driven as a bend


class Path(NamedTuple):
    """``steps`` (n, 2) of (ds [m], dtheta [rad]), ``poses`` (n + 1, 3), ``kinds`` (n,), ``clear`` (n + 1,) [m]."""

    steps: np.ndarray
    poses: np.ndarray
    kinds: np.ndarray
    clear: np.ndarray


class Planner:
    """Finds and refines paths in one costmap field; keeps only the search's memory."""

    def __init__(self, wheelchair, settings):
        self.footprint = footprints.grown(
            footprints.from_settings(wheelchair), settings.local_costmap.footprint_padding)
        self.settings = settings.planner
        self.body = clearance.make_body(self.footprint)
        slim = clearance.make_body(footprints.grown(self.footprint, -SLIMMER), 0.08)
        cap = self.settings.max_expansions
        self._slim = search.PathSearch(slim, self.footprint.rear, SLIMMER, cap)
        self._true = search.PathSearch(self.body, self.footprint.rear, 0.0, cap)

    def clearance(self, field, poses):
        """Clearance (n,) [m] of poses (n, 3)."""
        return clearance.of_poses(field, self.body, poses)

    def still(self, field, pose):
        """The Path of standing at ``pose`` (3,)."""
        poses = np.stack((pose, pose))
        return Path(np.zeros((1, 2)), poses, np.zeros(1, np.int64), self.clearance(field, poses))

    def seen(self, field, path):
        """Whether the ground below the leading edge was seen, for each step (n,) of a Path."""
        return seen_ahead(field.known, field.frame, path.poses[1:], path.kinds, self.footprint.front,
                          self.footprint.rear, self.footprint.half_width)

    def price(self, field, start, steps, kinds):
        """Cost [s] of a path on the search's scale."""
        return pieces.price_of(field.distance, field.known, field.frame, *self.body, self.footprint.rear,
                               np.asarray(start, dtype=float), steps, kinds, self._slim.weights)

    def refine(self, field, start, steps, kinds, targets, iterations):
        """Refined Path from ``start``; steps keep their kinds."""
        steps, poses, _ = refinement.refine(
            field.distance, field.frame, *self.body, REFINEMENT, np.asarray(start, dtype=float),
            np.ascontiguousarray(steps), np.ascontiguousarray(kinds), np.ascontiguousarray(targets), iterations)
        return Path(steps, poses, kinds, self.clearance(field, poses))

    def blocked(self, path, limit=None):
        """Index of the first pose whose clearance is below the limit and below what the start has, or -1.

        Turns on the spot swing the corners and need more. A chair that stands close to something may leave: up to
        half a metre on, it may be as close as it is.
        """
        limit = self.settings.min_clearance if limit is None else limit
        turns = np.concatenate((path.kinds, [1])) * np.concatenate(([1], path.kinds)) == 0
        limit = np.where(turns, limit + self.settings.turn_clearance - self.settings.min_clearance, limit)
        travelled = np.concatenate(([0.0], np.cumsum(np.hypot(path.steps[:, 0], 0.5 * path.steps[:, 1]))))
        floor = np.where(travelled < 0.5, np.minimum(limit, path.clear[0] - 0.003), limit)
        bad = np.flatnonzero(path.clear < floor)
        return int(bad[0]) if len(bad) else -1

    def begin(self, field, start, goal, allow_reverse, moving=-1, tolerance=0.0):
        """Set up a plan from ``start`` (3,) to ``goal`` (3,); ``go_on`` then works on it."""
        allow_reverse = allow_reverse and self.settings.min_vel_x < 0.0
        self._task = (field, np.array(start, dtype=float), self.inside(field, np.asarray(goal, dtype=float)),
                      allow_reverse, moving, max(GOAL_XY, tolerance))
        self._begin_search(self._slim, SLIM_FLOOR, SLIM_TURN_FLOOR)

    def _begin_search(self, which, floor, turn_floor):
        field, start, goal, allow_reverse, moving, reach = self._task
        self._search = which
        which.begin(field, start, goal, reach, GOAL_YAW, allow_reverse, floor, moving, turn_floor)

    def go_on(self, cap):
        """Work on the plan begun: None after ``cap`` states if it goes on, else (Path or None, reason)."""
        if not self._search.expand(cap):
            return None
        field, start, goal = self._task[:3]
        found = self._search.result()
        slim = self._search is self._slim
        if found.steps is not None:
            path = self._centred(field, start, goal, found.steps)
            if self.blocked(path) < 0:
                return path, ""
        if slim and not (found.steps is None and found.exhausted):
            self._begin_search(self._true, self.settings.min_clearance, self.settings.turn_clearance + TURN_SLACK)
            return None
        if found.steps is None and not found.exhausted:
            return None, "no path within %d states" % found.expansions
        return None, "no way through for a chair of %.2f m" % self.footprint.width

    def plan(self, field, start, goal, allow_reverse, moving=-1, tolerance=0.0):
        """(Path or None, reason) from ``start`` (3,) to ``goal`` (3,), at once."""
        self.begin(field, start, goal, allow_reverse, moving, tolerance)
        while True:
            done = self.go_on(self.settings.max_expansions)
            if done is not None:
                return done

    def _centred(self, field, start, goal, steps):
        """The searched path refined: with its small turns rounded, or as it was, or not at all if that is clearest."""
        best = None
        kinds = kinds_of(steps)
        clear = self.clearance(field, rolled(start, steps))
        for shape in (rounded(steps, kinds, clear), (steps, kinds)):
            steps_, kinds_ = resampled(*shape)
            targets = rolled(start, steps_)
            targets[-1] = goal
            path = self.refine(field, start, steps_, kinds_, targets, 25)
            if self.blocked(path, COMFORTABLE) < 0:
                return path
            if best is None or path.clear.min() > best.clear.min() + 0.01:
                best = path
        if self.blocked(best) >= 0:
            poses = rolled(start, steps_)
            raw = Path(steps_, poses, kinds_, self.clearance(field, poses))
            best = raw if self.blocked(raw) < 0 else best
        return best

    def inside(self, field, goal):
        """The goal (3,), or the point of the way to it that lies well inside the window."""
        rows, cols = field.distance.shape
        res = field.frame[2]
        low = field.frame[:2] + 0.2
        high = field.frame[:2] + np.array([cols, rows]) * res - 0.2
        if np.all(goal[:2] >= low) and np.all(goal[:2] <= high):
            return goal
        middle = (low + high) / 2.0
        way = goal[:2] - middle
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(way > 0, (high - middle) / way, np.where(way < 0, (low - middle) / way, np.inf))
        point = middle + way * min(1.0, float(np.min(reach)))
        return np.array([point[0], point[1], np.arctan2(way[1], way[0])])


def rolled(start, steps):
    """Poses (n + 1, 3) of steps (n, 2) driven from ``start``."""
    poses = np.empty((len(steps) + 1, 3))
    refinement._roll(np.asarray(start, dtype=float), np.ascontiguousarray(steps, dtype=float), poses)
    return poses


def rounded(steps, kinds, clear=None):
    """Steps and kinds with small turns on the spot between two drives laid into the steps beside them.

    The chair then need not stop for them; refinement finds the bend. Not before what is narrow (``clear`` (n + 1,)
    of the poses): there the turn is what makes the chair square in time.
    """
    steps, keep = steps.copy(), np.ones(len(kinds), bool)
    first = 0
    while first < len(kinds):
        last = first
        while last < len(kinds) and kinds[last] == kinds[first]:
            last += 1
        before, after = kinds[first - 1] if first else 0, kinds[last] if last < len(kinds) else 0
        turn = float(np.sum(steps[first:last, 1]))
        soon = np.cumsum(np.abs(steps[last:, 0])) < ROUND_BEFORE
        roomy = clear is None or np.min(clear[last:][:np.sum(soon) + 1], initial=np.inf) > ROOM
        if kinds[first] == 0 and (abs(turn) < 0.03 or (before == after != 0 and abs(turn) < ROUND and roomy)):
            near = [k for k in range(first - 4, last + 4)
                    if 0 <= k < len(kinds) and kinds[k] != 0 and kinds[k] in (before, after)]
            if near:
                keep[first:last] = False
                steps[near, 1] += turn / len(near)
        first = last
    return steps[keep], kinds[keep]


def resampled(steps, kinds):
    """Steps and kinds of the same way in steps of even length: refinement must not stretch a step across a gap."""
    new_steps, new_kinds = [], []
    first = 0
    while first < len(kinds):
        last = first
        while last < len(kinds) and kinds[last] == kinds[first]:
            last += 1
        run, kind = steps[first:last], kinds[first]
        size = np.abs(run[:, 0]) if kind else np.abs(run[:, 1])
        total = float(np.sum(size))
        n = max(1, int(np.ceil(total / (STEP if kind else STEP_TURN))))
        along = np.concatenate(([0.0], np.cumsum(size)))
        at = np.linspace(0.0, total, n + 1)
        columns = [np.diff(np.interp(at, along, np.concatenate(([0.0], np.cumsum(run[:, k]))))) for k in (0, 1)]
        new_steps.append(np.stack(columns, axis=1))
        new_kinds.append(np.full(n, kind))
        first = last
    return np.ascontiguousarray(np.concatenate(new_steps)), np.concatenate(new_kinds)
