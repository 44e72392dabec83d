"""The detector before the doors of real buildings, whose laser maps stand as walls."""
from typing import NamedTuple, Tuple

import numpy as np

from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control import doorway, se2
from wheelchair_shared_control.experiments.detector_study import matches
from wheelchair_shared_control.simulation import doors, outlines, scenes, starts, world

SAME_WIDTH = 0.15  # m
PASSAGE = 0.6  # m
JAMB = 0.12  # m
MAX_STARTS = 60  # draws until one has both jambs in view


class View(NamedTuple):
    """One start before a door: the door's true pose and width, what was found of it, and the rest."""

    name: str
    side: int
    door: object
    base: np.ndarray
    found: object
    error: np.ndarray
    false: Tuple
    others: int
    detection: object
    image: np.ndarray


def views(studio, map_path, doors_path, seed, starts_each=10, widths=(0.75, 1.25)):
    """Yield a ``View`` for ``starts_each`` starts on either side of every door whose clear width is in ``widths``."""
    site = scenes.load(str(map_path))
    shapes = outlines.from_world(site)
    annotated = [doors.measure(site, annotation) for annotation in doors.read(doors_path).values()]
    for number, annotation in enumerate(doors.read(doors_path).values()):
        for side in (0, 1):
            door = doors.measure(site, annotation, side)
            if not widths[0] <= door.width <= widths[1]:
                continue
            rng = np.random.default_rng((seed, number, side))
            boxes = _near(site.boxes, door.pose[:2], 12.0)
            done = 0
            for _ in range(MAX_STARTS):
                if done == starts_each:
                    break
                base = starts.draw_real_start(site, door, rng, shapes=shapes)
                if base is None:
                    break
                image, truth = studio.look(boxes, base, rng)
                if not jambs_in_view(studio, door, base, truth):
                    continue
                done += 1
                yield _examine(studio, site, annotated, annotation.name, side, door, base, image)


def jambs_in_view(studio, door, base, truth):
    """Are both jambs within the image, and seen?

    The ends of the clear width, in the door's plane, lie between the image's left and right edge, and the depth
    image holds points within 0.12 m of each, at three heights or more.
    """
    half = door.width / 2.0
    world_from_camera = cameras.lifted(base) @ studio.base_from_camera
    ends = se2.transform_points(door.pose, np.array([[0.0, half], [0.0, -half]]))
    for height in (0.5, 1.0):
        x, _, z, _ = np.linalg.inv(world_from_camera) @ np.column_stack((ends, np.full(2, height), np.ones(2))).T
        column = studio.camera.fx * x / np.maximum(z, 1e-6) + studio.camera.cx
        if not ((z > 0.0) & (column >= 0.0) & (column <= studio.camera.width - 1)).all():
            return False
    points = cameras.back_project(studio.camera, truth).reshape(-1, 3)[::3]
    points = points[np.isfinite(points).all(axis=1) & (points[:, 2] < studio.wheelchair.camera.max_range)]
    points = points @ world_from_camera[:3, :3].T + world_from_camera[:3, 3]
    points = points[points[:, 2] > 0.2]
    local = se2.transform_points(se2.inverse(door.pose), points[:, :2])
    for sign in (-1.0, 1.0):
        at = (np.abs(sign * local[:, 1] - half - 0.03) < JAMB) & (np.abs(local[:, 0]) < door.thickness / 2.0 + JAMB)
        if len(np.unique((points[at, 2] / 0.15).astype(int))) < 3:
            return False
    return True


def is_opening(site, pose, width):
    """Is a doorway that nobody annotated an opening of the map all the same?

    The cells of the gap, and those of a passage 0.6 m long to both sides of its plane, are free (but for the
    outermost 0.10 m), and an occupied cell stands within 0.15 m of either end.
    """
    across = np.linspace(-width / 2.0 + 0.10, width / 2.0 - 0.10, 15)
    along = np.linspace(-PASSAGE, PASSAGE, 25)
    grid = np.stack(np.meshgrid(along, across), axis=-1).reshape(-1, 2)
    if not world.is_free(site.floor, se2.transform_points(pose, grid)).mean() > 0.98:
        return False
    ring = np.stack(np.meshgrid(np.linspace(-0.15, 0.15, 7), np.linspace(-0.15, 0.15, 7)), axis=-1).reshape(-1, 2)
    return all(
        not world.is_free(site.floor, se2.transform_points(pose, ring + (0.0, sign * (width / 2.0 + 0.05)))).all()
        for sign in (-1.0, 1.0))


def _is_one_of(annotated, pose):
    """Does a doorway match an annotated door, from either side?"""
    other = se2.compose(pose, np.array([0.0, 0.0, np.pi]))
    return any(matches(pose, door.pose) or matches(other, door.pose) for door in annotated)


def _near(boxes, middle, reach):
    away = np.hypot(boxes[:, 0] - middle[0], boxes[:, 1] - middle[1]) - np.hypot(boxes[:, 4], boxes[:, 5])
    return boxes[away < reach]


def _examine(studio, site, annotated, name, side, door, base, image):
    detection = doorway.detect_depth(image, studio.camera, studio.base_from_camera, studio.detector_settings, 1)
    found, error, false, others = None, np.full(4, np.nan), [], 0
    for item in detection.doorways:
        pose = se2.compose(base, item.pose)
        if found is None and matches(pose, door.pose):
            found = pose
            error = np.append(se2.compose(se2.inverse(door.pose), pose), item.width - door.width)
        elif _is_one_of(annotated, pose) or is_opening(site, pose, item.width):
            others += 1
        else:
            false.append(pose)
    return View(name, side, door, base, found, error, tuple(false), others, detection, image)
