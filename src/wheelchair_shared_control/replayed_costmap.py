"""Features of a bag recomputed from its raw sensors, through the costmap that drives the chair.

A better costmap then needs no new driving. Each message of the main source (depth image, else cloud, else
laser) at most at the samples' rate becomes one look; all others are laid in as they come.
"""
import numpy as np

from wheelchair_shared_control import bags, camera, conversions, footprint, observations, parameters
from wheelchair_shared_control.bags import BagError
from wheelchair_shared_control.costmap import Costmap, CostmapError, to_grid
from wheelchair_shared_control.features import distances
from wheelchair_shared_control.values import RANGERS, Ranges

# in the order of preference: the first that a bag has is the main source, and its messages are the moments
MAIN_SOURCES = ("depth", "points", "scan")
DATA_TYPES = {"depth": "Image", "points": "PointCloud2", "scan": "LaserScan", "ranges": "Range"}
DATA_NAMES = {"depth": "depth image", "points": "point cloud", "scan": "laser scan"}
# our chair's laser, where a bag does not say how high it sits [m]
SCAN_HEIGHT = 0.3
LOOK_AHEAD = 2.0  # s
MUCH_INSIDE = 0.2  # share of moments
OLDEST_READING = 0.5  # s; a set of range readings may hold older ones no longer


def features(bag, topics, odometry, base_frame, navigation=None, rate=10.0):
    """Stamps (n,) [s], distances (n, 3) [m] of ``d_l, d_f, d_r``, and notes in words.

    ``odometry`` (m, 6): stamp, x, y, yaw, v, w; ``navigation``: settings of group ``move_base``. Raises
    BagError where the bag holds no sensor that the costmap can use.
    """
    names = [name for name in MAIN_SOURCES if topics[name] in bag.topics]
    if "depth" in names and topics["camera_info"] not in bag.topics:
        names.remove("depth")
    if not names:
        wanted = ", ".join("%s '%s'" % (name, topics[name]) for name in MAIN_SOURCES)
        raise BagError("%s: neither recorded features nor sensors: looked for %s" % (bag.path, wanted))
    replay = _Replay(topics, names[0], odometry, base_frame, navigation, rate)
    replay.look_ahead(bag)
    wanted = [topics[name] for name in names + ["camera_info", "tf", "tf_static"]]
    wanted += [topics["ranges"] + "/" + name for name in RANGERS]
    for topic, _, _, message in bag.messages(wanted):
        replay.insert(topic, message)
    return replay.result()


class _Replay:
    """Costmap, transforms and looks of one bag."""

    def __init__(self, topics, main, odometry, base_frame, navigation, rate):
        settings = costmap_settings(navigation)
        self._costmap = Costmap(settings.local_costmap, settings.wheelchair)
        self._wheelchair = settings.wheelchair
        self._footprint = footprint.from_settings(settings.wheelchair)
        self._odometry = odometry
        self._yaw = np.unwrap(odometry[:, 3])
        self._topics = topics
        self._main, self._interval, self._last = main, 0.9 / rate, -np.inf
        self._frames = Transforms(base_frame)
        self._camera, self._scaled = None, None
        self._ranges = {}
        self._stamps, self._distances, self._notes, self._refused = [], [], {}, {}
        self._handlers = {topics["camera_info"]: self._info, topics["depth"]: self._depth,
                          topics["points"]: self._points, topics["scan"]: self._scan,
                          topics["tf"]: self._frames.insert, topics["tf_static"]: self._frames.insert}
        for index, name in enumerate(RANGERS):
            self._handlers[topics["ranges"] + "/" + name] = lambda message, index=index: self._range(message, index)

    def look_ahead(self, bag):
        """Intrinsics and mountings are told once or now and then; the first looks need them already."""
        for names in (("camera_info",), ("tf_static",), ("tf",)):
            first = None
            for topic, _, time, message in bag.messages([self._topics[name] for name in names]):
                first = time if first is None else first
                if time - first > LOOK_AHEAD:
                    break
                self.insert(topic, message)

    def insert(self, topic, message):
        try:
            self._handlers[topic](message)
        except (conversions.ConversionError, CostmapError) as error:
            self._refused[str(error)] = self._refused.get(str(error), 0) + 1
        except AttributeError as error:
            text = "topic '%s' has messages of another type (%s)" % (topic, error)
            self._refused[text] = self._refused.get(text, 0) + 1

    def result(self):
        notes = list(self._notes) + ["%s (%d messages)" % entry for entry in self._refused.items()]
        inside = np.mean([min(found) == 0.0 for found in self._distances]) if self._distances else 0.0
        if inside > MUCH_INSIDE:
            notes.append("in %.0f %% of the moments something stands inside the chair's outline: if the recorded robot "
                         "has another one, name it (train --footprint)" % (100.0 * inside))
        return np.array(self._stamps), np.array(self._distances).reshape(-1, 3), tuple(notes)

    # ---- sources ---------------------------------------------------------------------------------------

    def _info(self, message):
        self._camera = conversions.camera_of(message)

    def _depth(self, message):
        pose, stamp = self._pose_at(message)
        if pose is None or self._too_soon("depth", stamp):
            return
        if self._camera is None:
            self._notes["depth images before the first camera_info are left out"] = True
            return
        lens = self._camera
        if (message.height, message.width) != (lens.height, lens.width):
            lens = camera.scaled(lens, message.width, message.height)
        transform = camera.lifted(pose) @ self._mounting(message.header.frame_id)
        self._costmap.move_to(pose)
        said = observations.insert_image(self._costmap, message, lens, transform, stamp, "depth")
        self._look(said, "depth", pose, stamp)

    def _points(self, message):
        pose, stamp = self._pose_at(message)
        if pose is None or self._too_soon("points", stamp):
            return
        transform = camera.lifted(pose) @ self._mounting(message.header.frame_id)
        self._costmap.move_to(pose)
        said = observations.insert_cloud(self._costmap, message, transform, stamp, "points")
        self._look(said, "points", pose, stamp)

    def _scan(self, message):
        pose, stamp = self._pose_at(message)
        if pose is None or self._too_soon("scan", stamp):
            return
        base_from_scan = self._frames.base_from(message.header.frame_id)
        if base_from_scan is None:
            self._notes["no transform to the laser's frame '%s': taken to sit at %s" % (
                message.header.frame_id, self._frames.base)] = True
            base_from_scan = np.eye(4)
        odom_from_scan = camera.lifted(pose) @ base_from_scan
        if not odom_from_scan[2, 3] > 0.0:
            odom_from_scan[2, 3] = SCAN_HEIGHT
        self._costmap.move_to(pose)
        said = observations.insert_scan(self._costmap, message, odom_from_scan, stamp, "scan")
        self._look(said, "scan", pose, stamp)

    def _range(self, message, index):
        pose, stamp = self._pose_at(message)
        if pose is None:
            return
        # the rangers speak one after the other: the last one closes the set, or one that speaks again, if that is mute
        if index in self._ranges:
            self._insert_ranges(pose, stamp)
        self._ranges[index] = (stamp, conversions.range_of(message))
        if len(self._ranges) == len(RANGERS) or index == len(RANGERS) - 1:
            self._insert_ranges(pose, stamp)

    def _insert_ranges(self, pose, stamp):
        values = np.full(len(RANGERS), np.nan)
        for place, (when, value) in self._ranges.items():
            if stamp - when <= OLDEST_READING:
                values[place] = value
        self._ranges = {}
        self._costmap.move_to(pose)
        self._costmap.insert_ranges(Ranges(stamp, values), pose, "ranges")

    # ---- looks -----------------------------------------------------------------------------------------

    def _look(self, said, name, pose, stamp):
        if not said:  # what is not seen is free in the features: silence must not pass for open space
            raise conversions.ConversionError("%s: holds no valid reading" % DATA_NAMES[name])
        if name != self._main:
            return
        self._last = stamp
        snapshot = self._costmap.update(pose, stamp)
        self._stamps.append(stamp)
        self._distances.append(distances(to_grid(snapshot), pose, self._footprint))

    def _too_soon(self, name, stamp):
        return name == self._main and 0.0 <= stamp - self._last < self._interval

    def _pose_at(self, message):
        """Interpolated pose (3,) in odom at the message's stamp, None outside the odometry."""
        stamp = conversions.seconds(message.header.stamp)
        table = self._odometry
        if not table[0, 0] <= stamp <= table[-1, 0]:
            return None, stamp
        x = np.interp(stamp, table[:, 0], table[:, 1])
        y = np.interp(stamp, table[:, 0], table[:, 2])
        return np.array([x, y, np.interp(stamp, table[:, 0], self._yaw)]), stamp

    def _mounting(self, frame):
        transform = self._frames.base_from(frame)
        if transform is None:
            note = "no transform to the camera's frame '%s': taken to sit as in config/wheelchair.yaml" % frame
            self._notes[note] = True
            transform = camera.mounting(self._wheelchair)
        return transform


def costmap_settings(navigation=None):
    """Settings of group ``move_base`` with the sources that a bag may have, at the main source's ranges."""
    navigation = navigation or parameters.load("move_base")
    nested = {}
    for key, value in navigation.as_dict().items():
        *heads, last = key.split("/")
        level = nested
        for head in heads:
            level = level.setdefault(head, {})
        level[last] = value
    costmap = nested["local_costmap"]
    known = [costmap.pop(name) for name in costmap["observation_sources"].split()]
    by_type = {source["data_type"]: source for source in known}
    image = by_type.get("Image") or by_type.get("PointCloud2") or known[0]
    for name, data_type in DATA_TYPES.items():
        # a bag's sources come as they were recorded: none is waited for
        source = dict(by_type.get(data_type, image), data_type=data_type, expected_update_rate=0.0)
        if data_type == "LaserScan" and data_type not in by_type:
            source.update(min_obstacle_height=-1.0, max_obstacle_height=3.0)  # wherever it is mounted
        costmap[name] = source
    costmap["observation_sources"] = " ".join(DATA_TYPES)
    return parameters.load("move_base", nested, "the bag's costmap")


class Transforms:
    """The tree of frames, each link as it was last heard; only links that do not move matter here."""

    def __init__(self, base):
        self.base = bags.plain(base)
        self._links, self._known = {}, {}

    def insert(self, message):
        """Take in a ``tf2_msgs/TFMessage`` or ``tf/tfMessage``."""
        for link in message.transforms:
            child, parent = bags.plain(link.child_frame_id), bags.plain(link.header.frame_id)
            if child not in self._links or self._links[child][0] != parent:
                self._known = {}
            elif child in self._known:
                continue
            self._links[child] = (parent, conversions.transform_matrix(link.transform))

    def base_from(self, frame):
        """Transform (4, 4) of ``frame`` in the base frame, or None where the tree does not join them."""
        frame = bags.plain(frame)
        if frame not in self._known:
            found = self._join(frame)
            if found is None:
                return None
            self._known[frame] = found
        return self._known[frame]

    def _join(self, frame):
        from_base, from_frame = self._chain(self.base), self._chain(frame)
        for ancestor, ancestor_from_base in from_base.items():
            if ancestor in from_frame:
                return np.linalg.inv(ancestor_from_base) @ from_frame[ancestor]
        return None

    def _chain(self, frame):
        """{ancestor: transform of ``frame`` in it}, from the frame itself upwards."""
        chain, transform = {frame: np.eye(4)}, np.eye(4)
        while frame in self._links and len(chain) < 100:
            frame, link = self._links[frame]
            if frame in chain:
                break
            transform = link @ transform
            chain[frame] = transform
        return chain
