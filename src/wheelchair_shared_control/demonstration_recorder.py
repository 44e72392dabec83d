"""A teacher on the simulated chair, recorded as a bag: the topics of the ROS graph, by plain calls.

The chair, its sensors, the costmap and the features are those of every episode. Equal seeds give equal bags,
byte for byte.
"""
import os
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from wheelchair_shared_control import camera, conversions, footprint, parameters, se2, teachers
from wheelchair_shared_control.bags import BagError
from wheelchair_shared_control.costmap import Costmap, to_grid
from wheelchair_shared_control.features import distances
from wheelchair_shared_control.replayed_costmap import costmap_settings
from wheelchair_shared_control.simulation import scenes
from wheelchair_shared_control.simulation.simulator import Simulator
from wheelchair_shared_control.values import RANGERS, Ranges

CAMERA = (160, 120)
START_STAMP = 1.0  # s; a stamp of 0 means "none" in ROS
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
    world = scenes.build(scene)
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
                with _Bag(temporary, simulator_settings.wheelchair, simulator.camera) as bag:
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


class _Bag:
    """A bag being written; methods are named after what they note, stamps are simulated time."""

    def __init__(self, path, wheelchair, lens):
        self._wheelchair, self._lens, self._path = wheelchair, lens, path
        self._store = get_typestore(Stores.ROS1_NOETIC)
        self._store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms",
            "tf2_msgs/msg/TFMessage"))
        for name in OWN_TYPES:
            definition = parameters.package_file("msg/%s.msg" % name).read_text(encoding="utf-8")
            self._store.register(get_types_from_msg(definition, "wheelchair_shared_control/msg/" + name))
        self._connections, self._sequence = {}, {}

    def __enter__(self):
        self._writer = Writer(self._path)
        self._writer.set_compression(Writer.CompressionFormat.LZ4)
        self._writer.open()
        self._static_transforms(0.0)
        return self

    def __exit__(self, *_):
        self._writer.close()

    def odometry(self, now, odometry):
        t = self._type
        pose = t("geometry_msgs", "Pose")(*self._pose(odometry.pose))
        twist = t("geometry_msgs", "Twist")(self._vector(odometry.twist.v), self._vector(0.0, 0.0, odometry.twist.w))
        no_covariance = np.zeros(36)
        header = self._header("odom", now, "odom")
        self._write("odom", now, t("nav_msgs", "Odometry")(
            header, "base_link", t("geometry_msgs", "PoseWithCovariance")(pose, no_covariance),
            t("geometry_msgs", "TwistWithCovariance")(twist, no_covariance)))
        transform = t("geometry_msgs", "Transform")(self._vector(*odometry.pose[:2]), pose.orientation)
        link = t("geometry_msgs", "TransformStamped")(header, "base_link", transform)
        self._write("tf", now, t("tf2_msgs", "TFMessage")([link]))

    def command(self, now, command):
        twist = self._twist(command)
        self._write("user/cmd_vel", now, twist)
        # nothing stands between this person and the wheels
        self._write("cmd_vel", now, twist)

    def depth(self, now, image):
        """Note a depth image (height, width) [m]; returns it as a reader of the bag will see it."""
        message = self._type("sensor_msgs", "Image")(
            self._header("camera/depth/image_raw", now, "camera_depth_optical_frame"), 0, 0, "", 0, 0, None)
        conversions.fill_depth(message, image, "16UC1")
        message.data = np.frombuffer(message.data, np.uint8)
        self._write("camera/depth/image_raw", now, message)
        lens = self._lens
        info = self._type("sensor_msgs", "CameraInfo")(
            message.header, lens.height, lens.width, "plumb_bob", np.zeros(5),
            np.array([lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1.0]), np.eye(3).reshape(-1),
            np.array([lens.fx, 0, lens.cx, 0, 0, lens.fy, lens.cy, 0, 0, 0, 1.0, 0]), 0, 0,
            self._type("sensor_msgs", "RegionOfInterest")(0, 0, 0, 0, False))
        self._write("camera/depth/camera_info", now, info)
        return conversions.depth_of(message)

    def ranges(self, now, values):
        r = self._wheelchair.rangers
        for name, value in zip(RANGERS, values):
            topic = "ir/" + name
            self._write(topic, now, self._type("sensor_msgs", "Range")(
                self._header(topic, now, "ir_" + name), 1, r.field_of_view, r.min_range, r.max_range, value))

    def state(self, now, command, odometry, features):
        """What the blender says while the person drives alone."""
        nothing = self._twist((np.nan, np.nan))
        twist, nan = self._twist(command), np.nan
        self._write("blender/state", now, self._type("wheelchair_shared_control", "BlendState")(
            header=self._header("blender/state", now, "base_link"), user=twist, planner=nothing, blended=twist,
            sent=twist, d_l=float(features[0]), d_f=float(features[1]), d_r=float(features[2]), v=odometry.twist.v,
            mean_l=nan, mean_r=nan, sigma_l=nan, sigma_r=nan, sigma=nan, beta=1.0, log_density=nan,
            clearance=float(min(features)), guard=0, policy="user", reason="demonstration"))

    # ---- messages --------------------------------------------------------------------------------------

    def _static_transforms(self, now):
        links = [("camera_depth_optical_frame", camera.mounting(self._wheelchair))]
        r = self._wheelchair.rangers
        for name in RANGERS:
            side, place = name.split("_")
            left = 1.0 if side == "left" else -1.0
            transform = camera.lifted((getattr(r, "x_" + place), left * r.y, left * np.pi / 2.0))
            transform[2, 3] = r.z
            links.append(("ir_" + name, transform))
        t = self._type
        self._write("tf_static", now, t("tf2_msgs", "TFMessage")([
            t("geometry_msgs", "TransformStamped")(
                self._header("tf_static", now, "base_link"), frame,
                t("geometry_msgs", "Transform")(self._vector(*matrix[:3, 3]), self._quaternion(matrix[:3, :3])))
            for frame, matrix in links]))

    def _type(self, package, name):
        return self._store.types["%s/msg/%s" % (package, name)]

    def _vector(self, x=0.0, y=0.0, z=0.0):
        return self._type("geometry_msgs", "Vector3")(float(x), float(y), float(z))

    def _twist(self, command):
        return self._type("geometry_msgs", "Twist")(self._vector(command[0]), self._vector(0.0, 0.0, command[1]))

    def _pose(self, pose):
        quaternion = self._type("geometry_msgs", "Quaternion")(0.0, 0.0, float(np.sin(pose[2] / 2)),
            float(np.cos(pose[2] / 2)))
        return self._type("geometry_msgs", "Point")(float(pose[0]), float(pose[1]), 0.0), quaternion

    def _quaternion(self, rotation):
        w = 0.5 * np.sqrt(max(0.0, 1.0 + np.trace(rotation)))
        x, y, z = (
            np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0],
                rotation[1, 0] - rotation[0, 1]])
            / (4.0 * w)
        )
        return self._type("geometry_msgs", "Quaternion")(float(x), float(y), float(z), float(w))

    def _header(self, topic, now, frame):
        sequence = self._sequence.get(topic, 0)
        self._sequence[topic] = sequence + 1
        seconds, nanoseconds = divmod(self._nanoseconds(now), 10**9)
        stamp = self._type("builtin_interfaces", "Time")(seconds, nanoseconds)
        return self._type("std_msgs", "Header")(seq=sequence, stamp=stamp, frame_id=frame)

    @staticmethod
    def _nanoseconds(now):
        return int(round((START_STAMP + now) * 1e9))

    def _write(self, topic, now, message):
        kind = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                "/" + topic, kind, typestore=self._store, latching=int(topic == "tf_static"))
        self._writer.write(self._connections[topic], self._nanoseconds(now),
            bytes(self._store.serialize_ros1(message, kind)))
