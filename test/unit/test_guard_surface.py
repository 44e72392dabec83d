"""The guard measures to the surface in the cells, where the costmap tells it, and keeps off whole cells where not."""
import math
from types import SimpleNamespace

import numpy as np
import pytest
from test_guard import CHAIR, RESOLUTION, SETTINGS, SIZE, Chair, empty, filled

from wheelchair_shared_control import conversions, rectangle, sweep
from wheelchair_shared_control.grid import LETHAL, WHOLE_CELLS
from wheelchair_shared_control.guard import FREE, STOPPED, Guard
from wheelchair_shared_control.values import Odometry, Twist

WHOLE = (0, 3, 0, 3)
STAMP = SimpleNamespace(secs=12, nsecs=500000000)


def with_surface(grid, box=WHOLE, cells=None):
    """The grid with a surface: ``box`` in the ``cells`` (rows, columns) bool, whole cells elsewhere."""
    surface = np.empty((SIZE, SIZE, 4), np.int8)
    surface[:] = WHOLE
    if cells is not None:
        surface[cells] = box
    return grid._replace(surface=surface)


def door(half):
    """A wall 0.1 m thick at x 0.9-1.0 with a gap of y +-``half`` (a multiple of a quarter cell), with its surface.

    A cell that is filled at most half is left free, its sliver is of the cell behind it, as the costmap has it.
    """
    cells = empty().cells
    surface = np.empty((SIZE, SIZE, 4), np.int8)
    surface[:] = WHOLE
    quarters = int(round((half + 3.0) / (0.25 * RESOLUTION)))  # of the left jamb, from the window's edge
    first, filled_from = divmod(quarters, 4)
    if filled_from >= 2:
        first, filled_from = first + 1, filled_from - 4
    columns = slice(int(round(3.9 / RESOLUTION)), int(round(4.0 / RESOLUTION)))
    cells[first:, columns] = LETHAL
    cells[: SIZE - first, columns] = LETHAL
    surface[first, columns] = (0, 3, filled_from, 3)
    surface[SIZE - 1 - first, columns] = (0, 3, 0, 3 - filled_from)
    return empty()._replace(cells=cells, surface=surface)


# ---- what the guard does with it ------------------------------------------------------------------------


@pytest.mark.parametrize("half", np.arange(0.35, 0.3749, 0.00625))
def test_passes_three_centimetres_wherever_the_cells_lie(half):
    """3 cm a side and up, at all four places that the jamb may have in its cell."""
    chair = Chair(door(half))
    states = chair.drive(Twist(0.15, 0.0), 14.0)
    assert chair.pose[0] > 1.5 and STOPPED not in states


@pytest.mark.parametrize("aside", [-0.010, 0.010])
def test_passes_three_centimetres_off_the_middle(aside):
    chair = Chair(door(0.35625), pose=(0.0, aside, 0.0))
    states = chair.drive(Twist(0.15, 0.0), 14.0)
    assert chair.pose[0] > 1.5 and STOPPED not in states


@pytest.mark.parametrize("half, surface, passes", [
    (0.35, None, True), (0.33125, None, False), (0.35, WHOLE_CELLS, True), (0.33125, WHOLE_CELLS, False)])
def test_without_the_surface_a_door_must_leave_more(half, surface, passes):
    """Cells from 0.35 m on, 2.5 cm beside the chair, leave 1.25 cm to what may jut out of them; from 0.325 m, none."""
    chair = Chair(door(half)._replace(surface=surface))
    chair.drive(Twist(0.15, 0.0), 14.0)
    assert (chair.pose[0] > 1.5) == passes


@pytest.mark.parametrize("quarter", range(4))
@pytest.mark.parametrize("command", [(0.3, 0.0), (0.3, 0.15), (0.0, 0.6), (-0.3, 0.1)])
def test_never_comes_nearer_to_the_surface_than_its_margin(quarter, command):
    """Walls ahead, beside and behind, one cell thick, of which the outer quarters are free."""
    grid = filled(empty(), (1.5, 1.525), (-1.5, 1.5))
    grid = filled(grid, (-1.0, 1.525), (0.6, 0.625))
    grid = filled(grid, (-0.8, -0.775), (-1.5, 0.6))
    surface = with_surface(grid).surface
    column, row, back = (int(round((at + 3.0) / RESOLUTION)) for at in (1.5, 0.6, -0.8))
    surface[:, column, 0] = surface[row, :, 2] = quarter
    surface[:, back, 1] = 3 - quarter
    chair = Chair(grid._replace(surface=surface))
    inside = 0.25 * quarter * RESOLUTION
    nearest = math.inf
    for _ in range(150):
        chair.drive(Twist(*command), 1 / 30)
        for u in (CHAIR.front, CHAIR.rear):
            for w in (CHAIR.half_width, -CHAIR.half_width):
                x = chair.pose[0] + math.cos(chair.pose[2]) * u - math.sin(chair.pose[2]) * w
                y = chair.pose[1] + math.sin(chair.pose[2]) * u + math.cos(chair.pose[2]) * w
                nearest = min(nearest, 1.5 + inside - x, 0.6 + inside - y, x + 0.775 + inside)
    assert SETTINGS.guarding.margin < nearest < 0.1 and chair.verdict.state == STOPPED


def test_a_hole_between_two_places_of_a_wall_is_none():
    """A wall beside a turning chair whose cells show only their inner quarters is as closed as a solid one."""
    wall = filled(empty(), (-1.5, 1.5), (0.45, 0.475))
    solid, sparse = Chair(with_surface(wall)), Chair(with_surface(wall, (1, 2, 0, 3), wall.cells == LETHAL))
    for chair in (solid, sparse):
        chair.drive(Twist(0.0, 0.5), 3.0)
    np.testing.assert_allclose(solid.pose, sparse.pose, atol=1e-9)


def test_a_lethal_cell_without_a_box_is_whole():
    grid = filled(empty(), (1.0, 1.025), (-0.5, 0.5))
    message = surface_message(with_surface(grid, (2, 3, 0, 3), grid.cells == LETHAL))
    more = filled(grid, (0.95, 0.975), (-0.2, 0.2))  # a grid that knows more than the surface
    surface = conversions.surface_of(message, more)
    assert (surface[more.cells == LETHAL] == WHOLE).all(axis=1).sum() == 16  # 0.4 m
    assert (surface[grid.cells == LETHAL] == (2, 3, 0, 3)).all()


def test_measures_to_the_box_and_not_to_its_centre():
    # 10 cm ahead of the front edge, the surface in the last quarter of its cell: 0.1 m + 0.75 * 0.025 m
    grid = filled(empty(), (0.8, 0.825), (-0.5, 0.5))
    fine = with_surface(grid, (3, 3, 0, 3), grid.cells == LETHAL)
    guard, guarding = Guard(SETTINGS), SETTINGS.guarding
    still = Odometry(0.0, np.zeros(3), Twist(0.0, 0.0))
    room = {}
    for name, seen in (("fine", fine), ("not known", grid), ("whole", grid._replace(surface=WHOLE_CELLS))):
        # how far a command of so and so much speed comes to a stop, from standstill
        scene = guard.look(seen, np.zeros(3))
        room[name] = max(
            v for v in np.arange(0.02, 0.6, 0.0005) if guard.check(Twist(v, 0.0), 0.0, still, scene).state == FREE)
    ways = {}
    for name, v in room.items():
        poses, _ = sweep.brake(
            np.zeros(3), 0.0, 0.0, v, 0.0, 1.5 / SETTINGS.rate, guarding.deceleration, guarding.turn_deceleration,
            SETTINGS.wheelchair.actuation.lag)
        margin = guarding.margin + guarding.margin_turning + guarding.margin_per_speed * v
        ways[name] = poses[-1, 0] + margin
    assert ways["fine"] == pytest.approx(0.11875, abs=1e-3)
    assert ways["not known"] == pytest.approx(0.1 - 0.5 * RESOLUTION, abs=1e-3)  # what may jut
    assert ways["whole"] == pytest.approx(0.1, abs=1e-3)


# ---- distances ------------------------------------------------------------------------------------------


def test_distance_of_a_box_is_that_of_its_nearest_point():
    rng = np.random.default_rng(8)
    for _ in range(300):
        low = rng.uniform(-1.3, 1.3, 2)
        size = rng.uniform(0.0, 0.06, 2)
        box = np.array([low[0], low[0] + size[0], low[1], low[1] + size[1]])
        x, y, yaw = rng.uniform(-0.3, 0.3, 3) * (1, 1, 10)
        got = rectangle.box_distance(
            box, x, y, math.cos(yaw), math.sin(yaw), CHAIR.front, CHAIR.rear, CHAIR.half_width)
        across, along = np.meshgrid(np.linspace(box[0], box[1], 41), np.linspace(box[2], box[3], 41))
        points = np.column_stack((across.ravel(), along.ravel()))
        sampled = rectangle.nearest(points, x, y, yaw, CHAIR.front, CHAIR.rear, CHAIR.half_width)
        if sampled > 0.002:
            assert got == pytest.approx(sampled, abs=0.0011)  # half of 1.5 mm between the points, both ways
        else:
            assert got <= sampled + 0.03 and got <= 0.002  # inside, the deepest corner counts


# ---- the message ----------------------------------------------------------------------------------------


def surface_message(grid):
    message = SimpleNamespace(header=SimpleNamespace(stamp=STAMP))
    return conversions.fill_surface(
        message, grid, lambda name, offset, datatype, count: SimpleNamespace(
            name=name, offset=offset, datatype=datatype, count=count))


def random_surface(rng):
    """A grid of random lethal cells far from the origin of odom, with any box that a cell may have."""
    cells = np.where(rng.random((SIZE, SIZE)) < 0.1, LETHAL, 0).astype(np.int8)
    low = rng.integers(-4, 4, (SIZE, SIZE, 2))
    high = np.minimum(low + rng.integers(0, 8, low.shape), 7)
    surface = np.stack((low[..., 0], high[..., 0], low[..., 1], high[..., 1]), axis=-1).astype(np.int8)
    return empty()._replace(cells=cells, surface=surface, origin=(57.325, -143.95))


def test_the_surface_comes_back_from_its_message():
    grid = random_surface(np.random.default_rng(2))
    message = surface_message(grid)
    back = conversions.surface_of(message, grid)
    lethal = grid.cells == LETHAL
    np.testing.assert_array_equal(back[lethal], grid.surface[lethal])
    assert (back[~lethal] == WHOLE).all() and not back.flags.writeable
    # rviz draws the middles of the boxes
    points = conversions.points_of(message)
    assert points.shape == (lethal.sum(), 3) and (points[:, 2] == 0.0).all()
    rows, columns = np.nonzero(lethal)
    x = grid.origin[0] + (columns + (grid.surface[lethal][:, :2].sum(axis=1) + 1) / 8) * RESOLUTION
    np.testing.assert_allclose(points[:, 0], x, atol=1e-5)


def test_boxes_that_lie_between_the_quarters_grow_to_the_next():
    grid = filled(empty(), (0.0, 0.025), (0.0, 0.025))
    message = surface_message(with_surface(grid))
    box = np.frombuffer(message.data, conversions.SURFACE).copy()
    box["x"], box["half_x"] = 0.0125, 0.004  # from 0.0085 to 0.0165: of quarters 1 and 2, each 6.25 mm
    message.data = box.tobytes()
    assert tuple(conversions.surface_of(message, grid)[120, 120]) == (1, 2, 0, 3)


@pytest.mark.parametrize("field, value", [
    ("x", math.nan), ("y", math.inf), ("half_x", -0.1), ("half_y", 3.0), ("x", 0.3), ("cell", 10**6)])
def test_a_box_that_cannot_be_its_cells_leaves_the_cell_whole(field, value):
    grid = filled(empty(), (0.0, 0.05), (0.0, 0.025))
    message = surface_message(with_surface(grid, (1, 2, 1, 2), grid.cells == LETHAL))
    boxes = np.frombuffer(message.data, conversions.SURFACE).copy()
    boxes[field][0] = value
    message.data = boxes.tobytes()
    surface = conversions.surface_of(message, grid)
    assert tuple(surface[120, 120]) == WHOLE and tuple(surface[120, 121]) == (1, 2, 1, 2)


def test_a_surface_of_another_window_is_of_no_use():
    grid = random_surface(np.random.default_rng(3))
    moved = grid._replace(origin=(grid.origin[0] + 0.1, grid.origin[1]))
    surface = conversions.surface_of(surface_message(moved), grid)
    # a box may reach one cell out of its own, but none of these lies four cells beside it
    assert (surface == WHOLE).all()


def _cut(message):
    message.data = message.data[:-1]


def _renamed(message):
    message.fields[3].name = "halfx"


def _of_double(message):
    message.fields[0].datatype = 8


@pytest.mark.parametrize("spoil, said", [(_cut, "bytes"), (_renamed, "fields"), (_of_double, "fields")])
def test_a_malformed_surface_is_refused(spoil, said):
    grid = filled(empty(), (0.0, 0.05), (0.0, 0.025))
    message = surface_message(with_surface(grid))
    spoil(message)
    with pytest.raises(conversions.ConversionError, match="surface.*" + said):
        conversions.surface_of(message, grid)


def test_an_update_of_the_grid_has_no_surface_yet():
    grid = with_surface(filled(empty(), (0.0, 0.05), (0.0, 0.025)))
    patch = SimpleNamespace(
        header=SimpleNamespace(stamp=STAMP), x=0, y=0, width=1, height=1, data=np.array([LETHAL], np.int8))
    assert conversions.updated_grid(grid, patch).surface is None
