"""The floor: the lowest large plane under the sensor, found by RANSAC and not assumed."""
from typing import NamedTuple

import numpy as np
import open3d as o3d


class Ground(NamedTuple):
    """``level_from_sensor`` (4, 4) lifts points into the frame level; ``found`` is False where it was taken from
    the mounting alone; ``support`` is the number of floor points."""

    level_from_sensor: np.ndarray
    found: bool
    support: int


def rotation_between(a, b):
    """The smallest rotation (3, 3) that turns unit vector ``a`` (3,) into ``b`` (3,)."""
    v = np.cross(a, b)
    c = float(np.dot(a, b))
    if c < -0.999999:
        # half a turn about any axis across a
        axis = np.cross(a, (1.0, 0.0, 0.0) if abs(a[0]) < 0.9 else (0.0, 1.0, 0.0))
        axis /= np.linalg.norm(axis)
        return 2.0 * np.outer(axis, axis) - np.eye(3)
    skew = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + skew + skew @ skew / (1.0 + c)


def corrected(points, settings):
    """``level_from_base`` (4, 4), or None, for ``points`` (n, 3) of a frame that is nearly level already.

    Only points within ``ground/search_height`` of z = 0 are asked, so that neither a table nor a bed becomes
    the floor; the plane must lie within ``ground/max_tilt`` and ``ground/max_height`` of the mounting's.
    """
    ground = settings.ground
    # a tilt error lifts far points: the band grows with the distance
    reach = np.hypot(points[:, 0], points[:, 1])
    band = np.abs(points[:, 2]) < ground.search_height + np.tan(np.radians(ground.max_tilt)) * reach * 0.5
    low = points[band]
    if len(low) < ground.min_points:
        return None
    plane = _segment(low, ground.tolerance, ground.iterations)
    if plane is None:
        return None
    normal, offset, support = plane
    if normal[2] < 0:
        normal, offset = -normal, -offset
    if support < ground.min_points or normal[2] < np.cos(np.radians(ground.max_tilt)):
        return None
    if abs(offset) > ground.max_height:
        return None
    below = (points @ normal + offset < -0.10).mean()
    if below > 0.2:
        return None
    return _level(normal, offset, np.zeros(3)), support


def found_along(points, up, settings, tilt_deg):
    """Normal (3,), offset and support of the floor of ``points`` (n, 3), or None.

    ``up`` (3,) is the rough direction of up; the floor is the largest plane within ``tilt_deg`` of it that has
    next to nothing below.
    """
    ground = settings.ground
    rest = points
    best = None
    for _ in range(6):
        if len(rest) < ground.min_points:
            break
        plane = _segment(rest, ground.tolerance, 400)
        if plane is None:
            break
        normal, offset, support = plane
        if normal @ up < 0:
            normal, offset = -normal, -offset
        distance = points @ normal + offset
        if support < ground.min_points:
            break
        if normal @ up > np.cos(np.radians(tilt_deg)):
            below = float((distance < -0.10).mean())
            if below < 0.03 and (best is None or support > 1.5 * best[2]):
                best = (normal, offset, support)
        rest = rest[np.abs(rest @ normal + offset) > 2.0 * ground.tolerance]
    return best


def level_from_plane(normal, offset, origin, forward):
    """Frame level (4, 4) with its origin on the floor under ``origin`` (3,), x along ``forward`` (3,) made
    horizontal."""
    x = np.asarray(forward, dtype=float) - (np.asarray(forward, dtype=float) @ normal) * normal
    length = np.linalg.norm(x)
    if length < 1e-3:
        x = np.cross(normal, (0.0, 1.0, 0.0) if abs(normal[1]) < 0.9 else (1.0, 0.0, 0.0))
        length = np.linalg.norm(x)
    x /= length
    rotation = np.stack((x, np.cross(normal, x), normal))
    foot = np.asarray(origin, dtype=float) - (np.asarray(origin, dtype=float) @ normal + offset) * normal
    transform = np.eye(4)
    transform[:3, :3] = rotation
    transform[:3, 3] = -rotation @ foot
    return transform


def _level(normal, offset, origin):
    transform = np.eye(4)
    transform[:3, :3] = rotation_between(normal, np.array([0.0, 0.0, 1.0]))
    foot = origin - (origin @ normal + offset) * normal
    transform[:3, 3] = origin * (1, 1, 0) - transform[:3, :3] @ foot
    return transform


def _segment(points, tolerance, iterations):
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.ascontiguousarray(points, dtype=float)))
    # probability 1: no early end, whose moment depends on the threads; equal input gives the equal plane
    model, inliers = cloud.segment_plane(tolerance, 3, iterations, 1.0)
    normal = np.asarray(model[:3], dtype=float)
    if not np.isfinite(normal).all() or len(inliers) < 3:
        return None
    # three points define the plane badly, all inliers well
    offset = float(model[3])
    for _ in range(2):
        near = points[np.abs(points @ normal + offset) < tolerance]
        if len(near) < 3:
            break
        centre = near.mean(axis=0)
        _, _, axes = np.linalg.svd(np.cov((near - centre).T))
        fitted = axes[2] if axes[2] @ normal > 0.0 else -axes[2]
        normal, offset = fitted, -float(fitted @ centre)
    return normal, offset, len(inliers)
