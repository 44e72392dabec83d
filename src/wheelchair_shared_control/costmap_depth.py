"""What one depth image says of every cell: returns in the obstacle band, floor, drop-offs, looks through it.

The grid is the horizontal plane of odom. Heights are measured from the floor, z = 0 in odom; they are kept as
bands of 0.1 m in one 16 bit mask a cell, so that only a look at the height of an obstacle can clear it: a
camera that has come too near for a lamp, and sees the floor below it, must not forget the lamp.
"""
import numba
import numpy as np

BANDS = 15  # bands of BAND_HEIGHT from the lowest marking height on
BAND_HEIGHT = np.float32(0.1)
DROP = np.uint16(1 << 15)  # the bit of a drop-off

UNSEEN, THROUGH, BLOCKED = 0, 1, 2

_COARSE = 8  # pixels: a hole in the floor is at least a block of so many invalid pixels square


@numba.njit(cache=True, nogil=True)
def camera_pitch_error(depth, intrinsics, odom_from_camera, tolerance, bins):
    """Error of the camera's pitch [rad, positive: it looks higher than it says] from the floor that it sees.

    A floor seen with a pitch error e appears to rise by tan(e) a metre: each floor pixel votes for
    height / distance, and the fullest bin wins, if it holds a tenth of the rays that should meet the floor
    within 4 m. Ramps and drop-offs do not aim at the camera's foot: they spread over many bins. Returns NaN
    where too little floor is seen.
    ``bins`` (n,) is scratch; ``intrinsics`` (fx, fy, cx, cy); ``odom_from_camera`` (3 or 4, 4).
    """
    height, width = depth.shape
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    m = odom_from_camera
    camera_height = m[2, 3]
    ahead_x, ahead_y = m[0, 2], m[1, 2]
    norm = np.sqrt(ahead_x * ahead_x + ahead_y * ahead_y)
    if norm < 0.2:  # looks straight down: no horizon to be wrong about
        return np.nan
    ahead_x /= norm
    ahead_y /= norm
    n = bins.shape[0]
    bins[:] = 0
    reach = tolerance * 1.5
    scale = n / (2.0 * reach)
    expected = 0
    for v in range(_COARSE // 2, height, _COARSE):
        yn = (v - cy) / fy
        for u in range(_COARSE // 2, width, _COARSE):
            xn = (u - cx) / fx
            up = m[2, 0] * xn + m[2, 1] * yn + m[2, 2]
            ahead = (ahead_x * (m[0, 0] * xn + m[0, 1] * yn + m[0, 2])
                     + ahead_y * (m[1, 0] * xn + m[1, 1] * yn + m[1, 2]))
            if up * 4.0 > -camera_height * ahead:
                continue
            expected += 1
            z = depth[v, u]
            if not (z > 0.0 and z < 20.0):
                continue
            slope = (camera_height + z * up) / (z * ahead)
            k = int((slope + reach) * scale)
            if slope > -reach and k < n:
                bins[k] += 1
    best, k_best = 0, 0
    for k in range(1, n - 1):
        votes = bins[k - 1] + bins[k] + bins[k + 1]
        if votes > best:
            best, k_best = votes, k
    if expected < 50 or best < 0.1 * expected:
        return np.nan
    mean = 0.0
    for k in range(k_best - 1, k_best + 2):
        mean += bins[k] * ((k + 0.5) / scale - reach)
    mean /= best
    return np.arctan(mean) if abs(mean) <= tolerance else np.nan


@numba.njit(cache=True, nogil=True)
def count_returns(depth, intrinsics, odom_from_camera, origin, resolution, limits,
                  hits, bands, places, floor, drops):
    """Sort every pixel of ``depth`` into the counters of its cell.

    ``limits``: (min height, max height, obstacle range, raytrace range, floor tolerance, floor near,
    floor far, depth that -Inf stands for) [m]. Distances are horizontal, along the camera's heading.
    Counters (rows, columns): ``hits``, ``bands`` and ``places`` (see `costmap_surface`) of returns between
    the heights, ``floor``, ``drops``: rays that passed below the floor's level, or that met no floor where it
    must be seen.
    """
    height, width = depth.shape
    rows, columns = hits.shape
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    m = odom_from_camera.astype(np.float32)
    min_height, max_height = np.float32(limits[0]), np.float32(limits[1])
    obstacle_range, raytrace_range = np.float32(limits[2]), np.float32(limits[3])
    lowest, floor_near, floor_far = np.float32(-limits[4]), np.float32(limits[5]), np.float32(limits[6])
    nearest = np.float32(limits[7])
    inverse = np.float32(1.0 / resolution)
    x0 = np.float32((odom_from_camera[0, 3] - origin[0]) / resolution)
    y0 = np.float32((odom_from_camera[1, 3] - origin[1]) / resolution)
    z0 = m[2, 3]
    norm = np.sqrt(m[0, 2] * m[0, 2] + m[1, 2] * m[1, 2])
    ahead_x = m[0, 2] / norm if norm > 1e-6 else np.float32(1.0)
    ahead_y = m[1, 2] / norm if norm > 1e-6 else np.float32(0.0)
    per_band = np.float32(1.0) / BAND_HEIGHT
    four = np.float32(4.0)
    xn = ((np.arange(width) - cx) / fx).astype(np.float32)
    columns_x, columns_y, columns_z = m[0, 0] * xn, m[1, 0] * xn, m[2, 0] * xn
    for v in range(height):
        yn = np.float32((v - cy) / fy)
        row_x = m[0, 1] * yn + m[0, 2]
        row_y = m[1, 1] * yn + m[1, 2]
        row_z = m[2, 1] * yn + m[2, 2]
        for u in range(width):
            z = depth[v, u]
            if np.isnan(z):
                continue
            dx = row_x + columns_x[u]
            dy = row_y + columns_y[u]
            dz = row_z + columns_z[u]
            ahead = dx * ahead_x + dy * ahead_y
            if z == np.inf:  # nothing within range: where the floor must be seen, it is missing
                if dz < np.float32(-1e-3):
                    t = -z0 / dz
                    if floor_near <= ahead * t <= floor_far:
                        column = int(x0 + dx * t * inverse)
                        row = int(y0 + dy * t * inverse)
                        if 0 <= row < rows and 0 <= column < columns:
                            drops[row, column] += 1
                continue
            if z <= np.float32(0.0):
                if z > -np.inf:  # 0 is how cameras say invalid
                    continue
                z = nearest
            h = z0 + z * dz
            if h > max_height:
                continue
            distance = z * ahead
            if distance > raytrace_range:
                if h >= lowest or dz >= np.float32(-1e-3):
                    continue
            # floats below 0 are cut towards 0: shift so that the first row is not doubled
            fx_cell = x0 + z * dx * inverse
            fy_cell = y0 + z * dy * inverse
            inside = fx_cell >= 0 and fy_cell >= 0 and fx_cell < columns and fy_cell < rows
            if h > min_height:
                if inside and distance <= obstacle_range:
                    column_4, row_4 = int(fx_cell * four), int(fy_cell * four)
                    column, row = column_4 >> 2, row_4 >> 2
                    hits[row, column] += 1
                    places[row, column] |= np.uint16(1 << ((column_4 & 3) | (row_4 & 3) << 2))
                    bands[row, column] |= np.uint16(1 << int((h - min_height) * per_band))
            elif h >= lowest:
                if inside:
                    floor[int(fy_cell), int(fx_cell)] += 1
            else:
                if inside and distance <= obstacle_range:
                    drops[int(fy_cell), int(fx_cell)] += 1
                t = z0 / (z0 - h)  # where the ray went through the level of the floor
                if distance * t <= obstacle_range:
                    fx_cell = x0 + t * z * dx * inverse
                    fy_cell = y0 + t * z * dy * inverse
                    if fx_cell >= 0 and fy_cell >= 0 and fx_cell < columns and fy_cell < rows:
                        drops[int(fy_cell), int(fx_cell)] += 1


@numba.njit(cache=True, nogil=True)
def count_holes(depth, intrinsics, odom_from_camera, origin, resolution, near, far, holes):
    """Count in ``holes`` (rows, columns) the invalid pixels where the floor must be seen.

    Cameras say invalid (NaN, 0) where nothing returns their light, as over stairs that lead down, but also
    at the edge of every object: only a whole block of invalid pixels counts.
    """
    height, width = depth.shape
    rows, columns = holes.shape
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    m = odom_from_camera
    norm = max(np.sqrt(m[0, 2] * m[0, 2] + m[1, 2] * m[1, 2]), 1e-6)
    size = max(6, _COARSE * width // 640)
    for v0 in range(0, height - size + 1, size):
        yn = (v0 + 0.5 * size - cy) / fy
        for u0 in range(0, width - size + 1, size):
            xn = (u0 + 0.5 * size - cx) / fx
            dz = m[2, 0] * xn + m[2, 1] * yn + m[2, 2]
            if dz > -0.05:
                continue
            t = -m[2, 3] / dz
            ahead = t * (m[0, 2] * (m[0, 0] * xn + m[0, 1] * yn + m[0, 2])
                         + m[1, 2] * (m[1, 0] * xn + m[1, 1] * yn + m[1, 2])) / norm
            if ahead < near or ahead > far:
                continue
            empty = True
            for v in range(v0, v0 + size):
                for u in range(u0, u0 + size):
                    z = depth[v, u]
                    if z > 0.0 or z == -np.inf:
                        empty = False
                        break
                if not empty:
                    break
            if not empty:
                continue
            for v in range(v0, v0 + size):
                yn_v = (v - cy) / fy
                for u in range(u0, u0 + size):
                    xn_u = (u - cx) / fx
                    dz = m[2, 0] * xn_u + m[2, 1] * yn_v + m[2, 2]
                    if dz > -0.05:
                        continue
                    t = -m[2, 3] / dz
                    column = int((m[0, 3] + t * (m[0, 0] * xn_u + m[0, 1] * yn_v + m[0, 2]) - origin[0]) / resolution)
                    row = int((m[1, 3] + t * (m[1, 0] * xn_u + m[1, 1] * yn_v + m[1, 2]) - origin[1]) / resolution)
                    if 0 <= row < rows and 0 <= column < columns:
                        holes[row, column] += 1


@numba.njit(cache=True, nogil=True)
def look(depth, intrinsics, camera_from_odom, x, y, z, half_cell, reach):
    """Whether the camera looks THROUGH a cell at the point (x, y, z) of odom, sees it BLOCKED, or neither.

    Three pixels across the cell are asked: the middle one is often the invalid edge of a jamb. BLOCKED: one
    of them returns from the cell's own depth. UNSEEN: out of the image, hidden by something nearer, invalid.
    A fifth intrinsic of 1 stands for a spherical image (see `costmap_points`).
    """
    m = camera_from_odom
    right = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3]
    down = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3]
    forward = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3]
    if intrinsics[4] == 1.0:
        level = np.sqrt(right * right + forward * forward)
        u = np.arctan2(right, forward) * intrinsics[0] + intrinsics[2]
        v = np.arctan2(down, level) * intrinsics[1] + intrinsics[3]
        forward = np.sqrt(level * level + down * down)
    else:
        if forward < 0.1:
            return UNSEEN
        u = right / forward * intrinsics[0] + intrinsics[2]
        v = down / forward * intrinsics[1] + intrinsics[3]
    if forward < 0.1 or forward > reach or not (v > -0.5 and v < depth.shape[0] - 0.5):
        return UNSEEN
    # Kinect: sigma_z = 0.0012 + 0.0019 (z - 0.4)^2; three of them, and half the diagonal of the cell
    margin = 1.42 * half_cell + 3.0 * (0.0012 + 0.0019 * (forward - 0.4) ** 2)
    aside = 0.7 * half_cell / forward * intrinsics[0]
    row = int(v + 0.5)
    state = UNSEEN
    for k in range(-1, 2):
        column = int(np.floor(u + k * aside + 0.5))
        if column < 0 or column >= depth.shape[1]:
            continue
        d = depth[row, column]
        if d > forward + margin:
            state = THROUGH
        elif d >= forward - margin:
            return BLOCKED
    return state
