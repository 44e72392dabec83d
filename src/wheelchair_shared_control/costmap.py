"""The rolling local costmap: what the sensors have seen about the chair, in the odom frame.

Built for doorways. Returns mark by height; only a look at the height of an obstacle clears it; the newest
look wins over the memory, so that drifting odometry does not close a door; what is out of view is
remembered, unless it was seen only briefly; unknown stays apart from free.
Costs as in costmap_2d: lethal 254, inscribed 253, unknown 255, else floor(252 exp(-k (d - r_inscribed))).
"""
import math
from typing import NamedTuple, Optional, Tuple

import numpy as np

from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control.costmap_cells import (
    DOUBTFUL,
    PRESUMED,
    SEEN,
    apply_counts,
    cells_inside,
    costs,
    drive_over,
    forget_brief,
)
from wheelchair_shared_control.costmap_depth import (
    band_of,
    camera_pitch_error,
    cloud_pitch_error,
    count_holes,
    count_returns,
)
from wheelchair_shared_control.costmap_points import INTRINSICS, SHAPE, count_points
from wheelchair_shared_control.costmap_rays import trace
from wheelchair_shared_control.costmap_surface import find_lethal, measure_to_surface
from wheelchair_shared_control.distance_transform import distance_transform
from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.grid import FREE, LETHAL, UNKNOWN, Grid
from wheelchair_shared_control.values import RANGERS

LETHAL_COST, INSCRIBED_COST, UNKNOWN_COST = 254, 253, 255


class CostmapError(Error):
    """An observation that cannot be used: wrong shape, unknown source, a pose that is not finite."""


class CostmapSnapshot(NamedTuple):
    """One state of the costmap; arrays are (rows, columns), row = y, nobody changes them.

    ``cost`` uint8, from the distances between cells' centres; ``distance`` float32 [m] from a cell's centre to
    the surface in the nearest lethal cell (finer than a cell, see `costmap_surface`), capped;
    ``known`` bool: seen, driven over or presumed; ``presumed`` bool: only taken as free because the chair
    started there, nobody has looked, ``doubtful`` bool: that of it which is farther off;
    ``origin`` outer corner of cell [0, 0] in odom [m]; ``stamp`` [s]: oldest of the required sources'
    newest observations, -inf while one of them has sent nothing; ``surface`` (rows, columns, 4) int8: the boxes
    of the lethal cells, see `costmap_surface`.
    """

    cost: np.ndarray
    distance: np.ndarray
    known: np.ndarray
    resolution: float
    origin: Tuple[float, float]
    stamp: float
    presumed: Optional[np.ndarray] = None
    doubtful: Optional[np.ndarray] = None
    surface: Optional[np.ndarray] = None


def to_grid(snapshot):
    """The snapshot with the values of ``nav_msgs/OccupancyGrid``: 0, 1..98, 99, 100, -1."""
    cells = _WIRE[snapshot.cost]
    cells.setflags(write=False)  # as a grid that came as a message
    return Grid(cells, snapshot.resolution, snapshot.origin, snapshot.stamp, snapshot.surface)


def _wire_values():
    values = np.empty(256, np.int8)
    values[0] = FREE
    inner = np.arange(1, 253)
    values[1:253] = 1 + (97 * (inner - 1)) // 251  # as costmap_2d's publisher
    values[INSCRIBED_COST], values[LETHAL_COST], values[UNKNOWN_COST] = 99, LETHAL, UNKNOWN
    return values


_WIRE = _wire_values()


class Costmap:
    """Memory of the sensors' looks in a window that follows the chair.

    ``settings``: the ``local_costmap`` part of the ``move_base`` parameters; ``wheelchair``: the chair.
    Call `move_to` with the chair's pose, insert observations, then `update`.
    """

    def __init__(self, settings, wheelchair):
        self.settings = settings
        self.resolution = settings.resolution
        self.footprint = footprints.from_settings(wheelchair)
        self._wheelchair = wheelchair
        self._shape = (int(round(settings.height / self.resolution)), int(round(settings.width / self.resolution)))
        self._lethal_odds = math.log(settings.lethal_probability / (1.0 - settings.lethal_probability))
        self._required = [
            name for name in settings.observation_sources.split()
            if getattr(settings, name).expected_update_rate > 0.0
        ]
        self._own = np.zeros(self._shape, bool)
        self._hits, self._floor, self._drops, self._holes = (np.zeros(self._shape, np.int32) for _ in range(4))
        self._bands, self._new_places = np.zeros(self._shape, np.uint16), np.zeros(self._shape, np.uint16)
        self._nearest = np.zeros(self._shape + (2,), np.int16)
        self._lethal, self._boxes = np.zeros(self._shape, bool), np.zeros(self._shape + (4,), np.int8)
        self._touched = np.zeros(self._shape, np.uint8)
        self._bins = np.zeros(61, np.int64)
        self._sphere = np.empty(SHAPE, np.float32)
        self.reset()

    def reset(self):
        """As new: everything unknown but the ground about the next pose, which is taken as free."""
        self._forget_all()
        self.origin = None
        self.pose = None
        self.newest = {}
        self.pitch_error = {}

    def clear(self):
        """Forget all obstacles and all known ground but that under the chair (``clear_costmaps``)."""
        self._forget_all()
        if self.pose is not None:
            self._drive_over()

    def clear_outside(self, radius):
        """Forget everything farther than ``radius`` [m] from ``base_link``."""
        if self.pose is None:
            return
        rows, columns = self._shape
        x = self.origin[0] + (np.arange(columns) + 0.5) * self.resolution - self.pose[0]
        y = self.origin[1] + (np.arange(rows) + 0.5) * self.resolution - self.pose[1]
        far = x[None, :] ** 2 + y[:, None] ** 2 > radius * radius
        for layer, empty in self._layers():
            layer[far] = empty

    def move_to(self, pose):
        """Let the window follow the chair at ``pose`` (3,) in odom. Returns whether the window moved."""
        pose = np.asarray(pose, dtype=float)
        if pose.shape != (3,) or not np.isfinite(pose).all():
            raise CostmapError("the chair's pose is %s, but must be three finite numbers" % (pose,))
        rows, columns = self._shape
        size = np.array([columns, rows]) * self.resolution
        corner = np.round((pose[:2] - size / 2.0) / self.resolution)
        self.pose = pose
        if self.origin is None:
            self._corner = corner.astype(int)
            self.origin = tuple(float(c) for c in corner * self.resolution)
            self._drive_over(self.settings.start_margin)
            return True
        moved = False
        shift = (corner - self._corner).astype(int)
        # in steps, so that most updates keep the window: readers then get small updates
        if np.abs(shift).max() * self.resolution >= 0.1:
            moved = True
            self._shift(*shift)
            self._corner = corner.astype(int)
            self.origin = tuple(float(c) for c in corner * self.resolution)
        self._drive_over()
        return moved

    def insert_depth(self, image, camera, odom_from_camera, stamp, source="camera"):
        """A depth image (height, width) [m]; NaN and 0 invalid, +Inf free, -Inf too near (REP 117, 118).

        ``odom_from_camera`` (4, 4) of the optical frame. Returns False, and changes nothing, where hardly
        a pixel holds information: such a camera is as good as dead, and the grid's stamp shows it.
        """
        settings = self._source(source)
        image = np.ascontiguousarray(image, dtype=np.float32)
        if image.ndim != 2 or image.shape != (camera.height, camera.width):
            raise CostmapError("depth image of shape %s for a camera of %d x %d" % (
                image.shape, camera.width, camera.height))
        transform = self._transform(odom_from_camera)
        if not settings.inf_is_valid:
            image = np.where(np.isposinf(image), np.float32(np.nan), image)
            image.setflags(write=False)  # as images that came in messages: the kernels are compiled for those
        sampled = image[::8, ::8]
        if not (np.isinf(sampled) | (sampled > 0.0)).mean() > 0.01:
            return False
        intrinsics = (camera.fx, camera.fy, camera.cx, camera.cy, 0.0)
        error = camera_pitch_error(image, intrinsics, transform, self.settings.pitch_tolerance, self._bins)
        transform = transform @ _pitched(-self._tracked(source, error))
        self._clear_counters()
        origin = np.array(self.origin)
        limits = self._limits(settings)
        count_returns(image, intrinsics, transform, origin, self.resolution, limits,
                      self._hits, self._bands, self._new_places, self._floor, self._drops)
        count_holes(image, intrinsics, transform, origin, self.resolution,
                    self.settings.floor_near, self.settings.floor_far, self._holes)
        self._apply(image, intrinsics, np.linalg.inv(transform), transform[:3, 3].copy(), settings, source, stamp)
        return True

    def insert_points(self, points_odom, sensor_odom, stamp, source="points"):
        """A point cloud (n, 3) [m] in odom, seen from ``sensor_odom`` (3,). Returns False if none is finite."""
        settings = self._source(source)
        points = np.asarray(points_odom, dtype=np.float64)
        sensor = np.asarray(sensor_odom, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3 or sensor.shape != (3,):
            raise CostmapError("points of shape %s and a sensor of shape %s, but must be (n, 3) and (3,)" % (
                points.shape, sensor.shape))
        self._window()
        error, heading = cloud_pitch_error(points, sensor, self.settings.pitch_tolerance, self._bins)
        if not math.isnan(error):
            points = points.copy()
            points[:, 2] -= math.tan(self._tracked(source, error)) * ((points[:, :2] - sensor[:2]) @ heading)
        self._clear_counters()
        used, filled = count_points(points, sensor, self._sphere, np.array(self.origin), self.resolution,
                                    self._limits(settings), self._hits, self._bands, self._new_places, self._floor,
                                    self._drops)
        if used == 0:
            return False
        # points per radian, for what is many: the cloud's density over the directions that it covers
        density = math.sqrt(used / (filled / INTRINSICS[0] ** 2))
        sphere_from_odom = np.eye(4)
        sphere_from_odom[:3, :3] = ((0, -1, 0), (0, 0, -1), (1, 0, 0))
        sphere_from_odom[:3, 3] = -sphere_from_odom[:3, :3] @ sensor
        self._apply(self._sphere, INTRINSICS, sphere_from_odom, sensor, settings, source, stamp, density)
        return True

    def insert_scan(self, ranges, angles, range_max, odom_from_sensor, height, stamp, source="scan"):
        """A laser scan: ``ranges`` (n,) [m] at ``angles`` (n,) [rad] about the sensor's pose (3,) in odom.

        REP 117: NaN says nothing, +Inf (if ``inf_is_valid``) that nothing lies within range, -Inf that
        something lies nearer than the sensor can tell, and clears nothing. ``height`` [m] of the sensor.
        Returns False, and changes nothing, where no reading says anything.
        """
        settings = self._source(source)
        ranges, angles = np.asarray(ranges, dtype=float), np.asarray(angles, dtype=float)
        if ranges.shape != angles.shape or ranges.ndim != 1:
            raise CostmapError("%d ranges at %d angles" % (ranges.size, angles.size))
        low, high = settings.min_obstacle_height, settings.max_obstacle_height
        if not low <= height <= high:
            raise CostmapError("%s: the scan lies %.2f m above the floor, limits %.2f and %.2f m" % (
                source, height, low, high))
        x, y, yaw = self._pose(odom_from_sensor)
        valid = np.isfinite(ranges) & (ranges > 0.0) & (ranges <= range_max)
        free = np.isposinf(ranges) & settings.inf_is_valid
        if not (valid | free | np.isneginf(ranges)).any():
            return False
        rays = np.zeros((ranges.size, 7))
        rays[:, 0], rays[:, 1], rays[:, 2] = x, y, yaw + angles
        rays[:, 3] = np.where(free, min(range_max, settings.raytrace_range), np.where(
            valid, np.minimum(ranges - self.resolution, settings.raytrace_range), 0.0))
        rays[:, 4] = np.where(valid & (ranges <= settings.obstacle_range), ranges, np.nan)
        rays[:, 5] = 1.0
        self._trace(rays, height, settings, source, stamp)
        return True

    def insert_ranges(self, ranges, pose, source="rangers"):
        """Readings of the infrared rangers, `values.Ranges`, taken at ``pose`` (3,) of the chair in odom.

        A reading marks the arc of its cone, where that is narrow, and clears the cone before it.
        """
        settings = self._source(source)
        pose = self._pose(pose)
        r = self._wheelchair.rangers
        values = np.asarray(ranges.values, dtype=float)
        if values.shape != (len(RANGERS),):
            raise CostmapError("%d range readings, but the chair has %d rangers" % (values.size, len(RANGERS)))
        if np.isnan(values).all():
            return False
        rays = []
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        places = {"front": r.x_front, "middle": r.x_middle, "rear": r.x_rear}
        for name, value in zip(RANGERS, values):
            if math.isnan(value) or (value == math.inf and not settings.inf_is_valid):
                continue
            side, place = name.split("_")
            left = 1.0 if side == "left" else -1.0
            x, y = places[place], left * r.y
            origin = (pose[0] + cos * x - sin * y, pose[1] + sin * x + cos * y)
            direction = pose[2] + left * math.pi / 2.0
            if value == -math.inf:
                # nearer than the sensor can tell: at the side edge, clears nothing
                rays.append((origin[0], origin[1], direction, 0.0, r.inset + 0.6 * self.resolution, 1.0, 0.0))
                continue
            hit = value if r.min_range <= value <= min(r.max_range, settings.obstacle_range) else math.nan
            clear = min(value - 1.5 * self.resolution, settings.raytrace_range, r.max_range)
            reach = min(value, r.max_range)
            # what returned lies somewhere on the arc: certain only where the arc is about a cell
            narrow = r.field_of_view * value < 2.0 * self.resolution
            n = max(int(r.field_of_view * reach / self.resolution), 1) if clear > 0.0 else 1
            for k in sorted(range(-n, n + 1), key=abs):  # the middle first: a cell takes its first weight
                offset = 0.5 * r.field_of_view * k / n
                weight = 1.0 if k == 0 else (0.5 if narrow else 0.0)
                rays.append((origin[0], origin[1], direction + offset, max(clear, 0.0),
                             hit if weight > 0.0 else math.nan, weight, not narrow))
        self._trace(np.array(rays, dtype=float).reshape(-1, 7), r.z, settings, source, ranges.stamp)
        return True

    def update(self, pose, now):
        """Forget what moved away, and return the `CostmapSnapshot` about the chair at ``pose`` (3,)."""
        self.move_to(pose)
        s = self.settings
        forget_brief(self._odds, self._mask, self._known, self._seen, self._last, float(now),
                     s.memory_time, s.static_time)
        find_lethal(self._odds, self._places, self._known, self._lethal_odds, self._lethal, self._boxes)
        distance = np.empty(self._shape, np.float32)
        # what is inflated must be measured
        cap = max(s.distance_cap, s.inflation_radius + 2.0 * self.resolution)
        distance_transform(self._lethal, self.resolution, cap, distance, self._nearest)
        cost = np.empty(self._shape, np.uint8)
        padded = footprints.grown(self.footprint, s.footprint_padding)
        costs(distance, self._known, self.resolution, padded.inscribed_radius, s.inflation_radius,
              s.cost_scaling_factor, s.track_unknown_space, cost)
        measure_to_surface(distance, self._nearest, self._boxes, self.resolution, s.inflation_radius)
        surface = self._boxes.copy()
        surface.setflags(write=False)
        # without any source nothing is ever seen; where none is required, nobody waits for one
        nobody = float(now) if s.observation_sources.split() else -math.inf
        stamp = min((self.newest.get(name, -math.inf) for name in self._required), default=nobody)
        return CostmapSnapshot(cost, distance, self._known.astype(bool), self.resolution, self.origin, stamp,
                               (self._known == PRESUMED) | (self._known == DOUBTFUL), self._known == DOUBTFUL, surface)

    # --- inside ------------------------------------------------------------------------------------------

    def _layers(self):
        """Every layer of the memory with its value for a cell that was never seen."""
        return ((self._odds, 0.0), (self._mask, 0), (self._places, 0), (self._known, 0), (self._seen, 0.0),
                (self._last, -np.inf))

    def _forget_all(self):
        self._odds = np.zeros(self._shape, np.float32)
        self._mask = np.zeros(self._shape, np.uint16)
        self._places = np.zeros(self._shape, np.uint16)
        self._known = np.zeros(self._shape, np.uint8)
        self._seen = np.zeros(self._shape, np.float32)
        self._last = np.full(self._shape, -np.inf)

    def _shift(self, columns, rows):
        for layer, empty in self._layers():
            moved = np.full_like(layer, empty)
            height, width = self._shape
            if abs(rows) < height and abs(columns) < width:
                moved[max(-rows, 0):height - max(rows, 0), max(-columns, 0):width - max(columns, 0)] = layer[
                    max(rows, 0):height - max(-rows, 0), max(columns, 0):width - max(-columns, 0)]
            layer[:] = moved

    def _drive_over(self, margin=0.0):
        trust = min(margin, self.settings.start_trust)
        for around, how in ((margin, DOUBTFUL), (trust, PRESUMED), (0.0, SEEN)):
            if around == 0.0 and how != SEEN:
                continue
            shape = footprints.grown(self.footprint, around)
            cells_inside(self._own, self.pose, shape.front, shape.rear, shape.half_width, np.array(self.origin),
                         self.resolution)
            drive_over(self._odds, self._mask, self._known, self._seen, self._own, self.settings.log_odds_min, how)

    def _source(self, name):
        try:
            return getattr(self.settings, name)
        except AttributeError:
            raise CostmapError("no observation source '%s' in local_costmap" % name)

    def _window(self):
        if self.origin is None:
            raise CostmapError("the chair's pose is not known yet")

    def _pose(self, pose):
        self._window()
        pose = np.asarray(pose, dtype=float)
        if pose.shape != (3,) or not np.isfinite(pose).all():
            raise CostmapError("the sensor's pose is %s, but must be three finite numbers" % (pose,))
        return pose

    def _transform(self, transform):
        self._window()
        transform = np.asarray(transform, dtype=float)
        if transform.shape != (4, 4) or not np.isfinite(transform).all():
            raise CostmapError("the camera's transform must be a finite 4 x 4 matrix")
        return transform

    def _tracked(self, source, error):
        """The error of a source's pitch [rad]; where no floor is seen (NaN), the last one, fading."""
        if math.isnan(error):
            error = 0.5 * self.pitch_error.get(source, 0.0)
        self.pitch_error[source] = error
        return error

    def _limits(self, source):
        s = self.settings
        return (source.min_obstacle_height, source.max_obstacle_height, source.obstacle_range, source.raytrace_range,
                s.floor_tolerance, s.floor_near, s.floor_far, self._wheelchair.camera.min_range)

    def _clear_counters(self):
        for counter in (self._hits, self._bands, self._new_places, self._floor, self._drops, self._holes):
            counter.fill(0)

    def _since(self, source, stamp):
        """Time [s] that a look of ``source`` stands for, and note its stamp."""
        before = self.newest.get(source, -math.inf)
        self.newest[source] = float(stamp)  # also an earlier one: a stamp from the future must not last
        return min(max(stamp - before, 0.0), 0.2) if math.isfinite(before) else 0.0

    def _apply(self, image, intrinsics, camera_from_odom, position, source_settings, source, stamp, density=None):
        s = self.settings
        dt = self._since(source, stamp)
        per_radian = density if density is not None else 0.0
        apply_counts(
            self._odds, self._mask, self._places, self._known, self._seen, self._last,
            self._hits, self._bands, self._new_places, self._floor, self._drops, self._holes, self._own,
            image, intrinsics, camera_from_odom, position, np.array(self.origin), self.resolution,
            per_radian, source_settings.raytrace_range,
            s.hit, s.miss, s.log_odds_min, s.log_odds_max,
            source_settings.marking, source_settings.clearing, float(stamp), dt)

    def _trace(self, rays, height, source_settings, source, stamp):
        s = self.settings
        band = band_of(height)
        dt = self._since(source, stamp)
        if not source_settings.marking:
            rays[:, 4] = np.nan
        if not source_settings.clearing:
            rays[:, 3] = 0.0
        self._touched.fill(0)
        trace(self._odds, self._mask, self._places, self._known, self._seen, self._last, self._touched, self._own, rays,
              np.array(self.origin), self.resolution, band, s.hit, s.miss, s.log_odds_min,
              s.log_odds_max, float(stamp), dt)


def _pitched(angle):
    """Rotation (4, 4) of the optical frame about its x axis (right)."""
    cos, sin = math.cos(angle), math.sin(angle)
    rotation = np.eye(4)
    rotation[1:3, 1:3] = ((cos, -sin), (sin, cos))
    return rotation
