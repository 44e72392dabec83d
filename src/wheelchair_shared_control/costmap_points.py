"""What a point cloud says of every cell; the cloud becomes a spherical image about its sensor for the looks."""
import numba
import numpy as np

from wheelchair_shared_control.costmap_depth import band_of

BINS_PER_RADIAN = 115.0  # half a degree
SHAPE = (361, 723)  # elevations, azimuths: all directions
# intrinsics of the spherical image, whose frame has z along odom's x, x along odom's -y, y down
INTRINSICS = (BINS_PER_RADIAN, BINS_PER_RADIAN, 361.0, 180.0, 1.0)


@numba.njit(cache=True, nogil=True)
def count_points(points, sensor, image, origin, resolution, limits,
                 hits, bands, places, floor, drops):
    """Sort ``points`` (n, 3) of odom into the counters, as `costmap_depth.count_returns` does with pixels.

    ``sensor`` (3,) is where the rays began; ``image`` becomes the spherical image of the nearest ranges,
    NaN where no point lies. Points that are not finite say nothing: their direction is lost.
    Returns how many points were used, and how many pixels of the image they fill.
    """
    rows, columns = hits.shape
    min_height, max_height, obstacle_range, raytrace_range, tolerance = limits[:5]
    image[:] = np.nan
    used = 0
    filled = 0
    for i in range(points.shape[0]):
        dx, dy, dz = points[i, 0] - sensor[0], points[i, 1] - sensor[1], points[i, 2] - sensor[2]
        level = np.sqrt(dx * dx + dy * dy)
        distance = np.sqrt(level * level + dz * dz)
        if not (distance > 0.0 and distance < np.inf):
            continue
        used += 1
        u = int(np.arctan2(-dy, dx) * INTRINSICS[0] + INTRINSICS[2] + 0.5)
        # straight down would be the row below the last
        v = min(int(np.arctan2(-dz, level) * INTRINSICS[1] + INTRINSICS[3] + 0.5), SHAPE[0] - 1)
        if np.isnan(image[v, u]):
            filled += 1
            image[v, u] = distance
        elif distance < image[v, u]:
            image[v, u] = distance
        h = points[i, 2]
        if h > max_height:
            continue
        x = (points[i, 0] - origin[0]) / resolution
        y = (points[i, 1] - origin[1]) / resolution
        inside = x >= 0 and y >= 0 and x < columns and y < rows
        if h > min_height:
            if inside and level <= obstacle_range:
                hits[int(y), int(x)] += 1
                places[int(y), int(x)] |= np.uint16(1 << ((int(4.0 * x) & 3) | (int(4.0 * y) & 3) << 2))
                bands[int(y), int(x)] |= np.uint16(1 << band_of(h))
        elif h >= -tolerance:
            if inside and level <= raytrace_range:
                floor[int(y), int(x)] += 1
        elif sensor[2] > 0.0:
            if inside and level <= obstacle_range:
                drops[int(y), int(x)] += 1
            t = sensor[2] / (sensor[2] - h)
            x = (sensor[0] + t * dx - origin[0]) / resolution
            y = (sensor[1] + t * dy - origin[1]) / resolution
            if x >= 0 and y >= 0 and x < columns and y < rows and t * level <= obstacle_range:
                drops[int(y), int(x)] += 1
    return used, filled
