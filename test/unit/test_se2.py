"""Poses in the plane: every expected number can be computed by hand."""
import numpy as np
import pytest

from wheelchair_shared_control import se2


def test_quarter_turn_then_one_metre_ahead():
    # at (1, 2) facing +y, one metre ahead is (1, 3)
    assert se2.compose([1.0, 2.0, np.pi / 2], [1.0, 0.0, 0.0]) == pytest.approx([1.0, 3.0, np.pi / 2])


def test_inverse_undoes_compose():
    rng = np.random.default_rng(7)
    poses = rng.uniform(-3.0, 3.0, (200, 3))
    assert se2.compose(poses, se2.inverse(poses)) == pytest.approx(np.zeros((200, 3)), abs=1e-12)


def test_points_follow_the_frame():
    points = se2.transform_points([1.0, 0.0, np.pi / 2], [[1.0, 0.0], [0.0, 1.0]])
    assert points == pytest.approx(np.array([[1.0, 1.0], [0.0, 0.0]]))


def test_half_a_circle_of_radius_half_a_metre():
    # v / w = 0.5 m; half a turn ends one metre to the left, facing back
    pose = se2.integrate([0.0, 0.0, 0.0], 0.5, 1.0, np.pi)
    assert pose[:2] == pytest.approx([0.0, 1.0])
    assert abs(pose[2]) == pytest.approx(np.pi)


def test_straight_line_is_the_limit_of_the_arc():
    assert se2.integrate([0.0, 0.0, 0.0], 0.5, 0.0, 2.0) == pytest.approx([1.0, 0.0, 0.0])
    assert se2.integrate([0.0, 0.0, 0.0], 0.5, 1e-9, 2.0) == pytest.approx([1.0, 0.0, 0.0], abs=1e-8)


@pytest.mark.parametrize("angle, expected", [(np.pi + 0.1, -np.pi + 0.1), (-7.0, -7.0 + 2 * np.pi), (0.5, 0.5)])
def test_angles_wrap(angle, expected):
    assert se2.wrap_angle(angle) == pytest.approx(expected)
