"""Open doorways in the readings of a depth sensor (Goil 2013, section III-D, after Derry and Argall 2013).

Walls are planes found by RANSAC; every wall is scanned for gaps of door width; a gap is an open doorway if next
to nothing stands in the volume between its jambs, from the floor up, and rays are seen to pass through it.
"""
from typing import NamedTuple, Tuple

import numpy as np
import open3d as o3d

from wheelchair_shared_control import (
    doorway_gaps,
    doorway_ground,
    doorway_jambs,
    doorway_narrows,
    doorway_rays,
    doorway_stagger,
    doorway_volume,
    doorway_walls,
)
from wheelchair_shared_control.camera import Camera
from wheelchair_shared_control.camera import base_from_camera as base_from_camera_of
from wheelchair_shared_control.doorway_tracker import DoorwayTracker
from wheelchair_shared_control.values import Doorway

SAME_WIDTH = 0.04  # m: doorways of one place that differ by less are equally wide


class FoundGap(NamedTuple):
    """A gap and what became of it: ``ends`` (2, 2) [m]; ``reason`` empty if it is a doorway."""

    ends: np.ndarray
    reason: str


class Detection(NamedTuple):
    """``doorways``, ``walls`` and ``gaps`` in the frame of the input's floor; ``reason`` says why there is no
    doorway; ``ground`` is how the floor was found."""

    doorways: Tuple[Doorway, ...]
    walls: Tuple[doorway_walls.Wall, ...]
    gaps: Tuple[FoundGap, ...]
    reason: str
    ground: doorway_ground.Ground


def detect_depth(image, camera, base_from_camera, settings, seed=0, stamp=0.0):
    """Doorways in one depth image.

    ``image`` (height, width) [m]; ``base_from_camera`` (4, 4) lifts the optical frame into a frame whose z = 0 is
    about the floor. The floor is found within the limits of ``ground/*`` about it; where too little of it is seen
    the mounting is believed. Doorways come in that frame, x y yaw about its z.
    """
    seeded(seed)
    image = np.asarray(image)
    transform = np.asarray(base_from_camera, dtype=float)
    if image.ndim != 2 or image.shape != (camera.height, camera.width):
        return nothing("the image is %s, the camera %d x %d" % (
            " x ".join(str(n) for n in image.shape[::-1]), camera.width, camera.height))
    step = max(1, int(round(np.sqrt(image.size / 5000.0))))
    coarse = doorway_rays.from_image(image, camera, transform, settings, step, step)
    if coarse.returned < settings.ground.min_points:
        return nothing("%d valid depths" % coarse.returned)
    ground = doorway_ground.Ground(np.eye(4), False, 0)
    corrected = doorway_ground.corrected(coarse.points[:, :coarse.returned].T.astype(float), settings)
    if corrected is not None:
        ground = doorway_ground.Ground(corrected[0], True, corrected[1])
    level_from_camera = ground.level_from_sensor @ transform
    # every column, because columns place the jambs; rows only repeat them
    row_step = max(1, int(round(image.shape[0] / float(settings.sensor.rows))))
    rays = doorway_rays.from_image(image, camera, level_from_camera, settings, row_step)
    few = doorway_rays.transformed(coarse, ground.level_from_sensor)
    return _detect(rays, few.points[:, :few.returned], ground, settings, stamp)


def detect_points(points, settings, origin=(0.0, 0.0, 0.0), level_from_points=None, seed=0, stamp=0.0):
    """Doorways in a cloud of ``points`` (n, 3) [m] seen from ``origin`` (3,).

    ``level_from_points`` (4, 4) lifts the points into a frame whose z = 0 is about the floor (identity if they are
    in it); the floor is then found as in ``detect_depth``.
    """
    seeded(seed)
    points = np.asarray(points)
    if points.ndim != 2 or points.shape[1] != 3:
        return nothing("points of shape %s, not (n, 3)" % (points.shape,))
    rays = doorway_rays.from_points(points, origin, settings)
    if rays.returned < settings.ground.min_points:
        return nothing("%d valid points" % rays.returned)
    if level_from_points is not None:
        rays = doorway_rays.transformed(rays, np.asarray(level_from_points, dtype=float))
    stride = max(1, rays.returned // 20000)
    ground = doorway_ground.Ground(np.eye(4), False, 0)
    corrected = doorway_ground.corrected(rays.points[:, ::stride].T.astype(float), settings)
    if corrected is not None:
        ground = doorway_ground.Ground(corrected[0], True, corrected[1])
        rays = doorway_rays.transformed(rays, corrected[0])
    return _detect(rays, rays.points, ground, settings, stamp)


def warm_up(settings):
    """Compile the array kernels, or load them from the cache: the first image then takes no longer than others."""
    camera = Camera(64, 48, 58.0, 58.0, 31.5, 23.5)
    image = np.full((48, 64), 2.0, np.float32)
    image[:, 20:44] = 4.0
    image[:6] = np.nan  # invalid pixels, as every real image has: the kernels see views of longer arrays
    image.setflags(write=False)  # as an image that came as a message: another form of the kernels
    detect_depth(image, camera, base_from_camera_of(0.0, 1.1, 0.0), settings)
    rays = doorway_rays.from_image(image, camera, base_from_camera_of(0.0, 1.1, 0.0), settings)
    line = doorway_rays.line_from_normal((1.0, 0.0), (2.0, 0.0), (0.0, 0.0))
    doorway_gaps.scan(rays, line, settings)
    doorway_rays.near(rays, line, settings, -1.0, 1.0)


def seeded(seed):
    """Seed open3d's RANSAC: equal input then gives equal doorways."""
    o3d.utility.random.seed(int(seed))


def nothing(reason):
    """The ``Detection`` of an input that cannot be searched."""
    return Detection((), (), (), reason, doorway_ground.Ground(np.eye(4), False, 0))


def _detect(rays, few, ground, settings, stamp):
    chosen = doorway_walls.chosen_points(few, rays.origin[:2], settings)
    walls = doorway_walls.find(chosen, rays.origin[:2], settings)
    headings = doorway_narrows.directions(chosen, settings.narrow)
    found, gaps, doubtful, weak, shut = [], [], [], [], []
    for wall in walls:
        if (wall.line.origin - rays.origin[:2]) @ wall.line.normal < settings.wall.min_distance:
            continue
        scan = doorway_gaps.scan(rays, wall.line, settings)
        for gap in doorway_gaps.gaps(scan, settings):
            doorway, result, both = _examine(rays, wall.line, gap, headings, settings, stamp)
            if result is not None:
                gaps.append(result)
            if both and doorway is None:
                shut.append(result.ends)
            if doorway is not None:
                aligned = doorway_narrows.is_along(headings, doorway.pose[2], settings.wall.join_angle)
                if both and aligned:
                    found.append(doorway)
                elif both or aligned:
                    doubtful.append(doorway)
                else:
                    weak.append(doorway)
    for narrow in doorway_narrows.find(rays, headings, settings):
        doorway, result = _narrow(rays, narrow, found, shut, settings, stamp)
        if result is not None:
            gaps.append(result)
        if doorway is not None:
            found.append(doorway)
    doorways = [doorway_stagger.levelled(rays, doorway, settings)
                for doorway in _distinct(_settled(found, doubtful, weak, settings))]
    return Detection(tuple(doorways), tuple(walls), tuple(gaps), "" if doorways else _why(walls, gaps), ground)


def _examine(rays, line, gap, headings, settings, stamp):
    """One gap, from rough columns to (Doorway or None, FoundGap or None, whether walls run along on both sides)."""
    door, scan = settings.door, settings.gap

    def at(left, right):
        return line.origin + np.outer((left, right), line.along)

    if not (np.isfinite(gap.left) or np.isfinite(gap.right)):
        return None, None, False
    if not np.isfinite(gap.left + gap.right):
        known = gap.left if np.isfinite(gap.left) else gap.right
        side = 1.0 if np.isfinite(gap.left) else -1.0
        other = _other_jamb(rays, line, known, side, settings)
        if other is None:
            return None, FoundGap(at(*sorted((known, known + 0.8 * side))), "one jamb only"), False
        left, right = sorted((known, other))
        gap = gap._replace(left=left, right=right)
    width = gap.right - gap.left
    if width < door.min_width - scan.slack or width > door.max_width + scan.slack:
        return None, FoundGap(at(gap.left, gap.right), "%.2f m wide" % width), False
    if gap.free_standing:
        return None, FoundGap(at(gap.left, gap.right), "between free-standing things"), False
    left, right = gap.left, gap.right
    beside = settings.jamb.wall_window
    for _ in range(2):
        near = doorway_rays.near(rays, line, settings, left - beside, right + beside)
        refined = doorway_jambs.refined_line(near, line, left, right, rays.origin[:2], settings)
        if refined is None:
            return None, FoundGap(at(left, right), "too little wall beside it"), False
        # edges along the old line are carried over to the new one
        ends = at(left, right)
        line, angle_sigma, offset_sigma = refined
        left, right = np.sort((ends - line.origin) @ line.along)
        near = doorway_rays.near(rays, line, settings, left - beside, right + beside)
        jambs = doorway_jambs.refined_edges(near, left, right, settings)
        left, right = jambs.wall_left, jambs.wall_right
        if not jambs.right - jambs.left > 0.3:
            return None, FoundGap(at(gap.left, gap.right), "closed"), False
    along = doorway_jambs.runs_along(near, left, right, settings)
    verdict = doorway_volume.judge(near, jambs, settings)
    left, right = jambs.left, jambs.right
    if verdict.reason:
        return None, FoundGap(at(left, right), verdict.reason), _is_shut(verdict, along, line, headings)
    if not any(along):
        return None, FoundGap(at(left, right), "no wall runs along it"), False
    ends = at(left, right) + jambs.plane * line.normal
    middle = ends.mean(axis=0)
    yaw = float(np.arctan2(line.normal[1], line.normal[0]))
    covariance = _covariance(line, jambs, angle_sigma, offset_sigma, settings)
    # left of someone who walks through: the larger s is to the right
    doorway = Doorway(np.array([middle[0], middle[1], yaw]), float(right - left), verdict.confidence, ends,
                      covariance, stamp)
    return doorway, FoundGap(at(left, right), ""), all(along)


def _is_shut(verdict, along, line, headings):
    """Is a gap surely shut, by what stands in it, and surely a gap of a wall: by both its sides, or by one that runs
    along the building's first direction?"""
    yaw = np.arctan2(line.normal[1], line.normal[0])
    return verdict.is_shut and (all(along) or any(along) and doorway_narrows.is_along(headings[:1], yaw, 3.0))


def _narrow(rays, narrow, found, shut, settings, stamp):
    """A narrow, examined like a gap, unless a doorway was found there already.

    Across a gap between two pieces of wall that is ``shut`` (list of (2, 2)) it is the way past a half-open leaf.
    """
    middle = 0.5 * (narrow.left + narrow.right)
    # a doorway found there stays, unless this is narrower
    narrower = np.hypot(*(narrow.right - narrow.left)) + SAME_WIDTH
    if not _is_new(middle, [doorway for doorway in found if doorway.width < narrower]):
        return None, None
    for ends in shut:
        across = ends[1] - ends[0]
        turn = abs(across @ narrow.normal) / np.hypot(*across)
        if np.hypot(*(ends.mean(axis=0) - middle)) < 0.6 and turn > np.sin(np.radians(20.0)):
            return None, None
    line = doorway_rays.line_from_normal(narrow.normal, middle, rays.origin[:2])
    ends = np.array([narrow.left, narrow.right])
    away = middle - rays.origin[:2]
    slant = np.arctan2(away @ line.along, away @ line.normal)
    if abs(slant) > np.radians(settings.narrow.max_aside):
        return None, None
    if (line.origin - rays.origin[:2]) @ line.normal < settings.wall.min_distance:
        return None, None
    left, right = np.sort((ends - line.origin) @ line.along)
    near = doorway_rays.near(rays, line, settings, left - 0.6, right + 0.6, 1.0)
    jambs = doorway_jambs.Jambs(float(left), float(right), float(left), float(right), 0.5 * narrow.depth,
                                narrow.measured, 0.02)
    verdict = doorway_volume.judge(near, jambs, settings, settings.narrow.margin, settings.volume.leaf)
    if verdict.reason:
        return None, FoundGap(ends, "narrow: " + verdict.reason)
    # looked at from aside, its far side hides how deep it is: then it must at least be as wide as doors are
    leads_on = verdict.deep >= settings.narrow.min_deep
    hidden = right - left < settings.volume.passage * np.tan(abs(slant)) or abs(slant) > np.radians(
        settings.volume.aside)
    if right - left > settings.narrow.usual_width if hidden else not leads_on:
        return None, FoundGap(ends, "narrow: %.0f %% of it seen to lead on" % (100.0 * verdict.deep))
    if doorway_volume.is_beside_walls(near, jambs, slant, settings, leads_on):
        return None, FoundGap(ends, "narrow: between walls along the way")
    covariance = _covariance(line, jambs, settings.narrow.angle_sigma, 0.03, settings)
    pose = np.append(middle, np.arctan2(line.normal[1], line.normal[0]))
    return Doorway(pose, float(right - left), 0.8 * verdict.confidence, ends, covariance, stamp), FoundGap(ends, "")


def _other_jamb(rays, line, known, side, settings):
    """Where the wall does not go on beyond a gap: the nearest thing as tall beside its plane (a wall along the way,
    the end of a partition), or None. ``known`` is the jamb in the wall, ``side`` 1 if the gap lies at larger s."""
    door = settings.door
    reach = door.max_width + settings.gap.slack
    near = doorway_rays.near(rays, line, settings, *sorted((known, known + side * reach)))
    away = side * (near.s - known)
    tall = (near.z > settings.volume.tall) & doorway_jambs.beside_plane(near, settings) & (away > 0.3) & (away < reach)
    if tall.sum() < 2 * settings.jamb.min_reveal:
        return None
    return float(known + side * np.percentile(away[tall], 3))


def _covariance(line, jambs, angle_sigma, offset_sigma, settings):
    """Covariance (3, 3) of x, y, yaw from the errors along and across the wall."""
    across = np.hypot(offset_sigma, 0.005 if jambs.measured else settings.jamb.thickness_sigma)
    along = np.hypot(jambs.edge_sigma, 0.003)
    turn = np.column_stack((line.normal, line.along))
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = turn @ np.diag((across ** 2, along ** 2)) @ turn.T
    covariance[2, 2] = angle_sigma ** 2 + 0.004 ** 2
    return covariance


def _distinct(doorways):
    """One doorway seen in two planes (a wall and its frame) counts once: the narrower one stays, or of equally wide
    ones the more confident."""
    kept = []
    for doorway in sorted(doorways, key=lambda d: -d.confidence):
        near = [k for k, other in enumerate(kept) if not _is_new(doorway.pose, [other])]
        if not near:
            kept.append(doorway)
        elif all(doorway.width < kept[k].width - SAME_WIDTH for k in near):
            kept = [other for k, other in enumerate(kept) if k not in near] + [doorway]
    return sorted(kept, key=lambda d: float(np.hypot(d.pose[0], d.pose[1])))


def _settled(found, doubtful, weak, settings):
    """Doorways (list): those ``found``, the ``doubtful`` ones, and the ``weak`` ones where there is nothing else.

    Doubtful is what the wall on one side alone tells, or walls that run along none of the building's directions. It
    gives way to what else was found at its place with another direction, or narrower, and replaces other things, as it
    is more exact. Weak is what both holds for.
    """
    for doorway in doubtful:
        near = [other for other in found if not _is_new(doorway.pose, [other])]
        agrees = [doorway_narrows.is_along([other.pose[2]], doorway.pose[2], settings.wall.join_angle) and
                  doorway.width < other.width + SAME_WIDTH for other in near]
        if all(agrees):
            found = [other for other in found if _is_new(doorway.pose, [other])] + [doorway]
    for doorway in weak:
        near = [other for other in found if not _is_new(doorway.pose, [other])]
        if not near:
            found = found + [doorway]
    return found


def _is_new(place, found):
    """Was no doorway ``found`` yet at ``place``?"""
    return all(np.hypot(*(doorway.pose[:2] - place[:2])) > 0.6 for doorway in found)


def _why(walls, gaps):
    if not walls:
        return "no wall found"
    if not gaps:
        return "%d wall%s, no gap in %s" % (len(walls), "s" * (len(walls) > 1), "them" if len(walls) > 1 else "it")
    told = sorted(set(gap.reason for gap in gaps if gap.reason))
    return "%d gap%s, none an open doorway: %s" % (len(gaps), "s" * (len(gaps) > 1), "; ".join(told[:4]))


__all__ = ["Detection", "DoorwayTracker", "FoundGap", "detect_depth", "detect_points"]
