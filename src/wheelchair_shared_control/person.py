"""How a person's eye and hand follow a path: late, noisy, and aware of both.

The person sees the truth ``delay`` seconds late, carries it on in mind with the stick's own history, and steers
with a hand that moves at a finite rate. Poses are in the door's frame (x along the normal, 0 at the plane).
"""
import math
from collections import deque

import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.values import STOP, Twist

STEP = 0.05  # s: of what the person carries on in mind


class Hand:
    """The stick: finite rate, and noise that fades where the stick rests (signal-dependent noise)."""

    def __init__(self, settings, rng):
        self._settings, self._rng = settings, rng
        self._twist, self._noise, self._last = STOP, np.zeros(2), None

    def update(self, now, wanted):
        """The stick's command ``Twist`` on its way to ``wanted``."""
        dt = 0.0 if self._last is None else max(0.0, now - self._last)
        self._last = now
        rates = self._settings.hand
        v = self._twist.v + np.clip(wanted.v - self._twist.v, -rates.speed_rate * dt, rates.speed_rate * dt)
        w = self._twist.w + np.clip(wanted.w - self._twist.w, -rates.turn_rate * dt, rates.turn_rate * dt)
        self._twist = Twist(float(v), float(w))
        noise = self._settings.noise
        keep = np.exp(-dt / noise.time)
        self._noise = keep * self._noise + np.sqrt(1.0 - keep * keep) * self._rng.standard_normal(2)
        effort = min(1.0, abs(v) / 0.1 + abs(w) / 0.2)
        return Twist(
            float(v + effort * noise.speed * self._noise[0]), float(w + effort * noise.turn * self._noise[1])
        )


class Eye:
    """Where the person believes the chair is now: seen late, carried on with the stick's history."""

    def __init__(self, settings):
        self._delay = settings.delay
        actuation = settings.wheelchair.actuation
        self._dead_time = settings.anticipation * actuation.dead_time
        self._lag = max(1e-3, settings.anticipation * actuation.lag)
        self._seen, self._pushed = deque(), deque()

    def saw(self, stamp, pose, twist):
        """Light falls in: pose (3,) and velocity at ``stamp`` [s]."""
        if self._seen and stamp < self._seen[-1][0]:
            self._seen.clear()
            self._pushed.clear()
        self._seen.append((stamp, np.asarray(pose, dtype=float), twist))

    def pushed(self, now, command):
        """The stick's command from ``now`` on."""
        self._pushed.append((now, command))

    def believed(self, now):
        """Believed pose (3,) and velocity ``Twist`` at ``now``."""
        while len(self._seen) > 1 and self._seen[1][0] <= now - self._delay + 1e-9:
            self._seen.popleft()
        stamp, pose, twist = self._seen[0]
        while len(self._pushed) > 1 and self._pushed[1][0] <= stamp - self._dead_time:
            self._pushed.popleft()
        (x, y, yaw), (v, w) = pose, twist
        steps = max(0, math.ceil((now - stamp) / STEP - 1e-6))
        for step in range(steps):
            moment = stamp + step * STEP
            dt = min(STEP, now - moment)
            command = self._command_at(moment - self._dead_time)
            if command is not None:
                share = 1.0 - math.exp(-dt / self._lag)
                v, w = v + share * (command.v - v), w + share * (command.w - w)
            heading = yaw + 0.5 * w * dt  # plain numbers: the same arc as se2.integrate at a tenth of its time
            x, y, yaw = x + v * dt * math.cos(heading), y + v * dt * math.sin(heading), yaw + w * dt
        return np.array([x, y, float(se2.wrap_angle(yaw))]), Twist(float(v), float(w))

    def _command_at(self, moment):
        found = None
        for stamp, command in self._pushed:
            if stamp > moment + 1e-9:
                break
            found = command
        return found


def calmness(settings):
    """1 on a chair that answers at once, less the later it answers: who knows a sluggish chair steers it gently.

    A loop with a delay T swings where its gain exceeds about 1 / T; half of that is calm.
    """
    actuation = settings.wheelchair.actuation
    delay = settings.anticipation * (actuation.dead_time + actuation.lag)
    return min(1.0, 0.5 / max(1e-3, delay * settings.drive.heading_gain))


def turn_on_the_spot(error, settings):
    """Turn rate [rad/s] that takes a heading ``error`` [rad] away without overshoot."""
    drive = settings.drive
    return float(np.clip(calmness(settings) * drive.heading_gain * error, -drive.turn, drive.turn))


def along_leg(pose, leg, speed, turning, settings):
    """Stick on a leg: ``(Twist, turning)``; ``turning`` (on the spot) has a memory of one flag (hysteresis).

    A cross-track error bends the wanted heading towards the leg over ``look_ahead``.
    """
    drive, calm = settings.drive, calmness(settings)
    direction = leg.direction
    offset = pose[:2] - leg.start
    cross = float(direction[0] * offset[1] - direction[1] * offset[0])
    bend = np.arctan2(cross, drive.look_ahead / calm)
    wanted = leg.heading + (bend if leg.reverse else -bend)
    error = float(se2.wrap_angle(wanted - pose[2]))
    off = abs(error)
    turning = off > drive.turn_start or (turning and off > drive.turn_stop)
    w = turn_on_the_spot(error, settings)
    if turning:
        return Twist(0.0, w), True
    v = speed * np.sqrt(calm) * max(0.3, np.cos(min(np.pi / 2.0, 2.0 * off)))
    return Twist(float(-v if leg.reverse else v), w), False
