"""Which cells are lethal, and where in them the surface lies: a sliver belongs to the cell that it juts from.

A wall hardly ever ends at the edge of a cell. If every cell that holds a millimetre of a jamb is lethal, a door
between two jambs loses half a cell a side on average and a whole one at worst. Here a cell of which an obstacle
fills at most half is left to the cell behind it, whose box is stretched to the true surface: the grid then
shows the door at its width on average, and distances are measured to the boxes.
"""
import numba
import numpy as np

# lowest and highest bit of a mask of four
_LOW = np.array([0, 0, 1, 0, 2, 0, 1, 0, 3, 0, 1, 0, 2, 0, 1, 0], np.int8)
_HIGH = np.array([3, 0, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3, 3], np.int8)


@numba.njit(cache=True, nogil=True)
def find_lethal(odds, places, known, threshold, lethal, boxes):
    """Fill ``lethal`` (rows, columns) bool and ``boxes`` (rows, columns, 4) int8 from the memory.

    A lethal cell's box (x low, x high, y low, y high) holds its occupied places, counted in quarters of a
    cell from its lower left quarter: 0..3, and down to -4 or up to 7 where it carries a sliver.
    """
    rows, columns = odds.shape
    for row in range(rows):
        for column in range(columns):
            occupied = odds[row, column] >= threshold
            lethal[row, column] = occupied
            if occupied:
                mask = places[row, column]
                across = (mask | mask >> 4 | mask >> 8 | mask >> 12) & 15
                along = ((mask & 15) != 0) | ((mask & 0xF0) != 0) << 1 | ((mask & 0xF00) != 0) << 2 | (
                    (mask & 0xF000) != 0) << 3
                boxes[row, column, 0] = _LOW[across]
                boxes[row, column, 1] = _HIGH[across]
                boxes[row, column, 2] = _LOW[along]
                boxes[row, column, 3] = _HIGH[along]
    carries = np.zeros((rows, columns), np.bool_)
    for row in range(1, rows - 1):
        for column in range(1, columns - 1):
            if not lethal[row, column] or carries[row, column]:
                continue
            for axis in range(2):
                low, high = boxes[row, column, 2 * axis], boxes[row, column, 2 * axis + 1]
                if low >= 2:
                    side = 1
                elif high <= 1:
                    side = -1
                else:
                    continue
                # the cell that the sliver juts from, and the one that it juts towards
                r, c = (row, column + side) if axis == 0 else (row + side, column)
                r_free, c_free = (row, column - side) if axis == 0 else (row - side, column)
                if lethal[r_free, c_free]:
                    continue
                if lethal[r, c]:
                    if side > 0 and boxes[r, c, 2 * axis] <= 0:
                        boxes[r, c, 2 * axis] = min(boxes[r, c, 2 * axis], low - 4)
                    elif side < 0 and boxes[r, c, 2 * axis + 1] >= 3:
                        boxes[r, c, 2 * axis + 1] = max(boxes[r, c, 2 * axis + 1], high + 4)
                    else:
                        continue
                elif not known[r, c] and known[r_free, c_free]:
                    # what lies behind the surface was never seen: it is the inside of the obstacle
                    for k in range(4):
                        boxes[r, c, k] = boxes[row, column, k]
                    boxes[r, c, 2 * axis] -= 4 * side
                    boxes[r, c, 2 * axis + 1] -= 4 * side
                    lethal[r, c] = True
                else:
                    continue
                carries[r, c] = True
                lethal[row, column] = False
                break


@numba.njit(cache=True, nogil=True)
def measure_to_surface(distance, nearest, boxes, resolution, reach):
    """Measure ``distance`` (rows, columns) [m] up to ``reach`` from a cell's centre to the nearest cell's box.

    ``nearest`` as of `distance_transform`. The edge of the box is that of its outermost places' centres.
    """
    rows, columns = distance.shape
    quarter = np.float32(0.25 * resolution)
    for row in range(rows):
        for column in range(columns):
            if distance[row, column] > reach:
                continue
            r, c = nearest[row, column, 0], nearest[row, column, 1]
            # in quarters of a cell from this cell's centre
            x0 = np.float32(4 * (c - column)) - np.float32(1.5)
            y0 = np.float32(4 * (r - row)) - np.float32(1.5)
            dx = max(x0 + boxes[r, c, 0], -(x0 + boxes[r, c, 1]), np.float32(0.0))
            dy = max(y0 + boxes[r, c, 2], -(y0 + boxes[r, c, 3]), np.float32(0.0))
            distance[row, column] = np.float32(np.sqrt(dx * dx + dy * dy)) * quarter
