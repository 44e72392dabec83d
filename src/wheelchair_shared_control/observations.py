"""Sensor messages into the costmap, given where the sensor was: for ``move_base`` and for replayed bags.

Messages are duck-typed (``sensor_msgs``); ``odom_from_sensor`` (4, 4) is the sensor's pose in the costmap's frame at
``stamp`` [s]; ``source`` names the costmap's observation source. All raise ConversionError or CostmapError, and
return False where a message holds no information: the costmap is then as old as it was.
"""
import math

import numpy as np

from wheelchair_shared_control import conversions
from wheelchair_shared_control.values import RANGERS, Ranges

MOST_TILT = math.radians(5.0)  # of a laser scanner, whose scan is taken for level


def insert_image(costmap, message, camera, odom_from_sensor, stamp, source):
    """A depth ``Image`` of ``camera``, which is None as long as no ``CameraInfo`` has come."""
    if camera is None:
        raise conversions.ConversionError("no camera_info yet")
    return costmap.insert_depth(conversions.depth_of(message), camera, odom_from_sensor, stamp, source=source)


def insert_cloud(costmap, message, odom_from_sensor, stamp, source):
    """A ``PointCloud2``; what is not finite in it says nothing."""
    points = conversions.points_of(message)
    points = points[np.isfinite(points).all(axis=1)] @ odom_from_sensor[:3, :3].T + odom_from_sensor[:3, 3]
    return costmap.insert_points(points, odom_from_sensor[:3, 3], stamp, source=source)


def insert_scan(costmap, message, odom_from_sensor, stamp, source):
    """A ``LaserScan`` of a scanner that sits level, head up or head down (it then turns the other way)."""
    angles, ranges, (_, high) = conversions.scan_of(message)
    upright = odom_from_sensor[2, 2]
    if abs(upright) < math.cos(MOST_TILT):
        raise conversions.ConversionError("laser scan: its plane is tilted by %.0f degrees, limit %.0f" % (
            math.degrees(math.acos(abs(upright))), math.degrees(MOST_TILT)))
    x, y, height = odom_from_sensor[:3, 3]
    pose = (x, y, math.atan2(odom_from_sensor[1, 0], odom_from_sensor[0, 0]))
    return costmap.insert_scan(ranges, math.copysign(1.0, upright) * angles, high, pose, height, stamp, source=source)


def insert_ranges(costmap, messages, pose, stamp, source):
    """``Range`` messages by their index in RANGERS, taken at ``pose`` (3,) of the chair; the others say nothing."""
    readings = np.full(len(RANGERS), np.nan)
    for index, message in messages.items():
        readings[index] = conversions.range_of(message)
    return costmap.insert_ranges(Ranges(stamp, readings), pose, source=source)
