"""Which doorway the person means, and where behind it the chair shall stand.

Doorways, poses and grids are in the odom frame; lengths in metres, angles in radians.
"""
from typing import NamedTuple, Optional

import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.footprint import distance_to_points, grown
from wheelchair_shared_control.grid import occupied_points

NO_ROOM = "no room behind the door"
BEHIND = 0.3  # m behind the plane the way to the goal begins: clear of walls up to 0.5 m thick


class Choice(NamedTuple):
    """The doorway meant, or None and the reason in words."""

    doorway: Optional[object]
    reason: str


def stick_direction(user, limits):
    """Direction [rad] in ``base_link`` in which a stick points, None where it rests or points back.

    Pushed straight forward 0, pushed left pi / 2: the angle of the stick itself, in shares of its limits.
    """
    if user is None or not np.isfinite(user).all():
        return None
    forward, left = user.v / limits.speed, user.w / limits.turn_rate
    if forward < 0.0 or np.hypot(forward, left) < 0.1:
        return None
    return float(np.arctan2(left, forward))


def facing_away(doorway, pose):
    """The doorway with its normal pointing away from ``pose`` (3,)."""
    to_door = doorway.pose[:2] - pose[:2]
    normal = np.array([np.cos(doorway.pose[2]), np.sin(doorway.pose[2])])
    if to_door @ normal >= 0.0:
        return doorway
    turned = np.array([doorway.pose[0], doorway.pose[1], se2.wrap_angle(doorway.pose[2] + np.pi)])
    return doorway._replace(pose=turned, jambs=doorway.jambs[::-1])


def choose(doorways, pose, user, settings, chair):
    """The doorway that the chair faces and the stick points at.

    ``settings`` is ``doorway_assistant``'s, ``chair`` the footprint. The cost of a doorway is its bearing,
    plus its angle to the stick's direction (a stick at rest says nothing), plus a little for its distance.
    """
    best, lowest, reason = None, np.inf, "no doorway in view"
    limits = settings.choice
    stick = stick_direction(user, settings.wheelchair.limits)
    needed = chair.width + 2.0 * limits.side_clearance
    for candidate in doorways:
        doorway = facing_away(candidate, pose)
        offset = doorway.pose[:2] - pose[:2]
        distance = float(np.hypot(*offset))
        direction = float(np.arctan2(offset[1], offset[0]))
        bearing = float(se2.wrap_angle(direction - pose[2]))
        incidence = abs(float(se2.wrap_angle(doorway.pose[2] - direction)))
        if not np.isfinite([distance, bearing, incidence, doorway.width, doorway.confidence]).all():
            reason = "the doorway is not finite"
        elif doorway.width < needed:
            reason = "the doorway is %.2f m wide, the chair needs %.2f m" % (doorway.width, needed)
        elif doorway.confidence < limits.confidence:
            reason = "the doorway's confidence is %.2f, needed %.2f" % (doorway.confidence, limits.confidence)
        elif distance > limits.distance:
            reason = "the doorway is %.1f m away, limit %.1f m" % (distance, limits.distance)
        elif abs(bearing) > limits.bearing:
            reason = "the doorway is %.0f degrees off the heading, limit %.0f" % (
                np.degrees(abs(bearing)), np.degrees(limits.bearing))
        elif incidence > limits.incidence:
            reason = "the doorway is seen %.0f degrees from its side, limit %.0f" % (
                np.degrees(incidence), np.degrees(limits.incidence))
        else:
            cost = abs(bearing) + limits.distance_weight * distance
            if stick is not None:
                cost += limits.stick_weight * abs(float(se2.wrap_angle(bearing - stick)))
            if cost < lowest:
                best, lowest = doorway, cost
    return Choice(best, "" if best is not None else reason)


def free_goal(door_pose, grid, chair, settings):
    """Goal pose (3,) behind a door, None where there is no room (paper, section III: 1 m inside).

    The pose 1 m beyond the plane; where the footprint meets a lethal cell there, the nearest free one
    0.50-1.00 m beyond, up to 0.20 m beside the normal and 15 degrees off it. Unknown cells do not count as
    occupied. ``grid`` None (nothing known): the first one.
    """
    nominal = np.array([settings.goal.distance, 0.0, 0.0])
    if grid is None:
        return se2.compose(door_pose, nominal)
    return free_goal_among(door_pose, occupied_points(grid), chair, settings.goal)


def free_goal_among(door_pose, obstacles, chair, limits):
    """``free_goal`` among points ``obstacles`` (n, 2); ``limits`` are the settings ``goal/*``."""
    reach = limits.distance + chair.circumscribed_radius + limits.beside + 0.1
    local = se2.transform_points(se2.inverse(door_pose), obstacles)
    # The chair at a goal reaches back to nearest - axle_to_rear; nothing before the plane can matter much.
    near = (local[:, 0] > -1.0) & (local[:, 0] < reach) & (np.abs(local[:, 1]) < reach)
    local = local[near]
    outline = grown(chair, limits.margin)
    for candidate in _candidates(limits):
        # The way from the door to the goal belongs to it: a pose behind another wall is not behind this door.
        back = max(outline.axle_to_rear, candidate[0] - BEHIND)
        swept = outline._replace(length=outline.front + back, axle_to_rear=back)
        if not len(local) or distance_to_points(swept, candidate, local).min() > 0.0:
            return se2.compose(door_pose, candidate)
    return None


def _candidates(limits):
    """Poses (n, 3) in the door's frame, the nearest to the nominal goal first."""
    along = np.arange(limits.distance, limits.nearest - 1e-9, -limits.step)
    beside = np.arange(0.0, limits.beside + 1e-9, limits.step)
    turn = np.arange(0.0, limits.turn + 1e-9, np.radians(5.0))
    beside = np.unique(np.concatenate((beside, -beside)))
    turn = np.unique(np.concatenate((turn, -turn)))
    poses = np.stack(np.meshgrid(along, beside, turn, indexing="ij"), axis=-1).reshape(-1, 3)
    # A turn moves the far corner by about 0.7 m a radian.
    cost = np.hypot(poses[:, 0] - limits.distance, poses[:, 1]) + 0.7 * np.abs(poses[:, 2])
    return poses[np.argsort(cost, kind="stable")]
