"""Planner `bezier`: a cubic curve from the chair's pose to the door's, renewed as it drives (Chen, Wang 2012, [7][8]).

    B(t) = (1-t)^3 P0 + 3 (1-t)^2 t P1 + 3 (1-t) t^2 P2 + t^3 P3

P0 is the chair, P1 lies ahead of it along its heading, P3 is the middle of the doorway, P2 before it on the normal: the
curve leaves along the heading and meets the door square; a second one goes on from there to the goal. How far P1 and
P2 lie, as shares of the distance, is chosen each cycle among a few: the curve that bends least and keeps clear. Once
the chair is nearer to the door than ``hand_over``, one curve goes to the goal. Where no curve is free, or the door
lies too far aside, the chair turns on the spot, towards the point ``square`` before the door.

Assumed: the planner is told a goal, not a door, so the door is where the assistant's goals put it, ``door_before_goal``
behind the goal on its axis; the weights of bending and clearance; the originals' controller is replaced by ours, which
follows a curve as any path and brakes before what would not stay clear.
"""
import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.planning.navigation import Navigator
from wheelchair_shared_control.planning.planner import STEP, Path, rolled

SHARES = (0.2, 0.35, 0.5, 0.65)  # of the distance: how far P1 and P2 lie from the ends
CLEAR = 0.5  # m: more room than this is not better


class Bezier(Navigator):
    """Follows the best free curve; goals, ages, arrival and giving up are the navigator's."""

    def _drive(self, now, odometry, field, user, candidates):
        own = self.settings.bezier
        acting, anchor = self.commands.predict(now, odometry, user)
        door = se2.compose(self.goal, np.array([-own.door_before_goal, 0.0, 0.0]))
        passes = se2.compose(se2.inverse(door), anchor)[0] > -own.hand_over
        target = self.goal if passes else door
        local = se2.compose(se2.inverse(anchor), target)
        path = None
        if abs(np.arctan2(local[1], local[0])) <= own.aside:
            path = self.best(field, anchor, target, None if passes else curve(door, self.goal, 0.35, 0.35)[1:])
        if path is None:
            return self._turn(now, field, acting, anchor, door)
        self._since_path = None
        return self._along(now, field, acting, path, candidates)

    def best(self, field, start, target, beyond=None):
        """The Path along the curve from ``start`` (3,) to ``target`` (3,) that costs least; None where none is free.

        ``beyond`` (m, 3): poses that every curve is continued by.
        """
        own, best, least = self.settings.bezier, None, np.inf
        for first in SHARES:
            for last in SHARES:
                poses = curve(start, target, first, last)
                path = self._checked(field, start, poses if beyond is None else np.concatenate((poses, beyond)))
                if self.planner.blocked(path) >= 0:
                    continue
                bending = np.sum(path.steps[:, 1] ** 2 / np.maximum(path.steps[:, 0], 1e-3))
                cost = bending + own.clearance_weight * np.sum((CLEAR - np.minimum(path.clear, CLEAR)) ** 2) * STEP
                if cost < least:
                    best, least = path, cost
        return best

    def _checked(self, field, start, poses):
        steps = np.column_stack((np.hypot(*np.diff(poses[:, :2], axis=0).T), se2.wrap_angle(np.diff(poses[:, 2]))))
        poses = rolled(start, steps)
        return Path(steps, poses, np.ones(len(steps), np.int64), self.planner.clearance(field, poses))

    def _turn(self, now, field, acting, anchor, door):
        """Turn on the spot, towards a point square before the door, or wait and give up."""
        point = se2.compose(door, np.array([-self.settings.bezier.square, 0.0, 0.0]))
        if np.hypot(*(point[:2] - anchor[:2])) < self.settings.bezier.near:
            wanted = door[2]
        else:
            wanted = np.arctan2(point[1] - anchor[1], point[0] - anchor[0])
        turn = float(se2.wrap_angle(wanted - anchor[2]))
        if abs(turn) < self.settings.bezier.turned:
            return self._without_path(now, "no curve is free of collision")
        still = self.planner.still(field, acting[:3])
        command = self.commands.legal(field, acting, self.commands.turning(turn), still)
        if command[0] is None:
            return self._without_path(now, "no curve and no turn is free of collision")
        return self._send(now, command[0], "turns towards the door", local_plan=command[1][0])


def curve(start, target, first, last):
    """Poses (n, 3) about every 0.08 m along the curve from ``start`` (3,) to ``target`` (3,).

    ``first``, ``last``: distance of P1 from the start and of P2 from the target, as shares of that between the ends.
    """
    start, target = np.asarray(start, dtype=float), np.asarray(target, dtype=float)
    chord = np.hypot(*(target[:2] - start[:2]))
    p0, p3 = start[:2], target[:2]
    p1 = p0 + first * chord * np.array([np.cos(start[2]), np.sin(start[2])])
    p2 = p3 - last * chord * np.array([np.cos(target[2]), np.sin(target[2])])
    t = np.linspace(0.0, 1.0, max(int(np.ceil(chord / STEP)), 2) + 1)[:, None]
    points = (1 - t) ** 3 * p0 + 3 * (1 - t) ** 2 * t * p1 + 3 * (1 - t) * t**2 * p2 + t**3 * p3
    along = (1 - t) ** 2 * (p1 - p0) + 2 * (1 - t) * t * (p2 - p1) + t**2 * (p3 - p2)
    return np.column_stack((points, np.arctan2(along[:, 1], along[:, 0])))
