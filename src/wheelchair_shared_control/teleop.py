"""From a joystick's axes and buttons to the user's command and the button's edges.

Axes are those of ``sensor_msgs/Joy``: -1 to 1, forward and left positive; buttons 0 or 1.
"""
import math

from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.values import STOP, Twist


class TeleopError(Error):
    """A joystick message that cannot be a command: too few axes or buttons, not a number."""


def shaped(deflection, dead_zone, curve):
    """Deflection [-1, 1] after dead zone and curve: 0 inside the zone, without a step at its edge, 1 at the end.

    Beyond the end counts as the end.
    """
    travel = (min(abs(deflection), 1.0) - dead_zone) / (1.0 - dead_zone)
    if travel <= 0.0:
        return 0.0
    return math.copysign(travel ** curve, deflection)


def command(axes, buttons, settings):
    """The user's command ``Twist`` [m/s, rad/s] of a joystick message; ``settings`` of the group ``teleop``.

    Zero while a dead-man button is asked for and not held. Raises TeleopError.
    """
    if settings.button.dead_man >= 0 and not held(buttons, settings.button.dead_man, "dead-man button"):
        return STOP
    limits, share = settings.wheelchair.limits, settings.share
    forward = shaped(_axis(axes, settings.axis.speed), settings.dead_zone, settings.curve)
    left = shaped(_axis(axes, settings.axis.turn), settings.dead_zone, settings.curve)
    speed = limits.speed * (share.forward if forward > 0.0 else share.reverse)
    # + 0.0: a stick pulled into its dead zone is 0, not -0
    return Twist(forward * speed + 0.0, left * limits.turn_rate * share.turn + 0.0)


def held(buttons, number, name):
    """Whether button ``number`` is down. Raises TeleopError where the joystick has no such button."""
    if number >= len(buttons):
        raise TeleopError("joy: %s is number %d, but there are %d buttons" % (name, number, len(buttons)))
    return bool(buttons[number])


def _axis(axes, number):
    if number >= len(axes):
        raise TeleopError("joy: axis %d is asked for, but there are %d axes" % (number, len(axes)))
    value = float(axes[number])
    if not math.isfinite(value):
        raise TeleopError("joy: axis %d is %g, must be a finite number" % (number, value))
    return value


class Edge:
    """Counts the presses of one button: ``count`` rises by one at each change from up to down.

    The first message only tells where the button is: one that is already down was not pressed.
    """

    def __init__(self):
        self.count = 0
        self._down = True

    def update(self, down):
        """Take over the button's level; returns ``count``."""
        if down and not self._down:
            self.count += 1
        self._down = bool(down)
        return self.count
