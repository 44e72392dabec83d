"""The costmap in scenes whose answer a reader can compute; depth images by open3d's ray caster."""
import math

import numpy as np
import pytest
from costmap_scenes import CAMERA, CHAIR, SETTINGS, Renderer, box, door, floor

from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control import costmap_points, parameters
from wheelchair_shared_control.costmap import Costmap, CostmapError, to_grid
from wheelchair_shared_control.values import Ranges

ORIGIN = np.zeros(3)
MOUNT = cameras.mounting(CHAIR)


class Chair:
    """A costmap whose chair looks at a rendered world; what it takes for its pose may differ from the truth."""

    def __init__(self, *boxes, settings=SETTINGS, **options):
        self.map = Costmap(settings.local_costmap, CHAIR)
        self.renderer = Renderer(boxes, **options)
        self.now = 100.0
        self.snapshot = None

    def look(self, pose=ORIGIN, odom=None, times=1, pitch=None, rng=None, change=None):
        odom = pose if odom is None else odom
        for _ in range(times):
            image = self.renderer.depth(pose, pitch=pitch, rng=rng)
            image = image if change is None else change(image)
            self.map.move_to(odom)
            self.map.insert_depth(image, CAMERA, cameras.lifted(odom) @ MOUNT, self.now)
            self.snapshot = self.map.update(odom, self.now)
            self.now += 0.1
        return self

    def replace_world(self, *boxes):
        self.renderer = Renderer(boxes)
        return self

    def lethal(self, x0, x1, y0, y1):
        """Lethal cells whose centre lies in a rectangle of odom: how many."""
        rows, columns = np.nonzero(self.snapshot.cost == 254)
        x = self.snapshot.origin[0] + (columns + 0.5) * 0.025
        y = self.snapshot.origin[1] + (rows + 0.5) * 0.025
        return int(((x > x0) & (x < x1) & (y > y0) & (y < y1)).sum())

    def cost(self, x, y):
        s = self.snapshot
        return int(s.cost[int((y - s.origin[1]) / 0.025), int((x - s.origin[0]) / 0.025)])

    def known(self, x, y):
        s = self.snapshot
        return bool(s.known[int((y - s.origin[1]) / 0.025), int((x - s.origin[0]) / 0.025)])


# --- heights -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("low, high, lethal, why", [
    (1.00, 1.50, True, "a hanging obstacle at the height of a head"),
    (0.71, 0.74, True, "a table top: 3 cm of edge, and its top from above"),
    (0.00, 0.15, True, "a door stop on the floor"),
    (0.00, 0.03, False, "a carpet's edge"),
    (1.50, 2.00, False, "a lintel above the chair"),
])
def test_height_decides_what_marks(low, high, lethal, why):
    chair = Chair(floor(), box(2.0, 2.3, -0.4, 0.4, low, high)).look(times=2)
    assert (chair.lethal(1.95, 2.35, -0.45, 0.45) > 20) == lethal, why
    if not lethal:
        assert chair.lethal(-3, 3, -3, 3) == 0


def test_floor_under_a_lintel_is_free_and_known():
    chair = Chair(floor(), *door(0.9, x=2.5, lintel=1.5)).look()
    assert chair.cost(2.5, 0.0) < 253 and chair.known(2.5, 0.0)


@pytest.mark.parametrize("error_deg", [-1.5, -0.7, 0.7, 1.5])
def test_a_camera_that_pitches_does_not_see_the_floor_as_an_obstacle(error_deg):
    # at 3 m a pitch error of 1.5 degrees lifts the floor by 8 cm: more than the 5 cm that mark
    rng = np.random.default_rng(3)
    chair = Chair(floor()).look(times=3, pitch=CHAIR.camera.pitch + math.radians(error_deg), rng=rng)
    assert chair.lethal(-3, 3, -3, 3) == 0
    assert chair.known(2.5, 0.0)


@pytest.mark.parametrize("step, lethal", [(-0.02, False), (-0.08, True), (-0.17, True), (-1.0, True)])
def test_a_step_down_marks_at_its_edge(step, lethal):
    # floor up to x = 2.2, then lower: rays that pass the edge go below the floor's level behind it
    chair = Chair(floor(x1=2.2), floor(x0=2.2, z=step)).look(times=2)
    assert (chair.lethal(2.15, 2.6, -0.5, 0.5) > 10) == lethal
    assert chair.lethal(-3.0, 2.15, -3, 3) == 0


@pytest.mark.parametrize("invalid", [np.inf, np.nan, 0.0])
def test_no_floor_where_it_must_be_seen_marks(invalid):
    # the floor ends at x = 2.2 and nothing lies below: nothing returns
    chair = Chair(floor(x1=2.2), box(4.2, 4.4, -5, 5, 0.0, 2.5))
    chair.look(times=3, change=lambda image: np.where(np.isposinf(image), invalid, image))
    assert chair.lethal(2.2, 3.0, -0.5, 0.5) > 100
    assert chair.lethal(-3.0, 2.15, -3, 3) == 0


# --- REP 117 ---------------------------------------------------------------------------------------------------


def test_a_frame_of_nan_changes_nothing_and_does_not_count_as_an_observation():
    chair = Chair(floor(), box(2.0, 2.2, -0.4, 0.4, 0.0, 1.0)).look(times=3)
    before = chair.snapshot
    stamp = chair.map.newest["camera"]
    chair.look(change=lambda image: np.full_like(image, np.nan))
    np.testing.assert_array_equal(chair.snapshot.cost, before.cost)
    assert chair.map.newest["camera"] == stamp


def test_scattered_nan_pixels_neither_mark_nor_clear():
    rng = np.random.default_rng(1)
    chair = Chair(floor(), box(2.0, 2.2, -0.4, 0.4, 0.0, 1.0)).look(times=2)
    before = chair.lethal(-3, 3, -3, 3)
    chair.look(times=5, change=lambda image: np.where(rng.random(image.shape) < 0.3, np.nan, image))
    assert chair.lethal(-3, 3, -3, 3) == before


def test_inf_looks_through_what_is_gone():
    # nothing behind it within 4.5 m: rays without return must clear too (navigation 808)
    chair = Chair(floor(), box(2.0, 2.2, -0.4, 0.4, 0.8, 1.2)).look(times=3)
    assert chair.lethal(1.9, 2.3, -0.5, 0.5) > 20
    chair.replace_world(floor()).look(times=4)
    assert chair.lethal(1.9, 2.3, -0.5, 0.5) == 0


def test_minus_inf_marks_ahead_of_the_chair():
    # all pixels closer than the camera can tell, 0.5 m: something stands 5 cm before the foot rest
    chair = Chair(floor()).look(change=lambda image: np.full_like(image, -np.inf))
    assert chair.lethal(0.70, 0.80, -0.3, 0.3) > 10


# --- memory ----------------------------------------------------------------------------------------------------


def test_jambs_are_remembered_through_the_last_metre():
    # door 0.90 m at x = 2.5; from x = 1.4 on the camera sees no jamb, and the chair stands there for 30 s
    chair = Chair(floor(), *door(0.9, x=2.5))
    for x in np.linspace(0.0, 1.7, 18):
        chair.look(pose=np.array([x, 0.0, 0.0]))
    chair.look(pose=np.array([1.7, 0.0, 0.0]), times=3)
    for _ in range(30):
        chair.now += 1.0
        chair.snapshot = chair.map.update(np.array([1.7, 0.0, 0.0]), chair.now)
    for side in (1, -1):
        inner = sorted((0.45 * side, 0.50 * side))
        assert chair.lethal(2.43, 2.57, *inner) >= 2
    assert chair.lethal(2.3, 2.7, -0.43, 0.43) == 0


@pytest.mark.parametrize("low", [1.25, 1.28, 1.32])
def test_a_hanging_lamp_is_remembered_where_the_camera_sees_only_the_floor_below_it(low):
    # lowest at 1.25 m: out of view nearer than (1.25 - 1.10) / tan(7 degrees) = 1.2 m
    chair = Chair(floor(), box(2.5, 2.6, -0.3, 0.3, low, 1.45), box(4.0, 4.1, -5, 5, 0, 2.5))
    for x in np.linspace(0.0, 1.7, 18):
        chair.look(pose=np.array([x, 0.0, 0.0]))
    assert chair.lethal(2.45, 2.65, -0.3, 0.3) > 10


def test_what_was_seen_briefly_and_left_the_view_is_forgotten_as_unknown():
    chair = Chair(floor()).look(times=3)
    chair.replace_world(floor(), box(1.81, 2.0, -0.2, 0.2, 0.0, 1.7)).look(times=5)  # steps in
    assert chair.lethal(1.7, 2.1, -0.3, 0.3) > 10
    away = np.array([0.0, 0.0, math.pi])
    chair.replace_world(floor()).look(pose=away, times=3)
    assert chair.lethal(1.7, 2.1, -0.3, 0.3) > 10, "not yet"
    chair.now += SETTINGS.local_costmap.memory_time
    chair.look(pose=away)
    assert chair.lethal(1.7, 2.1, -0.3, 0.3) == 0
    assert not chair.known(1.815, 0.0)


def test_someone_who_walks_by_leaves_no_trail():
    chair = Chair(floor())
    for y in np.arange(-1.0, 1.01, 0.05):  # 0.5 m/s
        chair.replace_world(floor(), box(2.0, 2.4, y - 0.2, y + 0.2, 0.0, 1.7)).look()
        # single cells may stay of a height, or at an edge of the view, that is not seen again
        assert chair.lethal(-3, 3, -0.9, y - 0.4) <= 3
    assert chair.lethal(1.9, 2.5, 0.7, 1.3) > 10
    chair.now += SETTINGS.local_costmap.memory_time
    assert chair.look(times=2).lethal(-3, 3, -3, 0.6) == 0


def test_an_intruder_on_ground_seen_free_is_lethal_at_once():
    chair = Chair(floor()).look(times=20)
    chair.replace_world(floor(), box(2.0, 2.4, -0.2, 0.2, 0.0, 1.7)).look(times=1)
    assert chair.lethal(1.95, 2.1, -0.25, 0.25) > 10


# --- doors under noise and drift ---------------------------------------------------------------------------------


def seen_gap(chair, x0=2.40, x1=2.60):
    """Width [m] between the innermost lethal cells' centres within the wall, less half a cell a side."""
    s = chair.snapshot
    rows, columns = np.nonzero(s.cost == 254)
    x = s.origin[0] + (columns + 0.5) * 0.025
    y = s.origin[1] + (rows + 0.5) * 0.025
    wall = (x > x0) & (x < x1)
    return y[wall & (y > 0)].min(), y[wall & (y < 0)].max()


@pytest.mark.parametrize("scale, yaw_deg_per_m", [(0.02, 1.0), (-0.02, -1.0)])
def test_drift_of_two_sigma_leaves_no_ghost_in_a_narrow_door(scale, yaw_deg_per_m):
    rng = np.random.default_rng(4)
    chair = Chair(floor(), *door(0.75, x=2.5))
    for x in np.arange(0.0, 1.5, 0.05):  # 0.5 m/s at 10 Hz
        yaw = math.radians(yaw_deg_per_m) * x
        odom = np.array([(1 + scale) * x, 0.5 * yaw * x, yaw])
        chair.look(pose=np.array([x, 0.0, 0.0]), odom=odom, rng=rng)
    # where the true jambs now lie in odom: the chair has drifted, and the door with it
    odom_from_world = cameras.lifted(odom) @ np.linalg.inv(cameras.lifted(np.array([x, 0.0, 0.0])))
    true_left = (odom_from_world @ (2.44, 0.375, 0, 1))[1]
    true_right = (odom_from_world @ (2.44, -0.375, 0, 1))[1]
    left, right = seen_gap(chair, 2.40, 2.65)
    assert left == pytest.approx(true_left, abs=0.03)
    assert right == pytest.approx(true_right, abs=0.03)


# --- window, chair, unknown ------------------------------------------------------------------------------------


def test_at_the_start_only_the_ground_about_the_chair_is_known():
    costmap = Costmap(SETTINGS.local_costmap, CHAIR)
    chair = Chair(floor())
    chair.snapshot = costmap.update(ORIGIN, 0.0)
    assert chair.known(1.08, 0.70) and chair.known(-0.72, -0.70)  # 0.70 + 0.4, 0.325 + 0.4, 0.35 + 0.4
    assert not chair.known(1.12, 0.0) and not chair.known(0.0, 0.74) and not chair.known(-0.77, 0.0)
    assert chair.cost(1.5, 0.0) == 255 and chair.cost(0.0, 0.0) == 0
    # of the 1.85 x 1.45 m that are taken as free, the chair stands on 1.05 x 0.65 m
    assert chair.snapshot.presumed.sum() == pytest.approx((1.85 * 1.45 - 1.05 * 0.65) / 0.025 ** 2, rel=0.03)
    assert math.isinf(chair.snapshot.stamp)


def test_the_window_moves_by_whole_cells_and_keeps_what_it_saw():
    chair = Chair(floor(), box(2.0, 2.2, -0.2, 0.2, 0.0, 1.0)).look(times=3)
    before = chair.lethal(1.9, 2.3, -0.3, 0.3)
    for pose in ((0.337, 0.211, 0.0), (0.9, -0.4, 2.0), (-0.3, 0.1, 0.0)):
        chair.snapshot = chair.map.update(np.array(pose), chair.now)
        assert chair.lethal(1.9, 2.3, -0.3, 0.3) == before
        cells = np.array(chair.snapshot.origin) / 0.025
        np.testing.assert_allclose(cells, np.round(cells), atol=1e-6)
        centre = np.array(chair.snapshot.origin) + 3.0
        assert np.abs(centre - pose[:2]).max() < 0.13
    chair.snapshot = chair.map.update(np.array([50.0, 0.0, 0.0]), chair.now)
    assert chair.lethal(40, 60, -5, 5) == 0 and not chair.known(51.5, 0.0)


def test_the_chairs_own_body_never_marks():
    # a person's shins, 0.65 m ahead of the axle: inside the outline, whose front edge lies at 0.70 m
    points = np.array([[0.65, y, z] for y in np.arange(-0.3, 0.3, 0.01) for z in np.arange(0.3, 0.7, 0.01)])
    for pose, marks in ((ORIGIN, False), (np.array([-1.5, 0.0, 0.0]), True)):
        costmap = Costmap(with_source("points", "PointCloud2").local_costmap, CHAIR)
        costmap.move_to(pose)
        for k in range(3):
            costmap.insert_points(points, (0.25, 0.0, 1.1), 0.1 * k)
        assert (costmap.update(pose, 0.3).cost == 254).any() == marks


def test_driving_over_a_place_frees_it():
    chair = Chair(floor(), box(2.0, 2.2, -0.2, 0.2, 0.0, 1.0)).look(times=3)
    chair.snapshot = chair.map.update(np.array([1.8, 0.0, 0.0]), chair.now)
    assert chair.lethal(1.6, 2.45, -0.3, 0.3) == 0


def test_clear_forgets_obstacles_and_known_ground_but_not_the_ground_under_the_chair():
    chair = Chair(floor(), box(2.0, 2.2, -0.2, 0.2, 0.0, 1.0)).look(times=3)
    chair.map.clear()
    chair.snapshot = chair.map.update(ORIGIN, chair.now)
    assert chair.lethal(-3, 3, -3, 3) == 0
    assert chair.known(0.5, 0.0) and not chair.known(1.9, 0.0) and not chair.known(1.0, 0.0)


def test_clear_outside_keeps_what_is_near():
    chair = Chair(floor(), box(1.8, 1.9, -0.2, 0.2, 0, 1), box(2.5, 2.6, 0.5, 0.9, 0, 1)).look(times=3)
    chair.map.clear_outside(2.2)
    chair.snapshot = chair.map.update(ORIGIN, chair.now)
    assert chair.lethal(1.7, 2.0, -0.3, 0.3) > 5 and chair.lethal(2.4, 2.7, 0.4, 1.0) == 0


def test_whatever_the_limits_allow_an_obstacle_becomes_lethal():
    rows = parameters.table("move_base")
    settings = SETTINGS.replace(**{
        "local_costmap/lethal_probability": rows["local_costmap/lethal_probability"].high,
        "local_costmap/log_odds_max": rows["local_costmap/log_odds_max"].low,
        "local_costmap/hit": rows["local_costmap/hit"].low})
    chair = Chair(floor(), box(2.0, 2.2, -0.4, 0.4, 0.0, 1.0), settings=settings).look(times=25)
    assert chair.lethal(1.95, 2.25, -0.45, 0.45) > 10


def test_costs_are_those_of_costmap_2d():
    chair = Chair(floor(), box(2.0, 2.05, -0.01, 0.01, 0.0, 1.0)).look(times=3)
    s = chair.snapshot
    lethal = np.argwhere(s.cost == 254) + 0.5
    k, radius = SETTINGS.local_costmap.cost_scaling_factor, 0.325  # half the width is the shortest way out
    for row, column in np.argwhere(s.known)[::97]:
        d = 0.025 * np.hypot(*(lethal - (row + 0.5, column + 0.5)).T).min()
        if d == 0:
            expected = 254
        elif d <= radius:
            expected = 253
        else:
            expected = math.floor(252 * math.exp(-k * (d - radius))) if d <= 0.8 else 0
        assert s.cost[row, column] == expected
        # to the surface within the nearest cell: from its centre at most half a diagonal either way
        assert s.distance[row, column] == pytest.approx(min(d, SETTINGS.local_costmap.distance_cap), abs=0.036)
    grid = to_grid(s)
    assert set(np.unique(grid.cells)) <= set(range(-1, 101))
    assert ((grid.cells == 100) == (s.cost == 254)).all() and ((grid.cells == -1) == (s.cost == 255)).all()
    assert ((grid.cells == 99) == (s.cost == 253)).all()


# --- other sources -----------------------------------------------------------------------------------------------


def with_source(name, data_type, **changes):
    """Settings with one more source, described as the camera is."""
    given = parameters.read_yaml(parameters.package_file("config/move_base.yaml"))
    given["wheelchair"] = parameters.read_yaml(parameters.package_file("config/wheelchair.yaml"))
    given["local_costmap"][name] = dict(given["local_costmap"]["camera"], data_type=data_type, **changes)
    given["local_costmap"]["observation_sources"] += " " + name
    return parameters.load("move_base", given)


def test_a_cloud_marks_and_clears_as_the_image_does():
    settings = with_source("points", "PointCloud2")
    renderer = Renderer([floor(), box(2.0, 2.2, -0.4, 0.4, 0.0, 1.0), box(4, 4.1, -5, 5, 0, 2.5)])
    empty = Renderer([floor(), box(4, 4.1, -5, 5, 0, 2.5)])
    chair = Chair(floor())
    costmap = Costmap(settings.local_costmap, CHAIR)
    costmap.move_to(ORIGIN)
    for world, blocked in ((renderer, True), (empty, False)):
        for k in range(4):
            optical = cameras.back_project(CAMERA, world.depth(ORIGIN)).reshape(-1, 3)
            points = optical @ MOUNT[:3, :3].T + MOUNT[:3, 3]
            assert costmap.insert_points(points, MOUNT[:3, 3], 0.1 * k)
        chair.snapshot = costmap.update(ORIGIN, 1.0)
        assert (chair.lethal(1.95, 2.25, -0.45, 0.45) > 20) == blocked
        assert chair.lethal(1.0, 1.9, -0.3, 0.3) == 0
        assert chair.known(2.6, 0.0) != blocked
    assert not costmap.insert_points(np.full((10, 3), np.nan), MOUNT[:3, 3], 5.0)


@pytest.mark.parametrize("error_deg", [-1.5, 1.5])
def test_a_cloud_that_pitches_has_no_obstacles_in_its_floor(error_deg):
    pitch = CHAIR.camera.pitch + math.radians(error_deg)
    costmap = Costmap(with_source("points", "PointCloud2").local_costmap, CHAIR)
    costmap.move_to(ORIGIN)
    depth = Renderer([floor(), box(2.0, 2.2, 0.2, 0.4, 0.0, 1.0)]).depth(ORIGIN, pitch=pitch)
    points = cameras.back_project(CAMERA, depth).reshape(-1, 3) @ MOUNT[:3, :3].T + MOUNT[:3, 3]
    costmap.insert_points(points, MOUNT[:3, 3], 0.0)
    chair = Chair(floor())
    chair.snapshot = costmap.update(ORIGIN, 0.0)
    assert chair.lethal(1.95, 2.25, 0.15, 0.45) > 5
    assert chair.lethal(-3, 3, -3, 3) == chair.lethal(1.95, 2.25, 0.15, 0.45)


def test_a_laser_scan_follows_rep_117():
    settings = with_source("scan", "LaserScan", raytrace_range=2.5, obstacle_range=2.0)
    costmap = Costmap(settings.local_costmap, CHAIR)
    chair = Chair(floor())
    costmap.move_to(ORIGIN)
    angles = np.radians([0.0, 30.0, 60.0, 90.0])
    costmap.insert_scan(np.array([1.5, np.inf, np.nan, -np.inf]), angles, 5.0, np.array([0.5, 0, 0]), 0.3, 0.0)
    chair.snapshot = costmap.update(ORIGIN, 0.0)
    assert chair.cost(2.01, 0.01) == 254  # 0.5 + 1.5 ahead
    assert chair.known(1.8, 0.01) and chair.cost(1.3, 0.01) != 255
    x, y = 0.5 + 2.0 * math.cos(math.radians(30)), 2.0 * math.sin(math.radians(30))
    assert chair.known(x, y), "+Inf clears as far as rays clear"
    x, y = 0.5 + 2.0 * math.cos(math.radians(60)), 2.0 * math.sin(math.radians(60))
    assert not chair.known(x, y), "NaN says nothing"
    assert not chair.known(0.5, 1.5), "-Inf clears nothing"
    # the obstacle goes: the beam that passes now clears it
    for k in range(4):
        costmap.insert_scan(np.array([np.inf]), angles[:1], 5.0, np.array([0.5, 0, 0]), 0.3, 0.1 * k)
    chair.snapshot = costmap.update(ORIGIN, 1.0)
    assert chair.cost(2.01, 0.01) != 254


@pytest.mark.parametrize("reading", [np.nan, 0.0, 5.1])
def test_a_scan_that_says_nothing_leaves_the_grid_as_old_as_it_was(reading):
    settings = with_source("scan", "LaserScan", raytrace_range=2.5, obstacle_range=2.0)
    costmap = Costmap(settings.local_costmap, CHAIR)
    costmap.move_to(ORIGIN)
    angles = np.radians(np.arange(360.0))
    assert costmap.insert_scan(np.full(360, 1.5), angles, 5.0, ORIGIN, 0.3, 1.0)
    assert not costmap.insert_scan(np.full(360, reading), angles, 5.0, ORIGIN, 0.3, 2.0)
    assert costmap.newest["scan"] == 1.0
    too_near = np.where(np.arange(360) == 4, -np.inf, reading)
    assert costmap.insert_scan(too_near, angles, 5.0, ORIGIN, 0.3, 2.0)
    assert costmap.newest["scan"] == 2.0


def test_infinity_says_nothing_where_it_is_not_valid():
    settings = SETTINGS.replace(**{
        "local_costmap/camera/inf_is_valid": False, "local_costmap/rangers/inf_is_valid": False})
    wall = box(2.0, 2.1, -1.0, 1.0, 0.0, 1.3)
    chair = Chair(floor(), wall, settings=settings).look(times=3)
    marked = chair.lethal(1.9, 2.2, -0.5, 0.5)
    assert marked > 10
    chair.look(times=3, change=lambda image: np.where(image < 2.3, np.inf, image))
    assert chair.lethal(1.9, 2.2, -0.5, 0.5) == marked
    chair.map.insert_ranges(Ranges(0.0, np.full(6, np.inf)), ORIGIN)
    chair.snapshot = chair.map.update(ORIGIN, chair.now)
    assert not chair.known(0.16, 1.2)


def test_inflation_beyond_the_cap_of_distances_leaves_an_empty_map_empty():
    settings = SETTINGS.replace(**{
        "local_costmap/inflation_radius": 2.5, "local_costmap/cost_scaling_factor": 1.0,
        "local_costmap/distance_cap": 1.5, "local_costmap/track_unknown_space": False})
    costmap = Costmap(settings.local_costmap, CHAIR)
    costmap.move_to(ORIGIN)
    snapshot = costmap.update(ORIGIN, 0.0)
    assert (snapshot.cost == 0).all() and snapshot.distance.min() > 2.5


def test_points_straight_above_and_below_the_sensor_stay_in_the_spherical_image():
    sensor, count = np.array([0.0, 0.0, 1.0]), costmap_points.count_points.py_func  # with Python's check of indices
    points = sensor + np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [-1.0, 1e-9, 0.0]])
    image = np.empty(costmap_points.SHAPE, np.float32)
    counters = [np.zeros((80, 80), kind) for kind in (np.int32, np.uint16, np.uint16, np.int32, np.int32)]
    limits = (0.05, 1.45, 4.0, 4.4, 0.05, 1.5, 3.0, 0.5)
    used, _ = count(points, sensor, image, np.array([-1.0, -1.0]), 0.025, limits, *counters)
    assert used == 4 and counters[3].sum() == 1, "the one straight below is floor"


def test_rangers_watch_the_sides():
    # 0.40 m from a sensor that sits 0.175 m beside the middle: a wall at y = 0.575
    chair = Chair(floor())
    values = np.array([0.40, np.inf, np.nan, np.inf, -np.inf, 1.4])
    chair.map.move_to(ORIGIN)
    chair.map.insert_ranges(Ranges(0.0, values), ORIGIN)
    chair.snapshot = chair.map.update(ORIGIN, 0.0)
    assert chair.lethal(0.55, 0.65, 0.55, 0.61) >= 1, "left front, 0.40 m"
    assert chair.known(0.16, 1.5), "left middle: free up to its 1.5 m"
    assert chair.lethal(0.1, 0.2, -0.36, -0.32) == 1, "right middle: at the chair's edge"
    assert chair.lethal(-0.3, -0.2, -1.7, -1.5) == 0, "right rear, beyond the obstacle range"
    assert chair.lethal(-3, 3, -3, 3) == chair.lethal(0.55, 0.65, 0.55, 0.61) + 1
    # the wall ends: the next readings clear what the first one marked
    for k in range(4):
        chair.map.insert_ranges(Ranges(0.1 * k, np.full(6, np.inf)), ORIGIN)
    chair.snapshot = chair.map.update(ORIGIN, 1.0)
    assert chair.lethal(0.5, 0.7, 0.5, 0.7) == 0


def test_a_far_reading_does_not_mark_ground_that_the_camera_saw_free():
    # at 0.9 m the cone is 9 cm wide: what returned, perhaps a jamb, need not stand in its middle
    chair = Chair(floor()).look(times=3)
    turned = np.array([2.06, -1.0, 0.0])
    for k in range(5):
        chair.map.move_to(turned)
        chair.map.insert_ranges(Ranges(0.1 * k, np.array([np.nan, 0.9, np.nan, np.nan, 0.3, np.nan])), turned)
    chair.snapshot = chair.map.update(turned, chair.now)
    assert chair.lethal(2.0, 2.4, -0.2, 0.2) == 0
    assert chair.lethal(2.1, 2.3, -1.6, -1.4) >= 1, "near readings do: 1.0 + 0.175 + 0.3"


def test_rangers_clear_a_remembered_jamb_that_drifted_into_the_gap():
    chair = Chair(floor(), box(2.0, 2.12, 0.36, 1.0, 0.0, 2.0)).look(times=25)
    pose = np.array([1.46, 0.0, 0.0])  # the left front ranger, 0.60 ahead, stands beside x = 2.06
    assert chair.lethal(2.0, 2.12, 0.35, 0.40) >= 1
    for k in range(5):
        chair.map.move_to(pose)
        chair.map.insert_ranges(Ranges(k * 0.1, np.array([0.30, np.inf, np.inf, np.inf, np.inf, np.inf])), pose)
    chair.snapshot = chair.map.update(pose, chair.now)
    assert chair.lethal(2.05, 2.07, 0.35, 0.43) == 0
    assert chair.lethal(2.04, 2.08, 0.46, 0.50) >= 1  # 0.175 + 0.30


def test_the_stamp_is_that_of_the_oldest_required_source():
    chair = Chair(floor()).look(times=1)  # camera at 100.0
    assert math.isinf(chair.snapshot.stamp), "the rangers have sent nothing"
    for t in (100.1, 100.9):
        chair.map.insert_ranges(Ranges(t, np.full(6, np.inf)), ORIGIN)
    assert chair.map.update(ORIGIN, 101.0).stamp == 100.0, "rangers cannot hide a dead camera"


def test_a_stamp_from_the_future_does_not_last():
    chair = Chair(floor()).look()
    for stamp in (1e6, 100.2):
        chair.map.insert_ranges(Ranges(stamp, np.full(6, np.inf)), ORIGIN)
    chair.now = 100.1
    assert chair.look().snapshot.stamp == 100.1


def test_without_a_source_the_costmap_is_never_complete():
    settings = SETTINGS.replace(**{"local_costmap/observation_sources": ""})
    costmap = Costmap(settings.local_costmap, CHAIR)
    assert costmap.update(ORIGIN, 5.0).stamp == -math.inf


@pytest.mark.parametrize("call, message", [
    (lambda m: m.insert_depth(np.zeros((4, 5)), CAMERA, np.eye(4), 0.0), "320 x 240"),
    (lambda m: m.insert_depth(np.zeros((240, 320)), CAMERA, np.full((4, 4), np.nan), 0.0), "finite 4 x 4"),
    (lambda m: m.insert_points(np.zeros((4, 2)), np.zeros(3), 0.0, source="camera"), r"\(n, 3\)"),
    (lambda m: m.insert_scan(np.zeros(3), np.zeros(2), 5.0, ORIGIN, 0.3, 0.0, source="camera"), "3 ranges at 2"),
    (lambda m: m.insert_scan(np.ones(2), np.zeros(2), 5.0, ORIGIN, 1.9, 0.0, source="camera"), "1.90 m .*limits 0.05"),
    (lambda m: m.insert_ranges(Ranges(0.0, np.zeros(5)), ORIGIN), "5 range readings"),
    (lambda m: m.insert_scan(np.zeros(2), np.zeros(2), 5.0, ORIGIN, 0.3, 0.0, source="sonar"), "'sonar'"),
    (lambda m: m.move_to(np.array([0.0, np.inf, 0.0])), "three finite"),
])
def test_unusable_input_is_refused_with_the_reason(call, message):
    costmap = Costmap(SETTINGS.local_costmap, CHAIR)
    costmap.move_to(ORIGIN)
    with pytest.raises(CostmapError, match=message):
        call(costmap)
