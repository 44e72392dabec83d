"""Every reading of a depth sensor as a ray that ends at a point above the levelled floor.

The detector works in the frame *level*: z along the floor's normal, the floor at z = 0. A ray knows more than
its end point: where it crosses a wall's plane on its way, the wall is open.
"""
from typing import NamedTuple

import numpy as np
from numba import njit

LABELS = 5
WALL, SHALLOW, DEEP, FRONT, BEFORE = range(LABELS)


class Rays(NamedTuple):
    """Rays from ``origin`` (3,) to ``points`` (3, n) float32 [m] in one frame.

    ``noise`` (n,) float32 is the standard deviation along the ray over the distance along it. The last
    ``unreturned`` rays met nothing within the sensor's range: their points lie beyond it.
    """

    origin: np.ndarray
    points: np.ndarray
    noise: np.ndarray
    unreturned: int = 0

    @property
    def returned(self):
        """Number of rays that met a surface."""
        return self.points.shape[1] - self.unreturned


class Line(NamedTuple):
    """A wall's plane seen from above: ``origin`` (2,), ``along`` (2,) unit, ``normal`` (2,) unit, away from the
    sensor; ``along`` is the normal turned by -90 degrees, so s grows to the right as the sensor sees it.
    ``lean`` is the change of offset with height (0 = vertical) about ``height`` [m].
    """

    origin: np.ndarray
    along: np.ndarray
    normal: np.ndarray
    lean: float = 0.0
    height: float = 0.0


@njit(cache=True)
def _from_image(depth, fx, fy, cx, cy, rotation, shift, nearest, farthest, noise_floor, noise_growth, row_step, step):
    rows, columns = depth.shape
    n = ((rows + row_step - 1) // row_step) * ((columns + step - 1) // step)
    points = np.empty((3, n), np.float32)
    noise = np.empty(n, np.float32)
    # returned rays fill the arrays from the front, unreturned ones from the back
    head, tail = 0, n
    far = np.float32(2.0) * np.float32(farthest)
    for v in range(0, rows, row_step):
        ry = (v - cy) / fy
        for u in range(0, columns, step):
            z = depth[v, u]
            if z != z or z <= 0.0:
                continue
            if z == np.inf:
                tail -= 1
                at = tail
                z = far
            elif z < nearest:
                continue
            else:
                at = head
                head += 1
            rx = (u - cx) / fx
            for k in range(3):
                points[k, at] = (rotation[k, 0] * rx + rotation[k, 1] * ry + rotation[k, 2]) * z + shift[k]
            spread = z - np.float32(0.4)
            noise[at] = (noise_floor + noise_growth * spread * spread) / z
    # close the hole in the middle
    gone = n - tail
    for i in range(gone):
        for k in range(3):
            points[k, head + i] = points[k, tail + i]
        noise[head + i] = noise[tail + i]
    return points, noise, head, gone


def from_image(depth, camera, level_from_camera, settings, row_step=1, step=1):
    """Rays of every ``row_step``-th row and ``step``-th column of ``depth`` (height, width) [m].

    REP 117/118: NaN, 0 and -Inf say nothing and are dropped; +Inf is a ray that met nothing within
    ``sensor/max_range``.
    """
    transform = np.asarray(level_from_camera, dtype=float)
    points, noise, head, gone = _from_image(
        np.ascontiguousarray(depth, dtype=np.float32), float(camera.fx), float(camera.fy), float(camera.cx),
        float(camera.cy), np.ascontiguousarray(transform[:3, :3]), np.ascontiguousarray(transform[:3, 3]),
        float(settings.sensor.min_range), float(settings.sensor.max_range),
        float(settings.sensor.noise_floor), float(settings.sensor.noise_growth), int(row_step), int(step))
    return Rays(transform[:3, 3].copy(), points[:, :head + gone], noise[:head + gone], int(gone))


def from_points(points, origin, settings):
    """Rays from ``origin`` (3,) to the finite ones of ``points`` (n, 3) [m]."""
    points = np.asarray(points, dtype=np.float32).reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    distance = np.linalg.norm(points - np.asarray(origin, dtype=np.float32), axis=1)
    seen = distance > settings.sensor.min_range_cloud
    points, distance = points[seen], distance[seen]
    noise = settings.sensor.cloud_noise / np.maximum(distance, 0.1)
    return Rays(np.asarray(origin, dtype=float), np.ascontiguousarray(points.T), noise.astype(np.float32), 0)


def transformed(rays, transform):
    """The same rays in another frame, ``transform`` (4, 4)."""
    rotation, shift = transform[:3, :3], transform[:3, 3]
    points = rotation.astype(np.float32) @ rays.points + shift.astype(np.float32)[:, None]
    return rays._replace(origin=rotation @ rays.origin + shift, points=points)


@njit(cache=True)
def _label(offset, z, noise, reach, tolerance, sigmas, deep, front, floor):
    """Label of a ray that ends ``offset`` behind the plane; ``reach`` is the sensor's distance to the plane.

    A ray that ends on the floor behind the plane has passed it, however near behind.
    """
    spread = sigmas * noise * abs(offset + reach)
    limit = tolerance + spread
    if offset > deep + spread or (z < floor and offset > limit):
        return 2
    if offset > limit:
        return 1
    if offset < -front - spread:
        return 3
    if offset < -limit:
        return 4
    return 0


@njit(cache=True, error_model="numpy")
def _crossings(points, noise, returned, origin, line_origin, along, normal, lean, height, tolerance, sigmas,
    deep, front,
               s_low, s_step, s_bins, z_low, z_step, z_bins, floor):
    counts = np.zeros((5, s_bins, z_bins), np.int32)
    ox, oy = np.float32(line_origin[0]), np.float32(line_origin[1])
    ax, ay = np.float32(along[0]), np.float32(along[1])
    nx, ny = np.float32(normal[0]), np.float32(normal[1])
    lean, height, eye = np.float32(lean), np.float32(height), np.float32(origin[2])
    s_low, z_low = np.float32(s_low), np.float32(z_low)
    per_s, per_z = np.float32(1.0 / s_step), np.float32(1.0 / z_step)
    cs = (np.float32(origin[0]) - ox) * ax + (np.float32(origin[1]) - oy) * ay
    reach = -((np.float32(origin[0]) - ox) * nx + (np.float32(origin[1]) - oy) * ny - lean * (eye - height))
    least = np.float32(0.2) * reach
    for i in range(points.shape[1]):
        dx, dy, z = points[0, i] - ox, points[1, i] - oy, points[2, i]
        offset = dx * nx + dy * ny - lean * (z - height)
        way = offset + reach
        if way < least:
            continue
        f = reach / way
        if i >= returned and f > 0.48:
            continue  # the plane lies out of range there: nothing is known
        row = (eye + (z - eye) * f - z_low) * per_z
        column = (cs + (dx * ax + dy * ay - cs) * f - s_low) * per_s
        if not (0.0 <= row < z_bins and 0.0 <= column < s_bins):
            continue
        label = 2 if i >= returned else _label(offset, z, noise[i], reach, tolerance, sigmas, deep, front, floor)
        counts[label, int(column), int(row)] += 1
    return counts


def count_crossings(rays, line, settings, s_low, s_step, s_bins, z_low, z_step, z_bins):
    """Counts (5, s_bins, z_bins) of the rays by label and by where they cross the plane of ``line``.

    WALL ends at the plane, SHALLOW within the depth of a wall behind it, DEEP farther behind,
    BEFORE within ``gap/front_depth`` before it, FRONT farther before it.
    """
    scan = settings.gap
    return _crossings(
        rays.points, rays.noise, rays.returned, rays.origin, line.origin, line.along, line.normal, line.lean,
        line.height, scan.tolerance, scan.tolerance_sigmas, scan.reveal_depth, scan.front_depth, s_low, s_step,
        s_bins, z_low, z_step,
        z_bins, settings.ground.floor_height)


class Crossings(NamedTuple):
    """Rays near one gap, each array (n,): ``s``, ``offset``, ``z`` of the end point in the wall's frame,
    ``s_cross``, ``z_cross`` where the ray meets the plane, ``label``, ``noise`` [m] across the plane."""

    s: np.ndarray
    offset: np.ndarray
    z: np.ndarray
    s_cross: np.ndarray
    z_cross: np.ndarray
    label: np.ndarray
    noise: np.ndarray

    def where(self, mask):
        """The rays that ``mask`` selects."""
        return Crossings(*(column[mask] for column in self))


@njit(cache=True, error_model="numpy")
def _near(points, noise, returned, origin, line_origin, along, normal, lean, height, tolerance, sigmas, deep,
          s_min, s_max, z_min, z_max, near_front, front, back, floor):
    total = points.shape[1]
    out = np.empty((6, total), np.float32)
    labels = np.empty(total, np.int8)
    n = 0
    ox, oy = np.float32(line_origin[0]), np.float32(line_origin[1])
    ax, ay = np.float32(along[0]), np.float32(along[1])
    nx, ny = np.float32(normal[0]), np.float32(normal[1])
    lean, height, eye = np.float32(lean), np.float32(height), np.float32(origin[2])
    cs = (np.float32(origin[0]) - ox) * ax + (np.float32(origin[1]) - oy) * ay
    reach = -((np.float32(origin[0]) - ox) * nx + (np.float32(origin[1]) - oy) * ny - lean * (eye - height))
    least = np.float32(0.05) * reach
    for i in range(total):
        dx, dy, z = points[0, i] - ox, points[1, i] - oy, points[2, i]
        offset = dx * nx + dy * ny - lean * (z - height)
        way = offset + reach
        if way < least:
            continue
        s = dx * ax + dy * ay
        f = reach / way
        if i >= returned and f > 0.48:
            continue
        sc = cs + (s - cs) * f
        zc = eye + (z - eye) * f
        crosses = s_min <= sc <= s_max and z_min <= zc <= z_max
        ends = s_min <= s <= s_max and z_min <= z <= z_max and front < offset < back
        if not (crosses or ends):
            continue
        out[0, n], out[1, n], out[2, n], out[3, n], out[4, n] = s, offset, z, sc, zc
        out[5, n] = noise[i] * way
        labels[n] = 2 if i >= returned else _label(
            offset, z, noise[i], reach, tolerance, sigmas, deep, near_front, floor)
        n += 1
    return out[:, :n], labels[:n]


def near(rays, line, settings, s_min, s_max, before=0.0):
    """The rays that cross a stretch of the plane, or end before or behind it, as Crossings.

    Heights from ``gap/low`` to over the lintel; the space from ``volume/passage_before`` before to
    ``volume/passage`` behind.
    """
    scan, volume = settings.gap, settings.volume
    table, labels = _near(
        rays.points, rays.noise, rays.returned, rays.origin, line.origin, line.along, line.normal, line.lean,
        line.height, scan.tolerance, scan.tolerance_sigmas, scan.reveal_depth, s_min, s_max, scan.low,
        settings.door.height + 0.4, scan.front_depth, -max(volume.passage_before + 0.1, before),
        volume.passage + 0.5,
        settings.ground.floor_height)
    return Crossings(table[0], table[1], table[2], table[3], table[4], labels, table[5])


def line_from_normal(normal, point, sensor_xy, lean=0.0, height=0.0):
    """A ``Line`` with its origin at the sensor's foot on it."""
    normal = np.asarray(normal, dtype=float)
    normal = normal / np.hypot(*normal)
    sensor_xy = np.asarray(sensor_xy, dtype=float)
    reach = float((np.asarray(point, dtype=float) - sensor_xy) @ normal)
    if reach < 0.0:
        normal, reach, lean = -normal, -reach, -lean
    return Line(sensor_xy + reach * normal, np.array([normal[1], -normal[0]]), normal, lean, height)
