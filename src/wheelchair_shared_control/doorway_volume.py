"""The door volume: is the space between two jambs open, from the floor up and deep enough to drive through?"""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control.doorway_jambs import beside_plane
from wheelchair_shared_control.doorway_rays import BEFORE, DEEP, FRONT, SHALLOW, WALL


class Verdict(NamedTuple):
    """``reason`` is empty for an open doorway; ``confidence`` in [0, 1]; ``is_shut`` if there are two jambs and
    something between them; ``deep`` is the share of its columns through which rays are seen to go farther than
    ``volume/passage``."""

    reason: str
    confidence: float
    is_shut: bool = False
    deep: float = 0.0


def judge(near, jambs, settings, margin=None, passed=None):
    """``Verdict`` on the gap between ``jambs`` from the rays ``near`` it (Crossings).

    ``margin`` [m]: what stands this near to a jamb belongs to it (default ``volume/margin``). ``passed`` [m]: a ray
    that ends on a jamb's inner face deeper than this counts as passed (default: it tells nothing).
    """
    volume, door = settings.volume, settings.door
    margin = volume.margin if margin is None else margin
    passed = np.inf if passed is None else passed
    left, right = jambs.left, jambs.right
    refuse = lambda reason, shut=False: Verdict(reason, 0.0, shut)  # noqa: E731
    width = right - left
    if not door.min_width <= width <= door.max_width:
        return refuse("%.2f m wide" % width)
    support = []
    for side, edge in ((-1.0, jambs.wall_left), (1.0, jambs.wall_right)):
        reason, share = _jamb(near, side, edge, settings)
        if reason and not reason.startswith("jamb ends"):
            other, share = _corner_jamb(near, side, edge, settings)
            reason = reason if other is None else other
        if reason:
            return refuse(reason + (" left" if side < 0 else " right"))
        support.append(share)

    # what stands in the volume between the jambs, from the wall's front to behind its back
    inner = (near.s > left + margin) & (near.s < right - margin)
    body = inner & (near.offset > -volume.before) & (near.offset < max(2.0 * jambs.plane, 0.1) + volume.behind) & (
        near.z > settings.gap.low) & (near.z < door.height)
    through = (near.s_cross > left + volume.margin) & (near.s_cross < right - volume.margin) & (near.label == DEEP)
    n_through = int(through.sum())
    blocked = int(body.sum()) / float(max(body.sum() + n_through, 1))
    if blocked > volume.max_blocked:
        return refuse("%.0f %% of the rays end in it" % (100.0 * blocked), True)

    # enough of it must be seen to be open, low down too: else it is a window, or unknown (glass, a shadow)
    seen, low, deep = _coverage(near, left, right, margin, passed, settings)
    if seen < volume.min_seen:
        return refuse("%.0f %% of it seen to be open" % (100.0 * seen))
    if low < volume.min_low:
        return refuse("not seen to be open near the floor")

    # a passage behind the jambs' inner faces: between cupboards these are as deep as the cupboards
    inner = max(_inner_depth(near, side, edge, settings) for side, edge in ((-1.0, left), (1.0, right)))
    behind = volume.passage + float(min(inner, volume.max_inner))
    left_clear, right_clear = _passage(near, left, right, margin, behind, settings)
    if right_clear - left_clear < max(door.min_width, volume.min_passage * width):
        return refuse("%.2f m of its width free behind or before it" % max(right_clear - left_clear, 0.0), True)
    confidence = min(1.0, seen) * (1.0 - blocked / volume.max_blocked * 0.5) * min(1.0, min(support) + 0.2)
    return Verdict("", float(np.clip(confidence, 0.0, 1.0)), False, deep)


def is_beside_walls(near, jambs, slant, settings, leads_on=True):
    """Is what is narrow no doorway, but lies between walls that go along the way?

    A corridor that one looks into through a doorway in its side is bounded by the wall about that doorway, whose
    near face is seen on one side before or behind the plane, and by the wall across, seen on the other side the
    other way round; looked at from aside (``slant`` [rad] from the normal) one wall is enough that goes past close to
    both sides of the plane. Or nothing of a wall across the way is seen although it is looked at from aside, a wall
    goes on behind the plane, or it is wider than doors are. Or a wall comes along the way up to the plane, and nothing
    shows that the way leads on (``leads_on``).
    """
    volume = settings.volume
    tall = near.where((near.z > settings.narrow.low) & (np.abs(near.offset) < 0.995))
    sides = [side * (tall.s - edge) for side, edge in ((-1.0, jambs.left), (1.0, jambs.right))]

    def goes_on(outward, width):
        """Before, behind: is next to the way's side nearly every piece taken, 0.3-1 m from the plane?"""
        beside = (outward > -0.05) & (outward < width) & (np.abs(tall.offset) > 0.3)
        pieces = np.bincount((np.abs(tall.offset[beside]) / 0.05).astype(int) + 20 * (tall.offset[beside] > 0.0),
                             minlength=40).reshape(2, 20)[:, 6:]
        return (pieces > 0).mean(axis=1) > volume.corridor

    def comes_along(outward):
        beside = (np.abs(outward) < 0.05) & (tall.offset < -0.1) & (tall.offset > -0.45)
        return len(np.unique((tall.offset[beside] / 0.05).astype(int))) >= 4

    wide = [goes_on(outward, volume.corridor_width) for outward in sides]
    close = [goes_on(outward, 0.08) for outward in sides]
    if (wide[0][0] and wide[1][1]) or (wide[0][1] and wide[1][0]) or (close[0] & close[1]).any():
        return True
    if not leads_on and any(comes_along(outward) for outward in sides):
        return True
    aside = abs(slant) > np.radians(volume.aside)
    if aside and (close[0].all() or close[1].all()):
        return True
    level = (tall.offset > -0.2) & (tall.offset < 0.3)
    across = max(len(np.unique((outward[level & (outward > 0.05) & (outward < 0.35)] / 0.05).astype(int)))
                 for outward in sides)
    if across == 0 and jambs.right - jambs.left > settings.narrow.usual_width:
        return True
    return (aside or wide[0][1] or wide[1][1]) and across < (3 if aside else 2)


def _jamb(near, side, edge, settings):
    """Is there a wall of a door's height right beside ``edge``? Returns (reason, share of wall rays)."""
    jamb = settings.jamb
    solid = (near.label == WALL) | (near.label == BEFORE)
    # where it ends, if it ends there: a wall that meets this one at an angle stands before the plane, not beside
    # the gap
    outward = side * (np.where(solid, near.s, near.s_cross) - edge)
    beside = (outward > jamb.clear) & (outward < jamb.clear + jamb.support_width) & (near.label != FRONT) & (
        near.z_cross > settings.gap.low)
    on_wall = beside & solid
    if on_wall.sum() < jamb.min_points:
        return "one jamb only: none seen", 0.0
    z = near.z_cross[on_wall]
    tall = np.unique((z / 0.05).astype(int)).size * 0.05
    if tall < jamb.min_height:
        return "one jamb only: %.2f m of it seen" % tall, 0.0
    share = on_wall.sum() / float(beside.sum())
    # rays that pass above what stands there: furniture. What ends low where nothing is told above is no jamb either
    top = float(np.percentile(z, 98))
    if top < settings.narrow.low:
        return "one jamb only: %.2f m high" % top, 0.0
    above = beside & ((near.label == SHALLOW) | (near.label == DEEP)) & (near.z_cross > top + 0.03) & (
        near.z_cross < jamb.full_height)
    if above.sum() > 0.1 * beside.sum() and top < jamb.full_height - 0.1:
        return "jamb ends at %.2f m:" % top, 0.0
    if share < jamb.min_share:
        return "jamb is broken:", share
    return "", share


def _corner_jamb(near, side, edge, settings):
    """A jamb that is no wall in the plane but something tall at its edge, such as a wall along the way.

    Returns (reason or "", share), or (None, 0) if there is nothing.
    """
    jamb = settings.jamb
    outward = side * (near.s - edge)
    standing = beside_plane(near, settings) & (outward > -jamb.reveal_band) & (outward < jamb.corner)
    if standing.sum() < jamb.min_points:
        return None, 0.0
    z = near.z[standing]
    if np.unique((z / 0.05).astype(int)).size * 0.05 < jamb.min_height or z.max() < settings.volume.tall:
        return None, 0.0
    top = float(np.percentile(z, 98))
    across = side * (near.s_cross - edge)
    above = (near.label == DEEP) & (across > 0.0) & (across < jamb.corner) & (near.z_cross > top + 0.03) & (
        near.z_cross < jamb.full_height)
    if above.sum() > 0.1 * standing.sum() and top < jamb.full_height - 0.1:
        return "jamb ends at %.2f m:" % top, 0.0
    return "", jamb.min_share


def _coverage(near, left, right, margin, passed, settings):
    """Share of the gap's columns that rays are seen to pass, at all heights, near the floor, and as far as
    ``volume/passage``."""
    volume = settings.volume
    n = max(int((right - left) / 0.04), 1)
    column = ((near.s_cross - left) / (right - left) * n).astype(int)
    inside = (near.s_cross > left) & (near.s_cross < right) & (near.z_cross > settings.gap.low) & (
        near.z_cross < settings.door.height)
    # a ray that ends on the inner face of a jamb tells nothing about the gap's middle: leave its column out
    at_jamb = (near.label == SHALLOW) & ((near.s < left + margin) | (near.s > right - margin))
    # one that ends beside the way, or deeper than a leaf hangs, has passed where a leaf would be
    aside = at_jamb & ((near.offset > passed) | (near.s < left - margin) | (near.s > right + margin))
    reveal = inside & at_jamb & ~aside
    deep = inside & ((near.label == DEEP) | aside)
    shut = inside & ((near.label == WALL) | (near.label == SHALLOW)) & ~reveal & ~aside

    def columns(mask):
        return np.bincount(column[mask], minlength=n)[:n]

    n_deep, n_reveal, n_shut = columns(deep), columns(reveal), columns(shut)
    counted = n_reveal <= n_deep
    counted[0] = counted[-1] = False
    if not counted.any():
        return 0.0, 0.0, 0.0
    good = (n_deep >= volume.min_rays) & (n_deep > 9 * n_shut)
    near_floor = near.z_cross < volume.low_height
    n_low, n_low_shut = columns(deep & near_floor), columns(shut & near_floor)
    low = (n_low >= 2) & (n_low > 4 * n_low_shut)
    # what is seen over the jambs, such as a ceiling, says nothing about the way
    beyond = columns(inside & (near.label == DEEP) & (near.offset > volume.passage) & (
        near.z < settings.wall.high)) >= volume.min_rays
    return float(good[counted].mean()), float(low[counted].mean()), float(beyond.mean())


def _inner_depth(near, side, edge, settings):
    """How deep [m] the inner face of a jamb is seen to go on behind the plane, without a break."""
    at = (np.abs(near.s - edge) < settings.volume.margin) & (near.z > settings.narrow.low) & (near.offset > 0.0) & (
        near.offset < 1.0)
    pieces = np.bincount((near.offset[at] / 0.05).astype(int), minlength=20)[:20] >= settings.volume.min_rays
    # the face about the gap hides the first of it where it is seen from the front
    breaks = np.flatnonzero(~pieces[2:])
    return 0.05 * (2 + (breaks[0] if len(breaks) else 18))


def _passage(near, left, right, margin, behind, settings):
    """Free run [m] between tall things from ``volume/passage_before`` before to ``behind`` the plane."""
    volume = settings.volume
    # what is that near to a jamb's line (a leaf at right angles, its handle, noise) leaves the way free
    low, high = left + margin, right - margin
    tall = (near.z > volume.tall) & (near.z < settings.door.height) & (near.offset < behind) & (
        near.offset > -volume.passage_before) & (near.s > low) & (near.s < high)
    n = max(int((right - left) / 0.03), 1)
    column = ((near.s[tall] - left) / (right - left) * n).astype(int)
    taken = np.bincount(column, minlength=n)[:n] >= volume.min_rays
    edges = np.flatnonzero(np.diff(np.concatenate(([True], taken, [True])).astype(np.int8)))
    if len(edges) < 2:
        return left, left
    starts, stops = edges[::2], edges[1::2]
    best = int(np.argmax(stops - starts))
    step = (right - left) / n
    return left + starts[best] * step, left + stops[best] * step
