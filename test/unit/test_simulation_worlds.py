"""Worlds: the four scenes, YAML, maps, annotated doors, SDF, meshes; and every way in which a file can be bad."""
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control import parameters, se2
from wheelchair_shared_control.simulation import doors, lintels, maps, outlines, scenes, sensors, starts
from wheelchair_shared_control.simulation import simulator as simulator_module
from wheelchair_shared_control.simulation.simulator import Simulator
from wheelchair_shared_control.simulation.world import SceneError, World, is_free, jambs, opposite

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"
CHAIR = footprints.from_settings(parameters.load("wheelchair"))
needs_shared = pytest.mark.skipif(not SHARED.is_dir(), reason="../shared/data is not on this machine")


# ---- the four scenes -----------------------------------------------------------------------------------


def test_the_four_scenes_have_the_designs_measures():
    shapes = {name: outlines.from_world(scenes.build(name)) for name in scenes.SCENES}
    for name, shape in shapes.items():
        # along the wall through the door plane: the gap of 0.90 m between -0.45 and 0.45
        assert outlines.free_runs(shape, (0.0, 0.0), np.array([0.0, 1.0]), 2.0) == [pytest.approx((-0.45, 0.45))]
        # 2 m beyond: an exit wall's face 0.15 m outside that jamb, or nothing within the reach
        left, right = name in ("left_wall", "hallway"), name in ("right_wall", "hallway")
        runs = [r for r in outlines.free_runs(shape, (2.0, 0.0), np.array([0.0, 1.0]), 2.0) if r[0] < 0.0 < r[1]]
        assert runs == [pytest.approx((-0.60 if right else -2.0, 0.60 if left else 2.0))]
        # the room: 6 m deep before the wall's near face, 5 m wide
        back = outlines.free_runs(shape, (-3.0, 1.0), np.array([1.0, 0.0]), 8.0)
        assert (-3.06, 2.94) == pytest.approx([r for r in back if r[0] < 0.0 < r[1]][0])
        across = outlines.free_runs(shape, (-3.0, 0.0), np.array([0.0, 1.0]), 8.0)
        assert (-2.5, 2.5) == pytest.approx([r for r in across if r[0] < 0.0 < r[1]][0])
    # the exit walls end 4 m beyond the wall
    assert outlines.sees(shapes["hallway"], (4.2, -1.0), (4.2, 1.0))
    assert not outlines.sees(shapes["hallway"], (3.9, 0.0), (3.9, 1.0))


def test_starts_are_within_the_limits_and_fixed_by_the_seed():
    poses = np.array([scenes.setup({"scene": "open"}, seed).start for seed in range(1, 41)])
    assert np.all((-3.0 <= poses[:, 0]) & (poses[:, 0] <= -1.5)) and np.all(np.abs(poses[:, 1]) <= 0.8)
    assert np.all(np.abs(poses[:, 2]) <= np.pi / 4.0)
    # uniform draws fill their ranges
    assert np.ptp(poses[:, 0]) > 1.3 and np.ptp(poses[:, 1]) > 1.4 and np.ptp(poses[:, 2]) > 1.4
    again = scenes.setup({"scene": "hallway", "door_width": 0.75}, 7).start
    assert np.array_equal(again, poses[6])  # the seed alone tells, not the scene
    given = {"start_distance": [2.5, 2.5], "start_heading": [30, 30], "start_offset": [0.5, 0.5]}
    assert scenes.setup(given, 3).start == pytest.approx((-2.5, 0.5, np.radians(30.0)))
    # alongside the wall: side edge 0.1 m from its face (design: issue of awkward starts)
    close = {"start_distance": [0.485, 0.485], "start_heading": [90, 90], "start_offset": [0.3, 0.3]}
    setup = scenes.setup(close, 3)
    assert outlines.clearance(outlines.from_world(setup.world), footprints.corners(CHAIR, setup.start)) \
        == pytest.approx(0.1)


def test_clutter_leaves_the_door_and_the_start_free():
    counts = set()
    for seed in range(1, 26):
        setup = scenes.setup({"scene": "open", "clutter": True}, seed)
        plain = scenes.setup({"scene": "open"}, seed)
        assert np.array_equal(setup.start, plain.start)
        boxes = setup.world.boxes[len(plain.world.boxes):]
        counts.add(len(boxes))
        assert np.all(boxes[:, 4:] >= 0.1) and np.all(boxes[:, 4:] <= 0.3)
        assert len(setup.world.names) == len(setup.world.boxes)
        for corners in outlines.from_boxes(boxes)[:, :4]:
            assert outlines.polygon_distance(corners, footprints.corners(CHAIR, setup.start)) >= 0.4
            passage = np.array([[0.7, 0.45], [-0.7, 0.45], [-0.7, -0.45], [0.7, -0.45]])
            assert outlines.polygon_distance(corners, passage) > 0.0
    assert counts <= {3, 4, 5, 6} and len(counts) >= 3


def test_a_scene_file_adds_boxes_to_a_scene(tmp_path):
    path = tmp_path / "office.yaml"
    path.write_text(yaml.safe_dump({"base": "hallway", "door_width": 0.8, "boxes": [
        {"name": "desk", "x": -2.0, "y": 2.0, "length": 1.0, "width": 0.6, "height": 0.7}]}))
    world = scenes.load(str(path))
    assert world.names[-1] == "desk" and world.doors[0].width == 0.8
    assert world.boxes[-1] == pytest.approx((-2.0, 2.0, 0.35, 0.0, 0.5, 0.3, 0.35))


# ---- maps ----------------------------------------------------------------------------------------------


def write_map(folder, pixels, name="map", **changes):
    """A map of ``pixels`` (rows, columns) 0-255, first row on top; returns the YAML's path."""
    Image.fromarray(np.asarray(pixels, dtype=np.uint8)).save(str(folder / (name + ".png")))
    content = {"image": name + ".png", "resolution": 0.05, "origin": [-1.0, -2.0, 0.0], "negate": 0,
               "occupied_thresh": 0.65, "free_thresh": 0.196}
    content.update(changes)
    (folder / (name + ".yaml")).write_text(yaml.safe_dump(content))
    return str(folder / (name + ".yaml"))


def test_rectangles_cover_the_pixels_exactly():
    cells = np.random.default_rng(4).random((60, 80)) < 0.6
    rectangles = maps.merge(cells)
    covered = np.zeros(cells.shape, dtype=int)
    for left, low, right, high in rectangles:
        covered[low:high, left:right] += 1
    assert np.array_equal(covered, cells.astype(int))
    assert len(maps.merge(np.ones((50, 50), bool))) == 1
    assert len(rectangles) < 0.6 * cells.sum()


def test_a_map_becomes_walls_where_it_is_occupied(tmp_path):
    pixels = np.full((40, 60), 254)
    pixels[0, :] = 0          # top row: y from -2 + 39 * 0.05 = -0.05 to 0
    pixels[30:, 10] = 0       # a column at x = -0.5 .. -0.45, from the bottom up to y = -1.5
    pixels[20, 20] = 205      # unknown
    world = scenes.load(write_map(tmp_path, pixels))
    assert len(world.boxes) == 2
    assert world.boxes[:, 6] == pytest.approx(1.25) and world.boxes[:, 2] == pytest.approx(1.25)
    shape = outlines.from_world(world)
    runs = outlines.free_runs(shape, (-0.475, -1.0), np.array([0.0, 1.0]), 1.5)
    # below the map, between the two walls, above the map
    assert runs == [pytest.approx(run) for run in ((-1.5, -1.0), (-0.5, 0.95), (1.0, 1.5))]
    known = is_free(world.floor, np.array([[0.5, -1.0], [0.025, -1.025], [-0.475, -1.6], [10.0, 0.0]]))
    assert known.tolist() == [True, False, False, False]


@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
@pytest.mark.parametrize("negate", [0, 1])
def test_modes_and_negate(tmp_path, mode, negate):
    # map_server: trinary and scale read darkness (negate: brightness), raw reads 0-100 as it stands
    values = {"wall": 100, "free": 0, "unknown": 50} if mode == "raw" else {"wall": 0, "free": 254, "unknown": 205}
    pixels = np.full((20, 20), values["free"])
    pixels[5, 5], pixels[5, 6] = values["wall"], values["unknown"]
    if negate:
        pixels = 255 - pixels
    world = scenes.load(write_map(tmp_path, pixels, mode=mode, negate=negate))
    assert len(world.boxes) == 1
    # row 5 from the top is row 14 from the bottom
    assert world.boxes[0, :2] == pytest.approx((-1.0 + 5.5 * 0.05, -2.0 + 14.5 * 0.05))
    assert not world.floor.free[14, 6] and world.floor.free.sum() == 398


def test_a_turned_map_turns_its_walls(tmp_path):
    pixels = np.full((20, 20), 254)
    pixels[19, 10:20] = 0  # bottom row, x from 0.5 to 1.0
    world = scenes.load(write_map(tmp_path, pixels, origin=[1.0, 0.0, np.pi / 2.0]))
    # turned by 90 degrees about the corner: the wall stands at x = 1 - 0.025, y from 0.5 to 1
    assert world.boxes[0, :2] == pytest.approx((0.975, 0.75))
    shape = outlines.from_world(world)
    assert not outlines.sees(shape, (0.5, 0.75), (1.5, 0.75)) and outlines.sees(shape, (0.5, 0.25), (1.5, 0.25))
    assert is_free(world.floor, np.array([[0.5, 0.75]]))[0]


def annotated(tmp_path, name, corners, points):
    content = [{"name": name, "door_corner_pt_1": corners[0], "door_corner_pt_2": corners[1],
                "approach": [{"from": "a", "point": points[0]}, {"from": "b", "point": points[1]}]}]
    path = tmp_path / "doors.yaml"
    path.write_text(yaml.safe_dump(content))
    return str(path)


def door_map(tmp_path):
    """8 x 8 m with a wall of 0.10 m at y = 0 and a gap of 0.85 m about x = 0.025."""
    pixels = np.full((160, 160), 254)
    pixels[[0, -1], :] = pixels[:, [0, -1]] = 0
    pixels[79:81, :] = 0        # y from -0.05 to 0.05
    pixels[79:81, 72:89] = 254  # 17 cells: x from -0.40 to 0.45
    return write_map(tmp_path, pixels, origin=[-4.0, -4.0, 0.0])


@pytest.mark.parametrize("reverse", [False, True])
def test_a_real_door_is_measured_from_the_map(tmp_path, reverse):
    world = scenes.load(door_map(tmp_path))
    corners = [[-0.7, 0.1], [0.8, 0.1]]  # clicked past the jambs and 0.10 m off the wall
    path = annotated(tmp_path, "d", corners[::-1] if reverse else corners, [[0.0, -1.0, -1.5], [0.1, 1.1, 1.4]])
    door = doors.measure(world, doors.read(path)["d"], 0)
    assert door.width == pytest.approx(0.85, abs=1e-6)
    assert door.pose[:2] == pytest.approx((0.025, 0.0), abs=0.003)
    assert np.cos(door.pose[2] - np.pi / 2.0) == pytest.approx(1.0)  # away from the side below
    other = doors.measure(world, doors.read(path)["d"], 1)
    assert np.cos(other.pose[2] + np.pi / 2.0) == pytest.approx(1.0)
    assert other.width == door.width and other.pose[:2] == pytest.approx(door.pose[:2])
    left, right = jambs(door)
    assert left == pytest.approx((-0.40, 0.0), abs=0.003) and right == pytest.approx((0.45, 0.0), abs=0.003)
    assert opposite(door).pose == pytest.approx(other.pose)


def test_a_door_across_the_grid_is_measured_along_its_line(tmp_path):
    # the same wall turned by 30 degrees by the map's origin: nothing may depend on the axes
    world = scenes.load(door_map(tmp_path))
    turn = np.array([0.0, 0.0, np.radians(30.0)])
    turned = world._replace(boxes=np.column_stack((se2.transform_points(turn, world.boxes[:, :2]), world.boxes[:, 2],
                                                   world.boxes[:, 3] + turn[2], world.boxes[:, 4:])))
    corners = se2.transform_points(turn, np.array([[-0.7, 0.05], [0.8, 0.05]])).tolist()
    points = se2.transform_points(turn, np.array([[0.0, -1.0], [0.1, 1.1]])).tolist()
    door = doors.measure(turned, doors.read(annotated(tmp_path, "d", corners, points))["d"], 0)
    assert door.width == pytest.approx(0.85, abs=1e-3)
    assert se2.transform_points(se2.inverse(turn), door.pose[None, :2])[0] == pytest.approx((0.025, 0.0), abs=0.004)
    assert np.degrees(door.pose[2]) == pytest.approx(120.0, abs=0.1)


def test_real_starts_obey_the_rule(tmp_path):
    world = scenes.load(door_map(tmp_path))
    path = annotated(tmp_path, "d", [[-0.7, 0.0], [0.8, 0.0]], [[0.0, -1.0], [0.0, 1.0]])
    shape = outlines.from_world(world)
    for side in (0, 1):
        door = doors.measure(world, doors.read(path)["d"], side)
        for seed in range(8):
            pose = starts.draw_real_start(world, door, scenes.stream(seed, 1))
            away = np.array(door.pose[:2]) - pose[:2]
            assert 1.3 <= np.hypot(*away) <= 2.8
            assert (pose[1] < 0.0) == (side == 0)
            assert abs(se2.wrap_angle(np.arctan2(away[1], away[0]) - pose[2])) <= np.pi / 4.0 + 1e-9
            assert outlines.clearance(shape, footprints.corners(CHAIR, pose)) >= 0.10
            assert outlines.sees(shape, pose[:2], door.pose[:2])
    # a start is drawn nowhere when all the floor is unknown
    blind = world._replace(floor=world.floor._replace(free=np.zeros_like(world.floor.free)))
    assert starts.draw_real_start(blind, door, scenes.stream(1, 1)) is None


@needs_shared
def test_the_real_floor_has_the_stated_doors():
    # shared/data/README.md: nine doors of 0.80 m or more (0.84-1.44), five of 0.74-0.79; it counts cells between
    # samples 1 cm apart, so that a run of n cells of 5 cm reads 1 cm less than its length here
    world = scenes.load(str(SHARED / "gdc_floor1" / "1.yaml"))
    annotations = doors.read(str(SHARED / "gdc_floor1" / "doors.yaml"))
    widths = {name: doors.measure(world, entry, 0).width - 0.01 for name, entry in annotations.items()}
    wide = sorted(width for width in widths.values() if width >= 0.80)
    narrow = sorted(width for width in widths.values() if width < 0.80)
    assert len(wide) == 9 and (wide[0], wide[-1]) == pytest.approx((0.84, 1.44), abs=0.005)
    assert len(narrow) == 5 and (narrow[0], narrow[-1]) == pytest.approx((0.74, 0.79), abs=0.005)
    seven = {"d1_728", "d1_elev_east", "d1_402", "d1_412", "d1_406", "d1_210a", "d1_210b"}
    assert seven == {name for name, width in widths.items() if 0.835 <= width <= 1.015}


@needs_shared
def test_every_real_door_has_starts_on_both_sides():
    data = SHARED / "gdc_floor1"
    for name, side in (("d1_402", 0), ("d1_402", 1), ("d1_728", 0), ("d1_210a", 1)):
        given = {"map": str(data / "1.yaml"), "doors": str(data / "doors.yaml"), "door": name, "side": side}
        setup = scenes.setup(given, 3)
        assert setup.start is not None and setup.door.name == name


# ---- SDF and meshes ------------------------------------------------------------------------------------

SDF = """<?xml version="1.0"?><sdf version="1.6"><model name="flat"><pose>1 0 0 0 0 1.5707963</pose>
<link name="wall"><pose>0 2 1.25 0 0 0</pose>
<collision name="left"><pose>-1.45 0 0 0 0 0</pose><geometry><box><size>2 0.15 2.5</size></box></geometry></collision>
<collision name="right"><pose>1.45 0 0 0 0 0</pose><geometry><box><size>2 0.15 2.5</size></box></geometry></collision>
<collision name="lintel"><pose>0 0 1 0 0 0</pose><geometry><box><size>0.9 0.15 0.5</size></box></geometry></collision>
<visual name="v"><geometry><box><size>9 9 9</size></box></geometry></visual></link>
<link name="ramp"><collision name="c"><pose>0 -2 0.5 0 0.5 0</pose><geometry><box><size>1 1 0.1</size></box></geometry>
</collision></link>
<link name="gone"><collision name="c"><geometry><mesh><uri>model://nowhere/a.dae</uri></mesh></geometry></collision></link>
</model></sdf>"""


def test_sdf_poses_are_nested_and_its_door_is_found_by_the_lintel(tmp_path):
    path = tmp_path / "flat.sdf"
    path.write_text(SDF)
    world = scenes.load(str(path))
    assert len(world.boxes) == 3 and len(world.meshes) == 1 and len(world.left_out) == 1
    # model turned by 90 degrees about (1, 0): the link at (0, 2) stands at (-1, 0), the wall runs along y
    lintel = world.boxes[list(world.names).index("wall/lintel")]
    assert lintel == pytest.approx((-1.0, 0.0, 2.25, np.pi / 2.0, 0.45, 0.075, 0.25), abs=1e-6)
    found, gaps = lintels.find(world)
    assert len(found) == 1 and not gaps
    assert found[0].pose == pytest.approx((-1.0, 0.0, 0.0), abs=1e-6) and found[0].width == pytest.approx(0.9, abs=1e-6)
    # the doors file that is written is read back as the same door
    out = tmp_path / "doors.yaml"
    out.write_text(yaml.safe_dump(doors.describe(found)))
    again = doors.measure(world, doors.read(str(out))["door_1"], 0)
    assert again.width == pytest.approx(0.9, abs=1e-3) and again.pose == pytest.approx(found[0].pose, abs=1e-3)


@needs_shared
def test_the_turtlebot3_house_has_its_doors():
    world = scenes.load(str(SHARED / "turtlebot3_house" / "model.sdf"))
    found, gaps = lintels.find(world)
    assert len(found) == 4 and all(door.width == pytest.approx(0.90, abs=0.01) for door in found)
    assert all(door.height == pytest.approx(2.0) for door in found)


def test_a_mesh_is_touched_and_seen_like_the_boxes_it_was_made_of(tmp_path):
    open3d = pytest.importorskip("open3d")
    world = scenes.build("hallway")
    mesh = open3d.geometry.TriangleMesh()
    for row in world.boxes:
        mesh += open3d.geometry.TriangleMesh.create_box(*(2.0 * row[4:])).translate(row[:3] - row[4:])
    settings = parameters.load("simulator")
    runs = []
    for name in ("boxes", "room.obj", "room.stl"):
        if name != "boxes":
            mesh.compute_triangle_normals()
            open3d.io.write_triangle_mesh(str(tmp_path / name), mesh, write_vertex_normals=False)
            world = scenes.load(str(tmp_path / name))
        with Simulator(world, settings, 1, (-1.2, 1.2, 0.0), camera=(160, 120)) as simulator:
            image, readings, clearance = simulator.depth().image, simulator.ranges().values, simulator.clearance()
            for _ in range(100):
                simulator.command(0.5, 0.0)
                simulator.advance(0.02)
            runs.append((image, readings, clearance, simulator.truth().pose[0], bool(simulator.touches)))
    for image, readings, clearance, x, touched in runs[1:]:
        both = np.isfinite(image) & np.isfinite(runs[0][0])
        assert both.mean() > 0.5 and np.abs(image[both] - runs[0][0][both]).max() < 0.06
        assert np.mean(np.isnan(image) == np.isnan(runs[0][0])) > 0.99
        assert readings == pytest.approx(runs[0][1], abs=1e-3) and clearance == pytest.approx(runs[0][2], abs=1e-6)
        assert x == pytest.approx(runs[0][3], abs=0.005) and touched and runs[0][4]


def test_meshes_are_drawn_as_the_ray_caster_sees_them(monkeypatch):
    open3d = pytest.importorskip("open3d")
    mesh = open3d.geometry.TriangleMesh()
    for k in range(6):
        centre = (-0.5 + 0.4 * k, -1.0 + 0.4 * k, 0.4 + 0.2 * k)
        mesh += open3d.geometry.TriangleMesh.create_sphere(0.25, 8).translate(centre)
    mesh += open3d.geometry.TriangleMesh.create_box(0.1, 6.0, 2.5).translate((2.5, -3.0, 0.0))  # behind them
    solid = (np.asarray(mesh.vertices), np.asarray(mesh.triangles))
    world = scenes.build("open")._replace(meshes=(solid,), names=scenes.build("open").names + ("solid",))
    images = []
    for limit in (10 ** 9, 0):
        monkeypatch.setattr(sensors, "DRAWN", limit)
        with Simulator(world, parameters.load("simulator"), 1, (-2.0, 0.0, 0.0), camera=(320, 240)) as simulator:
            images.append(simulator._depth_camera.truth(world.boxes, simulator.chair.pose))
    near = np.isfinite(images[1]) & (images[1] < 4.5)
    assert near.mean() > 0.5
    # but for single pixels on the spheres' outlines
    assert np.mean(np.abs(images[0][near] - images[1][near]) < 0.005) > 0.999


def test_a_mesh_too_large_for_pybullet_is_given_in_pieces(monkeypatch):
    steps = np.arange(-1.0, 1.0, 0.1)
    quads = [[(1.5, y, z), (1.5, y + 0.1, z), (1.5, y + 0.1, z + 0.1), (1.5, y, z + 0.1)]
             for y in steps for z in np.arange(0.0, 1.2, 0.1)]
    vertices = np.array(quads).reshape(-1, 3)
    triangles = np.array([(4 * i, 4 * i + 1, 4 * i + 2) for i in range(len(quads))]
                         + [(4 * i, 4 * i + 2, 4 * i + 3) for i in range(len(quads))])
    world = World(boxes=np.zeros((0, 7)), meshes=((vertices, triangles),), names=("curtain",))
    monkeypatch.setattr(simulator_module, "MESH_PIECE", 50)
    with Simulator(world, parameters.load("simulator"), 1, (0.0, 0.0, 0.0), camera=(160, 120)) as simulator:
        assert len(simulator._names) == -(-len(triangles) // 50)
        assert simulator.clearance() == pytest.approx(0.8)
        for _ in range(150):
            simulator.command(0.5, 0.0)
            simulator.advance(0.02)
        assert [touch.name for touch in simulator.touches[:1]] == ["curtain"]
        assert simulator.truth().pose[0] == pytest.approx(0.8, abs=0.01)


# ---- bad input -----------------------------------------------------------------------------------------


def bad_cases(tmp_path):
    good = np.full((4, 4), 254)
    (tmp_path / "noimage.png").write_bytes(b"not a picture")
    (tmp_path / "broken.obj").write_text("hello")
    (tmp_path / "broken.stl").write_text("hello")
    (tmp_path / "broken.dae").write_text("<x")
    (tmp_path / "broken.sdf").write_text("<sdf><model>")
    (tmp_path / "other.sdf").write_text("<html></html>")
    (tmp_path / "size.sdf").write_text(SDF.replace("2 0.15 2.5", "2 -0.15 2.5"))
    (tmp_path / "pose.sdf").write_text(SDF.replace("0 2 1.25 0 0 0", "0 2 1.25 0 zero 0"))
    (tmp_path / "scene.yaml").write_text("boxes: [{x: 1, y: 2, length: 0, width: 1, height: 1}]")
    (tmp_path / "key.yaml").write_text("boxen: []")
    (tmp_path / "list.yaml").write_text("- 1")
    yield "kitchen", "unknown scene 'kitchen', must be one of open"
    yield str(tmp_path / "nowhere.yaml"), "no such file"
    yield write_map(tmp_path, good, "a", image="gone.png"), "gone.png: no such file"
    yield write_map(tmp_path, good, "b", image="noimage.png"), "noimage.png cannot be read"
    yield write_map(tmp_path, good, "c", resolution=0), "'resolution' is 0, but must be"
    yield write_map(tmp_path, good, "d", origin=[0.0, 0.0]), "'origin'"
    yield write_map(tmp_path, good, "e", occupied_thresh=1.5), "'occupied_thresh' is 1.5"
    yield write_map(tmp_path, good, "f", free_thresh=0.7), "must be at most 'occupied_thresh'"
    yield write_map(tmp_path, good, "g", negate=2), "'negate' is 2"
    yield write_map(tmp_path, good, "h", mode="grey"), "'mode' is 'grey', but must be one of"
    yield write_map(tmp_path, good, "i", resolution=float("nan")), "'resolution'"
    for name in ("broken.obj", "broken.stl", "broken.dae"):
        yield str(tmp_path / name), "cannot be read as a mesh"
    yield str(tmp_path / "broken.sdf"), "is no SDF"
    yield str(tmp_path / "other.sdf"), "its root is 'html'"
    yield str(tmp_path / "size.sdf"), "but must be more than 0"
    yield str(tmp_path / "pose.sdf"), "must be 6 finite numbers"
    yield str(tmp_path / "scene.yaml"), "but must be more than 0"
    yield str(tmp_path / "key.yaml"), "unknown key 'boxen'"
    yield str(tmp_path / "list.yaml"), "list.yaml"


def test_bad_files_are_refused_in_one_line_that_names_the_culprit(tmp_path):
    for source, expected in bad_cases(tmp_path):
        with pytest.raises(SceneError) as caught:
            scenes.load(source)
        message = str(caught.value)
        assert expected in message and "\n" not in message, (source, message)
        assert Path(source).name in message, (source, message)


@pytest.mark.parametrize("change, expected", [
    ({"door": "front"}, "no door 'front', must be one of d"),
    ({"side": 2}, "'side' is 2, but must be at most 1"),
])
def test_a_door_that_is_not_there_is_refused(tmp_path, change, expected):
    path = annotated(tmp_path, "d", [[-0.7, 0.0], [0.8, 0.0]], [[0.0, -1.0], [0.0, 1.0]])
    with pytest.raises(Exception, match=re.escape(expected)):
        scenes.setup(dict({"map": door_map(tmp_path), "doors": path}, **change), 1)


@pytest.mark.parametrize("change, expected", [
    ("name: x", "holds no list"), ("- {door_corner_pt_1: [0, 0]}", "key 'name' is missing"),
    ("- {name: d, door_corner_pt_1: [0, 0], door_corner_pt_2: [0, 0.01]}", "0.01 m apart"),
    ("- {name: d, door_corner_pt_1: [0, 0], door_corner_pt_2: [1, .nan]}", "'door_corner_pt_2'"),
    ("- {name: d, door_corner_pt_1: [0, 0], door_corner_pt_2: [1, 0]}", "'approach' must be a list of two"),
    ("- {name: d, door_corner_pt_1: [0, 0], door_corner_pt_2: [1, 0], approach: [{point: [0, 1]}, {point: [0, 2]}]}",
     "stand on one side"), ("[", "is no YAML"),
])
def test_bad_doors_files_are_refused(tmp_path, change, expected):
    path = tmp_path / "bad.yaml"
    path.write_text(change)
    with pytest.raises(SceneError, match="bad.yaml.*" + re.escape(expected)):
        doors.read(str(path))


def test_a_scene_s_measures_belong_to_its_base(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text("door_width: 0.8\nboxes: [{x: 0, y: 2, length: 1, width: 1, height: 1}]\n", encoding="utf-8")
    with pytest.raises(SceneError, match="own.yaml: 'door_width' belongs to a 'base'"):
        scenes.load(str(path))


def test_a_start_inside_a_wall_is_refused():
    with pytest.raises(SceneError, match="'start_pose' is .*the chair would stand in something"):
        scenes.setup({"start_pose": [-0.5, 2.0, 0.0]}, 1)
    assert scenes.setup({"start_pose": [-2.0, 0.5, 0.1]}, 1).start == pytest.approx((-2.0, 0.5, 0.1))


def test_a_map_without_doors_is_started_somewhere_free(tmp_path):
    pixels = np.full((100, 100), 205)
    pixels[40:90, 40:90] = 254  # 2.5 x 2.5 m of free floor, all else is unknown
    setup = scenes.setup({"map": write_map(tmp_path, pixels)}, 2)
    assert setup.door is None
    # row 89 from the top ends at 10 * 0.05 = 0.5 m above the origin
    corners = footprints.corners(CHAIR, setup.start)
    assert np.all(corners >= (1.1, -1.4)) and np.all(corners <= (3.4, 0.9))  # free by 0.10 m
    nothing = scenes.setup({"map": write_map(tmp_path, np.full((50, 50), 205), "unknown")}, 2)
    assert nothing.start is None


def test_out_of_range_measures_are_refused():
    with pytest.raises(parameters.ParameterError, match="'door_width' is 9.0, but must be at most 2 m"):
        scenes.setup({"door_width": 9.0}, 1)
    with pytest.raises(SceneError, match="'start_distance'"):
        scenes.setup({"start_distance": [3.0, 1.0]}, 1)
    with pytest.raises(parameters.ParameterError, match="unknown parameter 'doorwidth'"):
        scenes.setup({"doorwidth": 0.9}, 1)
