"""Euclidean distance of every cell to the nearest lethal cell, exact, capped.

Meijster, Roerdink, Hesselink 2000: distances along the columns, then the lower envelope of parabolas along
each row. The cap keeps far rows cheap.
"""
import numba
import numpy as np


@numba.njit(cache=True, nogil=True)
def distance_transform(lethal, resolution, cap, distance, nearest):
    """Fill ``distance`` (rows, columns) float32 [m], centre to centre, at most ``cap``, from ``lethal`` bool.

    ``nearest`` (rows, columns, 2) int16 becomes row and column of the nearest lethal cell, -1 beyond the cap.
    """
    rows, columns = lethal.shape
    reach = int(np.ceil(cap / resolution)) + 1
    far = np.int32(reach)
    away = np.empty((rows, columns), np.int32)  # rows to the nearest lethal cell of the same column, signed
    for column in range(columns):
        away[0, column] = 0 if lethal[0, column] else -far
    for row in range(1, rows):
        for column in range(columns):
            away[row, column] = 0 if lethal[row, column] else max(away[row - 1, column] - 1, -far)
    for row in range(rows - 2, -1, -1):
        for column in range(columns):
            below = away[row + 1, column]
            if below >= 0 and below + 1 < -away[row, column]:
                away[row, column] = below + 1
    vertex = np.empty(columns, np.int32)  # columns whose parabolas form the envelope
    start = np.empty(columns, np.int32)  # first column at which each of them is lowest
    limit = np.float32(cap)
    for row in range(rows):
        last = -1
        for column in range(columns):
            g = away[row, column]
            if g >= far or g <= -far:
                continue  # beyond the cap: cannot be nearest to anything within it
            first = 0
            while last >= 0:
                other = vertex[last]
                h = away[row, other]
                at = start[last]
                if (at - other) * (at - other) + h * h > (at - column) * (at - column) + g * g:
                    last -= 1
                    continue
                # first column at which the new parabola is lower
                first = (column * column - other * other + g * g - h * h) // (2 * (column - other)) + 1
                break
            if first < columns:
                last += 1
                vertex[last] = column
                start[last] = first
        if last < 0:
            for column in range(columns):
                distance[row, column] = limit
                nearest[row, column, 0] = -1
            continue
        k = last
        for column in range(columns - 1, -1, -1):
            while start[k] > column:
                k -= 1
            h = away[row, vertex[k]]
            d = np.float32(np.sqrt(np.float32((column - vertex[k]) ** 2 + h * h)) * resolution)
            if d < limit:
                distance[row, column] = d
                nearest[row, column, 0] = row + h
                nearest[row, column, 1] = vertex[k]
            else:
                distance[row, column] = limit
                nearest[row, column, 0] = -1
