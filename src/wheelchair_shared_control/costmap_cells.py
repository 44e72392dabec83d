"""How the looks of one observation change the memory of a cell.

Memory of a cell: ``odds`` (log-odds of being occupied), ``mask`` (heights at which something was seen, see
`costmap_depth`), ``places`` (where in the cell, see `costmap_surface`), ``known`` (0 no, SEEN free or
driven over, PRESUMED free at the start, FOUND occupied, DOUBTFUL presumed, but farther off),
``seen`` [s] (for how long something was seen there),
``last`` [s] (when last).

The newest look wins: the log-odds are held in a narrow band, two looks through an obstacle erase it, and one
clear hit makes ground lethal that was free. Odometry drifts; a jamb that is now seen 3 cm beside where it was
remembered must not stay twice, or a 0.75 m door is closed.
"""
import numba
import numpy as np

from wheelchair_shared_control.costmap_depth import (
    BAND_HEIGHT,
    BANDS,
    BLOCKED,
    DROP,
    LOWEST_BAND,
    THROUGH,
    look,
)

SEEN, PRESUMED, FOUND, DOUBTFUL = 1, 2, 3, 4
_STANDS = 5.0  # time counts so much more for what was found on unknown ground
ALL_PLACES = np.uint16(0xFFFF)


@numba.njit(cache=True, nogil=True)
def contradicted(mask, through, blocked):
    """The bits of ``mask`` that are erased by looks ``through`` some heights and not ``blocked`` at others.

    Heights with less than three empty bands between them are one thing: a wall seen from afar over its whole
    height is gone when a camera that has come near, and sees only the middle, looks through that middle. A
    fifth of the thing, at least two bands of a tall one, must be looked through.
    """
    erased = np.uint16(0)
    low = 0
    while low < BANDS:
        if not (mask >> low) & 1:
            low += 1
            continue
        run = np.uint16(0)
        n, n_through, n_blocked, gap = 0, 0, 0, 0
        while low < BANDS and gap < 3:
            bit = np.uint16(1 << low)
            if mask & bit:
                run |= bit
                n += 1
                gap = 0
                n_through += 1 if through & bit else 0
                n_blocked += 1 if blocked & bit else 0
            else:
                gap += 1
            low += 1
        if n_blocked == 0 and n_through > 0 and (n_through >= 2 or n <= 4) and 5 * n_through >= n:
            erased |= run
    return erased


@numba.njit(cache=True, nogil=True)
def forget_cell(odds, mask, known, seen, row, column):
    odds[row, column] = 0.0
    mask[row, column] = 0
    known[row, column] = 0
    seen[row, column] = 0.0


@numba.njit(cache=True, nogil=True, inline="always")
def remember(known, seen, last, row, column, stamp, dt):
    """Note that something was seen in a cell.

    What is found where nothing was known most likely stands there. What appears on ground seen free has moved
    there, or the odometry has: it must be seen for longer to be taken for standing.
    """
    if known[row, column] != SEEN:
        known[row, column] = FOUND
        seen[row, column] += _STANDS * dt
    else:
        seen[row, column] += dt
    last[row, column] = stamp


@numba.njit(cache=True, nogil=True)
def apply_counts(odds, mask, places, known, seen, last, hits, bands, new_places, floor, drops, holes, own,
                 depth, intrinsics, camera_from_odom, camera_position, origin, resolution, per_radian, raytrace_range,
                 hit, miss, odds_min, odds_max, marking, clearing, stamp, dt):
    """Bring the counters of one depth image into the memory; ``own`` marks the cells under the chair.

    ``per_radian``: returns per radian, 0 for one each pixel.
    """
    rows, columns = odds.shape
    fx = per_radian if per_radian > 0.0 else intrinsics[0]
    fy = per_radian if per_radian > 0.0 else intrinsics[1]
    cx, cy, cz = camera_position
    for row in range(rows):
        y = origin[1] + (row + 0.5) * resolution
        for column in range(columns):
            n_hits = hits[row, column]
            n_drops = drops[row, column] + holes[row, column]
            n_floor = floor[row, column]
            m = mask[row, column]
            if n_hits == 0 and n_drops == 0 and n_floor == 0 and m == 0:
                continue
            if own[row, column]:
                continue
            x = origin[0] + (column + 0.5) * resolution
            gained = 0.0
            if marking and n_hits + n_drops > 0:
                dx, dy = x - cx, y - cy
                distance = np.sqrt(dx * dx + dy * dy)
                # pixels that a face of one cell square, or a cell's floor, covers at this distance
                pixels = resolution / max(distance, 0.3)
                face = fx * fy * pixels * pixels
                if n_hits > 0:
                    if n_hits >= 0.5 * face:
                        gained = hit
                    elif n_hits >= 0.1 * face and n_hits >= 2:
                        gained = 0.4 * hit
                    if gained > 0.0 and _noise_of_what_is_behind(hits, row, column, dx, dy, distance, resolution):
                        gained = 0.0
                        n_hits = 0
                    elif gained > 0.0 and clearing and _beside_more(hits, row, column):
                        through, blocked = _look_at_heights(
                            bands[row, column], depth, intrinsics, camera_from_odom, x, y, resolution,
                            raytrace_range)
                        if blocked == 0 and through != 0:
                            gained = 0.0
                            n_hits = 0
                if n_drops > 0 and n_drops > n_floor:
                    ground = face * cz / max(distance, 0.3)
                    strength = 0.0
                    if drops[row, column] >= 0.3 * ground:
                        strength = hit
                    elif n_drops >= 0.3 * ground:
                        strength = 0.75 * hit  # invalid pixels only: twice
                    if strength > 0.0:
                        mask[row, column] |= DROP
                        gained = max(gained, strength)
            if gained > 0.0:
                odds[row, column] = min(odds[row, column] + gained, odds_max)
                if n_hits > 0:
                    mask[row, column] |= bands[row, column]
                    places[row, column] = new_places[row, column]
                else:
                    places[row, column] = ALL_PLACES
                remember(known, seen, last, row, column, stamp, dt)
                continue
            if n_hits > 0 or not clearing:
                continue
            if m == 0:
                if n_floor > 0:
                    odds[row, column] = max(odds[row, column] - miss, odds_min)
                    known[row, column] = SEEN
                continue
            # something is remembered here, and nothing was hit: look at its heights
            through, blocked = _look_at_heights(
                m, depth, intrinsics, camera_from_odom, x, y, resolution, raytrace_range)
            erased = contradicted(m, through, blocked)
            if m & DROP and n_floor > 0 and n_drops == 0:
                erased |= DROP
            if erased == 0:
                continue
            if erased == m:
                odds[row, column] -= miss
                if odds[row, column] <= 0.0:
                    odds[row, column] = odds_min
                    mask[row, column] = 0
                    known[row, column] = SEEN
                    seen[row, column] = 0.0
            else:
                mask[row, column] = m & ~erased


@numba.njit(cache=True, nogil=True)
def _look_at_heights(mask, depth, intrinsics, camera_from_odom, x, y, resolution, reach):
    """At which heights of ``mask`` the camera looks through the cell at (x, y), and at which it is blocked."""
    through = np.uint16(0)
    blocked = np.uint16(0)
    half = 0.5 * resolution
    for band in range(BANDS):
        bit = np.uint16(1 << band)
        if mask & bit:
            # a band may be filled in part, as by the lower end of a lamp: it is empty if both ends are
            z = LOWEST_BAND + band * BAND_HEIGHT
            low = look(depth, intrinsics, camera_from_odom, x, y, z + 0.2 * BAND_HEIGHT, half, reach)
            high = look(depth, intrinsics, camera_from_odom, x, y, z + 0.8 * BAND_HEIGHT, half, reach)
            if low == BLOCKED or high == BLOCKED:
                blocked |= bit
            elif low == THROUGH and high == THROUGH:
                through |= bit
    return through, blocked


@numba.njit(cache=True, nogil=True)
def _beside_more(hits, row, column):
    """Whether an adjacent cell was hit at least twice as often: this one may hold only a sliver of it."""
    few = 2 * hits[row, column]
    for r in range(max(row - 1, 0), min(row + 2, hits.shape[0])):
        for c in range(max(column - 1, 0), min(column + 2, hits.shape[1])):
            if hits[r, c] >= few:
                return True
    return False


@numba.njit(cache=True, nogil=True, inline="always")
def _noise_of_what_is_behind(hits, row, column, dx, dy, distance, resolution):
    """Few hits just before many are the noise of the many: sigma 2.5 at this distance."""
    sigma = 0.0012 + 0.0019 * (distance - 0.4) ** 2
    steps = int(2.5 * sigma / resolution + 0.6)
    few = hits[row, column]
    for step in range(1, min(steps, 4) + 1):
        r_0 = row + int(np.round(step * dy / distance))
        c_0 = column + int(np.round(step * dx / distance))
        for r in range(max(r_0 - 1, 0), min(r_0 + 2, hits.shape[0])):
            for c in range(max(c_0 - 1, 0), min(c_0 + 2, hits.shape[1])):
                if few < 0.2 * hits[r, c]:
                    return True
    return False


@numba.njit(cache=True, nogil=True)
def forget_brief(odds, mask, known, seen, last, now, memory_time, static_time):
    """What was seen only briefly, and not for ``memory_time``, becomes unknown again: it moved away.

    A cell within two cells of something long seen is kept with it: drift moves a jamb over cells that
    were each seen only for a moment. Returns how many were forgotten.
    """
    rows, columns = odds.shape
    forgotten = 0
    for row in range(rows):
        for column in range(columns):
            if mask[row, column] == 0 or now - last[row, column] < memory_time:
                continue
            longest = np.float32(0.0)
            for r in range(max(row - 2, 0), min(row + 3, rows)):
                for c in range(max(column - 2, 0), min(column + 3, columns)):
                    longest = max(longest, seen[r, c])
            if longest < static_time:
                # marked with NaN, so that it does not count for its neighbours' verdict before theirs
                last[row, column] = np.nan
                forgotten += 1
    if forgotten:
        for row in range(rows):
            for column in range(columns):
                if np.isnan(last[row, column]):
                    forget_cell(odds, mask, known, seen, row, column)
                    last[row, column] = -np.inf
    return forgotten


@numba.njit(cache=True, nogil=True)
def drive_over(odds, mask, known, seen, own, odds_min, how):
    """The ground under the chair is free and known, whatever was remembered there; ``how`` SEEN, PRESUMED, DOUBTFUL."""
    for row in range(own.shape[0]):
        for column in range(own.shape[1]):
            if own[row, column]:
                odds[row, column] = odds_min
                mask[row, column] = 0
                known[row, column] = how
                seen[row, column] = 0.0


@numba.njit(cache=True, nogil=True)
def cells_inside(own, pose, front, rear, half_width, origin, resolution):
    """Fill ``own`` (rows, columns) bool: cells whose centre lies in the rectangle at ``pose`` (3,)."""
    own[:] = False
    rows, columns = own.shape
    reach = np.sqrt(max(front, -rear) ** 2 + half_width ** 2)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    row_0 = max(int((pose[1] - reach - origin[1]) / resolution), 0)
    row_1 = min(int((pose[1] + reach - origin[1]) / resolution) + 2, rows)
    column_0 = max(int((pose[0] - reach - origin[0]) / resolution), 0)
    column_1 = min(int((pose[0] + reach - origin[0]) / resolution) + 2, columns)
    for row in range(row_0, row_1):
        dy = origin[1] + (row + 0.5) * resolution - pose[1]
        for column in range(column_0, column_1):
            dx = origin[0] + (column + 0.5) * resolution - pose[0]
            ahead = cos * dx + sin * dy
            beside = cos * dy - sin * dx
            own[row, column] = rear <= ahead <= front and abs(beside) <= half_width


@numba.njit(cache=True, nogil=True)
def costs(distance, known, resolution, inscribed, inflation_radius, scaling, track_unknown, cost):
    """Fill ``cost`` (rows, columns) uint8 from ``distance`` [m]: 254, 253, floor(252 exp(-k (d - r))), 255."""
    rows, columns = distance.shape
    # squared distances are whole numbers of cells: one exponential each
    n = int((inflation_radius / resolution) ** 2) + 2
    table = np.zeros(n, np.uint8)
    for i in range(n):
        d = np.sqrt(i) * resolution
        if i == 0:
            table[i] = 254
        elif d <= inscribed:
            table[i] = 253
        elif d <= inflation_radius:
            table[i] = int(252.0 * np.exp(-scaling * (d - inscribed)))
    scale = 1.0 / (resolution * resolution)
    for row in range(rows):
        for column in range(columns):
            d = distance[row, column]
            if d > 0.0 and track_unknown and not known[row, column]:
                cost[row, column] = 255
                continue
            i = int(d * d * scale + 0.5)
            cost[row, column] = table[i] if i < n else 0
