"""The path that is driven: kept as long as it serves, and replaced only by one that is clearly better.

The path found by the search stays the reference: each cycle bends what remains of it for the present costmap and
pose, but never the bent one further, which would wander.
"""
import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.planning import following
from wheelchair_shared_control.planning.planner import Path, resampled, rolled

SLICE = 500  # states expanded in one cycle
STRAYED, TURNED = 0.25, 0.6  # m, rad beside the path: it is not being followed any more
BETTER, GAIN = 0.85, 0.5  # 1, s: a new path must cost less than so much of the old one, less this
BACK_TIME, BACKED = 5.0, 0.04  # s for a way back, m that may remain of it
FACED = 0.04  # rad: a turn on the spot with no more left is done
BENDS = 6  # iterations of refinement a cycle


class KeptPath:
    """Searches, keeps and bends the path to one goal at a time; ``planner``: a Planner."""

    def __init__(self, planner, frequency):
        self.planner, self._period = planner, 1.0 / frequency
        self.forget()

    def forget(self):
        """No path, and no search under way."""
        self._back_until, self._no_path = None, ""
        self._searching, self._searched_at = False, -np.inf
        self.turn_radius = 0.0  # m: of the chair's turns on the spot
        self.drop()
        self._goal = None

    def drop(self):
        """Give up the path; the next search finds another."""
        self._path, self._step = None, 0

    @property
    def empty(self):
        """Whether there is no path."""
        return self._path is None

    def stop_searching(self):
        """Leave a search that is under way: the planner was used for something else."""
        self._searching = False

    def search_now(self):
        """Search in the next cycle, not only when it is time again."""
        self._searched_at = -np.inf

    def kept(self):
        """What ``resume`` takes after ``forget``: the way to an old goal is driven on until there is one to the new."""
        return self._path, self._step, self._goal

    def resume(self, kept):
        """Drive on what ``kept`` gave."""
        self._path, self._step, self._goal = kept

    def go_back(self, field, pose, steps, now):
        """Drive ``steps`` (n, 2) straight back from ``pose`` (3,) before anything is searched again."""
        poses = rolled(pose, steps)
        self._path = Path(steps, poses, np.full(len(steps), -1), self.planner.clearance(field, poses))
        self._step, self._goal = 0, poses[-1]
        self._back_until, self._searching = now + BACK_TIME, False

    def update(self, now, field, anchor, goal, allow_reverse, moving):
        """(the way from ``anchor`` (3,) on, "") along the path that is kept or newly found, or (None, reason)."""
        way, blocked = None, True
        outdated = self._goal is not None and not np.array_equal(self._goal, goal)
        if self._path is not None:
            way, strayed = self._remaining(field, anchor)
            blocked = self._blocked(way, strayed) or (not allow_reverse and bool(np.any(way.kinds < 0)))
            if self._goes_back(now, way, blocked):
                return way, ""
            if self._path is None:
                way, blocked = None, True
        period = 0.2 if blocked else self._period
        if not self._searching and now - self._searched_at >= period:
            self._searched_at, self._searching = now, True
            self.planner.begin(field, anchor, goal, allow_reverse, moving)
        if self._searching:
            done = self.planner.go_on(SLICE)
            if done is not None:
                self._searching = False
                new, self._no_path = done
                if new is not None:
                    way, blocked = self._better(field, anchor, new, goal, way, blocked or outdated)
                elif blocked or outdated:
                    self._path = way = None
        if way is None:
            return None, self._no_path or "looking for a path"
        return way, ""

    def _goes_back(self, now, way, blocked):
        """Whether a way back is still being driven; at its end the path to the goal is looked for."""
        if self._back_until is None:
            return False
        if not blocked and now < self._back_until and np.hypot(*(way.poses[0, :2] - self._goal[:2])) > BACKED:
            return True
        self._back_until, self._path, self._searched_at = None, None, -np.inf
        return False

    def _blocked(self, way, strayed):
        return self.planner.blocked(way, 0.0) >= 0 or strayed[0] > STRAYED or strayed[1] > TURNED

    def _better(self, field, anchor, new, goal, way, blocked):
        """The new path, or the one that is driven where the new one is not clearly better."""
        old = self.kept()
        self._path, self._step, self._goal = new, 0, goal
        new_way, strayed = self._remaining(field, anchor)
        new_blocked = self._blocked(new_way, strayed)
        old_price = np.inf if blocked else self.planner.price(field, anchor, way.steps, way.kinds)
        new_price = self.planner.price(field, anchor, new_way.steps, new_way.kinds)
        if new_price < BETTER * old_price - GAIN and not (new_blocked and not blocked):
            return new_way, new_blocked
        self.resume(old)
        return way, blocked

    def _remaining(self, field, anchor):
        """What is left of the path, bent to start at ``anchor``; and how far that is from the path ([m], [rad])."""
        path = self._path
        step, part = following.project(anchor, path.poses, path.kinds, self._step, self.turn_radius)
        self._step = step
        on_path = path.poses[step] + part * (path.poses[step + 1] - path.poses[step])
        steps = path.steps[step:].copy()
        steps[0] *= 1.0 - part
        steps, kinds = resampled(steps, path.kinds[step:])
        targets = rolled(on_path, steps)
        targets[-1] = self.planner.inside(field, self._goal)
        # The way back is straight: it was looked at as it is.
        bends = 0 if self._back_until is not None else BENDS
        way = self.planner.refine(field, anchor, steps, kinds, targets, bends)
        n = int(np.argmax(way.kinds != 0))
        if n and abs(np.sum(way.steps[:n, 1])) < FACED:
            # The rest of a turn is not worth standing for: the drive that follows steers it out.
            self._step += int(np.argmax(path.kinds[step:] != 0))
            targets = targets[n:]
            way = self.planner.refine(field, anchor, steps[n:], kinds[n:], targets, BENDS)
        return way, (np.hypot(*(anchor[:2] - on_path[:2])), abs(se2.wrap_angle(anchor[2] - on_path[2])))
