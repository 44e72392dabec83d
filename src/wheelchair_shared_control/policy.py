"""What a policy is given in one tick, and what it gives back: the contract of the policies table."""
import math
from typing import Any, NamedTuple, Optional, Tuple

import numpy as np

from wheelchair_shared_control.values import STOP, Doorway, Twist


class Tick(NamedTuple):
    """All that a policy may look at in one tick; frames: odom, and ``base_link`` for velocities.

    ``user`` and ``planner`` are finite and within the chair's limits. ``features`` are d_l, d_f, d_r [m];
    ``clearance`` [m] is the footprint's distance to the nearest obstacle; ``prediction`` is the task model's
    answer or None; ``density_floor`` the 5 % quantile of its training set's log density (NaN if unknown);
    ``points`` (n, 2) [m] are the lethal cells and range readings around the chair; ``settings`` the blender's.
    """

    now: float
    user: Twist
    planner: Twist
    pose: np.ndarray
    twist: Twist
    features: Tuple[float, float, float]
    clearance: float
    prediction: Any
    density_floor: float
    grid: Any
    points: np.ndarray
    goal: Optional[np.ndarray]
    doorway: Optional[Doorway]
    doorways: Tuple[Doorway, ...]
    settings: Any


class PolicyResult(NamedTuple):
    """``command`` before the limiter; ``beta`` the user's weight, None where the policy has none;
    ``reason`` in words; ``sigma`` [rad/s] that entered Eq. 2, NaN where none did."""

    command: Twist
    beta: Optional[float]
    reason: str = ""
    sigma: float = math.nan


STICK_AT_REST = PolicyResult(STOP, None, "the stick is at rest")


def at_rest(user, settings):
    """Whether the stick is inside its dead zone."""
    return abs(user.v) < settings.stick.dead_zone_v and abs(user.w) < settings.stick.dead_zone_w
