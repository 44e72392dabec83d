"""Navigation in closed loop without sensors: goals, refusals, silence, old data, doors."""
import numpy as np
import pytest
from navigation_scenes import CHAIR, SETTINGS, Drive, box, door, snapshot

from wheelchair_shared_control import se2
from wheelchair_shared_control.planning import following
from wheelchair_shared_control.planning.navigation import ABORTED, ACTIVE, IDLE, SUCCEEDED, Navigator
from wheelchair_shared_control.values import STOP, Odometry, Twist

FREE = np.empty((0, 2))
AT_REST = Twist(0.0, 0.0)

# title, walls, start, goal; each must be reached without coming closer than 0
CROSSINGS = [
    ("straight on through the standard door", door(0.90), (-2.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    ("from beside the axis, turned away", door(0.90), (-2.0, 0.7, 0.6), (1.0, 0.0, 0.0)),
    ("a door 5 cm wider than the chair on either side", door(0.75), (-2.2, -0.4, 0.3), (1.0, 0.0, 0.0)),
    ("close and awkward: 0.3 m before the wall, at 60 degrees", door(0.90), (-0.99, 0.3, np.radians(60)), (1, 0, 0)),
    ("alongside the wall, 0.1 m from it", door(0.90), (-0.485, -0.4, np.radians(90)), (1.0, 0.0, 0.0)),
]


@pytest.mark.parametrize("title, walls, start, goal", CROSSINGS, ids=[row[0] for row in CROSSINGS])
def test_crosses(title, walls, start, goal):
    drive = Drive(walls, start)
    decision = drive.to(goal)
    assert decision.status == SUCCEEDED, decision.reason
    assert drive.least > 0.0
    assert np.hypot(*(drive.pose[:2] - np.array(goal[:2]))) < 0.25


def test_half_of_each_command_is_enough():
    drive = Drive(door(0.90), (-2.0, 0.3, 0.0), share=0.5)
    assert drive.to((1.0, 0.0, 0.0)).status == SUCCEEDED
    assert drive.least > 0.0


def test_speed_never_changes_faster_than_a_person_may_be_accelerated():
    drive = Drive(FREE, (0.0, 0.0, 0.0))
    drive.to((2.0, 0.5, 0.5))
    sent = np.array([d.command for d in drive.decisions if d.command is not None])
    # 0.7 m/s2 and 1.4 rad/s2 at 20 Hz: 0.035 m/s and 0.07 rad/s a cycle; the end is a stop
    assert np.abs(np.diff(sent[:-1, 0])).max() < 0.0351
    assert np.abs(np.diff(sent[:-1, 1])).max() < 0.0701
    assert sent[:, 0].max() <= 0.6 + 1e-9


def test_a_door_narrower_than_the_chair_is_refused():
    drive = Drive(door(0.60), (-1.5, 0.0, 0.0))
    decision = drive.to((1.0, 0.0, 0.0))
    assert decision.status == ABORTED
    assert decision.command == STOP
    assert "0.65 m" in decision.reason or "no path" in decision.reason
    assert drive.least > 0.05


def test_a_goal_inside_a_wall_aborts_after_one_recovery():
    drive = Drive(box(1.5, 2.5, -0.5, 0.5), (0.0, 0.0, 0.0))
    decision = drive.to((1.5, 0.0, 0.0))
    assert decision.status == ABORTED
    assert decision.reason
    # patience, recovery, patience: 4 s + 4 s
    assert sum(d.recovery for d in drive.decisions) == 1
    assert 7.0 < drive.now < 10.0


def test_idle_is_silent():
    drive = Drive(FREE, (0.0, 0.0, 0.0))
    assert all(drive.tick().command is None for _ in range(3))


def test_success_is_one_zero_then_silence():
    drive = Drive(FREE, (0.0, 0.0, 0.0))
    assert drive.to((1.0, 0.0, 0.0)).command == STOP
    assert [drive.tick().command for _ in range(3)] == [None] * 3
    assert drive.navigator.status == SUCCEEDED


def test_cancel_is_one_zero_then_silence():
    drive = Drive(FREE, (0.0, 0.0, 0.0))
    drive.navigator.set_goal((2.0, 0.0, 0.0), 0.0)
    for _ in range(20):
        drive.tick()
    drive.navigator.cancel(drive.now)
    commands = [drive.tick().command for _ in range(4)]
    assert commands == [STOP, None, None, None]
    assert drive.navigator.status == IDLE
    drive.navigator.cancel(drive.now)
    assert drive.tick().command is None


def test_a_new_goal_takes_over_without_stopping():
    drive = Drive(FREE, (0.0, 0.0, 0.0))
    drive.navigator.set_goal((3.0, 0.0, 0.0), 0.0)
    for _ in range(40):
        drive.tick()
    before = drive.decisions[-1].command.v
    drive.navigator.set_goal((3.0, 0.3, 0.0), drive.now)
    after = [drive.tick().command.v for _ in range(10)]
    assert before > 0.4
    assert min(after) > 0.2


OLD = [
    ("costmap", dict(age=0.0, stamp=-2.0), "costmap is 2.0 s old, limit 0.5 s"),
    ("odometry", dict(age=0.4, stamp=0.0), "odometry is 0.4 s old, limit 0.3 s"),
]


@pytest.mark.parametrize("what, ages, reason", OLD, ids=[row[0] for row in OLD])
def test_old_data_stop_the_chair_until_fresh_ones_come(what, ages, reason):
    navigator, pose, now = Navigator(SETTINGS), np.zeros(3), 10.0
    navigator.set_goal((2.0, 0.0, 0.0), now)
    seen = snapshot(FREE, pose, now + ages["stamp"])
    decision = navigator.update(now, Odometry(now - ages["age"], pose, AT_REST), seen)
    assert (decision.command, decision.status, decision.reason) == (STOP, ACTIVE, reason)
    for _ in range(20):
        now += 0.05
        decision = navigator.update(now, Odometry(now, pose, AT_REST), snapshot(FREE, pose, now))
    assert decision.command.v > 0.1


def test_nothing_known_yet_stops():
    navigator = Navigator(SETTINGS)
    navigator.set_goal((1.0, 0.0, 0.0), 0.0)
    assert navigator.update(0.0, None, None).reason == "no odometry"
    decision = navigator.update(0.0, Odometry(0.0, np.zeros(3), AT_REST), None)
    assert (decision.command, decision.reason) == (STOP, "no costmap")
    lost = Odometry(0.0, np.array([np.nan, 0.0, 0.0]), AT_REST)
    assert navigator.update(0.0, lost, snapshot(FREE, np.zeros(3), 0.0)).command == STOP


def test_a_source_that_never_came_is_named_as_the_reason():
    navigator = Navigator(SETTINGS)
    navigator.set_goal((1.0, 0.0, 0.0), 0.0)
    seen = snapshot(FREE, np.zeros(3), 0.0)._replace(stamp=-np.inf)
    decision = navigator.update(0.0, Odometry(0.0, np.zeros(3), AT_REST), seen)
    assert decision.command == STOP
    assert decision.reason == "costmap is not complete: a required source has sent nothing yet"


def test_a_clock_that_is_set_back_does_not_keep_the_chair_waiting():
    navigator, pose = Navigator(SETTINGS), np.zeros(3)
    navigator.set_goal((2.0, 0.0, 0.0), 1000.0)
    for start in (1000.0, 3.0):
        speeds = []
        for k in range(20):
            now = start + 0.05 * k
            seen = snapshot(FREE, pose, now)
            speeds.append(navigator.update(now, Odometry(now, pose, AT_REST), seen).command.v)
        assert speeds[0] < 0.1 < speeds[-1]


def test_while_a_person_pushes_forward_the_chair_never_reverses():
    # The goal lies behind: without a person the chair may reverse to it.
    drive = Drive(box(0.9, 1.0, -2.0, 2.0), (0.0, 0.0, 0.0))
    drive.navigator.set_goal((-1.0, 0.0, 0.0), 0.0)
    for _ in range(60):
        drive.tick(user=Twist(0.3, 0.0))
    assert min(d.command.v for d in drive.decisions) >= 0.0


def test_a_goal_must_be_finite():
    with pytest.raises(ValueError):
        Navigator(SETTINGS).set_goal((0.0, np.nan, 0.0), 0.0)


def test_make_plan_starts_and_ends_where_it_should():
    start, goal = (-1.8, 0.2, 0.0), (1.0, 0.0, 0.0)
    plan = Navigator(SETTINGS).make_plan(snapshot(door(0.90), start, 0.0), start, goal)
    assert np.allclose(plan[0], start)
    assert np.hypot(*(plan[-1, :2] - np.array(goal[:2]))) < 0.1
    # in the door the plan is square: within 3 degrees
    inside = np.abs(plan[:, 0]) < 0.3
    assert np.abs(se2.wrap_angle(plan[inside, 2])).max() < np.radians(3.0)


def test_make_plan_is_empty_where_there_is_no_way():
    plan = Navigator(SETTINGS).make_plan(snapshot(door(0.55), (-1.8, 0.0, 0.0), 0.0), (-1.8, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert len(plan) == 0
    assert CHAIR.width == 0.65


def test_under_a_push_a_turn_begins_before_its_corner():
    # 1 m ahead in steps of 0.1 m, a quarter turn on the spot, 0.5 m to the left. With v_H / 2 left of the speed the
    # turn is an arc of radius r, which touches both legs r tan(45 degrees) = r from the corner.
    drive = [(0.1 * k, 0.0, 0.0) for k in range(11)]
    turn = [(1.0, 0.0, a) for a in np.radians((30.0, 60.0, 90.0))]
    after = [(1.0, 0.1 * k, np.pi / 2.0) for k in range(1, 6)]
    poses = np.array(drive + turn + after)
    kinds = np.array([1] * 10 + [0] * 3 + [1] * 5)
    for ahead, radius, expected in ((0.15, 0.0, 8), (0.15, 0.1, 8), (0.15, 0.17, 10), (0.05, 0.1, 10)):
        step, _ = following.project(np.array([1.0 - ahead, 0.0, 0.0]), poses, kinds, 0, radius)
        assert step == expected, (ahead, radius)
