"""Simulated users: from what a person sees to the stick and the button.

A user is a list of steps (behaviour, until when) and a hand; the named ones are rows of ``SCRIPTS``, others come
from a YAML file. ``make`` gives a ``User``; ``User.update`` is asked about 20 times a second.

A file holds ``steps`` and, where wanted, ``settings`` that differ from config/users.yaml::

    settings: {drive/cruise: 0.3}
    steps:
    - {do: goal_directed, distance: 1.0, hand: tremor}  # until base_link is 1.0 m before the plane
    - {do: push, v: 0.2, w: -0.5, seconds: 2.0}         # m/s, rad/s
    - {do: hold}                                        # as the stick was; the last step has no end

``do`` is a key of ``BEHAVIOURS`` (goal_directed, push, hold, away, random), ``hand`` of ``HANDS`` (tremor, switch).
"""
from typing import NamedTuple, Optional

import numpy as np

from wheelchair_shared_control import parameters, se2
from wheelchair_shared_control.assistance import ARRIVED, ASSISTING, DETECTING, FAULT
from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.footprint import from_settings
from wheelchair_shared_control.person import Eye, Hand, turn_on_the_spot
from wheelchair_shared_control.values import STOP, Twist
from wheelchair_shared_control.way import Way

NEVER, AT_ONCE, FACE_FIRST = "never", "at_once", "face_first"


class UserError(Error):
    """A user is unknown, or its file does not say what it does."""


class UserAction(NamedTuple):
    """The stick and whether X is down."""

    command: Twist
    press: bool


class Step(NamedTuple):
    """One behaviour of ``BEHAVIOURS`` until a time [s] in it, or a distance [m] before the plane, is reached.

    ``command`` is what ``push`` pushes; ``hand`` an entry of ``HANDS`` that changes the stick afterwards.
    """

    behaviour: str
    seconds: float = np.inf
    distance: Optional[float] = None
    command: Twist = STOP
    hand: str = ""


def _hard(sign):
    def script(settings):
        hard = settings.hard
        push = Twist(hard.speed, sign * hard.turn)
        return [Step("goal_directed", distance=hard.distance), Step("push", command=push)]

    return script


# name on the command line -> settings -> steps
SCRIPTS = {
    "goal_directed": lambda settings: [Step("goal_directed")],
    "hard_left": _hard(1.0),
    "hard_right": _hard(-1.0),
    "away": lambda settings: [Step("away")],
    "frozen": lambda settings: [Step("goal_directed", seconds=settings.frozen.after), Step("hold")],
    "tremor": lambda settings: [Step("goal_directed", hand="tremor")],
    "switch": lambda settings: [Step("goal_directed", hand="switch")],
    "random": lambda settings: [Step("random")],
}
NAMES = tuple(SCRIPTS)


def make(name, settings, door_pose_world, rng, world=None, button=FACE_FIRST):
    """A ``User`` before a door.

    ``name`` is one of ``NAMES`` or a YAML file; ``settings`` those of the group ``users``; ``door_pose_world`` (3,)
    the middle of the gap in the plane, yaw in the direction of the crossing; ``rng`` its chance. ``world`` (its
    ``boxes`` and ``meshes``) is what the person sees of the walls; without it the ground counts as free.
    ``button``: "face_first" turns to the gap, stands, presses X (detector in the loop); "at_once" presses
    X and waits; "never" drives by itself. Raises UserError.
    """
    if button not in (NEVER, AT_ONCE, FACE_FIRST):
        raise UserError("button '%s' must be one of never, at_once, face_first" % button)
    if name in SCRIPTS:
        return User(name, SCRIPTS[name](settings), settings, door_pose_world, rng, world, button)
    if not str(name).endswith((".yaml", ".yml")):
        raise UserError("unknown user '%s': one of %s, or a YAML file" % (name, " ".join(NAMES)))
    steps, settings = _from_file(name, settings)
    return User(str(name), steps, settings, door_pose_world, rng, world, button)


class User:
    """A person on the chair; ``update`` gives stick and button."""

    def __init__(self, name, steps, settings, door_pose_world, rng, world=None, button=FACE_FIRST):
        self.name, self.settings = name, settings
        self._door = np.asarray(door_pose_world, dtype=float)
        self._steps, self._index, self._step_since = steps, 0, None
        self._rng = rng
        self._eye, self._hand = Eye(settings), Hand(settings, rng)
        self._aim = settings.noise.aim * float(rng.standard_normal())
        self._way = Way(settings, from_settings(settings.wheelchair), self._door, world)
        self._ask = AskForHelp(settings, button)
        self._command, self._hands = STOP, {}
        self._walk = np.zeros(2)  # the Ornstein-Uhlenbeck process of `random`
        self._last = self._fault_since = None

    @property
    def began(self):
        """Whether what the name says has begun: the button is dealt with."""
        return self._ask.done

    def update(self, now, truth, assistance_state=0):
        """``UserAction`` at ``now`` [s]; ``truth`` is ``Odometry`` in the world, ``assistance_state`` as in
        ``assistance``."""
        pose = se2.compose(se2.inverse(self._door), truth.pose)
        pose[1] -= self._aim
        self._eye.saw(truth.stamp, pose, truth.twist)
        believed, twist = self._eye.believed(now)
        dt = 0.0 if self._last is None else max(0.0, now - self._last)
        self._last = now
        press = False
        if not self._ask.done:
            wanted, press = self._ask.update(now, believed, twist, assistance_state, self._way)
        if self._ask.done:
            command = self._act(now, dt, believed, twist, assistance_state)
        else:
            command = self._hand.update(now, wanted)
        limits = self.settings.wheelchair.limits
        command = Twist(
            float(np.clip(command.v, -limits.speed, limits.speed)),
            float(np.clip(command.w, -limits.turn_rate, limits.turn_rate)),
        )
        self._command = command
        self._eye.pushed(now, command)
        return UserAction(command, press)

    def _act(self, now, dt, pose, twist, assistance_state):
        if self._step_since is None:
            self._step_since = now
        while self._index + 1 < len(self._steps):
            step = self._steps[self._index]
            near = step.distance is not None and -pose[0] <= step.distance
            if not near and now - self._step_since < step.seconds:
                break
            self._index, self._step_since = self._index + 1, now
        step = self._steps[self._index]
        if step.behaviour == "goal_directed" and self._lets_go(now, assistance_state):
            return STOP
        command = BEHAVIOURS[step.behaviour](self, now, dt, pose, twist, assistance_state, step)
        if step.hand:
            if self._index not in self._hands:
                self._hands[self._index] = HANDS[step.hand](self.settings, self._rng)
            command = self._hands[self._index](now, command)
        return command

    def _lets_go(self, now, assistance_state):
        """Whether the stick is let go for a moment, as the chair asks after a fault."""
        if assistance_state != FAULT:
            self._fault_since = None
            return False
        self._fault_since = now if self._fault_since is None else self._fault_since
        return now - self._fault_since < self.settings.button.stand

    # ---- behaviours --------------------------------------------------------------------------------

    def _goal_directed(self, now, dt, pose, twist, assistance_state, step):
        return self._hand.update(now, self._way.steer(now, pose, twist, assistance_state))

    def _push(self, now, dt, pose, twist, assistance_state, step):
        return step.command

    def _hold(self, now, dt, pose, twist, assistance_state, step):
        return self._command

    def _away(self, now, dt, pose, twist, assistance_state, step):
        to_door = float(np.arctan2(-pose[1], -pose[0]))
        error = float(se2.wrap_angle(to_door + np.pi - pose[2]))
        v = self.settings.away.speed if abs(error) < 0.35 else 0.0
        return self._hand.update(now, Twist(v, turn_on_the_spot(error, self.settings)))

    def _random(self, now, dt, pose, twist, assistance_state, step):
        values = self.settings.random
        keep = np.exp(-dt / values.time)
        self._walk = keep * self._walk + np.sqrt(1.0 - keep * keep) * self._rng.standard_normal(2)
        return Twist(float(values.speed_mean + values.speed * self._walk[0]), float(values.turn * self._walk[1]))


BEHAVIOURS = {
    "goal_directed": User._goal_directed,
    "push": User._push,
    "hold": User._hold,
    "away": User._away,
    "random": User._random,
}


class Tremor:
    """Adds a tremor of one frequency, drawn once, to the turn rate."""

    def __init__(self, settings, rng):
        tremor = settings.tremor
        self._frequency = float(rng.uniform(min(tremor.low, tremor.high), max(tremor.low, tremor.high)))
        self._phase = float(rng.uniform(0.0, 2.0 * np.pi))
        self._amplitude = tremor.turn

    def __call__(self, now, command):
        shake = self._amplitude * np.sin(2.0 * np.pi * self._frequency * now + self._phase)
        return Twist(command.v, command.w + float(shake))


class Switches:
    """Four on / off directions in place of a stick: forward, back, left, right, tapped so that their mean is right.

    Each axis keeps account of the motion it still owes, and is switched on when that is worth one shortest tap.
    """

    def __init__(self, settings, rng):
        self._full = (settings.switch.speed, settings.switch.turn)
        self._dwell = settings.switch.dwell
        self._on, self._changed, self._owed, self._last = [0.0, 0.0], [-np.inf, -np.inf], [0.0, 0.0], None

    def __call__(self, now, command):
        dt = 0.0 if self._last is None else max(0.0, now - self._last)
        self._last = now
        for axis, wanted in enumerate(command):
            full = self._full[axis]
            tap = full * self._dwell
            owed = self._owed[axis] + (wanted - self._on[axis] * full) * dt
            # What was not done in time is forgotten: the eye sees where the chair is.
            self._owed[axis] = float(np.clip(owed, -2.0 * tap, 2.0 * tap))
            if abs(wanted) < 0.02:
                on, self._owed[axis] = 0.0, 0.0
            elif abs(self._owed[axis]) >= tap:
                on = float(np.sign(self._owed[axis]))
            else:
                on = self._on[axis] if self._on[axis] * self._owed[axis] > 0.0 else 0.0
            if on != self._on[axis] and now - self._changed[axis] >= self._dwell:
                self._on[axis], self._changed[axis] = on, now
        return Twist(self._on[0] * self._full[0], self._on[1] * self._full[1])


HANDS = {"tremor": Tremor, "switch": Switches}


class AskForHelp:
    """The button: turn until the gap's middle is ahead, stand, press X, wait for the answer."""

    def __init__(self, settings, button):
        self._settings, self._button = settings, button
        self.done = button == NEVER
        self._began = self._stands_since = self._pressed = None
        self._answered = False

    def update(self, now, pose, twist, assistance_state, way):
        """``(Twist wanted, press)``; ``done`` is set once the answer is there."""
        button = self._settings.button
        if self._began is None:
            self._began = now
        if self._pressed is not None:
            return STOP, self._wait(now, assistance_state)
        error = float(se2.wrap_angle(np.arctan2(-pose[1], -pose[0]) - pose[2]))
        late = now - self._began > button.turn_time
        if self._button == AT_ONCE or late or abs(error) <= button.angle:
            still = abs(twist.v) < 0.02 and abs(twist.w) < 0.02
            if self._button == AT_ONCE or late:
                still = True
            if not still:
                self._stands_since = None
            elif self._stands_since is None:
                self._stands_since = now
            if still and (self._button == AT_ONCE or now - self._stands_since >= button.stand):
                self._pressed = now
                return STOP, True
            return STOP, False
        self._stands_since = None
        return way.turn_to(now, pose, twist, error), False

    def _wait(self, now, assistance_state):
        button = self._settings.button
        waited = now - self._pressed
        if assistance_state == DETECTING:
            self._answered = True
        # MANUAL after DETECTING: refused. ASSISTING, ARRIVED: accepted.
        decided = assistance_state in (ASSISTING, ARRIVED, FAULT) or (
            self._answered and assistance_state != DETECTING
        )
        if waited >= button.hold and (decided or (waited > button.patience and not self._answered)):
            self.done = True
        return waited < button.hold


def _from_file(path, settings):
    """Steps and settings of a user's YAML file: ``steps`` (list) and ``settings`` (changed ones of ``users``)."""
    try:
        content = parameters.read_yaml(path)
    except parameters.ParameterError as error:
        raise UserError(str(error))
    unknown = sorted(map(str, set(content) - {"steps", "settings"}))
    if unknown:
        raise UserError("%s: unknown key '%s': a user has steps and settings" % (path, unknown[0]))
    changes = content.get("settings") or {}
    if not isinstance(changes, dict):
        raise UserError("%s: settings must be a mapping such as 'drive/cruise: 0.3'" % path)
    try:
        settings = settings.replace(**{str(key): value for key, value in changes.items()})
    except parameters.ParameterError as error:
        raise UserError("%s: %s" % (path, error))
    steps = content.get("steps")
    if not isinstance(steps, list) or not steps:
        raise UserError("%s: steps must be a list with at least one step" % path)
    steps = [_step(path, number, step, settings) for number, step in enumerate(steps, 1)]
    for number, step in enumerate(steps[:-1], 1):
        if step.distance is None and not np.isfinite(step.seconds):
            raise UserError("%s: step %d needs an end, seconds or distance: other steps follow" % (path, number))
    return steps, settings


def _step(path, number, given, settings):
    where = "%s: step %d" % (path, number)
    if not isinstance(given, dict) or "do" not in given:
        raise UserError("%s: must be a mapping with a key 'do'" % where)
    unknown = sorted(map(str, set(given) - {"do", "seconds", "distance", "v", "w", "hand"}))
    if unknown:
        raise UserError("%s: unknown key '%s'" % (where, unknown[0]))
    if given["do"] not in tuple(BEHAVIOURS):
        raise UserError("%s: do is '%s', must be one of %s" % (where, given["do"], " ".join(BEHAVIOURS)))
    if given.get("hand", "") not in ("",) + tuple(HANDS):
        raise UserError("%s: hand is '%s', must be one of %s" % (where, given["hand"], " ".join(HANDS)))
    numbers = {}
    for key in ("seconds", "distance", "v", "w"):
        if key not in given:
            continue
        value = given[key]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
            raise UserError("%s: %s is %r, must be a finite number" % (where, key, value))
        numbers[key] = float(value)
    if numbers.get("seconds", 1.0) <= 0.0:
        raise UserError("%s: seconds is %g, must be above 0" % (where, numbers["seconds"]))
    limits = settings.wheelchair.limits
    for key, limit, unit in (("v", limits.speed, "m/s"), ("w", limits.turn_rate, "rad/s")):
        if key in numbers and given["do"] != "push":
            raise UserError("%s: %s belongs to 'push', not to '%s'" % (where, key, given["do"]))
        if abs(numbers.get(key, 0.0)) > limit:
            raise UserError("%s: %s is %g, the chair's limit is %g %s" % (where, key, numbers[key], limit, unit))
    return Step(
        given["do"],
        numbers.get("seconds", np.inf),
        numbers.get("distance"),
        Twist(numbers.get("v", 0.0), numbers.get("w", 0.0)),
        given.get("hand", ""),
    )
