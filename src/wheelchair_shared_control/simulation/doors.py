"""Annotated doors of a real building: clear width, plane and middle of the gap, from the map itself.

A doors file is a list of mappings: ``name``, ``door_corner_pt_1`` and ``_2`` (x, y), and ``approach``, two
poses (``point``: x, y, yaw), one on each side; they only say which side is which.
"""
from typing import NamedTuple

import numpy as np
import yaml

from wheelchair_shared_control import se2
from wheelchair_shared_control.simulation import outlines
from wheelchair_shared_control.simulation.world import Door, SceneError

REACH = 0.30    # m to either side of the door line
STEP = 0.005    # m between the lines that are measured
SEARCH = 6.0    # m along a line
SAME = 1e-3     # m: runs that differ by less count as equally wide


class Annotation(NamedTuple):
    """A door as a person clicked it: ``corners`` (2, 2), ``approaches`` (2, 2) one on each side, in the world."""

    name: str
    corners: np.ndarray
    approaches: np.ndarray
    source: str


def read(path):
    """The annotations of a doors file as {name: Annotation}, in its order. Raises SceneError."""
    path = str(path)
    try:
        with open(path, encoding="utf-8") as stream:
            content = yaml.safe_load(stream)
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError("%s: cannot be read: %s" % (path, getattr(error, "strerror", None) or error))
    except yaml.YAMLError as error:
        raise SceneError("%s: is no YAML: %s" % (path, " ".join(str(error).split())))
    if not isinstance(content, list) or not content:
        raise SceneError("%s: holds no list of doors" % path)
    doors = {}
    for index, entry in enumerate(content):
        where = "%s: door %d" % (path, index + 1)
        if not isinstance(entry, dict) or "name" not in entry:
            raise SceneError("%s: key 'name' is missing" % where)
        name = str(entry["name"])
        where = "%s: door '%s'" % (path, name)
        if name in doors:
            raise SceneError("%s stands there twice" % where)
        corners = np.array([_point(entry, key, where) for key in ("door_corner_pt_1", "door_corner_pt_2")])
        if np.hypot(*(corners[1] - corners[0])) < 0.1:
            raise SceneError("%s: its corners are %.2f m apart, but must be at least 0.1 m"
                             % (where, np.hypot(*(corners[1] - corners[0]))))
        approach = entry.get("approach")
        if not isinstance(approach, list) or len(approach) != 2 or not all(isinstance(a, dict) for a in approach):
            raise SceneError("%s: 'approach' must be a list of two mappings" % where)
        approaches = np.array([_point(side, "point", where) for side in approach])
        side = _beside(corners, approaches)
        if side[0] * side[1] >= 0.0:
            raise SceneError("%s: both approach points stand on one side of it" % where)
        doors[name] = Annotation(name, corners, approaches, path)
    return doors


def measure(world, annotation, side=0):
    """The ``Door`` of an annotation, to be crossed from its approach ``side`` (0 or 1). Raises SceneError.

    The clear width is the smallest free run of the world on lines parallel to the corners' within 0.3 m; the
    plane is the middle of the band of lines with that run, the middle of the gap is that of the run.
    """
    if side not in (0, 1):
        raise SceneError("door '%s': side is %r, but must be 0 or 1" % (annotation.name, side))
    first, second = annotation.corners
    middle, length = 0.5 * (first + second), np.hypot(*(second - first))
    along = (second - first) / length
    normal = np.array([-along[1], along[0]])
    shapes = outlines.near(outlines.from_world(world), middle, SEARCH + REACH)
    count = int(round(2.0 * REACH / STEP))
    # between the cells' borders, where a line would run along a wall's face
    offsets = -REACH + (np.arange(count) + 0.5) * STEP
    runs = [_run(shapes, middle + offset * normal, along, length / 2.0) for offset in offsets]
    found = [(offset, run) for offset, run in zip(offsets, runs) if run is not None]
    if not found:
        raise SceneError("%s: door '%s': no free run between its corners in %s"
                         % (annotation.source, annotation.name, world.name))
    width = min(high - low for _, (low, high) in found)
    band = [(offset, run) for offset, run in found if run[1] - run[0] <= width + SAME]
    plane = 0.5 * (band[0][0] + band[-1][0])
    _, run = min(band, key=lambda item: abs(item[0] - plane))
    centre = middle + plane * normal + 0.5 * (run[0] + run[1]) * along
    # the normal points away from the side of the start
    sign = -1.0 if _beside(annotation.corners, annotation.approaches)[side] > 0.0 else 1.0
    yaw = np.arctan2(sign * normal[1], sign * normal[0])
    thickness = band[-1][0] - band[0][0] + STEP
    return Door(np.array([centre[0], centre[1], yaw]), float(width), 2.0, float(thickness), annotation.name)


def _run(shapes, point, along, half):
    """The free run (from, to) that shares most with the stretch between the corners, or None."""
    shared, best = 0.0, None
    for low, high in outlines.free_runs(shapes, point, along, SEARCH):
        overlap = min(high, half) - max(low, -half)
        if overlap > shared:
            shared, best = overlap, (low, high)
    return best


def _beside(corners, points):
    """Signed distances (n,) [m] of points (n, 2) from the line through the corners, left positive."""
    along = corners[1] - corners[0]
    away = points - corners[0]
    return (along[0] * away[:, 1] - along[1] * away[:, 0]) / np.hypot(*along)


def _point(entry, key, where):
    value = entry.get(key)
    numbers = value if isinstance(value, list) and len(value) in (2, 3) else None
    if numbers is None or not all(isinstance(v, (int, float)) and np.isfinite(v) for v in numbers):
        raise SceneError("%s: '%s' is %r, but must be two or three finite numbers" % (where, key, value))
    return [float(numbers[0]), float(numbers[1])]


def describe(doors):
    """Doors as the content of a doors file: corners at the jambs, approaches 1 m before either side."""
    content = []
    for door in doors:
        ends = se2.transform_points(door.pose, np.array([[0.0, door.width / 2.0], [0.0, -door.width / 2.0]]))
        away = 1.0 + door.thickness / 2.0
        sides = se2.transform_points(door.pose, np.array([[-away, 0.0], [away, 0.0]]))
        yaws = (float(se2.wrap_angle(door.pose[2] + np.pi)), float(door.pose[2]))
        content.append({
            "name": door.name,
            "door_corner_pt_1": [round(float(v), 4) for v in ends[0]],
            "door_corner_pt_2": [round(float(v), 4) for v in ends[1]],
            "approach": [{"from": "side_%d" % index, "point": [round(float(p[0]), 4), round(float(p[1]), 4),
                                                               round(yaw, 4)]}
                         for index, (p, yaw) in enumerate(zip(sides, yaws))],
        })
    return content
