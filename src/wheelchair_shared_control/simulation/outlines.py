"""The world in the chair's height band, seen from above: convex polygons, and exact distances to them."""
from typing import NamedTuple

import numpy as np
from numba import njit

LOW, HIGH = 0.05, 1.30  # m: what stands lower is rolled over, what hangs higher is passed under
_CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])


class Outlines(NamedTuple):
    """Convex polygons: ``vertices`` (n, 5, 2) [m], counter-clockwise, of which the first ``counts`` (n,) are
    valid; a circle of ``radii`` (n,) about ``centres`` (n, 2) holds each; ``names`` tells whose they are."""

    vertices: np.ndarray
    counts: np.ndarray
    centres: np.ndarray
    radii: np.ndarray
    names: tuple


def from_world(world, low=LOW, high=HIGH):
    """Outlines of all that reaches into the heights from ``low`` to ``high`` [m]."""
    z, half = world.boxes[:, 2], world.boxes[:, 6]
    chosen = np.nonzero((z - half < high) & (z + half > low))[0]
    vertices, counts = [from_boxes(world.boxes[chosen])], [np.full(len(chosen), 4, dtype=np.int64)]
    names = [world.names[i] for i in chosen]
    for index, (points, triangles) in enumerate(world.meshes):
        corners = np.asarray(points, dtype=np.float64)[np.asarray(triangles, dtype=np.int64)]
        pieces, sizes = _cut(corners, low, high)
        vertices.append(pieces)
        counts.append(sizes)
        names += [world.names[len(world.boxes) + index]] * len(sizes)
    return _finished(np.concatenate(vertices), np.concatenate(counts), tuple(names))


def from_boxes(boxes):
    """Corners (n, 5, 2) of boxes (n, 7); the fifth repeats the fourth."""
    local = _CORNERS[None] * boxes[:, None, 4:6]
    cos, sin = np.cos(boxes[:, 3])[:, None], np.sin(boxes[:, 3])[:, None]
    vertices = np.empty((len(boxes), 5, 2))
    vertices[:, :4, 0] = boxes[:, 0:1] + cos * local[..., 0] - sin * local[..., 1]
    vertices[:, :4, 1] = boxes[:, 1:2] + sin * local[..., 0] + cos * local[..., 1]
    vertices[:, 4] = vertices[:, 3]
    return vertices


def _finished(vertices, counts, names):
    centres = 0.5 * (vertices.min(axis=1) + vertices.max(axis=1)) if len(vertices) else np.zeros((0, 2))
    radii = np.hypot(*np.moveaxis(vertices - centres[:, None], -1, 0)).max(axis=1) if len(vertices) else np.zeros(0)
    return Outlines(np.ascontiguousarray(vertices), counts, centres, radii, names)


def near(shapes, point, reach):
    """The outlines within ``reach`` [m] of ``point`` (2,)."""
    away = np.hypot(shapes.centres[:, 0] - point[0], shapes.centres[:, 1] - point[1]) - shapes.radii
    chosen = np.nonzero(away <= reach)[0]
    return Outlines(shapes.vertices[chosen], shapes.counts[chosen], shapes.centres[chosen],
                    shapes.radii[chosen], tuple(shapes.names[i] for i in chosen))


def clearance(outlines, polygon, cap=10.0):
    """Distance [m] from a convex ``polygon`` (k, 2) to the nearest outline, at most ``cap``; 0 when they meet."""
    return _clearance(outlines.vertices, outlines.counts, outlines.centres, outlines.radii,
                      np.ascontiguousarray(polygon, dtype=np.float64), cap)


def polygon_distance(a, b):
    """Distance [m] between two convex polygons (k, 2), (m, 2); 0 when they meet."""
    return _distance(np.ascontiguousarray(a, dtype=np.float64), np.ascontiguousarray(b, dtype=np.float64))


def sees(outlines, a, b):
    """Whether the straight line from ``a`` (2,) to ``b`` (2,) meets no outline."""
    length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
    if length == 0.0:
        return True
    direction = (np.asarray(b, dtype=float) - a) / length
    low, high = blocked(outlines, np.asarray(a, dtype=float), direction)
    return not np.any((high > 0.0) & (low < length))


def blocked(outlines, point, direction):
    """Where a line runs inside outlines: from (n,) to (n,) [m] along the unit ``direction`` from ``point``.

    Empty intervals have from > to.
    """
    return _blocked(outlines.vertices, outlines.counts, np.asarray(point, dtype=np.float64),
                    np.asarray(direction, dtype=np.float64))


def free_runs(outlines, point, direction, reach):
    """Free stretches [(from, to)] [m] of a line within ``reach`` of ``point``, in ascending order."""
    low, high = blocked(outlines, point, direction)
    kept = (high > low) & (high > -reach) & (low < reach)
    runs, at = [], -reach
    for start, end in sorted(zip(low[kept], high[kept])):
        # neighbouring boxes share a face: a crack of a micrometre is no opening
        if start > at + 1e-6:
            runs.append((at, start))
        at = max(at, end)
    if at < reach:
        runs.append((at, reach))
    return runs


@njit(cache=True)
def _cut(triangles, low, high):
    """Triangles (n, 3, 3) clipped to a height band and laid on the floor: convex polygons (m, 5, 2), counts (m,).

    A triangle that stands upright becomes a segment.
    """
    vertices, counts = np.zeros((len(triangles), 5, 2)), np.zeros(len(triangles), np.int64)
    first, second = np.empty((8, 3)), np.empty((8, 3))
    found = 0
    for t in range(len(triangles)):
        corners = triangles[t]
        lowest = min(corners[0, 2], corners[1, 2], corners[2, 2])
        highest = max(corners[0, 2], corners[1, 2], corners[2, 2])
        if lowest >= high or highest <= low:
            continue
        count = _clip(corners, 3, low, 1.0, first)
        count = _clip(first, count, high, -1.0, second)
        if count < 2:
            continue
        area = 0.0
        for i in range(count):
            j = i + 1 if i + 1 < count else 0
            area += 0.5 * (second[i, 0] * second[j, 1] - second[j, 0] * second[i, 1])
        target = vertices[found]
        if abs(area) < 1e-9 or count == 2:
            wide, tall = np.ptp(second[:count, 0]), np.ptp(second[:count, 1])
            axis = 0 if wide >= tall else 1
            target[0] = second[np.argmin(second[:count, axis]), :2]
            target[1] = second[np.argmax(second[:count, axis]), :2]
            count = 2
        else:
            for i in range(count):
                target[i] = second[i if area > 0.0 else count - 1 - i, :2]
        for i in range(count, 5):
            target[i] = target[count - 1]
        counts[found] = count
        found += 1
    return vertices[:found].copy(), counts[:found].copy()


@njit(cache=True)
def _clip(polygon, count, height, sign, kept):
    """The part of a polygon (count, 3) above (``sign`` 1) or below (-1) ``height``, written to ``kept``."""
    n = 0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        a, b = sign * (polygon[i, 2] - height), sign * (polygon[j, 2] - height)
        if a >= 0.0:
            kept[n] = polygon[i]
            n += 1
        if a * b < 0.0:
            kept[n] = polygon[i] + (polygon[j] - polygon[i]) * (a / (a - b))
            n += 1
    return n


@njit(cache=True)
def _segment_distance(px, py, ax, ay, bx, by):
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    t = 0.0 if square == 0.0 else ((px - ax) * dx + (py - ay) * dy) / square
    t = min(1.0, max(0.0, t))
    return np.hypot(px - ax - t * dx, py - ay - t * dy)


@njit(cache=True)
def _separated(a, b):
    """Whether an edge of convex ``a`` separates it from ``b``."""
    n = len(a)
    for i in range(n):
        j = (i + 1) % n
        nx, ny = a[j, 1] - a[i, 1], a[i, 0] - a[j, 0]
        if nx == 0.0 and ny == 0.0:
            continue
        high = -1e300
        for k in range(n):
            high = max(high, nx * a[k, 0] + ny * a[k, 1])
        low_a = 1e300
        for k in range(n):
            low_a = min(low_a, nx * a[k, 0] + ny * a[k, 1])
        low, high_b = 1e300, -1e300
        for k in range(len(b)):
            p = nx * b[k, 0] + ny * b[k, 1]
            low, high_b = min(low, p), max(high_b, p)
        if low > high or high_b < low_a:
            return True
    return False


@njit(cache=True)
def _distance(a, b):
    if not _separated(a, b) and not _separated(b, a):
        return 0.0
    best = 1e300
    for i in range(len(a)):
        for j in range(len(b)):
            k = (j + 1) % len(b)
            best = min(best, _segment_distance(a[i, 0], a[i, 1], b[j, 0], b[j, 1], b[k, 0], b[k, 1]))
    for i in range(len(b)):
        for j in range(len(a)):
            k = (j + 1) % len(a)
            best = min(best, _segment_distance(b[i, 0], b[i, 1], a[j, 0], a[j, 1], a[k, 0], a[k, 1]))
    return best


@njit(cache=True)
def _clearance(vertices, counts, centres, radii, polygon, cap):
    x, y = 0.0, 0.0
    for k in range(len(polygon)):
        x += polygon[k, 0] / len(polygon)
        y += polygon[k, 1] / len(polygon)
    radius = 0.0
    for k in range(len(polygon)):
        radius = max(radius, np.hypot(polygon[k, 0] - x, polygon[k, 1] - y))
    best = cap
    for i in range(len(counts)):
        if np.hypot(centres[i, 0] - x, centres[i, 1] - y) - radii[i] - radius >= best:
            continue
        best = min(best, _distance(polygon, vertices[i, : counts[i]]))
        if best == 0.0:
            break
    return best


@njit(cache=True)
def _blocked(vertices, counts, point, direction):
    n = len(counts)
    low, high = np.full(n, 1e300), np.full(n, -1e300)
    px, py, dx, dy = point[0], point[1], direction[0], direction[1]
    for i in range(n):
        for j in range(counts[i]):
            k = (j + 1) % counts[i]
            ax, ay = vertices[i, j, 0] - px, vertices[i, j, 1] - py
            bx, by = vertices[i, k, 0] - px, vertices[i, k, 1] - py
            side_a, side_b = dx * ay - dy * ax, dx * by - dy * bx
            if (side_a > 0.0) == (side_b > 0.0):
                continue
            t = side_a / (side_a - side_b)
            along = dx * (ax + t * (bx - ax)) + dy * (ay + t * (by - ay))
            low[i], high[i] = min(low[i], along), max(high[i], along)
    return low, high
