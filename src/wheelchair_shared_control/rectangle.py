"""Distances to the chair's outline: compiled, for points and for boxes.

The outline is a rectangle (front, rear, half_width) in ``base_link``, [m]; points are in odom, and so are boxes
(x low, x high, y low, y high), along whose axes they lie. The signed distance of a point is its distance to the
outline, negative inside by the depth below the nearest edge; that of a box is the distance between the two.
"""
import math

import numpy as np
from numba import njit


@njit(cache=True)
def signed_distance(x, y, front, rear, half_width):
    """Signed distance [m] of a point (x, y) in ``base_link`` to the rectangle's outline."""
    dx = max(rear - x, x - front)
    dy = abs(y) - half_width
    if dx <= 0.0 and dy <= 0.0:
        return max(dx, dy)
    dx = max(dx, 0.0)
    dy = max(dy, 0.0)
    return math.sqrt(dx * dx + dy * dy)


@njit(cache=True)
def box_distance(box, x, y, cos, sin, front, rear, half_width):
    """Signed distance [m] of a ``box`` (4,) to the outline of a chair at x, y whose yaw has ``cos``, ``sin``.

    Of two rectangles that do not overlap one's corner is the nearest to the other. Inside the outline counts the
    deepest corner of the box.
    """
    best = math.inf
    for i in range(2):
        dx = box[i] - x
        for j in range(2, 4):
            dy = box[j] - y
            d = signed_distance(cos * dx + sin * dy, cos * dy - sin * dx, front, rear, half_width)
            if d < best:
                best = d
    if best <= 0.0 or (box[0] == box[1] and box[2] == box[3]):
        return best
    for i in range(2):
        u = front if i else rear
        for j in range(2):
            w = half_width if j else -half_width
            px, py = x + cos * u - sin * w, y + sin * u + cos * w
            dx, dy = max(box[0] - px, px - box[1]), max(box[2] - py, py - box[3])
            if dx <= 0.0 and dy <= 0.0:
                d = max(dx, dy)
            else:
                dx, dy = max(dx, 0.0), max(dy, 0.0)
                d = math.sqrt(dx * dx + dy * dy)
            if d < best:
                best = d
    return best


@njit(cache=True)
def nearest(points, x, y, yaw, front, rear, half_width):
    """Signed distance [m] of the nearest of ``points`` (n, 2) at a pose; inf without points."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    best = math.inf
    for i in range(points.shape[0]):
        dx, dy = points[i, 0] - x, points[i, 1] - y
        d = signed_distance(cos * dx + sin * dy, cos * dy - sin * dx, front, rear, half_width)
        if d < best:
            best = d
    return best


@njit(cache=True)
def within(points, pose, front, rear, half_width, reach):
    """Whether each of ``points`` (n, 2) is nearer to the footprint at ``pose`` than ``reach`` [m]: (n,) bool."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    near = np.empty(points.shape[0], np.bool_)
    for i in range(points.shape[0]):
        dx, dy = points[i, 0] - pose[0], points[i, 1] - pose[1]
        near[i] = signed_distance(cos * dx + sin * dy, cos * dy - sin * dx, front, rear, half_width) < reach
    return near
