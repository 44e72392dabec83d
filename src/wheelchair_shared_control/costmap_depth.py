"""What one depth image says of every cell: returns in the obstacle band, floor, drop-offs, looks through it.

The grid is the horizontal plane of odom. Heights are measured from the floor, z = 0 in odom; they are kept as
bands of 0.1 m in one 16 bit mask a cell, so that only a look at the height of an obstacle can clear it: a
camera that has come too near for a lamp, and sees the floor below it, must not forget the lamp.
"""
import numba
import numpy as np

BANDS = 15  # bands of BAND_HEIGHT from LOWEST_BAND on; what lies lower or higher counts to the outer ones
BAND_HEIGHT = np.float32(0.1)
LOWEST_BAND = np.float32(0.05)  # m above the floor: a look at a lower height could not be told from the floor
DROP = np.uint16(1 << 15)  # the bit of a drop-off

UNSEEN, THROUGH, BLOCKED = 0, 1, 2

_COARSE = 8  # pixels: a hole in the floor is at least a block of so many invalid pixels square


@numba.njit(cache=True, nogil=True, inline="always")
def band_of(height):
    """The number of the band that a height [m] above the floor belongs to."""
    return min(max(int((height - LOWEST_BAND) / BAND_HEIGHT), 0), BANDS - 1)


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
    return _fullest(bins, reach, scale, expected, tolerance)


@numba.njit(cache=True, nogil=True)
def _fullest(bins, reach, scale, expected, tolerance):
    """Angle [rad] of the fullest bin, NaN if it is no tenth of ``expected`` or beyond ``tolerance``."""
    best, k_best = 0, 0
    for k in range(1, bins.shape[0] - 1):
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
def cloud_pitch_error(points, sensor, tolerance, bins):
    """As `camera_pitch_error` for ``points`` (n, 3) of odom; and the heading (2,) that the cloud covers.

    A cloud from all round has no heading: NaN.
    """
    heading = np.zeros(2)
    total = 0.0
    step = max(points.shape[0] // 5000, 1)
    for i in range(0, points.shape[0], step):
        dx, dy = points[i, 0] - sensor[0], points[i, 1] - sensor[1]
        level = np.sqrt(dx * dx + dy * dy)
        if 0.1 < level < 20.0:
            heading[0] += dx / level
            heading[1] += dy / level
            total += 1.0
    norm = np.sqrt(heading[0] ** 2 + heading[1] ** 2)
    if norm < 0.5 * total or total < 50.0:
        return np.nan, heading
    heading /= norm
    bins[:] = 0
    reach = tolerance * 1.5
    scale = bins.shape[0] / (2.0 * reach)
    expected = 0
    for i in range(0, points.shape[0], step):
        ahead = (points[i, 0] - sensor[0]) * heading[0] + (points[i, 1] - sensor[1]) * heading[1]
        if not 0.5 < ahead < 4.0 or not sensor[2] - points[i, 2] > 0.25 * ahead:
            continue
        expected += 1
        slope = points[i, 2] / ahead
        k = int((slope + reach) * scale)
        if slope > -reach and k < bins.shape[0]:
            bins[k] += 1
    return _fullest(bins, reach, scale, expected, tolerance), heading


@numba.njit(cache=True, nogil=True, error_model="numpy")
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
    zero, four = np.float32(0.0), np.float32(4.0)
    width_cells, height_cells = np.float32(columns), np.float32(rows)
    # the rays of a row, in cells a metre of depth: a part of the row and a part of the column
    xn = ((np.arange(width) - cx) / fx).astype(np.float32)
    columns_x, columns_y, columns_z = m[0, 0] * xn * inverse, m[1, 0] * xn * inverse, m[2, 0] * xn
    columns_ahead = (m[0, 0] * ahead_x + m[1, 0] * ahead_y) * xn
    kind = np.empty(width, np.int8)
    cell = np.empty(width, np.int32)
    place = np.empty(width, np.int32)
    band = np.empty(width, np.int32)
    hits_flat, bands_flat, places_flat = hits.ravel(), bands.ravel(), places.ravel()
    floor_flat = floor.ravel()
    for v in range(height):
        yn = np.float32((v - cy) / fy)
        row_x = (m[0, 1] * yn + m[0, 2]) * inverse
        row_y = (m[1, 1] * yn + m[1, 2]) * inverse
        row_z = m[2, 1] * yn + m[2, 2]
        row_ahead = (m[0, 1] * yn + m[0, 2]) * ahead_x + (m[1, 1] * yn + m[1, 2]) * ahead_y
        image = depth[v]
        for u in range(width):  # no branches: the compiler makes vector instructions of this loop
            z = image[u]
            x = x0 + z * (row_x + columns_x[u])
            y = y0 + z * (row_y + columns_y[u])
            h = z0 + z * (row_z + columns_z[u])
            distance = z * (row_ahead + columns_ahead[u])
            inside = (x >= zero) & (y >= zero) & (x < width_cells) & (y < height_cells) & (z > zero)
            hit = inside & (h > min_height) & (h <= max_height) & (distance <= obstacle_range)
            ground = inside & (h <= min_height) & (h >= lowest) & (distance <= raytrace_range)
            special = ((z > zero) & (h < lowest)) | (z < zero)
            kind[u] = np.int8(hit) + np.int8(2) * np.int8(ground) + np.int8(3) * np.int8(special)
            column_4, row_4 = np.int32(x * four), np.int32(y * four)
            cell[u] = (row_4 >> 2) * np.int32(columns) + (column_4 >> 2)
            place[u] = (column_4 & 3) | ((row_4 & 3) << 2)
            band[u] = min(max(np.int32((h - LOWEST_BAND) * per_band), np.int32(0)), np.int32(BANDS - 1))
        for u in range(width):
            k = kind[u]
            if k == 0:
                continue
            if k == 1:
                hits_flat[cell[u]] += 1
                places_flat[cell[u]] |= np.uint16(1 << place[u])
                bands_flat[cell[u]] |= np.uint16(1 << band[u])
                continue
            if k == 2:
                floor_flat[cell[u]] += 1
                continue
            z = image[u]
            dx, dy, dz = row_x + columns_x[u], row_y + columns_y[u], row_z + columns_z[u]
            ahead = row_ahead + columns_ahead[u]
            if z < zero:
                if z == -np.inf:  # something nearer than the camera can tell
                    h = z0 + nearest * dz
                    x, y = x0 + nearest * dx, y0 + nearest * dy
                    if min_height < h <= max_height and 0 <= x < width_cells and 0 <= y < height_cells:
                        hits[int(y), int(x)] += 1
                        places[int(y), int(x)] = 0xFFFF
                        bands[int(y), int(x)] |= np.uint16(1 << band_of(h))
                continue
            if not dz < np.float32(-1e-3):
                continue
            t = -z0 / dz  # the depth at which the ray goes through the level of the floor
            if z == np.inf:
                drop = floor_near <= ahead * t <= floor_far  # must be seen here, and is missing
            else:
                drop = ahead * t <= obstacle_range
                x, y = x0 + z * dx, y0 + z * dy
                if ahead * z <= obstacle_range and 0 <= x < width_cells and 0 <= y < height_cells:
                    drops[int(y), int(x)] += 1
            x, y = x0 + t * dx, y0 + t * dy
            if drop and 0 <= x < width_cells and 0 <= y < height_cells:
                drops[int(y), int(x)] += 1


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
