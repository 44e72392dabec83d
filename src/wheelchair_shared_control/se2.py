"""Poses in the plane.

A pose is a float array ``(..., 3)`` of ``[x, y, yaw]`` in metres and radians, yaw counter-clockwise from x
(REP 103). A pose named ``a_from_b`` is the pose of frame b in frame a, and maps points of b to points of a.
"""
import math

import numpy as np


def wrap_angle(angle):
    """Angle [rad] brought into [-pi, pi); broadcasts."""
    return (np.asarray(angle, dtype=float) + np.pi) % (2.0 * np.pi) - np.pi


def _wrapped(angle):
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def compose(a_from_b, b_from_c):
    """Pose ``a_from_c`` (..., 3) of a chain of two; broadcasts."""
    a_from_b = np.asarray(a_from_b, dtype=float)
    b_from_c = np.asarray(b_from_c, dtype=float)
    if a_from_b.ndim == 1 and b_from_c.ndim == 1:  # one pose: ten times faster without broadcasting
        (ax, ay, yaw), (bx, by, turn) = a_from_b.tolist(), b_from_c.tolist()
        cos, sin = math.cos(yaw), math.sin(yaw)
        return np.array([ax + cos * bx - sin * by, ay + sin * bx + cos * by, _wrapped(yaw + turn)])
    cos, sin = np.cos(a_from_b[..., 2]), np.sin(a_from_b[..., 2])
    x, y = b_from_c[..., 0], b_from_c[..., 1]
    return np.stack(
        np.broadcast_arrays(
            a_from_b[..., 0] + cos * x - sin * y,
            a_from_b[..., 1] + sin * x + cos * y,
            wrap_angle(a_from_b[..., 2] + b_from_c[..., 2]),
        ),
        axis=-1,
    )


def inverse(a_from_b):
    """Pose ``b_from_a`` (..., 3)."""
    a_from_b = np.asarray(a_from_b, dtype=float)
    if a_from_b.ndim == 1:
        x, y, yaw = a_from_b.tolist()
        cos, sin = math.cos(yaw), math.sin(yaw)
        return np.array([-cos * x - sin * y, sin * x - cos * y, _wrapped(-yaw)])
    cos, sin = np.cos(a_from_b[..., 2]), np.sin(a_from_b[..., 2])
    x, y = a_from_b[..., 0], a_from_b[..., 1]
    return np.stack((-cos * x - sin * y, sin * x - cos * y, wrap_angle(-a_from_b[..., 2])), axis=-1)


def transform_points(a_from_b, points_b):
    """Points (n, 2) of frame b, seen in frame a [m]."""
    x, y, yaw = a_from_b
    cos, sin = np.cos(yaw), np.sin(yaw)
    points_b = np.asarray(points_b, dtype=float)
    return points_b @ np.array([[cos, sin], [-sin, cos]]) + np.array([x, y])


def integrate(pose, v, w, dt):
    """Pose (..., 3) after ``dt`` [s] at constant speed ``v`` [m/s] and turn rate ``w`` [rad/s].

    The exact arc, also for ``w`` = 0; arguments broadcast.
    """
    pose = np.asarray(pose, dtype=float)
    turn = np.asarray(w, dtype=float) * dt
    # The chord of an arc is its length times sinc(turn / 2), along the mean heading.
    chord = np.asarray(v, dtype=float) * dt * np.sinc(turn / (2.0 * np.pi))
    heading = pose[..., 2] + turn / 2.0
    return np.stack(
        np.broadcast_arrays(
            pose[..., 0] + chord * np.cos(heading),
            pose[..., 1] + chord * np.sin(heading),
            wrap_angle(pose[..., 2] + turn),
        ),
        axis=-1,
    )
