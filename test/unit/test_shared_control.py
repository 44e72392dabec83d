"""Ages, faults, silence and hand-over of the blender, tick by tick, without ROS."""
import math

import numpy as np
import pytest

from wheelchair_shared_control import blending, parameters
from wheelchair_shared_control.assistance import ARRIVED, ASSISTING, FAULT, MANUAL
from wheelchair_shared_control.grid import Grid
from wheelchair_shared_control.guard import DEGRADED, FREE
from wheelchair_shared_control.shared_control import Inputs, SharedControl
from wheelchair_shared_control.task_model import Prediction
from wheelchair_shared_control.values import RANGERS, STOP, Doorway, Odometry, Ranges, Twist

SETTINGS = parameters.load("blender")
LIMITS = SETTINGS.wheelchair.limits
TICK = 1.0 / 30.0
FREE_GROUND = Grid(np.zeros((120, 120), np.int8), 0.05, (-3.0, -3.0), 0.0)
MODEL = Prediction(0.0, 0.0, 0.1, 0.1, 0.0)
CENTRE, AHEAD = Twist(0.0, 0.0), Twist(0.4, 0.0)


class Run:
    """Feeds a blender; an input named in ``dead`` keeps the stamp that it had when it died.

    The chair stands still for the sensors: what is tested is which command leaves the blender.
    """

    def __init__(self, policy="learned_variance", settings=SETTINGS, **kwargs):
        self.control = SharedControl(settings, policy, **kwargs)
        self.now = 100.0
        self.stamps = {}
        self.values = dict(user=AHEAD, planner=Twist(0.4, 0.2), assistance=MANUAL, prediction=MODEL)
        self.values.update(grid=FREE_GROUND, ranges=np.full(6, np.inf), odometry=Odometry(0.0, np.zeros(3), STOP))
        self.dead = set()
        self.log = []

    def inputs(self, **changes):
        for name in ("user", "planner", "odom", "grid", "grid_received", "ranges", "prediction"):
            if name not in self.dead:
                self.stamps[name] = self.now
        values, stamps = self.values, self.stamps
        return Inputs(
            self.now, values["user"], stamps.get("user", -math.inf), values["planner"],
            stamps.get("planner", -math.inf), values["odometry"]._replace(stamp=stamps["odom"]),
            values["grid"]._replace(stamp=stamps["grid"]), stamps["grid_received"],
            Ranges(stamps["ranges"], values["ranges"]), values["assistance"],
            prediction_stamp=stamps.get("prediction", -math.inf),
        )._replace(**changes)

    def go(self, duration, dead=None, changes=None, **values):
        """Tick for ``duration`` [s] with ``values`` changed and exactly the inputs ``dead`` silent."""
        self.values.update(values)
        if dead is not None:
            self.dead = set(dead)
        states = []
        for _ in range(int(round(duration / TICK))):
            self.now += TICK
            states.append(self.control.update(self.inputs(**(changes or {})), self.values["prediction"]))
        self.log += states
        return states


def driving(policy="learned_variance", assistance=MANUAL, **kwargs):
    """A run that has reached its speed."""
    run = Run(policy, **kwargs)
    run.go(0.2)
    states = run.go(2.0, assistance=assistance)
    assert states[-1].sent.v == pytest.approx(0.4)
    return run


def moves(state):
    return state.sent is not None and state.sent != STOP


def assert_ramps_down(states):
    """From 0.4 m/s at 0.8 m/s2 without jerk limit: zero after 0.5 s."""
    speeds = [0.0 if state.sent is None else state.sent.v for state in states]
    drops = -np.diff(speeds)
    assert (drops >= -1e-9).all() and drops.max() <= LIMITS.acceleration * TICK + 1e-9
    moving = [speed for speed in speeds if speed > 0.0]
    assert 0.4 < len(moving) * TICK <= 0.55


# input that dies, seconds until the chair begins to stop, words of the reason
DEATHS = [
    ("user", ["user"], 0.5, "user's command is"),
    ("odometry", ["odom"], 0.3, "odometry is"),
    ("costmap still coming with an old stamp", ["grid"], 0.4, "costmap is"),
    ("rangers", ["ranges"], 0.5, "ranger ir_left_front is"),
]


@pytest.mark.parametrize("title, dead, limit, words", DEATHS, ids=[row[0] for row in DEATHS])
def test_a_stale_input_stops_the_chair_and_recovers_by_itself(title, dead, limit, words):
    run = driving()
    # an input is repeated at most until its time-out
    states = run.go(limit - 2 * TICK, dead=dead)
    assert all(state.sent.v == pytest.approx(0.4) for state in states)
    states = run.go(2.0)
    held = [state for state in states if state.stopped]
    assert len(held) >= len(states) - 4 and words in held[0].reason
    assert_ramps_down(held)
    assert not moves(states[-1])
    states = run.go(2.0, dead=[])
    assert states[-1].sent.v == pytest.approx(0.4) and states[-1].reason == ""


def test_nobody_at_the_stick_is_one_zero_and_then_silence():
    run = driving()
    states = run.go(2.5, dead=["user"])
    sent = [state.sent for state in states]
    first_silence = sent.index(None)
    assert sent[first_silence - 1] == STOP and sent[first_silence - 2] != STOP
    assert all(command is None for command in sent[first_silence:])


def test_nothing_is_said_before_anybody_drives():
    run = Run()
    run.dead = {"user"}
    states = run.go(1.0, user=None)
    assert all(state.sent is None for state in states) and states[-1].reason.endswith("no user's command yet")


def test_a_stopped_chair_is_held_while_somebody_pushes_the_stick():
    run = driving()
    assert run.go(3.0, dead=["odom"])[-1].sent == STOP


@pytest.mark.parametrize("command", [(math.nan, 0.0), (0.3, math.nan), (math.inf, 0.0), (0.3, -math.inf)])
def test_a_users_command_that_is_not_finite_stops_the_chair(command):
    run = driving()
    states = run.go(1.0, user=Twist(*command))
    assert states[0].stopped and "not finite" in states[0].reason and states[-1].sent == STOP
    assert moves(run.go(1.0, user=AHEAD)[-1])


def test_a_users_command_that_leaves_the_plane_stops_the_chair():
    run = driving()
    states = run.go(1.0, changes=dict(user_planar=False))
    assert states[-1].sent == STOP and "leaves the plane" in states[-1].reason


def test_odometry_that_is_not_finite_stops_the_chair():
    run = driving()
    broken = Odometry(0.0, np.array([math.nan, 0.0, 0.0]), STOP)
    states = run.go(1.0, odometry=broken)
    assert states[-1].sent == STOP and states[-1].reason == "odometry is not finite"
    assert moves(run.go(1.0, odometry=broken._replace(pose=np.zeros(3)))[-1])


def test_a_ranger_that_only_says_nan_is_a_dead_one():
    run = driving()
    broken = np.full(6, np.inf)
    broken[5] = np.nan
    states = run.go(2.0, ranges=broken)
    assert states[-1].sent == STOP and "right_rear" in states[-1].reason


@pytest.mark.parametrize(
    "user, sent", [((5.0, 0.0), (0.6, 0.0)), ((0.6, 4.0), (0.15, 1.0)), ((-9.0, 0.0), (-0.6, 0.0))]
)
def test_a_command_beyond_the_limits_keeps_its_arc(user, sent):
    run = Run("user")
    assert run.go(3.0, user=Twist(*user))[-1].sent == pytest.approx(sent)


class TestDegraded:
    def test_a_dead_costmap_lets_the_person_creep_after_centring(self):
        run = driving()
        states = run.go(3.0, dead=["grid", "grid_received"])
        # first the stamp is old, after 1 s the process counts as dead
        assert not moves(states[-1]) and states[-1].guard == DEGRADED and "centre the stick" in states[-1].reason
        run.go(0.2, user=CENTRE)
        states = run.go(2.0, user=Twist(0.6, 0.0))
        assert states[-1].sent.v == pytest.approx(0.15) and states[-1].guard == DEGRADED
        assert math.isnan(states[-1].d_f)  # nobody knows
        assert "ranges alone" in states[-1].reason
        # it comes back: full speed at once, no centring
        assert run.go(2.0, dead=[])[-1].sent.v == pytest.approx(0.6)
        assert run.log[-1].guard == FREE

    def test_the_ranges_still_guard(self):
        run = driving()
        run.go(2.0, dead=["grid", "grid_received"])
        run.go(0.2, user=CENTRE)
        near = np.full(6, np.inf)
        near[0] = 0.16  # 1 cm beside the left front
        states = run.go(1.0, user=Twist(0.0, 0.5), ranges=near)
        assert not moves(states[-1]) and "obstacle" in states[-1].reason

    def test_ends_the_assistance(self):
        run = driving(assistance=ASSISTING)
        assert "no costmap" in run.go(3.0, dead=["grid", "grid_received"])[-1].fault

    def test_a_costmap_that_is_late_does_not_end_the_assistance(self):
        run = Run()
        run.stamps.update(grid=-math.inf, grid_received=-math.inf)
        run.go(2.0, dead=["grid", "grid_received"], user=CENTRE)
        assert run.go(0.7, assistance=ASSISTING)[-1].guard == DEGRADED
        # comes 0.7 s after the button, within 1 s
        assert run.go(2.0, dead=[], user=AHEAD)[-1].assisting and not run.log[-1].fault

    def test_no_costmap_ever(self):
        run = Run()
        run.dead = {"grid", "grid_received"}
        run.stamps.update(grid=-math.inf, grid_received=-math.inf)
        assert not moves(run.go(2.0, changes=dict(grid=None))[-1])
        run.go(0.2, changes=dict(grid=None), user=CENTRE)
        assert run.go(2.0, changes=dict(grid=None), user=AHEAD)[-1].sent.v == pytest.approx(0.15)


# policy, input that dies while assisting, its time-out, words of the fault
FAULTS = [
    ("learned_variance", "planner", 0.5, "planner's command is"),
    ("learned_variance", "prediction", 0.15, "task model's answer is"),
    ("learned_confidence", "prediction", 0.15, "task model's answer is"),
    ("planner", "planner", 0.5, "planner's command is"),
]


@pytest.mark.parametrize("policy, dead, limit, words", FAULTS)
def test_a_stale_partner_ends_the_assistance_and_the_person_drives_on(policy, dead, limit, words):
    run = driving(policy, ASSISTING)
    assert not any(state.fault for state in run.go(limit - 2 * TICK, dead=[dead]))
    states = run.go(1.5)
    assert words in states[-1].fault and states[-1].reason.startswith("fault: ")
    assert not moves(states[-1])
    # the stick still pushed: nothing moves, however long
    assert not moves(run.go(2.0, dead=[])[-1])
    run.go(0.2, user=CENTRE)
    states = run.go(2.0, user=Twist(0.3, -0.2))
    assert states[-1].sent == pytest.approx((0.3, -0.2)) and not states[-1].assisting
    # asked for anew, it assists again
    run.go(0.5, assistance=MANUAL)
    assert run.go(1.0, assistance=ASSISTING, user=AHEAD)[-1].assisting


@pytest.mark.parametrize("policy", ["planner", "learned_confidence", "fixed_share"])
def test_nothing_goes_on_that_nobody_could_end(policy):
    run = driving(policy, ASSISTING)
    assert run.go(0.5)[-1].assisting
    state = run.go(1.0, changes=dict(assistant_gone=True))[-1]
    assert state.fault == "fault: doorway_assistant is gone" and not moves(state)
    run.go(0.2, user=CENTRE)
    assert run.go(2.0, user=Twist(0.3, -0.2))[-1].sent == pytest.approx((0.3, -0.2))
    # when it is back, it says so first
    run.go(0.5, assistance=MANUAL, changes=dict(assistant_gone=False))
    assert run.go(1.0, assistance=ASSISTING, user=AHEAD)[-1].assisting


@pytest.mark.parametrize("policy", ["distance", "fixed_share"])
def test_a_policy_without_model_does_not_miss_it(policy):
    run = driving(policy, ASSISTING)
    state = run.go(1.0, dead=["prediction"], prediction=None)[-1]
    assert state.assisting and not state.fault and math.isnan(state.sigma_l)


def test_the_users_policy_does_not_miss_the_planner():
    run = driving("user", ASSISTING)
    assert run.go(2.0, dead=["planner", "prediction"])[-1].sent.v == pytest.approx(0.4)


def test_a_missing_model_refuses_to_assist_and_lets_the_person_drive():
    run = Run()
    run.dead = {"prediction"}
    run.go(1.0, prediction=None)
    states = run.go(1.5, assistance=ASSISTING, changes=dict(model_reason="no task model: not advertised"))
    assert states[-1].fault == "fault: no task model: not advertised" and not moves(states[-1])
    run.go(0.2, user=CENTRE)
    assert moves(run.go(1.0, user=AHEAD)[-1])


def test_the_planner_has_its_time_from_the_acceptance_on():
    run = Run()
    run.dead = {"planner"}
    run.go(2.0)  # no planner in manual driving
    states = run.go(0.5 - 2 * TICK, assistance=ASSISTING)
    assert not any(state.fault for state in states) and states[-1].sent.v == pytest.approx(0.4)
    assert "waiting for the planner" in states[-1].reason and not states[-1].assisting
    assert run.go(0.2)[-1].fault


@pytest.mark.parametrize("planner", [(math.nan, 0.0), (0.2, math.inf)])
def test_a_planner_that_is_not_finite_ends_the_assistance(planner):
    run = driving(assistance=ASSISTING)
    assert "not finite" in run.go(0.1, planner=Twist(*planner))[-1].fault


@pytest.mark.parametrize("field", ["sigma_l", "sigma_r", "log_density"])
def test_a_prediction_that_is_not_finite_ends_the_assistance(field):
    run = driving(assistance=ASSISTING)
    assert "not finite" in run.go(0.1, prediction=MODEL._replace(**{field: math.nan}))[-1].fault


@pytest.mark.parametrize(
    "body, words",
    [
        ("return Twist(float('nan'), 0.0), None, ''", "not finite"),
        ("return 1 / 0", "policy raised ZeroDivisionError"),
        ("return None", "policy gave None"),
        ("yield 1", "policy gave <generator"),
        ("return 10**400, None, ''", "policy gave (1000"),
        ("import sys; sys.exit(3)", "policy raised SystemExit: 3"),
        ("return (0.1, 0.0), 'half', ''", "policy gave"),
        ("return (0.1, 0.0), None, 3", "policy gave"),
        ("return (0.1, 0.0), float('nan'), ''", "policy gave"),
    ],
)
def test_a_policy_of_ones_own_that_fails_stops_the_chair(tmp_path, body, words):
    path = tmp_path / "bad.py"
    path.write_text(
        "from wheelchair_shared_control.values import Twist\n\ndef bad(tick, memory):\n    %s\n" % body
    )
    run = Run("%s:bad" % path)
    run.go(0.5)
    states = run.go(1.5, assistance=ASSISTING)
    assert words in states[-1].fault and not moves(states[-1])


def test_whatever_a_policy_does_to_its_tick_the_guard_sees_the_world_as_it_is(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "def honest(tick, memory):\n    return tick.user, 1.0, ''\n\n"
        "def other(tick, memory):\n    tick.points[:] += 50.0\n    tick.pose[:] += 1.0\n    tick.grid.cells[:] = 0\n"
        "    tick.grid.surface[:] = 3\n    tick.doorway.jambs[:] = 9.0\n    return tick.user, 1.0, ''\n"
    )
    cells = np.zeros((120, 120), np.int8)
    cells[50:70, 76] = 100  # a wall 0.1 m before the front edge
    surface = np.tile(np.array([0, 3, 0, 3], np.int8), (120, 120, 1))
    door = Doorway(np.array([2.0, 0.0, 0.0]), 0.9, 1.0, np.zeros((2, 2)), np.zeros((3, 3)))
    sent = {}
    for name in ("honest", "other"):
        run = Run("%s:%s" % (path, name))
        grid = Grid(cells, 0.05, (-3.0, -3.0), 0.0, surface)
        states = run.go(2.0, assistance=ASSISTING, grid=grid, changes={"doorway": door})
        assert states[-1].guard != FREE
        sent[name] = states[-1].sent
    assert sent["other"] == sent["honest"] and sent["other"].v < 0.3
    assert np.array_equal(run.values["odometry"].pose, np.zeros(3)) and cells.max() == 100
    assert surface[0, 0].tolist() == [0, 3, 0, 3] and door.jambs.max() == 0.0


def test_a_policy_of_ones_own_is_given_no_answer_of_a_dead_task_model(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text("def mine(tick, memory):\n    return tick.user, None, '' if tick.prediction else 'no model'\n")
    run = Run("%s:mine" % path)
    assert run.go(1.0, assistance=ASSISTING)[-1].reason == ""
    state = run.go(0.5, dead=["prediction"])[-1]
    assert state.reason == "no model" and state.fault == "" and moves(state)


def test_what_the_planner_said_before_the_assistance_does_not_end_it():
    run = Run()
    run.go(0.3, planner=Twist(math.nan, 0.0))
    run.go(1.0, dead=["planner"])
    assert run.go(0.3, assistance=ASSISTING)[-1].fault == ""
    states = run.go(2.0, planner=Twist(0.4, 0.2), dead=[])
    assert all(state.fault == "" for state in states) and moves(states[-1])


@pytest.mark.parametrize("fault", ["here", "of the assistant"])
def test_a_costmap_that_dies_and_returns_after_a_fault_does_not_let_the_stick_drive_on(fault):
    run = driving(assistance=ASSISTING)
    if fault == "here":
        run.go(1.0, dead=["planner"])
        run.go(0.5, dead=["planner"], assistance=FAULT)
    else:
        run.go(0.5, assistance=FAULT)
    run.go(2.0, dead=["grid", "grid_received"])
    states = run.go(2.0, dead=[])
    assert not moves(states[-1]) and "centre the stick" in states[-1].reason
    run.go(0.2, user=CENTRE, assistance=MANUAL)
    assert moves(run.go(1.0, user=AHEAD)[-1])


@pytest.mark.parametrize("policy, held", [("intent", True), ("minimum_vfh", True), ("user", False)])
def test_after_a_fault_of_the_assistant_who_was_led_must_let_go(policy, held):
    run = Run(policy)
    run.go(2.0, assistance=ASSISTING)
    states = run.go(2.0, assistance=FAULT)
    assert moves(states[-1]) != held


def test_a_fault_is_said_first_whatever_else_stops_the_chair():
    run = driving(assistance=ASSISTING)
    states = run.go(1.0, dead=["planner", "user"])
    assert states[-1].fault.startswith("fault: planner's command") and states[-1].reason.startswith("fault:")


def test_ticks_that_a_sensor_stops_are_the_assistance_s():
    run = driving(assistance=ASSISTING)
    states = run.go(0.4, dead=["odom"])
    assert states[-1].assisting and states[-1].stopped and states[-1].blended is None
    assert not run.go(0.4, dead=[], assistance=MANUAL)[-1].assisting


def test_a_reading_of_rangers_that_the_chair_does_without_holds_it_no_longer_than_its_age():
    run = Run("user", SETTINGS.replace(rangers=False))
    run.go(1.0, ranges=np.full(6, 0.10))
    turn = Twist(0.0, 0.5)
    assert run.go(1.0, user=turn)[-1].guard != FREE
    assert run.go(1.0, ranges=np.array([np.nan] + [0.10] * 5))[-1].guard != FREE  # one silent, five speak
    assert run.go(2.0, dead=["ranges"])[-1].guard == FREE


def test_a_policy_of_ones_own_may_return_a_plain_tuple(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text("def half(tick, memory):\n    return (tick.user.v / 2, 0.1), 0.5, 'half as fast'\n")
    run = Run("%s:half" % path)
    state = run.go(2.0, assistance=ASSISTING)[-1]
    assert state.sent == pytest.approx((0.2, 0.1)) and state.beta == 0.5 and state.reason == "half as fast"


def test_a_stick_at_rest_stops_the_chair_also_under_a_policy_that_forgot_it(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text("def lead(tick, memory):\n    return tick.planner, 0.0, 'the planner leads'\n")
    run = Run("%s:lead" % path)
    assert moves(run.go(2.0, assistance=ASSISTING)[-1])
    state = run.go(1.5, user=CENTRE)[-1]
    assert state.sent == STOP and state.reason == "the stick is at rest"


def test_a_policy_of_ones_own_that_cannot_be_prepared_is_refused_in_one_line(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "def half(tick, memory):\n    return tick.user, None, ''\n\n"
        "def prepare(settings):\n    open('/no/such/file')\n\nhalf.prepare = prepare\n"
    )
    with pytest.raises(blending.PolicyError, match="prepare: FileNotFoundError"):
        Run("%s:half" % path)


class TestHandOver:
    @pytest.mark.parametrize("after", [ARRIVED, MANUAL])
    def test_arrival_and_cancel_go_through_the_limiter(self, after):
        run = driving(assistance=ASSISTING)
        before = run.log[-1].sent
        states = run.go(1.0, assistance=after, user=Twist(0.4, -1.0))
        turns = [before.w] + [state.sent.w for state in states]
        assert np.abs(np.diff(turns)).max() <= LIMITS.turn_acceleration * TICK + 1e-9
        assert states[-1].sent == pytest.approx((0.4, -1.0)) and not any(state.stopped for state in states)

    def test_the_assistants_fault_asks_for_centring(self):
        run = driving(assistance=ASSISTING)
        assert not moves(run.go(1.5, assistance=FAULT)[-1])
        run.go(0.2, user=CENTRE)
        assert moves(run.go(0.5, user=AHEAD)[-1])

    def test_the_assistants_fault_does_not_hold_a_person_who_drove_alone(self):
        run = driving("user", assistance=ASSISTING)
        assert all(moves(state) for state in run.go(1.0, assistance=FAULT))

    def test_a_fault_before_it_assisted_holds_nobody(self):
        run = driving()
        assert moves(run.go(1.0, assistance=FAULT)[-1])

    def test_a_stick_at_rest_keeps_the_chair_at_rest(self):
        run = driving(assistance=ASSISTING)
        states = run.go(2.0, user=Twist(0.01, -0.01))
        assert states[-1].sent == STOP and states[-1].beta is None

    def test_a_stick_that_trembles_inside_its_dead_zone_moves_nothing(self):
        assert Run("user").go(1.0, user=Twist(0.019, 0.019))[-1].sent == STOP

    def test_the_planner_alone_needs_nobody(self):
        run = driving("planner", ASSISTING)
        states = run.go(2.0, dead=["user"], planner=Twist(-0.2, 0.0))
        assert states[-1].sent == pytest.approx((-0.2, 0.0))
        assert not moves(run.go(2.0, assistance=ARRIVED)[-1])


def test_the_state_holds_what_entered_the_blend():
    grid = FREE_GROUND._replace(cells=FREE_GROUND.cells.copy())
    grid.cells[:, 90:92] = 100  # x from 1.5 m: 0.8 m ahead of the front edge, cell centre at 0.825
    run = Run(guard_on=False)
    run.go(0.5, grid=grid)
    state = run.go(1.0, assistance=ASSISTING, user=Twist(0.2, 0.5), planner=Twist(0.4, 0.2))[-1]
    beta = math.exp(-0.3 / 0.3)
    assert state.beta == pytest.approx(beta) and state.sigma == pytest.approx(0.3)
    assert state.blended == pytest.approx((0.3, 0.2 + beta * 0.3)) and state.sent == pytest.approx(state.blended)
    # the wall goes on to both sides: its first cell beside the edge is 0.825 m ahead and 0 to 0.05 m beside
    assert (state.d_l, state.d_f, state.d_r, state.v) == pytest.approx((0.825, 0.825, 0.825, 0.0), abs=2e-3)
    assert state.clearance == pytest.approx(0.825, abs=1e-3)
    assert (state.user, state.planner) == ((0.2, 0.5), (0.4, 0.2)) and state.policy == "learned_variance"


def test_the_clock_set_back_is_a_new_start():
    run = driving()
    run.now = 0.0
    run.stamps.clear()
    assert run.go(2.0)[-1].sent.v == pytest.approx(0.4)


@pytest.mark.parametrize("policy", ["user", "learned_variance"])
def test_a_clock_that_is_put_right_by_a_little_is_no_new_start(policy):
    run = driving(policy, assistance=ASSISTING)
    before = run.go(0.5)[-1]
    run.now -= 0.08
    states = run.go(1.0)
    assert all(state.sent == pytest.approx(before.sent, abs=1e-3) and not state.fault for state in states)
    assert all(later.stamp >= earlier.stamp for earlier, later in zip([before] + states, states))


@pytest.mark.parametrize("policy", ["user", "learned_variance"])
def test_what_came_before_the_clock_was_set_back_is_never_fresh_again(policy):
    run = driving(policy, assistance=ASSISTING)
    run.now = 0.0
    states = run.go(101.0 + 3.0, dead=["user", "planner", "prediction"])  # beyond the time at which they died
    assert not any(moves(state) for state in states) and states[-1].reason.endswith("no user's command yet")
    states = run.go(3.0, dead=["planner", "prediction"])
    if policy == "user":
        assert moves(states[-1])
    else:
        assert not any(moves(state) for state in states)
        assert states[-1].fault in ("fault: no planner's command yet", "fault: no task model's answer yet")


def test_a_ranger_from_the_future_stops_the_chair_and_hides_nothing_later():
    run = driving()
    future = np.full(6, run.now)
    future[0] += 1000.0
    states = run.go(1.0, changes={"ranges": Ranges(future, np.full(6, np.inf))})
    assert states[0].stopped and not moves(states[-1])
    assert "ranger ir_left_front is stamped" in states[0].reason and "in the future" in states[0].reason
    near = np.full(6, np.inf)
    near[0] = 0.35  # 0.2 m beside the edge
    state = run.go(1.0, ranges=near)[-1]
    assert not state.stopped and state.clearance == pytest.approx(0.2, abs=0.01)
    # the same one dies
    assert "ranger ir_left_front is" in run.go(1.0, changes={"ranges": Ranges(
        np.r_[run.now, np.full(5, run.now + 1.0)], near)})[-1].reason


def test_a_grid_from_the_future_does_not_end_the_following_of_what_moves():
    run = driving()
    run.go(0.1, changes={"grid": FREE_GROUND._replace(stamp=run.now + 1000.0)})
    run.go(0.1)
    assert run.control._moving.stamp == run.now


def test_odometry_without_stamp_stops_a_moving_chair_at_once_on_the_wall_clock():
    run = Run()
    run.now = 1.79e9
    run.go(2.0)
    states = run.go(1.0, changes={"odometry": Odometry(0.0, np.zeros(3), AHEAD)})
    assert states[0].stopped and states[0].reason == "no odometry yet" and states[-1].sent == STOP


def test_equal_inputs_give_equal_states():
    first, second = driving(assistance=ASSISTING), driving(assistance=ASSISTING)
    assert [state.sent for state in first.log] == [state.sent for state in second.log]


def test_unknown_policy():
    with pytest.raises(blending.PolicyError):
        SharedControl(SETTINGS, "nonsense")


@pytest.mark.parametrize("rangers, presumes", (
    (("left_front", "left_middle"), True), (("left_front",), False), (("left_middle", "left_rear"), False), ((), False),
))
def test_a_wall_is_taken_to_go_on_that_front_and_middle_ranger_read(rangers, presumes):
    """A wall to the left, of which the map holds what lies ahead of 0.85 m: the guard is told of the gap before it."""
    cells = np.zeros((240, 240), np.int8)
    cells[135:137, 154:] = 100  # y = 0.375 to 0.425 m
    ranges = np.full(6, np.inf)
    for ranger in rangers:
        ranges[RANGERS.index(ranger)] = 0.375 - SETTINGS.wheelchair.rangers.y
    run, scenes = Run("user"), []
    look = run.control.guard.look
    run.control.guard.look = lambda *args, **kwargs: scenes.append(look(*args, **kwargs)) or scenes[-1]
    run.go(0.2, user=Twist(0.0, 0.5), grid=Grid(cells, 0.025, (-3.0, -3.0), 0.0), ranges=ranges)
    assert all(bool(len(scene.presumed)) == presumes for scene in scenes) and scenes
    assert all(0.59 < scene.presumed[:, 0].min() and scene.presumed[:, 0].max() < 1.26 for scene in scenes if presumes)
