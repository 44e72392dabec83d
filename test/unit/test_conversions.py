"""Messages as drivers send them: padded rows, either byte order, both depth encodings; and malformed ones."""
from types import SimpleNamespace as Message

import numpy as np
import pytest

from wheelchair_shared_control import conversions
from wheelchair_shared_control.conversions import ConversionError
from wheelchair_shared_control.grid import Grid


def image(pixels, encoding, order="<", padding=0):
    """A depth image whose rows carry ``padding`` bytes that mean nothing."""
    pixels = np.asarray(pixels)
    kind = order + {"32FC1": "f4", "16UC1": "u2"}[encoding]
    rows = [row.astype(kind).tobytes() + b"\xa5" * padding for row in pixels]
    return Message(width=pixels.shape[1], height=pixels.shape[0], encoding=encoding, is_bigendian=order == ">",
                   step=len(rows[0]), data=b"".join(rows))


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("padding", [0, 3])
def test_depth_of_both_encodings(order, padding):
    metres = np.array([[0.5, np.nan, 4.0], [np.inf, -np.inf, 1.25]])
    read = conversions.depth_of(image(metres, "32FC1", order, padding))
    assert read.dtype == np.float32 and read.dtype.isnative
    np.testing.assert_array_equal(read, metres)
    read = conversions.depth_of(image([[500, 0, 65535]], "16UC1", order, padding))
    np.testing.assert_allclose(read, [[0.5, np.nan, 65.535]], rtol=1e-6)


@pytest.mark.parametrize("changes, says", [
    (dict(encoding="mono8"), "'mono8' must be 32FC1 or 16UC1"),
    (dict(step=11), "48 bytes do not hold 3 x 4"),
    (dict(step=8), "do not hold"),
    (dict(data=b"\0" * 47), "47 bytes"),
    (dict(height=0, data=b""), "0 bytes"),
    (dict(width=0), "0 x 4"),
])
def test_malformed_depth_is_refused(changes, says):
    message = image(np.ones((4, 3)), "32FC1")
    message.__dict__.update(changes)
    with pytest.raises(ConversionError, match=says):
        conversions.depth_of(message)


def cloud(points, order="<", offsets=(4, 8, 16), point_step=21, padding=0, **changes):
    """A cloud with other fields between x, y and z."""
    data = bytearray()
    for row in points:
        for point in row:
            one = bytearray(b"\x7f" * point_step)
            for offset, value in zip(offsets, point):
                one[offset:offset + 4] = np.array(value, order + "f4").tobytes()
            data += one
        data += b"\x7f" * padding
    message = Message(
        fields=[Message(name=n, offset=o, datatype=7, count=1) for n, o in zip("xyz", offsets)],
        height=len(points), width=len(points[0]), point_step=point_step,
        row_step=point_step * len(points[0]) + padding, is_bigendian=order == ">", data=bytes(data))
    message.__dict__.update(changes)
    return message


POINTS = [[(1.0, -2.0, 3.0), (np.nan, 0.5, 0.25)], [(4.0, 5.0, 6.0), (7.0, 8.0, np.inf)]]


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("padding", [0, 5])
def test_points_of_a_cloud_with_gaps(order, padding):
    read = conversions.points_of(cloud(POINTS, order, padding=padding))
    np.testing.assert_array_equal(read, np.array(POINTS, np.float32).reshape(-1, 3))


def test_an_empty_cloud_has_no_points():
    assert conversions.points_of(cloud([[]], data=b"", row_step=0)).shape == (0, 3)


@pytest.mark.parametrize("changes, says", [
    (dict(point_step=0, row_step=42), "points of 0 bytes"),
    (dict(point_step=12, row_step=42), "do not hold"),
    (dict(row_step=20), "do not hold"),
    (dict(data=b"\0" * 83), "83 bytes"),
    (dict(fields=[Message(name="x", offset=0, datatype=7, count=1)]), "field 'y' is missing"),
    (dict(fields=[Message(name=n, offset=0, datatype=9, count=1) for n in "xyz"]), "unknown type 9"),
])
def test_malformed_clouds_are_refused(changes, says):
    with pytest.raises(ConversionError, match=says):
        conversions.points_of(cloud(POINTS, **changes))


def scan(ranges, **changes):
    message = Message(ranges=ranges, range_min=0.1, range_max=5.0, angle_min=-1.0, angle_increment=0.5)
    message.__dict__.update(changes)
    return message


def test_a_scan_beyond_its_limits_says_nothing_but_infinities_stay():
    angles, ranges, limits = conversions.scan_of(scan([0.05, 1.0, 6.0, np.inf, -np.inf, np.nan]))
    np.testing.assert_allclose(angles, [-1.0, -0.5, 0.0, 0.5, 1.0, 1.5])
    np.testing.assert_array_equal(ranges, [np.nan, 1.0, np.nan, np.inf, -np.inf, np.nan])
    assert limits == (0.1, 5.0)


@pytest.mark.parametrize("changes", [dict(range_max=np.nan), dict(range_max=0.1), dict(angle_increment=np.inf)])
def test_a_scan_without_angles_or_limits_is_refused(changes):
    with pytest.raises(ConversionError, match="laser scan"):
        conversions.scan_of(scan([1.0, 1.0], **changes))


@pytest.mark.parametrize("reading, value", [(1.0, 1.0), (1.6, np.inf), (0.05, -np.inf), (np.inf, np.inf),
                                            (-np.inf, -np.inf)])
def test_a_range_beyond_its_limits_is_infinite(reading, value):
    assert conversions.range_of(Message(range=reading, min_range=0.1, max_range=1.5)) == value
    assert np.isnan(conversions.range_of(Message(range=np.nan, min_range=0.1, max_range=1.5)))


def pose(x=0.0, quaternion=(0.0, 0.0, 0.0, 1.0)):
    return Message(position=Message(x=x, y=2.0, z=0.0), orientation=Message(**dict(zip("xyzw", quaternion))))


def test_a_goal_may_have_a_quaternion_of_any_length():
    half = np.sqrt(0.5)
    np.testing.assert_allclose(conversions.goal_pose_of(pose(1.0, (0.0, 0.0, 3.0 * half, 3.0 * half))),
                               [1.0, 2.0, np.pi / 2])


@pytest.mark.parametrize("given, says", [
    (pose(quaternion=(0.0, 0.0, 0.0, 0.0)), "invalid quaternion"),
    (pose(quaternion=(0.0, 0.0, np.nan, 1.0)), "invalid quaternion"),
    (pose(quaternion=(0.5, 0.0, 0.0, 0.8)), "tilted"),
    (pose(x=np.inf), "invalid position"),
])
def test_other_goals_are_refused(given, says):
    with pytest.raises(ConversionError, match=says):
        conversions.goal_pose_of(given)


def update(x, y, cells, stamp=7):
    cells = np.array(cells, np.int8)
    return Message(x=x, y=y, width=cells.shape[1], height=cells.shape[0], data=cells.reshape(-1),
                   header=Message(stamp=Message(secs=stamp, nsecs=0)))


GRID = Grid(np.zeros((3, 4), np.int8), 0.05, (0.0, 0.0), 1.0)


def test_an_update_is_laid_into_a_copy():
    new = conversions.updated_grid(GRID, update(2, 1, [[100, -1], [99, 5]]))
    assert new.stamp == 7.0 and not GRID.cells.any()
    np.testing.assert_array_equal(new.cells, [[0, 0, 0, 0], [0, 0, 100, -1], [0, 0, 99, 5]])


@pytest.mark.parametrize("changes, box", [
    ({(1, 2): 100, (2, 1): -1}, (1, 1, 2, 2)), ({(2, 3): 7}, (3, 2, 1, 1)), ({}, (0, 0, 1, 1)),
])
def test_an_update_holds_what_has_changed_and_no_more(changes, box):
    cells = GRID.cells.copy()
    for place, value in changes.items():
        cells[place] = value
    message = conversions.fill_update(update(9, 9, [[0]]), GRID._replace(cells=cells), GRID)
    assert (message.x, message.y, message.width, message.height) == box
    np.testing.assert_array_equal(conversions.updated_grid(GRID, message).cells, cells)


@pytest.mark.parametrize("patch, says", [
    (update(3, 0, [[1, 1]]), "do not fit"),
    (update(0, -1, [[1]]), "do not fit"),
    (update(0, 0, np.zeros((0, 0))), "do not fill"),
    (update(0, 0, [[0, 101]]), "a cell of 101 is not within -1 to 100"),
    (update(0, 0, [[-2, 0]]), "a cell of -2 "),
])
def test_an_update_beside_the_grid_is_refused(patch, says):
    with pytest.raises(ConversionError, match=says):
        conversions.updated_grid(GRID, patch)


@pytest.mark.parametrize("cell, resolution, says", [
    (0, 0.05, None), (100, 0.025, None), (-2, 0.05, "a cell of -2"), (127, 0.05, "a cell of 127"),
    (0, 0.001, "resolution"), (0, np.nan, "resolution"), (0, 1.0, "resolution"),
])
def test_a_grid_that_would_be_misread_is_refused(cell, resolution, says):
    info = Message(width=2, height=2, resolution=resolution, origin=pose())
    header = Message(stamp=Message(secs=7, nsecs=0))
    message = Message(info=info, data=np.array([0, 0, 0, cell], np.int8), header=header)
    if says is None:
        assert conversions.grid_of(message).cells[1, 1] == cell
        return
    with pytest.raises(ConversionError, match=says):
        conversions.grid_of(message)
