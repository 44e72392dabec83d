"""The measures of an episode, on logs whose answers can be computed by hand."""
import numpy as np
import pytest

from wheelchair_shared_control.assistance import ARRIVED, ASSISTING, FAULT
from wheelchair_shared_control.experiments import metrics, statistics
from wheelchair_shared_control.experiments.referee import Referee
from wheelchair_shared_control.footprint import Footprint

CHAIR = Footprint(1.05, 0.65, 0.35)  # front 0.70 m ahead of the axle, rear 0.35 m behind


def log(n=1, **columns):
    """A log of ``n`` ticks that drives straight at the door's axis, with some columns given."""
    shapes = {
        "time": (), "truth": (3,), "velocity": (2,), "user": (2,), "planner": (2,), "blended": (2,), "sent": (2,),
        "features": (4,), "sigma": (2,), "beta": (), "guard": (), "stopped": (), "assisted": (), "clearance": (),
    }
    values = {name: np.zeros((n,) + shape) for name, shape in shapes.items()}
    values["assisted"] = np.ones(n, bool)
    values["stopped"] = np.zeros(n, bool)
    values.update({name: np.asarray(value) for name, value in columns.items()})
    return metrics.Log(**values)


def test_phases_begin_and_end_with_the_footprint():
    # front at x + 0.70, rear at x - 0.35: the doorway begins at x = -1.0 and ends at x = 0.35
    x = np.array([-2.0, -1.01, -0.99, 0.0, 0.34, 0.36, 1.0])
    truth = np.column_stack((x, np.zeros((7, 2))))
    assert list(metrics.phases(log(7, truth=truth), CHAIR)) == [0, 0, 1, 1, 1, 2, 2]


def test_a_phase_once_left_does_not_come_back():
    truth = np.array([[-0.9, 0, 0], [-1.2, 0, 0]])
    assert list(metrics.phases(log(2, truth=truth), CHAIR)) == [1, 1]


def test_a_chair_across_the_door_reaches_as_far_as_its_side():
    rear, front = metrics.along_door(None, CHAIR, [0.0, 0.0, np.pi / 2])
    assert (rear, front) == (pytest.approx(-0.325), pytest.approx(0.325))


@pytest.mark.parametrize(
    "blended, share", [(1.0, 1.0), (0.0, 0.0), (0.25, 0.25), (1.4, 1.0), (-0.2, 0.0)]
)
def test_share_is_how_far_the_turn_moved_to_the_user(blended, share):
    ticks = log(1, user=[[0.3, 1.0]], planner=[[0.3, 0.0]], blended=[[0.3, blended]])
    assert metrics.user_share_of_ticks(ticks) == pytest.approx([share])


def test_share_is_undefined_in_agreement_at_rest_or_without_assistance_and_zero_when_stopped():
    ticks = log(
        4, user=[[0.3, 0.04], [0.01, 0.01], [0.3, 1.0], [0.3, 1.0]], planner=[[0.3, 0.0]] * 4,
        blended=[[0.3, 0.02]] * 4, assisted=[True, True, False, True], stopped=[False, False, False, True],
    )
    assert np.isnan(metrics.user_share_of_ticks(ticks)[:3]).all()
    assert metrics.user_share_of_ticks(ticks)[3] == 0.0


def test_shares_are_means_by_phase_and_none_where_no_tick_counts():
    truth = np.array([[-2.0, 0, 0], [-2.0, 0, 0], [0.0, 0, 0]])
    ticks = log(
        3, truth=truth, user=[[0.3, 1.0]] * 3, planner=[[0.3, 0.0]] * 3, blended=[[0.3, 1.0], [0.3, 0.5], [0.3, 0.0]]
    )
    assert metrics.shares(ticks, CHAIR) == {"all": 0.5, "approach": 0.75, "doorway": 0.0, "exit": None}


def test_escape_of_a_turn_is_the_outermost_corner():
    # the front corner lies hypot(0.70, 0.325) from the axle: a turn of 0.01 rad moves it 0.0077 m
    poses = [[0, 0, 0], [0, 0, 0.01]]
    assert metrics.corner_path(CHAIR, poses) == pytest.approx(0.01 * np.hypot(0.70, 0.325), rel=1e-4)


def test_wilson_interval_of_8_in_10():
    # Wilson (1927): (0.8 + z2/20 -+ z sqrt(0.016 + z2/400)) / (1 + z2/10), z2 = 3.8415
    rate = statistics.wilson(8, 10)
    assert (rate.low, rate.high) == (pytest.approx(0.4902, abs=1e-4), pytest.approx(0.9433, abs=1e-4))
    assert statistics.wilson(10, 10).high == 1.0 and np.isnan(statistics.wilson(0, 0).value)


def test_paired_difference_of_a_constant_shift_has_no_spread():
    values = np.linspace(0.0, 1.0, 30)
    found = statistics.paired_difference(values + 0.1, values, range(len(values)), np.random.default_rng(1))
    assert found == pytest.approx([0.1] * 3)


class TestReferee:
    """Door at (2, 0), crossed along +x."""

    def referee(self, needs_planner=True):
        return Referee([2.0, 0.0, 0.0], CHAIR, needs_planner)

    def test_rear_past_the_door_is_a_crossing(self):
        # the rear is 0.35 m behind base_link: 0.6 m past the plane means x = 2.95
        referee = self.referee()
        assert referee.update(0.0, [2.94, 0, 0], [], ASSISTING, "") is None
        assert referee.update(0.1, [2.96, 0, 0], [], ASSISTING, "").outcome == "crossed"

    def test_a_touch_beats_arrival(self):
        assert self.referee().update(0.0, [3.5, 0, 0], ["wall"], ARRIVED, "").outcome == "contact"

    def test_fault_ends_a_policy_that_needs_the_planner_only(self):
        assert self.referee().update(0.0, [0, 0, 0], [], FAULT, "no path").reason == "no path"
        assert self.referee(needs_planner=False).update(0.0, [0, 0, 0], [], FAULT, "no path") is None

    def test_eight_seconds_without_motion(self):
        referee = self.referee()
        assert referee.update(0.0, [0, 0, 0], [], ASSISTING, "") is None
        assert referee.update(4.0, [0.1, 0, 0], [], ASSISTING, "") is None
        assert referee.update(11.9, [0.1, 0, 0], [], ASSISTING, "") is None
        assert referee.update(12.0, [0.1, 0, 0], [], ASSISTING, "").outcome == "standstill"

    def test_sixty_seconds_are_the_end(self):
        referee = self.referee()
        verdicts = [referee.update(t, [0.01 * t, 0, 0], [], ASSISTING, "") for t in np.arange(0.0, 61.0, 1.0)]
        assert verdicts[59] is None and verdicts[60].outcome == "timeout"


def test_episodes_of_one_seed_are_drawn_together():
    """Ten seeds of twenty equal episodes tell as much as ten episodes, not as two hundred."""
    rng = np.random.default_rng(3)
    of_seeds = rng.normal(0.0, 1.0, 10)
    values, seeds = np.repeat(of_seeds, 20), np.repeat(np.arange(10), 20)
    value, low, high = statistics.mean_interval(values, seeds)
    alone = statistics.mean_interval(of_seeds, np.arange(10))
    assert (value, low, high) == pytest.approx(alone)
    _, near, far = statistics.mean_interval(values, np.arange(200))
    assert far - near < 0.4 * (high - low)
    # one seed alone: its episodes
    assert statistics.mean_interval([0.0, 1.0, None, np.nan], [7, 7, 7, 7])[0] == 0.5
    assert np.isnan(statistics.mean_interval([None], [1])[0])
