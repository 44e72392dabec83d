"""Rangers as obstacles: where in odom the six readings stand, and how old each is."""
import math
from collections import deque

import numpy as np

from wheelchair_shared_control.values import RANGERS

REMEMBERED = 1.0  # s: so long the line of a wall beside the chair is kept after it was read
SPACED = 0.1  # s between two lines that are kept, at most KEPT of them
KEPT = 10
TOGETHER = 0.3  # s: so old may the reading of one ranger be when the other's is taken for the same wall
JUMP = 0.5  # m between two readings' poses: the chair was set elsewhere
# What a ranger read on its way is kept as PLACES; while it has moved less than this [m, rad], readings are averaged.
APART, TURNED = 0.02, 0.03
PLACES = 50
MEAN_OF = 20  # readings
# m: what was read of one wall is not further off its line than this, root mean square, its two ends twice as far
FLAT = 0.012
ASIDE = 0.5  # m: what was read further off is another thing, seen through an opening


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
        self._pose = None
        self._forget_walls()

    def update(self, ranges, pose, latest=math.inf):
        """Take new readings; ``pose`` (3,) is that of ``base_link`` in odom at their stamps.

        ``ranges.stamp`` is one stamp or six. A reading stamped after ``latest`` [s] is not taken: it would count as
        fresh for ever, and every later one as older.
        """
        stamps = np.broadcast_to(np.asarray(ranges.stamp, dtype=float), (6,))
        values = np.asarray(ranges.values, dtype=float)
        self._ahead = np.where(stamps > latest, stamps, np.nan)
        if self._pose is not None and math.hypot(pose[0] - self._pose[0], pose[1] - self._pose[1]) > JUMP:
            self._forget_walls()
        self._pose = np.array(pose, dtype=float)
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
            if math.isfinite(value):
                sensor = (pose[0] + cos * self._x[i] - sin * self._y[i], pose[1] + sin * self._x[i] + cos * self._y[i])
                self._trails[i].add(self._points[i, self._angles.size // 2], stamps[i], sensor, pose[2])
        for side, (front, middle) in enumerate(self._pairs):
            if self._taken[front] > before[front] and self._echo[front] and self._valid[front] == self._taken[front]:
                self._note_wall(side, self._trails[front], self._trails[middle], self._taken[front])

    def oldest(self, now):
        """Name and age [s] of the ranger whose last valid reading is oldest; negative if its clock is ahead."""
        i = int(np.argmin(self._valid))
        return RANGERS[i], now - (self._valid[i] if math.isnan(self._ahead[i]) else self._ahead[i])

    def walls(self, now=None):
        """Walls (m, 4) beside the chair in odom [m], as front and middle ranger of a side saw them.

        Each leads from about the middle ranger's place (x, y) to the front ranger's, on the line through all that the
        front ranger read between the two on its way. If that is on no line, as where the one reads a hallway's wall and
        the other a jamb or a pillar before it, there is none. All lines of REMEMBERED before ``now`` (the newest
        message) count: a reading may be missed, and of lines that err by millimetres the nearest must decide.
        """
        now = self._taken.max() if now is None else now
        seen = [wall for side in self._walls for stamp, wall in side if now - stamp <= REMEMBERED]
        return np.array(seen).reshape(-1, 4)

    def _forget_walls(self):
        self._trails = [_Trail() for _ in RANGERS]
        self._walls = [deque(maxlen=KEPT) for _ in self._pairs]  # (stamp, (4,)) of each side

    def _note_wall(self, side, front, middle, stamp):
        """Keep the line through what a side's rangers read now and on the way; if that is none, forget the others."""
        begin, end = middle.newest(stamp), front.newest(stamp)
        if begin is None or end is None:
            return
        wall, kept = _line(begin, end, front.means()), self._walls[side]
        if wall is None:
            kept.clear()
        elif len(kept) > 1 and kept[-1][0] - kept[-2][0] < SPACED:
            kept[-1] = (stamp, wall)
        else:
            kept.append((stamp, wall))

    def points(self):
        """Points (n, 2) in odom [m] of the readings within range."""
        points = self._points.reshape(-1, 2)
        return points[~np.isnan(points[:, 0])]


class _Trail:
    """The places that a ranger read on its way, the newest last; what it reads again, resting or not, is averaged."""

    def __init__(self):
        self._places = deque(maxlen=PLACES)  # [first reading (2,), mean of all (2,), their number, newest stamp]
        self._sensor, self._yaw = None, 0.0  # where the newest place was first read from

    def add(self, point, stamp, sensor, yaw):
        """Take in a reading (2,) at ``stamp`` [s] of a ranger at ``sensor`` (2,), the chair's heading ``yaw`` [rad]."""
        point = np.array(point)
        if not self._rests(point, sensor, yaw):
            self._sensor, self._yaw = sensor, yaw
            older = list(self._places)[:-1]
            again = [i for i, place in enumerate(older) if math.dist(point, place[0]) < APART]
            if again:  # a chair that turns to and fro does not lose what it read before
                del self._places[again[-1]]
                self._places.append(older[again[-1]])
            else:
                self._places.append([point, point, 0, stamp])
        place = self._places[-1]
        place[2] = min(place[2] + 1, MEAN_OF)
        place[1] = place[1] + (point - place[1]) / place[2]
        place[3] = stamp

    def _rests(self, point, sensor, yaw):
        """Whether a reading is the newest place's, once more. Something else that came before the ranger is not."""
        return (
            self._sensor is not None and math.dist(sensor, self._sensor) < APART
            and abs(math.remainder(yaw - self._yaw, 2.0 * math.pi)) < TURNED
            and math.dist(point, self._places[-1][1]) < 3.0 * FLAT
        )

    def newest(self, now):
        """The newest place (2,), None where it was not read within TOGETHER."""
        if not self._places or abs(now - self._places[-1][3]) > TOGETHER:
            return None
        return self._places[-1][1]

    def means(self):
        """All places (n, 2)."""
        return np.array([place[1] for place in self._places])


def _line(begin, end, places):
    """The wall (4,) through ``begin``, ``end`` (2,) and those of ``places`` (n, 2) between; None if that is no line.

    Between is not less than APART from either, for ``end`` is one of the places.
    """
    way = end - begin
    length = math.hypot(way[0], way[1])
    if not length > 2.0 * APART:
        return None
    way /= length
    off = places - begin
    along, aside = off @ way, off @ np.array((-way[1], way[0]))
    between = (along > APART) & (along < length - APART) & (np.abs(aside) < ASIDE)
    points = np.concatenate(((begin, end), off[between] + begin))
    centre = points.mean(axis=0)
    (xx, xy), (_, yy) = (points - centre).T @ (points - centre) / len(points)
    if 0.5 * (xx + yy) - math.hypot(0.5 * (xx - yy), xy) > FLAT**2:  # the lesser eigenvalue: variance off the line
        return None
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    line = np.array((math.cos(angle), math.sin(angle)))
    ends = np.array((begin, end))
    on_line = centre + np.outer((ends - centre) @ line, line)
    if np.hypot(*(ends - on_line).T).max() > 2.0 * FLAT:
        return None
    return on_line.ravel()
