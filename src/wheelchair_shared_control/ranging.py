"""Rangers as obstacles: where in odom the six readings stand, and how old each is."""
import math
from collections import deque

import numpy as np

from wheelchair_shared_control.values import RANGERS

REMEMBERED = 1.0  # s: so long a wall beside the chair is known of after it was read
SPACED = 0.1  # s between two readings of it that are kept, at most KEPT of them
KEPT = 10
TOGETHER = 0.3  # s between the readings of front and middle ranger that are one wall's


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
        self._pairs = [(RANGERS.index(side + "_front"), RANGERS.index(side + "_middle")) for side in ("left", "right")]
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
        self._echo = np.zeros(6, dtype=bool)  # whether the last valid reading is a distance
        self._walls = [deque(maxlen=KEPT) for _ in self._pairs]  # (stamp, (4,)) of each side

    def update(self, ranges, pose, latest=math.inf):
        """Take new readings; ``pose`` (3,) is that of ``base_link`` in odom at their stamps.

        ``ranges.stamp`` is one stamp or six. A reading stamped after ``latest`` [s] is not taken: it would count as
        fresh for ever, and every later one as older.
        """
        stamps = np.broadcast_to(np.asarray(ranges.stamp, dtype=float), (6,))
        values = np.asarray(ranges.values, dtype=float)
        self._ahead = np.where(stamps > latest, stamps, np.nan)
        before = self._taken.copy()
        for i in range(6):
            if not stamps[i] > self._taken[i] or stamps[i] > latest:
                continue
            self._taken[i] = stamps[i]
            value = values[i]
            if math.isnan(value):
                continue
            self._valid[i] = stamps[i]
            self._echo[i] = math.isfinite(value)
            if value == math.inf:
                self._points[i] = np.nan
                continue
            beam = max(value, self._minimum)
            x = self._x[i] + beam * np.sin(self._angles)
            y = self._y[i] + self._side[i] * beam * np.cos(self._angles)
            cos, sin = math.cos(pose[2]), math.sin(pose[2])
            self._points[i, :, 0] = pose[0] + cos * x - sin * y
            self._points[i, :, 1] = pose[1] + sin * x + cos * y
        for side, (front, middle) in enumerate(self._pairs):
            if self._taken[front] > before[front]:
                self._note_wall(side, front, middle)

    def oldest(self, now):
        """Name and age [s] of the ranger whose last valid reading is oldest; negative if its clock is ahead."""
        i = int(np.argmin(self._valid))
        return RANGERS[i], now - (self._valid[i] if math.isnan(self._ahead[i]) else self._ahead[i])

    def walls(self):
        """Walls (m, 4) beside the chair in odom [m], as front and middle rangers saw them within REMEMBERED.

        Each leads from a middle ranger's reading (x, y) to the front ranger's of that side. A reading may be missed
        now and then, or err; the wall that it belongs to does not go for that.
        """
        newest = self._taken.max()
        seen = [wall for side in self._walls for stamp, wall in side if newest - stamp <= REMEMBERED]
        return np.array(seen).reshape(-1, 4)

    def _note_wall(self, side, front, middle):
        """Keep the wall through the newest readings of a side's front and middle rangers."""
        if abs(self._valid[front] - self._valid[middle]) > TOGETHER or not self._echo[[front, middle]].all():
            return
        centre = self._angles.size // 2
        wall = (self._taken[front], np.concatenate((self._points[middle, centre], self._points[front, centre])))
        kept = self._walls[side]
        if len(kept) > 1 and kept[-1][0] - kept[-2][0] < SPACED:
            kept[-1] = wall
        else:
            kept.append(wall)

    def points(self):
        """Points (n, 2) in odom [m] of the readings within range."""
        points = self._points.reshape(-1, 2)
        return points[~np.isnan(points[:, 0])]
