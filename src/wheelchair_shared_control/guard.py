"""The guard: no command passes whose braking sweep meets an obstacle; it slows first, then stops.

The sweep is that of the true footprint from the pose that the chair will have when the command acts (age of
the odometry, dead time and lag of the motors) to its standstill, along the command's arc. A command that does
not bring the chair closer to what it already stands close to always passes: nobody is trapped.
"""
import math
from collections import deque
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import footprint as outline
from wheelchair_shared_control import guard_cells, rectangle, sweep
from wheelchair_shared_control.grid import WHOLE_CELLS
from wheelchair_shared_control.values import STOP, Twist

FREE, SLOWED, STOPPED, DEGRADED = 0, 1, 2, 3
SCALES = (0.85, 0.7, 0.55, 0.4, 0.28, 0.18, 0.1, 0.05)
PART_TURNS = (0.5, 0.2, 0.0)
PART_SCALES = (1.0, 0.6, 0.35, 0.2, 0.1)
SLIDE_BELOW = 0.3  # of the command left on its own arc: below, a part of it may pass instead
# m/s: below, a part may pass in any case. A chair that sets off turns before it drives, because only its speed is
# limited in jerk, and would be held by the swing of its own corners.
CREEP = 0.1
# A door of 0.71 m leaves a chair of 0.65 m 3 cm a side: driven straight on, it may come by this much [m] closer to
# the ragged surface than it stands, down to CLOSEST. Turns have no such allowance.
PASSING = 0.004
CLOSEST = 0.008
STRAIGHT = 0.2
GRAZE = 0.003  # m: what reaches no further into the lane of the chair does not close it: so far a box errs
# of a cell: without the costmap's surface, so far before the edge of a lethal cell an obstacle may begin, for a cell
# that is filled less than half is left free (`costmap_surface`)
JUTS = 0.5
# The camera sees nothing nearer than 0.5 m, and the front rangers look sideways from behind the corners. Between a
# reading and what is marked ahead of it is what nobody saw, and the corner turns into just that. There a wall is taken
# to go on straight, if anything is marked so far [m] beside its continuation within the chair's width.
CORRIDOR = 0.10
PITCH = 0.005  # m between the points of a continuation
DEEPEST = 0.03  # m: a continuation that leads further into the chair is none, one less far a reading's error
LANE = 0.25  # m beyond the edge within which an obstacle closes the way straight on
GROUND_CELLS = 512  # remembered ground: 12.8 m a side, older cells are overwritten
GROUND_RESOLUTION = 0.025  # m
# The outline is taken smaller by this much [m] where unknown ground is concerned, both for what counts as driven
# over and for what must not be entered: a chair that drives back along its own track deviates by a little.
RIM = 0.05
# s: older odometry, which stops the chair anyway, is taken for so old (a stamp of 0 would be played through for ever)
LONGEST_COAST = 1.0
NOTHING, NO_WALLS = np.empty((0, 2)), np.empty((0, 4))
# what an obstacle is; unknown ground ahead of the chair may be driven onto slowly, other unknown ground not
STILL, MOVING, UNKNOWN, UNKNOWN_AHEAD, PRESUMED = range(5)
WORDS = ("obstacle", "something moving", "unknown ground", "unknown ground", "unseen wall")


class Verdict(NamedTuple):
    """``command`` that may be sent, ``state`` FREE, SLOWED or STOPPED, ``reason`` in words, and the point
    (2,) [odom, m] that decided, or None."""

    command: Twist
    state: int
    reason: str
    point: object = None


class Scene(NamedTuple):
    """What stands around the chair, in odom [m, m/s]: still points (n, 2) and the boxes (n, 4) of what stands there,
    moving points (m, 2) as they were at ``moving_stamp`` with their velocities (m, 2), and unknown ground (k, 2)."""

    still: np.ndarray
    boxes: np.ndarray
    unknown: np.ndarray
    moving: np.ndarray = NOTHING
    moving_velocity: np.ndarray = NOTHING
    moving_stamp: float = 0.0
    cells: int = 0  # the first so many of ``still`` are cells, the others readings of the rangers
    cell: float = 0.0  # edge of a cell [m]: what is a point here may begin half of it before the point
    jut: float = 0.0  # m: an obstacle in a cell may begin so much before its box
    presumed: np.ndarray = NOTHING  # (p, 2) where nobody saw a wall end (CORRIDOR); no policy knows of these


class Obstacles(NamedTuple):
    """A ``Scene`` as one check sees it, the n obstacles in the order still, moving, unknown, presumed."""

    points: np.ndarray  # (n, 2) m, in odom
    boxes: np.ndarray  # (n, 4)
    velocities: np.ndarray  # (n, 2) m/s
    kinds: np.ndarray  # (n,) STILL .. PRESUMED
    juts: np.ndarray  # (n,) m that each may begin before its box
    presumed: int  # index of the first PRESUMED one
    back_closed: bool  # whether something stands in the lane straight back
    ahead_closed: bool
    jut: float  # the cells' [m]


class Guard:
    """Remembers the commands still on their way to the wheels and the ground that was driven over."""

    def __init__(self, settings):
        self._settings = settings.guarding
        self._footprint = outline.from_settings(settings.wheelchair)
        self._limits = settings.wheelchair.limits
        self._actuation = settings.wheelchair.actuation
        self._period = 1.5 / settings.rate
        self._max_range = settings.max_range
        self._reach = self._furthest()
        self.reset()

    def reset(self):
        """Forget: the next pose is a new start, on new ground."""
        self._sent = deque(maxlen=256)
        self._ground = np.full((GROUND_CELLS, GROUND_CELLS, 2), np.iinfo(np.int32).min, dtype=np.int32)
        self._last_pose = None

    def sent(self, now, command):
        """Note a command that was sent at ``now`` [s]."""
        self._sent.append((now, command.v, command.w))
        oldest = now - self._actuation.dead_time - 1.0
        while len(self._sent) > 1 and self._sent[1][0] < oldest:
            self._sent.popleft()

    def stand_on(self, pose):
        """Note the pose (3,) in odom: the ground below the chair is free. The first one is the start."""
        margin = self._settings.start_margin
        if self._last_pose is not None:
            dx, dy = pose[0] - self._last_pose[0], pose[1] - self._last_pose[1]
            turn = abs(math.remainder(pose[2] - self._last_pose[2], 2.0 * math.pi))
            if math.hypot(dx, dy) < 0.02 and turn < 0.02:
                return
            # A jump is a chair set elsewhere: that is a start again.
            if math.hypot(dx, dy) < 0.5:
                margin = 0.0
        ground = outline.grown(self._footprint, margin - RIM)
        guard_cells.remember(
            self._ground, GROUND_RESOLUTION, np.asarray(pose, dtype=float), ground.front, ground.rear,
            ground.half_width,
        )
        self._last_pose = np.array(pose, dtype=float)

    def look(self, grid, pose, range_points=NOTHING, moving=None, walls=NO_WALLS):
        """The ``Scene`` around ``pose``: obstacles within ``max_range``, unknown ground within the guard's reach.

        Without a grid the ranges alone. ``walls`` (m, 4), of `RangePoints.walls`, are taken to go on (CORRIDOR).
        """
        range_points = np.ascontiguousarray(range_points, dtype=float)
        if grid is None:
            return Scene(range_points, _boxes_of(range_points), NOTHING)
        outline_ = self._footprint
        surface = WHOLE_CELLS if grid.surface is None else grid.surface
        lethal, boxes, unknown = guard_cells.gather(
            grid.cells, surface, grid.resolution, float(grid.origin[0]), float(grid.origin[1]),
            np.asarray(pose, dtype=float), outline_.front, outline_.rear, outline_.half_width,
            max(self._max_range, self._reach), self._reach, self._ground, GROUND_RESOLUTION,
        )
        cells = len(lethal)
        presumed = guard_cells.prolong(
            np.ascontiguousarray(walls, dtype=float), lethal, np.asarray(pose, dtype=float), 2.0 * outline_.half_width,
            CORRIDOR, grid.resolution, PITCH, DEEPEST, outline_.front, outline_.rear, outline_.half_width,
        )
        if len(range_points):
            lethal = np.concatenate((lethal, range_points))
            boxes = np.concatenate((boxes, _boxes_of(range_points)))
        scene = Scene(lethal, boxes, unknown, cells=cells, cell=grid.resolution,
                      jut=JUTS * grid.resolution if grid.surface is None else 0.0, presumed=presumed)
        if moving is not None and len(moving.points):
            scene = scene._replace(
                moving=moving.points, moving_velocity=moving.velocities, moving_stamp=moving.stamp
            )
        return scene

    def _furthest(self):
        """Furthest that any point of the chair gets before it stands [m]."""
        limits, actuation, settings = self._limits, self._actuation, self._settings
        radius = self._footprint.circumscribed_radius
        wait = 0.3 + actuation.dead_time + 2.0 * actuation.lag + self._period
        straight = limits.speed * (wait + 0.5 * limits.speed / settings.deceleration)
        turning = radius * limits.turn_rate * (wait + 0.5 * limits.turn_rate / settings.turn_deceleration)
        return min(max(straight, turning) + 0.2, 2.5)

    def clearance(self, scene, pose):
        """Distance [m] from the footprint at ``pose`` to the nearest obstacle of ``scene``; 0 inside."""
        box = self._footprint
        nearest = rectangle.nearest(scene.still, pose[0], pose[1], pose[2], box.front, box.rear, box.half_width)
        return max(float(nearest), 0.0)

    def check(self, command, now, odometry, scene):
        """The most of ``command`` that may be sent at ``now`` [s], as a ``Verdict``."""
        if command.v == 0.0 and command.w == 0.0:
            return Verdict(STOP, FREE, "")
        acts = now + self._actuation.dead_time
        sent = np.array(self._sent, dtype=float).reshape(-1, 3)
        pose, v, w = sweep.coast(
            np.asarray(odometry.pose, dtype=float), odometry.twist.v, odometry.twist.w, sent,
            min(max(odometry.stamp, now - LONGEST_COAST), now), acts, self._actuation.dead_time, self._actuation.lag,
        )
        obstacles = self._obstacles(scene, np.asarray(odometry.pose, dtype=float), pose, acts)
        hit = self._hit(command, pose, v, w, obstacles)
        if hit is None:
            return Verdict(command, FREE, "")
        scale, hit = self._same_arc(command, pose, v, w, obstacles, hit)
        what = self._describe(hit, obstacles, pose)
        least = Twist(command.v * scale, command.w * scale)
        if scale < SLIDE_BELOW or abs(command.v) < CREEP:
            least = self._part(command, least, pose, v, w, obstacles)
        point = obstacles.points[hit]
        if least.v == 0.0 and least.w == 0.0:
            return Verdict(STOP, STOPPED, "stopped: " + what, point)
        if least == Twist(command.v * scale, command.w * scale):
            return Verdict(least, SLOWED, "slowed to %.0f %%: %s" % (100.0 * scale, what), point)
        return Verdict(least, SLOWED, "turns less: " + what, point)

    def _same_arc(self, command, pose, v, w, obstacles, hit):
        """Largest scale in [0, 1) at which the command passes, and what stands against a larger one."""
        passed, failed = 0.0, 1.0
        for scale in SCALES:
            slower = self._hit(Twist(command.v * scale, command.w * scale), pose, v, w, obstacles)
            if slower is None:
                passed = scale
                break
            failed, hit = scale, slower
        for _ in range(3 if passed else 0):
            scale = 0.5 * (passed + failed)
            slower = self._hit(Twist(command.v * scale, command.w * scale), pose, v, w, obstacles)
            if slower is None:
                passed = scale
            else:
                failed, hit = scale, slower
        return passed, hit

    def _part(self, command, least, pose, v, w, obstacles):
        """What passes of a command whose own arc is as good as closed: the same way with less of its turn.

        A chair in a doorway swings its rear out with the slightest turn, and would stand there for ever although
        the way straight on is open. Nothing is added: both components stay between 0 and the command's.
        """
        if command.v == 0.0 or command.w == 0.0:
            return least

        def left(part):  # how much of the command it is, 0 to 2
            return part.v / command.v + part.w / command.w

        best = least
        for turn in PART_TURNS:
            for scale in PART_SCALES:
                part = Twist(command.v * scale, command.w * turn * scale)
                if left(part) <= left(best):
                    break
                if self._hit(part, pose, v, w, obstacles) is None:
                    best = part
                    break
        return best

    def _obstacles(self, scene, present, pose, acts):
        """The ``Obstacles`` of ``scene`` for a command that acts at ``acts`` [s].

        The chair, now at ``present``, will then have come to ``pose``.
        """
        if len(scene.unknown):
            # ahead of the chair as it stands now: what it reaches before the command acts was ahead, too
            dx, dy = scene.unknown[:, 0] - present[0], scene.unknown[:, 1] - present[1]
            ahead = math.cos(present[2]) * dx + math.sin(present[2]) * dy > self._footprint.front - 1.5 * RIM
            unknown_kinds = np.where(ahead, UNKNOWN_AHEAD, UNKNOWN)
        else:
            unknown_kinds = np.empty(0, dtype=int)
        moved = NOTHING
        if len(scene.moving):
            travelled = min(max(acts - scene.moving_stamp, 0.0), self._settings.moving_horizon)
            moved = scene.moving + scene.moving_velocity * travelled
        box = self._footprint
        near = rectangle.within(scene.still, pose, box.front, box.rear, box.half_width, self._reach)
        still = scene.still[near]
        others = (moved, scene.unknown, scene.presumed)
        points = np.concatenate((still,) + others)
        boxes = np.concatenate([scene.boxes[near]] + [_boxes_of(other) for other in others])
        juts = np.full(len(points), 0.5 * scene.cell)
        juts[: np.count_nonzero(near[: scene.cells])] = scene.jut
        velocities = np.zeros_like(points)
        velocities[len(still) : len(still) + len(moved)] = scene.moving_velocity
        kinds = np.concatenate((
            np.full(len(still), STILL), np.full(len(moved), MOVING), unknown_kinds,
            np.full(len(scene.presumed), PRESUMED),
        ))
        solid = boxes[: len(still) + len(moved)]
        lane = box.half_width - GRAZE + scene.jut
        back_closed, ahead_closed = (
            sweep.way_is_closed(solid, pose, forward, LANE, box.front, box.rear, lane) for forward in (False, True)
        )
        return Obstacles(
            points, boxes, velocities, kinds, juts, len(points) - len(scene.presumed), back_closed, ahead_closed,
            scene.jut,
        )

    def _hit(self, command, pose, v, w, obstacles):
        """Index of the first obstacle that the braking sweep of ``command`` meets, or None."""
        settings, box, kinds = self._settings, self._footprint, obstacles.kinds
        poses, times = sweep.brake(
            pose, v, w, command.v, command.w, self._period, settings.deceleration, settings.turn_deceleration,
            self._actuation.lag,
        )
        swing = abs(command.w) * box.circumscribed_radius
        # 0 straight on, 1 for a turn on the spot or nearly so: the arc's shape, whatever its speed
        turning = min(2.0 * swing / (abs(command.v) + swing), 1.0)
        if command.v > 0.0 and obstacles.ahead_closed or command.v < 0.0 and obstacles.back_closed:
            turning = 1.0
        margin = (
            obstacles.juts + settings.margin + settings.margin_turning * turning
            + settings.margin_per_speed * math.hypot(command.v, swing)
        )
        margins = np.where(kinds == MOVING, margin + settings.moving_margin, margin)
        margins[(kinds == UNKNOWN) | (kinds == UNKNOWN_AHEAD)] = 0.0
        if abs(command.v) <= settings.unknown_speed:
            margins[kinds == UNKNOWN_AHEAD] = -math.inf
        index, _ = sweep.first_violation(
            poses, times, obstacles.boxes, obstacles.velocities, margins, obstacles.presumed,
            PASSING if turning < STRAIGHT else 0.0, CLOSEST + obstacles.jut, settings.moving_horizon,
            box.front, box.rear, box.half_width, RIM,
        )
        return None if index < 0 else index

    def _describe(self, index, obstacles, pose):
        dx, dy = obstacles.points[index] - pose[:2]
        x = math.cos(pose[2]) * dx + math.sin(pose[2]) * dy
        y = math.cos(pose[2]) * dy - math.sin(pose[2]) * dx
        box = self._footprint
        beyond = {
            "ahead": x - box.front, "behind": box.rear - x, "on the left": y - box.half_width,
            "on the right": -y - box.half_width,
        }
        where = max(beyond, key=beyond.get)
        distance = max(rectangle.signed_distance(x, y, box.front, box.rear, box.half_width), 0.0)
        return "%s %.2f m %s" % (WORDS[obstacles.kinds[index]], distance, where)


def _boxes_of(points):
    """Boxes (n, 4) without extent at ``points`` (n, 2)."""
    return np.repeat(points, 2, axis=1)
