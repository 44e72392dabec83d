"""Following a path of steps: where the chair will be when a command acts, how fast it may go, which command is safe.

The plant: a command acts after the dead time and is approached with a first-order lag, within the
acceleration limits. A command is legal if the chair, driving it for one cycle and then braking, never comes closer
to a lethal cell than the limit, or than it stands already.
"""
from typing import NamedTuple

import numpy as np
from numba import njit

from wheelchair_shared_control.planning.clearance import FAST, SEEN, clearance, known_at

DT = 0.05
SLOW_BEFORE = 0.35  # m
BLIND_REVERSE = 0.1  # m/s, over ground that is only presumed free
EARLIEST = 0.2  # m: no turn begins earlier before its corner
TURN_ON_SPOT = 0.012  # m a step: below, the step is a turn on the spot


class Plant(NamedTuple):
    """Delays [s] and limits of the chair [m/s2, rad/s2]."""

    dead_time: float
    lag: float
    acceleration: float
    turn_acceleration: float


@njit(**FAST)
def _advance(state, v_target, w_target, lag, acc, turn_acc, dt):
    """One step of the chair's state (5,) x, y, yaw, v, w towards a target."""
    gain = 1.0 - np.exp(-dt / lag) if lag > 1e-6 else 1.0
    dv, dw = (v_target - state[3]) * gain, (w_target - state[4]) * gain
    # The limits are the seated person's; a small excess keeps the prediction from lagging a braking chair.
    dv = min(max(dv, -2.0 * acc * dt), 2.0 * acc * dt)
    dw = min(max(dw, -2.0 * turn_acc * dt), 2.0 * turn_acc * dt)
    v, w = state[3] + 0.5 * dv, state[4] + 0.5 * dw
    mid = state[2] + 0.5 * w * dt
    state[0] += v * dt * np.cos(mid)
    state[1] += v * dt * np.sin(mid)
    state[2] += w * dt
    state[3] += dv
    state[4] += dw


@njit(**FAST)
def predict(state, targets, lag, acc, turn_acc, dt):
    """State (5,) after the ``targets`` (n, 2), each lasting ``dt``."""
    out = state.copy()
    for k in range(targets.shape[0]):
        _advance(out, targets[k, 0], targets[k, 1], lag, acc, turn_acc, dt)
    return out


@njit(**FAST)
def rollouts(distance, frame, outline, spine, half_width, reach, middle, state, commands, last, n_steps,
             hold, lag, acc, turn_acc, dt):
    """Drive each command (n, 2) for ``hold`` steps and then brake.

    Returns poses (n, n_steps, 3) and the smallest clearance (n,) on the way to standstill.
    """
    n = commands.shape[0]
    poses = np.empty((n, n_steps, 3))
    least = np.empty(n)
    for i in range(n):
        s = state.copy()
        low = 0.5
        v, w = commands[i, 0], commands[i, 1]
        for k in range(n_steps):
            if k >= hold:
                # Braking keeps the arc: both speeds fall together.
                size = max(abs(v) / acc, abs(w) / turn_acc)
                if size > 0.0:
                    f = max(0.0, 1.0 - dt / size)
                    v *= f
                    w *= f
            _advance(s, v, w, lag, acc, turn_acc, dt)
            poses[i, k, 0], poses[i, k, 1], poses[i, k, 2] = s[0], s[1], s[2]
            c = clearance(distance, frame, outline, spine, half_width, reach, middle, 0.5, s[0], s[1], s[2])
            if c < low:
                low = c
        least[i] = low
    return poses, least


@njit(**FAST)
def project(pose, poses, kinds, first, radius):
    """Step index and fraction where ``pose`` stands on the path, not before step ``first``.

    Only the run of steps of one kind that ``first`` belongs to is looked at, and the next one where this one ends
    within reach: a path that comes back over itself is not cut short. ``radius`` [m] is that of the arc which the
    chair drives where the path turns on the spot, 0 for one that stands: an arc that touches both legs of a corner
    begins ``radius * tan(turn / 2)`` before it.
    """
    n = kinds.shape[0]
    k = first
    while True:
        last = k
        while last + 1 < n and kinds[last + 1] == kinds[k]:
            last += 1
        best, best_step, best_part = np.inf, k, 0.0
        for i in range(k, last + 1):
            ax, ay, at = poses[i, 0], poses[i, 1], poses[i, 2]
            ux, uy, ut = poses[i + 1, 0] - ax, poses[i + 1, 1] - ay, poses[i + 1, 2] - at
            da = (pose[2] - at + np.pi) % (2.0 * np.pi) - np.pi
            scale = 0.1 if kinds[i] != 0 else 1.0
            length = ux * ux + uy * uy + scale * ut * ut
            t = 0.0
            if length > 1e-12:
                t = ((pose[0] - ax) * ux + (pose[1] - ay) * uy + scale * da * ut) / length
            inside = min(max(t, 0.0), 1.0)
            ex, ey = pose[0] - ax - inside * ux, pose[1] - ay - inside * uy
            ea = (pose[2] - at - inside * ut + np.pi) % (2.0 * np.pi) - np.pi
            d = ex * ex + ey * ey + scale * ea * ea
            if d < best - 1e-9:
                best, best_step, best_part = d, i, inside
        if last + 1 >= n:
            return best_step, best_part
        # The end of the run: what is left of it, along the way or in heading.
        left = 0.0
        for i in range(best_step, last + 1):
            part = 1.0 - best_part if i == best_step else 1.0
            if kinds[k] == 0:
                left += part * abs(poses[i + 1, 2] - poses[i, 2])
            else:
                left += part * np.hypot(poses[i + 1, 0] - poses[i, 0], poses[i + 1, 1] - poses[i, 1])
        within = 0.035
        if kinds[k] != 0:
            within = 0.012
            j = last + 1
            while j < n and kinds[j] == 0:
                j += 1
            turn = abs(poses[j, 2] - poses[last + 1, 2])
            within = max(within, min(radius * np.tan(0.5 * min(turn, 2.0)), EARLIEST))
        if left > within:
            return best_step, best_part
        k = last + 1


@njit(**FAST)
def speeds(steps, kinds, clear, seen, at_contact, per_clearance, in_unknown, v_max, v_back, w_max, acc, turn_acc):
    """Rate (n,) [1/s] at which each step is driven: its speeds are steps * rate.

    From the clearance of the pose (``clear`` (n,)), unseen ground, the limits, and braking for what follows.
    """
    n = steps.shape[0]
    rate = np.empty(n)
    v_next, w_next = 0.0, 0.0
    for k in range(n - 1, -1, -1):
        ds, dth = abs(steps[k, 0]), abs(steps[k, 1])
        cap = v_max if steps[k, 0] >= 0.0 else v_back
        # What is narrow is entered at its own speed, not braked for at its edge.
        ahead, c, j = 0.0, clear[k], k
        while j + 1 < n and ahead < SLOW_BEFORE:
            ahead += abs(steps[j, 0])
            j += 1
            c = min(c, clear[j])
        v = min(cap, at_contact + per_clearance * max(c, 0.0))
        if not seen[k]:
            v = min(v, in_unknown if steps[k, 0] >= 0.0 else BLIND_REVERSE)
        w = min(w_max, 0.25 + 3.0 * max(clear[k], 0.0))
        r = 50.0
        if kinds[k] == 0:
            r = min(r, w / max(dth, 1e-4))
            r = min(r, np.sqrt(w_next * w_next + 2.0 * turn_acc * max(dth, 1e-4)) / max(dth, 1e-4))
        else:
            same = k + 1 < n and kinds[k + 1] == kinds[k]
            end = v_next if same else 0.0
            r = min(r, v / max(ds, 1e-4))
            r = min(r, np.sqrt(end * end + 2.0 * acc * ds) / max(ds, 1e-4))
            if dth > 1e-6:
                r = min(r, w_max / dth)
                if same:
                    r = min(r, np.sqrt(w_next * w_next + 2.0 * turn_acc * dth) / dth)
        rate[k] = r
        v_next, w_next = ds * r, dth * r
        if k > 0 and kinds[k - 1] != kinds[k]:
            v_next = 0.0
            w_next = 0.0
    return rate


@njit(**FAST)
def seen_ahead(known, frame, poses, kinds, front, rear, half_width):
    """Whether the ground under the edge that leads was seen, for each step (n,) and its end pose (n, 3)."""
    out = np.ones(poses.shape[0], dtype=np.bool_)
    for k in range(poses.shape[0]):
        c, s = np.cos(poses[k, 2]), np.sin(poses[k, 2])
        edge = rear if kinds[k] < 0 else front
        for side in range(-1, 2):
            if known_at(known, frame, poses[k, 0] + c * edge - s * side * half_width,
                        poses[k, 1] + s * edge + c * side * half_width) != SEEN:
                out[k] = False
    return out


def kinds_of(steps):
    """Kind (n,) of each step: 1 forward, -1 reverse, 0 turn on the spot."""
    return np.where(np.abs(steps[:, 0]) < TURN_ON_SPOT, 0, np.sign(steps[:, 0])).astype(np.int64)
