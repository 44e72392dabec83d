"""Collects the ticks of an episode into a log, in-process and in ROS alike."""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.experiments import metrics


class Tick(NamedTuple):
    """What the log keeps of a tick of the blender: those fields of ``shared_control.State``."""

    user: tuple
    planner: tuple
    blended: tuple
    sent: tuple
    d_l: float
    d_f: float
    d_r: float
    v: float
    sigma_l: float
    sigma_r: float
    beta: float
    guard: int
    stopped: bool
    assisting: bool


class Recorder:
    """Takes one row a blending tick; ``log()`` gives them as arrays."""

    def __init__(self, door_pose):
        self._world_to_door = se2.inverse(door_pose)
        self._rows = []

    def add(self, truth, state, clearance):
        """Add a tick.

        ``truth`` is ``Odometry`` in world, ``state`` is a ``shared_control.State`` or a ``Tick``, ``clearance`` [m] the
        true one.
        """
        self._rows.append(
            (
                truth.stamp, se2.compose(self._world_to_door, truth.pose), truth.twist,
                _pair(state.user), _pair(state.planner), _pair(state.blended), _pair(state.sent),
                (state.d_l, state.d_f, state.d_r, state.v), (state.sigma_l, state.sigma_r),
                np.nan if state.beta is None else state.beta, state.guard, state.stopped, state.assisting, clearance,
            )
        )

    def __len__(self):
        return len(self._rows)

    def log(self):
        """The ticks so far as a ``metrics.Log``."""
        shapes = ((), (3,), (2,), (2,), (2,), (2,), (2,), (4,), (2,), (), (), (), (), ())
        kinds = (float,) * 10 + (int, bool, bool, float)
        columns = list(zip(*self._rows)) or [()] * len(shapes)
        return metrics.Log(
            *(
                np.array(column, dtype=kind).reshape((len(self._rows),) + shape)
                for column, shape, kind in zip(columns, shapes, kinds)
            )
        )


def _pair(command):
    return (np.nan, np.nan) if command is None else (command[0], command[1])
