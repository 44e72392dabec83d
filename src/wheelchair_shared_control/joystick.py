"""A Linux joystick device (``/dev/input/js*``): its events as axes and buttons, and whether it still answers.

Kernel interface: Documentation/input/joydev/joystick-api.rst. An event is 8 bytes: time [ms] uint32, value
int16, type uint8 (1 button, 2 axis, 0x80 added while the device tells its state at opening), number uint8.
"""
import errno
import fcntl
import os
import select
import struct
from typing import NamedTuple, Tuple

from wheelchair_shared_control.errors import Error

_EVENT = struct.Struct("<IhBB")
_BUTTON, _AXIS, _INIT = 0x01, 0x02, 0x80
_GET_AXES, _GET_BUTTONS = 0x80016A11, 0x80016A12  # JSIOCGAXES, JSIOCGBUTTONS
_HIGHEST = 63  # a number above it is no event of a joystick


class JoystickError(Error):
    """The device is away, is not a joystick, or has stopped to answer."""


class JoystickState(NamedTuple):
    """``axes`` in [-1, 1], left and up positive (as ``joy_node`` has them); ``buttons`` 0 or 1."""

    axes: Tuple[float, ...] = ()
    buttons: Tuple[int, ...] = ()


def neutral(state):
    """The state of the same joystick with nothing touched."""
    return JoystickState((0.0,) * len(state.axes), (0,) * len(state.buttons))


def applied(state, data):
    """``JoystickState`` after the events in ``data`` (bytes, a multiple of 8). Raises JoystickError."""
    axes, buttons = list(state.axes), list(state.buttons)
    for _, value, kind, number in _EVENT.iter_unpack(data):
        kind &= ~_INIT
        if kind not in (_BUTTON, _AXIS) or number > _HIGHEST:
            raise JoystickError("event of type %d, number %d is none of a joystick" % (kind, number))
        values = buttons if kind == _BUTTON else axes
        values.extend([0] * (number + 1 - len(values)))
        # The kernel counts down and right as positive.
        values[number] = int(value != 0) if kind == _BUTTON else max(-1.0, min(1.0, -value / 32767.0)) + 0.0
    return JoystickState(tuple(float(value) for value in axes), tuple(buttons))


class Joystick:
    """An open device; ``read`` waits for events until a deadline. Raises JoystickError where it is away."""

    def __init__(self, path):
        self.path = path
        self._rest = b""
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            raise JoystickError("%s: %s" % (path, error.strerror))
        self.state = JoystickState((0.0,) * self._ask(_GET_AXES), (0,) * self._ask(_GET_BUTTONS))
        self._poll = select.poll()
        self._poll.register(self._file, select.POLLIN)

    def _ask(self, request):
        """Number of axes or buttons; 0 where the file is not a device of the kernel's (a pipe: it grows)."""
        try:
            return fcntl.ioctl(self._file, request, b"\0")[0]
        except OSError as error:
            if error.errno in (errno.ENOTTY, errno.EINVAL):
                return 0
            self._lost(error.strerror)

    def read(self, timeout):
        """The newest ``JoystickState`` after at most ``timeout`` [s] of waiting for a change."""
        if self._poll.poll(max(0.0, 1e3 * timeout)):
            try:
                data = os.read(self._file, 64 * _EVENT.size)
            except BlockingIOError:
                return self.state
            except OSError as error:
                self._lost(error.strerror)
            if not data:
                self._lost("end of file")
            data = self._rest + data
            whole = len(data) - len(data) % _EVENT.size
            self._rest = data[whole:]
            try:
                self.state = applied(self.state, data[:whole])
            except JoystickError as error:
                self._lost(str(error))
        else:
            self._ask(_GET_AXES)  # a device that was unplugged says so here
        return self.state

    def close(self):
        """Give the device back."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def _lost(self, why):
        self.close()
        raise JoystickError("%s: %s" % (self.path, why))
