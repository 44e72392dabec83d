"""A person who walks straight across the chair's way, an upright box.

Drawn against the chair's undisturbed motion: wholly in the camera's view from 2.0 s before the two would meet.
"""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control import se2
from wheelchair_shared_control.simulation import outlines

WIDTH, HEIGHT = 0.4, 1.7            # m
SPEED = (0.3, 0.6)                  # m/s
ANGLE = np.radians([45.0, 135.0])   # rad, of the walk to the chair's way, to either side
IN_VIEW = 2.0                       # s before the conflict
LENS_HOLDS = 0.8                    # m: nearer than this to the camera 0.4 m cannot be wholly in view
STANDS_ASIDE = 0.4                  # m from the chair's way, before and after the walk
MOVING = 0.1                        # m/s: a chair slower than this has no way to be crossed
TRIES = 4000


class Person(NamedTuple):
    """Walks from ``origin`` (2,) [m] with ``velocity`` (2,) [m/s] between the times ``begin`` and ``end`` [s].

    Before and after they stand. ``conflict`` [s] is when the undisturbed motions would meet.
    """

    origin: np.ndarray
    velocity: np.ndarray
    begin: float
    end: float
    conflict: float

    def box(self, time):
        """The person at ``time`` [s] as a row (7,) of ``World.boxes``."""
        walked = min(max(time, self.begin), self.end) - self.begin
        x, y = self.origin + walked * self.velocity
        yaw = np.arctan2(self.velocity[1], self.velocity[0])
        return np.array([x, y, HEIGHT / 2.0, yaw, WIDTH / 2.0, WIDTH / 2.0, HEIGHT / 2.0])


def draw(trajectory, world, wheelchair, rng):
    """A person for the chair's undisturbed ``trajectory`` (n, 4) [time, x, y, yaw], or None where none fits.

    Redrawn until: the motions meet first at the chair's front edge, the person's way is free of the world from
    2.0 s before to the meeting, and from then on they are wholly in view; where they are too near for a lens to hold
    them, their middle is. Where they stand before and after their walk they are not in the chair's way.
    """
    trajectory = np.array(trajectory, dtype=float)
    trajectory[:, 3] = np.unwrap(trajectory[:, 3])
    footprint = footprints.from_settings(wheelchair)
    shapes = outlines.from_world(world)
    times = trajectory[:, 0]
    speed = np.hypot(np.gradient(trajectory[:, 1], times), np.gradient(trajectory[:, 2], times))
    candidates = np.nonzero((speed > MOVING) & (times >= times[0] + IN_VIEW + 0.5))[0]
    if len(candidates) == 0:
        return None
    for _ in range(TRIES):
        conflict = times[rng.choice(candidates)]
        walk, side = rng.uniform(*SPEED), rng.choice([-1.0, 1.0])
        turn = side * rng.uniform(*ANGLE)
        across = rng.uniform(-footprint.half_width, footprint.half_width)
        chair = _at(trajectory, conflict)
        heading = chair[2] + turn
        # the box just meets the front edge
        reach = WIDTH / 2.0 * (abs(np.cos(turn)) + abs(np.sin(turn)))
        meeting = se2.transform_points(chair, np.array([[footprint.front + reach, across]]))[0]
        velocity = walk * np.array([np.cos(heading), np.sin(heading)])
        person = Person(meeting - IN_VIEW * velocity, velocity, conflict - IN_VIEW, conflict, conflict)
        if _meet_first(person, trajectory, footprint) and _in_view(person, trajectory, shapes, wheelchair):
            person = _extended(person, trajectory, footprint, shapes)
            if _out_of_the_way(person, trajectory, footprint):
                return person
    return None


def nominal_trajectory(start, door, speed=0.4, turn_rate=0.5, pause=1.0, step=0.05):
    """An undisturbed motion (n, 4) to draw against where none is known: turn to the gap, stand, drive through."""
    start = np.asarray(start, dtype=float)
    gap = np.asarray(door.pose[:2])
    bearing = np.arctan2(gap[1] - start[1], gap[0] - start[0])
    turn = float(se2.wrap_angle(bearing - start[2]))
    entry = se2.transform_points(door.pose, np.array([[-0.9, 0.0], [1.0, 0.0]]))
    points = np.vstack((start[:2], entry)) if np.hypot(*(gap - start[:2])) > 1.0 else np.vstack((start[:2], entry[1]))
    ahead = turn / turn_rate
    rows = [(t, start[0], start[1], start[2] + turn_rate * np.sign(turn) * t) for t in np.arange(0.0, abs(ahead), step)]
    time = abs(ahead) + pause
    for a, b in zip(points[:-1], points[1:]):
        length = np.hypot(*(b - a))
        yaw = np.arctan2(b[1] - a[1], b[0] - a[0])
        for s in np.arange(0.0, length, speed * step):
            rows.append((time + s / speed, *(a + (b - a) * s / length), yaw))
        time += length / speed
    return np.array(rows)


def _at(trajectory, time):
    """Pose (3,) at a time; the yaw of ``trajectory`` must not jump."""
    return np.array([np.interp(time, trajectory[:, 0], column) for column in trajectory.T[1:]])


def _outline(person, time):
    return outlines.from_boxes(person.box(time)[None])[0, :4]


def _meet_first(person, trajectory, footprint):
    """Whether the footprint stays clear of the person until just before the conflict."""
    return all(
        outlines.polygon_distance(_outline(person, time), footprints.corners(footprint, _at(trajectory, time))) > 0.0
        for time in np.arange(person.conflict - IN_VIEW, person.conflict - 0.1, 0.1))


def _in_view(person, trajectory, shapes, wheelchair):
    camera = wheelchair.camera
    left, right = camera.cx / camera.fx, (camera.width - 1 - camera.cx) / camera.fx
    for time in np.arange(person.conflict - IN_VIEW, person.conflict + 1e-9, 0.1):
        corners = _outline(person, time)
        if outlines.clearance(shapes, corners) == 0.0:
            return False
        eye = se2.compose(_at(trajectory, time), np.array([camera.x, 0.0, 0.0]))
        local = se2.transform_points(se2.inverse(eye), corners)
        if np.min(local[:, 0]) < LENS_HOLDS:
            middle = local.mean(axis=0)
            if -right * middle[0] < middle[1] < left * middle[0]:
                continue
            return False
        # the tilt narrows the view of what is low, and widens that of what is high, by little: level is taken
        if np.any(local[:, 1] > left * local[:, 0]) or np.any(-local[:, 1] > right * local[:, 0]):
            return False
        if np.max(local[:, 0]) > camera.max_range:
            return False
        if not all(outlines.sees(shapes, eye[:2], corner) for corner in corners):
            return False
    return True


def _out_of_the_way(person, trajectory, footprint):
    """Whether the chair's undisturbed way is free where the person stands before and after walking."""
    times = np.arange(trajectory[0, 0], trajectory[-1, 0], 0.2)
    for standing, moments in ((person.begin, times[times < person.begin]), (person.end, times[times > person.begin])):
        shape = _outline(person, standing)
        for time in moments:
            chair = footprints.corners(footprint, _at(trajectory, time))
            if outlines.polygon_distance(shape, chair) < STANDS_ASIDE:
                return False
    return True


def _extended(person, trajectory, footprint, shapes):
    """The same walk, begun as early and ended as late as the world (and the chair, before) leaves it free."""
    begin, end = person.begin, person.end
    origin = person.origin
    step = 0.1
    while begin - step >= 0.0:
        earlier = person._replace(origin=origin - step * person.velocity, begin=begin - step)
        if outlines.clearance(shapes, _outline(earlier, begin - step)) == 0.0:
            break
        chair = footprints.corners(footprint, _at(trajectory, begin - step))
        if outlines.polygon_distance(_outline(earlier, begin - step), chair) < 0.5:
            break
        begin, origin = begin - step, origin - step * person.velocity
    walker = person._replace(origin=origin, begin=begin, end=person.conflict + 10.0)
    while end < person.conflict + 10.0 and outlines.clearance(shapes, _outline(walker, end + step)) > 0.0:
        end += step
    return walker._replace(end=end)
