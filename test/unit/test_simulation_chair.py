"""The chair's URDF agrees with config/wheelchair.yaml; the person walks by the rule; time keeps its pace."""
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control import parameters, se2
from wheelchair_shared_control.simulation import outlines, person, rangers, scenes, surfaces
from wheelchair_shared_control.simulation.pace import Due, Pace
from wheelchair_shared_control.simulation.simulator import Simulator
from wheelchair_shared_control.simulation.wheelchair import URDF, read_body
from wheelchair_shared_control.simulation.world import SceneError
from wheelchair_shared_control.values import RANGERS

CHAIR = parameters.load("wheelchair")
ROBOT = ElementTree.parse(str(parameters.package_file(URDF))).getroot()


def numbers(text):
    return np.array([float(word) for word in text.split()])


def transform(joint):
    """Parent from child (4, 4) of a joint at rest."""
    origin = ROBOT.find("joint[@name='%s']/origin" % joint)
    r, p, y = numbers(origin.get("rpy", "0 0 0"))
    result = np.eye(4)
    turns = []
    for axis, angle in ((2, y), (1, p), (0, r)):
        c, s = np.cos(angle), np.sin(angle)
        i, j = [k for k in range(3) if k != axis]
        turn = np.eye(3)
        sign = -1.0 if axis == 1 else 1.0
        turn[i, i], turn[i, j], turn[j, i], turn[j, j] = c, -sign * s, sign * s, c
        turns.append(turn)
    result[:3, :3] = turns[0] @ turns[1] @ turns[2]
    result[:3, 3] = numbers(origin.get("xyz", "0 0 0"))
    return result


def test_the_urdfs_outline_is_the_footprint():
    collision = ROBOT.find("link[@name='chassis']/collision")
    size = numbers(collision.find("geometry/box").get("size"))
    centre = numbers(collision.find("origin").get("xyz"))
    footprint = footprints.from_settings(CHAIR)
    assert size == pytest.approx((footprint.length, footprint.width, outlines.HIGH - outlines.LOW))
    middle = (footprint.front + footprint.rear) / 2.0
    assert centre == pytest.approx((middle, 0.0, (outlines.HIGH + outlines.LOW) / 2.0))


def test_the_urdfs_sensors_sit_where_the_parameters_say():
    base_from_optical = transform("camera_joint") @ transform("camera_depth_optical_joint")
    assert base_from_optical == pytest.approx(cameras.mounting(CHAIR), abs=1e-6)
    for name, (x, y, z, yaw) in zip(RANGERS, rangers.mounting(CHAIR)):
        frame = transform("ir_%s_joint" % name)
        assert frame[:3, 3] == pytest.approx((x, y, z))
        assert frame[:3, 0] == pytest.approx((np.cos(yaw), np.sin(yaw), 0.0), abs=1e-9)  # x along the beam


def test_everything_that_is_seen_of_the_chair_lies_within_its_outline():
    body = read_body()
    footprint = footprints.from_settings(CHAIR)
    assert body.track / 2.0 + 0.03 < footprint.half_width
    assert body.castor_x + body.castor_radius < footprint.front
    for name in ("camera_joint",) + tuple("ir_%s_joint" % name for name in RANGERS):
        x, y, _ = transform(name)[:3, 3]
        assert footprint.rear < x < footprint.front and abs(y) < footprint.half_width


def test_a_broken_urdf_is_refused(tmp_path):
    path = tmp_path / "chair.urdf"
    path.write_text("<robot name='x'><link name='chassis'/></robot>")
    with pytest.raises(SceneError, match="chair.urdf: the inertial of link 'chassis' is missing"):
        read_body(str(path))
    with pytest.raises(SceneError, match="nowhere.urdf"):
        read_body(str(tmp_path / "nowhere.urdf"))


# ---- the person ----------------------------------------------------------------------------------------


def walkers(seeds):
    for seed in seeds:
        setup = scenes.setup({"scene": "open"}, seed)
        way = person.nominal_trajectory(setup.start, setup.door)
        rng = scenes.stream(seed, scenes.PERSON_STREAM)
        yield setup, way, person.draw(way, setup.world, CHAIR, rng)


def test_the_person_is_drawn_by_the_rule():
    footprint = footprints.from_settings(CHAIR)
    left, right = CHAIR.camera.cx / CHAIR.camera.fx, (CHAIR.camera.width - 1 - CHAIR.camera.cx) / CHAIR.camera.fx
    for _, way, walker in walkers(range(1, 8)):
        assert walker is not None
        speed = np.hypot(*walker.velocity)
        assert 0.3 <= speed <= 0.6 and walker.box(0.0)[4:6] == pytest.approx(0.2)
        at = [np.interp(walker.conflict, way[:, 0], column) for column in way[:, 1:].T]
        angle = abs(se2.wrap_angle(np.arctan2(walker.velocity[1], walker.velocity[0]) - at[2]))
        assert np.radians(44.0) <= angle <= np.radians(136.0)
        # undisturbed they would meet at the conflict, and not before
        shape = outlines.from_boxes(walker.box(walker.conflict)[None])[0, :4]
        assert outlines.polygon_distance(shape, footprints.corners(footprint, at)) < 0.02
        for time in np.arange(walker.conflict - 2.0, walker.conflict, 0.25):
            pose = np.array([np.interp(time, way[:, 0], column) for column in way[:, 1:].T])
            eye = se2.compose(pose, np.array([CHAIR.camera.x, 0.0, 0.0]))
            corners = se2.transform_points(se2.inverse(eye), outlines.from_boxes(walker.box(time)[None])[0, :4])
            if corners[:, 0].min() < person.LENS_HOLDS:
                corners = corners.mean(axis=0, keepdims=True)  # too near to be seen whole, not beside the view
            assert np.all(corners[:, 1] <= left * corners[:, 0] + 0.02)
            assert np.all(-corners[:, 1] <= right * corners[:, 0] + 0.02)


def test_the_person_is_seen_and_touched():
    # the person walks along x = 1.4 m, near face at 1.2 m, and is at y = -1 + 0.5 t; the chair's front, 0.7 m ahead,
    # meets them after about 0.5 m / 0.3 m/s + 0.25 s = 1.9 s, when they are before its middle
    walker = person.Person(np.array([1.4, -1.0]), np.array([0.0, 0.5]), 0.0, 10.0, 1.9)
    settings = parameters.load("simulator")
    images, world = [], scenes.build("open")
    for who in (walker, None):
        with Simulator(world, settings, 1, (0.0, 0.0, 0.0), camera=(160, 120), person=who) as simulator:
            simulator.advance(1.5)
            images.append(simulator.depth().image)
    both = np.isfinite(images[0]) & np.isfinite(images[1])
    assert np.sum(images[1][both] - images[0][both] > 0.1) > 50
    with Simulator(world, settings, 1, (0.0, 0.0, 0.0), camera=(160, 120), person=walker) as simulator:
        while simulator.time < 3.0 and not simulator.contacts():
            simulator.command(0.3, 0.0)
            simulator.advance(0.02)
        assert [name for name, _ in simulator.contacts()] == ["person"]
        assert simulator.clearance() < 0.001
        touch = simulator.touches[0]
        assert touch.time == pytest.approx(1.92, abs=0.05) and touch.v == pytest.approx(0.3, abs=0.01)
        assert touch.place[0] == pytest.approx(0.7, abs=0.01) and abs(touch.place[1]) < 0.3


def test_the_worlds_faces_look_outward_and_are_shaded_by_heading():
    rows = np.array([[1.0, 2.0, 1.0, 0.5, 0.3, 0.2, 1.0]])
    triangles = surfaces.of_boxes(rows)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert np.all(np.einsum("ij,ij->i", normals, triangles.mean(axis=1) - rows[0, :3]) > 0.0)
    assert len(triangles) == 10  # four sides and the top
    shades = surfaces.shades(triangles, (1.0, 0.5, 0.2))
    assert np.all((shades >= 0.0) & (shades <= (1.0, 0.5, 0.2))) and len(np.unique(shades[:, 0].round(3))) == 3


# ---- pace ----------------------------------------------------------------------------------------------


def test_simulated_time_follows_the_wall():
    pace = Pace(1.0)
    assert pace.wait(100.0, 0.0) == 0.0
    assert pace.wait(100.002, 0.010) == pytest.approx(0.008)
    assert pace.wait(100.2, 0.020) == 0.0      # 0.18 s late: caught up without sleeping
    assert pace.wait(100.2, 0.250) == pytest.approx(0.05)
    assert pace.wait(101.0, 0.260) == 0.0      # 0.74 s late: more than 0.25 s is not caught up
    assert pace.dropped == pytest.approx(0.74)
    assert pace.wait(101.0, 0.270) == pytest.approx(0.01)
    assert Pace(2.0).wait(0.0, 0.0) == 0.0
    fast = Pace(2.0)
    fast.wait(0.0, 0.0)
    assert fast.wait(0.0, 1.0) == pytest.approx(0.5)


def test_what_is_due_keeps_its_rate():
    due = Due(30.0)
    moments = [time for time in np.arange(0.0, 10.0, 0.01) if due.at(time)]
    assert len(moments) == 300
    assert np.diff(moments).max() < 0.0401
    # after a pause it does not fire again and again
    assert due.at(50.0) and not due.at(50.005) and due.at(50.04)
