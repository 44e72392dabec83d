"""Gaps: stretches of a wall's plane that rays pass through, between stretches where they end."""
from typing import NamedTuple, Tuple

import numpy as np

from wheelchair_shared_control.doorway_rays import DEEP, FRONT, SHALLOW, WALL, count_crossings


class Scan(NamedTuple):
    """What the rays say about a wall's plane, column by column.

    ``s`` (n,) [m] middles of the columns; ``solid``, ``open``, ``seen`` (n,) bool.
    """

    s: np.ndarray
    solid: np.ndarray
    open: np.ndarray
    seen: np.ndarray
    counts: np.ndarray


class Gap(NamedTuple):
    """A stretch between two solid columns; NaN where there is none within reach (``left`` < ``right``).

    ``free_standing``: what stands on both sides is short and has a free end: furniture, not a wall.
    """

    left: float
    right: float
    open_share: float
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
    total = counts[WALL] + behind
    told = total > 0
    heights = told.sum(axis=1)
    wall_cells = (told & (counts[WALL] >= gap.majority * total)).sum(axis=1)
    deep_cells = (told & (counts[DEEP] >= gap.majority * total)).sum(axis=1)
    seen = heights >= gap.min_cells
    share = np.maximum(heights, 1)
    return Scan(-gap.reach + (np.arange(s_bins) + 0.5) * gap.step, seen & (wall_cells >= gap.solid_share * share),
                seen & (deep_cells >= gap.open_share * share), seen, counts)


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
        if found.s[columns[0]] - left > gap.max_blank:
            left = np.nan
        if right - found.s[columns[-1]] > gap.max_blank:
            right = np.nan
        low = left if np.isfinite(left) else found.s[columns[0]]
        high = right if np.isfinite(right) else found.s[columns[-1]]
        free = np.isfinite(left + right) and all(
            _ends_freely(found, edge, side, settings) for edge, side in ((left, -1), (right, 1)))
        result.append(Gap(float(left), float(right), float(len(columns) * step / max(high - low, step)), free))
    return result


def _ends_freely(found, edge, side, settings):
    """Does the wall beside a gap end within ``gap/stub`` [m], with nothing but open columns after its end?

    Pieces between gaps of door width count as one wall: the pier between two doors is no end.
    """
    gap = settings.gap
    at = int(round((edge - found.s[0]) / gap.step)) + (0 if side > 0 else -1)
    solid, free = found.solid[at::side], found.open[at::side]
    allowed = int(settings.door.max_width / gap.step) + 5
    last = 0
    for column in range(len(solid)):
        if solid[column]:
            last = column
            if last * gap.step > gap.stub:
                return False
        elif not free[column] and not found.seen[at::side][column]:
            # out of view, or hidden: a wall that is not seen to end
            return free[last + 1:column].sum() * gap.step > 0.3 and column - last > allowed
        elif column - last > allowed:
            return bool(free[last + 1:column].mean() > 0.7)
    return False


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
