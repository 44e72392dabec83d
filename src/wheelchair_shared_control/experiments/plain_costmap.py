"""Costmap update and features in straightforward NumPy and SciPy: what the benchmark measures ours against.

The same job with the usual means: every pixel is projected, cells are counted with ``bincount``, each direction
is cleared up to its farthest return, probabilities are log-odds, SciPy gives the distance transform. It has
none of the height bands, drop-offs, memory rules and surfaces of `costmap.Costmap`: it does less.
"""
import numpy as np
from scipy import ndimage

from wheelchair_shared_control import se2
from wheelchair_shared_control.grid import LETHAL

DIRECTIONS = 720


class PlainCostmap:
    """A window of ``shape`` cells whose outer corner lies at ``origin`` (2,) in odom, without scrolling."""

    def __init__(self, settings, shape, origin):
        self.settings, self.shape, self.origin = settings, shape, np.asarray(origin, dtype=float)
        self.odds = np.zeros(shape, np.float32)
        self.known = np.zeros(shape, bool)
        rows, columns = shape
        self._x = self.origin[0] + (np.arange(columns) + 0.5) * settings.resolution
        self._y = self.origin[1] + (np.arange(rows) + 0.5) * settings.resolution

    def update(self, image, camera, odom_from_camera, inscribed_radius):
        """Take in a depth image (height, width) [m]; returns cost (rows, columns) uint8 and distance [m]."""
        s, source = self.settings, self.settings.camera
        m = np.asarray(odom_from_camera, dtype=np.float32)
        z = image.ravel()
        rays_x = np.tile((np.arange(camera.width, dtype=np.float32) - camera.cx) / camera.fx, camera.height)
        rays_y = np.repeat((np.arange(camera.height, dtype=np.float32) - camera.cy) / camera.fy, camera.width)
        valid = np.isfinite(z) & (z > 0.0)
        z, rays_x, rays_y = z[valid], rays_x[valid], rays_y[valid]
        x, y, height = ((m[k, 0] * rays_x + m[k, 1] * rays_y + m[k, 2]) * z + m[k, 3] for k in range(3))
        columns = np.floor((x - self.origin[0]) / s.resolution).astype(np.int32)
        rows = np.floor((y - self.origin[1]) / s.resolution).astype(np.int32)
        inside = (rows >= 0) & (columns >= 0) & (rows < self.shape[0]) & (columns < self.shape[1])
        marks = inside & (height > source.min_obstacle_height) & (height < source.max_obstacle_height)
        cells = np.prod(self.shape)
        hits = np.bincount(rows[marks] * self.shape[1] + columns[marks], minlength=cells).reshape(self.shape)
        # clear each direction up to its farthest return
        dx, dy = x - m[0, 3], y - m[1, 3]
        direction = ((np.arctan2(dy, dx) + np.pi) * (DIRECTIONS / (2.0 * np.pi))).astype(np.int32) % DIRECTIONS
        farthest = np.zeros(DIRECTIONS, np.float32)
        np.maximum.at(farthest, direction, np.minimum(np.hypot(dx, dy), source.raytrace_range))
        cell_x, cell_y = self._x[None, :] - m[0, 3], self._y[:, None] - m[1, 3]
        of_cell = ((np.arctan2(cell_y, cell_x) + np.pi) * (DIRECTIONS / (2.0 * np.pi))).astype(np.int32) % DIRECTIONS
        free = (np.hypot(cell_x, cell_y) < farthest[of_cell]) & (hits == 0)
        occupied = hits > 2
        self.odds = np.clip(self.odds + s.hit * occupied - s.miss * free, s.log_odds_min, s.log_odds_max)
        self.known |= free | occupied
        lethal = self.odds > np.log(s.lethal_probability / (1.0 - s.lethal_probability))
        distance = s.resolution * ndimage.distance_transform_edt(~lethal) if lethal.any() else np.full(
            self.shape, s.distance_cap)
        cost = np.where(distance <= inscribed_radius, 253.0, np.floor(
            252.0 * np.exp(-s.cost_scaling_factor * (distance - inscribed_radius))))
        cost[distance > s.inflation_radius] = 0.0
        cost[~self.known] = 255.0
        cost[lethal] = 254.0
        return cost.astype(np.uint8), distance


def plain_features(grid, pose, footprint, max_range=2.0):
    """``(d_l, d_f, d_r)`` [m] as `features.distances`, vectorised over the occupied cells."""
    rows, columns = np.nonzero(grid.cells == LETHAL)
    points = np.column_stack((columns + 0.5, rows + 0.5)) * grid.resolution + np.asarray(grid.origin)
    x, y = se2.transform_points(se2.inverse(np.asarray(pose, dtype=float)), points).T
    ahead, side = np.maximum(x - footprint.front, 0.0), np.abs(y) - footprint.half_width
    distance = np.minimum(np.hypot(ahead, np.maximum(side, 0.0)), max_range)
    to_edge = np.minimum(footprint.front - x, -side)
    under = (x >= footprint.rear) & (to_edge >= 0.0)
    front = ((side <= 0.0) & (x > footprint.front)) | (under & (to_edge == footprint.front - x))
    left = ((x >= footprint.rear) & (y > footprint.half_width)) | (under & (to_edge == -side) & (y >= 0.0))
    right = ((x >= footprint.rear) & (-y > footprint.half_width)) | (under & (to_edge == -side) & (y <= 0.0))
    return tuple(float(distance[region].min(initial=max_range)) for region in (left, front, right))
