"""The small values that modules hand to each other; all in SI units, none is ever changed."""
from typing import NamedTuple

import numpy as np

RANGERS = ("left_front", "left_middle", "left_rear", "right_front", "right_middle", "right_rear")


# s: by so much a computer's clock is put right (NTP) while it runs; a longer way back is another clock's
CLOCK_SLIP = 0.1


class Twist(NamedTuple):
    """A command or a velocity: ``v`` [m/s] forward, ``w`` [rad/s] counter-clockwise."""

    v: float
    w: float


STOP = Twist(0.0, 0.0)


class Odometry(NamedTuple):
    """Pose (3,) of ``base_link`` in odom (or world, for the truth) and the velocity in the body frame."""

    stamp: float
    pose: np.ndarray
    twist: Twist


class Depth(NamedTuple):
    """Depth image (height, width) float32 [m] along the optical axis; NaN, +Inf, -Inf as in REP 117 / 118."""

    stamp: float
    image: np.ndarray


class Ranges(NamedTuple):
    """Readings (6,) [m] in the order of ``RANGERS``; NaN, +Inf, -Inf as in REP 117."""

    stamp: float
    values: np.ndarray


class Doorway(NamedTuple):
    """An open doorway.

    ``pose`` (3,): the middle of the gap, its yaw the wall's normal pointing away from the sensor;
    ``covariance`` (3, 3) of the pose; ``width`` [m] clear; ``jambs`` (2, 2): left and right edge of the gap
    seen along the normal; ``confidence`` in [0, 1].
    """

    pose: np.ndarray
    width: float
    confidence: float
    jambs: np.ndarray
    covariance: np.ndarray
    stamp: float = 0.0
