"""Commands as sticks: a command is a push of so much into a direction, whatever the units of its axes."""
import math

from wheelchair_shared_control.values import Twist


def angle(command, limits):
    """Direction [rad] of the stick that asks for ``command``: 0 ahead, pi / 2 a turn to the left on the spot."""
    return math.atan2(command.w / limits.turn_rate, command.v / limits.speed)


def size(command, limits):
    """How far the stick is pushed, 0 to 1."""
    return min(math.hypot(command.v / limits.speed, command.w / limits.turn_rate), 1.0)


def pushed(direction, size_, limits):
    """The command of a stick pushed by ``size_`` (0 to 1) towards ``direction`` [rad]."""
    return Twist(size_ * math.cos(direction) * limits.speed, size_ * math.sin(direction) * limits.turn_rate)


def between(first, second):
    """Angle [rad] between two directions, 0 to pi."""
    return abs(math.remainder(first - second, 2.0 * math.pi))
