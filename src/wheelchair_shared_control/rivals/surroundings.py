"""What the rivals ask about the obstacles around the chair: bearings, free directions, time to a collision."""
import numpy as np

from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control import se2, sweep


def points_in_base(tick):
    """The obstacles (n, 2) [m] of a ``Tick`` in ``base_link``."""
    return se2.transform_points(se2.inverse(tick.pose), tick.points)


def nearest_bearing(tick):
    """Bearing [rad] in ``base_link`` of the obstacle nearest to the footprint; None without obstacles."""
    if not len(tick.points):
        return None
    footprint = footprints.from_settings(tick.settings.wheelchair)
    nearest = int(np.argmin(footprints.distance_to_points(footprint, tick.pose, tick.points)))
    dx, dy = tick.points[nearest] - tick.pose[:2]
    return float(se2.wrap_angle(np.arctan2(dy, dx) - tick.pose[2]))


def bearing(pose, point):
    """Bearing [rad] of ``point`` (2,) seen from ``pose`` (3,)."""
    return float(se2.wrap_angle(np.arctan2(point[1] - pose[1], point[0] - pose[0]) - pose[2]))


def free_distances(points_base, angles, half_width, front, reach):
    """How far [m] the chair could drive in each direction (n,) once turned there, at most ``reach``.

    ``points_base`` (m, 2) in ``base_link``; ``angles`` (n,) [rad]; the lane is ``half_width`` [m] to both sides of
    a ray from the axle, and begins at ``front`` [m] ahead of it. What stands in the lane beside the chair gives 0.
    """
    cos, sin = np.cos(angles)[:, None], np.sin(angles)[:, None]
    x, y = points_base[:, 0], points_base[:, 1]
    along, across = cos * x + sin * y, cos * y - sin * x
    beyond = np.where((np.abs(across) < half_width) & (along > 0.0), along - front, reach)
    return np.clip(beyond.min(axis=1, initial=reach), 0.0, reach)


def time_to_collision(tick, command, horizon, step):
    """Time [s] until ``command``, held, ends at an obstacle; inf within ``horizon``."""
    return sweep.time_to_collision(
        tick.settings.wheelchair.footprint, tick.pose, command, tick.points, horizon, step
    )
