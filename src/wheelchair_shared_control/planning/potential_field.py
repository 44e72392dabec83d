"""Planner `potential_field`: the goal attracts, obstacles repel, and the chair yields (Khatib 1985, [12]).

Attraction acts on the middle of the front edge, of size 1 far from the goal and falling in proportion within ``far``:

    F = D / max(|D|, far)                              D: from the front's place to where it is at the goal

Repulsion acts on points about the outline (Khatib's points subjected to the potential), each from what is nearest:

    F = eta (1/r - 1/r0) / r^2  grad r                 within r0, else none

The chair cannot yield sideways, so the sum along the heading is the speed, and the sum across it, each force by its
lever before the axle as a share of the front edge's, is the turn rate, both times a gain. There is no path and no look
ahead: the field has local minima, such as the wall beside a door, and the chair stands in them until the goal is given
up for want of progress. Nothing checks the command; that is the guard's.

Assumed: which points (four along each side, the middle of the front), and speeds in place of Khatib's accelerations,
which a commanded base hides. r is the costmap's distance, at least ``closest``.
"""
import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.planning import clearance
from wheelchair_shared_control.planning.navigation import Navigator, may_reverse

SHOWN = np.linspace(0.0, 1.0, 6)  # s of the command, as the local plan


class PotentialField(Navigator):
    """Drives down the gradient; goals, ages, arrival and giving up are the navigator's."""

    def __init__(self, settings):
        super().__init__(settings)
        box = self.planner.footprint
        sides = [(x, side * box.half_width) for x in np.linspace(box.rear, box.front, 4) for side in (1.0, -1.0)]
        self._points = np.array(sides + [(box.front, 0.0)])
        self._levers = self._points[:, 0] / box.front

    def _drive(self, now, odometry, field, user, candidates):
        own = self.settings.potential_field
        along, across = self.push(field, odometry.pose)
        v = min(own.speed_gain * along, self.commands.v_max)
        if v < 0.0:
            v = max(v, self.settings.planner.min_vel_x) if may_reverse(user) else 0.0
        w = min(max(own.turn_gain * across, -self.commands.w_max), self.commands.w_max)
        command = self.commands.limited(v, w)
        ahead = se2.integrate(odometry.pose, command.v, command.w, SHOWN)
        return self._send(now, command, "", local_plan=ahead)

    def push(self, field, pose):
        """The forces at ``pose`` (3,): their sum along the heading, and across it by their levers (left positive)."""
        own, front = self.settings.potential_field, np.array([[self.planner.footprint.front, 0.0]])
        way = (se2.transform_points(self.goal, front) - se2.transform_points(pose, front))[0]
        forces = [way / max(np.hypot(*way), own.far)]
        for x, y in se2.transform_points(pose, self._points):
            distance, *gradient = clearance.field_gradient(field.distance, field.frame, x, y)
            forces.append(repulsion(distance, np.array(gradient), own))
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        forces = np.array(forces) @ np.array([[cos, -sin], [sin, cos]])  # into base_link
        return float(forces[:, 0].sum()), float(forces[0, 1] + self._levers @ forces[1:, 1])


def repulsion(distance, gradient, own):
    """Force (2,) on a point ``distance`` [m] from the nearest obstacle, which lies against ``gradient`` (2,)."""
    if distance >= own.reach:
        return np.zeros(2)
    distance = max(distance, own.closest)
    return own.repulsion * (1.0 / distance - 1.0 / own.reach) / distance**2 * gradient
