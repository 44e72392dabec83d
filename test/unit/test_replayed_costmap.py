"""A bag's sensors through the costmap: which readings make one set, and what is refused as in the live node."""
import math
from types import SimpleNamespace as Message

import numpy as np
import pytest

from wheelchair_shared_control import demonstrations, replayed_costmap
from wheelchair_shared_control.values import RANGERS

TOPICS = demonstrations.topic_names()
ODOMETRY = np.array([[stamp, 0.0, 0.0, 0.0, 0.0, 0.0] for stamp in np.arange(0.0, 5.0, 0.05)])


def header(stamp, frame=""):
    return Message(stamp=Message(sec=int(stamp), nanosec=int(round(stamp % 1 * 1e9))), frame_id=frame)


def replay(main="scan"):
    return replayed_costmap._Replay(TOPICS, main, ODOMETRY, "base_link", None, 10.0)


@pytest.mark.parametrize("mute", [None] + list(RANGERS))
def test_range_readings_are_used_though_a_ranger_is_mute(mute, monkeypatch):
    bag, sets = replay(), []
    monkeypatch.setattr(bag._costmap, "insert_ranges", lambda ranges, pose, source: sets.append(ranges.values))
    for round_ in range(10):
        for index, name in enumerate(RANGERS):
            if name != mute:
                bag.insert(TOPICS["ranges"] + "/" + name, Message(
                    header=header(1.0 + 0.1 * round_ + 0.01 * index), range=0.4, min_range=0.1, max_range=1.5))
    assert len(sets) >= 9
    for values in sets:
        assert [name for name, value in zip(RANGERS, values) if math.isnan(value)] == ([] if mute is None else [mute])


def test_a_tilted_scanner_s_scans_are_refused():
    bag = replay()
    turn = Message(x=math.sin(0.1), y=0.0, z=0.0, w=math.cos(0.1))  # 11.5 degrees about x
    bag.insert(TOPICS["tf_static"], Message(transforms=[Message(
        header=header(0.0, "base_link"), child_frame_id="laser",
        transform=Message(translation=Message(x=0.1, y=0.0, z=0.3), rotation=turn))]))
    bag.insert(TOPICS["scan"], Message(
        header=header(1.0, "laser"), ranges=[1.5] * 11, range_min=0.1, range_max=5.0, angle_min=-0.5,
        angle_increment=0.1))
    stamps, _, notes = bag.result()
    assert not len(stamps) and "tilted by 11 degrees, limit 5" in notes[0]
