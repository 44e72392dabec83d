"""Jambs: the wall's plane and both edges of a gap, refined on all points without bins."""
from typing import NamedTuple, Optional

import numpy as np
from numba import njit

from wheelchair_shared_control.doorway_rays import BEFORE, DEEP, FRONT, SHALLOW, WALL, line_from_normal


class Jambs(NamedTuple):
    """What bounds a gap, in metres along the wall.

    ``left``, ``right``: edges of the clear width. ``wall_left``, ``wall_right``: edges of the opening in the wall's
    face, wider where the frame stands back in it. ``plane``: the middle of the door's thickness behind the wall's
    face, ``measured`` or assumed. ``edge_sigma``: standard deviation of an edge.
    """

    left: float
    right: float
    wall_left: float
    wall_right: float
    plane: float
    measured: bool
    edge_sigma: float


def refined_line(near, line, left, right, sensor_xy, settings):
    """The wall's plane, fitted to all its points beside the gap, weighted by their noise.

    ``near``: Crossings around the gap. Returns (line, standard deviation of the angle, of the offset), or None.
    """
    jamb = settings.jamb
    beside = (near.s < left - jamb.clear) | (near.s > right + jamb.clear)
    on_wall = np.flatnonzero(beside & (near.label == WALL) & (near.z > settings.gap.low))
    count = len(on_wall)
    if count < jamb.min_points:
        return None
    # neighbours share their errors: every few of many tell as much as all
    on_wall = on_wall[:: max(1, count // jamb.fit_points)]
    s, z, offset, noise = (column[on_wall].astype(float) for column in (near.s, near.z, near.offset, near.noise))
    weight = 1.0 / (noise ** 2 + jamb.noise_floor ** 2)
    middle = 0.5 * (left + right)
    height = float(np.average(z, weights=weight))
    design = np.column_stack((np.ones_like(s), s - middle, z - height))
    solution = None
    for _ in range(3):
        normal_matrix = design.T @ (design * weight[:, None])
        # a prior of an upright wall: one strip of wall says nothing about its lean
        normal_matrix[2, 2] += 1.0 / (0.02 ** 2)
        solution = np.linalg.solve(normal_matrix + 1e-9 * np.eye(3), design.T @ (weight * offset))
        residual = offset - design @ solution
        # robust: what stands out of the wall (skirting, switches, posters' edges) loses its say
        scale = np.sqrt(noise ** 2 + 0.01 ** 2)
        weight = 1.0 / (noise ** 2 + jamb.noise_floor ** 2) / (1.0 + (residual / (2.0 * scale)) ** 2)
    shift, slope, lean = solution
    normal = line.normal - slope * line.along
    length = np.hypot(*normal)
    point = line.origin + middle * line.along + shift * line.normal
    refined = line_from_normal(normal / length, point, sensor_xy, float(lean + line.lean), height)
    # neighbouring pixels share their errors (quantised disparity): count one in `correlated` as independent
    n = max(count / jamb.correlated, 2.0)
    spread = float(np.sqrt(np.average(residual ** 2, weights=weight)))
    lever = float(np.sqrt(np.average((s - np.average(s, weights=weight)) ** 2, weights=weight)))
    return refined, spread / np.sqrt(n) / max(lever, 0.05), spread / np.sqrt(n)


def runs_along(near, left, right, settings):
    """On which sides (left, right) of a gap does a wall of its own run along the plane?

    The ends of things that stand across the plane, and walls that meet it at an angle, have points in it too.
    """
    jamb, result = settings.jamb, []
    for side, edge in ((-1.0, left), (1.0, right)):
        outward = side * (near.s - edge)
        beside = np.flatnonzero((outward > 0.0) & (outward < jamb.own_window) & (near.label == WALL) & (
            near.z > settings.gap.low))
        count = len(beside)
        if count < jamb.min_points:
            result.append(False)
            continue
        beside = beside[:: max(1, count // jamb.fit_points)]
        s, offset = outward[beside].astype(float), near.offset[beside].astype(float)
        noise = near.noise[beside].astype(float)
        length = float(np.percentile(s, 95) - np.percentile(s, 5))
        spread = max(float(s.std()), 1e-3)
        slope = float(np.cov(s, offset)[0, 1]) / spread ** 2
        sigma = float(np.median(noise)) / spread / np.sqrt(max(count / jamb.correlated, 1.0))
        result.append(length > jamb.own_length and abs(slope) < jamb.own_slope + sigma and sigma < jamb.own_sigma)
    return tuple(result)


def refined_edges(near, left, right, settings):
    """``Jambs`` from all rays around the gap, whose rough edges are ``left`` and ``right`` [m]."""
    pitch = _pitch(near, left, right)
    near = near.where((near.label != FRONT) | beside_plane(near, settings))
    a = _edge(near, left, -1.0, right - left, pitch, settings)
    b = _edge(near, right, 1.0, right - left, pitch, settings)
    # a wall along the way that begins at the edge is deeper than what is looked at: no jamb's inner face
    back = [edge.back for edge in (a, b) if edge.back is not None and edge.back < 0.9 * settings.gap.reveal_depth]
    face = [edge.face for edge in (a, b) if edge.face > 0.0]
    front = float(np.mean(face)) if face else 0.0
    depth = max(back) - front if back else settings.jamb.thickness
    return Jambs(a.clear, b.clear, a.wall, b.wall, front + 0.5 * max(depth, 0.0), bool(back), max(pitch, 0.003))


def _pitch(near, left, right):
    """Distance [m] between neighbouring columns of rays in the wall's plane."""
    inside = (near.s_cross > left - 0.3) & (near.s_cross < right + 0.3) & (near.label != FRONT)
    count = int(inside.sum())
    if count < 10:
        return 0.02
    z = near.z_cross[inside]
    area = (right - left + 0.6) * max(float(np.percentile(z, 98) - np.percentile(z, 2)), 0.1)
    return float(np.sqrt(area / count))


class _Edge(NamedTuple):
    """``wall`` and ``clear`` edge, ``face``: offset of the frame's face (0: flush), ``back``: where its inner face
    ends, or None."""

    wall: float
    clear: float
    face: float
    back: Optional[float]


def _edge(near, rough, side, width, pitch, settings):
    """One edge: ``side`` -1 for the left, 1 for the right jamb.

    u is the way outward from the rough edge: the gap lies at u < 0, the wall at u > 0.
    """
    jamb, gap = settings.jamb, settings.gap
    window = min(jamb.window, 0.45 * width)
    near = near.where((np.abs(near.s_cross - rough) < window) | (np.abs(near.s - rough) < window))
    near = near.where(near.z > gap.low)
    u_cross, u_end = side * (near.s_cross - rough), side * (near.s - rough)
    close = np.abs(u_cross) < window
    deep = close & (near.label == DEEP)
    # a frame that stands back in the wall: a face of its own, parallel to the wall's, as tall as a door
    stands = (near.label == SHALLOW) & (u_cross < 0.0) & (u_end > -jamb.frame_width) & (
        u_end < -jamb.reveal_band - 0.5 * near.noise)
    framed = (stands & (near.z > settings.volume.tall)).sum() >= jamb.min_reveal
    if (close & (near.label == WALL)).sum() >= jamb.min_reveal:
        shallow = close & (near.label == SHALLOW)
        solid, passed = close & (near.label == WALL), deep
        if framed:
            passed = passed | shallow
        else:
            solid = solid | shallow
        wall = _corner(u_cross[solid], u_end[solid], u_cross[passed], pitch, jamb)
    else:
        wall = _standing(u_end, near, settings)
    edge, face = wall, 0.0
    if framed:
        limit = np.percentile(near.offset[stands], 10) + 2.0 * gap.tolerance + 2.0 * near.noise
        flat = stands & (near.offset < limit)
        if flat.sum() >= jamb.min_reveal:
            face = float(np.median(near.offset[flat]))
            # where each ray meets the plane of that face
            with np.errstate(divide="ignore", invalid="ignore"):
                u_face = u_cross + (u_end - u_cross) * (face / near.offset)
            zone = (u_face > wall - jamb.frame_width - 0.1) & (u_face < wall) & (near.offset > 0.5 * face)
            solid = zone & (near.label != DEEP)
            edge = _corner(u_face[solid], u_end[solid], u_face[zone & ~solid], pitch, jamb)
    inner = (np.abs(u_end - edge) < jamb.reveal_band + 2.0 * near.noise) & (u_cross < wall - jamb.reveal_clear) & (
        near.offset > face + gap.tolerance) & (near.offset < gap.reveal_depth) & (near.label != BEFORE)
    back = float(np.percentile(near.offset[inner], 97)) if inner.sum() >= jamb.min_reveal else None
    return _Edge(rough + side * wall, rough + side * edge, face, back)


def _standing(u_end, near, settings):
    """The edge where no wall is seen beside the gap, but something as tall: a wall along the way, a folded leaf."""
    jamb = settings.jamb
    tall = (near.z > settings.volume.tall) & (np.abs(u_end) < jamb.corner) & beside_plane(near, settings)
    if tall.sum() < jamb.min_reveal:
        return 0.0
    inmost = np.percentile(u_end[tall], 5)
    return float(np.median(u_end[tall & (u_end < inmost + jamb.reveal_band)]))


def beside_plane(near, settings):
    """Rays (mask) that end near the wall's plane, before or behind it."""
    return (np.abs(near.offset) < settings.gap.reveal_depth) & (near.z > settings.gap.low)


def _corner(u_plane, u_end, u_through, pitch, jamb):
    """Where a face ends, from the rays that end on it or on the inner face of its edge.

    A ray that meets the face's plane at ``u_plane`` ends there if that is outward of the edge e, and at u = e on
    the inner face if it is not: u_end = max(u_plane, e), whatever the noise along the ray. Without an inner face in
    view e is the threshold to the rays that pass, ``u_through``.
    """
    threshold = _threshold(u_through, u_plane, pitch, jamb.max_shadow)
    n = len(u_plane)
    step = max(1, n // 3000)
    u_plane, u_end = u_plane[::step].astype(float), u_end[::step].astype(float)
    edges = threshold + np.arange(0.0, jamb.max_reveal, 0.004)
    # a reading far off the model has a bounded say
    bound = jamb.reveal_band
    cost = _costs(u_plane, u_end, edges, bound)
    best = int(np.argmin(cost))
    inside = (u_plane < edges[best]) & (u_plane >= threshold)
    if best == 0 or inside.sum() * step < jamb.min_reveal or cost[0] - cost[best] < 0.004 * inside.sum():
        return threshold
    on_inner = inside & (np.abs(u_end - edges[best]) < bound)
    return float(np.median(u_end[on_inner])) if on_inner.sum() >= 5 else float(edges[best])


@njit(cache=True)
def _costs(u_plane, u_end, edges, bound):
    """Sum (len(edges),) over the rays of how far each ends from where the model of ``_corner`` says."""
    cost = np.zeros(len(edges))
    for k in range(len(edges)):
        for i in range(len(u_plane)):
            cost[k] += min(abs(u_end[i] - max(u_plane[i], edges[k])), bound)
    return cost


def _threshold(low, high, pitch, max_shadow):
    """The threshold that best parts ``low`` from ``high`` values; the middle of a tie.

    Rays cross a plane with the same density on both sides of an edge, so misplaced rays on both sides balance
    and the threshold has no bias.
    """
    if len(high) == 0 or len(low) == 0:
        return 0.0
    values = np.concatenate((low, high))
    is_high = np.concatenate((np.zeros(len(low), dtype=np.int64), np.ones(len(high), dtype=np.int64)))
    order = np.argsort(values, kind="stable")
    values, is_high = values[order], is_high[order]
    # wrong(k): the first k values are called low
    wrong = np.concatenate(([0], np.cumsum(is_high))) + (len(low) - np.concatenate(([0], np.cumsum(1 - is_high))))
    best = np.flatnonzero(wrong == wrong.min())
    k = int(best[len(best) // 2])
    below = values[k - 1] if k > 0 else values[0]
    above = values[k] if k < len(values) else values[-1]
    if above - below > max_shadow:
        # a camera's shadow is blank on one side only: the wall's last reading is the better witness
        return float(above - pitch)
    return float(0.5 * (below + above))
