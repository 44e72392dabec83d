"""The chair's outline on the floor: a rectangle whose drive axle is not in its middle."""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import se2


class Footprint(NamedTuple):
    """Rectangle in ``base_link``: x forward, the origin on the drive axle, all in metres."""

    length: float
    width: float
    axle_to_rear: float

    @property
    def front(self):
        """x of the front edge [m]."""
        return self.length - self.axle_to_rear

    @property
    def rear(self):
        """x of the rear edge [m], negative."""
        return -self.axle_to_rear

    @property
    def half_width(self):
        """y of the left edge [m]."""
        return self.width / 2.0

    @property
    def inscribed_radius(self):
        """Radius [m] of the largest circle about ``base_link`` inside the rectangle."""
        return min(self.half_width, self.axle_to_rear, self.front)

    @property
    def circumscribed_radius(self):
        """Distance [m] from ``base_link`` to the outermost corner."""
        return float(np.hypot(max(self.front, self.axle_to_rear), self.half_width))


def from_settings(wheelchair):
    """The footprint of checked ``wheelchair`` settings."""
    return Footprint(wheelchair.footprint.length, wheelchair.footprint.width, wheelchair.footprint.axle_to_rear)


def grown(footprint, margin):
    """The footprint with every edge moved outward by ``margin`` [m] (negative: inward)."""
    return Footprint(
        footprint.length + 2.0 * margin, footprint.width + 2.0 * margin, footprint.axle_to_rear + margin
    )


def corners(footprint, pose=None):
    """Corners (4, 2) [m], counter-clockwise from front left, in ``base_link`` or in the frame of ``pose``."""
    front, rear, side = footprint.front, footprint.rear, footprint.half_width
    points = np.array([[front, side], [rear, side], [rear, -side], [front, -side]])
    return points if pose is None else se2.transform_points(pose, points)


def distance_to_points(footprint, pose, points):
    """Distance (n,) [m] from the outline to ``points`` (n, 2) in the frame of ``pose``; 0 inside."""
    local = se2.transform_points(se2.inverse(pose), points)
    outside_x = np.maximum(np.maximum(footprint.rear - local[:, 0], local[:, 0] - footprint.front), 0.0)
    outside_y = np.maximum(np.abs(local[:, 1]) - footprint.half_width, 0.0)
    return np.hypot(outside_x, outside_y)
