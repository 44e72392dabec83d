"""The ground that the moving footprint sweeps: compiled loops over poses and boxes.

The outline is a rectangle (front, rear, half_width), boxes and distances are as in `rectangle`; odom, [m], [s].
"""
import math

import numpy as np
from numba import njit

from wheelchair_shared_control.rectangle import box_distance, nearest, signed_distance

STEP = 0.02  # s between the poses of a rollout: 1.2 cm at 0.6 m/s, 1.5 cm for a corner at 1 rad/s


@njit(cache=True)
def advance(pose, v, w, target_v, target_w, lag, dt):
    """One step of the chair: velocities follow their targets with a first-order lag; returns v, w.

    ``pose`` (3,) is changed in place (a private array of the callers below).
    """
    if lag > 0.0:
        share = 1.0 - math.exp(-dt / lag)
    else:
        share = 1.0
    new_v = v + (target_v - v) * share
    new_w = w + (target_w - w) * share
    mean_v, mean_w = 0.5 * (v + new_v), 0.5 * (w + new_w)
    heading = pose[2] + 0.5 * mean_w * dt
    pose[0] += mean_v * dt * math.cos(heading)
    pose[1] += mean_v * dt * math.sin(heading)
    pose[2] += mean_w * dt
    return new_v, new_w


@njit(cache=True)
def coast(pose, v, w, sent, since, until, dead_time, lag):
    """Where the commands already sent bring the chair: pose (3,), v, w at time ``until`` [s].

    ``sent`` (n, 3) holds time, v, w in rising time; each acts ``dead_time`` later. ``pose``, ``v``, ``w`` were
    measured at ``since``.
    """
    pose = pose.copy()
    t = since
    i = -1
    while t < until - 1e-9:
        dt = min(STEP, until - t)
        while i + 1 < sent.shape[0] and sent[i + 1, 0] + dead_time <= t + 0.5 * dt:
            i += 1
        if i >= 0:
            v, w = advance(pose, v, w, sent[i, 1], sent[i, 2], lag, dt)
        else:
            v, w = advance(pose, v, w, v, w, lag, dt)
        t += dt
    return pose, v, w


@njit(cache=True)
def brake(pose, v, w, command_v, command_w, hold, deceleration, turn_deceleration, lag):
    """Rollout of a command held for ``hold`` [s] and then braked along its arc: poses (n, 3), times (n,)."""
    stop_time = max(abs(command_v) / deceleration, abs(command_w) / turn_deceleration)
    # after eight lags a ten thousandth of any speed is left
    most = int((hold + stop_time + 8.0 * lag) / STEP) + 4
    poses = np.empty((most, 3))
    times = np.empty(most)
    state = pose.copy()
    n, t = 0, 0.0
    while n < most:
        poses[n] = state
        times[n] = t
        n += 1
        # the middle of the step stands for the step
        braked = t + 0.5 * STEP - hold
        scale = 1.0
        if braked > 0.0:
            scale = 1.0 - braked / stop_time if braked < stop_time else 0.0
        v, w = advance(state, v, w, command_v * scale, command_w * scale, lag, STEP)
        t += STEP
        if scale == 0.0 and abs(v) < 0.01 and abs(w) < 0.01:
            if n < most:
                poses[n] = state
                times[n] = t
                n += 1
            break
    return poses[:n], times[:n]


@njit(cache=True)
def first_violation(
    poses, times, boxes, velocities, margins, presumed, passing, closest, horizon, front, rear, half_width, rim,
):
    """Index of the box that the sweep comes too close to first, and of the pose; -1, -1 if none.

    ``boxes`` (n, 4) stand where they are at time 0 and move with ``velocities`` (n, 2) for ``horizon`` [s].
    A box outside the outline at pose 0 must stay ``min(margin, present clearance)`` away, where the present
    clearance is that of the nearest such box: the chair may pass along what it already stands close to, and
    ``passing`` [m] closer, for its raggedness, yet no closer than ``closest``. A box inside must not get deeper. A
    moving box must not be met sooner than by standing still. A margin of 0 marks unknown ground, which must not come
    further than ``rim`` [m] below the outline; -inf a box of no account. Boxes from index ``presumed`` on are only
    taken to stand there: near one of them the chair may come no nearer to the others than without it.

    No corner moves further between two poses than ``travel`` says, so that a box which is far away needs no
    look until the chair has come as far as it is away; how far that is its circle says.
    """
    n, m = boxes.shape[0], poses.shape[0]
    if n == 0:
        return -1, -1
    radius = math.sqrt(max(front, -rear) ** 2 + half_width * half_width)
    travel = np.zeros(m)
    for j in range(1, m):
        dx, dy = poses[j, 0] - poses[j - 1, 0], poses[j, 1] - poses[j - 1, 1]
        travel[j] = travel[j - 1] + math.sqrt(dx * dx + dy * dy) + radius * abs(poses[j, 2] - poses[j - 1, 2])
    cosines, sines = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y, cos0, sin0 = poses[0, 0], poses[0, 1], cosines[0], sines[0]
    widest = 0.0
    for i in range(n):
        widest = max(widest, margins[i])
    starts, sizes = np.empty(n), np.empty(n)
    present = beside = math.inf
    for i in range(n):
        dx, dy = boxes[i, 1] - boxes[i, 0], boxes[i, 3] - boxes[i, 2]
        sizes[i] = 0.5 * math.sqrt(dx * dx + dy * dy)
        dx, dy = 0.5 * (boxes[i, 0] + boxes[i, 1]) - x, 0.5 * (boxes[i, 2] + boxes[i, 3]) - y
        starts[i] = signed_distance(
            cos0 * dx + sin0 * dy, cos0 * dy - sin0 * dx, front, rear, half_width
        ) - sizes[i]
        # farther than any margin it does not matter how far
        if sizes[i] > 0.0 and starts[i] <= widest:
            starts[i] = box_distance(boxes[i], x, y, cos0, sin0, front, rear, half_width)
        if margins[i] > 0.0 and 0.0 <= starts[i]:
            beside = min(beside, starts[i])
            if i < presumed:
                present = min(present, starts[i])
    if passing > 0.0:
        present = max(present - passing, min(present, closest))
        beside = max(beside - passing, min(beside, closest))
    first_box, first_pose = -1, m
    box = np.empty(4)
    for i in range(n):
        if margins[i] == -math.inf or (i >= presumed and starts[i] < 0.0):  # where the chair is there is no wall
            continue
        if margins[i] <= 0.0:
            limit = min(-rim, starts[i])
        elif starts[i] >= 0.0:
            limit = min(margins[i], present if i < presumed else beside)
        else:
            limit = starts[i]
        limit -= 1e-6
        vx, vy = velocities[i, 0], velocities[i, 1]
        moves = vx != 0.0 or vy != 0.0
        speed = math.sqrt(vx * vx + vy * vy)
        j, d = 0, starts[i]
        while True:
            room = d - limit
            k = j + 1
            while k < first_pose and travel[k] - travel[j] + speed * (times[k] - times[j]) < room:
                k += 1
            if k >= first_pose:
                break
            j = k
            t = min(times[j], horizon)
            px, py = 0.5 * (boxes[i, 0] + boxes[i, 1]) + vx * t, 0.5 * (boxes[i, 2] + boxes[i, 3]) + vy * t
            dx, dy = px - poses[j, 0], py - poses[j, 1]
            d = signed_distance(
                cosines[j] * dx + sines[j] * dy, cosines[j] * dy - sines[j] * dx, front, rear, half_width
            ) - sizes[i]
            if d < limit:
                box[0], box[1] = boxes[i, 0] + vx * t, boxes[i, 1] + vx * t
                box[2], box[3] = boxes[i, 2] + vy * t, boxes[i, 3] + vy * t
                d = box_distance(box, poses[j, 0], poses[j, 1], cosines[j], sines[j], front, rear, half_width)
            if d < limit:
                if moves:
                    standing = box_distance(box, x, y, cos0, sin0, front, rear, half_width)
                    if d >= standing - 1e-6:
                        continue
                first_box, first_pose = i, j
                break
    if first_box < 0:
        return -1, -1
    return first_box, first_pose


@njit(cache=True)
def way_is_closed(boxes, pose, forward, length, front, rear, half_width):
    """Whether any of ``boxes`` (n, 4) lies in the lane of the outline, up to ``length`` [m] before or behind it."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for k in range(boxes.shape[0]):
        for i in range(2):
            dx = boxes[k, i] - pose[0]
            for j in range(2, 4):
                dy = boxes[k, j] - pose[1]
                if abs(cos * dy - sin * dx) < half_width:
                    beyond = cos * dx + sin * dy - front if forward else rear - cos * dx - sin * dy
                    if 0.0 < beyond < length:
                        return True
    return False


@njit(cache=True)
def _steps_to_collision(pose, v, w, points, steps, step, front, rear, half_width):
    state = pose.copy()
    start = nearest(points, state[0], state[1], state[2], front, rear, half_width)
    for i in range(1, steps + 1):
        advance(state, v, w, v, w, 0.0, step)
        clearance = nearest(points, state[0], state[1], state[2], front, rear, half_width)
        # already inside (a false cell): only what goes deeper is a collision
        if clearance <= 0.0 and clearance < start:
            return i
    return -1


def time_to_collision(footprint, pose, command, points, horizon, step):
    """Time [s] until ``command``, held, brings the footprint onto one of ``points`` (n, 2); inf within ``horizon``.

    ``footprint`` has length, width and axle_to_rear [m]; looked at every ``step`` [s]; a collision within the
    first step gives 0.
    """
    steps = int(math.ceil(horizon / step - 1e-9))
    hit = _steps_to_collision(
        np.array(pose, dtype=float), command.v, command.w, np.ascontiguousarray(points, dtype=float), steps, step,
        footprint.length - footprint.axle_to_rear, -footprint.axle_to_rear, 0.5 * footprint.width,
    )
    return math.inf if hit < 0 else (hit - 1) * step
