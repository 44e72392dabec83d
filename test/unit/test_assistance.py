"""The assistance's states: what the button, the stick, detector and planner make of them."""
import numpy as np
import pytest

from wheelchair_shared_control import parameters
from wheelchair_shared_control.assistance import (
    ARRIVED,
    ASSISTING,
    DETECTING,
    FAULT,
    MANUAL,
    Assistance,
    AssistanceInputs,
)
from wheelchair_shared_control.assistance_goal import choose, free_goal, stick_direction
from wheelchair_shared_control.footprint import from_settings
from wheelchair_shared_control.grid import Grid
from wheelchair_shared_control.values import STOP, Doorway, Odometry, Twist

TICK = 0.05


@pytest.fixture(scope="module")
def settings():
    return parameters.load("doorway_assistant")


def door(x=2.0, y=0.0, yaw=0.0, width=0.9, stamp=0.0, confidence=0.9):
    normal_left = np.array([-np.sin(yaw), np.cos(yaw)]) * width / 2.0
    middle = np.array([x, y])
    jambs = np.stack((middle + normal_left, middle - normal_left))
    return Doorway(np.array([x, y, yaw]), width, confidence, jambs, 1e-4 * np.eye(3), stamp)


class Chair:
    """A chair at a pose with an assistant; ``run`` lets time pass and keeps what was put out."""

    def __init__(self, settings, pose=(0.0, 0.0, 0.0)):
        self.assistance, self.now, self.pose = Assistance(settings), 10.0, np.array(pose, dtype=float)
        self.goals, self.cancels, self.asked = [], 0, []

    def step(self, **inputs):
        inputs.setdefault("odometry", Odometry(self.now, self.pose, STOP))
        out = self.assistance.update(self.now, AssistanceInputs(**inputs))
        if out.goal is not None:
            self.goals.append(out.goal)
        self.cancels += out.cancel_goal
        if out.detect:
            self.asked.append(self.now)
        self.now += TICK
        return out

    def run(self, seconds, **inputs):
        for _ in range(int(round(seconds / TICK))):
            out = self.step(**inputs)
        return out

    def assist(self, *doorways):
        self.step(press=True)
        out = self.step(doorways=tuple(d._replace(stamp=self.now) for d in doorways or (door(),)))
        assert out.state == ASSISTING
        return out


def grid_with(*points, size=8.0, resolution=0.05):
    """A free grid about the origin with lethal cells at ``points``."""
    cells = np.zeros((int(size / resolution),) * 2, dtype=np.int8)
    for x, y in points:
        cells[int((y + size / 2) / resolution), int((x + size / 2) / resolution)] = 100
    return Grid(cells, resolution, (-size / 2, -size / 2), 0.0)


# ---- the button ----------------------------------------------------------------------------------------


def test_nothing_happens_until_the_button_is_pressed(settings):
    chair = Chair(settings)
    out = chair.run(2.0, doorways=(door(stamp=11.0),), user=Twist(0.4, 0.0))
    assert (out.state, chair.goals, chair.asked, chair.cancels) == (MANUAL, [], [], 0)


def test_a_button_held_down_is_pressed_once(settings):
    chair = Chair(settings)
    assert chair.run(1.0, press=True).state == DETECTING
    chair.step()
    assert chair.step(press=True).state == MANUAL  # X again: cancelled


def test_the_detector_is_asked_at_once_and_every_half_second_for_five_seconds(settings):
    chair = Chair(settings)
    began = chair.now
    chair.step(press=True)
    out = chair.run(6.0, doorways=(), detector_reason="no opening in the wall")
    # 0, 0.5, ... 4.5 s: ten questions; at 5 s it is refused
    assert np.allclose(np.array(chair.asked) - began, 0.5 * np.arange(10), atol=TICK)
    assert (out.state, out.refused, out.reason) == (MANUAL, True, "refused: no opening in the wall")
    assert chair.goals == []


def test_the_goal_lies_one_metre_beyond_the_door_along_its_normal(settings):
    chair = Chair(settings)
    out = chair.assist(door(2.0, 0.5, np.pi / 6))
    assert chair.goals[0] == pytest.approx((2.0 + np.cos(np.pi / 6), 0.5 + np.sin(np.pi / 6), np.pi / 6))
    assert out.doorway.pose == pytest.approx((2.0, 0.5, np.pi / 6))


def test_a_normal_that_points_at_the_chair_is_turned(settings):
    chair = Chair(settings)
    chair.assist(door(2.0, 0.0, np.pi))
    assert chair.goals[0] == pytest.approx((3.0, 0.0, 0.0), abs=1e-9)


def test_a_doorway_seen_long_before_the_button_is_not_taken(settings):
    chair = Chair(settings)
    chair.step(press=True)
    assert chair.step(doorways=(door(stamp=chair.now - 2.0),)).state == DETECTING


def test_a_doorway_that_appears_after_two_seconds_is_taken(settings):
    chair = Chair(settings)
    chair.step(press=True)
    assert chair.run(2.0, doorways=()).state == DETECTING
    assert chair.step(doorways=(door(stamp=chair.now),)).state == ASSISTING


def test_a_doorway_from_the_future_is_not_taken_and_hides_no_later_look(settings):
    chair = Chair(settings)
    chair.step(press=True)
    out = chair.run(1.0, doorways=(door(stamp=1e4),))
    assert out.state == DETECTING
    assert chair.step(doorways=(door(stamp=chair.now),)).state == ASSISTING
    chair.run(0.5, doorways=(door(2.0, 0.0, stamp=1e4),))
    for _ in range(20):
        out = chair.step(doorways=(door(2.0, 0.15, stamp=chair.now),))
    assert out.doorway.pose[1] == pytest.approx(0.15, abs=0.01)
    refused = Chair(settings)
    refused.step(press=True)
    assert "in the future" in refused.run(6.0, doorways=(door(stamp=1e4),)).reason


@pytest.mark.parametrize("field, value", [
    ("pose", np.array([np.nan, 0.0, 0.0])), ("width", np.nan), ("confidence", np.nan),
])
def test_a_doorway_with_a_number_that_is_none_is_not_taken(settings, field, value):
    chair = Chair(settings)
    chair.step(press=True)
    out = chair.step(doorways=(door(stamp=chair.now)._replace(**{field: value}),))
    assert out.state == DETECTING and chair.goals == []


def test_without_fresh_odometry_no_doorway_is_latched(settings):
    chair = Chair(settings)
    chair.step(press=True)
    old = Odometry(chair.now - 1.0, chair.pose, STOP)
    assert chair.step(odometry=old, doorways=(door(stamp=chair.now),)).state == DETECTING
    future = Odometry(chair.now + 1.0, chair.pose, STOP)
    assert chair.step(odometry=future, doorways=(door(stamp=chair.now),)).state == DETECTING


# ---- which doorway -------------------------------------------------------------------------------------


def chosen(settings, doorways, user, pose=(0.0, 0.0, 0.0)):
    return choose(doorways, np.array(pose), user, settings, from_settings(settings.wheelchair))


def test_of_two_doorways_the_one_ahead_is_taken_while_the_stick_rests(settings):
    left, ahead = door(2.0, 1.2), door(2.0, -0.2)
    assert chosen(settings, (left, ahead), STOP).doorway.pose[1] == pytest.approx(-0.2)


def test_between_two_doorways_alike_the_stick_decides(settings):
    # both 22 degrees off the heading
    left, right = door(2.0, 0.8), door(2.0, -0.8)
    assert chosen(settings, (left, right), Twist(0.3, 0.4)).doorway.pose[1] > 0.0
    assert chosen(settings, (left, right), Twist(0.3, -0.4)).doorway.pose[1] < 0.0


def test_a_stick_pulled_back_or_not_a_number_points_nowhere(settings):
    limits = settings.wheelchair.limits
    assert stick_direction(Twist(-0.3, 0.1), limits) is None
    assert stick_direction(Twist(np.nan, 0.1), limits) is None
    assert stick_direction(STOP, limits) is None
    assert stick_direction(Twist(0.3, 0.0), limits) == 0.0


@pytest.mark.parametrize("doorway, words", [
    (door(width=0.66), "0.66 m wide, the chair needs 0.69 m"),
    (door(-2.0, 0.0, np.pi), "180 degrees off the heading"),
    (door(7.0), "7.0 m away"),
    (door(1.5, 0.5, -1.3), "from its side"),
    (door(confidence=0.1), "confidence is 0.10"),
])
def test_a_doorway_that_cannot_be_meant_is_refused_in_words(settings, doorway, words):
    choice = chosen(settings, (doorway,), STOP)
    assert choice.doorway is None
    assert words in choice.reason


# ---- the goal's place ----------------------------------------------------------------------------------


def test_a_box_one_metre_and_a_half_behind_the_door_moves_the_goal_nearer(settings):
    # The goal's front edge would be at 1.0 + 0.7 m; the box at 1.6 m leaves 1.6 - 0.7 - margin.
    chair = from_settings(settings.wheelchair)
    box = [(1.6, y) for y in np.arange(-0.6, 0.61, 0.05)]
    goal = free_goal(np.zeros(3), grid_with(*box), chair, settings)
    assert 0.5 <= goal[0] <= 1.6 - 0.7
    assert abs(goal[1]) < 1e-9 and abs(goal[2]) < 1e-9


def test_a_post_at_the_side_moves_the_goal_beside_the_normal(settings):
    goal = free_goal(np.zeros(3), grid_with((0.9, 0.28)), from_settings(settings.wheelchair), settings)
    assert goal[1] < 0.0
    assert abs(goal[1]) <= 0.2 + 1e-9 and abs(goal[2]) <= np.radians(15.0) + 1e-9


def test_a_wall_half_a_metre_behind_the_door_leaves_no_room(settings):
    wall = [(0.5, y) for y in np.arange(-2.0, 2.01, 0.05)]
    assert free_goal(np.zeros(3), grid_with(*wall), from_settings(settings.wheelchair), settings) is None


def test_unknown_ground_behind_the_door_does_not_count_as_occupied(settings):
    grid = grid_with()
    grid = grid._replace(cells=np.full_like(grid.cells, -1))
    goal = free_goal(np.zeros(3), grid, from_settings(settings.wheelchair), settings)
    assert goal == pytest.approx((1.0, 0.0, 0.0))


def test_without_room_behind_the_door_the_assistance_is_refused(settings):
    chair = Chair(settings)
    wall = grid_with(*[(2.5, y) for y in np.arange(-2.0, 2.01, 0.05)])
    chair.step(press=True)
    for _ in range(3):
        out = chair.step(doorways=(door(stamp=chair.now),), grid=wall)
    assert (out.state, out.refused, out.reason) == (MANUAL, True, "refused: no room behind the door")
    assert chair.goals == []


# ---- while assisting -----------------------------------------------------------------------------------


def test_a_latched_doorway_stays_when_nothing_is_seen_any_more(settings):
    chair = Chair(settings)
    chair.assist(door(2.0, 0.1))
    out = chair.run(5.0, doorways=(), user=Twist(0.3, 0.0), navigator_status="active")
    assert out.state == ASSISTING
    assert out.doorway.pose == pytest.approx((2.0, 0.1, 0.0))


def test_a_doorway_seen_again_elsewhere_moves_towards_what_is_seen(settings):
    chair = Chair(settings)
    chair.assist(door(3.0, 0.0))
    for _ in range(40):
        out = chair.step(doorways=(door(3.0, 0.1, stamp=chair.now),), navigator_status="active")
    # after 40 observations with a gain of 0.3 a share of 0.7^40 of the 0.1 m is left
    assert out.doorway.pose[1] == pytest.approx(0.1, abs=1e-3)
    # two seconds: at most one more goal for each second, the last within the 3 cm below which none is sent
    assert 2 <= len(chair.goals) <= 3
    assert abs(chair.goals[-1][1] - 0.1) <= 0.03


def test_the_same_observation_counts_once(settings):
    chair = Chair(settings)
    chair.assist(door(3.0, 0.0))
    seen = (door(3.0, 0.1, stamp=chair.now),)
    out = chair.run(1.0, doorways=seen, navigator_status="active")
    assert out.doorway.pose[1] == pytest.approx(0.03)  # 0.3 of 0.1 m, once


def test_another_doorway_does_not_take_the_latched_ones_place(settings):
    chair = Chair(settings)
    chair.assist(door(3.0, 0.0))
    for _ in range(20):
        out = chair.step(
            doorways=(door(3.0, 1.4, stamp=chair.now),), user=Twist(0.3, 0.5), navigator_status="active"
        )
    assert out.doorway.pose == pytest.approx((3.0, 0.0, 0.0))
    assert len(chair.goals) == 1


def test_in_the_gap_the_doorway_stays_as_it_is(settings):
    chair = Chair(settings)
    chair.assist(door(2.0, 0.0))
    chair.pose = np.array([1.2, 0.0, 0.0])  # front edge at 1.9 m
    for _ in range(20):
        out = chair.step(doorways=(door(2.0, 0.1, stamp=chair.now),), navigator_status="active")
    assert out.doorway.pose == pytest.approx((2.0, 0.0, 0.0))


# ---- how it ends ---------------------------------------------------------------------------------------


def test_the_planner_at_its_goal_means_arrival(settings):
    chair = Chair(settings)
    chair.assist()
    chair.pose = np.array([2.95, 0.0, 0.0])
    assert chair.run(0.2, navigator_status="succeeded").state == ARRIVED
    assert chair.cancels == 0
    chair.pose = np.array([4.1, 0.0, 0.0])  # driven on by more than a metre
    assert chair.step(navigator_status="succeeded").state == MANUAL


def test_past_the_goals_line_the_chair_has_arrived_wherever_the_stick_led_it(settings):
    chair = Chair(settings)
    chair.assist()
    chair.pose = np.array([3.05, 0.6, 0.8])
    out = chair.step(navigator_status="active")
    assert (out.state, out.cancel_goal) == (ARRIVED, True)


@pytest.mark.parametrize("button", ["press", "cancel"])
def test_x_again_or_circle_cancels(settings, button):
    chair = Chair(settings)
    chair.assist()
    out = chair.step(navigator_status="active", **{button: True})
    assert (out.state, out.cancel_goal, out.refused) == (MANUAL, True, False)
    assert out.doorway is None


def test_a_stick_pulled_back_for_two_seconds_cancels_and_not_before(settings):
    chair = Chair(settings)
    chair.assist()
    assert chair.run(1.9, user=Twist(-0.3, 0.0), navigator_status="active").state == ASSISTING
    assert chair.run(0.2, user=Twist(-0.3, 0.0), navigator_status="active").state == MANUAL


def test_a_stick_pulled_back_twice_for_a_moment_does_not_cancel(settings):
    chair = Chair(settings)
    chair.assist()
    for _ in range(3):
        chair.run(1.5, user=Twist(-0.3, 0.0), navigator_status="active")
        out = chair.run(0.2, user=Twist(0.1, 0.0), navigator_status="active")
    assert out.state == ASSISTING


def test_a_sideways_stick_never_ends_the_assistance(settings):
    chair = Chair(settings)
    chair.assist()
    assert chair.run(30.0, user=Twist(0.35, 1.0), navigator_status="active").state == ASSISTING


def test_a_chair_turned_away_for_two_seconds_is_handed_back(settings):
    chair = Chair(settings)
    chair.assist()
    chair.pose = np.array([0.0, 0.0, np.radians(95.0)])
    assert chair.run(5.0, navigator_status="active").state == ASSISTING
    chair.pose = np.array([0.0, 0.0, np.radians(-105.0)])
    assert chair.run(1.9, navigator_status="active").state == ASSISTING
    assert chair.run(0.2, navigator_status="active").state == MANUAL


def test_a_goal_that_the_planner_gives_up_is_a_fault_with_its_reason(settings):
    chair = Chair(settings)
    chair.assist()
    out = chair.step(navigator_status="aborted", navigator_reason="no path for 5.0 s")
    assert (out.state, out.reason, out.cancel_goal) == (FAULT, "planner: no path for 5.0 s", True)


def test_a_goal_that_nobody_accepts_is_a_fault(settings):
    chair = Chair(settings)
    chair.assist()
    assert chair.run(1.9, navigator_status="pending").state == ASSISTING
    assert chair.run(0.3, navigator_status="pending").state == FAULT


def test_the_blenders_fault_ends_the_assistance_and_an_old_one_does_not(settings):
    chair = Chair(settings)
    chair.assist()
    assert chair.step(fault="fault: prediction is 0.20 s old").state == FAULT
    chair.step(press=True, fault="fault: prediction is 0.20 s old")
    out = chair.step(doorways=(door(stamp=chair.now),), fault="fault: prediction is 0.20 s old")
    assert out.state == ASSISTING
    assert chair.step(fault="fault: prediction is 0.20 s old").state == ASSISTING
    assert chair.step(fault="").state == ASSISTING
    assert chair.step(fault="fault: prediction is 0.20 s old").state == FAULT


def test_a_fault_is_over_when_the_person_has_let_go_and_drives_again(settings):
    chair = Chair(settings)
    chair.assist()
    push = Twist(0.3, 0.0)
    chair.step(navigator_status="aborted", user=push)
    assert chair.run(3.0, user=push).state == FAULT
    assert chair.run(1.0, user=STOP).state == FAULT
    assert chair.step(user=push).state == MANUAL


def test_stale_odometry_ends_nothing(settings):
    chair = Chair(settings)
    chair.assist()
    old = Odometry(chair.now - 1.0, chair.pose, STOP)
    assert chair.run(5.0, odometry=old, user=Twist(-0.3, 0.0), navigator_status="active").state == ASSISTING


def test_time_that_goes_back_leaves_no_assistance_half_ended(settings):
    chair = Chair(settings)
    chair.assist()
    chair.now = 0.0
    chair.pose = np.array([0.0, 0.0, np.radians(-105.0)])
    assert chair.run(1.5, navigator_status="active").state == ASSISTING
    assert chair.run(1.0, navigator_status="active").state == MANUAL


def test_time_that_goes_back_hides_no_later_look_at_the_doorway(settings):
    chair = Chair(settings)
    chair.assist()
    chair.now = 1.0
    chair.step(navigator_status="active")
    for _ in range(20):
        out = chair.step(doorways=(door(2.0, 0.15, stamp=chair.now),), navigator_status="active")
    assert out.state == ASSISTING and out.doorway.pose[1] == pytest.approx(0.15, abs=0.01)
