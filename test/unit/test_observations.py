"""Sensor messages into the costmap: where a message's readings end up in odom, and what is refused."""
import math
from types import SimpleNamespace as Message

import numpy as np
import pytest

from wheelchair_shared_control import observations
from wheelchair_shared_control.conversions import ConversionError
from wheelchair_shared_control.values import RANGERS


class Costmap:
    """Keeps what it is given."""

    def __getattr__(self, name):
        def keep(*values, source):
            self.__dict__.setdefault("calls", []).append((name, values, source))
        return keep

    def only(self, name):
        (call, values, source), = self.calls
        assert (call, source) == (name, "mine")
        return values


def pose_of(x, y, z, yaw=0.0, roll=0.0):
    c, s, cr, sr = math.cos(yaw), math.sin(yaw), math.cos(roll), math.sin(roll)
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    matrix[:3, 3] = x, y, z
    return matrix


def scan(ranges):
    return Message(ranges=ranges, range_min=0.1, range_max=5.0, angle_min=0.0, angle_increment=0.5)


def cloud(points):
    points = np.asarray(points, "<f4")
    fields = [Message(name=name, offset=4 * index, datatype=7) for index, name in enumerate("xyz")]
    return Message(fields=fields, is_bigendian=False, point_step=12, row_step=12 * len(points), width=len(points),
                   height=1, data=points.tobytes())


def test_a_cloud_is_brought_into_odom_without_what_is_not_finite():
    costmap = Costmap()
    observations.insert_cloud(costmap, cloud([[1, 0, 0], [np.nan, 0, 0], [0, 2, 0.5]]), pose_of(3, 1, 0.2, math.pi / 2),
                              7.0, "mine")
    points, sensor, stamp = costmap.only("insert_points")
    np.testing.assert_allclose(points, [[3, 2, 0.2], [1, 1, 0.7]], atol=1e-6)
    np.testing.assert_allclose(sensor, [3, 1, 0.2])
    assert stamp == 7.0


@pytest.mark.parametrize("roll, turns", [(0.0, 1.0), (math.pi, -1.0), (math.radians(4.0), 1.0)])
def test_a_scanner_with_its_head_down_turns_the_other_way(roll, turns):
    costmap = Costmap()
    observations.insert_scan(costmap, scan([1.0, 2.0]), pose_of(1, 2, 0.3, 0.4, roll), 7.0, "mine")
    ranges, angles, high, pose, height, stamp = costmap.only("insert_scan")
    np.testing.assert_array_equal(ranges, [1.0, 2.0])
    np.testing.assert_allclose(angles, [0.0, turns * 0.5])
    np.testing.assert_allclose(pose, [1, 2, 0.4])
    assert (high, height, stamp) == (5.0, 0.3, 7.0)


@pytest.mark.parametrize("roll", [math.radians(6.0), math.radians(90.0), math.radians(173.0)])
def test_a_tilted_scanner_is_refused(roll):
    costmap = Costmap()
    with pytest.raises(ConversionError, match="tilted by .* degrees, limit 5"):
        observations.insert_scan(costmap, scan([1.0]), pose_of(0, 0, 0.3, 0.0, roll), 7.0, "mine")
    assert "calls" not in vars(costmap)


@pytest.mark.parametrize("said", [True, False])
def test_whether_a_scan_said_anything_is_handed_on(said):
    class Answers:
        def insert_scan(self, *_, source):
            return said

    assert observations.insert_scan(Answers(), scan([1.0]), pose_of(0, 0, 0.3), 7.0, "mine") is said


def test_rangers_that_did_not_speak_say_nothing():
    costmap = Costmap()
    messages = {
        index: Message(range=reading, min_range=0.1, max_range=1.5) for index, reading in ((4, 0.5), (0, 9.0))
    }
    observations.insert_ranges(costmap, messages, np.array([1.0, 2.0, 0.5]), 7.0, "mine")
    ranges, pose = costmap.only("insert_ranges")
    assert ranges.stamp == 7.0 and len(ranges.values) == len(RANGERS)
    np.testing.assert_array_equal(ranges.values, [np.inf, np.nan, np.nan, np.nan, 0.5, np.nan])
    np.testing.assert_array_equal(pose, [1.0, 2.0, 0.5])


def test_an_image_before_its_camera_info_is_refused():
    with pytest.raises(ConversionError, match="camera_info"):
        observations.insert_image(Costmap(), Message(), None, np.eye(4), 7.0, "mine")
