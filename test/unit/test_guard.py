"""The guard in titled scenes: a chair of 1.05 m x 0.65 m (front edge 0.70 m, rear edge -0.35 m) at the origin."""
import math
from types import SimpleNamespace

import numpy as np
import pytest

from wheelchair_shared_control import conversions, parameters, rectangle, se2, sweep
from wheelchair_shared_control import footprint as outline
from wheelchair_shared_control.grid import UNKNOWN, WHOLE_CELLS, Grid
from wheelchair_shared_control.guard import FREE, NO_WALLS, SLOWED, STOPPED, Guard
from wheelchair_shared_control.limiter import Limiter
from wheelchair_shared_control.moving import LOST, MovingCells
from wheelchair_shared_control.ranging import RangePoints
from wheelchair_shared_control.values import RANGERS, STOP, Odometry, Ranges, Twist

SETTINGS = parameters.load("blender")
CHAIR = outline.from_settings(SETTINGS.wheelchair)
RESOLUTION = 0.025
SIZE = 240  # cells: 6 m, the chair in the middle
TICK = 1.0 / 30.0


def empty(value=0):
    """A grid of 6 m x 6 m about the origin, all free or (-1) all unknown."""
    return Grid(np.full((SIZE, SIZE), value, dtype=np.int8), RESOLUTION, (-3.0, -3.0), 0.0)


def filled(grid, x, y, value=100):
    """The grid with the box x = (low, high), y = (low, high) [m] set to ``value``."""
    cells = grid.cells.copy()
    columns, rows = (slice(*(int(round((limit + 3.0) / RESOLUTION)) for limit in side)) for side in (x, y))
    cells[rows, columns] = value
    return grid._replace(cells=cells)


class Chair:
    """A chair with dead time and lag as configured, in a grid whose lethal cells are the truth."""

    def __init__(self, grid, pose=(0.0, 0.0, 0.0), settings=SETTINGS):
        self.guard, self.grid = Guard(settings), grid
        self.actuation = settings.wheelchair.actuation
        self.pose, self.v, self.w, self.now = np.array(pose, dtype=float), 0.0, 0.0, 0.0
        self.sent = [(-1.0, STOP)]
        rows, columns = np.nonzero(grid.cells == 100)
        self.obstacles = np.column_stack((columns + 0.5, rows + 0.5)) * RESOLUTION - 3.0
        self.nearest, self.verdict = self.clearance(), None

    def clearance(self):
        """Distance [m] from the outline to the nearest lethal cell's centre."""
        if not len(self.obstacles):
            return math.inf
        return float(outline.distance_to_points(CHAIR, self.pose, self.obstacles).min())

    def drive(self, command, duration, points=np.empty((0, 2)), walls=lambda: NO_WALLS):
        """Ask for ``command`` for ``duration`` [s]; returns the states that the guard gave."""
        states = []
        for _ in range(int(round(duration / TICK))):
            odometry = Odometry(self.now, self.pose, Twist(self.v, self.w))
            self.guard.stand_on(self.pose)
            scene = self.guard.look(self.grid, self.pose, points, walls=walls())
            self.verdict = self.guard.check(command, self.now, odometry, scene)
            self.guard.sent(self.now, self.verdict.command)
            self.sent.append((self.now, self.verdict.command))
            states.append(self.verdict.state)
            for _ in range(4):
                self.now += TICK / 4
                acting = [c for t, c in self.sent[-30:] if t <= self.now - self.actuation.dead_time + 1e-9]
                acting = acting[-1] if acting else STOP
                share = 1.0 - math.exp(-TICK / 4 / self.actuation.lag)
                self.v += (acting.v - self.v) * share
                self.w += (acting.w - self.w) * share
                self.pose = se2.integrate(self.pose, self.v, self.w, TICK / 4)
            self.nearest = min(self.nearest, self.clearance())
        return states


WALL_AHEAD = filled(empty(), (1.5, 1.6), (-3.0, 3.0))
WALL_LEFT = filled(empty(), (-3.0, 3.0), (0.40, 0.50))
WALL_BEHIND = filled(empty(), (-1.2, -1.1), (-3.0, 3.0))
POST_LEFT = filled(empty(), (0.2, 0.25), (0.55, 0.60))
# a door of 0.80 m in a wall 0.1 m thick: 7.5 cm on each side of a chair in its middle
DOOR = filled(filled(empty(), (0.9, 1.0), (-3.0, -0.4)), (0.9, 1.0), (0.4, 3.0))

# title, grid, command, duration, the last state must be
MEETINGS = [
    ("full speed at a wall", WALL_AHEAD, (0.6, 0.0), 4.0, STOPPED),
    ("walking pace at a wall", WALL_AHEAD, (0.2, 0.0), 6.0, STOPPED),
    ("a slight curve into a wall", WALL_AHEAD, (0.34, -0.05), 6.0, STOPPED),
    ("a curve into a wall", WALL_AHEAD, (0.6, 0.3), 5.0, STOPPED),
    ("turning on the spot beside a wall: the front corner swings into it", WALL_LEFT, (0.0, 1.0), 4.0, STOPPED),
    ("turning on the spot away from a wall: the rear corner swings into it", WALL_LEFT, (0.0, -1.0), 4.0, STOPPED),
    ("turning on the spot, a post within the front corner's circle", POST_LEFT, (0.0, 0.6), 4.0, STOPPED),
    ("reverse at a wall", WALL_BEHIND, (-0.6, 0.0), 5.0, STOPPED),
    ("reverse along an arc at a wall", WALL_BEHIND, (-0.5, 0.4), 5.0, STOPPED),
    ("a door met off its axis: the jamb", DOOR, (0.4, 0.35), 6.0, STOPPED),
]


@pytest.mark.parametrize("title, grid, command, duration, last", MEETINGS, ids=[row[0] for row in MEETINGS])
def test_stops_before_it_meets(title, grid, command, duration, last):
    chair = Chair(grid)
    states = chair.drive(Twist(*command), duration)
    assert states[-1] == last and SLOWED in states
    # a lethal cell reaches half its edge further than its centre, its corner 0.018 m
    assert chair.nearest > 0.018
    assert chair.nearest < 0.15  # ... and no earlier than it must
    assert abs(chair.v) < 0.02 and abs(chair.w) < 0.02
    assert chair.verdict.reason.startswith("stopped: obstacle") and chair.verdict.point is not None
    # Never trapped: the way it came is open.
    stopped = chair.pose.copy()
    chair.drive(Twist(-command[0], -command[1]), 1.5)
    moved = np.hypot(*(chair.pose - stopped)[:2]) + CHAIR.circumscribed_radius * abs(chair.pose[2] - stopped[2])
    assert moved > 0.1


def test_takes_numbers_of_numpy():
    chair = Chair(POST_LEFT)
    chair.drive(Twist(np.float64(0.3), np.float64(0.6)), 1.0)
    chair.drive(Twist(np.float32(-0.3), np.float32(0.01)), 1.0)
    assert chair.nearest > 0.018


@pytest.mark.parametrize("dead_time", [0.1, 0.5])
def test_knows_how_late_the_chair_answers(dead_time):
    chair = Chair(WALL_AHEAD, settings=SETTINGS.replace(**{"wheelchair/actuation/dead_time": dead_time}))
    chair.drive(Twist(0.6, 0.0), 6.0)
    assert chair.nearest > 0.018 and chair.verdict.state == STOPPED


@pytest.mark.parametrize("v", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("age", [0.0, 0.1, 0.25])
def test_counts_the_age_of_the_odometry(v, age):
    # Moving at v, 0.25 m of room at the stamp: what the chair covers until the command acts is gone.
    guard = Guard(SETTINGS)
    grid = filled(empty(), (0.95, 1.0), (-3.0, 3.0))
    for k in range(30):
        guard.sent(-1.0 + k * TICK, Twist(v, 0.0))
    scene = guard.look(grid, np.zeros(3))
    verdict = guard.check(Twist(v, 0.0), age, Odometry(0.0, np.zeros(3), Twist(v, 0.0)), scene)
    actuation, brakes = SETTINGS.wheelchair.actuation, SETTINGS.guarding
    # v (age + dead time + tick and a half + lag) + v^2 / 2a, against 0.25 m and half a cell, less the margins
    needs = v * (age + actuation.dead_time + 1.5 * TICK + actuation.lag) + v * v / (2.0 * brakes.deceleration)
    room = 0.2625 - 0.0125 - brakes.margin - brakes.margin_turning - brakes.margin_per_speed * v
    assert (verdict.state == FREE) == (needs < room)


def test_changes_nothing_on_known_free_ground():
    rng = np.random.default_rng(3)
    limits, guarding = SETTINGS.wheelchair.limits, SETTINGS.guarding
    for case in range(120):
        v = rng.uniform(-limits.speed, limits.speed)
        w = rng.uniform(-limits.turn_rate, limits.turn_rate)
        measured = Twist(v * rng.uniform(0, 1), w * rng.uniform(0, 1))
        guard = Guard(SETTINGS)
        guard.sent(-0.2, measured)
        # known and free is a disc about the chair: whatever the chair sweeps to standstill, and 0.3 m
        stop = abs(v) / guarding.deceleration
        reach = abs(v) * (0.1 + 0.1 + 0.15 + 0.05 + 0.5 * stop) + 0.3 + CHAIR.circumscribed_radius
        grid = empty(-1)
        y, x = np.mgrid[:SIZE, :SIZE] * RESOLUTION - 3.0 + RESOLUTION / 2
        grid.cells[np.hypot(x, y) <= reach + RESOLUTION] = 0
        if case % 2:
            grid.cells[np.hypot(x, y) > reach + RESOLUTION] = 100
        odometry = Odometry(-0.1, np.zeros(3), measured)
        verdict = guard.check(Twist(v, w), 0.0, odometry, guard.look(grid, np.zeros(3)))
        assert verdict.state == FREE and verdict.command == Twist(v, w), (v, w, verdict)


def test_drives_through_a_narrow_door():
    chair = Chair(DOOR)
    states = chair.drive(Twist(0.4, 0.0), 6.0)
    assert chair.pose[0] > 1.5 and STOPPED not in states


def test_passes_a_door_that_leaves_three_centimetres():
    """0.71 m: cells from y +-0.35 and, ragged, some from +-0.325, whose surface lies at 0.34375; the chair's sides
    at +-0.325."""
    door = filled(filled(empty(), (0.9, 1.0), (-3.0, -0.35)), (0.9, 1.0), (0.35, 3.0))
    ragged = filled(empty(), (0.95, 0.975), (0.325, 0.35)).cells == 100
    surface = np.tile(np.array([0, 3, 0, 3], np.int8), (SIZE, SIZE, 1))
    surface[ragged, 2] = 3
    door = door._replace(cells=np.where(ragged, 100, door.cells).astype(np.int8), surface=surface)
    chair = Chair(door)
    states = chair.drive(Twist(0.2, 0.0), 10.0)
    assert chair.pose[0] > 1.5 and STOPPED not in states


def test_a_chair_that_stands_close_may_leave():
    """2 cm beside a wall (less than any margin): along it, ahead and back; not closer."""
    wall = filled(empty(), (-3.0, 3.0), (0.35, 0.5))  # first cells' centres at 0.3625: 3.75 cm, edges 2.5 cm
    for command in ((0.3, 0.0), (-0.3, 0.0)):
        chair = Chair(wall)
        assert STOPPED not in chair.drive(Twist(*command), 2.0)
        assert abs(chair.pose[0]) > 0.4
    chair = Chair(wall)
    chair.drive(Twist(0.3, 0.5), 2.0)
    assert chair.nearest > 0.018


def test_a_chair_whose_rear_corner_is_close_may_drive_off_in_a_curve():
    """Through the limiter, whose first steps are all turn: those swing the rear corner into the wall."""
    wall = filled(empty(), (-0.5, -0.375), (-3.0, 3.0))  # 2.5 cm behind the rear edge
    chair, limiter = Chair(wall, pose=(0.0, 0.0, -0.3)), Limiter(SETTINGS.wheelchair.limits)
    chair.pose[0] += 0.35 * math.cos(0.3) + 0.325 * math.sin(0.3) - 0.35  # turned, the rear corner as close
    chair.nearest = chair.clearance()
    for _ in range(60):
        chair.drive(limiter.step(Twist(0.3, -0.5), TICK), TICK)
        limiter.sent(chair.verdict.command)
    assert chair.clearance() > 0.1 and chair.v > 0.25 and chair.nearest > 0.018


def test_a_false_cell_inside_the_outline_forbids_only_what_deepens_it():
    """A cell 5 cm inside the front edge, as a wrong reading leaves it."""
    grid = filled(empty(), (0.65, 0.675), (0.0, 0.025))
    forward, back = Chair(grid), Chair(grid)
    forward.drive(Twist(0.3, 0.0), 1.0)
    back.drive(Twist(-0.3, 0.0), 1.0)
    assert forward.pose[0] < 0.01 and forward.verdict.state == STOPPED
    assert back.pose[0] < -0.1


class TestUnknownGround:
    def test_ahead_counts_as_free_at_low_speed(self):
        chair = Chair(empty(-1))
        chair.drive(Twist(0.3, 0.0), 5.0)
        assert chair.pose[0] > 1.2

    def test_ahead_slows_a_fast_chair(self):
        chair = Chair(empty(-1))
        chair.drive(Twist(0.6, 0.0), 5.0)
        assert 0.2 < chair.v < 0.31 and "unknown ground" in chair.verdict.reason

    def test_behind_counts_as_occupied_beyond_the_start(self):
        # the first footprint grown by 0.4 m is free: 0.4 m back, no more
        chair = Chair(empty(-1))
        chair.drive(Twist(-0.4, 0.0), 6.0)
        assert -0.45 < chair.pose[0] < -0.25 and chair.verdict.state == STOPPED
        assert "unknown ground" in chair.verdict.reason and "behind" in chair.verdict.reason

    def test_behind_is_free_where_the_chair_came_from(self):
        chair = Chair(empty(-1))
        chair.drive(Twist(0.3, 0.01), 6.0)
        far = chair.pose[0]
        chair.drive(Twist(-0.3, -0.01), 6.0)
        assert chair.pose[0] < far - 1.2

    def test_beside_counts_as_occupied_for_a_turn(self):
        # known is the lane of the chair only; its corners would swing out of it
        lane = filled(empty(-1), (-3.0, 3.0), (-0.4, 0.4), 0)
        chair = Chair(lane, settings=SETTINGS.replace(**{"guarding/start_margin": 0.0}))
        chair.drive(Twist(0.0, 0.8), 3.0)
        assert chair.pose[2] < 0.35 and chair.verdict.state == STOPPED
        assert "on the left" in chair.verdict.reason or "on the right" in chair.verdict.reason


class TestRangers:
    rangers = SETTINGS.wheelchair.rangers

    def points(self, **readings):
        taken = RangePoints(SETTINGS.wheelchair)
        values = [readings.get(name, math.inf) for name in RANGERS]
        taken.update(Ranges(1.0, np.array(values)), np.zeros(3))
        return taken.points()

    def test_stand_where_they_were_read(self):
        # front left at x 0.60, y 0.175, looking left: 0.5 m is y = 0.675; the cone is 6 degrees wide
        points = self.points(left_front=0.5)
        assert points[1] == pytest.approx((0.60, 0.675))
        half_width = 0.5 * math.sin(math.radians(3))
        assert points[:, 0] == pytest.approx([0.60 - half_width, 0.60, 0.60 + half_width], abs=1e-6)
        assert self.points(right_rear=0.4)[1] == pytest.approx((-0.25, -0.575))

    def test_beyond_range_is_no_obstacle(self):
        assert len(self.points()) == 0

    def test_stop_a_turn_that_the_costmap_would_allow(self):
        chair = Chair(empty())
        chair.drive(Twist(0.0, 0.8), 2.0, points=self.points(left_front=0.2))  # 5 cm beside the front corner
        assert chair.pose[2] < 0.1 and chair.verdict.state == STOPPED
        free = Chair(empty())
        free.drive(Twist(0.0, 0.8), 2.0)
        assert free.pose[2] > 1.0

    def test_closer_than_the_minimum_forbids_only_what_shortens_it(self):
        # -Inf: at the minimum 0.1 m along the beam, 5 cm inside the side edge
        points = self.points(left_middle=-math.inf)
        assert points[1] == pytest.approx((0.15, 0.275))
        along, into = Chair(empty()), Chair(empty())
        along.drive(Twist(0.3, 0.0), 1.0, points=points)
        assert along.pose[0] > 0.1
        into.drive(Twist(0.0, 0.5), 1.0, points=points)
        assert into.pose[2] < 0.02

    @pytest.mark.parametrize("reading, limits, value", [
        (0.3, (0.1, 1.5), 0.3), (1.6, (0.1, 1.5), math.inf), (0.05, (0.1, 1.5), -math.inf),
        (math.inf, (0.1, 1.5), math.inf),
        (0.3, (0.0, 0.0), 0.3),  # a driver that fills in no limits: no reason to call what it saw free
    ])
    def test_a_message_is_read_within_its_limits(self, reading, limits, value):
        message = SimpleNamespace(range=reading, min_range=limits[0], max_range=limits[1])
        assert conversions.range_of(message) == value

    def test_nan_says_nothing_and_ages(self):
        taken = RangePoints(SETTINGS.wheelchair)
        taken.update(Ranges(1.0, np.full(6, np.inf)), np.zeros(3))
        broken = np.full(6, np.inf)
        broken[4] = np.nan
        taken.update(Ranges(1.4, broken), np.zeros(3))
        assert taken.oldest(1.5) == ("right_middle", pytest.approx(0.5))


AWAY = np.array([-20.0, 0.0, 0.0])  # of the chair: so far off that it makes no difference


class TestMoving:
    """A person of 0.4 m crosses from the right, the grid shows them every 0.1 s."""

    @staticmethod
    def grid(stamp, y, growing=0):
        grid = filled(empty(), (1.3, 1.7), (y - 0.2, y + 0.2))
        grid = filled(grid, (-2.0, -1.6), (1.0, 2.9), UNKNOWN)
        grid = filled(grid, (-2.0, -1.6), (1.0, 1.2 + 0.05 * growing))  # a box of which more and more is seen
        return grid._replace(stamp=stamp)

    def follow(self, speed, grids=10):
        moving = MovingCells(CHAIR)
        for k in range(grids):
            moving.update(self.grid(0.1 * k, -2.0 + speed * 0.1 * k, growing=k), AWAY)
        return moving

    def test_has_the_velocity_of_its_edges(self):
        moving = self.follow(0.5)
        assert np.allclose(moving.velocities, (0.0, 0.5), atol=0.05) and len(moving.points) >= 240
        assert moving.points[:, 0].min() > 1.0  # the box that only grows does not move

    def test_that_stand_do_not_move(self):
        assert len(self.follow(0.0).points) == 0

    def test_a_wall_that_is_seen_in_pieces_does_not_move(self):
        # All of a wall's end, 0.6 m, is seen for a second; then pieces of 0.2 m one after the other, as if one
        # piece walked along it. The same walk over free ground is one.
        for known, moves in ((True, False), (False, True)):
            moving, found = MovingCells(CHAIR), False
            for k in range(22):
                low, high = (0.0, 0.6) if k < 10 else (0.04 * (k - 10), 0.04 * (k - 10) + 0.2)
                if k < 10 and not known:
                    continue
                moving.update(filled(empty(), (1.0, 1.1), (low, high))._replace(stamp=0.1 * k), AWAY)
                found = found or len(moving.points) > 0
            assert found == moves

    def test_keep_moving_while_their_trail_lags(self):
        # From the 10th grid on the cells behind the walker are not cleared any more: only the leading edge goes on.
        # Half a second after the leading edge has stopped, the walker is believed to stand.
        moving, cells = MovingCells(CHAIR), empty().cells
        for k in range(32):
            y = -2.0 + 0.05 * min(k, 22)
            grid = filled(empty(), (1.3, 1.7), (y - 0.2, y + 0.2))
            cells = np.maximum(cells, grid.cells) if k > 10 else grid.cells
            moving.update(grid._replace(cells=cells.copy(), stamp=0.1 * k), AWAY)
            if 8 <= k <= 22:
                assert len(moving.points) and moving.velocities[0, 1] > 0.3, k
        assert len(moving.points) == 0

    def test_walk_on_when_they_come_apart_from_their_trail(self):
        # 0.4 m/s to the left. The trail of 0.9 m comes off in grid 22 and, being long, is nearer to where the middle of
        # both was expected than the walker.
        moving = MovingCells(CHAIR)
        for k in range(34):
            y = -1.5 + 0.04 * k
            low = y - 0.2 if k < 6 else -1.46
            grid = filled(empty(), (1.3, 1.7), (low if k < 22 else y - 0.2, y + 0.2))
            if k >= 22:
                grid = filled(grid, (1.3, 1.7), (-1.46, -0.87))
            moving.update(grid._replace(stamp=0.1 * k), AWAY)
            if k >= 8:
                ahead = moving.points[:, 1] > y - 0.25 if len(moving.points) else np.zeros(0, bool)
                assert ahead.any() and (moving.velocities[ahead, 1] > 0.2).all(), k

    @pytest.mark.parametrize("wall", [False, True])
    def test_are_found_though_their_trail_stays(self, wall):
        # From the first grid on all that they ever stood on stays marked; and they may walk along a wall, too.
        moving, cells = MovingCells(CHAIR), empty().cells
        for k in range(30):
            y = -2.0 + 0.05 * min(k, 20)
            grid = filled(empty(), (1.3, 1.7), (y - 0.2, y + 0.2))
            cells = np.maximum(cells, (filled(grid, (1.7, 1.8), (-2.9, 2.9)) if wall else grid).cells)
            moving.update(grid._replace(cells=cells.copy(), stamp=0.1 * k), AWAY)
            if 10 <= k <= 20:
                assert len(moving.points) and moving.points[:, 1].max() > y + 0.1, k
                assert np.allclose(moving.velocities, (0.0, 0.5), atol=0.1), k
        assert len(moving.points) == 0

    @pytest.mark.parametrize("before, surface", [("unknown", None), ("free", None), ("free", WHOLE_CELLS)])
    def test_a_cupboard_that_comes_into_view_does_not_move(self, before, surface):
        # 0.4 m deep, its end seen 0.05 m further in every grid. Had the ground been seen free, it would be a walker; in
        # another's costmap nobody knows that.
        moving = MovingCells(CHAIR)
        for k in range(20):
            grid = filled(empty(), (1.3, 1.7), (-2.0, 2.0), UNKNOWN if before == "unknown" else 0)
            grid = filled(grid, (1.3, 1.7), (-2.0, -1.8 + 0.05 * k))
            moving.update(grid._replace(stamp=0.1 * k, surface=surface), AWAY)
        assert (len(moving.points) > 0) == (before == "free" and surface is None)

    def test_a_wall_that_creeps_does_not_move(self):
        # Odometry drifts by a cell in each half second: the map's wall comes 0.05 m/s nearer, in pieces.
        moving = MovingCells(CHAIR)
        for k in range(30):
            x = 1.5 - RESOLUTION * (k // 5)
            grid = filled(filled(empty(), (x, 1.6), (-2.0, -1.3)), (x, 1.6), (-0.5, 0.3))
            moving.update(grid._replace(stamp=0.1 * k), AWAY)
            assert len(moving.points) == 0

    def test_a_wall_that_comes_into_view_bit_by_bit_does_not_move(self):
        # One cell thick, 0.9 m at first; its near end and its far end are seen in turns of 0.1 m further on.
        moving = MovingCells(CHAIR)
        for k in range(24):
            moving.update(filled(empty(), (0.5 + 0.04 * k, 1.4 + 0.04 * k), (1.0, 1.025))._replace(stamp=0.1 * k), AWAY)
            assert len(moving.points) == 0

    def test_are_followed_while_the_window_rolls(self):
        moving = MovingCells(CHAIR)
        for k in range(10):
            grid, shift = self.grid(0.1 * k, -2.0 + 0.05 * k), 2 * k  # the chair drives on
            cells = np.zeros_like(grid.cells)
            cells[:, : SIZE - shift] = grid.cells[:, shift:]
            moving.update(grid._replace(cells=cells, origin=np.add(grid.origin, (shift * RESOLUTION, 0.0))), AWAY)
        assert np.allclose(moving.velocities, (0.0, 0.5), atol=0.05) and len(moving.points) >= 240

    @pytest.mark.parametrize("stops", [None, 14])
    def test_are_not_lost_beside_a_wall(self, stops):
        # They walk along a wall of 3 m; what they left behind stays marked. From the 10th grid on the wall's marks
        # reach them, and the two are one blob. Who walks on enters new cells; who stops enters none.
        moving, trail = MovingCells(CHAIR), empty().cells
        for k in range(26):
            y = -2.0 + 0.05 * min(k, stops or k)
            grid = filled(empty(), (1.3, 1.7), (y - 0.2, y + 0.2))
            trail = np.maximum(trail, grid.cells) if k > 10 else grid.cells
            grid = filled(grid._replace(cells=trail.copy()), (1.7 + (0.1 if k < 10 else 0.0), 1.9), (-1.5, 1.5))
            moving.update(grid._replace(stamp=0.1 * k), AWAY)
            if 8 <= k <= (stops or 26):
                ahead = moving.points[:, 1] > y if len(moving.points) else np.zeros(0, bool)
                assert ahead.any() and (moving.velocities[ahead, 1] > 0.3).all(), k
        assert (len(moving.points) == 0) == (stops is not None)

    def test_are_moved_on_where_no_camera_sees_them(self):
        # They come at the chair's side; 0.3 m from it the grid shows them no more where they are, but where they were.
        # Away from the chair that means that they stand.
        for pose, speed, seconds in (
            (np.array([1.0, 0.0, 0.0]), 0.16, LOST), (np.array([1.0, 0.0, 0.0]), 0.5, LOST), (AWAY, 0.5, 0.6)
        ):
            moving, last, stop = MovingCells(CHAIR), None, 1.65 / speed
            for k in range(150):
                y = min(-2.5 + 0.1 * k * speed, -0.85)
                moving.update(self.grid(0.1 * k, y), pose)
                last = 0.1 * k if len(moving.points) else last
            # new cells count as new for 0.4 s, and a front is moved on for half a second
            assert stop + seconds - 0.3 <= last <= stop + seconds + 0.4, (pose, speed)

    @pytest.mark.parametrize("late", [0.6, 1.2, 1.6])
    @pytest.mark.parametrize("grows", [0.15, 0.3])
    def test_are_not_found_again_in_what_comes_into_view(self, late, grows):
        # They are seen no more 0.15 m before the chair's front, after 2.8 s; ``late`` [s] after that a wall beyond them
        # comes into view, one end first.
        moving = MovingCells(CHAIR)
        for k in range(90):
            time = 0.1 * k
            y = min(-1.8 + 0.5 * time, -0.4)
            grid = filled(empty(), (0.85, 1.25), (y - 0.2, y + 0.2))
            if time > 2.8 + late:
                grid = filled(grid, (1.0, 1.1), (0.45, min(0.65 + grows * (time - 2.8 - late), 1.6)))
            moving.update(grid._replace(stamp=time), np.zeros(3))
            of_wall = len(moving.points) and np.ptp(moving.points[:, 0]) < 0.15
            assert not of_wall
            assert time < 3.3 + LOST or len(moving.points) == 0

    def test_stop_a_chair_whose_way_they_will_cross(self):
        # The person's near side is at y -0.7, 0.5 m/s: 0.85 s later, when the chair's front would have come to
        # a stop at x 1.43, at y -0.275: before the chair, whose side is at -0.325.
        moving = self.follow(0.5, grids=23)
        guard, now = Guard(SETTINGS), moving.stamp
        pose = np.array([0.4, 0.0, 0.0])
        for k in range(40):
            guard.sent(now - 1.3 + k * TICK, Twist(0.6, 0.0))
        odometry = Odometry(now, pose, Twist(0.6, 0.0))
        grid = self.grid(now, -0.9)
        blind = guard.check(Twist(0.6, 0.0), now, odometry, guard.look(grid, pose))
        seen = guard.check(Twist(0.6, 0.0), now, odometry, guard.look(grid, pose, moving=moving))
        assert blind.state == FREE
        assert seen.state != FREE and "something moving" in seen.reason


def test_sweep_and_footprint_measure_alike():
    rng = np.random.default_rng(4)
    points = rng.uniform(-2, 2, (500, 2))
    pose = np.array([0.3, -0.2, 0.7])
    expected = outline.distance_to_points(CHAIR, pose, points)
    for point, distance in zip(points, expected):
        got = rectangle.nearest(point[None], *pose, CHAIR.front, CHAIR.rear, CHAIR.half_width)
        assert max(got, 0.0) == pytest.approx(distance, abs=1e-12)


def test_no_obstacle_is_overlooked_between_the_poses():
    """The jumps over far points find the same first pose as looking at every point in every pose."""
    rng = np.random.default_rng(5)
    for _ in range(60):
        v, w = rng.uniform(-0.6, 0.6), rng.uniform(-1, 1)
        poses, times = sweep.brake(np.zeros(3), v, w, v, w, 0.3, 0.5, 1.0, 0.15)
        points = rng.uniform(-1.5, 1.5, (60, 2))
        margin = 0.05
        index, pose = sweep.first_violation(
            poses, times, np.repeat(points, 2, axis=1), np.zeros((60, 2)), np.full(60, margin), 60, 0.0, 0.0, 1.0,
            CHAIR.front, CHAIR.rear, CHAIR.half_width, 0.05,
        )
        all_ = np.array([
            [rectangle.nearest(p[None], *q, CHAIR.front, CHAIR.rear, CHAIR.half_width) for p in points] for q in poses
        ])
        outside = all_[0] >= 0.0
        limit = np.where(outside, min(margin, all_[0][outside].min()), all_[0]) - 1e-6
        hits = (all_[1:] < limit).any(axis=1)
        assert pose == (1 + int(np.argmax(hits)) if hits.any() else -1)


class BesideAWall:
    """A chair beside a wall at y = ``wall``, its rangers with ``noise`` [m] and a share ``missed`` of their readings.

    ``grid`` is what the map holds; with ``camera`` it gains what camera and rangers see on the way.
    """

    RANGERS = SETTINGS.wheelchair.rangers
    CAMERA = SETTINGS.wheelchair.camera
    X = np.array([RANGERS.x_front, RANGERS.x_middle, RANGERS.x_rear])

    def __init__(self, wall, grid, start, seed=0, noise=0.0, missed=0.0, camera=False):
        self.wall, self.noise, self.missed, self.camera = wall, noise, missed, camera
        self.chair, self.readings = Chair(grid._replace(surface=WHOLE_CELLS), start), RangePoints(SETTINGS.wheelchair)
        self.rng = np.random.default_rng([79, seed])

    def look(self):
        x, y, yaw = self.chair.pose
        mounted = y + math.sin(yaw) * self.X + math.cos(yaw) * self.RANGERS.y
        values = (self.wall - mounted) / math.cos(yaw) + self.noise * self.rng.standard_normal(3)
        values[self.rng.random(3) < self.missed] = np.inf
        values[values < self.RANGERS.min_range], values[values > self.RANGERS.max_range] = -np.inf, np.inf
        self.readings.update(Ranges(self.chair.now + 1.0, np.r_[values, np.full(3, np.inf)]), self.chair.pose)
        if self.camera:
            self.chair.grid = self.seen(x, y, yaw, values)

    def seen(self, x, y, yaw, values):
        cells = self.chair.grid.cells.copy()
        row = int(math.ceil((self.wall + 3.0) / RESOLUTION - 1e-9))
        dx = (np.arange(SIZE) + 0.5) * RESOLUTION - 3.0 - x - math.cos(yaw) * self.CAMERA.x
        dy = self.wall - y - math.sin(yaw) * self.CAMERA.x
        ahead, aside = math.cos(yaw) * dx + math.sin(yaw) * dy, math.cos(yaw) * dy - math.sin(yaw) * dx
        in_view = np.abs(aside) < ahead * 0.5 * self.CAMERA.width / self.CAMERA.fx
        cells[row, in_view & (ahead > self.CAMERA.min_range) & (ahead < self.CAMERA.max_range)] = 100
        for k in np.flatnonzero(np.isfinite(values)):
            along = x + math.cos(yaw) * self.X[k] - math.sin(yaw) * (self.RANGERS.y + values[k])
            across = y + math.sin(yaw) * self.X[k] + math.cos(yaw) * (self.RANGERS.y + values[k])
            cells[row if not self.noise else int((across + 3.0) / RESOLUTION), int((along + 3.0) / RESOLUTION)] = 100
        return self.chair.grid._replace(cells=cells)

    def nearest(self, command, duration, prolonged=True):
        """Least true distance [m] of the outline to the wall while ``command`` is asked for."""
        nearest = math.inf
        for tick in range(int(round(duration / TICK))):
            if tick % 3 == 0:
                self.look()
            walls = self.readings.walls if prolonged else lambda: NO_WALLS
            self.chair.drive(command, TICK, self.readings.points(), walls)
            nearest = min(nearest, self.wall - outline.corners(CHAIR, self.chair.pose)[:, 1].max())
        return nearest


def wall_with_a_gap(wall, until, again):
    """A map of a wall to the left at y = ``wall`` up to x = ``until`` and from ``again`` on."""
    begin = math.ceil(wall / RESOLUTION - 1e-9) * RESOLUTION
    return filled(filled(empty(), (-2.0, until), (begin, begin + 0.05)), (again, 2.5), (begin, begin + 0.05))


class TestUnseenBesideACorner:
    """A wall of which the map holds what the camera and the rangers saw, and not what lies between."""

    # wall, from where on the map holds it again, start, command; without the continuation each of these touches
    TOUCH = [
        (0.55, 0.85, (0.0, 0.0, 0.0), Twist(0.2, 0.5)),
        (0.55, 0.85, (0.0, 0.0, 0.0), Twist(0.02, 0.5)),
        (0.40, 0.775, (0.0, -0.0818, 0.210), Twist(0.10, 0.5)),
        (0.55, 0.775, (0.0, 0.1004, 0.168), Twist(0.05, 0.5)),
    ]

    @pytest.mark.parametrize("wall, again, start, command", TOUCH)
    def test_corner_does_not_turn_into_the_gap(self, wall, again, start, command):
        assert BesideAWall(wall, wall_with_a_gap(wall, 0.10, again), start).nearest(command, 4.0) > 0.005

    @pytest.mark.parametrize("wall, again, start, command", TOUCH)
    def test_that_is_what_closes_it(self, wall, again, start, command):
        assert BesideAWall(wall, wall_with_a_gap(wall, 0.10, again), start).nearest(command, 4.0, False) < -0.005

    @pytest.mark.parametrize("seed", range(25))
    def test_no_pose_beside_a_gap_ends_in_it(self, seed):
        rng = np.random.default_rng([78, seed])
        wall = RESOLUTION * rng.integers(15, 25)
        yaw, beside = rng.uniform(0.0, 0.35), rng.uniform(0.01, 0.08)
        y = wall - beside - CHAIR.front * math.sin(yaw) - CHAIR.half_width * math.cos(yaw)
        reading = 0.60 * math.cos(yaw) - (wall - y - 0.60 * math.sin(yaw)) * math.tan(yaw)
        command = Twist(rng.choice([0.0, 0.02, 0.05, 0.1, 0.2]), rng.choice([0.1, 0.3, 0.5]))
        grid = wall_with_a_gap(wall, 0.10, reading + rng.uniform(0.15, 0.32))
        assert BesideAWall(wall, grid, (0.0, y, yaw), seed).nearest(command, 3.0) > 0.0

    # what the rangers and an old map do; each touches without the continuation in some of these places
    TROUBLES = {
        "exact": {}, "noise": dict(noise=0.01), "missed readings": dict(missed=0.05),
        "many missed": dict(missed=0.2), "both": dict(noise=0.01, missed=0.05),
    }

    @pytest.mark.parametrize("ghost", [None, 0.025, 0.05, 0.075], ids="ghost {}".format)
    @pytest.mark.parametrize("trouble", TROUBLES)
    @pytest.mark.parametrize("wall", [0.475, 0.575, 0.65])
    def test_what_camera_and_rangers_see_on_the_way_is_enough(self, wall, trouble, ghost):
        """A new place: nothing is in the map but what is seen, and the wall as it drifted since another visit."""
        grid = empty()
        if ghost is not None:
            grid = filled(grid, (-2.5, 2.5), (wall + ghost, wall + ghost + 0.025))
        chair = BesideAWall(wall, grid, (0.0, 0.0, 0.0), camera=True, **self.TROUBLES[trouble])
        assert chair.nearest(Twist(0.2, 0.5), 2.5) > 0.004

    def test_without_the_continuation_that_is_not_enough(self):
        nearest = [
            BesideAWall(0.575, empty(), (0.0, 0.0, 0.0), camera=True, **trouble).nearest(Twist(0.2, 0.5), 2.5, False)
            for trouble in self.TROUBLES.values()
        ]
        assert np.sum(np.array(nearest) < -0.005) >= 3, nearest

    def presumed(self, grid, y, pose=(0.0, 0.0, 0.0)):
        """What is presumed of a wall at ``y`` that was read from x = 0.15 to 0.60 m."""
        scene = Guard(SETTINGS).look(grid, np.array(pose), walls=np.array([[0.15, y, 0.60, y]]))
        assert len(scene.still) == len(scene.boxes) == scene.cells  # no policy sees it
        return scene.presumed

    def test_nothing_is_made_up_before_a_reading_or_beyond_a_gap_for_the_chair(self):
        assert not len(self.presumed(wall_with_a_gap(0.5, 0.4, 1.275), 0.5))
        assert len(self.presumed(wall_with_a_gap(0.5, 0.4, 1.20), 0.5))

    def test_gap_is_closed_by_points_on_the_line_from_end_to_end(self):
        made_up = self.presumed(filled(empty(), (0.8, 1.4), (0.5, 0.525)), 0.51)
        assert np.allclose(made_up[:, 1], 0.51)
        assert made_up[:, 0].min() == pytest.approx(0.60) and made_up[:, 0].max() > 0.79
        assert np.diff(np.sort(made_up[:, 0])).max() <= 0.005 + 1e-9

    @pytest.mark.parametrize("offset, made_up", [(-0.10, True), (0.075, True), (-0.125, False), (0.10, False)])
    def test_what_stands_far_beside_it_is_no_sign_that_the_wall_goes_on(self, offset, made_up):
        grid = filled(empty(), (1.0, 1.2), (0.5 + offset, 0.525 + offset))  # centres 0.0125 m further
        assert bool(len(self.presumed(grid, 0.5))) == made_up

    @pytest.mark.parametrize("y, made_up", [(0.310, True), (0.290, False)])
    def test_a_wall_in_the_chair_is_none_but_for_an_error(self, y, made_up):
        assert bool(len(self.presumed(filled(empty(), (1.0, 1.4), (0.275, 0.325)), y))) == made_up

    def test_a_wall_across_the_way_is_not_continued(self):
        grid = filled(empty(), (0.7, 0.9), (0.9, 1.4))
        for slope, goes_on in ((0.5, True), (2.0, False)):
            wall = np.array([[0.4, 0.9 - 0.2 * slope, 0.6, 0.9]])
            assert bool(len(Guard(SETTINGS).look(grid, np.zeros(3), walls=wall).presumed)) == goes_on

    @staticmethod
    def as_without(grid, walls, pose=(0.0, 0.0, 0.0)):
        """Whether a continuation of ``walls`` changes nothing."""
        guard, odometry = Guard(SETTINGS), Odometry(0.0, np.array(pose), STOP)
        commands = [Twist(v, w) for v in (0.1, 0.0, -0.1) for w in (-0.4, -0.2, 0.0, 0.2, 0.4)]
        without, with_it = (
            [guard.check(command, 0.0, odometry, scene).command for command in commands]
            for scene in (guard.look(grid, odometry.pose, walls=given) for given in (NO_WALLS, np.array(walls)))
        )
        return with_it == without

    @pytest.mark.parametrize("beside", [0.375, 0.425, 0.50])
    @pytest.mark.parametrize("ahead", [0.80, 0.95, 1.2])
    @pytest.mark.parametrize("jitter, missing", [(0, 0.0), (1, 0.0), (0, 0.33), (1, 0.2)])
    def test_the_corner_of_a_room_stays_as_it_is(self, beside, ahead, jitter, missing):
        """Whether its walls are in the map clean, ragged or with holes."""
        rng, grid = np.random.default_rng(80), empty()
        cells, row, column = grid.cells, int(round((beside + 3.0) / RESOLUTION)), int(round((ahead + 3.0) / RESOLUTION))
        for along in range(20, column):
            if rng.random() >= missing:
                cells[row + rng.integers(0, jitter + 1), along] = 100
        for across in range(20, row + 1):
            if rng.random() >= missing:
                cells[across, column + rng.integers(0, jitter + 1)] = 100
        assert self.as_without(grid, [[0.15, beside, 0.60, beside]])

    @pytest.mark.parametrize("width", [0.71, 0.80, 0.90])
    @pytest.mark.parametrize("aside", [0.05, 0.15, 0.30])
    def test_nor_does_a_chair_askew_before_a_door_lose_anything(self, width, aside):
        half = 0.5 * width
        grid = empty()
        for sign in (1.0, -1.0):
            for x, low, high in (((0.9, 1.0), half, 2.5), ((-2.0, 0.9), half + aside, half + aside + 0.1)):
                grid = filled(grid, x, (low, high) if sign > 0.0 else (-high, -low))
        rng, tried = np.random.default_rng(5), 0
        while tried < 20:
            pose = np.array([rng.uniform(-0.1, 0.3), rng.uniform(-0.25, 0.25), rng.uniform(-0.35, 0.35)])
            readings = []
            for x in (0.15, 0.60):
                ranger = se2.compose(pose, np.array([x, SETTINGS.wheelchair.rangers.y, 0.0]))
                beam = (half + aside - ranger[1]) / math.cos(pose[2])
                readings.extend(se2.compose(ranger, np.array([0.0, beam, 0.0]))[:2])
            if max(readings[0], readings[2]) < 0.85:  # else a beam meets the door's wall first
                tried += 1
                assert self.as_without(grid, [readings], pose)

    @pytest.mark.parametrize("seed", range(8))
    def test_what_is_made_up_never_allows_more(self, seed):
        """What passes with it passes without it, whether it lies nearer than all that was seen or not."""
        rng = np.random.default_rng([77, seed])
        tried = changed = 0
        while tried < 25:
            wall, gap = RESOLUTION * rng.integers(14, 20), rng.uniform(0.1, 0.35)
            grid = filled(wall_with_a_gap(wall, 0.6, 0.6 + gap), (0.2, 2.0), (-wall - 0.1, -wall))
            pose = np.array([0.0, rng.uniform(-0.05, 0.1), rng.uniform(0.0, 0.25)])
            guard = Guard(SETTINGS)
            plain = guard.look(grid, pose)
            if guard.clearance(plain, pose) <= 0.005:
                continue
            tried += 1
            prolonged = guard.look(grid, pose, walls=np.array([[0.15, wall, 0.6, wall]]))
            command, odometry = Twist(rng.choice([0.0, 0.1, -0.1]), rng.uniform(-0.5, 0.5)), Odometry(0.0, pose, STOP)
            passed = guard.check(command, 0.0, odometry, prolonged).command
            assert guard.check(passed, 0.0, odometry, plain).command == passed
            changed += passed != guard.check(command, 0.0, odometry, plain).command
        assert changed

    @staticmethod
    def straight_on(real, presumed, way=0.010, passing=0.0):
        """What keeps a chair from going so far [m] towards two points before its front: 0, 1 (presumed), or -1."""
        points = np.array([[CHAIR.front + real, 0.0], [CHAIR.front + presumed, 0.2]])
        poses = np.zeros((11, 3))
        poses[:, 0] = np.linspace(0.0, way, 11)
        hit, _ = sweep.first_violation(
            poses, np.arange(11) * 0.02, np.repeat(points, 2, axis=1), np.zeros_like(points), np.full(2, 0.05), 1,
            passing, 0.008, 1.0, CHAIR.front, CHAIR.rear, CHAIR.half_width, 0.05,
        )
        return hit

    def test_straight_on_it_may_come_nearer_by_the_raggedness_of_a_surface_as_to_what_was_seen(self):
        assert self.straight_on(0.5, 0.020, way=0.003, passing=0.004) == -1
        assert self.straight_on(0.5, 0.020, way=0.006, passing=0.004) == 1

    def test_it_has_half_a_cell_more_and_does_not_close_the_way_ahead(self):
        guard, pose = Guard(SETTINGS), np.zeros(3)
        scene = guard.look(empty(), pose)._replace(presumed=np.array([[CHAIR.front + 0.15, 0.0]]))
        seen = guard._obstacles(scene, pose, pose, 0.0)
        assert seen.juts[seen.presumed:] == pytest.approx([0.5 * RESOLUTION]) and not seen.ahead_closed
        solid = guard.look(empty(), pose, np.array([[CHAIR.front + 0.15, 0.0]]))
        assert guard._obstacles(solid, pose, pose, 0.0).ahead_closed

    def test_where_something_stands_nearer_there_is_no_gap(self):
        grid = filled(filled(empty(), (0.70, 0.80), (0.425, 0.450)), (0.95, 1.0), (0.5, 0.525))
        made_up = self.presumed(grid, 0.5)
        assert len(made_up) and not np.any((made_up[:, 0] > 0.705) & (made_up[:, 0] < 0.795))

    def test_beside_what_is_made_up_the_chair_comes_no_nearer_to_what_was_seen(self):
        assert self.straight_on(0.020, 0.5) == 0
        assert self.straight_on(0.020, 0.005) == 0  # 5 mm are not what stands there
        assert self.straight_on(0.5, 0.020) == 1
        assert self.straight_on(0.5, 0.065) == -1

    def test_nobody_is_trapped_by_what_is_made_up(self):
        assert self.straight_on(0.020, 0.005, way=-0.010) == -1

    def test_where_the_chair_is_there_is_no_wall(self):
        assert self.straight_on(0.5, -0.001) == -1


class TestWallsBeside:
    """What front and middle rangers tell of a wall."""

    RANGERS = SETTINGS.wheelchair.rangers

    def read(self, points, stamp, pose=(0.0, 0.0, 0.0), **given):
        values = np.full(6, np.inf)
        for name, value in given.items():
            values[RANGERS.index(name)] = value
        points.update(Ranges(stamp, values), np.array(pose, dtype=float))
        return points.walls()

    def test_both_sides_in_odom(self):
        walls = self.read(RangePoints(SETTINGS.wheelchair), 1.0, (2.0, 0.0, np.pi / 2), left_front=0.4, left_middle=0.5,
                          right_front=0.6, right_middle=0.7)
        y = self.RANGERS.y
        left = [2.0 - y - 0.5, self.RANGERS.x_middle, 2.0 - y - 0.4, self.RANGERS.x_front]
        right = [2.0 + y + 0.7, self.RANGERS.x_middle, 2.0 + y + 0.6, self.RANGERS.x_front]
        np.testing.assert_allclose(walls, [left, right], atol=1e-9)

    @pytest.mark.parametrize("given", [
        dict(left_front=0.4), dict(left_middle=0.4), dict(left_front=0.4, right_middle=0.4),
        dict(left_middle=0.4, left_rear=0.4),
        dict(left_front=-np.inf, left_middle=0.4), dict(left_front=0.4, left_middle=-np.inf),
    ])
    def test_no_wall_of_a_single_reading(self, given):
        assert self.read(RangePoints(SETTINGS.wheelchair), 1.0, **given).shape == (0, 4)

    def test_a_missed_reading_takes_no_wall_away_for_a_second(self):
        points = RangePoints(SETTINGS.wheelchair)
        assert len(self.read(points, 1.0, left_front=0.4, left_middle=0.4)) == 1
        assert len(self.read(points, 1.1)) == len(self.read(points, 1.9)) == 1
        assert not len(self.read(points, 2.1))

    def test_lines_of_the_last_second_also_of_a_fast_ranger(self):
        points = RangePoints(SETTINGS.wheelchair)
        for stamp in np.arange(1.0, 3.0, 0.02):
            walls = self.read(points, stamp, left_front=0.4, left_middle=0.4)
        assert 9 <= len(walls) <= 10
        assert 4 <= len(points.walls(2.98 + 0.5)) <= 6 and not len(points.walls(2.98 + 1.1))

    def test_while_the_chair_rests_readings_are_averaged(self):
        points, rng = RangePoints(SETTINGS.wheelchair), np.random.default_rng(6)
        for stamp in np.arange(1.0, 5.0, 0.1):
            front, middle = 0.4 + 0.01 * rng.standard_normal(2)
            walls = self.read(points, stamp, left_front=front, left_middle=middle)
        np.testing.assert_allclose(walls[:, [1, 3]], self.RANGERS.y + 0.4, atol=0.004)

    def drive(self, reads, points=None, to=1.5, noise=0.0, y=0.0, step=0.015):
        """{x of the chair: walls}, where the left side's rangers at x (in odom) read ``reads(x)``."""
        points, found = points or RangePoints(SETTINGS.wheelchair), {}
        rng = np.random.default_rng(7)
        for k, x in enumerate(np.arange(0.0, to, step)):
            front, middle = (
                reads(x + ahead) * (1.0 + noise * rng.standard_normal())
                for ahead in (self.RANGERS.x_front, self.RANGERS.x_middle)
            )
            found[round(x, 5)] = self.read(points, 1.0 + 0.05 * k, (x, y, 0.0), left_front=front, left_middle=middle)
        return found

    # what stands out of a wall that is read at 0.45 m: a jamb for good, a pillar for a while
    @pytest.mark.parametrize("begin, end", [(1.2, 9.0), (1.2, 1.6), (1.2, 1.4)])
    @pytest.mark.parametrize("nearer", [0.07, 0.10, 0.20])
    @pytest.mark.parametrize("noise", [0.0, 0.01])
    def test_a_jamb_and_the_wall_behind_it_are_not_one_wall(self, begin, end, nearer, noise):
        found = self.drive(lambda x: 0.45 - nearer * (begin <= x < end), noise=noise)
        slopes = [abs(wall[3] - wall[1]) / (wall[2] - wall[0]) for walls in found.values() for wall in walls]
        assert max(slopes) < 0.06
        assert all(len(walls) for x, walls in found.items() if x < begin - 0.62)  # before it
        assert not any(len(walls) for x, walls in found.items() if begin - 0.50 < x < min(begin, end) - 0.30)
        assert len(found[1.485]) or end < 9.0

    @pytest.mark.parametrize("step", [0.0004, 0.00075, 0.001, 0.003])
    @pytest.mark.parametrize("nearer", [0.10, 0.20])
    def test_nor_for_a_chair_that_creeps(self, nearer, step):
        """As the guard makes it: 8 mm/s and more, at 20 Hz."""
        found = self.drive(lambda x: 0.45 - nearer * (x >= 0.9), step=step, to=0.9, noise=0.01)
        slopes = [abs(wall[3] - wall[1]) / (wall[2] - wall[0]) for walls in found.values() for wall in walls]
        assert max(slopes) < 0.06
        assert not any(len(walls) for x, walls in found.items() if 0.35 < x < 0.7)

    def test_something_that_comes_before_a_ranger_at_rest_is_not_averaged_with_the_wall(self):
        points = RangePoints(SETTINGS.wheelchair)
        for stamp in np.arange(1.0, 3.0, 0.05):
            assert len(self.read(points, stamp, left_front=0.6, left_middle=0.6))
        for stamp in np.arange(3.0, 4.0, 0.05):
            assert not len(self.read(points, stamp, left_front=0.25, left_middle=0.6))
        # and when it has gone, it leaves nothing
        walls = self.read(points, 4.0, left_front=0.6, left_middle=0.6)
        np.testing.assert_allclose(walls[-1, [1, 3]], self.RANGERS.y + 0.6, atol=1e-6)

    def test_where_the_heading_wraps_nothing_is_different(self):
        points, rng, found = RangePoints(SETTINGS.wheelchair), np.random.default_rng(8), []
        for stamp in np.arange(1.0, 5.0, 0.05):
            yaw = math.remainder(math.pi + 0.001 * rng.standard_normal(), 2.0 * math.pi)
            front, middle = 0.6 * (1.0 + 0.01 * rng.standard_normal(2))
            found = self.read(points, stamp, (0.0, 0.0, yaw), left_front=front, left_middle=middle)
        np.testing.assert_allclose(found[:, [1, 3]], -self.RANGERS.y - 0.6, atol=0.005)

    @pytest.mark.parametrize("depth, goes_on", [(0.15, False), (0.8, True)])
    def test_an_opening_in_a_wall_is_not_a_bend_in_it(self, depth, goes_on):
        """What the front ranger read through a side door is no part of the wall before and behind it."""
        found = self.drive(lambda x: 0.45 + depth * (0.95 < x < 1.1), to=0.75)
        assert bool(len(found[0.57])) == goes_on

    def test_the_wall_that_was_left_is_forgotten_at_once(self):
        points = RangePoints(SETTINGS.wheelchair)
        assert len(self.drive(lambda x: 0.45, points, to=0.4)[0.39])
        assert not len(self.read(points, 9.0, (0.42, 0.0, 0.0), left_front=0.25, left_middle=0.45))

    def test_a_chair_set_elsewhere_and_a_reset_forget(self):
        points = RangePoints(SETTINGS.wheelchair)
        assert len(self.drive(lambda x: 0.45, points, to=0.4)[0.39])
        assert not len(self.read(points, 2.4, (2.0, 0.0, 0.0)))
        assert len(self.read(points, 2.5, (2.0, 0.0, 0.0), left_front=0.4, left_middle=0.4)) == 1
        points.reset()
        assert not len(points.walls())

    def test_a_middle_ranger_that_died_tells_nothing(self):
        points = RangePoints(SETTINGS.wheelchair)
        self.read(points, 1.0, left_front=0.4, left_middle=0.4)
        stamps = np.full(6, 2.5)
        stamps[RANGERS.index("left_middle")] = 1.0
        points.update(Ranges(stamps, np.full(6, 0.4)), np.zeros(3))
        assert [wall[1] > 0.0 for wall in points.walls()] == [False]  # the right side's alone
