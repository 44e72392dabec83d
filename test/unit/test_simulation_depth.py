"""The depth camera: the z-buffer against open3d's ray caster, and the Kinect's noise."""
import numpy as np
import pytest

from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control import parameters
from wheelchair_shared_control.simulation import depth_noise, outlines, rangers, scenes, zbuffer
from wheelchair_shared_control.simulation.sensors import DepthCamera
from wheelchair_shared_control.simulation.world import box, make

SETTINGS = parameters.load("simulator")
CAMERA = cameras.from_settings(SETTINGS.wheelchair)
FAR = SETTINGS.wheelchair.camera.max_range


def ray_cast(boxes, camera, world_from_camera):
    """Depth (height, width) [m] by open3d, floor included."""
    open3d = pytest.importorskip("open3d")
    scene = open3d.t.geometry.RaycastingScene()
    rows = np.vstack((boxes, [box(0.0, 0.0, -0.5, 0.0, 100.0, 100.0, 1.0)]))
    for row in rows:
        mesh = open3d.t.geometry.TriangleMesh.create_box(*(2.0 * row[4:]))
        turn = np.eye(3)
        turn[:2, :2] = [[np.cos(row[3]), -np.sin(row[3])], [np.sin(row[3]), np.cos(row[3])]]
        mesh.translate(-row[4:]).rotate(turn, np.zeros(3)).translate(row[:3])
        scene.add_triangles(mesh)
    directions = cameras.back_project(camera, np.ones((camera.height, camera.width))) @ world_from_camera[:3, :3].T
    rays = np.concatenate((np.broadcast_to(world_from_camera[:3, 3], directions.shape), directions), axis=-1)
    return scene.cast_rays(open3d.core.Tensor(rays.astype(np.float32)))["t_hit"].numpy()


def away_from_edges(depth, pixels=2):
    """Pixels none of whose neighbours within ``pixels`` differs by more than 5 cm."""
    steady = np.isfinite(depth)
    for axis in (0, 1):
        for shift in range(-pixels, pixels + 1):
            with np.errstate(invalid="ignore"):
                steady &= np.abs(np.roll(depth, shift, axis) - depth) < 0.05
    return steady


def clutter_world(seed, count=60):
    rng = np.random.default_rng(seed)
    rows = [box(*rng.uniform((0.5, -2, 0), (3, 2, 1.5)), rng.uniform(-3, 3), *rng.uniform(0.05, 1.0, 3))
            for _ in range(count)]
    return make(rows, ["box_%d" % i for i in range(count)])


@pytest.mark.parametrize("scene", ["hallway", "clutter", "behind walls"])
def test_zbuffer_is_within_5_mm_of_the_ray_caster(scene):
    rng = np.random.default_rng(7)
    if scene == "hallway":
        world = scenes.build("hallway")
    elif scene == "clutter":
        world = clutter_world(3)
    else:  # many full-height boxes: most are culled before drawing
        rows = [box(x, y, 1.25, 0.1 * x, 0.06, 0.3, 2.5)
                for x in np.arange(0.0, 4.0, 0.3) for y in np.arange(-3.0, 3.0, 0.29)]
        world = make(rows, ["pillar_%d" % i for i in range(len(rows))])
    camera = cameras.scaled(CAMERA, 320, 240)
    for _ in range(3):
        pose = np.array([rng.uniform(-3.0, -1.0), rng.uniform(-1.0, 1.0), rng.uniform(-0.6, 0.6)])
        world_from_camera = cameras.lifted(pose) @ cameras.mounting(SETTINGS.wheelchair)
        inverse, _ = zbuffer.render(world.boxes, camera, world_from_camera, FAR + 0.5)
        with np.errstate(divide="ignore"):
            depth = 1.0 / inverse
        truth = ray_cast(world.boxes, camera, world_from_camera)
        compared = away_from_edges(truth) & (truth < FAR)
        assert compared.mean() > 0.2
        assert np.abs(depth[compared] - truth[compared]).max() < 0.005


def test_boxes_hidden_behind_walls_are_not_missed():
    # a map's wall: hundreds of 5 cm boxes; culling must not change a pixel within range
    rng = np.random.default_rng(5)
    rows = [box(*(np.round(rng.uniform((0.5, -2.5), (5.0, 2.5)), 1)), 1.25, 0.0, 0.05, 0.05, 2.5) for _ in range(400)]
    rows += [box(2.0, -1.0, 1.0, 0.3, 0.4, 0.4, 0.3), box(1.0, 0.0, 2.25, 0.0, 0.1, 3.0, 0.5)]
    boxes = np.array(rows)
    world_from_camera = cameras.lifted(np.array([-0.4, 0.1, 0.05])) @ cameras.mounting(SETTINGS.wheelchair)
    culled, _ = zbuffer.render(boxes, CAMERA, world_from_camera, FAR)
    batches = [zbuffer.render(boxes[i:i + 20], CAMERA, world_from_camera, FAR)[0] for i in range(0, len(boxes), 20)]
    whole = np.max(batches, axis=0)
    near = whole > 1.0 / FAR
    assert near.mean() > 0.3
    assert np.array_equal(culled[near], whole[near])


def test_depth_of_a_wall_straight_ahead():
    # wall face at x = 2; camera at x = 0.25: the level line through the wall is at 1.75 m / cos(pitch) along z... the
    # depth along the optical axis of the pixel that looks level is 1.75 * cos(15 deg)
    world = make([box(2.05, 0.0, 1.25, 0.0, 0.1, 6.0, 2.5)], ["wall"])
    camera = DepthCamera(SETTINGS, np.random.default_rng(1))
    image = camera.truth(world.boxes, np.zeros(3))
    row = int(round(CAMERA.cy - CAMERA.fy * np.tan(np.radians(15.0))))
    assert image[row, 320] == pytest.approx(1.75 * np.cos(np.radians(15.0)), abs=2e-3)


def test_noise_has_the_stated_spread_and_quanta():
    # plane at depth z facing the camera: sigma_z = 0.0012 + 0.0019 (z - 0.4)^2, then disparity in 1/8 pixel
    noise = depth_noise.DepthNoise(SETTINGS.depth_noise, SETTINGS.wheelchair, np.random.default_rng(2))
    for z in (0.8, 2.0, 4.0):
        inverse = np.full((480, 640), 1.0 / z, np.float32)
        image = noise.apply(inverse, np.full((480, 640), z, np.float32), CAMERA)
        valid = image[np.isfinite(image)]
        sigma = 0.0012 + 0.0019 * (z - 0.4) ** 2
        quantum = z * z / (589.4 * 0.075 / 0.125)
        assert valid.std() == pytest.approx(np.hypot(sigma, quantum / np.sqrt(12.0)), rel=0.05)
        assert valid.mean() == pytest.approx(z, abs=0.1 * sigma + 1e-4)
        counts = 589.4 * 0.075 / 0.125 / valid
        assert np.abs(counts - np.rint(counts)).max() < 2e-3


def test_no_depth_is_told_as_in_rep_117():
    camera = DepthCamera(SETTINGS, np.random.default_rng(1))
    # 0.35 m before the lens: closer than 0.5 m
    near = camera.frame(np.array([box(0.65, 0.0, 1.0, 0.0, 0.1, 3.0, 2.0)]), np.zeros(3))
    assert np.isneginf(near[240, 320])
    # nothing but floor, and that beyond 4.5 m in the upper rows
    empty = camera.frame(np.zeros((0, 7)), np.zeros(3))
    assert np.isposinf(empty[0]).all() and np.isfinite(empty[479]).all()
    # a wall along the way, turned out by 5 degrees: columns that look 10-14 degrees left meet it at 81-85 degrees
    # of incidence, those that look 20 degrees left at 75
    graze = camera.frame(np.array([box(3.0, 0.62, 1.25, np.radians(5.0), 6.0, 0.1, 2.5)]), np.zeros(3))
    assert np.isnan(graze[200, 175:213]).all() and np.isfinite(graze[200, 100:110]).all()


def test_two_pixels_on_either_side_of_an_edge_are_invalid():
    camera = DepthCamera(SETTINGS, np.random.default_rng(1))
    boxes = np.array([box(2.0, 0.0, 1.0, 0.0, 0.1, 0.6, 2.0), box(4.0, 0.0, 1.25, 0.0, 0.1, 8.0, 2.5)])
    row = camera.frame(boxes, np.zeros(3))[150]
    truth = camera.truth(boxes, np.zeros(3))[150]
    edges = np.nonzero(np.abs(np.diff(truth)) > 0.5)[0]
    assert len(edges) == 2
    for edge in edges:
        assert np.isnan(row[edge - 1:edge + 3]).all()
        assert np.isfinite(row[edge - 4:edge - 1]).all() and np.isfinite(row[edge + 3:edge + 6]).all()


def test_small_image_is_the_same_view():
    boxes = scenes.build("hallway").boxes
    pose = np.array([-2.0, 0.1, 0.1])
    full = DepthCamera(SETTINGS, np.random.default_rng(1)).truth(boxes, pose)
    small = DepthCamera(SETTINGS, np.random.default_rng(1), (160, 120)).truth(boxes, pose)
    assert small.shape == (120, 160)
    # the centre of a small pixel lies between the four inner ones of its 4 x 4 block
    middle = full.reshape(120, 4, 160, 4)[:, 1:3, :, 1:3]
    spread = np.max(middle, axis=(1, 3)) - np.min(np.where(np.isfinite(middle), middle, -np.inf), axis=(1, 3))
    steady = spread < 0.02
    assert steady.mean() > 0.5
    assert np.abs(middle.mean(axis=(1, 3))[steady] - small[steady]).max() < 0.01


def test_rangers_read_the_distance_to_a_wall_beside():
    # left wall's face at y = 0.6: the sensors sit at y = 0.175, so that they read 0.425; the right side is open
    boxes = np.array([box(0.0, 0.65, 1.25, 0.0, 4.0, 0.1, 2.5)])
    rays = rangers.rays(SETTINGS.wheelchair)
    true = rangers.distances(boxes, rays, 3.0)
    assert true[:3] == pytest.approx(0.425, abs=1e-6)
    # nearer than the floor under the lowest ray of the right cones: 0.40 m / sin(3 deg) = 7.6 m
    assert np.isposinf(true[3:]).all()
    rng = np.random.default_rng(3)
    many = np.array([rangers.measure(true, SETTINGS.wheelchair, 0.01, rng)[0] for _ in range(2000)])
    assert many.std() == pytest.approx(0.00425, rel=0.1)
    limits = rangers.measure(np.array([0.05, 1.6, 0.5, np.inf, 1.0, 1.0]), SETTINGS.wheelchair, 0.0, rng)
    assert np.isneginf(limits[0]) and np.isposinf(limits[1]) and np.isposinf(limits[3]) and limits[2] == 0.5


def test_clearance_is_exact_between_polygons():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    assert outlines.polygon_distance(square, square + [1.5, 0.2]) == pytest.approx(0.5)
    assert outlines.polygon_distance(square, square + [2.0, 2.0]) == pytest.approx(np.sqrt(2.0))
    assert outlines.polygon_distance(square, square + [0.9, 0.9]) == 0.0
    assert outlines.polygon_distance(square, 0.1 * square + 0.4) == 0.0  # one within the other
    # a shelf at 1.4 m and a kerb of 4 cm are out of the height band
    world = make([box(2.0, 0.0, 1.5, 0.0, 1.0, 1.0, 0.2), box(3.0, 0.0, 0.02, 0.0, 1.0, 1.0, 0.04)], ["shelf", "kerb"])
    assert outlines.clearance(outlines.from_world(world), square) == 10.0
