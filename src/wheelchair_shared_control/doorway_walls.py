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


def chosen_points(points, settings):
    """Few of ``points`` (3, n) [m] (level): the mean of each cell, above furniture and below ceilings.

    One point a cell makes a far wall as good as a near one, and averages the noise away.
    """
    wall = settings.wall
    for low in (wall.low, 0.3):
        band = (points[2] > low) & (points[2] < wall.high)
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
    for _ in range(wall.max_planes):
        if len(rest) < wall.min_cells:
            break
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(rest))
        model, inliers = cloud.segment_plane(wall.tolerance, 3, wall.iterations, 1.0)
        if len(inliers) < wall.min_cells:
            break
        mask = np.zeros(len(rest), dtype=bool)
        mask[inliers] = True
        normal = np.asarray(model[:3])
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
