"""Rangers as obstacles: where in odom the six readings stand, how old each is, and what walls they tell of."""
import math

import numpy as np

from wheelchair_shared_control.values import RANGERS
from wheelchair_shared_control.walls_beside import WallsBeside

JUMP = 0.5  # m between two readings' poses: the chair was set elsewhere


class RangePoints:
    """Keeps the last valid reading of each ranger as points in odom (REP 117).

    +Inf clears, NaN says nothing (the last valid reading ages), -Inf is an obstacle at the minimum along the
    beam. ``settings`` are the wheelchair's.
    """

    def __init__(self, settings):
        rangers = settings.rangers
        xs = {"front": rangers.x_front, "middle": rangers.x_middle, "rear": rangers.x_rear}
        self._x = np.array([xs[name.split("_")[1]] for name in RANGERS])
        self._side = np.array([1.0 if name.startswith("left") else -1.0 for name in RANGERS])
        self._y = rangers.y * self._side
        self._minimum = rangers.min_range
        half = 0.5 * rangers.field_of_view
        self._angles = np.array([-half, 0.0, half])
        self.reset()

    def reset(self):
        """Forget all readings."""
        self._taken = np.full(6, -np.inf)  # stamp of the last message used
        self._valid = np.full(6, -np.inf)  # stamp of the last valid reading
        self._points = np.full((6, len(self._angles), 2), np.nan)
        self._ahead = np.full(6, np.nan)  # stamp of the last message, where it was from the future
        self._pose = None
        self._beside = WallsBeside()

    def update(self, ranges, pose, latest=math.inf):
        """Take new readings; ``pose`` (3,) is that of ``base_link`` in odom at their stamps.

        ``ranges.stamp`` is one stamp or six. A reading stamped after ``latest`` [s] is not taken: it would count as
        fresh for ever, and every later one as older.
        """
        stamps = np.broadcast_to(np.asarray(ranges.stamp, dtype=float), (6,))
        values = np.asarray(ranges.values, dtype=float)
        self._ahead = np.where(stamps > latest, stamps, np.nan)
        if self._pose is not None and math.hypot(pose[0] - self._pose[0], pose[1] - self._pose[1]) > JUMP:
            self._beside = WallsBeside()
        self._pose = np.array(pose, dtype=float)
        for i in range(6):
            if not stamps[i] > self._taken[i] or stamps[i] > latest:
                continue
            self._taken[i] = stamps[i]
            value = values[i]
            if math.isnan(value):
                continue
            self._valid[i] = stamps[i]
            if value == math.inf:
                self._points[i] = np.nan
                continue
            beam = max(value, self._minimum)
            x = self._x[i] + beam * np.sin(self._angles)
            y = self._y[i] + self._side[i] * beam * np.cos(self._angles)
            cos, sin = math.cos(pose[2]), math.sin(pose[2])
            self._points[i, :, 0] = pose[0] + cos * x - sin * y
            self._points[i, :, 1] = pose[1] + sin * x + cos * y
            if math.isfinite(value):
                sensor = (pose[0] + cos * self._x[i] - sin * self._y[i], pose[1] + sin * self._x[i] + cos * self._y[i])
                self._beside.read(i, self._points[i, self._angles.size // 2], stamps[i], sensor, pose[2])
        self._beside.join()

    def oldest(self, now):
        """Name and age [s] of the ranger whose last valid reading is oldest; negative if its clock is ahead."""
        i = int(np.argmin(self._valid))
        return RANGERS[i], now - (self._valid[i] if math.isnan(self._ahead[i]) else self._ahead[i])

    def walls(self, now=None):
        """`WallsBeside.walls` at ``now`` [s], by default the stamp of the newest message."""
        return self._beside.walls(self._taken.max() if now is None else now)

    def points(self, since=-math.inf):
        """Points (n, 2) in odom [m] of the readings within range, of those rangers that were heard after ``since``."""
        points = self._points[self._valid >= since].reshape(-1, 2)
        return points[~np.isnan(points[:, 0])]
