"""Gaps: stretches of a wall's plane that rays pass through, between stretches where they end."""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control.doorway_rays import BEFORE, DEEP, FRONT, SHALLOW, WALL, count_crossings


class Scan(NamedTuple):
    """What the rays say about a wall's plane, column by column.

    ``s`` (n,) [m] middles of the columns; ``solid``, ``open``, ``seen``, ``hidden`` (n,) bool: hidden behind
    something that stands before the plane.
    """

    s: np.ndarray
    solid: np.ndarray
    open: np.ndarray
    seen: np.ndarray
    hidden: np.ndarray


class Gap(NamedTuple):
    """A stretch between two solid columns; NaN where there is none within reach (``left`` < ``right``).

    ``free_standing``: what stands on both sides is short and has a free end: furniture, not a wall.
    """

    left: float
    right: float
    free_standing: bool = False


def scan(rays, line, settings):
    """``Scan`` of the plane of ``line``, from ``gap/low`` up to the door's height or the top of the view."""
    gap = settings.gap
    s_bins = int(2.0 * gap.reach / gap.step)
    z_bins = int((settings.door.height - gap.low) / gap.step_height)
    counts = count_crossings(rays, line, settings, -gap.reach, gap.step, s_bins, gap.low, gap.step_height, z_bins)
    if rays.returned < gap.sparse:
        # few points: neighbouring columns speak for each other
        counts = counts + np.roll(counts, 1, axis=1) + np.roll(counts, -1, axis=1)
    behind = counts[SHALLOW] + counts[DEEP]
    # what leans on the wall (a leaf folded back, a shelf) ends a gap as the wall does
    solid = counts[WALL] + counts[BEFORE]
    total = solid + behind
    told = total > 0
    heights = told.sum(axis=1)
    wall_cells = (told & (solid >= gap.majority * total)).sum(axis=1)
    deep_cells = (told & (counts[DEEP] >= gap.majority * total)).sum(axis=1)
    seen = heights >= gap.min_cells
    hidden = (counts[FRONT] > 0).sum(axis=1) >= np.maximum(2 * heights, gap.min_cells)
    share = np.maximum(heights, 1)
    return Scan(-gap.reach + (np.arange(s_bins) + 0.5) * gap.step, seen & (wall_cells >= gap.solid_share * share),
                seen & (deep_cells >= gap.open_share * share), seen, hidden)


def gaps(found, settings):
    """Gaps (list) in a ``Scan``: every open stretch, extended to the nearest solid column on each side."""
    gap = settings.gap
    step = gap.step
    solid = _dense(found.solid, int(round(gap.min_solid / step)))
    index = np.flatnonzero(found.open)
    result = []
    if len(index) == 0:
        return result
    at_solid = np.flatnonzero(solid)
    # solid columns cut the open ones into stretches
    after = np.searchsorted(at_solid, index)
    for group in np.unique(after):
        columns = index[after == group]
        if len(columns) * step < gap.min_open:
            continue
        left = found.s[at_solid[group - 1]] + step / 2.0 if group > 0 else np.nan
        right = found.s[at_solid[group]] - step / 2.0 if group < len(at_solid) else np.nan
        # blank columns before the jamb (its reveal, its shadow) are few; a jamb far off is another thing
        if not found.s[columns[0]] - left <= gap.max_blank:
            left = _hider(found, columns[0], -1, gap)
        if not right - found.s[columns[-1]] <= gap.max_blank:
            right = _hider(found, columns[-1], 1, gap)
        result.append(Gap(float(left), float(right), _is_free_standing(found, left, right, settings)))
    return result


def _hider(found, column, side, gap):
    """Where an open stretch goes out of sight behind something nearer, such as a wall along the way: maybe a jamb."""
    for step in range(1, int(0.1 / gap.step) + 2):
        at = column + side * step
        if 0 <= at < len(found.s) and found.hidden[at]:
            return found.s[at] - side * gap.step / 2.0
    return np.nan


def _is_free_standing(found, left, right, settings):
    """Is what bounds a gap no wall: a post, or short pieces with free ends on both sides?"""
    if not np.isfinite(left + right):
        return False
    lengths = [_length(found, edge, side, settings) for edge, side in ((left, -1), (right, 1))]
    return min(lengths) < settings.gap.post or max(lengths) < settings.gap.stub


def _length(found, edge, side, settings):
    """Length [m] of the wall beside a gap up to its free end: infinite where no end is seen.

    A free end is a stretch of open columns wider than a door: the pier between two doors is no end.
    """
    gap = settings.gap
    at = int(round((edge - found.s[0]) / gap.step)) + (0 if side > 0 else -1)
    solid, free, seen = found.solid[at::side], found.open[at::side], found.seen[at::side]
    last, opened = 0, 0
    for column in range(len(solid)):
        if solid[column]:
            last, opened = column, 0
            if last * gap.step > gap.stub:
                break
        elif free[column]:
            opened += 1
            if opened * gap.step > settings.door.max_width:
                return (last + 1) * gap.step
        elif not seen[column] and (column - last) * gap.step > 0.1:
            # out of view: an end that was seen before is one
            return (last + 1) * gap.step if opened * gap.step > 0.1 else np.inf
    return np.inf


def _dense(mask, length):
    """Columns of runs of at least ``length`` true ones, holes of one column forgiven."""
    filled = mask.copy()
    filled[1:-1] |= mask[:-2] & mask[2:]
    edges = np.flatnonzero(np.diff(np.concatenate(([False], filled, [False])).astype(np.int8)))
    keep = np.zeros(len(mask), dtype=bool)
    for start, stop in zip(edges[::2], edges[1::2]):
        if stop - start >= length:
            keep[start:stop] = True
    return keep
