"""Walls: vertical planes found one after the other by open3d's RANSAC on few, well-chosen points."""
from typing import NamedTuple

import numpy as np
import open3d as o3d

from wheelchair_shared_control.doorway_rays import Line, line_from_normal


class Wall(NamedTuple):
    """A vertical plane: ``line`` seen from above, ``ends`` (2, 2) [m] of what is seen of it, ``support`` points."""

    line: Line
    ends: np.ndarray
    support: int


def chosen_points(points, sensor_xy, settings):
    """Few of ``points`` (3, n) [m] (level): the mean of each cell, above furniture and below ceilings, within
    ``wall/reach`` of the sensor.

    One point a cell makes a far wall as good as a near one, and averages the noise away.
    """
    wall = settings.wall
    within = (points[0] - sensor_xy[0]) ** 2 + (points[1] - sensor_xy[1]) ** 2 < wall.reach ** 2
    for low in (wall.low, 0.3):
        band = within & (points[2] > low) & (points[2] < wall.high)
        if band.sum() >= wall.min_points:
            break
    chosen = points[:, band].astype(float)
    if chosen.shape[1] == 0:
        return np.empty((0, 3))
    cell = wall.cell
    while True:
        keys = np.floor(chosen / np.array([[cell], [cell], [3.0 * cell]])).astype(np.int64)
        keys -= keys.min(axis=1, keepdims=True)
        spans = keys.max(axis=1) + 1
        flat = (keys[0] * spans[1] + keys[1]) * spans[2] + keys[2]
        _, inverse, counts = np.unique(flat, return_inverse=True, return_counts=True)
        if len(counts) <= wall.max_points:
            break
        cell *= 1.25
    means = np.stack([np.bincount(inverse, weights=axis) / counts for axis in chosen], axis=1)
    return means


def find(points, sensor_xy, settings):
    """Walls, the best supported first, in ``points`` (n, 3) [m] (level) of ``chosen_points``.

    Planes that lean are taken off too, and forgotten. Coplanar pieces are one plane from the start; planes that
    nearly coincide (a wall and its skirting, two halves of a bent wall) are joined.
    """
    wall = settings.wall
    rest = points
    walls = []
    # a scan all round holds more walls, each a smaller share of it, than a camera's view of some 600 cells
    size = max(1.0, len(points) / 600.0)
    iterations, planes = int(wall.iterations * size ** 2), int(wall.max_planes * size ** 0.5)
    for _ in range(planes):
        if len(rest) < wall.min_cells:
            break
        # with the heights stretched, hardly a point of a desk lies near one level plane, while a wall stays a plane
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(rest * (1.0, 1.0, wall.stretch)))
        model, inliers = cloud.segment_plane(wall.tolerance, 3, iterations, 1.0)
        if len(inliers) < wall.min_cells:
            break
        mask = np.zeros(len(rest), dtype=bool)
        mask[inliers] = True
        normal = np.asarray(model[:3]) * (1.0, 1.0, wall.stretch)
        normal = normal / np.linalg.norm(normal)
        if abs(normal[2]) < np.sin(np.radians(wall.max_lean)):
            found = _vertical(rest[mask], sensor_xy)
            # the vertical plane collects again: the first one leant a little
            mask |= np.abs((rest[:, :2] - found.line.origin) @ found.line.normal) < wall.tolerance
            found = _vertical(rest[np.abs((rest[:, :2] - found.line.origin) @ found.line.normal) < wall.tolerance],
                              sensor_xy)
            if found is not None and not any(_same(found, other, wall) for other in walls):
                walls.append(found)
        rest = rest[~mask]
    return walls


def _vertical(points, sensor_xy):
    """Wall through ``points`` (n, 3), by total least squares in the plane."""
    xy = points[:, :2]
    if len(xy) < 3:
        return None
    centre = xy.mean(axis=0)
    _, _, axes = np.linalg.svd(xy - centre, full_matrices=False)
    line = line_from_normal(axes[1], centre, sensor_xy)
    s = (xy - line.origin) @ line.along
    ends = line.origin + np.outer((s.min(), s.max()), line.along)
    return Wall(line, ends, len(points))


def _same(a, b, wall):
    """Do two planes coincide over the shorter piece?"""
    turn = abs(a.line.normal @ b.line.normal)
    if turn < np.cos(np.radians(wall.join_angle)):
        return False
    return bool((np.abs((a.ends - b.line.origin) @ b.line.normal) < wall.join_offset).all())
