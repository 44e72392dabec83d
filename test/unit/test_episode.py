"""The closed loop without ROS: titled scenes that must come out as their titles say."""
import numpy as np
import pytest

from wheelchair_shared_control.assistance import ASSISTING, MANUAL
from wheelchair_shared_control.experiments import graph, options, results
from wheelchair_shared_control.experiments.episode import Episode
from wheelchair_shared_control.simulation.simulator import Simulator
from wheelchair_shared_control.simulation.world import SceneError
from wheelchair_shared_control.values import Twist

SMALL = options.CAMERAS["160x120"]
CLOSE = dict(start_distance=(1.6, 1.6), start_heading=(0.0, 0.0), start_offset=(0.0, 0.0))
BESIDE = dict(start_distance=(1.2, 1.2), start_heading=(0.0, 0.0), start_offset=(0.9, 0.9))

CASES = [
    ("the planner crosses an open doorway by itself", dict(policy="planner", **CLOSE), "crossed"),
    ("a person crosses into a hallway with the paper's blend", dict(scene="hallway", **CLOSE), "crossed"),
    ("a person who pushes at the wall without a guard hits it", dict(guard=False, **BESIDE), "contact"),
    ("a person who pushes at the wall under the guard stands before it", BESIDE, "standstill"),
]


@pytest.fixture
def push(tmp_path):
    """A user who pushes straight ahead and never asks."""
    path = tmp_path / "push.yaml"
    path.write_text("steps: [{do: push, v: 0.4, w: 0.0}]\n", encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("title, changes, outcome", CASES, ids=[case[0].replace(" ", "_") for case in CASES])
def test_closed_loop(title, changes, outcome, push):
    chosen = options.Options(detector=False, camera=SMALL, **changes)
    if "start_offset" in changes and changes["start_offset"] != (0.0, 0.0):
        chosen = chosen._replace(policy="user", user=push)
    result = Episode(chosen, seed=11).run()
    assert result["outcome"] == outcome, results.sentence(result)
    if outcome != "contact":
        assert result["min_clearance_m"] > 0.0
    if outcome == "standstill":
        assert result["escape_m"] >= 0.1  # the guard never traps the person


def test_equal_seeds_give_equal_bits():
    chosen = options.Options(policy="distance", detector=False, camera=SMALL)
    ticks = []
    for _ in range(2):
        episode = Episode(chosen, seed=3)
        with Simulator(
            episode.world, episode.settings.simulator, 3, episode.setup.start, chosen.camera
        ) as simulator:
            loop = graph.Graph(chosen, episode.setup, 3, episode.settings, simulator)
            rows = []
            for _ in range(150):  # 2.5 s
                loop.tick()
                rows.append(np.concatenate((simulator.truth().pose, loop.state.sent, loop.state[7:10])))
        ticks.append(np.array(rows))
    assert np.abs(ticks[0][-1, :3] - ticks[0][0, :3]).max() > 0.05  # the chair did move
    assert np.array_equal(ticks[0], ticks[1], equal_nan=True)


def test_a_seed_gives_every_policy_the_same_start():
    starts = [Episode(options.Options(policy=policy), seed=5).setup.start for policy in ("user", "planner")]
    assert np.array_equal(*starts)


def test_a_scene_without_a_door_is_refused_by_its_name(tmp_path):
    path = tmp_path / "box.yaml"
    path.write_text(
        "boxes: [{name: b, x: 2.0, y: 0.0, z: 0.5, length: 0.5, width: 0.5, height: 1.0}]\n", encoding="utf-8"
    )
    with pytest.raises(SceneError, match="box.yaml: has no door"):
        Episode(options.Options(scene=str(path)), seed=1)


def test_who_takes_the_stick_after_the_end_is_heard_under_the_planner_alone():
    """``escape_m`` is what a person gets who pulls the stick back; under ``planner`` that ends the assistance."""
    chosen = options.Options(policy="planner", detector=False, camera=SMALL, **CLOSE)
    episode = Episode(chosen, seed=3)
    with Simulator(episode.world, episode.settings.simulator, 3, episode.setup.start, chosen.camera) as simulator:
        loop = graph.Graph(chosen, episode.setup, 3, episode.settings, simulator)
        while loop.assistance.state != ASSISTING:
            assert simulator.time < 5.0
            loop.tick()
        loop.override_user(Twist(-0.3, 0.0))
        until = simulator.time + 4.0
        while simulator.time < until:
            loop.tick()
        assert loop.assistance.state == MANUAL
        assert loop.state.sent[0] < -0.1
