"""The paper's features on grids whose answer can be computed by hand, and against a loop over all cells."""
import math

import numpy as np
import pytest

from wheelchair_shared_control import se2
from wheelchair_shared_control.features import FeaturesError, distances
from wheelchair_shared_control.footprint import Footprint
from wheelchair_shared_control.grid import LETHAL, UNKNOWN, Grid

CHAIR = Footprint(1.05, 0.65, 0.35)  # front edge at 0.70, rear edge at -0.35, sides at +-0.325
ORIGIN = np.zeros(3)


def grid_with(*points):
    """6 x 6 m about the chair at 0.025 m, with the cells of ``points`` occupied; centres at odd 0.0125 m."""
    cells = np.zeros((240, 240), np.int8)
    for x, y in points:
        cells[int((y + 3.0) / 0.025), int((x + 3.0) / 0.025)] = LETHAL
    return Grid(cells, 0.025, (-3.0, -3.0), 0.0)


@pytest.mark.parametrize("point, expected, why", [
    ((1.2125, 0.0125), (2.0, 0.5125, 2.0), "ahead: 1.2125 - 0.70"),
    ((0.1125, 0.6125), (0.2875, 2.0, 2.0), "beside, left: 0.6125 - 0.325"),
    ((0.1125, -0.6125), (2.0, 2.0, 0.2875), "beside, right"),
    ((1.0125, 0.6125), (math.hypot(0.3125, 0.2875), 2.0, 2.0), "ahead of the left side: from the corner"),
    ((1.0125, 0.3125), (2.0, 0.3125, 2.0), "still between the side edges: front"),
    ((1.0125, 0.3375), (math.hypot(0.3125, 0.0125), 2.0, 2.0), "just beyond the side edge: left"),
    ((-0.3375, 0.6125), (0.2875, 2.0, 2.0), "just ahead of the rear edge counts"),
    ((-0.3625, 0.6125), (2.0, 2.0, 2.0), "behind the rear edge does not"),
    ((-0.6125, 0.0125), (2.0, 2.0, 2.0), "straight behind neither"),
    ((2.7375, 0.0125), (2.0, 2.0, 2.0), "farther than 2 m"),
    ((0.6875, 0.0125), (2.0, 0.0, 2.0), "under the foot rest: the front edge is nearest"),
    ((0.0125, 0.3125), (0.0, 2.0, 2.0), "under the left arm rest"),
    ((-0.3375, -0.2125), (2.0, 2.0, 0.0), "under the seat, rear: no region lies behind, the right edge is nearest"),
])
def test_one_occupied_cell(point, expected, why):
    assert distances(grid_with(point), ORIGIN, CHAIR) == pytest.approx(expected, abs=1e-9), why


def test_unknown_and_inscribed_are_not_occupied():
    grid = grid_with()
    grid.cells[:120] = UNKNOWN
    grid.cells[120:] = 99
    assert distances(grid, ORIGIN, CHAIR) == (2.0, 2.0, 2.0)


def by_loop(grid, pose, footprint, max_range):
    """The definition, word by word, over every cell."""
    d = {"left": max_range, "front": max_range, "right": max_range}
    for row, column in zip(*np.nonzero(grid.cells == LETHAL)):
        centre = np.array([[column + 0.5, row + 0.5]]) * grid.resolution + grid.origin
        x, y = se2.transform_points(se2.inverse(pose), centre)[0]
        distance = math.hypot(max(footprint.rear - x, 0, x - footprint.front), max(abs(y) - footprint.half_width, 0))
        if footprint.rear <= x <= footprint.front and abs(y) <= footprint.half_width:
            edges = {"front": footprint.front - x, "left": footprint.half_width - y,
                     "right": footprint.half_width + y}
            region = min(edges, key=edges.get)
        elif x > footprint.front and abs(y) <= footprint.half_width:
            region = "front"
        elif x >= footprint.rear and y > footprint.half_width:
            region = "left"
        elif x >= footprint.rear and y < -footprint.half_width:
            region = "right"
        else:
            continue
        d[region] = min(d[region], distance)
    return d["left"], d["front"], d["right"]


def test_random_grids_and_poses_equal_the_definition():
    rng = np.random.default_rng(5)
    for share in (0.0005, 0.002, 0.05) * 8:
        cells = np.where(rng.random((120, 100)) < share, LETHAL, 0).astype(np.int8)
        grid = Grid(cells, 0.05, tuple(rng.uniform(-4, 1, 2)), 0.0)
        pose = np.append(rng.uniform(-3, 3, 2), rng.uniform(-4, 4))  # also outside the grid
        assert distances(grid, pose, CHAIR, 1.7) == pytest.approx(by_loop(grid, pose, CHAIR, 1.7), abs=1e-9)


def test_mirrored_world_mirrors_left_and_right():
    rng = np.random.default_rng(6)
    cells = np.where(rng.random((240, 240)) < 0.003, LETHAL, 0).astype(np.int8)
    left, front, right = distances(Grid(cells, 0.025, (-3.0, -3.0), 0.0), np.array([0.1, 0.0, 0.0]), CHAIR)
    mirrored = distances(Grid(cells[::-1], 0.025, (-3.0, -3.0), 0.0), np.array([0.1, 0.0, 0.0]), CHAIR)
    assert mirrored == pytest.approx((right, front, left))


def test_a_pose_that_is_not_finite_is_refused():
    with pytest.raises(FeaturesError, match="not finite"):
        distances(grid_with(), np.array([0.0, np.nan, 0.0]), CHAIR)
    with pytest.raises(FeaturesError, match="int8"):
        distances(Grid(np.zeros((4, 4)), 0.025, (0.0, 0.0), 0.0), ORIGIN, CHAIR)
