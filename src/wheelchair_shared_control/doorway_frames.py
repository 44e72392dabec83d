"""Doorways in an observation whose floor nobody has told: which way is up, where is the floor."""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import doorway, doorway_ground
from wheelchair_shared_control.camera import back_project

AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}
# What looks ahead in the usual frames: bodies (z up, x ahead), optical frames (y down, z ahead), OpenGL (y up, z back)
AHEAD = {"z": (1, 0, 0), "-z": (1, 0, 0), "-y": (0, 0, 1), "y": (0, 0, -1), "x": (0, 0, -1), "-x": (0, 0, 1)}
# Guesses for an unknown cloud, the most usual first, with their weights
GUESSES = (("z", 1.0), ("-y", 1.0), ("y", 0.2), ("-z", 0.02), ("x", 0.02), ("-x", 0.02))
LOWEST, HIGHEST = 0.2, 2.5  # m: a sensor's usual height above the floor
# m: farther is a number that stands for nothing (65.535 m is the largest of 16 bits), in a cloud one out of memory
FARTHEST_DEPTH, FARTHEST_POINT = 50.0, 1e7
MILLIMETRES = 100.0  # m: a cloud half of which lies farther away is in another unit
ON_FLOOR = 0.05  # m: no sensor is that low; the cloud's frame is a floor's, or a chair's
ASSUMED_HEIGHT = 1.1  # m of the sensor above the origin of such a frame


class Located(NamedTuple):
    """A ``Detection`` in the frame on the floor under the sensor, with the points (n, 3) [m] it was made from."""

    detection: doorway.Detection
    points: np.ndarray
    up: str


def detect(frame, settings, up="auto", seed=0):
    """``Located`` doorways of a ``doorway_files.Frame``.

    ``up``: an axis of the input's frame, or "auto". The floor is the largest plane within ``ground/search_tilt`` of
    it with nothing below. x of the result is the input's direction ahead (``AHEAD``) made horizontal.
    """
    doorway.seeded(seed)
    if frame.depth is not None:
        with np.errstate(invalid="ignore"):
            depth = np.where(frame.depth < FARTHEST_DEPTH, frame.depth, np.nan)
        points = back_project(frame.camera, depth).reshape(-1, 3)
        guesses = (("-y", 1.0),) if up == "auto" else ((up, 1.0),)
    else:
        points = np.asarray(frame.points, dtype=float).reshape(-1, 3)
        guesses = GUESSES if up == "auto" else ((up, 1.0),)
    points = points[(np.abs(points) < FARTHEST_POINT).all(axis=1)]  # false for what is not finite
    if len(points) < settings.ground.min_points:
        return Located(doorway.nothing("%d valid points" % len(points)), points, "")
    origin = np.asarray(frame.origin, dtype=float)
    away = float(np.median(np.linalg.norm(points - origin, axis=1)))
    if away > MILLIMETRES:
        return Located(doorway.nothing("half of the points lie farther than %.0f m from the sensor: "
                                       "is the cloud in metres?" % away), points, "")
    level_from_input, chosen = _level(points, origin, guesses, settings)
    if level_from_input is None:
        return Located(doorway.nothing("no floor found"), points, "")
    if frame.depth is not None:
        detection = doorway.detect_depth(frame.depth, frame.camera, level_from_input, settings, seed)
    else:
        # seen from the sensor first: single precision has no centimetres left in the frame of a map far away
        level_from_sensor = level_from_input.copy()
        level_from_sensor[:3, 3] += level_from_input[:3, :3] @ origin
        sensor = np.zeros(3)
        if abs(level_from_sensor[2, 3]) < ON_FLOOR:
            sensor = ASSUMED_HEIGHT * level_from_input[2, :3]
        detection = doorway.detect_points(points - origin, settings, sensor, level_from_sensor, seed)
    level = detection.ground.level_from_sensor @ level_from_input
    return Located(detection, points @ level[:3, :3].T + level[:3, 3], chosen)


def _level(points, origin, guesses, settings):
    """Frame level (4, 4) of the best guess and its name, or (None, "")."""
    few = _thinned(points)
    best, best_score = None, 0.0
    for name, weight in guesses:
        up = np.array(AXES[name], dtype=float)
        plane = doorway_ground.found_along(few, up, settings, settings.ground.search_tilt)
        if plane is None:
            continue
        normal, offset, support = plane
        height = float(origin @ normal + offset)
        usual = LOWEST <= height <= HIGHEST
        score = weight * support * (1.0 if usual else 0.1)
        if score > best_score:
            best, best_score = (doorway_ground.level_from_plane(normal, offset, origin, AHEAD[name]), name), score
    return best if best is not None else (None, "")


def _thinned(points, count=15000, cell=0.04):
    """About ``count`` points (n, 3), evenly over the surfaces."""
    stride = max(1, len(points) // (20 * count))
    points = points[::stride]
    while True:
        keys = np.floor((points - points.min(axis=0)) / cell).astype(np.int64)
        spans = keys.max(axis=0) + 1
        _, first = np.unique((keys[:, 0] * spans[1] + keys[:, 1]) * spans[2] + keys[:, 2], return_index=True)
        if len(first) <= count:
            return points[np.sort(first)]
        cell *= 1.4
