"""A teacher on the simulated chair, recorded as a bag: the topics of the ROS graph, by plain calls.

The chair, its sensors, the costmap and the features are those of every episode. Equal seeds give equal bags,
byte for byte.
"""
import os
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import camera, footprint, parameters, se2, teachers
from wheelchair_shared_control.bag_writing import BagWriter
from wheelchair_shared_control.bags import BagError
from wheelchair_shared_control.costmap import Costmap, to_grid
from wheelchair_shared_control.features import distances
from wheelchair_shared_control.replayed_costmap import costmap_settings
from wheelchair_shared_control.simulation import scenes
from wheelchair_shared_control.simulation.simulator import Simulator
from wheelchair_shared_control.values import Ranges

CAMERA = (160, 120)
OWN_TYPES = ("BlendState",)


class Recorded(NamedTuple):
    """One bag: ``path``, ``duration`` [s], ``bytes``, smallest true ``clearance`` [m], whether it ``touched``."""

    path: str
    duration: float
    bytes: int
    clearance: float
    touched: bool


def jobs(set_name, settings):
    """(scene, teacher's index) of all demonstrations of a set, in order."""
    return [(scene, index) for scene in teachers.SCENES for index in range(settings.teachers_per_scene)]


def record(set_name, scene, index, seed, path, settings, simulator_settings=None, navigation=None):
    """Drive one demonstration and write it to ``path``. Returns ``Recorded``; raises BagError.

    ``settings``: group ``teachers``. What chance draws depends on ``seed``, scene and index alone.
    """
    simulator_settings = simulator_settings or parameters.load("simulator")
    key = [int(seed), teachers.SETS.index(set_name), teachers.SCENES.index(scene), int(index)]
    rng = np.random.default_rng(key)
    teacher = teachers.Teacher(teachers.style(set_name, scene, index, settings, rng), settings, rng)
    world = scenes.build(scene, teacher.style.door_width)
    door = world.doors[0].pose
    start = se2.compose(door, teacher.style.start)
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=str(path.parent), prefix="." + path.name, suffix=".bag")
        os.close(handle)
        os.unlink(temporary)
        try:
            noise = int(np.random.default_rng(key + [1]).integers(2**31))
            with Simulator(world, simulator_settings, noise, start, CAMERA) as simulator:
                with _Bag(temporary, simulator_settings.wheelchair, simulator.camera, OWN_TYPES) as bag:
                    clearance, touched = _drive(simulator, teacher, door, bag, settings, navigation)
                duration = simulator.time
            os.replace(temporary, str(path))
        finally:
            if os.path.exists(temporary):
                os.unlink(temporary)
    except OSError as error:
        raise BagError("%s: cannot be written: %s" % (path, error.strerror or error))
    return Recorded(str(path), duration, path.stat().st_size, clearance, touched)


def _drive(simulator, teacher, door, bag, settings, navigation):
    """Let the teacher drive to the end; smallest clearance [m], and whether anything was touched."""
    eyes = _Eyes(simulator, navigation)
    tick = 1.0 / settings.odometry_rate
    stick_every = int(round(settings.odometry_rate / settings.command_rate))
    look_every = int(round(settings.odometry_rate / settings.look_rate))
    clearance, touched, count = np.inf, False, 0
    door_from_world = se2.inverse(door)
    while True:
        now = simulator.time
        odometry = simulator.odometry()
        bag.odometry(now, odometry)
        if count % stick_every == 0:
            command = teacher.update(now, se2.compose(door_from_world, simulator.truth().pose))
            if command is None:
                return clearance, touched
            bag.command(now, command)
            simulator.command(*command)
            clearance = min(clearance, simulator.clearance())
        if count % look_every == 0:
            found = eyes.look(odometry, bag)
            bag.state(now, command, odometry, found)
        simulator.advance(tick)
        touched = touched or bool(simulator.contacts())
        count += 1


class _Eyes:
    """Sensors, costmap and features of the chair."""

    def __init__(self, simulator, navigation):
        settings = costmap_settings(navigation)
        self._simulator = simulator
        self._costmap = Costmap(settings.local_costmap, settings.wheelchair)
        self._footprint = footprint.from_settings(settings.wheelchair)
        self._mounting = camera.mounting(settings.wheelchair)

    def look(self, odometry, bag):
        """Features (3,) [m] of now; what was seen goes into the bag."""
        now, pose = self._simulator.time, odometry.pose
        # the person's view is that of the bag: 16UC1 in millimetres
        image = bag.depth(now, self._simulator.depth().image)
        ranges = Ranges(now, np.asarray(self._simulator.ranges().values, dtype=np.float32).astype(float))
        bag.ranges(now, ranges.values)
        self._costmap.move_to(pose)
        self._costmap.insert_ranges(ranges, pose, "ranges")
        self._costmap.insert_depth(image, self._simulator.camera, camera.lifted(pose) @ self._mounting, now, "depth")
        return distances(to_grid(self._costmap.update(pose, now)), pose, self._footprint)


class _Bag(BagWriter):
    """A demonstration's bag: the chair, its sensors, and the teacher's stick."""

    def command(self, now, command):
        twist = self.twist(command)
        self.write("user/cmd_vel", now, twist)
        # nothing stands between this person and the wheels
        self.write("cmd_vel", now, twist)

    def state(self, now, command, odometry, features):
        """What the blender says while the person drives alone."""
        nothing = self.twist((np.nan, np.nan))
        twist, nan = self.twist(command), np.nan
        self.write("blender/state", now, self.type("wheelchair_shared_control", "BlendState")(
            header=self.header("blender/state", now, "base_link"), user=twist, planner=nothing, blended=twist,
            sent=twist, d_l=float(features[0]), d_f=float(features[1]), d_r=float(features[2]), v=odometry.twist.v,
            mean_l=nan, mean_r=nan, sigma_l=nan, sigma_r=nan, sigma=nan, beta=1.0, log_density=nan,
            clearance=float(min(features)), guard=0, policy="user", reason="demonstration"))
