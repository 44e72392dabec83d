"""Sensors that see along single rays at one height: laser scanners, infrared rangers."""
import numba
import numpy as np

from wheelchair_shared_control.costmap_cells import SEEN, remember


@numba.njit(cache=True, nogil=True)
def trace(odds, mask, places, known, seen, last, touched, own, rays, origin, resolution, band,
          hit, miss, odds_min, odds_max, stamp, dt):
    """Mark the ends of ``rays``, then clear along them.

    ``rays`` (n, 7): x, y of the origin in odom, direction [rad], length up to which the ray clears [m],
    distance of the hit [m] (NaN: none), weight of the hit, 1 if its direction is doubtful: such a hit marks no
    ground that was seen free. ``band``: height of the sensor as a bit's number
    (-1: out of the bands, nothing is cleared). ``touched`` (rows, columns) uint8 is scratch, zero on entry.
    """
    rows, columns = odds.shape
    bit = np.uint16(1 << max(band, 0))
    for i in range(rays.shape[0]):
        if not np.isfinite(rays[i, 4]):
            continue
        # what returned reaches half a cell deeper at least: the surface may be a sliver of the first cell
        for k in range(3):
            distance = rays[i, 4] + 0.25 * k * resolution
            column_4 = int(np.floor(4.0 * (rays[i, 0] + distance * np.cos(rays[i, 2]) - origin[0]) / resolution))
            row_4 = int(np.floor(4.0 * (rays[i, 1] + distance * np.sin(rays[i, 2]) - origin[1]) / resolution))
            column, row = column_4 >> 2, row_4 >> 2
            if not (0 <= row < rows and 0 <= column < columns) or own[row, column]:
                continue
            if rays[i, 6] and known[row, column] == SEEN and mask[row, column] == 0:
                continue
            place = np.uint16(1 << ((column_4 & 3) | (row_4 & 3) << 2))
            if touched[row, column] == 1:
                places[row, column] |= place
                continue
            touched[row, column] = 1
            odds[row, column] = min(odds[row, column] + hit * rays[i, 5], odds_max)
            mask[row, column] |= bit
            places[row, column] = place
            remember(known, seen, last, row, column, stamp, dt)
    step = 0.5 * resolution
    for i in range(rays.shape[0]):
        cos, sin = np.cos(rays[i, 2]), np.sin(rays[i, 2])
        for k in range(int(rays[i, 3] / step)):
            column = int(np.floor((rays[i, 0] + (k + 0.5) * step * cos - origin[0]) / resolution))
            row = int(np.floor((rays[i, 1] + (k + 0.5) * step * sin - origin[1]) / resolution))
            if not (0 <= row < rows and 0 <= column < columns):
                break
            if touched[row, column] or own[row, column]:
                continue
            touched[row, column] = 2
            m = mask[row, column]
            if m == 0:
                odds[row, column] = max(odds[row, column] - miss, odds_min)
                known[row, column] = SEEN
                continue
            if band < 0 or not m & bit:
                continue
            # one height is all that such a sensor sees: it speaks for the whole thing
            erased = _run_with(m, band)
            if erased == m:
                odds[row, column] -= miss
                if odds[row, column] <= 0.0:
                    odds[row, column] = odds_min
                    mask[row, column] = 0
                    known[row, column] = SEEN
                    seen[row, column] = 0.0
            else:
                mask[row, column] = m & ~erased


@numba.njit(cache=True, nogil=True, inline="always")
def _run_with(mask, band):
    """The bits of ``mask`` that are connected with bit ``band``."""
    run = np.uint16(0)
    k = band
    while k >= 0 and (mask >> k) & 1:
        run |= np.uint16(1 << k)
        k -= 1
    k = band + 1
    while k < 15 and (mask >> k) & 1:
        run |= np.uint16(1 << k)
        k += 1
    return run
