"""Legs from where the chair stands, onto a door's axis, through the gap and clear of it.

Everything in the frame of ``crossing_line`` (in a plain wall the door's). A way is a list of ``Leg``; between two of
them the chair turns on the spot or rounds the corner. The leg through the gap lies on the axis and begins at least
``drive/square`` before the plane.
"""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import se2, way_search
from wheelchair_shared_control.ground import room

MARGIN = 0.15  # m: the axis is met so far before the place where the chair must be square
CLEAR = 0.75   # m: the rearmost point so far behind the plane is clear of the door


class Leg(NamedTuple):
    """A straight piece of a way, from ``start`` to ``end`` (2,) [m], driven forward or backward."""

    start: np.ndarray
    end: np.ndarray
    reverse: bool = False

    @property
    def length(self):
        """Length [m]."""
        return float(np.hypot(*(self.end - self.start)))

    @property
    def direction(self):
        """Unit vector (2,) from start to end."""
        return (self.end - self.start) / max(self.length, 1e-9)

    @property
    def heading(self):
        """Yaw [rad] of the chair on this leg."""
        x, y = self.direction
        yaw = float(np.arctan2(y, x))
        return float(se2.wrap_angle(yaw + np.pi)) if self.reverse else yaw


def plan(pose, settings, chair, ground=None, may_reverse=True):
    """Legs (list) from ``pose`` (3,); without ``ground`` the floor before and behind the wall counts as free."""
    drive = settings.drive
    exit_legs = _exit(settings, chair, ground)
    axis_end = exit_legs[0].end
    on_axis = [Leg(np.array([min(pose[0], -drive.square), 0.0]), axis_end)] + exit_legs[1:]
    if pose[0] > -drive.square + 0.05 and abs(pose[1]) < 0.3 and abs(pose[2]) < 1.0:
        return on_axis  # in the gap, or too near to it for anything else
    ways = sorted(_direct(pose, drive, axis_end, may_reverse), key=lambda legs: _cost(pose, legs))
    best = None
    for legs in ways:
        if ground is None or least_room(pose, legs, chair, ground, -drive.square) >= settings.plan.clearance:
            best = legs
            break
    if best is None and ground is not None:
        best = _searched(pose, settings, chair, ground, axis_end)
        if best is not None and not may_reverse and any(leg.reverse for leg in best):
            best = None
    return on_axis if best is None else best + exit_legs[1:]


def crossing_line(settings, chair, ground):
    """Pose (3,) of the straight line on which the chair has most room through the gap, in the door's frame.

    In a plain wall that is the door's axis; where walls or furniture continue the gap on one side, it is moved and
    turned a little.
    """
    x = np.arange(-settings.drive.square, CLEAR - chair.rear + 1e-9, 0.05)
    in_gap = x <= 0.1 - chair.rear
    best, highest = np.zeros(3), -np.inf
    for turn in np.radians(np.arange(-16.0, 16.1, 2.0)):
        for beside in np.arange(-0.16, 0.161, 0.02):
            line = np.array([0.0, beside, turn])
            free = room(ground, chair, se2.compose(line, np.column_stack((x, np.zeros((len(x), 2))))))
            wanted = settings.plan.clearance
            score = min(free[in_gap].min(), wanted) + 0.5 * min(free[~in_gap].min(), wanted)
            score -= 0.1 * abs(turn) + 0.05 * abs(beside)
            if score > highest + 1e-9:
                best, highest = line, score
    return best


def least_room(pose, legs, chair, ground, until=np.inf):
    """Least room [m] of the chair along ``legs`` from ``pose``, turns included, up to x = ``until``."""
    poses, yaw, at = [], pose[2], pose[:2]
    for leg in legs:
        # turn where the chair stands, then drive
        turn = float(se2.wrap_angle(leg.heading - yaw))
        for share in np.linspace(0.0, 1.0, 2 + int(abs(turn) / 0.1)):
            poses.append((at[0], at[1], yaw + share * turn))
        for share in np.linspace(0.0, 1.0, 2 + int(leg.length / 0.08)):
            point = leg.start + share * (leg.end - leg.start)
            poses.append((point[0], point[1], leg.heading))
        yaw, at = leg.heading, leg.end
    poses = np.array(poses)
    kept = poses[poses[:, 0] <= until]
    return float(room(ground, chair, kept).min()) if len(kept) else np.inf


def _cost(pose, legs):
    """Length and turning of a way, in metres."""
    cost, yaw = 0.0, pose[2]
    for leg in legs:
        cost += leg.length * (3.0 if leg.reverse else 1.0)
        turn = abs(float(se2.wrap_angle(leg.heading - yaw)))
        cost += 0.5 * turn + (0.3 if turn > 0.3 or leg.reverse else 0.0)  # a stop
        yaw = leg.heading
    return cost


def settles(remaining, turn, beside=0.0):
    """Whether ``remaining`` metres of axis are enough to become square on it while driving, without a stop."""
    return remaining >= 0.35 + 1.2 * abs(turn) + 5.0 * abs(beside)


def _direct(pose, drive, axis_end, may_reverse):
    """Ways of one to three legs: along the axis, straight to a point of it, or straight back first."""
    x, y, yaw = pose
    if settles(-drive.square - x, yaw, y) or (abs(y) < 0.015 and x < -drive.square):
        yield [Leg(np.array([x, 0.0]), axis_end)]
    back = -np.array([np.cos(yaw), np.sin(yaw)])
    for length in (0.0, 0.3, 0.6, 0.9) if may_reverse else (0.0,):
        at = pose[:2] + length * back
        before = [Leg(pose[:2].copy(), at, reverse=True)] if length else []
        for corner_x in np.arange(-drive.square - MARGIN, min(-drive.square - MARGIN, at[0] + 1.0) - 1.5, -0.1):
            corner = np.array([corner_x, 0.0])
            if np.hypot(*(corner - at)) > 0.15:
                yield before + [Leg(at, corner), Leg(corner, axis_end)]


def _exit(settings, chair, ground):
    """Legs behind the meeting of the axis: the first through the gap, more where the room ends soon behind it."""
    drive = settings.drive
    start = np.array([-drive.square, 0.0])
    straight = [Leg(start, np.array([drive.beyond, 0.0]))]
    if ground is None:
        return straight
    x = np.arange(-chair.rear + 0.1, drive.beyond + 1e-9, 0.05)  # the gap itself is judged by its width
    free = room(ground, chair, np.column_stack((x, np.zeros((len(x), 2))))) >= settings.plan.minimum
    reach = float(x[np.argmin(free)] - 0.05) if not free.all() else float(x[-1])
    if reach >= CLEAR - chair.rear:
        return [Leg(start, np.array([reach, 0.0]))]
    reach = max(reach, 0.3)
    return _turn_behind(settings, chair, ground, start, reach)


def _turn_behind(settings, chair, ground, start, reach):
    """Through the gap and round a corner, for a door that opens on a narrow corridor."""
    lattice = way_search.lattice_through(np.zeros(2), np.array([0.0, -2.5]), np.array([2.5, 2.5]))
    xs, ys = lattice.points()
    ends = []
    for h, yaw in enumerate(lattice.yaws):
        behind = min(chair.rear * np.cos(yaw), chair.front * np.cos(yaw)) - chair.half_width * abs(np.sin(yaw))
        ends += [(i, j, h, 0.0) for i in np.nonzero(xs + behind >= CLEAR)[0] for j in range(len(ys))]
    result = way_search.search(
        ground, chair, lattice, ends, settings.plan.clearance, settings.plan.minimum
    ) if ends else None
    for x in np.arange(reach, 0.25, -0.05):
        corners = way_search.descend(result, np.array([x, 0.0, 0.0])) if result is not None else None
        if corners:
            return [Leg(start, np.array([x, 0.0]))] + _legs(np.array([x, 0.0, 0.0]), corners)
    return [Leg(start, np.array([reach, 0.0]))]


def _searched(pose, settings, chair, ground, axis_end):
    """Legs by the lattice search, shortened where the straight way is as free; None where there is none."""
    drive = settings.drive
    low = np.array([min(-3.6, pose[0] - 1.0), min(-2.5, pose[1] - 1.0)])
    high = np.array([-0.35, max(2.5, pose[1] + 1.0)])
    lattice = way_search.lattice_through(pose[:2], low, high)
    xs, ys = lattice.points()
    axis = int(np.argmin(np.abs(ys)))
    met = np.nonzero((xs <= -drive.square - MARGIN + 1e-6) & (xs > -2.6))[0]
    ends = [(i, axis, 0, -xs[i]) for i in met]
    result = way_search.search(ground, chair, lattice, ends, settings.plan.clearance, settings.plan.minimum)
    corners = way_search.descend(result, pose)
    if corners is None:
        return None
    legs = _legs(pose, corners)
    meeting = np.array([corners[-1][0], 0.0])
    return _shortened(pose, legs + [Leg(meeting, axis_end)], settings, chair, ground)


def _legs(pose, corners):
    """Legs through the corner points of a search, from where the chair is."""
    legs, at = [], pose[:2].copy()
    for x, y, _, reverse in corners[1:]:
        point = np.array([x, y])
        if np.hypot(*(point - at)) > 0.02:
            legs.append(Leg(at, point, bool(reverse)))
            at = point
    return legs


def _shortened(pose, legs, settings, chair, ground):
    """Fewer legs: two or more become one where that has as much room, and costs no more."""
    index, at = 0, pose.copy()
    until = -settings.drive.square
    while index < len(legs) - 2:
        for last in range(len(legs) - 2, index, -1):
            old = legs[index: last + 1]
            if any(leg.reverse for leg in old):
                continue
            after = legs[last + 1: last + 2]
            new = [Leg(legs[index].start, legs[last].end)]
            if new[0].length < 0.05:
                continue
            enough = min(settings.plan.clearance, least_room(at, old + after, chair, ground, until))
            if (
                _cost(at, new + after) <= _cost(at, old + after)
                and least_room(at, new + after, chair, ground, until) >= enough - 1e-6
            ):
                legs = legs[:index] + new + legs[last + 1:]
                break
        leg = legs[index]
        at = np.array([leg.end[0], leg.end[1], leg.heading])
        index += 1
    return legs
