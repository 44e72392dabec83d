"""Obstacles that move: lethal cells of the costmap grouped into blobs, and the velocity of each blob.

What a thing that stands shows changes as the chair drives: cells are added where more of it comes into view, so
that its middle seems to move. A blob has moved only where its leading and its trailing edge both went the same way.
Behind a walker cells stay occupied for a while, so that the trailing edge may lag: it is the leading one that counts.
"""
from collections import deque
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from wheelchair_shared_control.grid import LETHAL

NOTHING = np.empty((0, 2))
LARGEST = 1.3  # m: extent of a person and their trail; larger blobs are walls and furniture
LAG = 0.3  # of the leading edge's way: the least that the trailing edge must have gone
FEWEST = 3  # cells of a blob
NEAREST = 0.35  # m between where a blob was expected and where it is
BASELINE = (0.35, 0.8)  # s over which edges are compared
SLOWEST = 0.15  # m/s: slower is noise of cells and odometry
FASTEST = 2.0  # m/s: faster is a mismatch
CONFIRMED = 2  # grids in a row that show motion before it is believed
REMEMBERED = 0.5  # s that a moving blob is moved on unseen


class Blob(NamedTuple):
    """Cells (n, 2) [odom, m], their middle (2,), and their lowest and highest x, y: edges (2, 2)."""

    points: np.ndarray
    middle: np.ndarray
    edges: np.ndarray


class Track:
    """One blob followed through the grids."""

    def __init__(self, stamp, blob):
        self.history = deque(maxlen=12)
        self.velocity = np.zeros(2)
        self.seen_moving = 0
        self.take(stamp, blob)

    def expected(self, stamp):
        """Middle (2,) where the blob should be now."""
        return self.blob.middle + (self.velocity if self.moves else 0.0) * (stamp - self.stamp)

    @property
    def moves(self):
        """Whether the motion is believed."""
        return self.seen_moving >= CONFIRMED

    def take(self, stamp, blob):
        """Follow the blob to where it is now."""
        self.stamp, self.blob = stamp, blob
        self.history.append((stamp, blob.edges))
        velocity = self._measured()
        if velocity is None:
            return
        if SLOWEST <= float(np.hypot(*velocity)) <= FASTEST:
            self.velocity = velocity if not self.seen_moving else 0.5 * (self.velocity + velocity)
            self.seen_moving += 1
        else:
            self.seen_moving = 0

    def _measured(self):
        """Velocity (2,) [m/s] over the baseline, or None while the blob is too young."""
        for stamp, edges in self.history:
            span = self.stamp - stamp
            if span < BASELINE[0]:
                return None
            if span <= BASELINE[1]:
                shift = self.blob.edges - edges
                together = (shift[0] * shift[1]) > 0.0
                order = np.abs(shift[0]) < np.abs(shift[1])
                less, more = np.where(order, shift[0], shift[1]), np.where(order, shift[1], shift[0])
                # what grows or shrinks on one side only has not moved; what lags too much moves as its laggard
                moved = np.where(np.abs(less) >= LAG * np.abs(more), more, less)
                return np.where(together, moved, 0.0) / span
        return None


class MovingCells:
    """Follows blobs from grid to grid.

    After ``update``: ``points`` (n, 2) of the moving blobs in odom [m], their ``velocities`` (n, 2) [m/s], and the
    ``stamp`` [s] to which both refer.
    """

    def __init__(self):
        self.reset()

    def reset(self):
        """Forget all grids."""
        self.points, self.velocities, self.stamp = NOTHING, NOTHING, -np.inf
        self._tracks = []

    def update(self, grid):
        """Take a grid; one that was taken before, or an older one, is passed over."""
        if not grid.stamp > self.stamp:
            return
        self.stamp = grid.stamp
        blobs = find_blobs(grid)
        tracks = []
        free = list(range(len(blobs)))
        # those known to move choose first
        for track in sorted(self._tracks, key=lambda t: -t.seen_moving):
            expected = track.expected(grid.stamp)
            best, distance = None, NEAREST
            for index in free:
                away = float(np.hypot(*(blobs[index].middle - expected)))
                if away < distance:
                    best, distance = index, away
            if best is not None:
                free.remove(best)
                track.take(grid.stamp, blobs[best])
                tracks.append(track)
            elif track.moves and grid.stamp - track.stamp < REMEMBERED:
                tracks.append(track)
        tracks += [Track(grid.stamp, blobs[index]) for index in free]
        self._tracks = tracks
        moving = [track for track in tracks if track.moves]
        if not moving:
            self.points, self.velocities = NOTHING, NOTHING
            return
        self.points = np.concatenate(
            [track.blob.points + track.velocity * (grid.stamp - track.stamp) for track in moving]
        )
        self.velocities = np.concatenate([np.tile(track.velocity, (len(track.blob.points), 1)) for track in moving])


def find_blobs(grid):
    """Groups of touching lethal cells no larger than a person: list of ``Blob``."""
    labels, count = ndimage.label(grid.cells == LETHAL, structure=np.ones((3, 3)))
    largest = LARGEST / grid.resolution
    blobs = []
    for index, box in enumerate(ndimage.find_objects(labels, count), start=1):
        height, width = box[0].stop - box[0].start, box[1].stop - box[1].start
        if max(height, width) > largest or height * width < FEWEST:
            continue
        rows, columns = np.nonzero(labels[box] == index)
        if len(rows) < FEWEST:
            continue
        cells = np.column_stack((columns + box[1].start + 0.5, rows + box[0].start + 0.5))
        points = cells * grid.resolution + np.asarray(grid.origin)
        edges = np.stack((points.min(axis=0), points.max(axis=0)))
        blobs.append(Blob(points, points.mean(axis=0), edges))
    return blobs
