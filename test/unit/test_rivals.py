"""The rival policies, each in the situation that shows its character, and their rows in the table."""
import json
import math
import zipfile

import numpy as np
import pytest

from wheelchair_shared_control import blending, cases, footprint, parameters, policy, shared_control
from wheelchair_shared_control.rivals import (
    case_based,
    efficiency,
    intent,
    minimax,
    minimum_vfh,
    surroundings,
    winner_takes_all,
)
from wheelchair_shared_control.values import STOP, Doorway, Twist

SETTINGS = parameters.load("blender")
CHAIR = footprint.from_settings(SETTINGS.wheelchair)  # front edge 0.70 m before the axle, sides at 0.325 m
LIMITS = SETTINGS.wheelchair.limits  # 0.6 m/s, 1.0 rad/s
RIVALS = ("efficiency", "minimax", "intent", "case_based", "winner_takes_all", "minimum_vfh")
NOTHING = np.empty((0, 2))


def tick(user, planner=(0.0, 0.0), points=NOTHING, **changes):
    """A tick at the origin, heading along x, with obstacles at ``points``."""
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    near = footprint.distance_to_points(CHAIR, np.zeros(3), points).min(initial=2.0)
    values = dict(
        now=0.0, user=Twist(*user), planner=Twist(*planner), pose=np.zeros(3), twist=Twist(*user),
        features=(2.0, 2.0, 2.0), clearance=near, prediction=None, density_floor=math.nan, grid=None, points=points,
        goal=np.array([3.0, 0.0, 0.0]), doorway=None, doorways=(), settings=SETTINGS,
    )
    values.update(changes)
    return policy.Tick(**values)


def doorway(x, y, yaw=0.0):
    """A doorway 0.9 m wide."""
    return Doorway(np.array([x, y, yaw]), 0.9, 1.0, np.zeros((2, 2)), np.zeros((3, 3)))


def wall(x, y0, y1):
    """Points every centimetre across the way."""
    y = np.arange(y0, y1, 0.01)
    return np.column_stack((np.full(len(y), x), y))


@pytest.mark.parametrize("name", RIVALS)
def test_a_rival_is_a_row_of_the_table_and_gives_a_command_anywhere(name):
    rng = np.random.default_rng(4)
    function, memory = blending.load_policy(name), {}
    for step in range(300):
        points = rng.uniform(-2.5, 2.5, (int(rng.integers(0, 60)), 2))
        seen = () if step % 3 else (doorway(*rng.uniform(-3, 3, 3)),)
        there = tick(
            (rng.uniform(-0.6, 0.6), rng.uniform(-1, 1)), (rng.uniform(-0.25, 0.6), rng.uniform(-1, 1)), points,
            now=0.03 * step, features=tuple(rng.uniform(0, 2, 3)), doorways=seen, doorway=seen[0] if seen else None,
            goal=None if step % 5 == 0 else rng.uniform(-3, 3, 3), pose=rng.uniform(-3, 3, 3),
        )
        result = blending.decided(function, there, memory)
        assert np.isfinite(result.command).all()
        assert result.beta is None or 0.0 <= result.beta <= 1.0
    assert blending.decided(function, tick((0.0, 0.01), (0.5, 0.4)), memory).command == STOP


def test_warming_up_calls_the_policy_and_forgets_it(tmp_path):
    path = tmp_path / "count.py"
    path.write_text(
        "calls = []\n\ndef count(tick, memory):\n    calls.append(len(memory))\n    memory[len(calls)] = tick\n"
        "    return tick.user, 1.0, ''\n", encoding="utf-8")
    control = shared_control.SharedControl(SETTINGS, "%s:count" % path)
    control.warm_up()
    calls = control._policy.__globals__["calls"]
    assert calls and control._memory == {}


# ---- efficiency --------------------------------------------------------------------------------------------


def test_efficiency_weighs_both_commands_by_how_well_they_are_driven():
    # Straight to the goal in free space: smoothness 1, directness 1, safety 1 - exp(-0.5 (1 + 1)^2) = 0.8647,
    # n = 0.9549. u = 0.5 n u_H + 0.5 n u_P = 0.5 * 0.9549 * (0.4 + 0.2) = 0.2865 m/s
    n = (2.0 + 1.0 - math.exp(-2.0)) / 3.0
    same = efficiency.efficiency(tick((0.4, 0.0), (0.2, 0.0)), {})
    assert same.command == pytest.approx((0.3 * n, 0.0)) and same.beta == pytest.approx(0.5)
    # A user who turns off by 45 degrees is less smooth and less direct, exp(-0.5 pi / 4) = 0.675 each
    off = (2.0 * math.exp(-math.pi / 8.0) + 1.0 - math.exp(-2.0)) / 3.0
    turning = efficiency.efficiency(tick((0.3, 0.3), (0.3, 0.0)), {})
    assert turning.beta == pytest.approx(off / (off + n))
    assert turning.command == pytest.approx((0.15 * (off + n), 0.15 * off))


def test_efficiency_trusts_less_who_drives_at_the_obstacle():
    # d = 0.2 / 2.0; the post lies straight ahead: safety of straight on 1 - exp(-0.5 * 0.1^2) = 0.005,
    # of 45 degrees off 1 - exp(-0.5 (0.1 + 0.707)^2) = 0.278
    post = dict(goal=None, clearance=0.2, points=[(0.9, 0.0)])
    result = efficiency.efficiency(tick((0.3, 0.0), (0.3, 0.3), **post), {})
    straight = (1.0 + 1.0 - math.exp(-0.005)) / 2.0
    aside = (math.exp(-math.pi / 8.0) + 1.0 - math.exp(-0.5 * (0.1 + math.sqrt(0.5)) ** 2)) / 2.0
    assert result.beta == pytest.approx(straight / (straight + aside))


# ---- minimax -----------------------------------------------------------------------------------------------


def test_minimax_leaves_the_user_alone_where_nothing_is_wrong():
    # free, as before: safety, comfort and obedience of the user's own command are all 1
    result = minimax.minimax(tick((0.4, 0.3), (0.2, -0.3)), {"last": Twist(0.4, 0.3)})
    assert result.command == Twist(0.4, 0.3) and result.beta == 1.0


def test_minimax_takes_the_share_whose_worst_index_is_best():
    # 0.3 m before a wall the user pushes on and the planner turns on the spot: neither alone is best
    there = tick((0.6, 0.0), (0.0, 0.6), wall(1.0, -1.0, 1.0))
    result = minimax.minimax(there, {"last": Twist(0.3, 0.3)})
    worst = []
    for step in range(11):
        k = step / 10.0
        worst.append(min(minimax.indices_of(there, Twist(0.6 * k, 0.6 * (1.0 - k)), Twist(0.3, 0.3))))
    assert 0.0 < result.beta < 1.0
    assert worst[int(round(10 * result.beta))] == max(worst) > max(worst[0], worst[10])


# ---- intent ------------------------------------------------------------------------------------------------


def drive_intent(user, points=NOTHING, seconds=2.0, **changes):
    """The last result of two seconds of one stick."""
    memory, result = {}, None
    for step in range(int(seconds * 30)):
        result = intent.intent(tick(user, points=points, now=step / 30.0, **changes), memory)
    return result


def test_a_confidence_follows_the_agreement_with_its_time_constant():
    own = SETTINGS.intent
    assert intent.followed(0.0, 0.3, 0.3, own.time, own) == pytest.approx(1.0 - math.exp(-1.0))
    # one spread off, agreement exp(-1/2)
    assert intent.followed(0.0, 0.3, 0.3 + own.spread, 100.0, own) == pytest.approx(math.exp(-0.5))


def test_intent_leads_to_the_doorway_that_the_person_heads_for():
    # The door's axis lies 0.2 m to the left, the person pushes straight on. The waypoint is 0.9 m along, 0.2 m
    # aside: w = 2 v y / (x^2 + y^2) = 2 * 0.36 * 0.2 / 0.85
    posts = [(2.0, 0.65), (2.0, -0.25)]
    result = drive_intent((0.36, 0.0), posts, doorway=doorway(2.0, 0.2))
    assert result.reason.startswith("doorway")
    assert result.command == pytest.approx((0.36, 0.36 * 0.4 / 0.85))


def test_intent_lets_the_person_drive_who_wants_something_else():
    memory = {}
    for step in range(60):
        led = intent.intent(tick((0.36, 0.0), doorway=doorway(2.0, 0.2), now=0.05 * step), memory)
    assert led.beta is None
    result = intent.intent(tick((0.1, 1.0), doorway=doorway(2.0, 0.2), now=3.0), memory)
    assert result.command == Twist(0.1, 1.0) and result.beta == 1.0 and "the stick deviates" in result.reason


def test_intent_takes_no_rest_for_agreement():
    memory = {}
    for now in (0.0, 0.05):
        before = intent.intent(tick((0.36, 0.0), doorway=doorway(2.0, 0.2), now=now), memory)
    for step in range(100):
        intent.intent(tick((0.0, 0.0), doorway=doorway(2.0, 0.2), now=0.1 + 0.05 * step), memory)
    after = intent.intent(tick((0.36, 0.0), doorway=doorway(2.0, 0.2), now=5.1), memory)
    assert "the person drives" in before.reason and "the person drives" in after.reason


def test_intent_leads_nowhere_before_it_is_confident_or_where_the_way_is_closed():
    first = intent.intent(tick((0.36, 0.0), doorway=doorway(2.0, 0.2)), {})
    assert first.command == Twist(0.36, 0.0) and first.beta == 1.0
    closed = drive_intent((0.36, 0.0), wall(0.9, -1.0, 1.0), doorway=doorway(2.0, 0.2))
    assert closed.command == Twist(0.36, 0.0) and "no safe trajectory" in closed.reason


# ---- case_based --------------------------------------------------------------------------------------------


@pytest.fixture
def one_case(tmp_path):
    """A file whose only case says: with the goal 3 m ahead and 2 m of room, drive at 0.3 m/s."""
    path = tmp_path / "cases.npz"
    cases.save(path, cases.Cases(np.array([[2.0, 2.0, 2.0, 0.3, 3.0, 0.0]]), np.array([[0.3, 0.0]]), {"made_by": "me"}))
    return SETTINGS.replace(**{"case_based/cases": str(path)})


def test_case_based_does_what_was_done_in_the_demonstrated_situation(one_case):
    result = case_based.case_based(tick((0.5, 0.8), twist=Twist(0.3, 0.0), settings=one_case), {})
    assert result.command == pytest.approx((0.3, 0.0)) and result.beta == pytest.approx(0.0)


def test_case_based_leaves_it_to_the_person_where_nothing_like_it_was_shown(one_case):
    # one goal scale further away: D = 1, f = exp(-1 / (2 familiar^2))
    own = one_case.case_based
    f = math.exp(-0.5 / own.familiar**2)
    there = tick((0.5, 0.8), twist=Twist(0.3, 0.0), settings=one_case, goal=np.array([3.0 + own.goal_scale, 0.0, 0.0]))
    result = case_based.case_based(there, {})
    assert result.command == pytest.approx((0.3 * f + 0.5 * (1.0 - f), 0.8 * (1.0 - f)))
    assert result.beta == pytest.approx(1.0 - f)


def test_nearer_cases_weigh_more():
    # distances 0 and 0.3, blur 0.1: weights 10 and 2.5
    command, nearest = case_based.retrieve(
        np.array([[0.0] * 6, [0.3] + [0.0] * 5, [9.0] * 6]), np.array([[0.2, 0.0], [0.6, 1.0], [5.0, 5.0]]),
        np.zeros(6), 2, 0.1)
    assert nearest == 0.0 and command == pytest.approx(((10 * 0.2 + 2.5 * 0.6) / 12.5, 2.5 / 12.5))


def test_the_shipped_cases_come_from_bags_of_both_sets_and_execute_nothing():
    shipped = cases.load("shipped")
    assert 1000 < len(shipped.situations) < 10000
    names = [bag["file"] for bag in shipped.provenance["bags"]]
    assert len(names) == 48 and all(len(bag["sha256"]) == 64 for bag in shipped.provenance["bags"])
    both = cases.mirrored(shipped)
    assert np.allclose(both.commands[:, 1].mean(), 0.0, atol=1e-6)
    with zipfile.ZipFile(str(parameters.package_file("config/models/cases.npz"))) as archive:
        assert b"O'" not in archive.read("situations.npy")[:128]


def test_a_file_that_is_no_cases_is_refused_by_its_name(tmp_path):
    path = tmp_path / "bad.npz"
    numbers = dict(situations=np.zeros((2, 6), "f4"), commands=np.zeros((2, 2), "f4"))
    header = json.dumps({"format": cases.FORMAT, "version": cases.VERSION})
    for content in (
        b"", b"PK\x03\x04 damaged", dict(header=np.array([{}], dtype=object)), dict(numbers, header="[" * 100000),
        dict(numbers, header=header.replace("1", "2")), dict(numbers, header=header, commands=np.zeros((3, 2), "f4")),
        dict(numbers, header=header, situations=np.full((2, 6), np.nan, "f4")), dict(numbers, header=header, code="x"),
    ):
        if isinstance(content, dict):
            np.savez(str(path), **content)
        else:
            path.write_bytes(content)
        with pytest.raises(cases.CasesError, match="bad.npz"):
            cases.load(path)
        wrong = SETTINGS.replace(**{"case_based/cases": str(path)})
        with pytest.raises(blending.PolicyError, match="bad.npz"):
            blending.prepare(blending.load_policy("case_based"), wrong)


def test_the_doorway_of_a_demonstration_is_where_it_was_narrowest():
    # the axle drives along x; the chair's middle, 0.175 m before it, is in the plane x = 2 when the axle is at 1.825
    x = np.linspace(0.0, 4.0, 401)
    inside = (x + CHAIR.front > 2.0) & (x + CHAIR.rear < 2.0)
    door = cases.doorway_of(np.where(inside, 0.25, 3.0), np.column_stack((x, 0 * x, 0 * x)), CHAIR)
    assert door == pytest.approx((2.0, 0.0, 0.0), abs=0.011)


# ---- winner_takes_all --------------------------------------------------------------------------------------


def test_winner_takes_all_never_mixes():
    own = SETTINGS.winner_takes_all
    free = winner_takes_all.winner_takes_all(tick((0.5, 0.3), (0.3, -0.2)), {})
    assert free.command == Twist(0.5, 0.3) and free.beta == 1.0
    # The wall is 0.25 m before the front edge, 0.4 s at 0.5 m/s: danger exp(-0.4 / T). The planner's command is of
    # the person's own class, ahead, so obstacle avoidance has all of it and drives alone.
    there = tick((0.5, 0.0), (0.2, 0.3), wall(0.95, -1.0, 1.0))
    until = surroundings.time_to_collision(there, there.user, own.horizon, own.step)
    assert until == pytest.approx(0.4)
    result = winner_takes_all.winner_takes_all(there, {})
    assert result.reason == winner_takes_all.AVOIDANCE and result.command == Twist(0.2, 0.3) and result.beta == 0.0


def test_winner_takes_all_turns_away_where_the_person_will_not_have_the_planner_s_way():
    # hard left, hand's breadth from the wall, while the planner would reverse: nobody supports that class
    there = tick((0.5, 0.9), (-0.2, 0.0), wall(0.72, -1.0, 1.0), features=(0.2, 0.02, 1.5))
    chances = {"left": 0.9, "ahead": 0.1, "right": 0.0, "back": 0.0}
    result = winner_takes_all.winner_takes_all(there, {"chances": chances})
    assert result.reason == winner_takes_all.COLLISION
    assert result.command == Twist(0.0, -SETTINGS.winner_takes_all.turn_rate)  # the right side is freer


def test_the_driver_stays_until_another_is_better_by_the_hysteresis():
    own = SETTINGS.winner_takes_all
    chances = {"left": 0.0, "ahead": 1.0, "right": 0.0, "back": 0.0}
    # at t_c = T ln 2 the person and obstacle avoidance are equal: whoever drives goes on
    half = winner_takes_all.appropriateness(chances, "ahead", "ahead", own.time * math.log(2.0), own)
    assert half[winner_takes_all.USER] == pytest.approx(0.5) == half[winner_takes_all.AVOIDANCE]
    for driver in (winner_takes_all.USER, winner_takes_all.AVOIDANCE):
        memory = {"chances": chances, "now": 0.0, "driver": driver}
        nearly = tick((0.5, 0.0), planner=(0.2, 0.0), points=wall(1.07, -0.5, 0.5))
        assert winner_takes_all.winner_takes_all(nearly, memory).reason == driver
    memory = {"chances": chances, "now": 0.0, "driver": winner_takes_all.USER}
    near = tick((0.5, 0.0), planner=(0.2, 0.0), points=wall(0.85, -0.5, 0.5))
    assert winner_takes_all.winner_takes_all(near, memory).reason != winner_takes_all.USER


def test_the_distribution_forgets_with_its_window():
    before = {"left": 1.0, "ahead": 0.0, "right": 0.0, "back": 0.0}
    after = winner_takes_all.updated(before, "ahead", 1.0, 1.0)
    assert after["left"] == pytest.approx(math.exp(-1.0)) and sum(after.values()) == pytest.approx(1.0)


# ---- minimum_vfh -------------------------------------------------------------------------------------------


def test_minimum_vfh_gives_the_person_all_of_free_space():
    for stick in ((0.5, 0.4), (0.2, -0.9), (0.0, 0.5), (-0.3, 0.2)):
        assert minimum_vfh.minimum_vfh(tick(stick), {}).command == pytest.approx(stick)


def test_minimum_vfh_goes_round_a_post_on_the_nearer_side():
    # a post ahead, 0.1 m to the right of the stick's line: the lane to the left of it costs less than that to the right
    result = minimum_vfh.minimum_vfh(tick((0.5, 0.0), points=[(1.3, -0.1)]), {})
    assert result.command.w > 0.05 and result.command.v > 0.2
    mirrored = minimum_vfh.minimum_vfh(tick((0.5, 0.0), points=[(1.3, 0.1)]), {})
    assert mirrored.command == pytest.approx((result.command.v, -result.command.w), abs=1e-4)


def test_minimum_vfh_fits_through_a_door_in_door_mode_only():
    # a gap of 0.80 m: the lane is 0.65 m and twice the margin, 0.85 m without and 0.77 m with door mode
    jambs = np.concatenate((wall(1.0, 0.40, 1.6), wall(1.0, -1.6, -0.39)))
    closed = minimum_vfh.minimum_vfh(tick((0.5, 0.0), points=jambs), {})
    through = minimum_vfh.minimum_vfh(tick((0.5, 0.0), points=jambs, doorway=doorway(1.0, 0.0)), {})
    assert closed.command.v < 0.35 and abs(closed.command.w) > 0.05  # looks for another way, and slowly
    assert through.command == pytest.approx((0.5, 0.0)) and through.reason.startswith("door mode")


# ---- surroundings ------------------------------------------------------------------------------------------


def test_free_distances_of_lanes():
    # a post 2 m ahead: 1.3 m before the front edge; turned left by 45 degrees it lies 1.41 m beside the lane
    free = surroundings.free_distances(np.array([[2.0, 0.0]]), np.radians([0.0, 45.0]), 0.325, 0.70, 3.0)
    assert free == pytest.approx([1.3, 3.0])
    # beside the chair, in the lane of a turn to the left: no way at all
    beside = surroundings.free_distances(np.array([[0.1, 0.5]]), np.radians([80.0]), 0.325, 0.70, 3.0)
    assert beside == pytest.approx([0.0])
