"""The clear width where one jamb stands before the other: the shortest free run along one line across the way.

Leaves that stand open, partitions and pillars reach farther into the way than the jamb beside them, but before or
behind the other jamb. What lies between them sideways is then shorter than every line that one can draw across.
"""
import numpy as np

from wheelchair_shared_control import doorway_rays


def levelled(rays, doorway, settings):
    """``doorway`` with the ends of ``level_run`` if its jambs stand staggered and the run is no wider than doors."""
    pose = doorway.pose
    line = doorway_rays.line_from_normal((np.cos(pose[2]), np.sin(pose[2])), pose[:2], rays.origin[:2])
    left, right = np.sort((doorway.jambs - line.origin) @ line.along)
    beyond = settings.stagger.beyond
    near = doorway_rays.near(rays, line, settings, left - beyond, right + beyond)
    distance = float((line.origin - rays.origin[:2]) @ line.normal)
    run = level_run(near, left, right, distance, settings)
    if run is None or run[1] - run[0] > settings.door.max_width:
        return doorway
    ends = line.origin + np.outer(run[:2], line.along) + run[2] * line.normal
    return doorway._replace(pose=np.append(ends.mean(axis=0), pose[2]), width=float(run[1] - run[0]), jambs=ends)


def level_run(near, left, right, distance, settings):
    """The shortest run (low, high, offset) [m] between tall things along one line parallel to the plane, or None.

    None unless every such line with something to both sides is longer than from ``left`` to ``right`` by more than
    ``stagger/longer``: the jambs then stand level, and the finer measurement of their edges holds.
    ``near``: Crossings about the gap; ``distance`` [m] of the sensor from its plane. A jamb whose inner face is
    turned away from the sensor, or is seen too flat for a reading, is taken to be ``stagger/hidden`` deep.
    """
    stagger = settings.stagger
    tall = (near.z > settings.narrow.low) & (near.z < settings.narrow.high) & (
        np.abs(near.offset) < stagger.reach + stagger.row)
    s, offset = near.s[tall].astype(float), near.offset[tall].astype(float)
    # measured inward, so that both sides are the same: how far does a thing reach into the way at each line?
    lines = np.arange(-stagger.reach, stagger.reach + 1e-9, stagger.step)
    inmost = []
    for side, edge in ((-1.0, left), (1.0, right)):
        inward = -side * (s - edge)
        at = (inward > -stagger.beyond) & (inward < stagger.within)
        # the sensor's foot is the origin of s
        hidden = stagger.hidden if side * edge < stagger.flat * distance else 0.0
        inmost.append(_inmost(inward[at], offset[at], lines, hidden, stagger))
    run = right - left - inmost[0] - inmost[1]
    told = np.isfinite(run)
    if not told.any():
        return None
    shortest = float(run[told].min())
    if shortest < right - left + stagger.longer:
        return None
    band = np.flatnonzero(told & (run < shortest + stagger.longer / 2.0))
    k = int(band[len(band) // 2])
    return float(left + inmost[0][k]), float(right - inmost[1][k]), float(lines[k])


def _inmost(inward, offset, lines, hidden, stagger):
    """How far (len(lines),) things reach inward at each line; NaN where too few points tell."""
    result = np.full(len(lines), np.nan)
    half = stagger.row / 2.0
    for k, line in enumerate(lines):
        here = inward[(offset > line - half - hidden) & (offset < line + half)]
        if len(here) >= stagger.min_points:
            # stray points apart
            result[k] = np.partition(here, -stagger.min_points)[-stagger.min_points]
    return result
