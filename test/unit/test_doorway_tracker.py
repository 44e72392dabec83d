"""The tracker: frames fused in odom, and what is forgotten."""
import numpy as np
import pytest

from wheelchair_shared_control import parameters
from wheelchair_shared_control.doorway_tracker import DoorwayTracker, in_frame
from wheelchair_shared_control.values import Doorway

SETTINGS = parameters.load("doorway_detector")
SIGMA = np.diag([0.02, 0.02, 0.02]) ** 2
HERE = np.zeros(3)


def door(x, y, yaw=0.0, width=0.9, confidence=0.8):
    jambs = np.array([[x, y + width / 2.0], [x, y - width / 2.0]])
    return Doorway(np.array([x, y, yaw]), width, confidence, jambs, SIGMA)


def test_a_doorway_is_told_from_its_second_frame_on():
    tracker = DoorwayTracker(SETTINGS)
    assert tracker.update([door(2.0, 0.0)], HERE, 0.0) == ()
    assert len(tracker.update([door(2.0, 0.0)], HERE, 0.1)) == 1


def test_equal_weights_give_the_mean_and_half_the_variance():
    tracker = DoorwayTracker(SETTINGS)
    tracker.update([door(2.00, 0.0)], HERE, 0.0)
    (told,) = tracker.update([door(2.02, 0.0)], HERE, 0.1)
    assert told.pose[0] == pytest.approx(2.01)
    assert told.covariance[0, 0] == pytest.approx(0.02**2 / 2.0)


def test_a_frame_that_contradicts_the_others_moves_little():
    straight, askew = door(2.0, 0.0), door(2.05, 0.0, yaw=np.radians(12.0))
    tracker = DoorwayTracker(SETTINGS)
    for k, seen in enumerate((straight, straight, askew, straight, straight)):
        (told,) = tracker.update([seen], HERE, 0.1 * k) or (None,)
    assert abs(np.degrees(told.pose[2])) < 0.6 and abs(told.pose[0] - 2.0) < 0.003  # the mean: 2.4 degrees, 1 cm
    # a door that stands elsewhere indeed is believed in the end
    for k in range(40):
        (told,) = tracker.update([askew], HERE, 1.0 + 0.1 * k)
    assert np.degrees(told.pose[2]) > 10.0


def test_no_number_of_frames_takes_away_the_error_that_all_share():
    tracker = DoorwayTracker(SETTINGS)
    for k in range(50):
        told = tracker.update([door(2.0, 0.0)], HERE, 0.1 * k)
    assert np.sqrt(told[0].covariance[0, 0]) == pytest.approx(SETTINGS.tracker.floor)


def test_the_other_side_of_a_doorway_is_the_same_doorway_and_its_yaw_points_away_from_the_chair():
    tracker = DoorwayTracker(SETTINGS)
    for stamp in (0.0, 0.1):
        tracker.update([door(2.0, 0.0)], HERE, stamp)
    beyond = np.array([4.0, 0.0, np.pi])
    (told,) = tracker.update([door(2.0, 0.0, yaw=np.pi)], beyond, 5.0)
    assert abs(told.pose[2]) == pytest.approx(np.pi)
    # seen along -x, left is at smaller y
    assert told.jambs[0] == pytest.approx((2.0, -0.45))


def test_two_doorways_stay_two_the_nearest_first():
    tracker = DoorwayTracker(SETTINGS)
    for stamp in (0.0, 0.1):
        told = tracker.update([door(3.0, -1.0), door(2.0, 0.5)], HERE, stamp)
    assert [d.pose[0] for d in told] == pytest.approx([2.0, 3.0])


def test_a_latched_doorway_that_ought_to_be_seen_and_is_not_is_dropped():
    tracker = DoorwayTracker(SETTINGS)
    for stamp in np.arange(SETTINGS.tracker.latch) * 0.1:
        tracker.update([door(2.5, 0.0)], HERE, stamp)
    for k in range(SETTINGS.tracker.max_unseen):
        assert len(tracker.update([], HERE, 0.3 + 0.1 * k)) == 1
    assert tracker.update([], HERE, 5.0) == ()


def test_what_looks_like_a_doorway_in_two_frames_of_five_is_not_told():
    # 2 of 5 is less than tracker/min_share = 0.6; two frames alone are enough
    tracker = DoorwayTracker(SETTINGS)
    told = [len(tracker.update([door(2.5, 0.0)] if k < 2 else [], HERE, 0.1 * k)) for k in range(5)]
    assert told[:2] == [0, 1]
    assert told[4] == 0


def test_of_two_readings_of_one_place_the_more_frequent_one_is_told():
    tracker = DoorwayTracker(SETTINGS)
    for k in range(5):
        turned = [door(2.5, 0.1, yaw=0.6)] if k % 2 == 0 else []
        told = tracker.update([door(2.5, 0.0)] + turned, HERE, 0.1 * k)
    assert [round(float(doorway.pose[2]), 1) for doorway in told] == [0.0]


def test_a_doorway_out_of_view_is_kept_until_the_memory_ends():
    tracker = DoorwayTracker(SETTINGS)
    for stamp in (0.0, 0.1):
        tracker.update([door(2.5, 0.0)], HERE, stamp)
    turned_away = np.array([0.0, 0.0, np.pi / 2.0])
    assert len(tracker.update([], turned_away, 0.1 + SETTINGS.tracker.memory - 0.1)) == 1
    assert tracker.update([], turned_away, 0.1 + SETTINGS.tracker.memory + 0.1) == ()


def test_a_doorway_in_another_frame_takes_its_covariance_along():
    narrow = door(2.0, 0.0)._replace(covariance=np.diag([0.01, 0.04, 0.001]))
    moved = in_frame(np.array([1.0, 1.0, np.pi / 2.0]), narrow)
    assert moved.pose == pytest.approx((1.0, 3.0, np.pi / 2.0))
    assert np.diag(moved.covariance) == pytest.approx((0.04, 0.01, 0.001))
