"""Simulated users: what they do, on a kinematic chair with the limiter, dead time and lag."""
import numpy as np
import pytest

from wheelchair_shared_control import footprint, parameters, se2, users
from wheelchair_shared_control.assistance import ASSISTING, DETECTING, FAULT, MANUAL
from wheelchair_shared_control.ground import from_world, room
from wheelchair_shared_control.limiter import Limiter
from wheelchair_shared_control.simulation import outlines, scenes, world
from wheelchair_shared_control.values import STOP, Odometry, Twist
from wheelchair_shared_control.way_plan import crossing_line, plan

DT, TICK = 0.025, 2  # s; user's commands at 20 Hz
DOOR = np.zeros(3)  # in the scenes too the tests look from the door's frame


@pytest.fixture(scope="module")
def settings():
    return parameters.load("users")


class Ride:
    """A user on a chair that goes where the stick says, ``log`` rows of t, pose in the door's frame, stick."""

    def __init__(self, settings, name, start, world=None, door=DOOR, seed=1, button=users.NEVER):
        self.user = users.make(name, settings, door, np.random.default_rng(seed), world=world, button=button)
        self.door, self.pose = door, se2.compose(door, np.array(start, dtype=float))
        self.chair = footprint.from_settings(settings.wheelchair)
        self.limiter = Limiter(settings.wheelchair.limits)
        self.actuation = settings.wheelchair.actuation
        self.shapes = None if world is None else outlines.from_world(world)
        self.v = self.w = self.time = 0.0
        self.sent, self.log, self.presses, self.clearance = [], [], [], np.inf
        self.command, self.steps = STOP, 0

    @property
    def local(self):
        """Pose in the door's frame."""
        return se2.compose(se2.inverse(self.door), self.pose)

    def run(self, seconds, state=MANUAL, until=None):
        for _ in range(int(round(seconds / DT))):
            if self.steps % TICK == 0:
                action = self.user.update(self.time, Odometry(self.time, self.pose, Twist(self.v, self.w)), state)
                self.command = action.command
                self.log.append((self.time, *self.local, *action.command))
                if action.press:
                    self.presses.append(self.time)
                if self.shapes is not None:
                    outline = footprint.corners(self.chair, self.pose)
                    self.clearance = min(self.clearance, outlines.clearance(self.shapes, outline))
                if until is not None and until(self):
                    return True
            self.sent.append(self.limiter.step(self.command, DT))
            acting = self.sent[max(0, len(self.sent) - 1 - int(self.actuation.dead_time / DT))]
            share = DT / self.actuation.lag
            self.v += share * (acting.v - self.v)
            self.w += share * (acting.w - self.w)
            self.pose = se2.integrate(self.pose, self.v, self.w, DT)
            self.time += DT
            self.steps += 1
        return False

    def column(self, number):
        return np.array([row[number] for row in self.log])


def crossed(ride):
    """Rearmost point of the footprint 0.6 m past the plane (design, section 4)."""
    outline = se2.transform_points(se2.inverse(ride.door), footprint.corners(ride.chair, ride.pose))
    return outline[:, 0].min() >= 0.6


def scene_ride(settings, name="goal_directed", width=0.9, start=(-2.2, 0.6, -0.5), scene="open", **rest):
    built = scenes.build(scene, door_width=width)
    return Ride(settings, name, start, built, built.doors[0].pose, **rest)


# ---- goal_directed -------------------------------------------------------------------------------------


@pytest.mark.parametrize("title, width, start", [
    ("from afar, straight ahead", 0.9, (-3.0, 0.0, 0.0)),
    ("near and far beside the axis, looking away from it", 0.9, (-1.5, 0.8, np.radians(45.0))),
    ("a narrow door, 5 cm a side", 0.75, (-2.2, -0.5, np.radians(-30.0))),
])
def test_a_competent_person_crosses_without_touching(settings, title, width, start):
    ride = scene_ride(settings, width=width, start=start)
    assert ride.run(40.0, until=crossed), title
    assert ride.clearance > 0.0, title


def test_the_person_is_square_on_the_axis_before_the_gap(settings):
    ride = scene_ride(settings, start=(-1.6, -0.8, 0.3))
    ride.run(40.0, until=crossed)
    x, y, yaw = ride.column(1), ride.column(2), ride.column(3)
    # at 0.8 m before the plane on the last way in: the front edge is still 0.1 m before it
    at = np.nonzero(x < -0.8)[0][-1]
    assert abs(y[at]) < 0.05
    assert abs(yaw[at]) < np.radians(6.0)


def test_beside_a_wall_the_person_drives_along_it_before_turning_in(settings):
    # A corridor 1.8 m wide along the door's wall, the chair parked in it 2 m beside the door:
    #
    #   =======| door |==========   x = 0
    #                     [>      chair heading for the door, 0.2 m from the far wall
    #   =========================   x = -1.8
    corridor = [
        world.box(0.0, 0.45 + 2.0, 1.25, 0.0, 0.12, 4.0, 2.5),
        world.box(0.0, -0.45 - 2.0, 1.25, 0.0, 0.12, 4.0, 2.5),
        world.box(-1.86, 0.0, 1.25, 0.0, 0.12, 9.0, 2.5),
    ]
    built = world.make(corridor, ["left", "right", "far"])
    ride = Ride(settings, "goal_directed", (-1.25, -2.0, np.pi / 2.0), built)
    assert ride.run(50.0, until=crossed)
    assert ride.clearance > 0.0


def test_a_gap_that_a_wall_narrows_on_one_side_is_crossed_beside_its_middle(settings):
    built = world.make([
        world.box(0.0, 0.5 + 1.0, 1.25, 0.0, 0.12, 2.0, 2.5),
        world.box(0.0, -0.5 - 1.0, 1.25, 0.0, 0.12, 2.0, 2.5),
        world.box(0.6, -0.5, 1.25, 0.0, 1.0, 0.1, 2.5),  # 5 cm into the way of the axis' right half
    ], ["left", "right", "narrow"])
    ground = from_world(built, DOOR)
    chair = footprint.from_settings(settings.wheelchair)
    line = crossing_line(settings, chair, ground)
    x = np.linspace(-0.9, 0.9, 30)
    on_axis = room(ground, chair, np.column_stack((x, 0.0 * x, 0.0 * x))).min()
    on_line = room(ground, chair, se2.compose(line, np.column_stack((x, 0.0 * x, 0.0 * x)))).min()
    assert line[1] > 0.0
    assert on_line > on_axis


def test_in_a_plain_wall_the_line_is_the_doors_axis(settings):
    built = scenes.build("open")
    ground = from_world(built, built.doors[0].pose)
    chair = footprint.from_settings(settings.wheelchair)
    assert crossing_line(settings, chair, ground) == pytest.approx((0.0, 0.0, 0.0))


def test_room_is_the_distance_from_the_outline_to_the_wall(settings):
    # Wall face at x = -0.06; front edge 0.70 m ahead of base_link at -1.06: 0.30 m, as good as the cells are
    built = scenes.build("open")
    ground = from_world(built, built.doors[0].pose)
    chair = footprint.from_settings(settings.wheelchair)
    assert room(ground, chair, [-1.06, 1.5, 0.0])[0] == pytest.approx(0.30, abs=0.02)
    assert room(ground, chair, [0.0, 0.0, 0.0])[0] == pytest.approx(0.45 - 0.325, abs=0.02)
    assert room(ground, chair, [0.0, 0.3, 0.0])[0] <= 0.0


def test_the_way_leads_through_the_gap_on_the_axis(settings):
    chair = footprint.from_settings(settings.wheelchair)
    legs = plan(np.array([-2.0, 0.7, 0.2]), settings, chair)
    last = legs[-1]
    assert last.start[0] <= -0.9 and last.end[0] > 0.6
    assert last.start[1] == last.end[1] == 0.0


def test_equal_seeds_give_equal_sticks_and_others_do_not(settings):
    logs = []
    for seed in (3, 3, 4):
        ride = Ride(settings, "goal_directed", (-2.0, 0.3, 0.1), seed=seed)
        ride.run(3.0)
        logs.append(ride.log)
    assert logs[0] == logs[1]
    assert logs[0] != logs[2]


# ---- held --------------------------------------------------------------------------------------------------------


def held_ride(settings, start, state, seconds=12.0, scene="open", **rest):
    """A chair that no command moves; rows of the log."""
    ride = scene_ride(settings, start=start, scene=scene, **rest)
    ride.limiter.step = lambda command, dt: STOP
    ride.run(seconds, state=state)
    return ride


def pulls(ride):
    """(begin, length) [s] of every stretch with the stick pulled back as far as ends the assistance."""
    limit = parameters.load("doorway_assistant").cancel.stick_back
    back, time, found = ride.column(4) <= -limit, ride.column(0), []
    for k in np.flatnonzero(back[1:] & ~back[:-1]) + 1:
        end = len(time) - 1 if back[k:].all() else k + int(np.argmin(back[k:]))
        found.append((time[k], time[end] - time[k]))
    return found


def test_who_is_held_while_assisted_pulls_back_shorter_than_ends_the_assistance(settings):
    ride = held_ride(settings, (-1.5, 0.3, -0.3), ASSISTING)
    found = pulls(ride)
    assert len(found) >= 2
    assert found[0][0] > settings.drive.stuck_time
    assert all(0.5 < length < parameters.load("doorway_assistant").cancel.stick_time - 0.3 for _, length in found)
    assert ride.column(4).max() > 0.1  # and pushes on in between


def test_not_where_there_is_no_room_behind(settings):
    rear = footprint.from_settings(settings.wheelchair).rear
    for behind, pulled in ((0.05, False), (0.30, True)):  # m to the room's right wall
        start = (-2.0, -2.5 + behind - rear, np.pi / 2.0)
        assert bool(pulls(held_ride(settings, start, ASSISTING))) == pulled, behind


def test_the_pull_ends_before_a_wall_behind(settings):
    rear = footprint.from_settings(settings.wheelchair).rear
    ride = scene_ride(settings, start=(-2.0, -2.5 + 0.25 - rear, np.pi / 2.0))
    step = ride.limiter.step
    ride.limiter.step = lambda command, dt: step(Twist(min(command.v, 0.0), 0.0), dt)
    ride.run(8.0, state=ASSISTING)
    assert pulls(ride)
    assert ride.local[1] < -2.5 + 0.22 - rear
    assert ride.clearance > 0.05


@pytest.mark.parametrize("y, yaw", [(0.05, 0.1), (0.05, -0.1), (0.0, 0.2), (-0.1, 0.0)])
def test_after_the_pull_the_person_goes_on_through_the_door(settings, y, yaw):
    """Held with the front in the door, where a way planned anew might begin behind the chair."""
    ride = scene_ride(settings, start=(-0.78, y, yaw))
    step = ride.limiter.step
    # ahead it is held until it has come back a little; the other half of the stick is a planner's that sends nothing
    ride.limiter.step = lambda command, dt: step(
        Twist(0.5 * (command.v if held.back else min(command.v, 0.0)), command.w if held.back else 0.0), dt)
    held = Held()
    ride.run(20.0, state=ASSISTING, until=lambda ride: held.see(ride.local[0] < -0.86) or crossed(ride))
    assert held.back and pulls(ride)
    assert np.abs(ride.column(3)).max() < 0.6
    assert crossed(ride)


class Held:
    """Whether something has ever been seen."""

    back = False

    def see(self, now):
        self.back = self.back or now
        return False


def test_who_was_turning_when_held_turns_on_the_spot_again_after_the_pull(settings):
    ride = scene_ride(settings, start=(-2.4, 0.8, 1.2))
    ride.limiter.step = lambda command, dt: STOP
    ride.run(3.0, state=ASSISTING)
    assert ride.command.v < -0.1  # pulled
    ride.run(2.0, state=ASSISTING)
    assert abs(ride.command.v) < 0.05 and abs(ride.command.w) > 0.3


def test_the_time_until_the_assistance_begins_does_not_count_as_held(settings):
    ride = scene_ride(settings, start=(-2.0, 0.0, np.radians(40.0)), button=users.FACE_FIRST)
    assert ride.run(20.0, until=lambda ride: ride.presses)
    ride.run(3.0, state=DETECTING)
    ride.run(2.0, state=ASSISTING)
    assert ride.user.began and not pulls(ride)


def test_who_cannot_turn_to_the_gap_backs_off_and_turns_there(settings):
    ride = scene_ride(settings, start=(-2.0, 0.0, np.radians(40.0)), button=users.FACE_FIRST)
    step = ride.limiter.step

    def no_turn_yet(command, dt):
        free = ride.local[0] < -2.1
        return step(command if free else Twist(command.v, 0.0), dt)

    ride.limiter.step = no_turn_yet
    assert ride.run(12.0, until=lambda ride: ride.presses)
    assert ride.local[0] < -2.1


# ---- the others ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name, w", [("hard_left", 1.0), ("hard_right", -1.0)])
def test_the_stress_test_begins_one_metre_and_a_half_before_the_plane(settings, name, w):
    ride = Ride(settings, name, (-2.5, 0.0, 0.0))
    ride.run(6.0)
    pushed = (ride.column(4) == 0.35) & (ride.column(5) == w)
    first = int(np.argmax(pushed))
    assert pushed[first:].all() and not pushed[:first].any()
    assert ride.column(1)[first] == pytest.approx(-1.5, abs=0.06)  # within a tick of driving, and the delay's belief


def test_away_turns_its_back_on_the_door_and_leaves(settings):
    ride = Ride(settings, "away", (-2.0, 0.3, 0.2))
    ride.run(12.0)
    assert np.hypot(*ride.local[:2]) > 3.0


def test_frozen_holds_what_the_stick_said_after_the_first_second(settings):
    ride = Ride(settings, "frozen", (-2.5, 0.0, 0.0))
    ride.run(5.0)
    late = ride.column(0) > 1.1
    assert len(set(zip(ride.column(4)[late], ride.column(5)[late]))) == 1
    assert ride.column(4)[late][0] > 0.1


def test_a_tremor_shakes_the_turn_rate_between_four_and_seven_hertz(settings):
    settings = settings.replace(**{"noise/turn": 0.0, "noise/speed": 0.0, "noise/aim": 0.0})
    ride = Ride(settings, "tremor", (-3.0, 0.0, 0.0))
    calm = Ride(settings, "goal_directed", (-3.0, 0.0, 0.0))
    ride.run(4.0)
    calm.run(4.0)
    shake = ride.column(5)
    spectrum = np.abs(np.fft.rfft(shake - shake.mean()))
    highest = np.fft.rfftfreq(len(shake), 0.05)[np.argmax(spectrum)]
    assert 3.8 <= highest <= 7.2
    # amplitude 0.3 rad/s: a sine's standard deviation is 0.3 / sqrt(2) = 0.21
    assert np.std(shake) == pytest.approx(0.21, abs=0.06)
    assert np.std(calm.column(5)) < 0.05


def test_switches_know_only_on_and_off(settings):
    ride = Ride(settings, "switch", (-2.5, 0.5, -0.3))
    ride.run(10.0)
    on = settings.switch
    assert set(np.round(ride.column(4), 9)) <= {-on.speed, 0.0, on.speed}
    assert set(np.round(ride.column(5), 9)) <= {-on.turn, 0.0, on.turn}
    assert np.abs(ride.column(5)).max() > 0.0


def test_random_wanders_about_its_mean_within_the_chairs_limits(settings):
    user = users.make("random", settings, DOOR, np.random.default_rng(5), button=users.NEVER)
    at = Odometry(0.0, np.array([-2.0, 0.0, 0.0]), STOP)
    sticks = np.array([user.update(0.05 * k, at._replace(stamp=0.05 * k)).command for k in range(2000)])
    limits, wander = settings.wheelchair.limits, settings.random
    assert np.abs(sticks[:, 0]).max() <= limits.speed and np.abs(sticks[:, 1]).max() <= limits.turn_rate
    # 100 s at a correlation time of 1 s are about 50 independent draws: 3 standard errors are 0.42 of one
    assert sticks[:, 0].mean() == pytest.approx(wander.speed_mean, abs=0.42 * wander.speed)
    # correlation exp(-0.05 / 1) from one tick to the next
    assert np.corrcoef(sticks[:-1, 1], sticks[1:, 1])[0, 1] == pytest.approx(np.exp(-0.05), abs=0.03)


# ---- the button ----------------------------------------------------------------------------------------


def test_the_person_faces_the_gap_stands_and_presses_x(settings):
    ride = Ride(settings, "hard_left", (-2.0, 0.5, np.radians(35.0)), button=users.FACE_FIRST)
    assert ride.run(15.0, until=lambda r: r.presses)
    x, y, yaw = ride.local
    bearing = float(se2.wrap_angle(np.arctan2(-y, -x) - yaw))
    assert abs(bearing) <= np.radians(2.5)
    assert abs(ride.v) < 0.02 and abs(ride.w) < 0.03
    assert np.hypot(x + 2.0, y - 0.5) < 0.05  # turned on the spot
    assert not ride.user.began


def test_what_the_name_says_begins_when_the_assistance_is_accepted(settings):
    ride = Ride(settings, "goal_directed", (-2.0, 0.0, 0.0), button=users.FACE_FIRST)
    ride.run(10.0, until=lambda r: r.presses)
    ride.run(2.0, state=DETECTING)
    assert not ride.user.began and ride.command == STOP
    ride.run(1.0, state=ASSISTING)
    assert ride.user.began and ride.command.v > 0.1
    assert np.ptp(ride.presses) < 0.3  # pressed once, for a moment


@pytest.mark.parametrize("state", [MANUAL, FAULT])
def test_or_when_it_has_failed(settings, state):
    ride = Ride(settings, "goal_directed", (-2.0, 0.0, 0.0), button=users.AT_ONCE)
    ride.run(1.0, state=DETECTING)
    assert not ride.user.began
    ride.run(0.5, state=state)
    assert ride.user.began


# ---- users that are not there, users from a file ------------------------------------------------------


@pytest.mark.parametrize("name", ["goal_directed", "tremor"])
def test_after_a_fault_the_person_lets_the_stick_go_once(settings, name):
    ride = Ride(settings, name, (-2.6, 0.0, 0.0))
    ride.run(1.0, state=ASSISTING)
    before = len(ride.log)
    ride.run(2.0, state=FAULT)
    stick = np.hypot(ride.column(4), ride.column(5))
    still = stick[before:] == 0.0
    assert still[0] and 2 <= still.sum() <= 10 and not still[int(still.sum()):].any()


def test_a_user_from_a_file_does_its_steps_in_turn(settings, tmp_path):
    path = tmp_path / "hasty.yaml"
    path.write_text(
        "settings: {drive/cruise: 0.3}\n"
        "steps:\n"
        "- {do: goal_directed, distance: 2.0}\n"
        "- {do: push, v: 0.1, w: -0.4, seconds: 1.0}\n"
        "- {do: hold}\n"
    )
    ride = Ride(settings, str(path), (-2.6, 0.0, 0.0))
    ride.run(8.0)
    pushed = (ride.column(4) == 0.1) & (ride.column(5) == -0.4)
    first = int(np.argmax(pushed))
    assert ride.column(1)[first] == pytest.approx(-2.0, abs=0.06)
    assert pushed[first:].all()  # the last step holds what the one before pushed
    assert ride.column(4)[:first].max() < 0.4


@pytest.mark.parametrize("text, words", [
    ("steps: []\n", "at least one step"),
    ("steps: [{do: fly}]\n", "do is 'fly'"),
    ("steps: [{do: push, v: fast}]\n", "v is 'fast', must be a finite number"),
    ("steps: [{do: push, speed: 1}]\n", "unknown key 'speed'"),
    ("steps: [{do: hold, hand: third}]\n", "hand is 'third'"),
    ("settings: {drive/cruise: 9.0}\nsteps: [{do: hold}]\n", "drive/cruise"),
    ("steps: [{do: push, v: 0.2, seconds: -3}]\n", "seconds is -3, must be above 0"),
    ("steps: [{do: push, v: 55}]\n", "v is 55, the chair's limit is"),
    ("steps: [{do: hold, v: 0.2}]\n", "v belongs to 'push', not to 'hold'"),
    ("steps: [{do: away}, {do: hold}]\n", "step 1 needs an end"),
    ("people: 3\n", "unknown key 'people'"),
    ("1: 2\npeople: 3\n", "unknown key '1'"),
    ("steps: [{do: [push]}]\n", "do is"),
    ("steps: [{do: push, 1: 2, speed: 1}]\n", "unknown key '1'"),
    ("- 1\n", "no mapping"),
])
def test_a_file_that_is_no_user_is_refused_with_its_name(settings, tmp_path, text, words):
    path = tmp_path / "user.yaml"
    path.write_text(text)
    with pytest.raises(users.UserError, match=words) as refused:
        users.make(str(path), settings, DOOR, np.random.default_rng(1))
    assert "user.yaml" in str(refused.value)


def test_an_unknown_user_is_refused_with_the_names_there_are(settings):
    with pytest.raises(users.UserError, match="unknown user 'hasty': one of goal_directed hard_left"):
        users.make("hasty", settings, DOOR, np.random.default_rng(1))
