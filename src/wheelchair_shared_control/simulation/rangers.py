"""Infrared rangers: the nearest surface in a narrow cone (REP 117: -Inf too close, +Inf nothing in range)."""
import math

import numpy as np
from numba import njit

from wheelchair_shared_control.values import RANGERS

_ACROSS, _UP = 7, 3  # rays that fill a cone: the fan lies level, where walls and jambs are met


def mounting(wheelchair):
    """Places and directions (6, 4) in base_link, in the order of ``RANGERS``: x, y, z [m], yaw [rad]."""
    r = wheelchair.rangers
    along = {"front": r.x_front, "middle": r.x_middle, "rear": r.x_rear}
    rows = []
    for name in RANGERS:
        side, place = name.split("_")
        sign = 1.0 if side == "left" else -1.0
        rows.append((along[place], sign * r.y, r.z, sign * math.pi / 2.0))
    return np.array(rows)


def rays(wheelchair):
    """Rays (6, k, 6) of the cones in base_link: origin [m] and unit direction."""
    half = wheelchair.rangers.field_of_view / 2.0
    across, up = np.meshgrid(np.linspace(-half, half, _ACROSS), np.linspace(-half, half, _UP))
    inside = np.hypot(across, up) <= half * 1.0001
    across, up = across[inside], up[inside]
    result = np.empty((len(RANGERS), len(across), 6))
    for row, (x, y, z, yaw) in zip(result, mounting(wheelchair)):
        row[:, :3] = (x, y, z)
        row[:, 3] = np.cos(up) * np.cos(yaw + across)
        row[:, 4] = np.cos(up) * np.sin(yaw + across)
        row[:, 5] = np.sin(up)
    return result


def in_world(rays_base, pose):
    """Rays (..., 6) of base_link seen in the world from ``pose`` (3,)."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    result = np.empty_like(rays_base)
    result[..., :3] = rays_base[..., :3] @ turn.T + np.array([pose[0], pose[1], 0.0])
    result[..., 3:] = rays_base[..., 3:] @ turn.T
    return result


def distances(boxes, rays_world, reach):
    """Distance (6,) [m] to the nearest box or floor along each cone's rays (6, k, 6); +Inf beyond ``reach``."""
    return _distances(np.ascontiguousarray(boxes, dtype=np.float64), np.ascontiguousarray(rays_world), float(reach))


def measure(true, wheelchair, noise, rng):
    """Readings (6,) [m] of true distances (6,): relative Gaussian ``noise``, limits as in REP 117."""
    r = wheelchair.rangers
    factor = 1.0 + noise * rng.standard_normal(len(true))
    reading = np.asarray(true) * factor
    reading = np.where(reading > r.max_range, np.inf, reading)
    return np.where(reading < r.min_range, -np.inf, reading)


@njit(cache=True)
def _distances(boxes, rays, reach):
    cones, count = rays.shape[0], rays.shape[1]
    result = np.full(cones, np.inf)
    for b in range(len(boxes)):
        hx, hy, hz = boxes[b, 4], boxes[b, 5], boxes[b, 6]
        radius = np.hypot(hx, hy) + reach
        cos, sin = 2.0, 0.0
        for i in range(cones):
            dx, dy = rays[i, 0, 0] - boxes[b, 0], rays[i, 0, 1] - boxes[b, 1]
            if dx * dx + dy * dy > radius * radius:
                continue
            if cos == 2.0:
                cos, sin = np.cos(boxes[b, 3]), np.sin(boxes[b, 3])
            ox, oy, oz = cos * dx + sin * dy, -sin * dx + cos * dy, rays[i, 0, 2] - boxes[b, 2]
            for k in range(count):
                vx = cos * rays[i, k, 3] + sin * rays[i, k, 4]
                vy = -sin * rays[i, k, 3] + cos * rays[i, k, 4]
                vz = rays[i, k, 5]
                near, far = 0.0, min(reach, result[i])
                for o, v, h in ((ox, vx, hx), (oy, vy, hy), (oz, vz, hz)):
                    if abs(v) < 1e-12:
                        if abs(o) > h:
                            far = -1.0
                    else:
                        a, c = (-h - o) / v, (h - o) / v
                        near, far = max(near, min(a, c)), min(far, max(a, c))
                if near <= far and near < result[i]:
                    result[i] = near
    for i in range(cones):
        for k in range(count):
            if rays[i, k, 5] < 0.0:
                t = -rays[i, k, 2] / rays[i, k, 5]
                if t < min(result[i], reach):
                    result[i] = t
    return result
