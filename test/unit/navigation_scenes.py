"""A drawn world, its perfect costmap, and a chair with dead time and lag: navigation without sensors."""
from collections import deque

import numpy as np

from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control import parameters, se2
from wheelchair_shared_control.costmap import CostmapSnapshot
from wheelchair_shared_control.distance_transform import distance_transform
from wheelchair_shared_control.planning.navigation import ACTIVE, Navigator
from wheelchair_shared_control.values import Odometry, Twist

SETTINGS = parameters.load("move_base")
CHAIR = footprints.from_settings(SETTINGS.wheelchair)
RESOLUTION, CELLS = 0.025, 240
DT = 0.05


def line(x0, y0, x1, y1):
    """Points (n, 2) every centimetre from one end to the other."""
    n = int(np.hypot(x1 - x0, y1 - y0) / 0.01) + 2
    return np.stack((np.linspace(x0, x1, n), np.linspace(y0, y1, n)), axis=1)


def box(x0, x1, y0, y1):
    """The outline of a box."""
    return np.concatenate((line(x0, y0, x1, y0), line(x1, y0, x1, y1), line(x1, y1, x0, y1), line(x0, y1, x0, y0)))


def door(width):
    """A wall 0.12 m thick across x = 0 with a gap about y = 0."""
    half = width / 2.0
    return np.concatenate((box(-0.06, 0.06, half, 4.0), box(-0.06, 0.06, -4.0, -half)))


def snapshot(points, pose, stamp, known=True):
    """The costmap of walls (n, 2) about ``pose``, all of its ground known or unknown."""
    origin = np.floor((np.asarray(pose)[:2] - 0.5 * CELLS * RESOLUTION) / RESOLUTION) * RESOLUTION
    lethal = np.zeros((CELLS, CELLS), bool)
    index = np.floor((points - origin) / RESOLUTION).astype(int)
    inside = np.all((index >= 0) & (index < CELLS), axis=1)
    lethal[index[inside, 1], index[inside, 0]] = True
    distance = np.empty((CELLS, CELLS), np.float32)
    nearest = np.empty((CELLS, CELLS, 2), np.int16)
    distance_transform(lethal, RESOLUTION, SETTINGS.local_costmap.distance_cap, distance, nearest)
    cost = np.where(lethal, 254, 0).astype(np.uint8)
    return CostmapSnapshot(cost, distance, np.full(lethal.shape, known), RESOLUTION, tuple(origin), stamp)


class Drive:
    """A navigator and the chair that obeys it; ``share``: of each command so much is carried out."""

    def __init__(self, walls, start, settings=SETTINGS, share=1.0):
        self.walls, self.pose, self.share = np.asarray(walls), np.array(start, dtype=float), share
        self.navigator = Navigator(settings)
        # the window stays where it was: nothing moves here but the chair
        self._seen = snapshot(self.walls, self.pose, 0.0)
        self.twist, self.now, self.least = Twist(0.0, 0.0), 0.0, np.inf
        self._pending = deque([(0.0, 0.0)] * int(round(settings.wheelchair.actuation.dead_time / 0.01)))
        self._lag = settings.wheelchair.actuation.lag
        self.decisions, self.poses = [], []

    def tick(self, user=None, stamp=None):
        """One control cycle; returns its Decision."""
        seen = self._seen._replace(stamp=self.now if stamp is None else stamp)
        decision = self.navigator.update(self.now, Odometry(self.now, self.pose.copy(), self.twist), seen, user)
        command = decision.command or (0.0, 0.0)
        v, w = self.twist
        for _ in range(5):
            self._pending.append((command[0] * self.share, command[1] * self.share))
            target = self._pending.popleft()
            gain = 1.0 - np.exp(-0.01 / self._lag)
            v, w = v + (target[0] - v) * gain, w + (target[1] - w) * gain
            self.pose = se2.integrate(self.pose, v, w, 0.01)
        self.twist, self.now = Twist(v, w), self.now + DT
        if len(self.walls) and len(self.poses) % 2 == 0:
            self.least = min(self.least, footprints.distance_to_points(CHAIR, self.pose, self.walls).min())
        self.decisions.append(decision)
        self.poses.append(self.pose)
        return decision

    def to(self, goal, limit=40.0, **options):
        """Drive to ``goal`` until the navigator is no longer active; its last Decision."""
        self.navigator.set_goal(goal, self.now)
        end = self.now + limit
        decision = self.tick(**options)
        while decision.status == ACTIVE and self.now < end:
            decision = self.tick(**options)
        return decision
