"""What stands around the chair, for the guard: compiled loops over the costmap's cells and the ground driven over.

The outline is a rectangle (front, rear, half_width), boxes and distances are as in `rectangle`; odom, [m].
"""
import math

import numpy as np
from numba import njit

from wheelchair_shared_control.rectangle import signed_distance


@njit(cache=True)
def gather(
    cells, surface, resolution, origin_x, origin_y, pose, front, rear, half_width, reach, unknown_reach, ground,
    ground_resolution,
):
    """Lethal and unknown cell centres (n, 2), (m, 2) nearer to the footprint at ``pose`` than their reach [m].

    And the boxes (n, 4) of what stands in the lethal cells: those of ``surface``, as `Grid` has it, or, where that
    is empty, the whole cells. A box reaches to the edge of its cell where the next cell is lethal, too: what lies
    between two places that returned is no gap.

    Only cells at the edge of their kind: a sweep meets those first. Ground off the grid is unknown. ``ground``
    (k, k, 2), k a power of two, remembers cells that the chair has driven over, by their index modulo k: those
    are known to be free even where the grid knows nothing.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    radius = math.sqrt(max(front, -rear) ** 2 + half_width * half_width) + max(reach, unknown_reach)
    # one cell more on every side, so that each cell that counts has its four neighbours
    first_c = int(math.floor((pose[0] - radius - origin_x) / resolution)) - 1
    first_r = int(math.floor((pose[1] - radius - origin_y) / resolution)) - 1
    width = int(math.ceil(2.0 * radius / resolution)) + 3
    rows, columns = cells.shape
    mask = ground.shape[0] - 1
    kinds = np.zeros((width, width), np.int8)  # 1 lethal, 2 unknown, 0 known and free, or too far away
    dx_x, dx_y = cos * resolution, -sin * resolution
    for i in range(width):
        r = first_r + i
        y = origin_y + (r + 0.5) * resolution
        gy = int(math.floor(y / ground_resolution))
        dy = y - pose[1]
        x0 = origin_x + (first_c + 0.5) * resolution - pose[0]
        local_x, local_y = cos * x0 + sin * dy, cos * dy - sin * x0
        inside_row = 0 <= r < rows
        for j in range(width):
            c = first_c + j
            value = -1
            if inside_row and 0 <= c < columns:
                value = cells[r, c]
            if value == 100:
                kinds[i, j] = 1
            elif value == -1:
                u, w = local_x + j * dx_x, local_y + j * dx_y
                limit = unknown_reach + 2.0 * resolution
                if rear - limit < u < front + limit and abs(w) < half_width + limit:
                    gx = int(math.floor((origin_x + (c + 0.5) * resolution) / ground_resolution))
                    if ground[gy & mask, gx & mask, 0] != gx or ground[gy & mask, gx & mask, 1] != gy:
                        kinds[i, j] = 2
    fine = surface.shape[0] == rows and surface.shape[1] == columns
    quarter = 0.25 * resolution
    lethal = np.empty((width * width, 2))
    boxes = np.empty((width * width, 4))
    unknown = np.empty((width * width, 2))
    n_lethal, n_unknown = 0, 0
    for i in range(1, width - 1):
        y = origin_y + (first_r + i + 0.5) * resolution
        dy = y - pose[1]
        for j in range(1, width - 1):
            kind = kinds[i, j]
            if kind == 0 or (
                kinds[i, j - 1] == kind and kinds[i, j + 1] == kind
                and kinds[i - 1, j] == kind and kinds[i + 1, j] == kind
                and (kind == 2 or not fine or (
                    kinds[i - 1, j - 1] == kind and kinds[i - 1, j + 1] == kind
                    and kinds[i + 1, j - 1] == kind and kinds[i + 1, j + 1] == kind))
            ):
                continue
            x = origin_x + (first_c + j + 0.5) * resolution
            dx = x - pose[0]
            d = signed_distance(cos * dx + sin * dy, cos * dy - sin * dx, front, rear, half_width)
            if kind == 1 and d <= reach:
                lethal[n_lethal, 0], lethal[n_lethal, 1] = x, y
                x_low, x_high, y_low, y_high = 0.0, 4.0, 0.0, 4.0
                if fine:
                    r, c = first_r + i, first_c + j
                    x_low, x_high = surface[r, c, 0], surface[r, c, 1] + 1.0
                    y_low, y_high = surface[r, c, 2], surface[r, c, 3] + 1.0
                    if kinds[i, j - 1] == 1:
                        x_low = min(x_low, 0.0)
                    if kinds[i, j + 1] == 1:
                        x_high = max(x_high, 4.0)
                    if kinds[i - 1, j] == 1:
                        y_low = min(y_low, 0.0)
                    if kinds[i + 1, j] == 1:
                        y_high = max(y_high, 4.0)
                left, below = x - 2.0 * quarter, y - 2.0 * quarter
                boxes[n_lethal, 0], boxes[n_lethal, 1] = left + x_low * quarter, left + x_high * quarter
                boxes[n_lethal, 2], boxes[n_lethal, 3] = below + y_low * quarter, below + y_high * quarter
                n_lethal += 1
            elif kind == 2 and d <= unknown_reach:
                unknown[n_unknown, 0], unknown[n_unknown, 1] = x, y
                n_unknown += 1
    return lethal[:n_lethal].copy(), boxes[:n_lethal].copy(), unknown[:n_unknown].copy()


@njit(cache=True)
def remember(ground, ground_resolution, pose, front, rear, half_width):
    """Mark in ``ground`` the cells whose centre lies below the footprint at ``pose`` as driven over."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    radius = math.sqrt(max(front, -rear) ** 2 + half_width * half_width)
    mask = ground.shape[0] - 1
    for gy in range(
        int(math.floor((pose[1] - radius) / ground_resolution)),
        int(math.floor((pose[1] + radius) / ground_resolution)) + 1,
    ):
        dy = (gy + 0.5) * ground_resolution - pose[1]
        for gx in range(
            int(math.floor((pose[0] - radius) / ground_resolution)),
            int(math.floor((pose[0] + radius) / ground_resolution)) + 1,
        ):
            dx = (gx + 0.5) * ground_resolution - pose[0]
            if signed_distance(cos * dx + sin * dy, cos * dy - sin * dx, front, rear, half_width) <= 0.0:
                ground[gy & mask, gx & mask, 0] = gx
                ground[gy & mask, gx & mask, 1] = gy


@njit(cache=True)
def prolong(walls, points, pose, reach, corridor, step, pitch, deepest, front, rear, half_width):
    """Points (k, 2), ``pitch`` [m] or less apart, in the gaps of walls that go on straight ahead of ``pose`` (3,).

    A wall (x, y, x, y), one of ``walls`` (m, 4), leads from its first point to its second. Where any of ``points``
    (n, 2), centres of cells with edges of ``step`` [m], lie within ``corridor`` [m] beside its continuation, up to
    ``reach`` [m] on, the continuation is closed up to there, but for pieces of ``step`` [m] in which one of them lies
    on it, or on the chair's side, anyway. A wall that leads more than ``deepest`` [m] into the footprint, or across
    the chair's way (60 degrees), is none.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    pieces = int(reach / step)
    each = int(step / pitch) + 1
    out = np.empty((len(walls) * pieces * each, 2))
    count = 0
    for i in range(len(walls)):
        x, y = walls[i, 2], walls[i, 3]
        dx, dy = x - walls[i, 0], y - walls[i, 1]
        length = math.sqrt(dx * dx + dy * dy)
        if not length > 0.0 or cos * dx + sin * dy < 0.5 * length:
            continue
        dx, dy = dx / length, dy / length
        away = 1.0 if (pose[0] - x) * dy - (pose[1] - y) * dx > 0.0 else -1.0  # side on which the chair is not
        held, furthest = np.zeros(pieces, np.bool_), -1
        for j in range(len(points)):
            px, py = points[j, 0] - x, points[j, 1] - y
            along = px * dx + py * dy
            behind = away * (py * dx - px * dy)
            if along >= 0.0 and abs(behind) <= corridor:
                piece = int(along / step)
                if piece < pieces:
                    if behind <= 0.6 * step:
                        held[piece] = True
                    furthest = max(furthest, piece)
        begin = count
        for piece in range(furthest + 1):
            for k in range(0 if held[piece] else each):
                along = (piece + k / each) * step
                px, py = x + along * dx - pose[0], y + along * dy - pose[1]
                if signed_distance(cos * px + sin * py, cos * py - sin * px, front, rear, half_width) < -deepest:
                    furthest = -1
                out[count, 0], out[count, 1] = x + along * dx, y + along * dy
                count += 1
        if furthest < 0:
            count = begin
    return out[:count].copy()
