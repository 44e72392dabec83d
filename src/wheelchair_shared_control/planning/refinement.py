"""Refinement of a path by iterative LQR: the steps of the path are bent until the footprint is centred and square.

The path is a chain of unicycle steps (ds, dtheta), so every iterate can be driven: turns on the spot and reversals
stay what they are. Cost: closeness of the footprint's outline and spine to lethal cells, departure from the searched
path, bending, and the end's distance from the goal. In a gap the outline's two sides pull to the middle with equal
strength; the spine, which only counts where the footprint overlaps something, points there from outside of it.
"""
import numpy as np
from numba import njit

from wheelchair_shared_control.planning.clearance import FAST, clearance, field_gradient

ARC = 0.5  # rad/m: what was searched as an arc stays one
STEER = 0.35  # m: within about three of it a deviation from the path is steered out


@njit(**FAST)
def _roll(start, steps, poses):
    poses[0] = start
    for k in range(steps.shape[0]):
        ds, dth = steps[k, 0], steps[k, 1]
        half = 0.5 * dth
        chord = ds * (1.0 - half * half / 6.0)
        heading = poses[k, 2] + half
        poses[k + 1, 0] = poses[k, 0] + chord * np.cos(heading)
        poses[k + 1, 1] = poses[k, 1] + chord * np.sin(heading)
        poses[k + 1, 2] = poses[k, 2] + dth


@njit(**FAST)
def _track(start, prior, kinds, targets, steps, poses):
    """Fill ``steps`` and ``poses``: the way from ``start`` that steers back to ``targets`` along ``prior``.

    A start beside the path would carry the whole way beside it, into the jambs; from this one it is refined.
    """
    poses[0] = start
    for k in range(prior.shape[0]):
        ds, dth = prior[k, 0], prior[k, 1]
        off = (poses[k, 2] - targets[k, 2] + np.pi) % (2.0 * np.pi) - np.pi
        if kinds[k] == 0:
            dth -= min(max(off, -0.3), 0.3)
        else:
            dx, dy = poses[k, 0] - targets[k, 0], poses[k, 1] - targets[k, 1]
            beside = -np.sin(targets[k, 2]) * dx + np.cos(targets[k, 2]) * dy
            # Both errors die out, critically damped, within a few STEER.
            bend = -kinds[k] * beside / (STEER * STEER) - 2.0 * off / STEER
            dth += min(max(bend, -2.5), 2.5) * abs(ds)
        steps[k, 0], steps[k, 1] = ds, dth
        half = 0.5 * dth
        chord = ds * (1.0 - half * half / 6.0)
        poses[k + 1, 0] = poses[k, 0] + chord * np.cos(poses[k, 2] + half)
        poses[k + 1, 1] = poses[k, 1] + chord * np.sin(poses[k, 2] + half)
        poses[k + 1, 2] = poses[k, 2] + dth


@njit(**FAST)
def _stage(distance, frame, outline, spine, half_width, reach, middle, weights, pose, target, end, g, h):
    """Cost of one pose; adds gradient (3,) and Gauss-Newton Hessian (3, 3)."""
    comfortable, near, w_spine, w_outline, w_near, w_xy, w_yaw, w_end_xy, w_end_yaw = weights[:9]
    g[:] = 0.0
    h[:] = 0.0
    cost = 0.0
    x, y, yaw = pose[0], pose[1], pose[2]
    c, s = np.cos(yaw), np.sin(yaw)
    d, _, _ = field_gradient(distance, frame, x + c * middle, y + s * middle)
    if d < reach + comfortable:
        n, m = spine.shape[0], outline.shape[0]
        for k in range(n + m):
            if k < n:
                px, py = spine[k], 0.0
                scale, limit = w_spine / n, half_width
            else:
                px, py = outline[k - n, 0], outline[k - n, 1]
                scale, limit = w_outline / m, comfortable
            d, gx, gy = field_gradient(distance, frame, x + c * px - s * py, y + s * px + c * py)
            if d >= limit:
                continue
            turn = gx * (-s * px - c * py) + gy * (c * px - s * py)
            r = limit - d
            weight = scale
            cost += 0.5 * scale * r * r
            slope = scale * r
            if k >= n and d < near:
                cost += 0.5 * w_near * (near - d) ** 2
                slope += w_near * (near - d)
                weight += w_near
            g[0] -= slope * gx
            g[1] -= slope * gy
            g[2] -= slope * turn
            h[0, 0] += weight * gx * gx
            h[1, 1] += weight * gy * gy
            h[2, 2] += weight * turn * turn
            h[0, 1] += weight * gx * gy
            h[0, 2] += weight * gx * turn
            h[1, 2] += weight * gy * turn
    if end:
        w_xy, w_yaw = w_end_xy, w_end_yaw
    dx, dy = x - target[0], y - target[1]
    da = (yaw - target[2] + np.pi) % (2.0 * np.pi) - np.pi
    cost += 0.5 * (w_xy * (dx * dx + dy * dy) + w_yaw * da * da)
    g[0] += w_xy * dx
    g[1] += w_xy * dy
    g[2] += w_yaw * da
    h[0, 0] += w_xy
    h[1, 1] += w_xy
    h[2, 2] += w_yaw
    h[1, 0], h[2, 0], h[2, 1] = h[0, 1], h[0, 2], h[1, 2]
    return cost


@njit(**FAST)
def _bend_weights(distance, frame, outline, spine, half_width, reach, middle, weights, prior, targets):
    """Weight (n,) of each step's bending: large in narrow places and shortly before them.

    The front is 0.7 m ahead of the axle: who still bends when the front enters is not square. And the map's jambs
    are ragged: who follows them wags in the door.
    """
    n = prior.shape[0]
    out = np.empty(n)
    left = 0.0
    for k in range(n - 1, -1, -1):
        c = clearance(distance, frame, outline, spine, half_width, reach, middle, 0.5,
                      targets[k + 1, 0], targets[k + 1, 1], targets[k + 1, 2])
        if c < weights[12]:
            left = weights[13]
        stiff = left > 0.0 and prior[k, 0] > 0.01 and abs(prior[k, 1]) < ARC * prior[k, 0]
        out[k] = weights[11] * (1.0 + (weights[14] if stiff else 0.0))
        left -= abs(prior[k, 0]) + 0.3 * abs(prior[k, 1])
    return out


@njit(**FAST)
def _control_cost(steps, prior, weights, w_bends):
    w_ds, w_dth = weights[9], weights[10]
    cost = 0.0
    for k in range(steps.shape[0]):
        a, b = steps[k, 0] - prior[k, 0], steps[k, 1] - prior[k, 1]
        cost += 0.5 * (w_ds * a * a + w_dth * b * b + w_bends[k] * steps[k, 1] ** 2)
    return cost


@njit(**FAST)
def refine(distance, frame, outline, spine, half_width, reach, middle, weights, start, steps, kinds, targets,
           iterations):
    """Refined steps (n, 2), poses (n + 1, 3) and cost, from pose ``start`` along ``steps`` (n, 2), ``kinds`` (n,).

    ``targets`` (n + 1, 3): the poses that the path is held to, the last one the goal.
    """
    n = steps.shape[0]
    prior = steps.copy()
    steps = steps.copy()
    poses = np.empty((n + 1, 3))
    trial = np.empty((n + 1, 3))
    trial_steps = steps.copy()
    feed = np.empty((n, 2))
    gain = np.empty((n, 2, 3))
    g = np.empty((n + 1, 3))
    h = np.empty((n + 1, 3, 3))
    gt, ht = np.empty(3), np.empty((3, 3))
    w_ds, w_dth = weights[9], weights[10]
    w_bends = _bend_weights(distance, frame, outline, spine, half_width, reach, middle, weights, prior, targets)
    _track(start, prior, kinds, targets, steps, poses)
    cost = _control_cost(steps, prior, weights, w_bends)
    for k in range(n + 1):
        cost += _stage(distance, frame, outline, spine, half_width, reach, middle, weights,
                       poses[k], targets[k], k == n, g[k], h[k])
    damping = 1e-3
    for _ in range(iterations):
        # Backward: value function v + vx' dx + dx' vxx dx / 2.
        vx = g[n].copy()
        vxx = h[n].copy()
        for k in range(n - 1, -1, -1):
            w_bend = w_bends[k]
            ds, dth = steps[k, 0], steps[k, 1]
            mid = poses[k, 2] + 0.5 * dth
            c, s = np.cos(mid), np.sin(mid)
            # x' = x + ds cos(yaw + dth / 2), ...: A = I + last column, B (3, 2).
            a0, a1 = -ds * s, ds * c
            q0, q1, q2 = vx[0], vx[1], vx[2]
            qx0, qx1 = q0, q1
            qx2 = q2 + a0 * q0 + a1 * q1
            b00, b10 = c, s
            b01, b11 = -0.5 * ds * s, 0.5 * ds * c
            qu0 = b00 * q0 + b10 * q1 + w_ds * (ds - prior[k, 0])
            qu1 = b01 * q0 + b11 * q1 + q2 + w_dth * (dth - prior[k, 1]) + w_bend * dth
            # W = Vxx A, by columns of A: e0, e1, (a0, a1, 1).
            w02 = vxx[0, 0] * a0 + vxx[0, 1] * a1 + vxx[0, 2]
            w12 = vxx[1, 0] * a0 + vxx[1, 1] * a1 + vxx[1, 2]
            w22 = vxx[2, 0] * a0 + vxx[2, 1] * a1 + vxx[2, 2]
            qxx00, qxx01, qxx11 = vxx[0, 0], vxx[0, 1], vxx[1, 1]
            qxx02 = w02
            qxx12 = w12
            qxx22 = a0 * w02 + a1 * w12 + w22
            # Qux = B' Vxx A
            u00 = b00 * vxx[0, 0] + b10 * vxx[1, 0]
            u01 = b00 * vxx[0, 1] + b10 * vxx[1, 1]
            u02 = b00 * w02 + b10 * w12
            u10 = b01 * vxx[0, 0] + b11 * vxx[1, 0] + vxx[2, 0]
            u11 = b01 * vxx[0, 1] + b11 * vxx[1, 1] + vxx[2, 1]
            u12 = b01 * w02 + b11 * w12 + w22
            u02v = b00 * vxx[0, 2] + b10 * vxx[1, 2]
            # Quu = R + B' Vxx B
            r00 = b00 * u00 + b10 * u01 + w_ds + damping
            r01 = u00 * b01 + u01 * b11 + u02v
            u12v = b01 * vxx[0, 2] + b11 * vxx[1, 2] + vxx[2, 2]
            r11 = u10 * b01 + u11 * b11 + u12v + w_dth + w_bend + damping
            det = r00 * r11 - r01 * r01
            if det < 1e-12:
                det = 1e-12
            i00, i01, i11 = r11 / det, -r01 / det, r00 / det
            feed[k, 0] = -(i00 * qu0 + i01 * qu1)
            feed[k, 1] = -(i01 * qu0 + i11 * qu1)
            gain[k, 0, 0] = -(i00 * u00 + i01 * u10)
            gain[k, 0, 1] = -(i00 * u01 + i01 * u11)
            gain[k, 0, 2] = -(i00 * u02 + i01 * u12)
            gain[k, 1, 0] = -(i01 * u00 + i11 * u10)
            gain[k, 1, 1] = -(i01 * u01 + i11 * u11)
            gain[k, 1, 2] = -(i01 * u02 + i11 * u12)
            # V = Q + K' Qu + Qux' k (+ terms that cancel for the exact minimiser)
            k0, k1 = feed[k, 0], feed[k, 1]
            vx[0] = g[k, 0] + qx0 + u00 * k0 + u10 * k1
            vx[1] = g[k, 1] + qx1 + u01 * k0 + u11 * k1
            vx[2] = g[k, 2] + qx2 + u02 * k0 + u12 * k1
            vxx[0, 0] = h[k, 0, 0] + qxx00 + u00 * gain[k, 0, 0] + u10 * gain[k, 1, 0]
            vxx[0, 1] = h[k, 0, 1] + qxx01 + u00 * gain[k, 0, 1] + u10 * gain[k, 1, 1]
            vxx[0, 2] = h[k, 0, 2] + qxx02 + u00 * gain[k, 0, 2] + u10 * gain[k, 1, 2]
            vxx[1, 1] = h[k, 1, 1] + qxx11 + u01 * gain[k, 0, 1] + u11 * gain[k, 1, 1]
            vxx[1, 2] = h[k, 1, 2] + qxx12 + u01 * gain[k, 0, 2] + u11 * gain[k, 1, 2]
            vxx[2, 2] = h[k, 2, 2] + qxx22 + u02 * gain[k, 0, 2] + u12 * gain[k, 1, 2]
            vxx[1, 0], vxx[2, 0], vxx[2, 1] = vxx[0, 1], vxx[0, 2], vxx[1, 2]
        # Forward, with a line search.
        alpha = 1.0
        improved = False
        for _try in range(5):
            trial[0] = start
            new = 0.0
            for k in range(n):
                e0 = trial[k, 0] - poses[k, 0]
                e1 = trial[k, 1] - poses[k, 1]
                e2 = trial[k, 2] - poses[k, 2]
                for u in range(2):
                    trial_steps[k, u] = (steps[k, u] + alpha * feed[k, u] + gain[k, u, 0] * e0
                                         + gain[k, u, 1] * e1 + gain[k, u, 2] * e2)
                half = 0.5 * trial_steps[k, 1]
                chord = trial_steps[k, 0] * (1.0 - half * half / 6.0)
                trial[k + 1, 0] = trial[k, 0] + chord * np.cos(trial[k, 2] + half)
                trial[k + 1, 1] = trial[k, 1] + chord * np.sin(trial[k, 2] + half)
                trial[k + 1, 2] = trial[k, 2] + trial_steps[k, 1]
            new = _control_cost(trial_steps, prior, weights, w_bends)
            for k in range(n + 1):
                new += _stage(distance, frame, outline, spine, half_width, reach, middle, weights,
                              trial[k], targets[k], k == n, gt, ht)
                if new >= cost:
                    break
            if new < cost:
                improved = True
                break
            alpha *= 0.4
        if not improved:
            damping *= 20.0
            if damping > 10.0:
                break
            continue
        gain_of_cost = cost - new
        cost = new
        damping = max(damping * 0.3, 1e-4)
        steps[:] = trial_steps
        poses[:] = trial
        for k in range(n + 1):
            _stage(distance, frame, outline, spine, half_width, reach, middle, weights,
                   poses[k], targets[k], k == n, g[k], h[k])
        if gain_of_cost < 1e-3 * cost:
            break
    return steps, poses, cost
