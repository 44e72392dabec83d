"""Clearance of the polygon in a distance field, and refinement, against numbers that a reader can compute."""
import numpy as np
import pytest
from navigation_scenes import CHAIR, SETTINGS, door, line, snapshot

from wheelchair_shared_control.planning import clearance
from wheelchair_shared_control.planning.following import kinds_of, predict
from wheelchair_shared_control.planning.planner import Planner, resampled, rolled, rounded

BODY = clearance.make_body(CHAIR)


def of(points, pose):
    field = clearance.make_field(snapshot(points, (0.0, 0.0, 0.0), 0.0))
    return float(clearance.of_poses(field, BODY, np.array([pose], dtype=float))[0])


# wall, pose, clearance: the front edge is 0.70 m ahead of the axle, the side edges are 0.325 m beside it
CASES = [
    ("wall ahead", line(1.0, -2.0, 1.0, 2.0), (0.0, 0.0, 0.0), 0.30),
    ("wall on the left", line(-2.0, 0.5, 2.0, 0.5), (0.0, 0.0, 0.0), 0.175),
    ("wall behind", line(-0.6, -2.0, -0.6, 2.0), (0.0, 0.0, 0.0), 0.25),
    ("turned by 90 degrees, the wall beside is ahead", line(-2.0, 1.0, 2.0, 1.0), (0.0, 0.0, np.pi / 2), 0.30),
    ("far away: the cap", line(2.5, -2.0, 2.5, 2.0), (0.0, 0.0, 0.0), 0.50),
]


@pytest.mark.parametrize("title, points, pose, expected", CASES, ids=[row[0] for row in CASES])
def test_clearance(title, points, pose, expected):
    # to within half a cell's diagonal and the sampling of the outline
    assert of(points, pose) == pytest.approx(expected, abs=0.02)


def test_what_stands_inside_the_footprint_is_negative():
    assert of(line(0.2, 0.0, 0.25, 0.0), (0.0, 0.0, 0.0)) < -0.2


def test_outside_the_window_is_far():
    field = clearance.make_field(snapshot(np.array([[0.0, 0.0]]), (0.0, 0.0, 0.0), 0.0))
    assert clearance.field_at(field.distance, field.frame, 50.0, 0.0) == clearance.FAR
    assert clearance.field_at(field.distance, field.frame, np.nan, 0.0) == clearance.FAR


def test_padding_keeps_what_was_there():
    field = clearance.make_field(snapshot(door(0.9), (0.0, 0.0, 0.0), 0.0))
    larger = clearance.padded(field, np.array([4.0, 0.0]), 1.0, 4.0)
    assert larger.distance.shape[1] > field.distance.shape[1]
    for x, y in ((0.0, 0.0), (0.3, 0.2), (-1.0, 1.0)):
        assert clearance.field_at(larger.distance, larger.frame, x, y) == pytest.approx(
            clearance.field_at(field.distance, field.frame, x, y))


def test_refinement_centres_a_path_that_scrapes_a_jamb():
    planner = Planner(SETTINGS.wheelchair, SETTINGS)
    field = clearance.make_field(snapshot(door(0.80), (-0.5, 0.0, 0.0), 0.0))
    # 0.80 m leaves 0.075 m a side; a path 5 cm off the middle leaves 0.025 m
    start = np.array([-1.6, 0.05, 0.0])
    steps = np.tile([0.08, 0.0], (32, 1))
    targets = rolled(start, steps)
    assert planner.clearance(field, targets).min() < 0.04
    path = planner.refine(field, start, steps, kinds_of(steps), targets, 25)
    assert path.clear.min() > 0.05
    assert np.allclose(path.poses[0], start)


def test_resampling_keeps_the_way():
    steps = np.array([[0.3, 0.2], [0.3, 0.0], [0.0, 0.5], [-0.2, 0.1]])
    fine, kinds = resampled(steps, kinds_of(steps))
    assert np.abs(fine[:, 0]).max() <= 0.0801
    assert np.allclose(np.sum(fine, axis=0), np.sum(steps, axis=0))
    # steps may be cut finer, but what is driven forward, turned and reversed comes in this order
    assert [kind for k, kind in enumerate(kinds) if not k or kind != kinds[k - 1]] == [1, 0, -1]


def test_small_turns_between_drives_are_rounded():
    steps = np.array([[0.1, 0.0], [0.1, 0.0], [0.0, 0.3], [0.1, 0.0], [0.1, 0.0]])
    round_steps, kinds = rounded(steps, kinds_of(steps))
    assert list(kinds) == [1, 1, 1, 1]
    assert np.sum(round_steps[:, 1]) == pytest.approx(0.3)


def test_prediction_follows_the_lag():
    # After one time constant the speed has covered 1 - 1/e of the step, within limits that do not bite here.
    state = predict(np.zeros(5), np.tile([0.1, 0.0], (30, 1)), 0.15, 5.0, 10.0, 0.005)
    assert state[3] == pytest.approx(0.1 * (1.0 - np.exp(-1.0)), rel=1e-6)
