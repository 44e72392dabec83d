"""What rviz shows of a tick: Fig. 4's triangle about the user's arrow, the share bar, the guard."""
import math

import numpy as np
import pytest

from wheelchair_shared_control import footprint, markers
from wheelchair_shared_control.guard import FREE, STOPPED
from wheelchair_shared_control.shared_control import State
from wheelchair_shared_control.values import Twist

CHAIR = footprint.Footprint(1.05, 0.65, 0.35)


def state(**changes):
    values = {name: math.nan for name in State._fields}
    values.update(
        user=Twist(0.4, 0.2), planner=Twist(0.4, -0.2), blended=Twist(0.4, 0.0), sent=Twist(0.4, 0.0), sigma=0.3,
        beta=0.25, guard=FREE, reason="", guard_point=None,
    )
    values.update(changes)
    return State(**values)


def shapes(**changes):
    return {shape.name: shape for shape in markers.shapes(state(**changes), CHAIR)}


def bearings(points):
    """Angles [rad] at which points are seen from the first one."""
    points = np.asarray(points)[:, :2]
    return np.arctan2(*(points[1:] - points[0]).T[::-1])


@pytest.mark.parametrize("sigma", [0.1, 0.3, 0.9])
def test_the_triangle_is_centred_on_the_users_arrow_and_as_wide_as_sigma(sigma):
    seen = shapes(sigma=sigma)
    right, left = bearings(seen["sigma"].points)
    (user,) = bearings(seen["user"].points)
    assert 0.5 * (left + right) == pytest.approx(user)
    assert left - right == pytest.approx(sigma * markers.HORIZON)


def test_the_share_bar_is_as_long_as_the_weights():
    seen = shapes(beta=0.25)
    assert seen["share_user"].scale[1] == pytest.approx(0.25 * markers.BAR)
    assert seen["share_planner"].scale[1] == pytest.approx(0.75 * markers.BAR)
    assert seen["share_text"].text == "user 25 %"


def test_what_is_absent_is_taken_away():
    seen = shapes(user=None, planner=Twist(math.nan, math.nan), blended=None, beta=None, sigma=math.nan)
    assert not any(seen[name].points for name in ("user", "planner", "blended", "sigma", "share_user", "guard"))


def test_the_guard_says_why_and_where():
    seen = shapes(guard=STOPPED, reason="stopped: obstacle 0.04 m ahead", guard_point=np.array([1.0, 2.0]))
    assert seen["guard"].odom and seen["guard"].points[0][:2] == (1.0, 2.0)
    assert seen["guard_text"].text == "stopped: obstacle 0.04 m ahead"
