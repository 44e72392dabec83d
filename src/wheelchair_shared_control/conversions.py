"""ROS messages to values and back.

Works on any object with the fields of the message (from topics or from bags), so that nodes, bags and tests share it.
Functions that fill a message take the empty message as an argument: nothing here imports a message package.
"""
import numpy as np

from wheelchair_shared_control.camera import Camera
from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.grid import LETHAL, Grid
from wheelchair_shared_control.values import Doorway, Odometry, Twist


class ConversionError(Error):
    """A message is malformed: wrong encoding, wrong length, missing field, not planar."""


DEPTH_ENCODINGS = {"32FC1": "f4", "16UC1": "u2"}
# sensor_msgs/PointField datatypes
POINT_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
FLOAT32, UINT32 = 7, 6
# one lethal cell of a costmap's surface: middle and half sizes [m] of the box that the obstacle in it fills, and the
# cell's number, row by row, in the grid of the same stamp
SURFACE = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("half_x", "<f4"), ("half_y", "<f4"), ("cell", "<u4")])
FINEST_GRID, COARSEST_GRID = 0.005, 0.5  # m: finer ones take gigabytes, in coarser ones there is no door
# quarters of a cell that a box may reach out of its cell, see `costmap_surface`
BOX_LOW, BOX_HIGH = -4, 7


# ---- time ----------------------------------------------------------------------------------------------


def seconds(stamp):
    """A stamp from a topic (secs, nsecs) or a bag (sec, nanosec) as seconds."""
    if hasattr(stamp, "secs"):
        return stamp.secs + 1e-9 * stamp.nsecs
    return stamp.sec + 1e-9 * stamp.nanosec


# ---- poses and velocities ------------------------------------------------------------------------------


def yaw_of(quaternion):
    """Yaw [rad] of a quaternion message. Raises ConversionError where it is not one."""
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    norm = x * x + y * y + z * z + w * w
    if not np.isfinite(norm) or abs(norm - 1.0) > 0.02:
        raise ConversionError(
            "invalid quaternion (%g, %g, %g, %g): its length must be 1" % (x, y, z, w)
        )
    return float(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def goal_pose_of(message):
    """Pose (3,) of a goal's ``geometry_msgs/Pose``, as lenient as the C++ move_base: any length, but upright.

    Raises ConversionError.
    """
    q = message.orientation
    quaternion = np.array([q.x, q.y, q.z, q.w])
    norm = float(np.linalg.norm(quaternion))
    if not np.isfinite(norm) or norm < 1e-3:
        raise ConversionError("invalid quaternion (%g, %g, %g, %g)" % tuple(quaternion))
    x, y, z, w = quaternion / norm
    if 1.0 - 2.0 * (x * x + y * y) < 0.999:
        raise ConversionError("invalid quaternion (%g, %g, %g, %g): it is tilted" % tuple(quaternion))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    pose = np.array([message.position.x, message.position.y, yaw])
    if not np.isfinite(pose).all():
        raise ConversionError("invalid position (%g, %g): it is not finite" % tuple(pose[:2]))
    return pose


def fill_quaternion(message, yaw):
    """Set a quaternion message to a turn of ``yaw`` [rad] about z."""
    message.x = message.y = 0.0
    message.z, message.w = float(np.sin(yaw / 2.0)), float(np.cos(yaw / 2.0))
    return message


def pose_of(message):
    """Pose (3,) of a ``geometry_msgs/Pose``. Raises ConversionError."""
    pose = np.array([message.position.x, message.position.y, yaw_of(message.orientation)])
    if not np.isfinite(pose).all():
        raise ConversionError("pose (%g, %g, %g) is not finite" % tuple(pose))
    return pose


def fill_pose(message, pose):
    """Set a ``geometry_msgs/Pose`` to a planar pose (3,)."""
    message.position.x, message.position.y, message.position.z = float(pose[0]), float(pose[1]), 0.0
    fill_quaternion(message.orientation, float(pose[2]))
    return message


def transform_matrix(message):
    """Transform (4, 4) of a ``geometry_msgs/Transform``. Raises ConversionError."""
    q, t = message.rotation, message.translation
    norm = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
    if not np.isfinite(norm) or abs(norm - 1.0) > 0.02:
        raise ConversionError("invalid rotation in a transform: its quaternion's length must be 1")
    x, y, z, w = q.x, q.y, q.z, q.w
    matrix = np.eye(4)
    matrix[:3, :3] = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    matrix[:3, 3] = (t.x, t.y, t.z)
    if not np.isfinite(matrix).all():
        raise ConversionError("a transform is not finite")
    return matrix


def twist_of(message):
    """``Twist`` of a ``geometry_msgs/Twist``; non-finite numbers pass through for the reader to refuse."""
    return Twist(float(message.linear.x), float(message.angular.z))


def is_planar(message):
    """Whether a ``geometry_msgs/Twist`` moves only along x and about z."""
    linear, angular = message.linear, message.angular
    return linear.y == 0.0 and linear.z == 0.0 and angular.x == 0.0 and angular.y == 0.0


def fill_twist(message, twist):
    """Set a ``geometry_msgs/Twist``; None gives NaN (absent)."""
    v, w = (np.nan, np.nan) if twist is None else twist
    message.linear.x, message.angular.z = float(v), float(w)
    return message


def odometry_of(message):
    """``Odometry`` of a ``nav_msgs/Odometry``. Raises ConversionError."""
    twist = twist_of(message.twist.twist)
    if not np.isfinite(twist).all():
        raise ConversionError("odometry: velocity (%g, %g) is not finite" % twist)
    return Odometry(seconds(message.header.stamp), pose_of(message.pose.pose), twist)


# ---- depth ---------------------------------------------------------------------------------------------


def camera_of(message):
    """``Camera`` of a ``sensor_msgs/CameraInfo``. Raises ConversionError."""
    matrix = message.K if hasattr(message, "K") else message.k
    fx, cx, fy, cy = matrix[0], matrix[2], matrix[4], matrix[5]
    if not (np.isfinite([fx, fy, cx, cy]).all() and fx > 0.0 and fy > 0.0):
        raise ConversionError("camera info: focal lengths (%g, %g) must be positive" % (fx, fy))
    return Camera(int(message.width), int(message.height), float(fx), float(fy), float(cx), float(cy))


def fill_camera_info(message, camera):
    """Set the intrinsics of a ``sensor_msgs/CameraInfo`` (no distortion)."""
    message.width, message.height = camera.width, camera.height
    message.distortion_model = "plumb_bob"
    message.D = [0.0] * 5
    message.K = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    message.R = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.P = [camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return message


def depth_of(message):
    """Depth (height, width) float32 [m] of a ``sensor_msgs/Image`` (32FC1 m, 16UC1 mm with 0 invalid; REP 118).

    Raises ConversionError.
    """
    kind = DEPTH_ENCODINGS.get(message.encoding)
    if kind is None:
        raise ConversionError("depth image: encoding '%s' must be 32FC1 or 16UC1" % message.encoding)
    dtype = np.dtype((">" if message.is_bigendian else "<") + kind)
    data = np.frombuffer(message.data, dtype=np.uint8)
    filled = message.width > 0 and message.step >= message.width * dtype.itemsize
    if not filled or data.size != message.step * message.height or not data.size:
        raise ConversionError(
            "depth image: %d bytes do not hold %d x %d pixels of %s"
            % (data.size, message.width, message.height, message.encoding)
        )
    rows = data.reshape(message.height, message.step)[:, : message.width * dtype.itemsize]
    image = np.ascontiguousarray(rows).view(dtype).reshape(message.height, message.width)
    if kind == "u2":
        depth = image.astype(np.float32) * np.float32(0.001)
        depth[image == 0] = np.nan
    else:
        depth = image.astype(np.float32, copy=False)
    # read-only whatever the encoding: numba compiles its functions once more for writable arrays
    depth.setflags(write=False)
    return depth


def fill_depth(message, image, encoding="32FC1"):
    """Set a ``sensor_msgs/Image`` to a depth image (height, width) [m]."""
    message.height, message.width = image.shape
    message.encoding, message.is_bigendian = encoding, 0
    if encoding == "16UC1":
        with np.errstate(invalid="ignore"):
            millimetres = np.where(np.isfinite(image), np.rint(image * 1000.0), 0.0)
        pixels = np.clip(millimetres, 0, 65535).astype("<u2")
    else:
        pixels = np.ascontiguousarray(image, dtype="<f4")
    message.step = message.width * pixels.dtype.itemsize
    message.data = pixels.tobytes()
    return message


def points_of(message):
    """Points (n, 3) float32 [m] of a ``sensor_msgs/PointCloud2``, invalid ones included. Raises ConversionError."""
    fields = {field.name: field for field in message.fields}
    missing = [name for name in "xyz" if name not in fields]
    if missing:
        raise ConversionError(
            "point cloud: field '%s' is missing (has: %s)" % (missing[0], ", ".join(sorted(fields)) or "none")
        )
    order = ">" if message.is_bigendian else "<"
    formats = []
    for name in "xyz":
        kind = POINT_TYPES.get(fields[name].datatype)
        if kind is None:
            raise ConversionError("point cloud: field '%s' has unknown type %d" % (name, fields[name].datatype))
        formats.append(order + kind)
    offsets = [fields[name].offset for name in "xyz"]
    data = np.frombuffer(message.data, dtype=np.uint8)
    ends = [offset + np.dtype(kind).itemsize for offset, kind in zip(offsets, formats)]
    if (
        data.size != message.row_step * message.height
        or message.row_step < message.width * message.point_step
        or (data.size and max(ends) > message.point_step)
    ):
        raise ConversionError(
            "point cloud: %d bytes do not hold %d x %d points of %d bytes"
            % (data.size, message.width, message.height, message.point_step)
        )
    if not data.size:
        return np.empty((0, 3), np.float32)
    dtype = np.dtype(
        {"names": list("xyz"), "formats": formats, "offsets": offsets, "itemsize": message.point_step}
    )
    rows = data.reshape(message.height, message.row_step)[:, : message.width * message.point_step]
    points = np.ascontiguousarray(rows).view(dtype).reshape(-1)
    return np.stack([points[name].astype(np.float32) for name in "xyz"], axis=-1)


def fill_points(message, points, point_field):
    """Set a ``sensor_msgs/PointCloud2`` to points (..., 3) [m]; ``point_field`` is the PointField class."""
    points = np.ascontiguousarray(points, dtype="<f4")
    message.height, message.width = points.shape[:2] if points.ndim == 3 else (1, len(points))
    message.fields = [point_field(name, 4 * index, FLOAT32, 1) for index, name in enumerate("xyz")]
    message.is_bigendian, message.is_dense = False, False
    message.point_step, message.row_step = 12, 12 * message.width
    message.data = points.tobytes()
    return message


# ---- laser and rangers ---------------------------------------------------------------------------------


def scan_of(message):
    """Angles (n,) [rad] and ranges (n,) [m] of a ``sensor_msgs/LaserScan``, with its limits (low, high).

    Readings outside the limits are NaN, +Inf and -Inf stay (REP 117). Raises ConversionError.
    """
    ranges = np.asarray(message.ranges, dtype=float)
    low, high = float(message.range_min), float(message.range_max)
    with np.errstate(invalid="ignore"):
        angles = message.angle_min + np.arange(ranges.size) * message.angle_increment
    if not (np.isfinite(angles).all() and np.isfinite([low, high]).all() and low < high):
        raise ConversionError("laser scan: its angles and limits must be finite, range_min below range_max")
    with np.errstate(invalid="ignore"):
        outside = np.isfinite(ranges) & ((ranges < low) | (ranges > high))
    return angles, np.where(outside, np.nan, ranges), (low, high)


def range_of(message):
    """Reading [m] of a ``sensor_msgs/Range`` as REP 117 asks: beyond its limits +Inf or -Inf, else the number.

    An upper limit of 0 is one that nobody filled in, and no reason to take an obstacle for free space.
    """
    reading = float(message.range)
    if np.isnan(reading):
        return reading
    if reading > message.max_range > 0.0:
        return np.inf
    if reading < message.min_range:
        return -np.inf
    return reading


# ---- grids ---------------------------------------------------------------------------------------------


def grid_of(message):
    """``Grid`` of a ``nav_msgs/OccupancyGrid``. Raises ConversionError."""
    info = message.info
    cells = np.asarray(_int8(message.data))
    if info.width < 1 or info.height < 1 or cells.size != info.width * info.height:
        raise ConversionError("grid: %d cells do not fill %d x %d" % (cells.size, info.width, info.height))
    if not FINEST_GRID <= info.resolution <= COARSEST_GRID:
        raise ConversionError("grid: resolution %g m is not within %g to %g" % (
            info.resolution, FINEST_GRID, COARSEST_GRID))
    _check_costs("grid", cells)
    origin = pose_of(info.origin)
    if abs(origin[2]) > 1e-3:
        raise ConversionError("grid: an origin turned by %g rad is not supported" % origin[2])
    cells = cells.reshape(info.height, info.width)
    cells.setflags(write=False)
    return Grid(
        cells, float(info.resolution), (float(origin[0]), float(origin[1])),
        seconds(message.header.stamp),
    )


def _check_costs(name, cells):
    if cells.min() < -1 or cells.max() > 100:
        raise ConversionError("%s: a cell of %d is not within -1 to 100" % (
            name, cells.min() if cells.min() < -1 else cells.max()))


def updated_grid(grid, message):
    """``Grid`` with a ``map_msgs/OccupancyGridUpdate`` laid into a copy. Raises ConversionError."""
    patch = _int8(message.data)
    rows, columns = grid.cells.shape
    if message.width < 1 or message.height < 1 or patch.size != message.width * message.height:
        raise ConversionError("grid update: %d cells do not fill %d x %d" % (patch.size, message.width, message.height))
    if message.x < 0 or message.y < 0 or message.x + message.width > columns or message.y + message.height > rows:
        raise ConversionError(
            "grid update: %d x %d cells at (%d, %d) do not fit a grid of %d x %d"
            % (message.width, message.height, message.x, message.y, columns, rows)
        )
    _check_costs("grid update", patch)
    cells = grid.cells.copy()
    cells[message.y : message.y + message.height, message.x : message.x + message.width] = patch.reshape(
        message.height, message.width
    )
    cells.setflags(write=False)
    return grid._replace(cells=cells, stamp=seconds(message.header.stamp), surface=None)


def fill_grid(message, grid):
    """Set a ``nav_msgs/OccupancyGrid`` (its header is the caller's); the cells stay an array, for ``numpy_msg``."""
    message.info.height, message.info.width = grid.cells.shape
    message.info.resolution = grid.resolution
    fill_pose(message.info.origin, (grid.origin[0], grid.origin[1], 0.0))
    message.data = cells_data(grid.cells)
    return message


def fill_update(message, grid, before):
    """Set a ``map_msgs/OccupancyGridUpdate`` to the cells of ``grid`` that are not as in ``before``, of equal shape.

    It is a box around all of them, and one cell where nothing has changed: an update's stamp says that the grid lives.
    """
    rows, columns = np.nonzero(grid.cells != before.cells)
    low_row, high_row = (int(rows.min()), int(rows.max())) if rows.size else (0, 0)
    low_column, high_column = (int(columns.min()), int(columns.max())) if rows.size else (0, 0)
    message.y, message.height = low_row, high_row - low_row + 1
    message.x, message.width = low_column, high_column - low_column + 1
    message.data = cells_data(grid.cells[low_row : high_row + 1, low_column : high_column + 1])
    return message


def fill_surface(message, grid, point_field):
    """Set a ``sensor_msgs/PointCloud2`` to the ``surface`` of ``grid``, lethal cells only; the header is the caller's.

    ``point_field`` is the PointField class.
    """
    rows, columns = np.nonzero(grid.cells == LETHAL)
    boxes = grid.surface[rows, columns].astype(float)
    quarter = 0.25 * grid.resolution
    points = np.zeros(len(rows), SURFACE)
    for axis, at in enumerate((columns, rows)):
        low, high = boxes[:, 2 * axis], boxes[:, 2 * axis + 1] + 1.0
        points["xy"[axis]] = grid.origin[axis] + (4.0 * at + 0.5 * (low + high)) * quarter
        points[("half_x", "half_y")[axis]] = 0.5 * (high - low) * quarter
    points["cell"] = rows * grid.cells.shape[1] + columns
    message.height, message.width = 1, len(points)
    message.fields = [
        point_field(name, SURFACE.fields[name][1], UINT32 if name == "cell" else FLOAT32, 1) for name in SURFACE.names
    ]
    message.is_bigendian, message.is_dense = False, True
    message.point_step, message.row_step = SURFACE.itemsize, SURFACE.itemsize * len(points)
    message.data = points.tobytes()
    return message


def surface_of(message, grid):
    """``surface`` (rows, columns, 4) int8 for ``grid`` of such a message: outward to whole quarters of a cell.

    Where a cell has no box, or one that does not belong to it, it is whole. Raises ConversionError.
    """
    fields = {field.name: (field.offset, field.datatype) for field in message.fields}
    expected = {name: (SURFACE.fields[name][1], UINT32 if name == "cell" else FLOAT32) for name in SURFACE.names}
    if fields != expected or message.is_bigendian or message.point_step != SURFACE.itemsize:
        raise ConversionError("surface: fields must be %s, little-endian" % ", ".join(SURFACE.names))
    if len(message.data) != message.point_step * message.width * message.height:
        count = message.width * message.height
        raise ConversionError("surface: %d bytes do not hold %d boxes" % (len(message.data), count))
    points = np.frombuffer(message.data, SURFACE)
    rows, columns = grid.cells.shape
    surface = np.empty((rows, columns, 4), np.int8)
    surface[:] = (0, 3, 0, 3)
    points = points[points["cell"] < rows * columns]
    row, column = np.divmod(points["cell"].astype(int), columns)
    boxes = np.empty((len(points), 4))
    quarter = 0.25 * grid.resolution
    for axis, at in enumerate((column, row)):
        half = points[("half_x", "half_y")[axis]].astype(float)
        middle = points["xy"[axis]].astype(float) - grid.origin[axis] - grid.resolution * at
        # a thousandth of a cell is rounding
        boxes[:, 2 * axis] = np.floor((middle - half) / quarter + 0.004)
        boxes[:, 2 * axis + 1] = np.ceil((middle + half) / quarter - 0.004) - 1.0
    low, high = boxes[:, 0::2], boxes[:, 1::2]
    # false for what is not finite
    own = ((low >= BOX_LOW) & (high <= BOX_HIGH) & (low <= high)).all(axis=1)
    surface[row[own], column[own]] = boxes[own].astype(np.int8)
    surface.setflags(write=False)
    return surface


class _Writable(np.ndarray):
    """An array that genpy can write: it calls ``tostring``, which NumPy dropped in 2.3."""

    def tostring(self):
        return self.tobytes()


def cells_data(cells):
    """Cells (rows, columns) as the ``data`` of a grid's ``numpy_msg``."""
    return np.ascontiguousarray(cells, dtype=np.int8).reshape(-1).view(_Writable)


def _int8(data):
    """Cells as int8, whether they came as a tuple, an array or bytes."""
    if isinstance(data, (bytes, bytearray)):
        return np.frombuffer(data, dtype=np.int8)
    return np.asarray(data, dtype=np.int8)


# ---- doorways ------------------------------------------------------------------------------------------


def doorway_of(message):
    """``Doorway`` of a ``Doorway`` message. Raises ConversionError."""
    covariance = np.asarray(message.pose.covariance, dtype=float).reshape(6, 6)
    planar = covariance[np.ix_((0, 1, 5), (0, 1, 5))]
    jambs = np.array([(point.x, point.y) for point in message.jambs])
    return Doorway(
        pose_of(message.pose.pose), float(message.width), float(message.confidence), jambs, planar,
        seconds(message.header.stamp),
    )


def fill_doorway(message, doorway):
    """Set a ``Doorway`` message (its header is the caller's)."""
    fill_pose(message.pose.pose, doorway.pose)
    covariance = np.zeros((6, 6))
    covariance[np.ix_((0, 1, 5), (0, 1, 5))] = doorway.covariance
    message.pose.covariance = covariance.reshape(-1).tolist()
    message.width, message.confidence = float(doorway.width), float(doorway.confidence)
    for point, jamb in zip(message.jambs, doorway.jambs):
        point.x, point.y, point.z = float(jamb[0]), float(jamb[1]), 0.0
    return message
