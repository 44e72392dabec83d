"""A world at rest: boxes and meshes on a floor, and the doors in it.

The world's frame has z up, the floor is z = 0 (REP 103).
"""
from typing import NamedTuple, Optional, Tuple

import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.errors import Error


class SceneError(Error):
    """A scene, map, mesh, SDF or doors file that cannot become a world."""


class Door(NamedTuple):
    """A doorway to be crossed.

    ``pose`` (3,) in the world: the middle of the gap at the middle of the wall's thickness, its yaw the
    wall's normal pointing away from the side where the chair starts. ``width`` is clear; all in metres.
    """

    pose: np.ndarray
    width: float
    height: float = 2.0
    thickness: float = 0.12
    name: str = "door"


class FloorMap(NamedTuple):
    """What a map knows of the floor: ``free`` (rows, columns) bool, row = y; unknown is not free.

    ``origin`` (3,) is the pose of the outer corner of cell [0, 0] in the world.
    """

    free: np.ndarray
    resolution: float
    origin: np.ndarray


class World(NamedTuple):
    """Everything the chair can see and touch but the floor.

    ``boxes`` (n, 7): centre x, y, z, yaw, half sizes x, y, z [m, rad]; ``meshes``: tuple of
    (vertices (k, 3) [m], triangles (m, 3) int); ``names``: one for every box, then one for every mesh;
    ``floor`` is known for worlds made from a map only; ``left_out`` says what of the file is missing here.
    """

    boxes: np.ndarray
    meshes: Tuple = ()
    doors: Tuple = ()
    name: str = "world"
    names: Tuple = ()
    floor: Optional[FloorMap] = None
    left_out: Tuple = ()


def box(x, y, z, yaw, length, width, height):
    """A row of ``World.boxes`` from full sizes [m]; ``z`` is that of the centre."""
    return (x, y, z, yaw, length / 2.0, width / 2.0, height / 2.0)


def make(rows, names, **rest):
    """A world of boxes from rows of seven numbers. Raises SceneError for sizes that are not positive."""
    boxes = np.array(rows, dtype=float).reshape(-1, 7)
    for name, row in zip(names, boxes):
        if not np.all(np.isfinite(row)):
            raise SceneError("box '%s' holds a number that is not finite" % name)
        if not np.all(row[4:] > 0.0):
            raise SceneError("box '%s' has a size of %g m, but must be more than 0" % (name, 2.0 * row[4:].min()))
    return World(boxes=boxes, names=tuple(names), **rest)


def opposite(door):
    """The same doorway crossed from its other side."""
    return door._replace(pose=se2.compose(door.pose, np.array([0.0, 0.0, np.pi])))


def jambs(door):
    """Left and right edge (2, 2) of the gap in the door plane, seen along the normal [m]."""
    half = door.width / 2.0
    return se2.transform_points(door.pose, np.array([[0.0, half], [0.0, -half]]))


def is_free(floor, points):
    """Whether each of ``points`` (n, 2) [m] lies on a free cell; off the map is not free."""
    local = se2.transform_points(se2.inverse(floor.origin), points) / floor.resolution
    cells = np.floor(local).astype(int)
    rows, columns = floor.free.shape
    inside = (cells[:, 0] >= 0) & (cells[:, 0] < columns) & (cells[:, 1] >= 0) & (cells[:, 1] < rows)
    result = np.zeros(len(local), dtype=bool)
    result[inside] = floor.free[cells[inside, 1], cells[inside, 0]]
    return result
