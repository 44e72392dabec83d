"""An occupancy grid in the odom frame, with the values that go over the wire."""
from typing import NamedTuple, Optional, Tuple

import numpy as np

UNKNOWN = -1
FREE = 0
INSCRIBED = 99
LETHAL = 100

WHOLE_CELLS = np.empty((0, 0, 4), np.int8)
WHOLE_CELLS.setflags(write=False)  # as one that came as a message


class Grid(NamedTuple):
    """Axis-aligned grid of ``nav_msgs/OccupancyGrid`` values.

    ``cells`` (rows, columns) int8, row = y, column = x; ``origin`` is the outer corner of cell [0, 0] in
    odom [m]; ``stamp`` [s] is that of the oldest required observation in it. ``surface`` (rows, columns, 4)
    int8, if the costmap tells it: of each lethal cell the quarters x low, x high, y low, y high that the obstacle
    in it fills, as `costmap_surface` has them; `WHOLE_CELLS` where lethal cells are marked whatever little they hold;
    None where it is not known.
    """

    cells: np.ndarray
    resolution: float
    origin: Tuple[float, float]
    stamp: float
    surface: Optional[np.ndarray] = None


def cell_centres(grid):
    """Centres of all cells: x (columns,) and y (rows,) [m]."""
    rows, columns = grid.cells.shape
    return (
        grid.origin[0] + (np.arange(columns) + 0.5) * grid.resolution,
        grid.origin[1] + (np.arange(rows) + 0.5) * grid.resolution,
    )


def to_cells(grid, points):
    """Rows (n,) and columns (n,) of ``points`` (n, 2) [m], and whether each lies on the grid (n,)."""
    points = np.asarray(points, dtype=float)
    columns = np.floor((points[:, 0] - grid.origin[0]) / grid.resolution).astype(int)
    rows = np.floor((points[:, 1] - grid.origin[1]) / grid.resolution).astype(int)
    height, width = grid.cells.shape
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    return rows, columns, inside


def occupied_points(grid):
    """Centres (n, 2) [m] of the lethal cells: the paper's occupied cells (section III-A)."""
    rows, columns = np.nonzero(grid.cells == LETHAL)
    return np.column_stack((columns + 0.5, rows + 0.5)) * grid.resolution + np.asarray(grid.origin)
