"""The ground as a person sees it: how much room the chair has at a pose among a world's walls.

A distance field around one door, in the door's frame (x along the crossing, 0 in the plane), made from what
stands in the chair's height band.
"""
import functools
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.ndimage import distance_transform_edt

from wheelchair_shared_control import se2
from wheelchair_shared_control.simulation import outlines

RESOLUTION = 0.025  # m
REACH = 5.0  # m about the door


class Ground(NamedTuple):
    """``distance`` (rows, columns) float32 [m] to the nearest wall, row = y; ``origin`` the centre of cell [0, 0]."""

    distance: np.ndarray
    origin: np.ndarray


def from_world(world, door_pose):
    """The ground about ``door_pose`` (3,) in a ``World``."""
    shapes = outlines.from_world(world)
    cells = int(round(2.0 * REACH / RESOLUTION)) + 1
    origin = np.array([-REACH, -REACH])
    occupied = np.zeros((cells, cells), dtype=bool)
    for vertices, count in zip(shapes.vertices, shapes.counts):
        _fill(occupied, origin, se2.transform_points(se2.inverse(door_pose), vertices[:count]))
    distance = distance_transform_edt(~occupied) * RESOLUTION if occupied.any() else np.full(occupied.shape, REACH)
    return Ground(np.minimum(distance, 2.0).astype(np.float32), origin)


def _fill(occupied, origin, polygon):
    """Mark the cells that a convex polygon (k, 2), counter-clockwise, covers or passes within half a cell."""
    low = np.floor((polygon.min(axis=0) - origin) / RESOLUTION).astype(int)
    high = np.ceil((polygon.max(axis=0) - origin) / RESOLUTION).astype(int)
    low = np.maximum(low, 0)
    high = np.minimum(high, np.array(occupied.shape)[::-1] - 1)
    if np.any(low > high):
        return
    x = origin[0] + RESOLUTION * np.arange(low[0], high[0] + 1)
    y = origin[1] + RESOLUTION * np.arange(low[1], high[1] + 1)
    inside = np.ones((len(y), len(x)), dtype=bool)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0)):
        edge = b - a
        length = np.hypot(*edge)
        if length < 1e-9:
            continue
        left = (edge[0] * (y[:, None] - a[1]) - edge[1] * (x[None, :] - a[0])) / length
        inside &= left >= -0.5 * RESOLUTION
    occupied[low[1]: high[1] + 1, low[0]: high[0] + 1] |= inside


@functools.lru_cache(maxsize=8)
def probes(chair):
    """Points (n, 2) of the outline and (m, 2) of the inside at which room is measured [m], in ``base_link``."""
    x = np.linspace(chair.rear, chair.front, 1 + int(np.ceil(chair.length / 0.05)))
    y = np.linspace(-chair.half_width, chair.half_width, 1 + int(np.ceil(chair.width / 0.05)))
    edge = np.concatenate([
        np.column_stack((x, np.full_like(x, chair.half_width))),
        np.column_stack((x, np.full_like(x, -chair.half_width))),
        np.column_stack((np.full_like(y, chair.front), y)),
        np.column_stack((np.full_like(y, chair.rear), y)),
    ])
    inside_x, inside_y = np.meshgrid(x[2:-2:2], y[2:-2:2])
    return edge, np.column_stack((inside_x.ravel(), inside_y.ravel()))


def room(ground, chair, poses):
    """Distance (n,) [m] from the chair's outline at ``poses`` (n, 3) to the nearest wall; 0 or less: it touches."""
    edge, inside = probes(chair)
    poses = np.atleast_2d(np.asarray(poses, dtype=float))
    return _room(ground.distance, ground.origin[0], ground.origin[1], RESOLUTION, edge, inside, poses)


@njit(cache=True)
def _room(distance, x0, y0, resolution, edge, inside, poses):
    result = np.empty(len(poses))
    rows, columns = distance.shape
    for i in range(len(poses)):
        cos, sin = np.cos(poses[i, 2]), np.sin(poses[i, 2])
        least = 1e9
        for k in range(len(edge) + len(inside)):
            if k < len(edge):
                px, py, less = edge[k, 0], edge[k, 1], 0.0
            else:
                # a thin thing between the probes of the inside is at most this far from one of them
                px, py, less = inside[k - len(edge), 0], inside[k - len(edge), 1], 0.075
            column = int(np.round((poses[i, 0] + cos * px - sin * py - x0) / resolution))
            row = int(np.round((poses[i, 1] + sin * px + cos * py - y0) / resolution))
            if 0 <= row < rows and 0 <= column < columns:
                d = distance[row, column] - less
            else:
                d = 0.0  # beyond the horizon: not a way
            if d < least:
                least = d
                if least <= 0.0:
                    break
        result[i] = least
    return result
