"""Doorways in depth images of walls whose places a reader can add up."""
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control import doorway, doorway_figure, doorway_files, doorway_frames, parameters
from wheelchair_shared_control.simulation import zbuffer

WHEELCHAIR = parameters.load("wheelchair")
SETTINGS = parameters.load("doorway_detector")
CAMERA = cameras.from_settings(WHEELCHAIR)
MOUNTING = cameras.mounting(WHEELCHAIR)
DATA = Path(__file__).resolve().parents[3] / "shared" / "data"

# The wall's middle lies 2.5 m ahead of base_link, 0.12 m thick. From y = 0.55 to the left and from y = -0.35 to the
# right it is shut, so the gap is 0.90 m wide and its middle is at y = 0.10.
LEFT = [2.5, 2.55, 1.25, 0.0, 0.06, 2.0, 1.25]
RIGHT = [2.5, -2.35, 1.25, 0.0, 0.06, 2.0, 1.25]


def look(*boxes):
    """Depth image without noise of ``boxes``, nothing beyond 4.5 m."""
    depth = zbuffer.render_boxes(np.array(boxes, dtype=float).reshape(-1, 7), CAMERA, MOUNTING)
    return np.where(depth <= 4.5, depth, np.inf).astype(np.float32)


def detect(image, seed=0):
    return doorway.detect_depth(image, CAMERA, MOUNTING, SETTINGS, seed)


def test_a_gap_between_two_walls_is_a_doorway_in_the_middle_of_the_wall():
    found = detect(look(LEFT, RIGHT))
    assert found.reason == ""
    (door,) = found.doorways
    assert door.pose[:2] == pytest.approx((2.5, 0.10), abs=0.02)
    assert door.pose[2] == pytest.approx(0.0, abs=np.radians(1.0))  # away from the sensor: along +x
    assert door.width == pytest.approx(0.90, abs=0.01)
    assert 0.5 < door.confidence <= 1.0
    assert door.jambs[0] == pytest.approx((2.5, 0.55), abs=0.02)  # left first
    assert door.jambs[1] == pytest.approx((2.5, -0.35), abs=0.02)
    assert np.linalg.eigvalsh(door.covariance).min() > 0.0


@pytest.mark.parametrize("width", [0.71, 1.25])
def test_the_narrowest_and_the_widest_doors_pass_with_measurement_error(width):
    half = width / 2.0
    left = [2.5, half + 2.0, 1.25, 0.0, 0.06, 2.0, 1.25]
    right = [2.5, -half - 2.0, 1.25, 0.0, 0.06, 2.0, 1.25]
    (door,) = detect(look(left, right)).doorways
    assert door.width == pytest.approx(width, abs=0.01)


def test_jambs_that_stand_staggered_are_measured_along_one_line():
    # a partition 0.25 m behind the right jamb reaches 0.20 m farther into the way: sideways between it and the left
    # jamb lie 0.55 + 0.15 = 0.70 m, but no line across the way is shorter than the 0.90 m in the wall
    partition = [2.75, -0.55, 1.25, 0.0, 0.03, 0.40, 1.25]
    (door,) = detect(look(LEFT, RIGHT, partition)).doorways
    assert door.width == pytest.approx(0.90, abs=0.02)
    assert door.pose[:2] == pytest.approx((2.5, 0.10), abs=0.03)


def test_a_short_piece_of_wall_tells_a_doorway_beside_longer_walls_of_another_direction():
    # 0.30 m of wall from y = 0.55 on; the right jamb ends a wall that stands at 66 degrees, and so does a longer one
    # far behind: across their direction nothing is narrow, the gap is 0.55 + 0.30 m wide
    turn = np.radians(66.0)
    along, across = np.array([np.cos(turn), np.sin(turn)]), np.array([np.sin(turn), -np.cos(turn)])
    x, y = np.array([2.25, -0.30]) - 0.7 * along + 0.05 * across
    image = look([2.25, 0.70, 1.25, 0.0, 0.05, 0.15, 1.25], [x, y, 1.25, turn, 0.7, 0.05, 1.25],
                 [4.0, 0.2, 1.25, turn, 1.2, 0.05, 1.25])
    (door,) = detect(image).doorways
    assert door.width == pytest.approx(0.85, abs=0.03)
    assert door.pose[2] == pytest.approx(0.0, abs=np.radians(3.0))


SHUT = {
    "a closed leaf": [2.5, 0.10, 1.0, 0.0, 0.02, 0.45, 1.0],
    # 30 degrees from shut, hinged at the left jamb (2.5, 0.55): its middle is 0.45 m along it
    "a half-closed leaf": [2.5 + 0.45 * 0.5, 0.55 - 0.45 * 0.866, 1.0, np.radians(-60.0), 0.45, 0.02, 1.0],
    "a window with its sill at 0.8 m": [2.5, 0.10, 0.4, 0.0, 0.06, 0.45, 0.4],
    "another wall 0.4 m behind": [2.96, 0.10, 1.25, 0.0, 0.06, 3.0, 1.25],
}


@pytest.mark.parametrize("what", sorted(SHUT))
def test_a_gap_is_no_doorway_with(what):
    found = detect(look(LEFT, RIGHT, SHUT[what]))
    assert found.doorways == ()
    assert found.reason


def test_the_space_beside_the_end_of_a_wall_is_no_doorway():
    found = detect(look(LEFT))
    assert found.doorways == ()
    assert "one jamb only" in found.reason


def test_a_gap_between_low_cupboards_is_no_doorway():
    # 1.1 m high: the camera, at 1.10 m, sees over them
    cupboards = [[2.5, side * 1.05 + 0.1, 0.55, 0.0, 0.25, 0.6, 0.55] for side in (1.0, -1.0)]
    assert detect(look(*cupboards)).doorways == ()


def test_a_box_on_the_floor_before_the_wall_hides_no_doorway():
    box = [1.9, 0.75, 0.2, 0.3, 0.15, 0.15, 0.2]
    assert len(detect(look(LEFT, RIGHT, box)).doorways) == 1


def test_equal_input_gives_equal_doorways():
    image = look(LEFT, RIGHT)
    first, second = detect(image, seed=3), detect(image, seed=3)
    assert np.array_equal(first.doorways[0].pose, second.doorways[0].pose)
    assert first.doorways[0].width == second.doorways[0].width


def test_a_camera_that_leans_more_than_it_was_mounted_finds_the_floor():
    # tf says 15 degrees down, the camera looks 17 degrees down: the floor tells
    camera = WHEELCHAIR.camera
    leaning = cameras.base_from_camera(camera.x, camera.z, camera.pitch + np.radians(2))
    depth = zbuffer.render_boxes(np.array([LEFT, RIGHT]), CAMERA, leaning)
    found = detect(np.where(depth <= 4.5, depth, np.inf).astype(np.float32))
    assert found.ground.found
    (door,) = found.doorways
    # the floor's normal rights the camera about base_link, whose place above the floor then is a little off
    assert door.pose[:2] == pytest.approx((2.5, 0.10), abs=0.06)
    assert door.width == pytest.approx(0.90, abs=0.02)


@pytest.mark.parametrize("fill", [np.nan, 0.0, -np.inf, np.inf])
def test_an_image_without_depths_gives_a_reason(fill):
    found = detect(np.full((480, 640), fill, np.float32))
    assert found.doorways == () and "valid" in found.reason


def test_an_image_of_another_size_than_the_camera_gives_a_reason():
    assert "640 x 480" in detect(np.ones((10, 20), np.float32)).reason


@pytest.mark.parametrize("points", [np.empty((0, 3)), np.zeros((1, 3)), np.full((500, 3), np.nan), np.ones((5, 2))])
def test_a_cloud_that_is_none_gives_a_reason(points):
    found = doorway.detect_points(points, SETTINGS)
    assert found.doorways == () and found.reason


@pytest.mark.parametrize("tilt_deg", [0.0, 12.0])
def test_a_cloud_in_the_optical_frame_is_righted_by_its_floor(tilt_deg):
    points = cameras.back_project(CAMERA, look(LEFT, RIGHT)).reshape(-1, 3)[::4]
    points = points[np.isfinite(points).all(axis=1)]
    angle = np.radians(tilt_deg)
    roll = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    result = doorway_frames.detect(doorway_files.Frame(points=points @ roll.T), SETTINGS)
    assert result.up == "-y"
    (door,) = result.detection.doorways
    # the camera stands 0.25 m ahead of base_link, so the door is 2.25 m ahead of it
    assert np.hypot(*door.pose[:2]) == pytest.approx(np.hypot(2.25, 0.10), abs=0.03)
    assert door.width == pytest.approx(0.90, abs=0.03)


# the camera stands 0.25 m ahead of base_link, 1.10 m above the floor; the door's middle is at (2.5, 0.10) of base_link
FRAMES = {
    "a chair's frame, whose origin lies on the floor": ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (2.5, 0.10)),
    "a map far away": ((5e5, 5e6, 100.0), (5e5 + 0.25, 5e6, 101.10), (2.25, 0.10)),
}


@pytest.mark.parametrize("what", sorted(FRAMES))
def test_a_cloud_in(what):
    shift, origin, expected = FRAMES[what]
    points = cameras.back_project(CAMERA, look(LEFT, RIGHT)).reshape(-1, 3)[::4].astype(float)
    points = points[np.isfinite(points).all(axis=1)] @ MOUNTING[:3, :3].T + MOUNTING[:3, 3]
    result = doorway_frames.detect(doorway_files.Frame(points=points + shift, origin=origin), SETTINGS)
    (door,) = result.detection.doorways
    assert door.pose[:2] == pytest.approx(expected, abs=0.03)
    assert door.width == pytest.approx(0.90, abs=0.02)


def test_a_cloud_in_millimetres_is_told_to_be_none_in_metres():
    points = 1000.0 * cameras.back_project(CAMERA, look(LEFT, RIGHT)).reshape(-1, 3)
    detection = doorway_frames.detect(doorway_files.Frame(points=points), SETTINGS).detection
    assert detection.doorways == () and "is the cloud in metres?" in detection.reason


def test_a_figure_of_many_frames_shows_some_of_them(tmp_path, monkeypatch):
    result = doorway_frames.detect(doorway_files.Frame(depth=look(LEFT, RIGHT), camera=CAMERA), SETTINGS)
    # few enough points to keep, more than are drawn
    assert doorway_figure.MAX_POINTS < len(doorway_figure.thinned(result).points) < len(result.points)
    monkeypatch.setattr(doorway_figure, "MAX_PANELS", 2)
    doorway_figure.save(tmp_path / "a.png", [("a", doorway_figure.thinned(result))] * 5)
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (1430, 715)  # two panels of 6.5 inches beside each other, 110 dots an inch


def test_numbers_that_stand_for_nothing_hide_no_doorway():
    # 65.535 m is 16 bits of ones, 1e30 comes out of memory that nobody filled
    image = look(LEFT, RIGHT)
    for number in (65.535, 1e30):
        spoilt = image.copy()
        spoilt[100:110, 100:140] = number
        result = doorway_frames.detect(doorway_files.Frame(depth=spoilt, camera=CAMERA), SETTINGS)
        assert len(result.detection.doorways) == 1
    points = cameras.back_project(CAMERA, image).reshape(-1, 3)
    points = np.concatenate((points[np.isfinite(points).all(axis=1)][::4], [[-1e30] * 3]))
    assert len(doorway_frames.detect(doorway_files.Frame(points=points), SETTINGS).detection.doorways) == 1


@pytest.mark.skipif(not DATA.exists(), reason="the real scans of ../shared/data are not here")
def test_a_real_furnished_room_has_walls_and_no_doorway():
    (frame,) = doorway_files.read(DATA / "room_scan" / "room_scan1.pcd")
    detection = doorway_frames.detect(frame, SETTINGS).detection
    assert len(detection.walls) >= 3
    assert detection.doorways == ()


@pytest.mark.skipif(not DATA.exists(), reason="the real depth images of ../shared/data are not here")
def test_a_real_corridor_has_both_walls_and_no_doorway_within_4_m():
    (frame,) = doorway_files.read(DATA / "corridor_depth" / "SUN_depth.png", doorway_files.Reading(format="sun"))
    detection = doorway_frames.detect(frame, SETTINGS).detection
    # walls along x, on either side of the camera
    sides = [wall.line.normal[1] for wall in detection.walls if abs(wall.line.normal[1]) > 0.95]
    assert min(sides) < 0.0 < max(sides)
    assert all(np.hypot(*d.pose[:2]) > 4.0 for d in detection.doorways)


@pytest.mark.skipif(not DATA.exists(), reason="the real depth images of ../shared/data are not here")
def test_a_real_living_room_has_no_doorway():
    paths = sorted((DATA / "living_room_depth").glob("*.png"))
    assert len(paths) == 5
    for path in paths:
        (frame,) = doorway_files.read(path)
        assert doorway_frames.detect(frame, SETTINGS).detection.doorways == ()


# A corner door: the wall along y ends at y = -0.45, a partition along x has its face at y = 0.45, from the wall's
# plane on. The gap is 0.90 m wide, and no wall goes on beyond the partition in the plane.
CORNER = [[2.5, -2.45, 1.25, 0.0, 0.06, 2.0, 1.25], [3.44, 0.51, 1.25, 0.0, 1.0, 0.06, 1.25]]


def test_a_doorway_between_a_wall_and_a_partition_is_found_along_the_walls_directions():
    (found,) = detect(look(*CORNER)).doorways
    assert found.pose[:2] == pytest.approx((2.5, 0.0), abs=0.10)
    assert found.pose[2] == pytest.approx(0.0, abs=np.radians(5.0))
    assert found.width == pytest.approx(0.90, abs=0.05)


def test_a_corridor_as_wide_as_a_door_is_no_doorway():
    # walls along x at y = 0.5 and y = -0.5, closed 4 m ahead
    sides = [[2.5, side * 0.56, 1.25, 0.0, 2.0, 0.06, 1.25] for side in (1.0, -1.0)]
    assert detect(look([4.2, 0.0, 1.25, 0.0, 0.06, 2.0, 1.25], *sides)).doorways == ()


def test_a_niche_between_a_cupboard_and_a_side_wall_is_no_doorway():
    # the wall at x = 3, a side wall along x at y = 0.9, a cupboard 0.6 m deep that leaves 0.8 m free beside it
    wall, side = [3.06, 0.0, 1.25, 0.0, 0.06, 3.0, 1.25], [1.5, 0.96, 1.25, 0.0, 1.5, 0.06, 1.25]
    assert detect(look(wall, side, [2.7, -0.7, 0.9, 0.0, 0.3, 0.8, 0.9])).doorways == ()
