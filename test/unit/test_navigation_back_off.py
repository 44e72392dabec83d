"""What the planner does where its commands are not carried out, and where it may turn and reverse."""
import numpy as np
import pytest
from navigation_scenes import CHAIR, SETTINGS, Drive, box, door, snapshot

from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control.planning import clearance, planners
from wheelchair_shared_control.planning.navigation import ABORTED, ACTIVE
from wheelchair_shared_control.planning.planner import Planner
from wheelchair_shared_control.values import STOP, Twist

FREE = np.empty((0, 2))
HELD = dict(share=0.0)


def speeds(drive, seconds, **options):
    """Forward commands (n,) of ``seconds`` towards a goal beyond the door."""
    drive.navigator.set_goal((1.5, 0.0, 0.0), drive.now)
    return np.array([drive.tick(**options).command.v for _ in range(int(seconds / 0.05))])


def test_a_chair_that_is_held_back_comes_again_from_farther_away():
    v = speeds(Drive(door(0.90), (-1.5, 0.0, 0.0), **HELD), 4.0)
    first = int(np.argmax(v < 0.0))
    # 1.5 s of patience beyond dead time and lag
    assert 1.5 < first * 0.05 < 2.6
    assert v[:first].max() > 0.1


def test_a_chair_that_may_drive_nothing_forward_comes_again_from_farther_away():
    drive = Drive(door(0.90), (-1.5, 0.0, 0.0))
    legal = drive.navigator.commands.legal

    def backward_only(field, acting, command, path):
        chosen = legal(field, acting, command, path)
        return chosen if command.v < 0.0 else (None,) + chosen[1:]

    drive.navigator.commands.legal = backward_only
    v = speeds(drive, 3.0)
    first = int(np.argmax(v < 0.0))
    assert 1.5 < first * 0.05 < 2.6 and v.max() == 0.0


def test_who_is_held_for_ever_is_told_so():
    decision = Drive(door(0.90), (-1.5, 0.0, 0.0), **HELD).to((1.5, 0.0, 0.0), limit=60.0)
    assert decision.status == ABORTED
    assert "no progress" in decision.reason


def test_a_chair_that_moves_is_not_held():
    drive = Drive(door(0.75), (-1.5, 0.0, 0.0))
    assert speeds(drive, 5.0).min() >= 0.0


def test_with_a_person_at_the_stick_it_does_not_back_off():
    assert speeds(Drive(door(0.90), (-1.5, 0.0, 0.0), **HELD), 4.0, user=Twist(0.3, 0.0)).min() >= 0.0
    assert speeds(Drive(door(0.90), (-1.5, 0.0, 0.0), **HELD), 4.0, user=STOP).min() >= 0.0


@pytest.mark.parametrize("name", sorted(planners.TABLE))
def test_a_person_who_pulls_back_is_not_driven_ahead(name):
    """Ahead and back would blend to nothing, and hold the chair before whatever the person wants away from."""
    drive = Drive(door(0.90), (-1.5, 0.3, -0.2))
    drive.navigator = planners.make(SETTINGS, name)
    assert speeds(drive, 1.5).max() > 0.1
    for pull, ahead in ((-0.05, False), (-0.3, False), (-0.045, True), (0.2, True)):
        commands = [drive.tick(user=Twist(pull, 0.0)).command for _ in range(20)]
        assert (max(command.v for command in commands) > 0.03) == ahead, pull
        if not ahead:
            assert all(command.w == 0.0 for command in commands if command.v == 0.0), pull


def test_who_pulls_back_is_still_turned_on_the_spot_where_the_path_turns():
    # a corridor across the chair's way, and the goal in it: as in test_turns_keep_more_distance_than_passages
    drive = Drive(np.concatenate((box(0.84, 0.94, -3.0, 3.0), box(-1.5, -1.4, -3.0, 3.0))), (0.0, 0.0, 0.0),
                  SETTINGS.replace(**{"planner/min_vel_x": 0.0}), **HELD)
    drive.navigator.set_goal((0.0, 1.5, np.pi / 2.0), 0.0)
    commands = [drive.tick(user=Twist(-0.1, 0.0)).command for _ in range(40)]
    assert max(command.v for command in commands) <= 0.0
    assert max(abs(command.w) for command in commands if command.v == 0.0) > 0.1


def test_after_the_pull_the_chair_starts_from_standstill():
    drive = Drive(door(0.90), (-1.5, 0.0, 0.0))
    assert speeds(drive, 2.0).max() > 0.2
    for _ in range(20):
        assert drive.tick(user=Twist(-0.2, 0.0)).reason == "the person pulls back"
    limits = SETTINGS.wheelchair.limits
    assert 0.0 < drive.tick(user=Twist(0.2, 0.0)).command.v <= limits.acceleration * 0.05 + 1e-9


DEAD_ENDS = [
    ("without a path", box(0.9, 1.0, -2.9, 2.9), 0.0, "no way through"),
    ("held", door(0.90), 6.0, "no progress"),
    ("without a command", door(0.90), 0.0, "no command is free"),
]


@pytest.mark.parametrize("title, walls, timeout, reason", DEAD_ENDS, ids=[row[0] for row in DEAD_ENDS])
def test_it_does_not_give_up_while_the_person_pulls_back(title, walls, timeout, reason):
    """A fault would ask for a centred stick, and hold the chair just when the person leaves the dead end."""
    drive = Drive(walls, (-1.5, 0.0, 0.0), SETTINGS.replace(oscillation_timeout=timeout), **HELD)
    if reason == "no command is free":
        legal = drive.navigator.commands.legal
        drive.navigator.commands.legal = lambda *given: (None,) + legal(*given)[1:]
    drive.navigator.set_goal((1.9, 0.0, 0.0), 0.0)
    assert drive.tick(user=Twist(0.1, 0.0)).status == ACTIVE
    for _ in range(400):
        assert drive.tick(user=Twist(-0.2, 0.0)).status == ACTIVE
    # the pull interrupts the patience, and does not renew it
    pushed = 0
    while drive.navigator.status == ACTIVE and pushed < 400:
        drive.tick(user=Twist(0.1, 0.0))
        pushed += 1
        if pushed % 20 == 0:
            for _ in range(20):
                drive.tick(user=Twist(-0.2, 0.0))
    assert drive.navigator.status == ABORTED and reason in drive.navigator.reason


RESTS = [
    ("at rest", Twist(0.01, 0.015), True), ("pushed a little", Twist(0.025, 0.0), False),
    ("turned to the right a little", Twist(0.0, -0.025), False), ("not finite", Twist(0.0, float("nan")), False),
]


@pytest.mark.parametrize("title, user, rests", RESTS, ids=[row[0] for row in RESTS])
def test_a_chair_that_its_person_holds_need_not_progress(title, user, rests):
    drive = Drive(door(0.90), (-1.5, 0.0, 0.0), SETTINGS.replace(oscillation_timeout=4.0), **HELD)
    drive.navigator.set_goal((1.5, 0.0, 0.0), 0.0)
    for _ in range(100):
        drive.tick(user=user)
    assert (drive.navigator.status == ACTIVE) == rests
    if not rests:
        return
    pushed = 0
    while drive.navigator.status == ACTIVE and pushed < 200:  # a rest in between does not begin the time anew
        for user in (Twist(0.2, 0.0),) * 19 + (STOP,):
            drive.tick(user=user)
        pushed += 19
    assert "no progress" in drive.navigator.reason
    assert 75 < pushed < 105  # 4 s of pushing


def test_it_backs_off_over_seen_ground_only():
    drive = Drive(door(0.90), (-1.5, 0.0, 0.0), **HELD)
    drive._seen = snapshot(drive.walls, drive.pose, 0.0, known=False)
    assert speeds(drive, 4.0).min() >= 0.0


LOOKS = [("nobody at the stick", None, True), ("pushing", Twist(0.3, 0.0), True), ("a stick at rest", STOP, False)]


@pytest.mark.parametrize("title, user, ends", LOOKS, ids=[row[0] for row in LOOKS])
def test_a_look_that_is_held_ends_unless_the_stick_is_at_rest(title, user, ends):
    drive = Drive(FREE, (0.0, 0.0, 0.0), **HELD)
    drive._seen = snapshot(FREE, drive.pose, 0.0, known=False)
    drive.navigator.set_goal((0.5, 2.5, 1.5), 0.0)
    looks = [drive.tick(user=user).reason == "looks towards the goal" for _ in range(60)]
    assert looks[0] and looks[30]
    assert looks[-1] != ends


def test_turns_keep_more_distance_than_passages():
    # a wall before the chair, so near that a turn at once would swing a front corner to it
    walls = np.concatenate((box(0.74, 0.84, -3.0, 3.0), box(-1.5, -1.4, -3.0, 3.0)))
    start = np.zeros(3)
    planner = Planner(SETTINGS.wheelchair, SETTINGS)
    field = clearance.make_field(snapshot(walls, start, 0.0))
    path, reason = planner.plan(field, start, (0.0, 1.5, np.pi / 2.0), True)
    assert path is not None, reason
    turning = np.flatnonzero(path.kinds == 0)
    assert len(turning)
    least = min(path.clear[0] - 0.003, SETTINGS.planner.turn_clearance)
    assert path.clear[turning].min() >= least - 1e-9


REVERSALS = [
    ("seen", dict(), True),
    ("presumed about the start", dict(presumed=True), True),
    ("presumed, but farther off", dict(presumed=True, doubtful=True), False),
    ("unknown", dict(known=False), False),
]


@pytest.mark.parametrize("title, ground, allowed", REVERSALS, ids=[row[0] for row in REVERSALS])
def test_reverses_over(title, ground, allowed):
    start = np.zeros(3)
    # a blind alley, too narrow to turn in
    alley = np.concatenate((box(0.8, 0.9, -0.5, 0.5), box(-2.9, 0.8, 0.5, 0.6), box(-2.9, 0.8, -0.6, -0.5)))
    seen = snapshot(alley, start, 0.0)
    rows, columns = seen.known.shape
    x = seen.origin[0] + (np.arange(columns) + 0.5) * seen.resolution
    behind = np.broadcast_to(x < CHAIR.rear, (rows, columns))
    seen = seen._replace(
        known=seen.known & (ground.get("known", True) | ~behind),
        presumed=behind & ground.get("presumed", False), doubtful=behind & ground.get("doubtful", False))
    path, _ = Planner(SETTINGS.wheelchair, SETTINGS).plan(
        clearance.make_field(seen), start, np.array([-1.0, 0.0, 0.0]), True)
    reverses = path is not None and bool(np.any(path.kinds < 0))
    assert reverses == allowed


def test_the_way_back_ends_before_a_wall():
    drive = Drive(np.concatenate((door(0.90), box(-1.8, -1.7, -2.0, 2.0))), (-1.1, 0.0, 0.0), **HELD)
    speeds(drive, 2.1)
    drive.share = 1.0
    for _ in range(60):
        drive.tick()
    assert np.min(np.array(drive.poses)[:, 0]) < -1.15
    assert min(footprints.distance_to_points(CHAIR, pose, drive.walls).min() for pose in drive.poses) > 0.0


def test_a_swing_into_unseen_ground_beside_something_is_dear():
    """Between the rangers' beams a jamb can hide: whoever may turn elsewhere shall."""
    planner, start = Planner(SETTINGS.wheelchair, SETTINGS), np.zeros(3)
    steps, kinds = np.tile([0.0, 0.1], (8, 1)), np.zeros(8, np.int64)

    def price(wall, known):
        field = clearance.make_field(snapshot(wall, start, 0.0, known=known))
        return planner.price(field, start, steps, kinds)

    near, far = box(-1.0, 1.0, -0.8, -0.7), box(-1.0, 1.0, -2.1, -2.0)
    # turned by 0.8 rad the rear corner has 0.2 m left to the near wall
    assert price(near, False) > 5.0 * price(near, True)
    assert price(far, False) < 3.5 * price(far, True)
