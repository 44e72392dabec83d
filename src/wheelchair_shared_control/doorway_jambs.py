"""Jambs: the wall's plane and both edges of a gap, refined on all points without bins."""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control.doorway_rays import DEEP, FRONT, SHALLOW, WALL, Line, line_from_normal


class Jambs(NamedTuple):
    """Edges ``left`` and ``right`` [m] along the wall, the wall's ``thickness`` [m] (``measured`` or assumed), and
    the standard deviation [m] of an edge."""

    left: float
    right: float
    thickness: float
    measured: bool
    edge_sigma: float


def refined_line(near, line, left, right, sensor_xy, settings):
    """The wall's plane, fitted to all its points beside the gap, weighted by their noise.

    ``near``: Crossings around the gap. Returns (line, standard deviation of the angle, of the offset), or None.
    """
    jamb = settings.jamb
    beside = (near.s < left - jamb.clear) | (near.s > right + jamb.clear)
    on_wall = beside & (near.label == WALL) & (near.z > settings.gap.low)
    if on_wall.sum() < jamb.min_points:
        return None
    s, z, offset = (column[on_wall].astype(float) for column in (near.s, near.z, near.offset))
    weight = 1.0 / (near.noise[on_wall].astype(float) ** 2 + jamb.noise_floor ** 2)
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
        scale = np.sqrt(near.noise[on_wall].astype(float) ** 2 + 0.01 ** 2)
        weight = 1.0 / (near.noise[on_wall].astype(float) ** 2 + jamb.noise_floor ** 2) / (
            1.0 + (residual / (2.0 * scale)) ** 2)
    shift, slope, lean = solution
    normal = line.normal - slope * line.along
    length = np.hypot(*normal)
    point = line.origin + middle * line.along + shift * line.normal
    refined = line_from_normal(normal / length, point, sensor_xy, float(lean + line.lean), height)
    # neighbouring pixels share their errors (quantised disparity): count one in `correlated` as independent
    n = max(on_wall.sum() / jamb.correlated, 2.0)
    spread = float(np.sqrt(np.average(residual ** 2, weights=weight)))
    lever = float(np.sqrt(np.average((s - np.average(s, weights=weight)) ** 2, weights=weight)))
    return refined, spread / np.sqrt(n) / max(lever, 0.05), spread / np.sqrt(n)


def refined_edges(near, left, right, settings):
    """``Jambs`` from all rays around the gap, whose rough edges are ``left`` and ``right`` [m]."""
    jamb = settings.jamb
    pitch = _pitch(near, left, right)
    left, left_reveal = _edge(near, left, -1.0, right - left, pitch, settings)
    right, right_reveal = _edge(near, right, 1.0, right - left, pitch, settings)
    depths = [d for d in (left_reveal, right_reveal) if d is not None]
    thickness = max(depths) if depths else jamb.thickness
    return Jambs(left, right, thickness, bool(depths), max(pitch, 0.003))


def _pitch(near, left, right):
    """Distance [m] between neighbouring columns of rays in the wall's plane."""
    inside = (near.s_cross > left - 0.3) & (near.s_cross < right + 0.3) & (near.label != FRONT)
    count = int(inside.sum())
    if count < 10:
        return 0.02
    z = near.z_cross[inside]
    area = (right - left + 0.6) * max(float(np.percentile(z, 98) - np.percentile(z, 2)), 0.1)
    return float(np.sqrt(area / count))


def _edge(near, rough, side, width, pitch, settings):
    """One edge: ``side`` -1 for the left, 1 for the right jamb. Returns (edge, depth of its reveal or None)."""
    jamb = settings.jamb
    # outward coordinate from the rough edge: the gap lies at u < 0, the wall at u > 0
    near = near.where((near.z > settings.gap.low) & (near.z_cross > settings.gap.low) & (near.label != FRONT))
    u_cross = side * (near.s_cross - rough)
    window = np.abs(u_cross) < min(jamb.window, 0.45 * width)
    wall = u_cross[window & (near.label == WALL)].astype(float)
    other = u_cross[window & (near.label != WALL)].astype(float)
    edge = _threshold(other, wall, pitch, jamb.max_shadow)
    # the reveal: rays that enter the gap and end on the jamb's inner face, all at the same s
    u_end = side * (near.s - rough)
    depth = None
    for _ in range(3):
        reveal = (u_cross < edge - jamb.reveal_clear) & (np.abs(u_end - edge) < jamb.reveal_band + 2.0 * near.noise) & (
            near.offset > -0.02) & (near.offset < settings.gap.reveal_depth)
        n = int(reveal.sum())
        if n < jamb.min_reveal or np.percentile(near.offset[reveal], 90) < settings.gap.tolerance:
            break
        edge = float(np.median(u_end[reveal]))
        depth = float(np.percentile(near.offset[reveal], 97))
    return rough + side * edge, depth


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
