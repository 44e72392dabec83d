"""The ground that the moving footprint sweeps: compiled loops over cells, poses, points and boxes.

The chair is a rectangle (front, rear, half_width) in ``base_link``; points are in odom, and so are boxes
(x low, x high, y low, y high), along whose axes they lie. The signed distance of a point is its distance to the
outline, negative inside by the depth below the nearest edge; that of a box is the distance between the two.
"""
import math

import numpy as np
from numba import njit

STEP = 0.02  # s between the poses of a rollout: 1.2 cm at 0.6 m/s, 1.5 cm for a corner at 1 rad/s


@njit(cache=True)
def signed_distance(x, y, front, rear, half_width):
    """Signed distance [m] of a point (x, y) in ``base_link`` to the rectangle's outline."""
    dx = max(rear - x, x - front)
    dy = abs(y) - half_width
    if dx <= 0.0 and dy <= 0.0:
        return max(dx, dy)
    dx = max(dx, 0.0)
    dy = max(dy, 0.0)
    return math.sqrt(dx * dx + dy * dy)


@njit(cache=True)
def box_distance(box, x, y, cos, sin, front, rear, half_width):
    """Signed distance [m] of a ``box`` (4,) to the outline of a chair at x, y whose yaw has ``cos``, ``sin``.

    Of two rectangles that do not overlap one's corner is the nearest to the other. Inside the outline counts the
    deepest corner of the box.
    """
    best = math.inf
    for i in range(2):
        dx = box[i] - x
        for j in range(2, 4):
            dy = box[j] - y
            d = signed_distance(cos * dx + sin * dy, cos * dy - sin * dx, front, rear, half_width)
            if d < best:
                best = d
    if best <= 0.0 or (box[0] == box[1] and box[2] == box[3]):
        return best
    for i in range(2):
        u = front if i else rear
        for j in range(2):
            w = half_width if j else -half_width
            px, py = x + cos * u - sin * w, y + sin * u + cos * w
            dx, dy = max(box[0] - px, px - box[1]), max(box[2] - py, py - box[3])
            if dx <= 0.0 and dy <= 0.0:
                d = max(dx, dy)
            else:
                dx, dy = max(dx, 0.0), max(dy, 0.0)
                d = math.sqrt(dx * dx + dy * dy)
            if d < best:
                best = d
    return best


@njit(cache=True)
def nearest(points, x, y, yaw, front, rear, half_width):
    """Signed distance [m] of the nearest of ``points`` (n, 2) at a pose; inf without points."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    best = math.inf
    for i in range(points.shape[0]):
        dx, dy = points[i, 0] - x, points[i, 1] - y
        d = signed_distance(cos * dx + sin * dy, cos * dy - sin * dx, front, rear, half_width)
        if d < best:
            best = d
    return best


@njit(cache=True)
def within(points, pose, front, rear, half_width, reach):
    """Whether each of ``points`` (n, 2) is nearer to the footprint at ``pose`` than ``reach`` [m]: (n,) bool."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    near = np.empty(points.shape[0], np.bool_)
    for i in range(points.shape[0]):
        dx, dy = points[i, 0] - pose[0], points[i, 1] - pose[1]
        near[i] = signed_distance(cos * dx + sin * dy, cos * dy - sin * dx, front, rear, half_width) < reach
    return near


@njit(cache=True)
def prolong(walls, points, pose, reach, corridor, step, pitch, deepest, front, rear, half_width):
    """Points (k, 2), ``pitch`` [m] apart, in the gaps of walls that go on straight ahead of ``pose`` (3,).

    A wall (x, y, x, y), one of ``walls`` (m, 4), leads from its first point to its second. Where any of ``points``
    (n, 2), centres of cells with edges of ``step`` [m], lie within ``corridor`` [m] beside its continuation, up to
    ``reach`` [m] on, the continuation is closed up to there, but for pieces of ``step`` [m] in which one of them lies
    on it, or on the chair's side, anyway. A wall that leads more than ``deepest`` [m] into the footprint, or across
    the chair's way (60 degrees), is none.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    pieces = int(reach / step)
    each = int(step / pitch) + 1
    out = np.empty((len(walls) * pieces * each, 2))
    count = 0
    for i in range(len(walls)):
        x, y = walls[i, 2], walls[i, 3]
        dx, dy = x - walls[i, 0], y - walls[i, 1]
        length = math.sqrt(dx * dx + dy * dy)
        if not length > 0.0 or cos * dx + sin * dy < 0.5 * length:
            continue
        dx, dy = dx / length, dy / length
        away = 1.0 if (pose[0] - x) * dy - (pose[1] - y) * dx > 0.0 else -1.0  # side on which the chair is not
        held, furthest = np.zeros(pieces, np.bool_), -1
        for j in range(len(points)):
            px, py = points[j, 0] - x, points[j, 1] - y
            along = px * dx + py * dy
            behind = away * (py * dx - px * dy)
            if along >= 0.0 and abs(behind) <= corridor:
                piece = int(along / step)
                if piece < pieces:
                    if behind <= 0.6 * step:
                        held[piece] = True
                    furthest = max(furthest, piece)
        begin = count
        for piece in range(furthest):
            for k in range(0 if held[piece] else each):
                along = (piece + k / each) * step
                px, py = x + along * dx - pose[0], y + along * dy - pose[1]
                if signed_distance(cos * px + sin * py, cos * py - sin * px, front, rear, half_width) < -deepest:
                    furthest = -1
                out[count, 0], out[count, 1] = x + along * dx, y + along * dy
                count += 1
        if furthest < 0:
            count = begin
    return out[:count].copy()


@njit(cache=True)
def gather(
    cells, surface, resolution, origin_x, origin_y, pose, front, rear, half_width, reach, unknown_reach, ground,
    ground_resolution,
):
    """Lethal and unknown cell centres (n, 2), (m, 2) nearer to the footprint at ``pose`` than their reach [m].

    And the boxes (n, 4) of what stands in the lethal cells: those of ``surface``, as `Grid` has it, or, where that
    is empty, the whole cells. A box reaches to the edge of its cell where the next cell is lethal, too: what lies
    between two places that returned is no gap.

    Only cells at the edge of their kind: a sweep meets those first. Ground off the grid is unknown. ``ground``
    (k, k, 2), k a power of two, remembers cells that the chair has driven over, by their index modulo k: those
    are known to be free even where the grid knows nothing.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    radius = math.sqrt(max(front, -rear) ** 2 + half_width * half_width) + max(reach, unknown_reach)
    # one cell more on every side, so that each cell that counts has its four neighbours
    first_c = int(math.floor((pose[0] - radius - origin_x) / resolution)) - 1
    first_r = int(math.floor((pose[1] - radius - origin_y) / resolution)) - 1
    width = int(math.ceil(2.0 * radius / resolution)) + 3
    rows, columns = cells.shape
    mask = ground.shape[0] - 1
    kinds = np.zeros((width, width), np.int8)  # 1 lethal, 2 unknown, 0 known and free, or too far away
    dx_x, dx_y = cos * resolution, -sin * resolution
    for i in range(width):
        r = first_r + i
        y = origin_y + (r + 0.5) * resolution
        gy = int(math.floor(y / ground_resolution))
        dy = y - pose[1]
        x0 = origin_x + (first_c + 0.5) * resolution - pose[0]
        local_x, local_y = cos * x0 + sin * dy, cos * dy - sin * x0
        inside_row = 0 <= r < rows
        for j in range(width):
            c = first_c + j
            value = -1
            if inside_row and 0 <= c < columns:
                value = cells[r, c]
            if value == 100:
                kinds[i, j] = 1
            elif value == -1:
                u, w = local_x + j * dx_x, local_y + j * dx_y
                limit = unknown_reach + 2.0 * resolution
                if rear - limit < u < front + limit and abs(w) < half_width + limit:
                    gx = int(math.floor((origin_x + (c + 0.5) * resolution) / ground_resolution))
                    if ground[gy & mask, gx & mask, 0] != gx or ground[gy & mask, gx & mask, 1] != gy:
                        kinds[i, j] = 2
    fine = surface.shape[0] == rows and surface.shape[1] == columns
    quarter = 0.25 * resolution
    lethal = np.empty((width * width, 2))
    boxes = np.empty((width * width, 4))
    unknown = np.empty((width * width, 2))
    n_lethal, n_unknown = 0, 0
    for i in range(1, width - 1):
        y = origin_y + (first_r + i + 0.5) * resolution
        dy = y - pose[1]
        for j in range(1, width - 1):
            kind = kinds[i, j]
            if kind == 0 or (
                kinds[i, j - 1] == kind and kinds[i, j + 1] == kind
                and kinds[i - 1, j] == kind and kinds[i + 1, j] == kind
                and (kind == 2 or not fine or (
                    kinds[i - 1, j - 1] == kind and kinds[i - 1, j + 1] == kind
                    and kinds[i + 1, j - 1] == kind and kinds[i + 1, j + 1] == kind))
            ):
                continue
            x = origin_x + (first_c + j + 0.5) * resolution
            dx = x - pose[0]
            d = signed_distance(cos * dx + sin * dy, cos * dy - sin * dx, front, rear, half_width)
            if kind == 1 and d <= reach:
                lethal[n_lethal, 0], lethal[n_lethal, 1] = x, y
                x_low, x_high, y_low, y_high = 0.0, 4.0, 0.0, 4.0
                if fine:
                    r, c = first_r + i, first_c + j
                    x_low, x_high = surface[r, c, 0], surface[r, c, 1] + 1.0
                    y_low, y_high = surface[r, c, 2], surface[r, c, 3] + 1.0
                    if kinds[i, j - 1] == 1:
                        x_low = min(x_low, 0.0)
                    if kinds[i, j + 1] == 1:
                        x_high = max(x_high, 4.0)
                    if kinds[i - 1, j] == 1:
                        y_low = min(y_low, 0.0)
                    if kinds[i + 1, j] == 1:
                        y_high = max(y_high, 4.0)
                left, below = x - 2.0 * quarter, y - 2.0 * quarter
                boxes[n_lethal, 0], boxes[n_lethal, 1] = left + x_low * quarter, left + x_high * quarter
                boxes[n_lethal, 2], boxes[n_lethal, 3] = below + y_low * quarter, below + y_high * quarter
                n_lethal += 1
            elif kind == 2 and d <= unknown_reach:
                unknown[n_unknown, 0], unknown[n_unknown, 1] = x, y
                n_unknown += 1
    return lethal[:n_lethal].copy(), boxes[:n_lethal].copy(), unknown[:n_unknown].copy()


@njit(cache=True)
def remember(ground, ground_resolution, pose, front, rear, half_width):
    """Mark in ``ground`` the cells whose centre lies below the footprint at ``pose`` as driven over."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    radius = math.sqrt(max(front, -rear) ** 2 + half_width * half_width)
    mask = ground.shape[0] - 1
    for gy in range(
        int(math.floor((pose[1] - radius) / ground_resolution)),
        int(math.floor((pose[1] + radius) / ground_resolution)) + 1,
    ):
        dy = (gy + 0.5) * ground_resolution - pose[1]
        for gx in range(
            int(math.floor((pose[0] - radius) / ground_resolution)),
            int(math.floor((pose[0] + radius) / ground_resolution)) + 1,
        ):
            dx = (gx + 0.5) * ground_resolution - pose[0]
            if signed_distance(cos * dx + sin * dy, cos * dy - sin * dx, front, rear, half_width) <= 0.0:
                ground[gy & mask, gx & mask, 0] = gx
                ground[gy & mask, gx & mask, 1] = gy


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
