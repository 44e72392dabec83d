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


STICKS = [
    ("pushed forward", Twist(0.3, 0.0), False),
    ("at rest", STOP, False),
    ("turned only", Twist(0.0, 0.4), True),
    ("hardly forward, and turned", Twist(0.04, 0.4), True),
]


@pytest.mark.parametrize("title, user, backs", STICKS, ids=[row[0] for row in STICKS])
def test_a_chair_that_is_held_backs_off_unless_the_stick_pushes_on_or_rests(title, user, backs):
    v = speeds(Drive(door(0.90), (-1.5, 0.0, 0.0), **HELD), 4.0, user=user)
    assert (v.min() < -0.05) == backs


@pytest.mark.parametrize("name", sorted(planners.TABLE))
def test_a_person_who_pulls_back_is_not_driven_ahead(name):
    """Ahead and back would blend to nothing, and hold the chair before whatever the person wants away from."""
    drive = Drive(door(0.90), (-1.5, 0.0, 0.0))
    drive.navigator = planners.make(SETTINGS, name)
    assert speeds(drive, 1.5).max() > 0.1
    for _ in range(20):
        pulled = drive.tick(user=Twist(-0.06, 0.0))
        assert pulled.command.v <= 0.0
    assert pulled.status == ACTIVE
    assert max(drive.tick(user=Twist(0.2, 0.0)).command.v for _ in range(20)) > 0.05


@pytest.mark.parametrize("title, walls, timeout, reason", [
    ("without a path", box(0.9, 1.0, -2.9, 2.9), 0.0, "no way through"), ("held", door(0.90), 6.0, "no progress"),
])
def test_it_does_not_give_up_while_the_person_pulls_back(title, walls, timeout, reason):
    """A fault would ask for a centred stick, and hold the chair just when the person leaves the dead end."""
    for user, gives_up in ((Twist(0.1, 0.0), True), (Twist(-0.2, 0.0), False)):
        drive = Drive(walls, (-1.5, 0.0, 0.0), SETTINGS.replace(oscillation_timeout=timeout), **HELD)
        drive.navigator.set_goal((1.9, 0.0, 0.0), 0.0)
        decisions = [drive.tick(user=user) for _ in range(300)]
        assert (decisions[-1].status == ABORTED) == gives_up, title
        assert not gives_up or reason in decisions[-1].reason


def test_a_command_that_is_not_finite_is_nobody_s():
    assert speeds(Drive(door(0.90), (-1.5, 0.0, 0.0)), 1.0, user=Twist(-0.3, float("nan"))).max() > 0.1


def test_it_backs_off_over_seen_ground_only():
    drive = Drive(door(0.90), (-1.5, 0.0, 0.0), **HELD)
    drive._seen = snapshot(drive.walls, drive.pose, 0.0, known=False)
    assert speeds(drive, 4.0).min() >= 0.0


LOOKS = [
    ("nobody at the stick", None, True), ("pushing", Twist(0.3, 0.0), True), ("turning", Twist(0.0, 0.4), True),
    ("a stick at rest", STOP, False),
]


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
