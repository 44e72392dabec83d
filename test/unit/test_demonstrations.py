"""Bags to samples: what is taken, what is left out and counted, and bags that cannot be read."""
import importlib.machinery
import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from wheelchair_shared_control import bags, command_line, demonstration_recorder, demonstrations, parameters, training
from wheelchair_shared_control.bags import BagError
from wheelchair_shared_control.task_model import TaskModel

ROOT = Path(__file__).resolve().parents[2]
LASER_BAG = ROOT.parent / "shared" / "data" / "laser_bag" / "subset.bag"
SETTINGS = parameters.load("demonstrations")
STATE = "wheelchair_shared_control/msg/BlendState"
STORE = get_typestore(Stores.ROS1_NOETIC)
STORE.register(get_types_from_msg(parameters.package_file("msg/BlendState.msg").read_text(), STATE))
STORE.register(get_types_from_msg(
    "std_msgs/Header header\nuint8 state", "wheelchair_shared_control/msg/AssistanceState"))


def kind(package, name):
    return STORE.types["%s/msg/%s" % (package, name)]


def header(stamp, frame="odom"):
    time = kind("builtin_interfaces", "Time")(*divmod(int(round(stamp * 1e9)), 10**9))
    return kind("std_msgs", "Header")(seq=0, stamp=time, frame_id=frame)


def vector(x=0.0, y=0.0, z=0.0):
    return kind("geometry_msgs", "Vector3")(x, y, z)


def twist(v, w):
    return kind("geometry_msgs", "Twist")(vector(float(v)), vector(z=float(w)))


def odometry(stamp, v, w):
    pose = kind("geometry_msgs", "Pose")(
        kind("geometry_msgs", "Point")(v * stamp, 0.0, 0.0), kind("geometry_msgs", "Quaternion")(0.0, 0.0, 0.0, 1.0))
    return kind("nav_msgs", "Odometry")(
        header(stamp), "base_link", kind("geometry_msgs", "PoseWithCovariance")(pose, np.zeros(36)),
        kind("geometry_msgs", "TwistWithCovariance")(twist(v, w), np.zeros(36)))


def state(stamp, features=(0.5, 2.0, 0.7)):
    nothing, nan = twist(np.nan, np.nan), np.nan
    d_l, d_f, d_r = (float(value) for value in features)
    return kind("wheelchair_shared_control", "BlendState")(
        header=header(stamp), user=nothing, planner=nothing, blended=nothing, sent=nothing, d_l=d_l, d_f=d_f, d_r=d_r,
        v=nan, mean_l=nan, mean_r=nan, sigma_l=nan, sigma_r=nan, sigma=nan, beta=nan, log_density=nan, clearance=nan,
        guard=0, policy="user", reason="")


def write(path, messages, compression=None):
    """A bag of ``messages``: (topic, time [s], message)."""
    writer, connections = Writer(path), {}
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        for topic, time, message in sorted(messages, key=lambda entry: entry[1]):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=STORE)
            raw = STORE.serialize_ros1(message, message.__msgtype__)
            writer.write(connections[topic], int(round(time * 1e9)), bytes(raw))
    return path


def driving(seconds=5.0, v=0.3, w=-0.2, user=True, sent=True, moment=10.0, begin=100.0):
    """Messages of a chair that drives as its person asks: odometry and commands at 20 Hz, states at ``moment`` Hz."""
    messages = []
    for index in range(int(seconds * 20)):
        stamp = begin + index / 20.0
        messages.append(("/odom", stamp, odometry(stamp, v, w)))
        if user:
            messages.append(("/user/cmd_vel", stamp, twist(v, w)))
        if sent:
            messages.append(("/cmd_vel", stamp, twist(v, w)))
    for index in range(int((seconds - 0.1) * moment)):
        stamp = begin + index / moment
        messages.append(("/blender/state", stamp, state(stamp)))
    return messages


def read(path, **options):
    return demonstrations.read(path, SETTINGS, **options)


def test_samples_are_the_recorded_distances_and_the_measured_speeds(tmp_path):
    found = read(write(tmp_path / "a.bag", driving()))
    assert found.source == "recorded" and len(found.samples) == 49  # 4.9 s at 10 Hz
    # w = -0.2 turns right: w_l 0, w_r 0.2
    np.testing.assert_allclose(found.samples, np.tile([0.5, 2.0, 0.7, 0.3, 0.0, 0.2], (49, 1)))
    assert sum(found.left_out.values()) == 0 and found.notes == ()


def test_speeds_are_interpolated_at_the_features_stamp(tmp_path):
    # speed grows by 0.1 m/s a second; odometry 30 ms off the states
    messages = [("/odom", 100 + t, odometry(100 + t, 0.1 * t, 0.0)) for t in np.arange(0.03, 5, 0.1)]
    messages += [("/blender/state", 100 + t, state(100 + t)) for t in np.arange(1.0, 4.0, 0.1)]
    found = read(write(tmp_path / "a.bag", messages))
    np.testing.assert_allclose(found.samples[:, 3], 0.1 * (found.stamps - 100), atol=1e-6)
    assert "every motion counts" in found.notes[0]


@pytest.mark.parametrize("compression", [None, Writer.CompressionFormat.BZ2, Writer.CompressionFormat.LZ4])
def test_compressed_bags(tmp_path, compression):
    assert len(read(write(tmp_path / "a.bag", driving(), compression)).samples) == 49


def test_renamed_topics(tmp_path):
    messages = [(topic.replace("/odom", "/base/odometry"), time, message) for topic, time, message in driving()]
    path = write(tmp_path / "a.bag", messages)
    with pytest.raises(BagError, match="no odometry on topic 'odom' .topics: base/odometry, blender/state"):
        read(path)
    assert len(read(path, topics=demonstrations.topic_names(["odometry=/base/odometry"])).samples) == 49


@pytest.mark.parametrize("text", ["odom", "wheel=/odom", "odom="])
def test_renamings_that_say_nothing(text):
    with pytest.raises(BagError, match="--topic " + text):
        demonstrations.topic_names([text])


def left_out(path, **expected):
    found = read(path)
    assert {rule: count for rule, count in found.left_out.items() if count} == expected
    return found


def test_a_standing_chair_is_left_out(tmp_path):
    assert len(left_out(write(tmp_path / "a.bag", driving(v=0.0, w=0.0)), standing=49).samples) == 0


def test_turning_on_the_spot_is_kept_and_reversing_is_not(tmp_path):
    assert len(left_out(write(tmp_path / "a.bag", driving(v=0.0, w=0.4))).samples) == 49
    assert len(left_out(write(tmp_path / "b.bag", driving(v=-0.2, w=0.0)), reversing=49).samples) == 0


def test_another_hand_on_the_wheels_is_left_out(tmp_path):
    # the person pushes straight ahead, the wheels get a turn
    messages = [(topic, time, twist(0.3, 0.5) if topic == "/cmd_vel" else message) for topic, time,
        message in driving(w=0.0)]
    left_out(write(tmp_path / "a.bag", messages), not_the_user=49)


def test_limits_of_acceleration_are_no_other_hand(tmp_path):
    # the person pulls from 0.5 to -0.5 rad/s at once; the wheels follow at 0.8 rad/s2: 1.25 s
    messages = []
    for index in range(100):
        t = index / 20.0
        asked, sent = (0.5, 0.5) if t < 2.0 else (-0.5, max(-0.5, 0.5 - 0.8 * (t - 2.0)))
        messages += [("/user/cmd_vel", 100 + t, twist(0.3, asked)), ("/cmd_vel", 100 + t, twist(0.3, sent)),
                     ("/odom", 100 + t, odometry(100 + t, 0.3, sent))]
    messages += [("/blender/state", 100 + t, state(100 + t)) for t in np.arange(0.0, 4.9, 0.1)]
    left_out(write(tmp_path / "a.bag", messages))


def test_a_pushed_chair_is_left_out(tmp_path):
    messages = [(topic, time, twist(0, 0) if "cmd_vel" in topic else message) for topic, time, message in driving()]
    left_out(write(tmp_path / "a.bag", messages), not_commanded=49)


def test_missing_commands_are_said(tmp_path):
    found = left_out(write(tmp_path / "a.bag", driving(user=False, sent=False)))
    assert len(found.samples) == 49 and "no commands on 'cmd_vel'" in found.notes[0]


def test_assisted_driving_is_left_out(tmp_path):
    message = kind("wheelchair_shared_control", "AssistanceState")
    messages = driving() + [("/assistance", 102.0, message(header(102.0), 2)),
        ("/assistance", 103.0, message(header(103.0), 0))]
    left_out(write(tmp_path / "a.bag", messages), assisted=10)  # one second at 10 Hz


def test_a_gap_in_the_odometry_is_left_out(tmp_path):
    messages = [entry for entry in driving() if not (entry[0] == "/odom" and 101.975 < entry[1] < 102.975)]
    # the message before the gap is that of 101.95, the one after it of 103.0: states from 102.0 to 102.9 lie in it
    left_out(write(tmp_path / "a.bag", messages), unaligned=10)


def test_distances_that_are_none_are_left_out(tmp_path):
    messages = [entry for entry in driving() if entry[0] != "/blender/state"]
    for index, bad in enumerate(((np.nan, 1, 1), (1, -1, 1), (1, 1, np.inf))):
        messages.append(("/blender/state", 101.0 + index, state(101.0 + index, bad)))
    assert len(left_out(write(tmp_path / "a.bag", messages), impossible=3).samples) == 0


def test_states_faster_than_the_rate_are_thinned(tmp_path):
    found = read(write(tmp_path / "a.bag", driving(moment=50.0)))
    assert 45 <= len(found.samples) <= 50 and found.left_out["too_close"] == 245 - len(found.samples)


def test_a_second_clock_is_noticed(tmp_path):
    # recorded at times 1000 s after the stamps: the commands, which carry no stamp, are moved back
    messages = [(topic, time + 1000.0, message) for topic, time, message in driving()]
    found = left_out(write(tmp_path / "a.bag", messages))
    assert len(found.samples) == 49 and "-1000.0 s" in found.notes[0]


def test_bags_that_cannot_be_read_say_why(tmp_path):
    good = write(tmp_path / "good.bag", driving()).read_bytes()
    cases = {
        "empty.bag": (b"", "is empty"),
        "text.bag": (b"hello\n" * 100, "is no bag"),
        "old.bag": (b"#ROSBAG V1.2\n" + good[13:], "bag format 1.2"),
        "cut.bag": (good[: len(good) // 2], "cut short|damaged"),
        "unindexed.bag": (good.replace(b"index_pos=" + good.split(b"index_pos=")[1][:8],
            b"index_pos=" + bytes(8)), "no index"),
        "header.bag": (good[:13], "damaged|could not|Could not|read"),
    }
    for name, (content, message) in cases.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(BagError, match=message) as caught:
            read(tmp_path / name)
        assert str(tmp_path / name) in str(caught.value) and "\n" not in str(caught.value)
    with pytest.raises(BagError, match="no such file"):
        read(tmp_path / "none.bag")
    with pytest.raises(BagError, match="no ROS 2 bag"):
        read(tmp_path)
    with pytest.raises(BagError, match="holds no messages"):
        read(write(tmp_path / "nothing.bag", []))


def test_damaged_bags_give_a_result_or_one_line(tmp_path):
    good = write(tmp_path / "good.bag", driving(2.0)).read_bytes()
    rng = np.random.default_rng(0)
    for index in range(60):
        broken = bytearray(good)
        for place in rng.integers(len(broken), size=5):
            broken[place] = rng.integers(256)
        path = tmp_path / ("%d.bag" % index)
        path.write_bytes(bytes(broken[: rng.integers(len(broken) // 2, len(broken))] if index % 2 else broken))
        try:
            assert np.isfinite(read(path).samples).all()
        except BagError as error:
            assert "\n" not in str(error)


def test_the_library_s_bare_assertion_becomes_a_line(tmp_path):
    # one nanosecond between an entry of the index and its message: rosbags asserts, without a word
    content = bytearray(write(tmp_path / "a.bag", driving()).read_bytes())
    header = content.index(bytes((47, 0, 0, 0)))  # the length of an index record's header
    content[header + 4 + 47 + 4 + 4] += 1  # then the length of its entries, seconds, nanoseconds
    (tmp_path / "b.bag").write_bytes(bytes(content))
    with pytest.raises(BagError, match="b.bag: .*library rosbags expects it .AssertionError.; 'rosbag reindex'"):
        read(tmp_path / "b.bag")


def test_what_is_no_file_and_parts_of_ros_2_bags_are_named(tmp_path):
    os.mkfifo(str(tmp_path / "pipe"))  # opening it would wait for ever
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    for name, message in (("pipe", "is no regular file"), ("a.mcap", "part of a ROS 2 bag: name the directory")):
        with pytest.raises(BagError, match=message):
            read(tmp_path / name)


def test_a_directory_stands_for_the_bags_in_it(tmp_path):
    (tmp_path / "ros2").mkdir()
    for name in ("b.bag", "a.bag", "notes.txt", "ros2/metadata.yaml"):
        (tmp_path / name).write_bytes(b"")
    assert bags.expand([tmp_path]) == [tmp_path / "a.bag", tmp_path / "b.bag", tmp_path / "ros2"]
    assert bags.expand([tmp_path / "ros2", tmp_path / "none.bag"]) == [tmp_path / "ros2", tmp_path / "none.bag"]
    (tmp_path / "empty").mkdir()
    with pytest.raises(BagError, match="empty: holds no .bag"):
        bags.expand([tmp_path / "empty"])


def test_stamps_that_do_not_advance_are_named(tmp_path):
    messages = [(topic, time, odometry(0.0, 0.3, 0.0) if topic == "/odom" else message)
                for topic, time, message in driving()]
    with pytest.raises(BagError, match="stamps of topic 'odom' do not advance: all are 0.000 s"):
        read(write(tmp_path / "a.bag", messages))


# ---- raw sensors -------------------------------------------------------------------------------------------

#            wall
#   [ base -> mount -> laser -- 1.5 m --|      both links 0.1 m; the chair's front edge is 0.70 m ahead of its base:
#                                              0.2 + 1.5 - 0.7 = 1.0 m
FREE_AHEAD = 1.0
CELL = 0.05


def looking(store, frame="laser", reading=None):
    """(topic, time, message): a chair turns slowly on the spot and looks at a wall; two tell where its laser sits."""
    def make(package, name, **fields):
        return store.types["%s/msg/%s" % (package, name)](**fields)

    def head(stamp, name):
        time = make("builtin_interfaces", "Time", sec=int(stamp), nanosec=int(round(stamp % 1 * 1e9)))
        seq = {"seq": 0} if "seq" in store.types["std_msgs/msg/Header"].__dataclass_fields__ else {}
        return make("std_msgs", "Header", stamp=time, frame_id=name, **seq)

    def xyz(kind, x=0.0, z=0.0):
        return make("geometry_msgs", kind, x=x, y=0.0, z=z)

    upright = make("geometry_msgs", "Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    angles = np.arange(-40, 41) * 0.005
    ranges = 1.5 / np.cos(angles) if reading is None else np.full(81, reading)
    messages = []
    for topic, parent, child in (("/tf_static", "base_link", "mount"), ("/tf_static/second", "mount", "laser")):
        transform = make("geometry_msgs", "Transform", translation=xyz("Vector3", 0.1, 0.15), rotation=upright)
        link = make("geometry_msgs", "TransformStamped", header=head(100.0, parent), child_frame_id=child,
                    transform=transform)
        messages.append((topic, 100.0, make("tf2_msgs", "TFMessage", transforms=[link])))
    for stamp in 100.0 + np.arange(60) / 20.0:
        pose = make("geometry_msgs", "Pose", position=xyz("Point"), orientation=upright)
        twist_ = make("geometry_msgs", "Twist", linear=xyz("Vector3"), angular=xyz("Vector3", z=0.03))
        messages.append(("/odom", stamp, make(
            "nav_msgs", "Odometry", header=head(stamp, "odom"), child_frame_id="base_link",
            pose=make("geometry_msgs", "PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
            twist=make("geometry_msgs", "TwistWithCovariance", twist=twist_, covariance=np.zeros(36)))))
        messages.append(("/scan", stamp, make(
            "sensor_msgs", "LaserScan", header=head(stamp, frame), angle_min=float(angles[0]),
            angle_max=float(angles[-1]), angle_increment=0.005, time_increment=0.0, scan_time=0.05, range_min=0.05,
            range_max=5.0, ranges=ranges.astype(np.float32), intensities=np.zeros(0, np.float32))))
    return messages


def write_looking(path, compression=None, **options):
    """A ROS 1 bag of ``looking``; the two publishers of the mounting share the topic, and word its type differently."""
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    definition = store.generate_msgdef("tf2_msgs/msg/TFMessage")[0]
    writer = Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        connections = {
            topic: writer.add_connection(
                topic.replace("/second", ""), "tf2_msgs/msg/TFMessage", msgdef=comment + definition, md5sum="0" * 32,
                callerid="/" + publisher, latching=1)
            for topic, publisher, comment in (("/tf_static", "one", ""), ("/tf_static/second", "two", "# by hand\n"))
        }
        for topic, time, message in looking(store, **options):
            kind_ = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind_, typestore=store)
            writer.write(connections[topic], int(round(time * 1e9)), bytes(store.serialize_ros1(message, kind_)))
    return path


@pytest.mark.parametrize("compression", [None, Writer.CompressionFormat.BZ2, Writer.CompressionFormat.LZ4])
def test_transforms_of_two_publishers_are_joined(tmp_path, compression):
    path = write_looking(tmp_path / "a.bag", compression)
    with bags.open_bag(path) as bag:
        assert len(list(bag.messages(["tf_static"]))) == 2
    found = read(path)
    assert found.source == "raw" and len(found.samples) == 30  # 0 to 2.9 s at 10 Hz
    assert found.notes == ("no commands on 'cmd_vel': every motion counts as the driver's",)
    np.testing.assert_allclose(found.samples[:, 1], FREE_AHEAD, atol=CELL)
    np.testing.assert_allclose(found.samples[:, [0, 2, 4]], [[2.0, 2.0, 0.03]] * 30)  # nothing on either side


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_bags_of_ros_2(tmp_path, storage):
    store = get_typestore(Stores.ROS2_HUMBLE)
    connections = {}
    with Rosbag2Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin[storage]) as writer:
        for topic, time, message in looking(store):
            topic = topic.replace("/second", "")
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=store)
            writer.write(connections[topic], int(round(time * 1e9)), store.serialize_cdr(message, message.__msgtype__))
    found = read(tmp_path / "bag")
    assert len(found.samples) == 30
    np.testing.assert_allclose(found.samples[:, 1], FREE_AHEAD, atol=CELL)
    # damaged in the middle: a result or one line
    part = next(iter((tmp_path / "bag").glob("*." + {"SQLITE3": "db3", "MCAP": "mcap"}[storage])))
    part.write_bytes(part.read_bytes()[: part.stat().st_size // 2])
    with pytest.raises(BagError, match="bag: "):
        read(tmp_path / "bag")


def test_a_scan_without_readings_is_not_taken_for_open_space(tmp_path):
    with pytest.raises(BagError, match="no features could be made of it; laser scan: holds no valid reading"):
        read(write_looking(tmp_path / "a.bag", reading=np.nan))
    # +Inf is a reading: nothing within the laser's range
    found = read(write_looking(tmp_path / "b.bag", reading=np.inf))
    np.testing.assert_allclose(found.samples[:, :3], 2.0)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Three seconds of a teacher in the hallway, recorded twice."""
    settings = parameters.load("teachers").replace(longest=5.0)
    folder = tmp_path_factory.mktemp("recorded")
    for name in ("one.bag", "two.bag"):
        demonstration_recorder.record("paper", "hallway", 1, 3, folder / name, settings)
    return folder


def test_equal_seeds_give_equal_bags(recorded):
    assert (recorded / "one.bag").read_bytes() == (recorded / "two.bag").read_bytes()


def test_features_recomputed_from_raw_sensors_are_the_recorded_ones(recorded):
    as_recorded, again = read(recorded / "one.bag", source="recorded"), read(recorded / "one.bag", source="raw")
    assert as_recorded.source == "recorded" and again.source == "raw" and again.notes == ()
    assert len(as_recorded.samples) > 30
    common = np.isin(np.round(as_recorded.stamps, 3), np.round(again.stamps, 3))
    assert common.mean() > 0.9
    match = np.searchsorted(again.stamps, as_recorded.stamps[common] - 1e-6)
    # the chair's pose is rounded in no message: the same costmap, up to the order of the range readings
    difference = np.abs(again.samples[match] - as_recorded.samples[common])
    assert np.median(difference) == 0.0 and (difference[:, :3] < 0.03).mean() > 0.98


def train(*arguments):
    return subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "train")] + [str(argument) for argument in arguments],
        capture_output=True, text=True, timeout=60, env={"PYTHONPATH": str(ROOT / "src"), "PATH": "/usr/bin:/bin"},
    )


def test_train_writes_no_model_of_bags_that_say_nothing(tmp_path):
    (tmp_path / "bad.bag").write_bytes(b"#ROSBAG V2.0\nrubbish")
    done = train(tmp_path / "bad.bag", "--output", tmp_path / "model.npz")
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1 and "bad.bag" in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.bag"]


@pytest.fixture
def train_here(monkeypatch, capsys):
    """The command line ``train`` in this process: (exit code, stdout, lines of stderr)."""
    loader = importlib.machinery.SourceFileLoader("train_script", str(ROOT / "scripts" / "train"))
    script = importlib.util.module_from_spec(importlib.util.spec_from_loader("train_script", loader))
    loader.exec_module(script)
    monkeypatch.setattr(sys, "argv", ["train"])

    def call(*arguments):
        try:
            code = command_line.run(script.main, [str(argument) for argument in arguments])
        except SystemExit as end:
            code = end.code
        out, err = capsys.readouterr()
        return code, out, err.splitlines()

    return call


def test_train_makes_a_model_and_adds_to_it(tmp_path, train_here):
    rng = np.random.default_rng(0)
    for name in ("a.bag", "b.bag"):
        messages = []
        for index in range(60):
            stamp, w = 100 + index / 10.0, rng.normal() * 0.2
            messages.append(("/odom", stamp, odometry(stamp, rng.uniform(0.2, 0.4), w)))
            messages.append(("/cmd_vel", stamp, twist(0.3, w)))
            messages.append(("/blender/state", stamp, state(stamp, rng.uniform(0, 2, 3))))
        write(tmp_path / name, messages)
    first, mine = tmp_path / "model.npz", tmp_path / "mine.npz"
    code, out, errors = train_here(tmp_path / "a.bag", "--output", first, "--components", "2", "--json")
    assert code == 0, errors
    document = json.loads(out)
    assert document["components"] == 2 and document["samples"] == 60 == document["bags"][0]["samples"]
    assert set(document["coverage"]) == {"1", "2"} and "2" in document["bic"]
    # a person's own bag joins the samples that the model keeps; the first one again is noticed
    code, _, errors = train_here(tmp_path / "b.bag", tmp_path / "a.bag", "--add", first, "--output", mine)
    assert code == 0 and len(errors) == 1 and "same bag as a.bag" in errors[0]
    model = TaskModel.load(tmp_path / "mine.npz")
    assert len(model.training.samples) == 120
    assert [entry["file"] for entry in model.training.provenance["bags"]] == ["a.bag", "b.bag"]
    # --add BAG: into the model --output
    code, _, errors = train_here("--add", tmp_path / "b.bag", "--output", first)
    assert code == 0 and errors == [] and len(TaskModel.load(first).training.samples) == 120


def test_one_bag_that_gives_nothing_is_one_line(tmp_path, train_here):
    model = tmp_path / "model.npz"
    for name, messages, reason in (
        ("standing.bag", driving(v=0.0, w=0.0), "all its moments are left out: 49 standing"),
        ("short.bag", driving(2.0), "19 samples are too few for 3 components: at least 54 are needed"),
        ("no_odometry.bag", [entry for entry in driving() if entry[0] != "/odom"], "no odometry on topic 'odom'"),
    ):
        code, out, errors = train_here(write(tmp_path / name, messages), "--output", model)
        assert code == 1 and out == "" and len(errors) == 1
        assert errors[0].startswith("train: %s: %s" % (tmp_path / name, reason))
        assert not model.exists()


def test_a_long_bag_beside_a_short_one_trains(tmp_path, train_here):
    # 79 and 19 samples: without the long bag 19 could not hold three components; fifths are left out instead
    paths = [write(tmp_path / name, driving(seconds)) for name, seconds in (("long.bag", 8.0), ("short.bag", 2.0))]
    code, out, errors = train_here(*paths, "--output", tmp_path / "m.npz", "--json")
    assert code == 0 and errors == [] and json.loads(out)["left_out"] == "fifth of the samples"
    # 59 samples: a fifth left out, 47 remain
    code, _, errors = train_here(write(tmp_path / "a.bag", driving(6.0)), "--output", tmp_path / "n.npz")
    assert code == 1 and "a.bag: leaving out part 1 of 5 to judge the fit: 47 samples are too few" in errors[0]
    assert not (tmp_path / "n.npz").exists()


def test_a_bag_is_added_to_the_shipped_model_where_there_is_no_own(tmp_path, train_here, monkeypatch):
    monkeypatch.setattr(training, "AUTO_COMPONENTS", (1,))  # BIC of all K takes its time
    path, own = write(tmp_path / "a.bag", driving(8.0)), tmp_path / "mine.npz"
    code, _, errors = train_here("--add", path, "--output", own, "--components", "1")
    assert code == 0 and errors == []
    assert len(TaskModel.load(own).training.samples) == len(TaskModel.load("paper").training.samples) + 79


def test_a_model_is_not_written_over_a_recording(tmp_path, train_here):
    # "--output mine/*.bag": the shell puts the recordings in the model's place
    first, second = (write(tmp_path / name, driving(6.0)) for name in ("a.bag", "b.bag"))
    before = first.read_bytes()
    code, _, errors = train_here("--output", first, second)
    assert code == 2 and len(errors) == 1 and "--output: %s is a bag's name" % first in errors[0]
    assert first.read_bytes() == before


def test_bad_bags_are_named_and_the_others_count(tmp_path, train_here):
    good = write(tmp_path / "good.bag", driving(8.0))
    (tmp_path / "bad.bag").write_bytes(b"")
    document = tmp_path / "train.json"
    code, _, errors = train_here(tmp_path, good, "--output", tmp_path / "m.npz", "--json-file", document)
    assert code == 0
    assert errors == ["train: %s: is empty" % (tmp_path / "bad.bag"),
                      "train: %s: is the same bag as good.bag: left out" % good]
    entries = json.loads(document.read_text())["bags"]
    assert [(Path(entry["file"]).name, entry["samples"]) for entry in entries] == [
        ("good.bag", 79), ("bad.bag", 0), ("good.bag", 0)]


def test_base_models_that_cannot_be_added_to_are_refused(tmp_path, train_here):
    path = write(tmp_path / "a.bag", driving(8.0))
    (tmp_path / "base.npz").write_bytes(b"rubbish")
    for base in (tmp_path / "base.npz", tmp_path / "none.npz"):
        code, _, errors = train_here(path, "--add", base, "--output", tmp_path / "m.npz")
        assert code == 1 and len(errors) == 1 and str(base) in errors[0]
    assert not (tmp_path / "m.npz").exists()


@pytest.mark.skipif(not LASER_BAG.exists(), reason="../shared/data/laser_bag is not here")
def test_a_real_bag_with_a_laser(tmp_path):
    found = read(LASER_BAG)
    assert found.source == "raw" and len(found.samples) > 150
    assert (found.samples[:, :3] >= 0).all() and (found.samples[:, :3] <= 2).all()
    assert np.median(found.samples[:, 3]) == pytest.approx(0.2, abs=0.01)  # it drove at 0.2 m/s


@pytest.mark.skipif(not LASER_BAG.exists(), reason="../shared/data/laser_bag is not here")
def test_a_real_bag_trains_with_topic_options(tmp_path, train_here):
    code, out, errors = train_here(
        LASER_BAG, "--topic", "scan=/scan", "--topic", "odom=/odom", "--topic", "cmd_vel=/cmd_vel",
        "--components", "auto", "--output", tmp_path / "m.npz", "--json")
    assert code == 0 and errors == []
    document = json.loads(out)
    assert document["samples"] > 150 and document["bags"][0]["source"] == "raw"
    model = TaskModel.load(tmp_path / "m.npz")
    assert model.components == document["components"] == int(min(document["bic"], key=document["bic"].get))
    # a topic that is not there is said with those that are
    code, _, errors = train_here(LASER_BAG, "--topic", "odom=/wheels", "--output", tmp_path / "n.npz")
    assert code == 1 and "no odometry on topic 'wheels' (topics: cmd_vel, odom, scan" in errors[0]
