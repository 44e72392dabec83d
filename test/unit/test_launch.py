"""Launch files: they parse, and what they give to each node passes that node's own check."""
import itertools
import os
import shutil
from pathlib import Path

import pytest

from wheelchair_shared_control import parameters
from wheelchair_shared_control.experiments import options

roslaunch = pytest.importorskip("roslaunch", reason="roslaunch is not installed")
import rospkg  # noqa: E402 - comes with roslaunch

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "wheelchair_shared_control"
LAUNCH = sorted(path.name for path in (ROOT / "launch").glob("*.launch"))


@pytest.fixture(autouse=True)
def package_path(monkeypatch):
    """``$(find ...)`` means this checkout, whether or not a workspace is sourced."""
    path = os.pathsep.join([str(ROOT), *rospkg.get_ros_paths()])
    monkeypatch.setenv("ROS_PACKAGE_PATH", path)
    monkeypatch.delenv("CMAKE_PREFIX_PATH", raising=False)
    # roslaunch looks packages up once a process
    from roslaunch import substitution_args

    monkeypatch.setattr(substitution_args, "_rospack", None)


def load(name, *arguments):
    """What roslaunch makes of a launch file: ({node name: node}, {node name: its private parameters})."""
    config = roslaunch.config.ROSLaunchConfig()
    loader = roslaunch.xmlloader.XmlLoader(resolve_anon=True)
    loader.load(str(ROOT / "launch" / name), config, argv=list(arguments), verbose=False)
    assert not config.config_errors
    nodes = {node.name: node for node in config.nodes}
    given = {}
    for name in nodes:
        given[name] = nested = {}
        prefix = "/%s/" % name
        for key, parameter in config.params.items():
            if key.startswith(prefix):
                *heads, last = key[len(prefix):].split("/")
                level = nested
                for head in heads:
                    level = level.setdefault(head, {})
                level[last] = parameter.value
    return nodes, given


def settings(name, *arguments):
    """The checked settings of every node of ours."""
    nodes, given = load(name, *arguments)
    ours = [node.name for node in nodes.values() if node.package == PACKAGE]
    return {node: parameters.load(nodes[node].type, given[node], node) for node in ours}


@pytest.mark.parametrize("name", LAUNCH)
def test_every_launch_file_parses_and_its_nodes_exist(name):
    nodes, _ = load(name)
    for node in nodes.values():
        if node.package == PACKAGE:
            assert os.access(str(ROOT / "nodes" / node.type), os.X_OK), node.type


@pytest.mark.parametrize("name", ["demo.launch", "shared_control.launch", "simulation.launch"])
def test_every_node_accepts_what_the_launch_file_gives_it(name):
    checked = settings(name)
    assert checked


@pytest.mark.parametrize("scene, user", list(zip(itertools.cycle(options.SCENES), options.USERS)))
def test_demo_knows_all_scenes_and_users(scene, user):
    checked = settings("demo.launch", "scene:=" + scene, "user:=" + user)
    assert checked["simulator"].scene.scene == checked["simulated_user"].scene.scene == scene
    assert checked["simulated_user"].user == user


def test_arguments_reach_the_nodes():
    checked = settings(
        "demo.launch", "seed:=7", "door_width:=0.8", "clutter:=true", "person:=true", "camera:=160x120", "guard:=off",
        "policy:=distance", "start_distance:=2.5", "start_heading:=-30:15", "dead_time:=0.5", "lag:=0.2",
        "model:=full", "drift:=0", "side:=1", "start_pose:=-2.5, 0.1, 0.2", "detector:=truth",
        "referee:=true", "result_file:=result.json",
    )
    simulator = checked["simulator"]
    assert simulator.scene.seed == 7
    assert simulator.scene.door_width == 0.8
    assert simulator.scene.clutter and simulator.person
    assert (simulator.camera_width, simulator.camera_height) == (160, 120)
    assert list(simulator.scene.start_distance) == [2.5, 2.5]
    assert list(simulator.scene.start_heading) == [-30, 15]
    assert list(simulator.scene.start_pose) == [-2.5, 0.1, 0.2]
    assert simulator.odometry.factor == 0.0
    # The simulated user stands before the same door as the simulator's chair.
    assert checked["simulated_user"].scene == checked["referee"].scene == simulator.scene
    assert checked["referee"].result_file == "result.json"
    for name in ("simulator", "move_base", "blender"):
        assert checked[name].wheelchair.actuation.dead_time == 0.5
        assert checked[name].wheelchair.actuation.lag == 0.2
    assert not checked["blender"].guard
    assert checked["blender"].policy == "distance"
    assert checked["task_model"].model == "full"
    assert checked["simulated_user"].button == "at_once"


@pytest.mark.parametrize("policy, model", [("learned_variance", "paper"), ("learned_confidence", "full")])
def test_each_policy_asks_its_own_model(policy, model):
    assert settings("shared_control.launch", "policy:=" + policy)["task_model"].model == model


@pytest.mark.parametrize(
    "argument, node, key",
    [("guard:=perhaps", "blender", "guard"), ("camera:=wide", "simulator", "camera_width"),
     ("seed:=x", "simulator", "scene/seed"), ("dead_time:=-1", "simulator", "wheelchair/actuation/dead_time")],
)
def test_a_bad_argument_is_refused_by_the_node_that_gets_it(argument, node, key):
    _, given = load("demo.launch", argument)
    with pytest.raises(parameters.ParameterError, match=key):
        parameters.load(node, given[node], node)


@pytest.mark.parametrize("planner", options.PLANNERS)
def test_a_planner_is_started_by_its_name_in_the_slot_and_under_the_interface_of_move_base(planner):
    nodes, _ = load("demo.launch", "planner:=" + planner)
    assert nodes["move_base"].type == "move_base"
    assert settings("demo.launch", "planner:=" + planner)["move_base"].base_local_planner == planner


def test_planner_none_leaves_the_slot_free():
    assert "move_base" not in load("shared_control.launch", "planner:=none")[0]
    assert "move_base" in load("shared_control.launch")[0]


def test_the_planner_alone_hears_no_user():
    assert dict(load("shared_control.launch", "policy:=planner")[0]["move_base"].remap_args)["user/cmd_vel"] \
        != dict(load("shared_control.launch")[0]["move_base"].remap_args)["user/cmd_vel"]


def test_a_chair_has_no_simulator_and_its_topics_are_arguments():
    nodes, _ = load("shared_control.launch", "odom:=/base/odom", "cmd_vel:=/base/cmd_vel", "ranges:=sonar",
                    "costmap:=map")
    assert not {"simulator", "simulated_user"} & set(nodes)
    remaps = dict(nodes["blender"].remap_args)
    assert remaps["odom"] == "/base/odom"
    assert remaps["cmd_vel"] == "/base/cmd_vel"
    assert remaps["ir/left_rear"] == "sonar/left_rear"
    for suffix in ("", "_updates", "_surface"):
        assert remaps["move_base/local_costmap/costmap" + suffix] == "map" + suffix
    # The planner never reaches the base by itself.
    assert dict(nodes["move_base"].remap_args)["cmd_vel"] == "planner/cmd_vel"


def test_a_chair_without_rangers_says_so_once():
    checked = settings("demo.launch", "rangers:=false")
    assert not checked["blender"].rangers
    assert checked["move_base"].local_costmap.observation_sources == "camera"
    checked = settings("demo.launch")
    assert checked["blender"].rangers
    assert "rangers" in checked["move_base"].local_costmap.observation_sources


def test_a_folder_of_one_s_own_configuration_takes_the_place_of_ours(tmp_path):
    shutil.copytree(str(ROOT / "config"), str(tmp_path / "config"))
    changes = (("wheelchair.yaml", "width: 0.65", "width: 0.60"), ("blender.yaml", "rate: 30", "rate: 40"))
    for name, before, after in changes:
        path = tmp_path / "config" / name
        assert before in path.read_text()
        path.write_text(path.read_text().replace(before, after))
    checked = settings("shared_control.launch", "config:=%s" % (tmp_path / "config"))
    assert checked["blender"].rate == 40
    for name in ("move_base", "blender", "doorway_assistant"):
        assert checked[name].wheelchair.footprint.width == 0.60


@pytest.mark.parametrize("pad, assist, cancel", [("ps3_kernel", 0, 1), ("ps3_sixad", 14, 13)])
def test_the_pad_says_which_button_is_x(pad, assist, cancel):
    button = settings("shared_control.launch", "pad:=" + pad)["doorway_assistant"].button
    assert (button.assist, button.cancel) == (assist, cancel)
