"""Obstacles that move: lethal cells of the costmap grouped into blobs, and the velocity of each blob.

What a thing that stands shows changes as the chair drives: cells are added where more of it comes into view, so
that its middle seems to move. A blob has moved only where its leading and its trailing edge both went the same way.
Behind a walker cells stay occupied for a while, so that the trailing edge may lag: it is the leading one that counts.
And what has moved stands where nothing stood: a wall that is seen in pieces, now these, now those, does not.

Two kinds of blobs are followed, each by itself: whole things, and *fronts*, the cells that were entered just now where
free ground had been seen. A walker whose trail stays marked (before an open space nothing looks through it), or who
walks along a wall, is no thing of their own, but has a front; what only comes into view was unknown, and has none.

A walker is lost to this where they pass close to a wall, which makes one blob of both, and where they come so near
that no camera sees them: their cells then stay as they were last seen. Neither means that they stand: they are moved on
for a while, and then forgotten. By then other blobs near them are other things.
"""
from collections import deque
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from wheelchair_shared_control import rectangle
from wheelchair_shared_control.grid import LETHAL, UNKNOWN, WHOLE_CELLS

NOTHING = np.empty((0, 2))
LARGEST = 1.3  # m: extent of a person and their trail; larger blobs are walls and furniture
LONGEST = 2.0  # m: the same for one who is known to walk, whose trail has grown
THIN = (0.8, 0.08)  # m: what is longer and on average thinner is a wall
SMALLEST = 0.15  # m: smaller ones are scraps of either
LAG = 0.3  # of the leading edge's way: the least that the trailing edge must have gone
FEWEST = 3  # cells of a blob
NEAREST = 0.35  # m between where a blob was expected and where it is
BASELINE = (0.35, 0.8)  # s over which edges are compared
SLOWEST = 0.15  # m/s: slower is noise of cells and odometry
FASTEST = 2.0  # m/s: faster is a mismatch
BRISK = 1.0  # m/s: an edge of a walker that went faster jumped
CONFIRMED = 2  # grids in a row that show motion before it is believed
STANDS = 3  # grids in a row without motion before a walker is believed to stand
REMEMBERED = 0.5  # s that a moving blob is moved on unseen
LOST = 2.0  # s that a walker is moved on where something says that they may still walk
WALKED = 5  # grids that showed motion: what showed it less often is no walker yet
NEAR = 0.6  # m to the chair's outline: so near a depth camera sees nothing, or too little of a person
LEAVES = (0.3, 0.05)  # s, m: who comes so much further away from the chair in that time leaves it
AROUND = 0.1  # m about where a walker is expected: cells newly entered there are theirs
ENTERED = 0.01  # m2: so much of them
FRESH = 0.4  # s: a cell that was found lethal earlier is not newly entered
FRESH_SHARE = 0.12  # of a moving blob's cells: a person of 0.4 m at 0.3 m/s enters a quarter anew in that time
FREE_BEFORE = 1.0  # s: a cell that was seen free so short a time ago was free when it was entered
FRONT_AREA = 0.02  # m2: smaller fronts flicker; a person 0.4 m wide and deep at 0.3 m/s enters twice that in FRESH
FRONT_CELLS = 12  # of a front, where cells are coarse: two wide, a strip of wall that comes into view looks like one
FRONT_SMALLEST, FRONT_LARGEST = 0.15, 0.9  # m: longer ones are edges of walls that flicker or were displaced
FORGOTTEN = 3.0  # s after which a cell that was lethal counts as new again


class Blob(NamedTuple):
    """Cells (n, 2) [odom, m], their middle (2,), their lowest and highest x, y: edges (2, 2), and the share of the
    cells where nothing stood before."""

    points: np.ndarray
    middle: np.ndarray
    edges: np.ndarray
    fresh: float = 1.0


class Track:
    """One blob followed through the grids."""

    def __init__(self, stamp, blob):
        self.history = deque(maxlen=12)
        self.velocity = np.zeros(2)
        self.seen_moving = self.seen_standing = 0
        self.take(stamp, blob)

    def expected(self, stamp):
        """Middle (2,) where the blob should be now."""
        return self.blob.middle + (self.velocity if self.moves else 0.0) * (stamp - self.stamp)

    @property
    def moves(self):
        """Whether the motion is believed."""
        return self.seen_moving >= CONFIRMED

    def points(self, stamp):
        """Cells (n, 2) [m] where they should be now: those last seen, moved on."""
        return self.blob.points + self.velocity * (stamp - self.stamp)

    def box(self, stamp):
        """Lowest and highest x, y (2, 2) [m] of those cells."""
        return self.blob.edges + self.velocity * (stamp - self.stamp)

    def take(self, stamp, blob):
        """Follow the blob to where it is now."""
        self.stamp, self.blob = stamp, blob
        self.history.append((stamp, blob.edges))
        velocity = self._measured()
        if velocity is None:
            return
        if SLOWEST <= float(np.hypot(*velocity)) <= FASTEST and blob.fresh >= FRESH_SHARE and (
            self.moves or float(np.ptp(blob.edges, axis=0).max()) <= LARGEST
        ):
            self.velocity = velocity if not self.seen_moving else 0.5 * (self.velocity + velocity)
            self.seen_moving, self.seen_standing = self.seen_moving + 1, 0
            return
        self.seen_standing += 1
        if not self.moves or self.seen_standing >= STANDS:
            self.seen_moving = 0

    def _measured(self):
        """Velocity (2,) [m/s] over the baseline, or None while the blob is too young."""
        for stamp, edges in self.history:
            span = self.stamp - stamp
            if span < BASELINE[0]:
                return None
            if span <= BASELINE[1]:
                shift = self.blob.edges - edges
                order = np.abs(shift[0]) < np.abs(shift[1])
                less, more = np.where(order, shift[0], shift[1]), np.where(order, shift[1], shift[0])
                together = (shift[0] * shift[1]) > 0.0
                if self.moves:
                    # Its trail hides how far the trailing edge has come: what leads says how fast it walks. Where the
                    # trail has come off, the trailing edge has jumped.
                    more = np.where(np.abs(more) > BRISK * span, less, more)
                    return np.where(together | (np.abs(less) < 0.5 * np.abs(more)), more, 0.5 * (less + more)) / span
                # what grows or shrinks on one side only has not moved; what lags too much moves as its laggard
                moved = np.where(np.abs(less) >= LAG * np.abs(more), more, less)
                return np.where(together, moved, 0.0) / span
        return None


class MovingCells:
    """Follows blobs from grid to grid.

    After ``update``: ``points`` (n, 2) of the moving blobs in odom [m], their ``velocities`` (n, 2) [m/s], and the
    ``stamp`` [s] to which both refer. ``footprint``: the chair's outline.
    """

    def __init__(self, footprint):
        self._footprint = footprint
        self.reset()

    def reset(self):
        """Forget all grids."""
        self.points, self.velocities, self.stamp = NOTHING, NOTHING, -np.inf
        self._things, self._fronts = [], []
        self._memory = _Memory()

    def update(self, grid, pose):
        """Take a grid as the chair stands at ``pose`` (3,) in odom; one no newer than the last is passed over."""
        if not grid.stamp > self.stamp:
            return
        self.stamp = grid.stamp
        fresh, entered = self._memory.update(grid)
        self._things = self._follow(self._things, find_blobs(grid, fresh), grid, pose, fresh)
        self._fronts = self._follow(self._fronts, find_fronts(grid, entered), grid, pose, fresh)
        moving = [track for track in self._things if track.moves]
        known = [track.box(grid.stamp) for track in moving]
        for track in self._fronts:
            middle = track.expected(grid.stamp)
            if track.moves and not any((low <= middle).all() and (middle <= high).all() for low, high in known):
                moving.append(track)
        if not moving:
            self.points, self.velocities = NOTHING, NOTHING
            return
        self.points = np.concatenate([track.points(grid.stamp) for track in moving])
        self.velocities = np.concatenate([np.tile(track.velocity, (len(track.blob.points), 1)) for track in moving])

    def _follow(self, known, blobs, grid, pose, fresh):
        """The ``Track``s that continue ``known`` in this grid's ``blobs``, and new ones for what nobody continues."""
        tracks = []
        free = list(range(len(blobs)))
        # those known to move choose first
        for track in sorted(known, key=lambda t: -t.seen_moving):
            expected = track.expected(grid.stamp)
            best, distance = None, NEAREST
            missed = track.moves and grid.stamp - track.stamp > REMEMBERED
            for index in () if missed else free:
                away = float(np.hypot(*(blobs[index].middle - expected)))
                if track.moves and blobs[index].fresh >= FRESH_SHARE:
                    # Where a walker comes apart from the trail it is the piece on new ground that walks on.
                    away -= NEAREST
                if away < distance:
                    best, distance = index, away
            if best is not None:
                free.remove(best)
            # a walker of whom nothing is seen, or only cells that are left of them
            lost = track.moves and (best is None or blobs[best].fresh < FRESH_SHARE)
            if lost and self._walks_on(track, grid, pose, fresh, best is not None):
                tracks.append(track)
            elif best is not None:
                track.take(grid.stamp, blobs[best])
                tracks.append(track)
        return tracks + [Track(grid.stamp, blobs[index]) for index in free]

    def _walks_on(self, track, grid, pose, fresh, stands):
        """Whether a walker who was not told apart is moved on; ``stands``: whether cells stand where they should be."""
        since = grid.stamp - track.stamp
        if not stands and since < REMEMBERED:
            return True
        if since >= LOST or track.seen_moving < WALKED:
            return False
        expected = track.points(grid.stamp)
        away = self._distance(expected, pose)
        if away < NEAR and self._distance(track.points(grid.stamp + LEAVES[0]), pose) < away + LEAVES[1]:
            return True
        edges = np.stack((expected.min(axis=0) - AROUND, expected.max(axis=0) + AROUND))
        size = grid.cells.shape[::-1]
        first, last = np.clip(np.floor((edges - grid.origin) / grid.resolution).astype(int), 0, size)
        window = (slice(first[1], last[1] + 1), slice(first[0], last[0] + 1))
        return np.count_nonzero(fresh[window]) * grid.resolution**2 >= ENTERED

    def _distance(self, points, pose):
        box = self._footprint
        return rectangle.nearest(points, pose[0], pose[1], pose[2], box.front, box.rear, box.half_width)


class _Memory:
    """Since when each lethal cell has been one, and what it was before, while the window rolls."""

    def __init__(self):
        self._since = self._last = self._free = self._was_free = self._corner = None

    def update(self, grid):
        """Which cells (rows, columns) have been lethal for no longer than FRESH [s]; which of them were free before."""
        corner = np.round(np.asarray(grid.origin) / grid.resolution).astype(int)
        if self._since is None or self._since.shape != grid.cells.shape:
            self._since, self._last, self._free = (np.full(grid.cells.shape, -np.inf) for _ in range(3))
            self._was_free = np.zeros(grid.cells.shape, bool)
        elif not np.array_equal(corner, self._corner):
            shift = corner - self._corner
            self._since, self._last, self._free = (
                _rolled(values, shift, -np.inf) for values in (self._since, self._last, self._free)
            )
            self._was_free = _rolled(self._was_free, shift, False)
        self._corner = corner
        lethal = grid.cells == LETHAL
        new = lethal & (grid.stamp - self._last > FORGOTTEN)
        self._since[new] = grid.stamp
        self._was_free[new] = grid.stamp - self._free[new] <= FREE_BEFORE
        np.copyto(self._last, grid.stamp, where=lethal)
        np.copyto(self._free, grid.stamp, where=(grid.cells != UNKNOWN) & ~lethal)
        fresh = lethal & (grid.stamp - self._since <= FRESH)
        return fresh, fresh & self._was_free


def _rolled(values, shift, new):
    """``values`` (rows, columns) in a window whose corner moved by ``shift`` (columns, rows); new cells are ``new``."""
    moved = np.full_like(values, new)
    there, here = [], []
    for size, by in zip(values.shape, shift[::-1]):
        there.append(slice(max(-by, 0), max(min(size - by, size), 0)))
        here.append(slice(max(by, 0), max(min(size + by, size), 0)))
    moved[tuple(there)] = values[tuple(here)]
    return moved


def find_blobs(grid, fresh=None):
    """Groups of touching lethal cells no larger than a person: list of ``Blob``.

    ``fresh`` (rows, columns): the cells where nothing stood before; None where that is not known.
    """
    labels, count = ndimage.label(grid.cells == LETHAL, structure=np.ones((3, 3)))
    largest, smallest = LONGEST / grid.resolution, SMALLEST / grid.resolution
    blobs = []
    for index, box in enumerate(ndimage.find_objects(labels, count), start=1):
        height, width = box[0].stop - box[0].start, box[1].stop - box[1].start
        if not smallest <= max(height, width) <= largest or height * width < FEWEST:
            continue
        rows, columns = np.nonzero(labels[box] == index)
        thickness = len(rows) * grid.resolution / max(height, width)
        if len(rows) < FEWEST or (max(height, width) * grid.resolution > THIN[0] and thickness < THIN[1]):
            continue
        share = 1.0 if fresh is None else float(fresh[box][rows, columns].mean())
        blobs.append(_blob(rows + box[0].start, columns + box[1].start, grid, share))
    return blobs


def find_fronts(grid, entered):
    """Groups of touching cells that were ``entered`` (rows, columns) just now, no larger than a person: ``Blob``s.

    None in a costmap that is not ours: others write the cost of obstacles over unknown ground (as costmap_2d within the
    inscribed radius), so that it passes for free before a wall comes into view there.
    """
    fewest = max(FRONT_CELLS, FRONT_AREA / grid.resolution**2)
    if grid.surface is WHOLE_CELLS or np.count_nonzero(entered) < fewest:
        return []
    labels, count = ndimage.label(entered, structure=np.ones((3, 3)))
    fronts = []
    for index, box in enumerate(ndimage.find_objects(labels, count), start=1):
        longer = max(box[0].stop - box[0].start, box[1].stop - box[1].start) * grid.resolution
        if not FRONT_SMALLEST <= longer <= FRONT_LARGEST:
            continue
        rows, columns = np.nonzero(labels[box] == index)
        if len(rows) >= fewest:
            fronts.append(_blob(rows + box[0].start, columns + box[1].start, grid))
    return fronts


def _blob(rows, columns, grid, fresh=1.0):
    cells = np.column_stack((columns + 0.5, rows + 0.5))
    points = cells * grid.resolution + np.asarray(grid.origin)
    return Blob(points, points.mean(axis=0), np.stack((points.min(axis=0), points.max(axis=0))), fresh)
