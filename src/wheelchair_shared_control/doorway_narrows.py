"""Narrows: places where tall things stand a door's width apart, found in the nearest tall reading of each bearing.

Real doors often sit in corners and at the ends of partitions, where no wall goes on beside them. There the doorway
is the shortest line from a corner, where the view opens, to what stands on the other side.
"""
import numpy as np
from numba import njit


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


def find(rays, settings):
    """Pairs (list) of points (2, 2) [m], left and right as the sensor sees them, the narrowest first."""
    narrow, door = settings.narrow, settings.door
    step = np.radians(narrow.step)
    bins = int(np.ceil(2.0 * np.pi / step))
    reach, seen = _profile(rays.points, rays.returned, rays.origin[0], rays.origin[1], narrow.low, narrow.high, bins,
                           step)
    bearing = -np.pi + (np.arange(bins) + 0.5) * step
    known = np.flatnonzero(seen)
    if len(known) < 3:
        return []
    with np.errstate(invalid="ignore"):
        points = np.column_stack((reach * np.cos(bearing), reach * np.sin(bearing)))
    tall = np.flatnonzero(np.isfinite(reach) & (reach < narrow.reach))
    longest = door.max_width + 0.05
    pairs = []
    for side in (-1, 1):
        for corner in _corners(reach, seen, tall, side, narrow.jump):
            # what stands on the open side, in order of its distance from the corner
            turn = side * (tall - corner)
            other = tall[(turn > 2) & (turn * step < np.pi / 2.0)]
            away = np.hypot(*(points[other] - points[corner]).T)
            fits = (away > 0.6) & (away < longest)
            for end in other[fits][np.argsort(away[fits], kind="stable")][:narrow.tries]:
                if _free(points[corner], points[end], reach, bearing, min(corner, end) + 2, max(corner, end) - 1):
                    left, right = (corner, end) if side < 0 else (end, corner)
                    pairs.append(np.array([points[left], points[right]]) + rays.origin[:2])
                    break
    pairs.sort(key=lambda pair: float(np.hypot(*(pair[1] - pair[0]))))
    kept = []
    for pair in pairs:
        middle = pair.mean(axis=0)
        if all(np.hypot(*(middle - other.mean(axis=0))) > 0.3 for other in kept):
            kept.append(pair)
    return kept[:narrow.max_pairs]


def _corners(reach, seen, tall, side, jump):
    """Bins (list) beyond which, to ``side`` (1: larger bearings, to the left), the view opens by more than ``jump``."""
    corners = []
    for k in tall:
        ahead = [k + side * n for n in range(1, 6) if 0 <= k + side * n < len(reach)]
        ahead = [j for j in ahead if seen[j]]
        if len(ahead) >= 3 and all(reach[j] > reach[k] + jump for j in ahead[-3:]) and reach[ahead[0]] > reach[k] - 0.1:
            corners.append(k)
    # of neighbours that see the same corner, the last one
    return [k for k in corners if k + side not in corners and k + 2 * side not in corners]


def _free(a, b, reach, bearing, low, high):
    """Does every bearing between see past the line from ``a`` to ``b``?"""
    if high <= low:
        return False
    k = np.arange(low, high)
    direction = np.column_stack((np.cos(bearing[k]), np.sin(bearing[k])))
    normal = np.array([-(b - a)[1], (b - a)[0]])
    with np.errstate(divide="ignore", invalid="ignore"):
        line = (a @ normal) / (direction @ normal)
    past = reach[k] > line + 0.05
    return bool(past.mean() > 0.93 and np.median(reach[k] - line) > 0.3)
