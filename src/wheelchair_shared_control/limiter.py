"""The limiter: brings a command to the chair no faster than a seated person bears.

Speed, turn rate and their changes are bounded on both axes; the jerk is bounded along the direction of
travel only, where it is felt: the person sits close to the drive axle, so that turning moves them little.
"""
import math

from wheelchair_shared_control.values import STOP, Twist


def within_limits(command, limits):
    """``command`` scaled down, keeping its arc, until speed and turn rate are within ``limits``."""
    excess = max(abs(command.v) / limits.speed, abs(command.w) / limits.turn_rate, 1.0)
    return Twist(float(command.v / excess), float(command.w / excess))


def approach(value, rate, target, max_rate, max_change, dt):
    """One step of ``value`` towards ``target`` with bounded rate and bounded change of the rate.

    Returns the new value and the new rate. The rate is reduced in time to arrive without overshoot: a rate r
    that falls by ``max_change * dt`` a step covers ``r (r + max_change dt) / (2 max_change)`` before it is 0.
    """
    gap = target - value
    if gap == 0.0 and rate == 0.0:
        return value, 0.0
    drop = max_change * dt
    highest = 0.5 * (math.sqrt(drop * drop + 8.0 * max_change * abs(gap)) - drop)
    wanted = math.copysign(min(max_rate, highest), gap)
    new_rate = min(max(wanted, rate - drop), rate + drop)
    new_rate = min(max(new_rate, -max_rate), max_rate)
    # Steps of uneven length (a tick at once on a user's command) would pass the target by a hair: end on it.
    if gap * new_rate >= 0.0 and abs(new_rate) * dt >= abs(gap) - 1e-12 and abs(new_rate) <= drop + 1e-9:
        return target, 0.0
    return value + new_rate * dt, new_rate


class Limiter:
    """Memory of the last command and its acceleration; ``limits`` are the chair's settings."""

    def __init__(self, limits):
        self._limits = limits
        self.reset()

    def reset(self):
        """Forget: the chair stands."""
        self.command = self._before = STOP
        self._acceleration = 0.0
        self._dt = 0.0

    def step(self, target, dt):
        """The command [m/s, rad/s] to send ``dt`` [s] after the last one, on the way to ``target``."""
        limits = self._limits
        target = within_limits(target, limits)
        v, self._acceleration = approach(
            self.command.v, self._acceleration, target.v, limits.acceleration, limits.jerk, dt
        )
        if abs(v) > limits.speed:
            v, self._acceleration = math.copysign(limits.speed, v), 0.0
        change = limits.turn_acceleration * dt
        w = min(max(target.w, self.command.w - change), self.command.w + change)
        self._before, self._dt = self.command, dt
        self.command = Twist(v, w)
        return self.command

    def ramp_down(self, dt):
        """The command on the way to standstill at the acceleration limit, without regard to jerk."""
        limits = self._limits
        self._acceleration = 0.0
        self._before, self._dt = self.command, dt
        self.command = Twist(
            _towards_zero(self.command.v, limits.acceleration * dt),
            _towards_zero(self.command.w, limits.turn_acceleration * dt),
        )
        return self.command

    def sent(self, command):
        """Take over what the guard left of the last step: the next one starts there.

        What it left of the acceleration is kept, too. Otherwise a chair close to a wall, which may drive off but
        not turn, would for ever be given the first step of a jerk-limited ramp, the one that is all turn.
        """
        if command != self.command:
            gained = command.v - self._before.v
            speeds_up = gained * command.v > 0.0 and abs(command.v) > abs(self._before.v)
            self._acceleration = gained / self._dt if speeds_up and self._dt > 0.0 else 0.0
            self.command = command


def _towards_zero(value, change):
    return math.copysign(max(abs(value) - change, 0.0), value) if value else 0.0
