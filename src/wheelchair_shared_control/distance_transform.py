"""Euclidean distance of every cell to the nearest lethal cell, exact, capped.

Meijster, Roerdink, Hesselink 2000: distances along the columns, then the lower envelope of parabolas along
each row. The cap keeps far rows cheap.
"""
import numba
import numpy as np


@numba.njit(cache=True, nogil=True)
def distance_transform(lethal, resolution, cap, distance):
    """Fill ``distance`` (rows, columns) float32 [m], centre to centre, at most ``cap``, from ``lethal`` bool."""
    rows, columns = lethal.shape
    reach = int(np.ceil(cap / resolution)) + 1
    far = np.int32(reach)
    column_distance = np.empty((rows, columns), np.int32)
    for column in range(columns):
        column_distance[0, column] = 0 if lethal[0, column] else far
    for row in range(1, rows):
        for column in range(columns):
            if lethal[row, column]:
                column_distance[row, column] = 0
            else:
                column_distance[row, column] = min(column_distance[row - 1, column] + 1, far)
    for row in range(rows - 2, -1, -1):
        for column in range(columns):
            below = column_distance[row + 1, column] + 1
            if below < column_distance[row, column]:
                column_distance[row, column] = below
    vertex = np.empty(columns, np.int32)  # columns whose parabolas form the envelope
    start = np.empty(columns, np.int32)  # first column at which each of them is lowest
    limit = np.float32(cap)
    for row in range(rows):
        last = -1
        for column in range(columns):
            g = column_distance[row, column]
            if g >= far:
                continue  # beyond the cap: cannot be nearest to anything within it
            first = 0
            while last >= 0:
                other = vertex[last]
                h = column_distance[row, other]
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
            continue
        k = last
        for column in range(columns - 1, -1, -1):
            while start[k] > column:
                k -= 1
            h = column_distance[row, vertex[k]]
            d = np.float32(np.sqrt(np.float32((column - vertex[k]) ** 2 + h * h)) * resolution)
            distance[row, column] = min(d, limit)
