"""Walls beside the chair, as the front and the middle ranger of a side read them on the chair's way.

The guard takes them to go on straight ahead (doc/guard.md). Two readings are a wall only where what the front
ranger read between the two lies on one line with them: a hallway's wall and a jamb before it are two things.
"""
import math
from collections import deque

import numpy as np

from wheelchair_shared_control.values import RANGERS

REMEMBERED = 1.0  # s: so long the line of a wall beside the chair is kept after it was read
SPACED = 0.1  # s between two lines that are kept, at most KEPT of them
KEPT = 10
TOGETHER = 0.3  # s: so old may the reading of one ranger be when the other's is taken for the same wall
# What a ranger read on its way is kept as PLACES; while it has moved less than this [m, rad], readings are averaged.
APART, TURNED = 0.02, 0.03
PLACES = 50
MEAN_OF = 20  # readings
# m: what was read of one wall is not further off its line than this, root mean square, its two ends twice as far
FLAT = 0.012
ASIDE = 0.5  # m: what was read further off is another thing, seen through an opening
PAIRS = [(RANGERS.index(side + "_front"), RANGERS.index(side + "_middle")) for side in ("left", "right")]


class WallsBeside:
    """Takes the rangers' echoes one by one, and keeps the lines of the last second."""

    def __init__(self):
        self._trails = [_Trail() for _ in RANGERS]
        self._walls = [deque(maxlen=KEPT) for _ in PAIRS]  # (stamp, (4,)) of each side
        self._joined = [-math.inf for _ in PAIRS]  # stamp of the front ranger's reading that was joined last

    def read(self, index, point, stamp, sensor, yaw):
        """Ranger ``index`` of RANGERS read ``point`` (2,) at ``stamp`` [s] from ``sensor`` (2,), [odom, m]; ``yaw`` is
        the chair's heading [rad]. Stamps of a ranger rise."""
        self._trails[index].add(point, stamp, sensor, yaw)

    def join(self):
        """After the readings of a moment: keep the line through what each side read now and on the way.

        Where a front ranger's new reading makes no line, the others of its side are forgotten.
        """
        for side, (front, middle) in enumerate(PAIRS):
            stamp = self._trails[front].stamp
            if not stamp > self._joined[side]:
                continue
            self._joined[side] = stamp
            begin, end = self._trails[middle].newest(stamp), self._trails[front].newest(stamp)
            if begin is None or end is None:
                continue
            wall, kept = _line(begin, end, self._trails[front].means()), self._walls[side]
            if wall is None:
                kept.clear()
            elif len(kept) > 1 and kept[-1][0] - kept[-2][0] < SPACED:
                kept[-1] = (stamp, wall)
            else:
                kept.append((stamp, wall))

    def walls(self, now):
        """Walls (m, 4) in odom [m], each from about the middle ranger's place (x, y) to the front ranger's.

        All lines of REMEMBERED before ``now`` [s] count: a reading may be missed, and of lines that err by millimetres
        the nearest must decide.
        """
        seen = [wall for side in self._walls for stamp, wall in side if now - stamp <= REMEMBERED]
        return np.array(seen).reshape(-1, 4)


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

    @property
    def stamp(self):
        """Of the newest reading [s]; -inf before the first."""
        return self._places[-1][3] if self._places else -math.inf

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
