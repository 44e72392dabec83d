"""Clearance of the true footprint polygon, read from the costmap's distance field by compiled kernels.

The field holds for each cell the distance [m] of its centre to what is in the nearest lethal cell. A pose's
clearance is the smallest field value on the polygon's outline; points on the polygon's spine catch what stands
inside it. Cells outside the window count as far from everything.
"""
from typing import NamedTuple

import numpy as np
from numba import njit

from wheelchair_shared_control import footprint as footprints


class Field(NamedTuple):
    """What the kernels read: ``distance`` (rows, cols) float32 [m]; ``known`` (rows, cols) uint8: UNKNOWN, SEEN,
    PRESUMED (taken for free, but neither seen nor driven over) or DOUBTFUL (the same, and not reversed over);
    ``frame`` (3,) float64: x and y [m] of the outer corner of cell [0, 0], resolution [m]."""

    distance: np.ndarray
    known: np.ndarray
    frame: np.ndarray


class Body(NamedTuple):
    """A sampled footprint in ``base_link``: ``outline`` (n, 2), ``spine`` (m,) x of points with y = 0,
    ``half_width``, ``reach`` (distance of the outermost corner from ``middle``), ``middle`` x of the centre."""

    outline: np.ndarray
    spine: np.ndarray
    half_width: float
    reach: float
    middle: float


FAR = 2.0
UNKNOWN, SEEN, PRESUMED, DOUBTFUL = 0, 1, 2, 3
# No division is by zero here, and no value NaN: the checks cost more than the arithmetic. Not "reassoc": sums would
# then depend on whether a kernel was compiled in this process or read from the cache, and with them a run's last digit.
FAST = dict(cache=True, error_model="numpy", fastmath={"nsz", "arcp", "contract"})


def make_field(snapshot):
    """Field of a costmap snapshot."""
    frame = np.array([snapshot.origin[0], snapshot.origin[1], snapshot.resolution], dtype=np.float64)
    known = snapshot.known.astype(np.uint8)
    if snapshot.presumed is not None:
        known[snapshot.presumed] = PRESUMED
    if snapshot.doubtful is not None:
        known[snapshot.doubtful] = DOUBTFUL
    return Field(
        np.ascontiguousarray(snapshot.distance, dtype=np.float32),
        known,
        frame,
    )


def padded(field, point, margin, limit):
    """The field, enlarged by unknown free ground so that ``point`` (2,) lies ``margin`` [m] inside it.

    At most ``limit`` [m] are added on a side.
    """
    rows, cols = field.distance.shape
    res = field.frame[2]
    low = np.ceil((field.frame[:2] - (point - margin)) / res)
    high = np.ceil(((point + margin) - (field.frame[:2] + np.array([cols, rows]) * res)) / res)
    most = int(limit / res)
    (left, below), (right, above) = np.clip(low, 0, most).astype(int), np.clip(high, 0, most).astype(int)
    if not (left or below or right or above):
        return field
    sides = ((below, above), (left, right))
    frame = np.array([field.frame[0] - left * res, field.frame[1] - below * res, res])
    return Field(
        np.pad(field.distance, sides, constant_values=np.float32(FAR)), np.pad(field.known, sides), frame)


def make_body(footprint, spacing=0.05):
    """Body of a Footprint, its outline sampled at most every ``spacing`` [m], corners included."""
    corners = footprints.corners(footprint)
    outline = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0)):
        n = int(np.ceil(np.hypot(*(b - a)) / spacing))
        outline.append(a + (b - a) * (np.arange(n) / n)[:, None])
    half = min(footprint.half_width, footprint.length / 2.0)
    n = int(np.ceil((footprint.length - 2.0 * half) / 0.1)) + 1
    spine = np.linspace(footprint.rear + half, footprint.front - half, n)
    return Body(
        np.ascontiguousarray(np.concatenate(outline)),
        spine,
        float(half),
        float(np.hypot(footprint.length / 2.0, footprint.half_width)),
        float((footprint.front + footprint.rear) / 2.0),
    )


@njit(inline="always", **FAST)
def field_at(distance, frame, x, y):
    """Bilinear field value [m] at a point; FAR outside the window."""
    rows, cols = distance.shape
    inverse = 1.0 / frame[2]
    u = (x - frame[0]) * inverse - 0.5
    v = (y - frame[1]) * inverse - 0.5
    if not (u >= 0.0 and v >= 0.0 and u < cols - 1 and v < rows - 1):
        return FAR
    i, j = np.uint32(v), np.uint32(u)
    a, b = v - i, u - j
    d00, d10 = np.float64(distance[i, j]), np.float64(distance[i + np.uint32(1), j])
    low = d00 + (distance[i, j + np.uint32(1)] - d00) * b
    high = d10 + (distance[i + np.uint32(1), j + np.uint32(1)] - d10) * b
    return low + (high - low) * a


@njit(inline="always", **FAST)
def field_gradient(distance, frame, x, y):
    """Value [m] and gradient (d/dx, d/dy) of the bilinear field."""
    rows, cols = distance.shape
    inverse = 1.0 / frame[2]
    u = (x - frame[0]) * inverse - 0.5
    v = (y - frame[1]) * inverse - 0.5
    if not (u >= 0.0 and v >= 0.0 and u < cols - 1 and v < rows - 1):
        return FAR, 0.0, 0.0
    i, j = np.uint32(v), np.uint32(u)
    a, b = v - i, u - j
    d00, d10 = np.float64(distance[i, j]), np.float64(distance[i + np.uint32(1), j])
    across_low = distance[i, j + np.uint32(1)] - d00
    across_high = distance[i + np.uint32(1), j + np.uint32(1)] - d10
    low, high = d00 + across_low * b, d10 + across_high * b
    return low + (high - low) * a, (across_low + (across_high - across_low) * a) * inverse, (high - low) * inverse


@njit(**FAST)
def known_at(known, frame, x, y):
    """UNKNOWN, SEEN, PRESUMED or DOUBTFUL, of a point's cell; UNKNOWN outside the window."""
    col = int(np.floor((x - frame[0]) / frame[2]))
    row = int(np.floor((y - frame[1]) / frame[2]))
    if row < 0 or col < 0 or row >= known.shape[0] or col >= known.shape[1]:
        return UNKNOWN
    return known[row, col]


@njit(**FAST)
def clearance(distance, frame, outline, spine, half_width, reach, middle, cap, x, y, yaw):
    """Clearance [m] of the polygon at a pose, at most ``cap``; negative where something stands inside it."""
    c, s = np.cos(yaw), np.sin(yaw)
    d = field_at(distance, frame, x + c * middle, y + s * middle)
    if d >= reach + cap:
        return cap
    best = cap
    for k in range(spine.shape[0]):
        d = field_at(distance, frame, x + c * spine[k], y + s * spine[k]) - half_width
        if d < -0.02 and d < best:
            best = d
    if best < 0.0:
        return best
    for k in range(outline.shape[0]):
        px, py = outline[k, 0], outline[k, 1]
        d = field_at(distance, frame, x + c * px - s * py, y + s * px + c * py)
        if d < best:
            best = d
    return best


@njit(**FAST)
def clearances(distance, frame, outline, spine, half_width, reach, middle, cap, poses):
    """Clearance (n,) [m] of poses (n, 3)."""
    out = np.empty(poses.shape[0])
    for k in range(poses.shape[0]):
        out[k] = clearance(distance, frame, outline, spine, half_width, reach, middle, cap,
                           poses[k, 0], poses[k, 1], poses[k, 2])
    return out


def of_poses(field, body, poses, cap=0.5):
    """Clearance (n,) [m] of poses (n, 3) in the field's frame."""
    poses = np.ascontiguousarray(np.atleast_2d(poses), dtype=np.float64)
    return clearances(field.distance, field.frame, *body, cap, poses)
