"""What the benchmark measures against does the same job: same doorway, same features."""
import numpy as np
import pytest
from costmap_scenes import CAMERA, CHAIR, SETTINGS, Renderer, door, floor

from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control.costmap import Costmap
from wheelchair_shared_control.experiments.plain_costmap import PlainCostmap, plain_features
from wheelchair_shared_control.features import distances
from wheelchair_shared_control.footprint import Footprint
from wheelchair_shared_control.grid import LETHAL, Grid


def test_both_costmaps_see_the_same_wall_and_the_same_gap():
    image = Renderer([floor(), *door(0.9, x=2.51)]).depth(np.zeros(3))
    mount = cameras.mounting(CHAIR)
    ours = Costmap(SETTINGS.local_costmap, CHAIR)
    ours.move_to(np.zeros(3))
    ours.insert_depth(image, CAMERA, mount, 0.0)
    snapshot = ours.update(np.zeros(3), 0.0)
    plain = PlainCostmap(SETTINGS.local_costmap, snapshot.cost.shape, snapshot.origin)
    cost, distance = plain.update(image, CAMERA, mount, ours.footprint.inscribed_radius)
    face = int((2.46 + 3.0) / 0.025)  # the column of cells that holds the face of the wall, at 2.45
    for row in range(int((3.0 - 0.9) / 0.025), int((3.0 + 0.9) / 0.025)):
        y = (row + 0.5) * 0.025 - 3.0
        if abs(abs(y) - 0.45) > 0.03:
            assert (cost[row, face] == 254) == (snapshot.cost[row, face] == 254) == (abs(y) > 0.45)
    assert distance[120, face] == pytest.approx(snapshot.distance[120, face], abs=0.03)


def test_both_features_agree():
    rng = np.random.default_rng(8)
    chair = Footprint(1.05, 0.65, 0.35)
    for share in (0.001, 0.0004) * 10:
        cells = np.where(rng.random((240, 240)) < share, LETHAL, 0).astype(np.int8)
        grid = Grid(cells, 0.025, (-3.0, -3.0), 0.0)
        pose = np.append(rng.uniform(-0.5, 0.5, 2), rng.uniform(-3, 3))
        assert plain_features(grid, pose, chair) == pytest.approx(distances(grid, pose, chair), abs=1e-9)
