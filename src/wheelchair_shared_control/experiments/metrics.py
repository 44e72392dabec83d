"""What is measured in an episode: phases, the user's share, clearance, escape.

The definitions are those of the README, section *Definitions*. Every function takes the log of an episode,
arrays with one entry a blending tick.
"""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.experiments.statistics import wilson
from wheelchair_shared_control.guard import STOPPED

PHASES = ("approach", "doorway", "exit")
STICK_DEAD_ZONE = 0.02  # m/s and rad/s: the stick counts as at rest below
DISAGREEMENT = 0.05  # rad/s: below, user and planner ask for the same turn
FAST_ENOUGH = 0.05  # m/s: below, a share of the speed says nothing
DOORWAY_BEGINS = 0.3  # m from the foremost footprint point to the door plane
PAST_THE_DOOR = 0.6  # m from the rearmost footprint point past the door plane
STANDSTILL = 8.0  # s
TIME_LIMIT = 60.0  # s


class Log(NamedTuple):
    """One row a tick: ``n`` ticks. Commands are (n, 2) of v [m/s], w [rad/s]; NaN where there was none."""

    time: np.ndarray  # (n,) s
    truth: np.ndarray  # (n, 3) pose in the door's frame: x past the plane, y beside the axis
    velocity: np.ndarray  # (n, 2) true speeds
    user: np.ndarray  # (n, 2)
    planner: np.ndarray  # (n, 2)
    blended: np.ndarray  # (n, 2) the policy's command, before limiter and guard
    sent: np.ndarray  # (n, 2)
    features: np.ndarray  # (n, 4) d_l, d_f, d_r [m], v [m/s]
    sigma: np.ndarray  # (n, 2) sigma_l, sigma_r [rad/s], unscaled
    beta: np.ndarray  # (n,)
    guard: np.ndarray  # (n,) BlendState's codes
    stopped: np.ndarray  # (n,) bool: guard or fault held the chair
    assisted: np.ndarray  # (n,) bool
    clearance: np.ndarray  # (n,) m, from the truth


def along_door(door_pose, footprint, pose):
    """x [m] of the rearmost and the foremost footprint point past the door plane, for poses (..., 3).

    ``pose`` is in the door's frame when ``door_pose`` is None.
    """
    local = np.asarray(pose, float) if door_pose is None else se2.compose(se2.inverse(door_pose), pose)
    cos, sin = np.cos(local[..., 2]), np.abs(np.sin(local[..., 2]))
    ends = np.stack((footprint.front * cos, footprint.rear * cos), axis=-1)
    side = footprint.half_width * sin
    return local[..., 0] + ends.min(axis=-1) - side, local[..., 0] + ends.max(axis=-1) + side


def phases(log, footprint):
    """Phase of every tick (n,) as an index into PHASES; a phase once left does not come back."""
    rear, front = along_door(None, footprint, log.truth)
    phase = np.where(rear > 0.0, 2, np.where(front > -DOORWAY_BEGINS, 1, 0))
    return np.maximum.accumulate(phase) if len(phase) else phase


def user_share_of_ticks(log):
    """The person's share of the turn rate of every tick (n,); NaN where it is not defined.

    ``clip((w - w_P) / (w_H - w_P), 0, 1)`` with w before the limiter, where the stick is out of its dead zone
    and the two disagree by more than 0.05 rad/s; 0 where guard or fault stopped the chair.
    """
    w_user, w_planner = log.user[:, 1], log.planner[:, 1]
    disagreement = w_user - w_planner
    steering = np.abs(log.user).max(axis=1, initial=0.0) >= STICK_DEAD_ZONE
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip((log.blended[:, 1] - w_planner) / disagreement, 0.0, 1.0)
        valid = log.assisted & steering & (np.abs(disagreement) > DISAGREEMENT)
    return np.where(valid, np.where(log.stopped, 0.0, share), np.nan)


def speed_share_of_ticks(log):
    """The share of the person's speed that is carried out, of every tick (n,); NaN where |v_H| <= 0.05 m/s."""
    v_user = log.user[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip(log.blended[:, 0] / v_user, 0.0, 1.0)
        valid = np.abs(v_user) > FAST_ENOUGH
    return np.where(valid, np.where(log.stopped, 0.0, share), np.nan)


def mean_or_none(values):
    """Mean of the finite ``values``, None where there are none."""
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    return float(values.mean()) if values.size else None


def shares(log, footprint):
    """The person's share over the whole episode and by phase: {"all", "approach", "doorway", "exit"}."""
    share, phase = user_share_of_ticks(log), phases(log, footprint)
    result = {"all": mean_or_none(share)}
    result.update({name: mean_or_none(share[phase == index]) for index, name in enumerate(PHASES)})
    return result


def was_stopped(blended, guard):
    """Whether guard or fault held the chair in a tick: the guard stopped it, or there was no command to blend."""
    return guard == STOPPED or not np.isfinite(blended).all()


def path_length(log):
    """Length [m] of the true path of ``base_link``."""
    return float(np.hypot(*np.diff(log.truth[:, :2], axis=0).T).sum()) if len(log.time) > 1 else 0.0


def corner_path(footprint, poses):
    """Longest path [m] of any footprint corner along ``poses`` (n, 3): how far a chair moved, turning included."""
    front, rear, side = footprint.front, footprint.rear, footprint.half_width
    outline = np.array([[front, side], [rear, side], [rear, -side], [front, -side]])
    poses = np.asarray(poses, float)
    if len(poses) < 2:
        return 0.0
    tracks = np.stack([se2.transform_points(pose, outline) for pose in poses])
    return float(np.hypot(*np.moveaxis(np.diff(tracks, axis=0), -1, 0)).sum(axis=0).max())


def summarise(episodes):
    """The summary over a list of episode results (dictionaries), as ``evaluate`` prints it.

    Rates and shares leave out starts that do not exist (``no_start``); a share is the mean over the episodes
    that have one.
    """
    driven = [episode for episode in episodes if episode["outcome"] != "no_start"]
    crossed = sum(episode["outcome"] == "crossed" for episode in driven)
    clearances = np.array([e["min_clearance_m"] for e in driven if e["min_clearance_m"] is not None], float)

    def mean(key):
        return mean_or_none([np.nan if e[key] is None else e[key] for e in driven])

    return {
        "episodes": len(episodes),
        "successes": crossed,
        "contacts": sum(episode["outcome"] == "contact" for episode in driven),
        "refused": sum(episode["outcome"] == "refused" for episode in driven),
        "no_start": len(episodes) - len(driven),
        "min_clearance_m": float(clearances.min()) if clearances.size else None,
        "clearance_p05_m": float(np.percentile(clearances, 5)) if clearances.size else None,
        "duration_s": mean("duration_s"),
        "user_share": {
            phase: mean_or_none(
                [np.nan if e["user_share"][phase] is None else e["user_share"][phase] for e in driven]
            )
            for phase in ("all",) + PHASES
        },
        "v_share": mean("v_share"),
        "beta": mean("beta"),
        "guard_active": mean("guard_active"),
        "success_rate": wilson(crossed, len(driven))._asdict(),
    }
