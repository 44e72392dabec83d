"""Narrows: places where tall things stand a door's width apart across one of the building's directions.

Real doors often sit in corners, at the ends of partitions and in recesses, where no wall goes on in their plane.
From above they are where the free space between what stands on the left and on the right is shortest, measured
along the walls' directions.
"""
from typing import NamedTuple

import numpy as np
from numba import njit

ANGLES = 180  # steps of the search for the walls' directions, in a quarter turn


class Narrow(NamedTuple):
    """Free run between two tall things: its ends ``left`` and ``right`` (2,) [m] as the sensor sees them, in the
    middle of the depth that they share; ``normal`` (2,) unit, away from the sensor; ``depth`` [m] of that stretch,
    and whether it was ``measured``; one stands at most ``uneven`` [m] before the other;
    ``rank`` of the building's direction that it follows, 0 is the best."""

    left: np.ndarray
    right: np.ndarray
    normal: np.ndarray
    depth: float
    measured: bool
    uneven: float
    rank: int


def find(rays, headings, settings):
    """Narrows (list), those to be believed first in front, along and across ``headings`` [rad].

    ``headings`` are the building's ``directions``.
    """
    narrow = settings.narrow
    step = np.radians(narrow.step)
    bins = int(np.ceil(2.0 * np.pi / step))
    reach, seen = _profile(rays.points, rays.returned, rays.origin[0], rays.origin[1], narrow.low, narrow.high, bins,
                           step)
    known = np.flatnonzero(seen)
    if len(known) < 3:
        return []
    bearing = -np.pi + (known + 0.5) * step
    reach = reach[known].astype(float)
    found = []
    for rank, heading in enumerate(headings):
        for quarter in range(4):
            found += _across(bearing, reach, heading + quarter * np.pi / 2.0, rays.origin[:2], rank, settings)
    return _in_order(found, narrow)[:narrow.max_pairs]


def _in_order(found, narrow):
    """The shortest run first; of those at its place the ones whose ends are the most even."""
    rest = sorted(found, key=lambda n: float(np.hypot(*(n.right - n.left))))
    result = []
    while rest:
        place = 0.5 * (rest[0].left + rest[0].right)
        here = [n for n in rest if np.hypot(*(0.5 * (n.left + n.right) - place)) < narrow.place]
        result += sorted(here, key=lambda n: (n.uneven, n.rank))
        rest = [n for n in rest if not any(n is other for other in here)]
    return result


def directions(few, narrow):
    """Directions (list) [rad] in [0, pi/2) along which, and across which, most of ``few`` (n, 3) line up.

    Empty for fewer than three points. The sharper the histogram of the points along an axis, the more of them stand in
    walls across it.
    """
    if len(few) < 3:
        return []
    score = _sharpness(np.ascontiguousarray(few[:, :2], dtype=np.float64), ANGLES, narrow.line_width)
    best = int(np.argmax(score))
    chosen = [best]
    # a building with a second set of directions
    apart = np.abs((np.arange(ANGLES) - best + ANGLES // 2) % ANGLES - ANGLES // 2)
    other = np.where(apart > ANGLES * 15 // 90, score, 0.0)
    second = int(np.argmax(other))
    peak = score[(second - 1) % ANGLES] <= score[second] >= score[(second + 1) % ANGLES]
    floor = float(np.median(score))
    if peak and score[second] - floor > narrow.second_share * (score[best] - floor):
        chosen.append(second)
    return [k * np.pi / 2.0 / ANGLES for k in chosen]


def is_along(headings, yaw, limit_deg):
    """Does ``yaw`` [rad] lie along or across one of ``headings``, to within ``limit_deg``?"""
    limit = np.sin(np.radians(2.0 * limit_deg))
    return any(abs(np.sin(2.0 * (heading - yaw))) < limit for heading in headings)


@njit(cache=True)
def _sharpness(points, angles, width):
    n = len(points)
    score = np.zeros(angles)
    reach = 0.0
    for i in range(n):
        reach = max(reach, points[i, 0] ** 2 + points[i, 1] ** 2)
    bins = 2 * int(np.sqrt(reach) / width) + 4
    counts = np.empty(bins)
    for k in range(angles):
        angle = k * np.pi / 2.0 / angles
        c, s = np.cos(angle), np.sin(angle)
        for axis in range(2):
            counts[:] = 0.0
            for i in range(n):
                if axis == 0:
                    along = c * points[i, 0] + s * points[i, 1]
                else:
                    along = c * points[i, 1] - s * points[i, 0]
                place = along / width + bins / 2.0
                low = int(place)
                share = place - low
                # each point speaks for the two nearest bins: no edge between them matters
                counts[low] += 1.0 - share
                counts[min(low + 1, bins - 1)] += share
            for b in range(bins):
                score[k] += counts[b] * counts[b]
    return score


@njit(cache=True)
def _profile(points, returned, x, y, low, high, bins, step):
    """Third smallest distance (bins,) of the tall readings of each bearing from -pi on; inf where there are fewer,
    and whether anything at all was seen there."""
    best = np.full((bins, 3), np.inf, np.float32)
    seen = np.zeros(bins, np.bool_)
    for i in range(points.shape[1]):
        z = points[2, i]
        if i < returned and (z < 0.0 or z > high):
            continue
        dx, dy = points[0, i] - x, points[1, i] - y
        k = int((np.arctan2(dy, dx) + np.pi) / step)
        if k >= bins:
            k = bins - 1
        seen[k] = True
        if i >= returned or z < low:
            continue
        r = np.sqrt(dx * dx + dy * dy)
        if r < best[k, 2]:
            if r < best[k, 1]:
                best[k, 2] = best[k, 1]
                if r < best[k, 0]:
                    best[k, 1] = best[k, 0]
                    best[k, 0] = r
                else:
                    best[k, 1] = r
            else:
                best[k, 2] = r
    return best[:, 2].copy(), seen


def _across(bearing, reach, heading, origin, rank, settings):
    """Narrows (list) whose normal has the direction ``heading`` [rad], the building's best but ``rank``.

    The wall's frame: v along the normal, u to the right of it, from the sensor.
    """
    narrow, door = settings.narrow, settings.door
    turn = (bearing - heading + np.pi) % (2.0 * np.pi) - np.pi
    order = np.argsort(-turn, kind="stable")  # from left to right
    order = order[np.abs(turn[order]) < np.radians(narrow.max_slant)]
    if len(order) < 3:
        return []
    turn, reach = turn[order], reach[order]
    far = np.minimum(reach, 100.0)
    u, v = -far * np.sin(turn), far * np.cos(turn)
    normal = np.array([np.cos(heading), np.sin(heading)])
    along = np.array([normal[1], -normal[0]])
    result = []
    # what bounds a run is seen from the front only: how deep it is behind that is unknown. Two readings of it
    for uneven in (narrow.level, narrow.before):
        rows = _rows(u, v, narrow.row, narrow.reach, narrow.tolerance, uneven, narrow.beside, door.min_width - 0.03,
                     door.max_width + 0.03)
        for group in _groups(rows):
            c, low, high = group[np.argmin(group[:, 2] - group[:, 1])]
            left, right = _extent(u, v, low, c, narrow), _extent(u, v, high, c, narrow)
            front, back = max(left[0], right[0]), min(left[1], right[1])
            measured = back - front > 0.03
            if back < front:  # one stands before the other
                front = back = 0.5 * (front + back)
            if back - front > narrow.max_depth:
                continue
            # of a jamb whose inner face is hidden only the front is seen
            plane = 0.5 * (front + back) if measured else front + 0.5 * settings.jamb.thickness
            ends = [origin + edge * along + plane * normal for edge in (low, high)]
            item = Narrow(ends[0], ends[1], normal, float(back - front), bool(measured), float(uneven), rank)
            if not any(_equal(item, other, narrow.apart) for other in result):
                result.append(item)
    return result


def _equal(a, b, apart):
    """Do two runs along the same direction have their ends in the same places?"""
    return bool(np.abs(a.left - b.left).max() < apart and np.abs(a.right - b.right).max() < apart)


@njit(cache=True)
def _rows(u, v, step, reach, tolerance, before, beside, min_width, max_width):
    """Free runs (n, 3) between tall things near to a line across the normal: the line's distance, the run's ends.

    A bearing passes a line if it sees something behind it; a run of bearings that pass is bounded by two that do
    not. What bounds it must stand near the line: at most ``before`` before it.
    """
    n = len(u)
    out = np.empty((4096, 3))
    found = 0
    for row in range(int(reach / step)):
        c = 0.3 + row * step
        k = 0
        while k < n:
            if v[k] <= c + tolerance:
                k += 1
                continue
            first = k
            while k < n and v[k] > c + tolerance:
                k += 1
            last = k - 1
            if first == 0 or k == n or last - first < 2:
                continue
            if v[first - 1] < c - before or v[k] < c - before:
                continue
            left, right = u[first - 1], u[k]
            # neighbours in the view that reach farther into the gap
            m = first - 1
            while m >= 0 and abs(u[m] - u[first - 1]) < beside and c - before <= v[m] <= c + tolerance:
                left = max(left, u[m])
                m -= 1
            m = k
            while m < n and abs(u[m] - u[k]) < beside and c - before <= v[m] <= c + tolerance:
                right = min(right, u[m])
                m += 1
            width = right - left
            if width < min_width or width > max_width or found == len(out):
                continue
            out[found, 0], out[found, 1], out[found, 2] = c, left, right
            found += 1
    return out[:found]


def _groups(rows):
    """Rows of the same opening: (list of (m, 3)) neighbouring lines whose runs overlap."""
    groups = []
    for row in rows:
        for group in groups:
            last = group[-1]
            if row[0] - last[0] < 0.11 and abs(0.5 * (row[1] + row[2] - last[1] - last[2])) < 0.15:
                group.append(row)
                break
        else:
            groups.append([row])
    return [np.array(group) for group in groups]


def _extent(u, v, edge, c, narrow):
    """From where to where (v) [m] what bounds a run at ``edge`` is seen beside it, around the line at ``c``."""
    at = (np.abs(u - edge) < narrow.edge_band) & (np.abs(v - c) < 1.0)
    seen = np.sort(v[at])
    if len(seen) == 0:
        return c, c
    # the piece that holds the line
    cuts = np.flatnonzero(np.diff(seen) > 0.12)
    starts = np.concatenate(([0], cuts + 1))
    stops = np.concatenate((cuts, [len(seen) - 1]))
    away = [max(seen[a] - c, c - seen[b], 0.0) for a, b in zip(starts, stops)]
    best = int(np.argmin(away))
    return float(seen[starts[best]]), float(seen[stops[best]])
