"""The pinhole camera: intrinsics, mounting, back-projection.

The optical frame has z forward, x right, y down (REP 103).
"""
from typing import NamedTuple

import numpy as np


class Camera(NamedTuple):
    """Intrinsics in pixels; pixel (0, 0) is the centre of the upper left pixel."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float


def from_settings(wheelchair):
    """Intrinsics of checked ``wheelchair`` settings."""
    c = wheelchair.camera
    return Camera(c.width, c.height, c.fx, c.fy, c.cx, c.cy)


def scaled(camera, width, height):
    """The same view sampled at ``width`` x ``height`` pixels."""
    sx, sy = width / camera.width, height / camera.height
    return Camera(
        int(width), int(height), camera.fx * sx, camera.fy * sy,
        (camera.cx + 0.5) * sx - 0.5, (camera.cy + 0.5) * sy - 0.5,
    )


def base_from_camera(x, z, pitch):
    """Transform (4, 4) of the optical frame in ``base_link``: ``x`` ahead, ``z`` up [m], ``pitch`` down [rad].

    ``base_link`` lies on the floor below the middle of the drive axle.
    """
    cos, sin = np.cos(pitch), np.sin(pitch)
    transform = np.eye(4)
    # Columns: the optical x (right), y (down), z (forward) axes in base_link.
    transform[:3, 0] = (0.0, -1.0, 0.0)
    transform[:3, 1] = (-sin, 0.0, -cos)
    transform[:3, 2] = (cos, 0.0, -sin)
    transform[:3, 3] = (x, 0.0, z)
    return transform


def mounting(wheelchair):
    """``base_from_camera`` (4, 4) of checked ``wheelchair`` settings."""
    return base_from_camera(wheelchair.camera.x, wheelchair.camera.z, wheelchair.camera.pitch)


def lifted(a_from_b):
    """A planar pose (3,) as a transform (4, 4)."""
    x, y, yaw = a_from_b
    cos, sin = np.cos(yaw), np.sin(yaw)
    transform = np.eye(4)
    transform[:2, :2] = ((cos, -sin), (sin, cos))
    transform[:2, 3] = (x, y)
    return transform


def back_project(camera, depth):
    """Points (height, width, 3) [m] in the optical frame; invalid depth stays invalid."""
    depth = np.asarray(depth)
    columns = (np.arange(camera.width, dtype=np.float32) - camera.cx) / camera.fx
    rows = (np.arange(camera.height, dtype=np.float32) - camera.cy) / camera.fy
    return np.stack((depth * columns[None, :], depth * rows[:, None], depth), axis=-1)
