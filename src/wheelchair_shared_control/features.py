"""The paper's features: distance to the nearest occupied cell on the left, ahead and on the right.

Goil, Derry, Argall 2013, section III-A, Fig. 1a. The regions come from extending the footprint's edges::

                      |   front   |
              left    |           |    right
                      +-----------+
                      |   chair   |
        left, from    |           |    right
        the rear on   +-----------+ ........

"""
import numba
import numpy as np

from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.grid import LETHAL

_LETHAL = np.int8(LETHAL)


class FeaturesError(Error):
    """A pose or a grid from which no feature can be computed."""


def distances(grid, pose, footprint, max_range=2.0):
    """``(d_l, d_f, d_r)`` [m] about the chair at ``pose`` (3,) in the frame of ``grid``, a `grid.Grid`.

    Front: ahead of the front edge, between the side edges. Left, right: beyond that side edge, from the rear
    edge forward without end. Each distance runs from the footprint's boundary to the cell's centre and is at
    most ``max_range``, which an empty region gives too. A cell inside the footprint gives 0 to the region of
    the nearest of the front, left and right edges. Occupied is 100; unknown is not occupied.
    Raises FeaturesError for a pose that is not finite, or cells that are not an int8 array.
    """
    cells = np.ascontiguousarray(grid.cells)
    if cells.ndim != 2 or cells.dtype != np.int8:
        raise FeaturesError("the grid's cells are %s of shape %s, but must be int8 (rows, columns)" % (
            cells.dtype, cells.shape))
    x, y, yaw = (float(value) for value in pose)
    if not np.isfinite(x + y + yaw):
        raise FeaturesError("the pose (%g, %g, %g) is not finite" % (x, y, yaw))
    return _distances(
        cells, float(grid.resolution), float(grid.origin[0]), float(grid.origin[1]), x, y, yaw,
        float(footprint.front), float(footprint.rear), float(footprint.half_width), float(max_range))


@numba.njit(cache=True, nogil=True)
def _distances(cells, resolution, origin_x, origin_y, x, y, yaw, front, rear, half_width, max_range):
    rows, columns = cells.shape
    cos, sin = np.cos(yaw), np.sin(yaw)
    best_left = best_front = best_right = max_range * max_range
    # only cells within reach of the outline can count
    reach = np.sqrt(max(front, -rear) ** 2 + half_width ** 2) + max_range + resolution
    row_0 = max(int((y - reach - origin_y) / resolution), 0)
    row_1 = min(int(max((y + reach - origin_y) / resolution, -1.0)) + 1, rows)
    column_0 = max(int((x - reach - origin_x) / resolution), 0)
    column_1 = min(int(max((x + reach - origin_x) / resolution, -1.0)) + 1, columns)
    for row in range(row_0, row_1):
        dy = origin_y + (row + 0.5) * resolution - y
        for column in range(column_0, column_1):
            if cells[row, column] != _LETHAL:
                continue
            dx = origin_x + (column + 0.5) * resolution - x
            ahead = cos * dx + sin * dy
            if ahead < rear:
                continue
            left = cos * dy - sin * dx
            over = max(ahead - front, 0.0)
            if left > half_width:
                best_left = min(best_left, over * over + (left - half_width) ** 2)
            elif left < -half_width:
                best_right = min(best_right, over * over + (left + half_width) ** 2)
            elif ahead > front:
                best_front = min(best_front, over * over)
            else:  # under the chair
                to_front, to_left, to_right = front - ahead, half_width - left, half_width + left
                nearest = min(to_front, to_left, to_right)
                if to_left == nearest:
                    best_left = 0.0
                if to_right == nearest:
                    best_right = 0.0
                if to_front == nearest:
                    best_front = 0.0
    return np.sqrt(best_left), np.sqrt(best_front), np.sqrt(best_right)
