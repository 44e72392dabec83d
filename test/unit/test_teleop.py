"""The stick's way to a command, the button's edges, the joystick's device."""
import math
import os
import pty
import struct

import pytest

from wheelchair_shared_control import joystick, parameters, teleop
from wheelchair_shared_control.values import STOP


@pytest.fixture(scope="module")
def settings():
    # dead zone 0.1, curve 1.5, 0.6 m/s, 1.0 rad/s, half speed backward: written here so that the sums below hold
    # whatever the shipped numbers are
    return parameters.load("teleop").replace(**{
        "dead_zone": 0.1, "curve": 1.5, "axis/speed": 1, "axis/turn": 0, "button/dead_man": -1,
        "share/forward": 1.0, "share/reverse": 0.5, "share/turn": 1.0,
        "wheelchair/limits/speed": 0.6, "wheelchair/limits/turn_rate": 1.0,
    })


@pytest.mark.parametrize("axes, v, w", [
    ((0.0, 0.0), 0.0, 0.0),
    ((0.0, 1.0), 0.6, 0.0),
    ((0.0, -1.0), -0.3, 0.0),          # backward half as fast
    ((1.0, 0.0), 0.0, 1.0),            # left is positive
    ((-1.0, 0.0), 0.0, -1.0),
    ((0.0, 0.1), 0.0, 0.0),            # the dead zone's edge is still rest
    ((0.0, 0.325), 0.6 * 0.125, 0.0),  # (0.325 - 0.1) / 0.9 = 1/4; (1/4)^1.5 = 1/8
    ((0.0, 1.2), 0.6, 0.0),            # a worn pad that says more than its end
])
def test_a_deflection_gives_the_command_of_the_curve(settings, axes, v, w):
    assert teleop.command(axes, (), settings) == pytest.approx((v, w))


def test_the_curve_has_no_step_at_the_edge_of_the_dead_zone():
    assert 0.0 < teleop.shaped(0.1001, 0.1, 1.0) < 0.001


@pytest.mark.parametrize("axes, words", [
    ((0.0,), "axis 1 is asked for, but there are 1 axes"),
    ((0.0, math.nan), "axis 1 is nan"),
    ((math.inf, 0.0), "axis 0 is inf"),
])
def test_a_message_that_cannot_be_a_command_is_refused_in_words(settings, axes, words):
    with pytest.raises(teleop.TeleopError, match=words):
        teleop.command(axes, (), settings)


def test_the_dead_man_button_must_be_held(settings):
    settings = settings.replace(**{"button/dead_man": 2})
    assert teleop.command((0.0, 1.0), (0, 0, 0), settings) == STOP
    assert teleop.command((0.0, 1.0), (0, 0, 1), settings).v == pytest.approx(0.6)
    with pytest.raises(teleop.TeleopError, match="there are 2 buttons"):
        teleop.command((0.0, 1.0), (0, 0), settings)


def test_a_button_counts_once_however_long_it_is_held():
    edge = teleop.Edge()
    assert [edge.update(down) for down in (0, 1, 1, 1, 0, 1)] == [0, 1, 1, 1, 1, 2]


def test_a_button_that_is_down_at_the_first_message_was_not_pressed():
    edge = teleop.Edge()
    assert [edge.update(down) for down in (1, 1, 0, 1)] == [0, 0, 0, 1]


@pytest.mark.parametrize("pad", ["ps3_kernel", "ps3_sixad"])
def test_both_maps_of_the_pad_name_parameters_that_exist(pad):
    sections = parameters.read_yaml(parameters.package_file("config/%s.yaml" % pad))
    assert sorted(sections) == ["doorway_assistant", "teleop"]
    for group, section in sections.items():
        changes = {head + "/" + key: value for head, values in section.items() for key, value in values.items()}
        parameters.load(group).replace(**changes)


# ---- the device: 8 bytes an event, value in [-32767, 32767], right and down positive ------------------

BUTTON, AXIS, INIT = 1, 2, 0x80


def event(value, kind, number):
    return struct.pack("<IhBB", 1234, value, kind, number)


def test_events_become_axes_and_buttons_with_left_and_forward_positive():
    data = event(-32767, AXIS | INIT, 1) + event(16384, AXIS, 0) + event(1, BUTTON, 2)
    state = joystick.applied(joystick.JoystickState(), data)
    assert state.axes == pytest.approx((-0.5, 1.0), abs=1e-4)
    assert state.buttons == (0, 0, 1)


def test_the_lowest_value_of_the_kernel_stays_within_one():
    assert joystick.applied(joystick.JoystickState(), event(-32768, AXIS, 0)).axes == (1.0,)


@pytest.mark.parametrize("kind, number", [(7, 0), (AXIS, 200)])
def test_a_file_that_is_no_joystick_is_refused(kind, number):
    with pytest.raises(joystick.JoystickError, match="none of a joystick"):
        joystick.applied(joystick.JoystickState(), event(1, kind, number))


def test_a_device_that_is_not_there_is_named(tmp_path):
    with pytest.raises(joystick.JoystickError, match="js7: No such file"):
        joystick.Joystick(str(tmp_path / "js7"))


def test_a_pipe_is_read_until_its_writer_goes(tmp_path):
    path = str(tmp_path / "js")
    os.mkfifo(path)
    reader_first = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # lets the writer open without waiting
    writer = os.open(path, os.O_WRONLY)
    device = joystick.Joystick(path)
    os.close(reader_first)
    whole = event(-32767, AXIS, 1) + event(1, BUTTON, 0)
    os.write(writer, whole[:11])  # an event cut in two
    assert device.read(1.0).axes == (0.0, 1.0)
    assert device.state.buttons == ()
    os.write(writer, whole[11:])
    assert device.read(1.0).buttons == (1,)
    assert device.read(0.01).axes == (0.0, 1.0)  # nothing new: the stick is where it was
    os.close(writer)
    with pytest.raises(joystick.JoystickError, match="end of file"):
        device.read(1.0)


def test_a_terminal_that_hangs_up_is_a_lost_device():
    master, slave = pty.openpty()
    device = joystick.Joystick(os.ttyname(slave))
    os.close(slave)
    os.close(master)
    with pytest.raises(joystick.JoystickError):
        device.read(1.0)


def test_nothing_is_touched_on_a_neutral_joystick():
    state = joystick.JoystickState((0.3, -1.0), (1, 0, 1))
    assert joystick.neutral(state) == ((0.0, 0.0), (0, 0, 0))
