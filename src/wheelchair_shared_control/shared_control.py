"""Shared control: one tick from the ages of all inputs to the command that may be sent, with its reason.

Order: ages, policy (while assisting), limiter, guard. Faults are remembered here; time comes in as ``now``.
"""
import math
from typing import Any, NamedTuple, Optional, Tuple

import numpy as np

from wheelchair_shared_control import blending, features, moving, rectangle
from wheelchair_shared_control import footprint as outline
from wheelchair_shared_control.assistance import ASSISTING, FAULT, MANUAL
from wheelchair_shared_control.grid import Grid
from wheelchair_shared_control.guard import DEGRADED, FREE, STOPPED, Guard
from wheelchair_shared_control.limiter import Limiter, within_limits
from wheelchair_shared_control.ranging import RangePoints
from wheelchair_shared_control.values import CLOCK_SLIP, STOP, Doorway, Odometry, Ranges, Twist

NEVER = -math.inf
WAITS, CENTRE = "waiting for", "centre the stick to drive on"  # in a reason, read by referee and experiments


class Inputs(NamedTuple):
    """What the blender last received; every ``stamp`` is in seconds on the clock of ``now``.

    ``user_stamp``, ``planner_stamp``, ``grid_received`` are times of arrival (a Twist has no stamp);
    ``prediction_stamp`` is when the question was asked, NaN for just now. ``user_planar``: whether the message's
    other four components were 0. ``ranges.stamp`` may be one stamp or six. ``model_reason`` says why there is no
    prediction. ``assistant_gone``: nobody is left who could end the assistance.
    """

    now: float
    user: Optional[Twist] = None
    user_stamp: float = NEVER
    planner: Optional[Twist] = None
    planner_stamp: float = NEVER
    odometry: Optional[Odometry] = None
    grid: Optional[Grid] = None
    grid_received: float = NEVER
    ranges: Optional[Ranges] = None
    assistance: int = MANUAL
    doorway: Optional[Doorway] = None
    doorways: Tuple[Doorway, ...] = ()
    goal: Optional[np.ndarray] = None
    prediction_stamp: float = math.nan
    model_reason: str = ""
    user_planar: bool = True
    planner_planar: bool = True
    assistant_gone: bool = False


class State(NamedTuple):
    """All that was known and decided in one tick: the fields of ``BlendState``, NaN or None where absent.

    ``blended`` is the command before the limiter, None where there was none; ``sent`` is None for silence.
    ``stopped``: guard or fault held the chair. ``assisting``: a policy made the command. ``fault``: why the
    assistance ended, until it is asked for again. ``ages`` [s] by input, for the diagnostics. ``guard_point``
    (2,) is what the guard saw, in odom.
    """

    stamp: float
    user: Optional[Twist]
    planner: Optional[Twist]
    blended: Optional[Twist]
    sent: Optional[Twist]
    d_l: float
    d_f: float
    d_r: float
    v: float
    mean_l: float
    mean_r: float
    sigma_l: float
    sigma_r: float
    sigma: float
    beta: Optional[float]
    log_density: float
    clearance: float
    guard: int
    policy: str
    reason: str
    stopped: bool
    assisting: bool
    fault: str
    ages: dict
    guard_point: Any = None


class SharedControl:
    """The blender without ROS; memory of limiter, guard, faults and the policy.

    ``density_floor`` is the 5 % quantile of the task model's training set (``learned_confidence`` needs it); it
    may be set at any time. ``guard_on`` None takes it from the settings. Raises PolicyError.
    """

    def __init__(self, settings, policy_name=None, guard_on=None, density_floor=math.nan):
        self.settings = settings
        self.policy_name = settings.policy if policy_name is None else policy_name
        self.guard_on = settings.guard if guard_on is None else guard_on
        self.density_floor = density_floor
        self._policy = blending.load_policy(self.policy_name)
        blending.prepare(self._policy, settings)
        self._needs_prediction = blending.needs_prediction(self.policy_name)
        self._needs_planner = blending.needs_planner(self.policy_name)
        self._footprint = outline.from_settings(settings.wheelchair)
        self.limiter = Limiter(settings.wheelchair.limits)
        self.guard = Guard(settings)
        self._ranges = RangePoints(settings.wheelchair)
        self._moving = moving.MovingCells(self._footprint)
        self.reset()

    def reset(self):
        """As after a start: nothing received, nothing sent, no fault."""
        self.limiter.reset()
        self.guard.reset()
        self._ranges.reset()
        self._moving.reset()
        self._memory = {}
        self._started = None
        self._last = None
        self._assistance = MANUAL
        self._assisting_since = math.inf
        self._fault = ""
        self._centre = ""  # why the stick must be centred before the chair moves again
        self._dead_costmap = False
        self._late, self._late_since = "", None  # the task model's answer: why it is late, and since when
        self._silent = True
        self._by_policy = False
        self._cached = (None, None)
        self._of_old_clock = {}  # times of arrival by another clock: how old that is, nobody knows

    def warm_up(self):
        """Compile (or load) what is compiled, so that the first tick is as fast as any; then forget it."""
        grid = Grid(np.full((40, 40), -1, dtype=np.int8), 0.05, (-1.0, -1.0), 0.0)
        grid.cells[20:22, 38] = 100
        grid.cells.setflags(write=False)  # as a grid that came as a message: another form of the kernels
        still = Odometry(0.0, np.zeros(3), STOP)
        inputs = Inputs(
            0.0, Twist(0.3, 0.3), 0.0, Twist(0.3, 0.0), 0.0, still, grid, 0.0, Ranges(0.0, np.full(6, np.inf)),
            goal=np.array([2.0, 0.0, 0.0]),
        )
        rectangle.signed_distance(2.0, 0.0, 0.7, -0.35, 0.3)  # only asked when the guard stops the chair
        for step in range(3):
            now = step * 0.1
            self.query(inputs)
            self.update(
                inputs._replace(
                    now=now, user_stamp=now, odometry=still._replace(stamp=now), grid=grid._replace(stamp=now),
                    grid_received=now, ranges=Ranges(now, np.full(6, 0.6)), planner_stamp=now,
                    assistance=ASSISTING if step else MANUAL,  # some policies have kernels of their own
                )
            )
        self.reset()

    # ---- features ----------------------------------------------------------------------------------------

    def query(self, inputs):
        """What the task model is to be asked: (d_l, d_f, d_r, v), or None without odometry or grid."""
        if inputs.grid is None or inputs.odometry is None or not _finite(inputs.odometry):
            return None
        d_l, d_f, d_r = self._features(inputs)
        return d_l, d_f, d_r, min(abs(inputs.odometry.twist.v), self.settings.wheelchair.limits.speed)

    def _features(self, inputs):
        key = (id(inputs.grid.cells), inputs.grid.stamp, tuple(inputs.odometry.pose))
        if key != self._cached[0]:
            values = features.distances(
                inputs.grid, inputs.odometry.pose, self._footprint, max_range=self.settings.max_range
            )
            self._cached = (key, tuple(float(value) for value in values))
        return self._cached[1]

    # ---- one tick ----------------------------------------------------------------------------------------

    def update(self, inputs, prediction=None):
        """One tick: decides what is sent now. ``prediction`` is the task model's answer, or None."""
        now, limits = inputs.now, self.settings.wheelchair.limits
        if self._last is not None and self._last - CLOCK_SLIP <= now < self._last:
            now = self._last  # time stands until the clock is there again
            inputs = inputs._replace(now=now)
        if self._last is not None and now < self._last:
            self.reset()  # the clock was set back
            self._of_old_clock = {name: stamp for name, stamp in _arrivals(inputs) if stamp > now}
        if self._of_old_clock:
            inputs = inputs._replace(**{
                name: NEVER for name, stamp in _arrivals(inputs) if self._of_old_clock.get(name) == stamp
            })
        if self._started is None:
            self._started = now
        dt = 1.0 / self.settings.rate if self._last is None else min(max(now - self._last, 1e-3), 0.1)
        self._last = now

        ages = self._ages(inputs, prediction)
        sensors = self._take_sensors(inputs, ages)
        user_problem = self._user_problem(inputs, ages)
        self._follow_assistance(inputs, ages, prediction, sensors)
        alone = self.policy_name == "planner" and self._assisting(inputs)
        user = STOP if user_problem else within_limits(inputs.user, limits)
        if blending.at_rest(user, self.settings):
            user = STOP
            if self._centre and not user_problem:
                self._centre = ""

        result, blended, stopped, drives = None, None, True, False
        if sensors.problem:
            reason = sensors.problem
        elif user_problem and not alone:
            reason = user_problem
        elif self._centre and not alone:
            reason = "%s; %s" % (self._centre, CENTRE)
        elif self._late:
            reason = self._late
        else:
            drives, stopped = True, False
            result, reason = self._command(inputs, prediction, user, sensors, ages)
            blended = result.command
        if self._fault and not reason.startswith(self._fault):
            reason = _joined(self._fault, reason)  # the assistant must hear of it, whatever else there is to say
        # ``drives`` False: the command ramps down at the acceleration limit, without regard to jerk
        limited = self.limiter.step(blended, dt) if drives else self.limiter.ramp_down(dt)

        command, guard_state, guard_point = limited, FREE, None
        if self.guard_on and sensors.scene is not None:
            verdict = self.guard.check(limited, now, inputs.odometry, sensors.scene)
            command, guard_state, guard_point = verdict.command, verdict.state, verdict.point
            reason = _joined(reason, verdict.reason)
            self.limiter.sent(command)
        if sensors.degraded:
            guard_state = guard_state if guard_state == STOPPED else DEGRADED
        sent = self._spoken(command, now, alone or not self._absent(inputs, ages))

        features_ = None if sensors.degraded else self.query(inputs)  # of a dead costmap's last grid they are none
        features_ = features_ or (math.nan,) * 4
        learned = prediction if prediction is not None else _NO_PREDICTION
        return State(
            now, inputs.user, inputs.planner, blended, sent, *features_,
            *learned[:4], math.nan if result is None else result.sigma, None if result is None else result.beta,
            learned[4], sensors.clearance, guard_state, self.policy_name, reason,
            stopped or guard_state == STOPPED, self._by_policy and self._assisting(inputs), self._fault, ages,
            guard_point,
        )

    def _command(self, inputs, prediction, user, sensors, ages):
        """The policy's result, or the user's command where nobody assists."""
        self._by_policy = False
        limits = self.settings.wheelchair.limits
        if sensors.degraded:
            cap = self.settings.degraded
            excess = max(abs(user.v) / cap.speed, abs(user.w) / cap.turn_rate, 1.0)
            slow = Twist(user.v / excess, user.w / excess)
            return blending.PolicyResult(slow, None), "costmap is dead: ranges alone, at most %g m/s" % cap.speed
        if not self._assisting(inputs):
            return blending.PolicyResult(user, None), self._fault
        waits = self._waits(inputs, prediction)
        if waits:
            return blending.PolicyResult(user, None), waits
        planner = STOP if inputs.planner is None else within_limits(inputs.planner, limits)
        self._by_policy = True
        if not self._needs_prediction and ages["prediction"] > self.settings.ages.prediction:
            prediction = None  # no fault where a policy can do without
        # copies: whatever a function of somebody's own does to them, guard and graph see the world as it is
        tick = blending.Tick(
            inputs.now, user, planner, np.array(inputs.odometry.pose, dtype=float), inputs.odometry.twist,
            self._features(inputs), sensors.clearance, prediction, self.density_floor,
            _copied(inputs.grid), sensors.scene.still.copy(), _copied(inputs.goal), _copied(inputs.doorway),
            tuple(map(_copied, inputs.doorways)), self.settings,
        )
        try:
            result = blending.decided(self._policy, tick, self._memory)
        except blending.PolicyError as error:
            self._end_assistance(str(error))
            return blending.PolicyResult(STOP, None), self._fault
        if user == STOP and result.command != STOP and self.policy_name != "planner":
            result = blending.STICK_AT_REST  # a function of one's own that forgot it
        return result, result.reason

    def _waits(self, inputs, prediction):
        """What the policy still waits for after the assistance began, in words; the user drives meanwhile."""
        if self._needs_planner and inputs.planner_stamp < self._assisting_since:
            return WAITS + " the planner's first command"
        if self._needs_prediction and prediction is None:
            return WAITS + " the task model's first answer"
        return ""

    # ---- ages and faults ---------------------------------------------------------------------------------

    def _ages(self, inputs, prediction):
        """Age [s] of every input, inf for one that never came."""
        now = inputs.now
        asked = now if math.isnan(inputs.prediction_stamp) else inputs.prediction_stamp
        return {
            "user": math.inf if inputs.user is None else now - inputs.user_stamp,
            "planner": math.inf if inputs.planner is None else now - inputs.planner_stamp,
            "odom": math.inf if inputs.odometry is None else now - inputs.odometry.stamp,
            "costmap": math.inf if inputs.grid is None else now - inputs.grid.stamp,
            "costmap_silence": now - max(inputs.grid_received, self._started),
            "ranges": math.inf,
            "prediction": math.inf if prediction is None else now - asked,
        }

    def _take_sensors(self, inputs, ages):
        """Take odometry, ranges and grid; what is wrong with them, and the scene around the chair."""
        limits, odometry = self.settings.ages, inputs.odometry
        if odometry is None:
            return _Sensors("no odometry yet")
        if not _finite(odometry):
            return _Sensors("odometry is not finite")
        self.guard.stand_on(odometry.pose)
        if inputs.ranges is not None:
            self._ranges.update(inputs.ranges, odometry.pose, inputs.now + limits.ranges)
        ranger, ages["ranges"] = self._ranges.oldest(inputs.now)
        problem = ""
        if abs(ages["odom"]) > limits.odom:
            problem = _too_old("odometry", ages["odom"], limits.odom)
        elif self.settings.rangers and abs(ages["ranges"]) > limits.ranges:
            problem = _too_old("ranger ir_" + ranger, ages["ranges"], limits.ranges)
        dead = ages["costmap_silence"] > limits.costmap_silence
        if dead and not self._dead_costmap:
            self._centre = self._centre or "no costmap for %.1f s" % ages["costmap_silence"]
        elif self._dead_costmap and not dead and self._centre.startswith("no costmap"):
            self._centre = ""
        self._dead_costmap = dead
        if dead and not problem and not self.settings.rangers:
            problem = "no costmap, and no rangers to drive by"
        if not dead and not problem and abs(ages["costmap"]) > limits.costmap:
            problem = _too_old("costmap", ages["costmap"], limits.costmap)
        grid = None if dead else inputs.grid
        # a chair that does without rangers is not stopped by a silent one, and not held by what it read last
        points = self._ranges.points() if self.settings.rangers else self._ranges.points(inputs.now - limits.ranges)
        if grid is not None and ages["costmap"] >= -limits.costmap:
            self._moving.update(grid, odometry.pose)  # which passes over all that is older
        moving_cells = None if grid is None else self._moving
        scene = self.guard.look(grid, odometry.pose, points, moving_cells, self._ranges.walls(inputs.now))
        clearance = min(self.guard.clearance(scene, odometry.pose), self.settings.max_range)
        return _Sensors(problem, scene, clearance, dead)

    def _user_problem(self, inputs, ages):
        if inputs.user is None:
            return "no user's command yet"
        if ages["user"] > self.settings.ages.user:
            return _too_old("user's command", ages["user"], self.settings.ages.user)
        if not np.isfinite(inputs.user).all():
            return "user's command (%g, %g) is not finite" % inputs.user
        if not inputs.user_planar:
            return "user's command leaves the plane: only linear.x and angular.z may differ from 0"
        return ""

    def _absent(self, inputs, ages):
        """Whether nobody holds the stick: no command, or none within its age."""
        return inputs.user is None or ages["user"] > self.settings.ages.user

    def _assisting(self, inputs):
        return inputs.assistance == ASSISTING and not self._fault

    def _follow_assistance(self, inputs, ages, prediction, sensors):
        """Edges of the assistance's state, and the faults that end it here."""
        before, self._assistance = self._assistance, inputs.assistance
        if inputs.assistance == ASSISTING and before != ASSISTING:
            self._memory, self._fault, self._assisting_since, self._by_policy = {}, "", inputs.now, False
        elif before == ASSISTING and inputs.assistance != ASSISTING:
            # Arrival and cancel hand over through the limiter; after a fault the person must let go first.
            # Where the person drove alone anyway, there is nothing to let go of.
            if inputs.assistance == FAULT and not self._fault and blending.leads(self.policy_name):
                self._centre = "the assistance ended with a fault"
            self._fault = ""
        self._late = ""
        if not self._assisting(inputs):
            self._late_since = None
            return
        limits, began = self.settings.ages, inputs.now - self._assisting_since
        heard = self._needs_planner and inputs.planner_stamp >= self._assisting_since  # not of a former assistance
        planner_age, prediction_age = min(ages["planner"], began), min(ages["prediction"], began)
        if prediction_age <= limits.prediction:
            self._late_since = None
        if inputs.assistant_gone:
            self._end_assistance("doorway_assistant is gone")
        elif sensors.degraded and began > limits.costmap_silence:
            # one that is only late, as when all nodes start at once, comes within that time
            self._end_assistance("no costmap")
        elif self._needs_planner and planner_age > limits.planner:
            self._end_assistance(_too_old("planner's command", ages["planner"], limits.planner))
        elif heard and inputs.planner is not None and not np.isfinite(inputs.planner).all():
            self._end_assistance("planner's command (%g, %g) is not finite" % inputs.planner)
        elif heard and not inputs.planner_planar:
            self._end_assistance("planner's command leaves the plane")
        elif self._needs_prediction and prediction_age > limits.prediction:
            # A blender that was held up itself finds its last answer old; the next one is a tick away. So the chair
            # ramps down at once, and the assistance ends where no answer comes for as long again.
            late = _too_old("task model's answer", ages["prediction"], limits.prediction)
            self._late_since = inputs.now if self._late_since is None else self._late_since
            self._late = inputs.model_reason or late
            if inputs.now - self._late_since > limits.prediction:
                self._end_assistance(self._late)
        elif self._needs_prediction and prediction is not None and not _usable(prediction):
            self._end_assistance("task model's answer is not finite")

    def _end_assistance(self, why):
        self._fault = "fault: " + why
        self._centre = self._fault

    def _spoken(self, command, now, somebody):
        """The command to publish: silence (None) once the last zero was said and nobody drives."""
        if somebody or command != STOP:
            self._silent = False
        elif self._silent:
            return None
        else:
            self._silent = True
        self.guard.sent(now, command)
        return command


class _Sensors(NamedTuple):
    problem: str
    scene: Any = None
    clearance: float = math.nan
    degraded: bool = False


_NO_PREDICTION = (math.nan,) * 5


def _arrivals(inputs):
    """What is stamped by its arrival here: (field, time)."""
    return [
        (name, getattr(inputs, name)) for name in ("user_stamp", "planner_stamp", "grid_received", "prediction_stamp")
    ]


def _copied(value):
    """The same with arrays of its own: an array, or a tuple with names (``Grid``, ``Doorway``)."""
    if hasattr(value, "_fields"):
        return value._replace(**{name: _copied(part) for name, part in zip(value._fields, value)})
    return value.copy() if isinstance(value, np.ndarray) else value


def _finite(odometry):
    return bool(np.isfinite(odometry.pose).all() and np.isfinite(odometry.twist).all())


def _usable(prediction):
    """Whether the answer can enter the blend: finite, deviations not negative (the density may be -inf)."""
    return (
        math.isfinite(prediction.sigma_l) and math.isfinite(prediction.sigma_r)
        and min(prediction.sigma_l, prediction.sigma_r) >= 0.0 and not math.isnan(prediction.log_density)
    )


def _too_old(what, age, limit):
    if age > 1e6:  # never, or a stamp of 0
        return "no %s yet" % what
    if age < 0.0:  # another computer's clock: how old it really is, nobody knows
        return "%s is stamped %.1f s in the future, limit %g s" % (what, -age, limit)
    return "%s is %.1f s old, limit %g s" % (what, age, limit)


def _joined(first, second):
    return "; ".join(text for text in (first, second) if text)
