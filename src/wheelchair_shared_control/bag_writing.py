"""Writing bags (ROS 1, format 2.0) by plain calls: the topics of the ROS graph, no ROS needed.

Stamps are simulated time; equal calls give equal bytes. The library is ``rosbags``.
"""
import lz4.frame
import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from wheelchair_shared_control import camera, conversions, parameters
from wheelchair_shared_control.values import RANGERS

START_STAMP = 1.0  # s; a stamp of 0 means "none" in ROS


def _ros_lz4(content):
    """An LZ4 frame that ROS's own roslz4 reads: it knows independent blocks with a checksum at the end, no others."""
    return lz4.frame.compress(
        content, compression_level=0, block_size=lz4.frame.BLOCKSIZE_MAX4MB, block_linked=False, content_checksum=True,
        store_size=False,
    )


class BagWriter:
    """A bag being written, for ``with``: motion and sensors of the chair.

    Methods are named after what they note, ``now`` is simulated time [s]. ``own_types``: names of this package's
    messages that are written, each after those that it holds. What is written on ``latched`` topics is kept for late
    readers.
    """

    latched = ("tf_static",)

    def __init__(self, path, wheelchair, lens, own_types=()):
        self._wheelchair, self._lens, self._path = wheelchair, lens, path
        self._store = get_typestore(Stores.ROS1_NOETIC)
        self._store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms",
            "tf2_msgs/msg/TFMessage"))
        for name in own_types:
            definition = parameters.package_file("msg/%s.msg" % name).read_text(encoding="utf-8")
            self._store.register(get_types_from_msg(definition, "wheelchair_shared_control/msg/" + name))
        self._connections, self._sequence = {}, {}

    def __enter__(self):
        self._writer = Writer(self._path)
        self._writer.set_compression(Writer.CompressionFormat.LZ4)
        self._writer.compressor = _ros_lz4
        self._writer.open()
        self._static_transforms(0.0)
        return self

    def __exit__(self, *_):
        self._writer.close()

    def odometry(self, now, odometry):
        """Note ``Odometry`` of odom, and its transform."""
        t = self.type
        pose = t("geometry_msgs", "Pose")(*self.pose(odometry.pose))
        twist = t("geometry_msgs", "Twist")(self.vector(odometry.twist.v), self.vector(0.0, 0.0, odometry.twist.w))
        no_covariance = np.zeros(36)
        header = self.header("odom", now, "odom")
        self.write("odom", now, t("nav_msgs", "Odometry")(
            header, "base_link", t("geometry_msgs", "PoseWithCovariance")(pose, no_covariance),
            t("geometry_msgs", "TwistWithCovariance")(twist, no_covariance)))
        transform = t("geometry_msgs", "Transform")(self.vector(*odometry.pose[:2]), pose.orientation)
        link = t("geometry_msgs", "TransformStamped")(header, "base_link", transform)
        self.write("tf", now, t("tf2_msgs", "TFMessage")([link]))

    def depth(self, now, image):
        """Note a depth image (height, width) [m]; returns it as a reader of the bag will see it."""
        message = self.type("sensor_msgs", "Image")(
            self.header("camera/depth/image_raw", now, "camera_depth_optical_frame"), 0, 0, "", 0, 0, None)
        conversions.fill_depth(message, image, "16UC1")
        message.data = np.frombuffer(message.data, np.uint8)
        self.write("camera/depth/image_raw", now, message)
        lens = self._lens
        info = self.type("sensor_msgs", "CameraInfo")(
            message.header, lens.height, lens.width, "plumb_bob", np.zeros(5),
            np.array([lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1.0]), np.eye(3).reshape(-1),
            np.array([lens.fx, 0, lens.cx, 0, 0, lens.fy, lens.cy, 0, 0, 0, 1.0, 0]), 0, 0,
            self.type("sensor_msgs", "RegionOfInterest")(0, 0, 0, 0, False))
        self.write("camera/depth/camera_info", now, info)
        return conversions.depth_of(message)

    def ranges(self, now, values):
        """Note the six readings (6,) [m]."""
        r = self._wheelchair.rangers
        for name, value in zip(RANGERS, values):
            topic = "ir/" + name
            self.write(topic, now, self.type("sensor_msgs", "Range")(
                self.header(topic, now, "ir_" + name), 1, r.field_of_view, r.min_range, r.max_range, value))

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
        t = self.type
        self.write("tf_static", now, t("tf2_msgs", "TFMessage")([
            t("geometry_msgs", "TransformStamped")(
                self.header("tf_static", now, "base_link"), frame,
                t("geometry_msgs", "Transform")(self.vector(*matrix[:3, 3]), self.quaternion(matrix[:3, :3])))
            for frame, matrix in links]))

    def type(self, package, name):
        """A message type of ``package``."""
        return self._store.types["%s/msg/%s" % (package, name)]

    def vector(self, x=0.0, y=0.0, z=0.0):
        """A ``Vector3``."""
        return self.type("geometry_msgs", "Vector3")(float(x), float(y), float(z))

    def twist(self, command):
        """A ``Twist`` of (v, w)."""
        return self.type("geometry_msgs", "Twist")(self.vector(command[0]), self.vector(0.0, 0.0, command[1]))

    def pose(self, pose):
        """Position and orientation of a planar pose (3,), to make a ``Pose`` of."""
        quaternion = self.type("geometry_msgs", "Quaternion")(0.0, 0.0, float(np.sin(pose[2] / 2)),
            float(np.cos(pose[2] / 2)))
        return self.type("geometry_msgs", "Point")(float(pose[0]), float(pose[1]), 0.0), quaternion

    def quaternion(self, rotation):
        """A ``Quaternion`` of a rotation (3, 3)."""
        w = 0.5 * np.sqrt(max(0.0, 1.0 + np.trace(rotation)))
        x, y, z = (
            np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0],
                rotation[1, 0] - rotation[0, 1]])
            / (4.0 * w)
        )
        return self.type("geometry_msgs", "Quaternion")(float(x), float(y), float(z), float(w))

    def header(self, topic, now, frame):
        """A ``Header``; each topic counts its own."""
        sequence = self._sequence.get(topic, 0)
        self._sequence[topic] = sequence + 1
        seconds, nanoseconds = divmod(self.nanoseconds(now), 10**9)
        stamp = self.type("builtin_interfaces", "Time")(seconds, nanoseconds)
        return self.type("std_msgs", "Header")(seq=sequence, stamp=stamp, frame_id=frame)

    @staticmethod
    def nanoseconds(now):
        """The stamp of ``now`` [s]."""
        return int(round((START_STAMP + now) * 1e9))

    def write(self, topic, now, message):
        """Append a message of ``topic``."""
        kind = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                "/" + topic, kind, typestore=self._store, latching=int(topic in self.latched))
        self._writer.write(self._connections[topic], self.nanoseconds(now),
            bytes(self._store.serialize_ros1(message, kind)))
