"""Parameters are refused with the key and the limit, one line."""
import copy
import pickle

import pytest

from wheelchair_shared_control import parameters
from wheelchair_shared_control.parameters import ParameterError


def given(**changes):
    """A node's parameters of group move_base, with some set: local_costmap__width=3.0."""
    nested = copy.deepcopy(parameters._defaults("move_base"))
    for key, value in changes.items():
        *heads, last = key.split("__")
        level = nested
        for head in heads:
            level = level[head]
        level[last] = value
    return nested


def refused(nested):
    with pytest.raises(ParameterError) as error:
        parameters.load("move_base", nested, "/move_base")
    text = str(error.value)
    assert text.startswith("/move_base: ") and "\n" not in text
    return text


@pytest.mark.parametrize("group", [
    "move_base", "blender", "simulator", "task_model", "training", "doorway_detector", "doorway_assistant",
    "teleop", "joystick", "simulated_user", "referee", "scene", "users", "wheelchair",
])
def test_the_shipped_numbers_are_within_their_limits(group):
    assert parameters.load(group).as_dict()


@pytest.mark.parametrize("changes, key, limit", [
    ({"controller_frequency": 0.0}, "'controller_frequency' is 0.0", "at least 2 Hz"),
    ({"controller_frequency": 1e9}, "'controller_frequency' is 1000000000.0", "at most 100 Hz"),
    ({"controller_frequency": float("nan")}, "'controller_frequency' is nan", "finite"),
    ({"controller_frequency": "fast"}, "'controller_frequency' is 'fast'", "a number"),
    ({"controller_frequency": True}, "'controller_frequency' is True", "a number"),
    ({"local_costmap__width": 0.1}, "'local_costmap/width' is 0.1", "at least 2 m"),
    ({"local_costmap__rolling_window": False}, "'local_costmap/rolling_window' is False", "one of True"),
    ({"planner__max_expansions": 1.5}, "'planner/max_expansions' is 1.5", "a whole number"),
    ({"local_costmap__observation_sources": 3}, "'local_costmap/observation_sources' is 3", "text"),
    ({"wheelchair__footprint__width": -1.0}, "'wheelchair/footprint/width' is -1.0", "at least 0.3 m"),
    ({"local_costmap__camera__data_type": "Sonar"}, "'local_costmap/camera/data_type' is 'Sonar'", "one of Image"),
])
def test_a_value_beyond_its_limit(changes, key, limit):
    text = refused(given(**changes))
    assert key in text and limit in text


def test_an_unknown_name_and_a_missing_one():
    assert "unknown parameter 'controler_frequency'" in refused(given(controler_frequency=20.0))
    nested = given()
    del nested["planner"]["sim_time"]
    assert "parameter 'planner/sim_time' is missing" in refused(nested)
    nested = given(local_costmap__observation_sources="camera lidar")
    assert "'local_costmap/lidar/" in refused(nested)


def test_a_number_as_users_of_yaml_write_it():
    assert parameters.load("move_base", given(controller_frequency="2e1")).controller_frequency == 20.0


CHAIR = [[0.7, 0.325], [0.7, -0.325], [-0.35, -0.325], [-0.35, 0.325]]


@pytest.mark.parametrize("corners", [[], "", CHAIR, CHAIR[::-1], str(CHAIR)])
def test_the_outline_may_be_said_again_as_for_the_cpp_node(corners):
    assert parameters.load("move_base", given(local_costmap__footprint=corners))


@pytest.mark.parametrize("corners", [
    [[0.5, 0.3], [0.5, -0.3], [-0.5, -0.3], [-0.5, 0.3]], CHAIR[:3], CHAIR + [[0.9, 0.0]], [1.0, 2.0], [["a", "b"]],
    "[[0.7", "0.5",
])
def test_another_outline_is_refused(corners):
    assert "'local_costmap/footprint' is" in refused(given(local_costmap__footprint=corners))


@pytest.mark.parametrize("changes, says", [
    ({"local_costmap__floor_near": 3.0}, "'local_costmap/floor_near' is 3, but must be below 'floor_far', 3 m"),
    ({"local_costmap__camera__min_obstacle_height": 2.0}, "min_obstacle_height' is 2, but must be below"),
    ({"local_costmap__camera__topic": ""}, "'local_costmap/camera/topic' is empty"),
    ({"local_costmap__global_frame": ""}, "'local_costmap/global_frame' is empty"),
])
def test_numbers_that_contradict_each_other(changes, says):
    assert says in refused(given(**changes))


def test_settings_are_read_only_and_travel_to_other_processes():
    settings = parameters.load("move_base")
    with pytest.raises(AttributeError):
        settings.planner_frequency = 1.0
    with pytest.raises(ParameterError, match="unknown parameter 'planer'"):
        settings.replace(planer=1.0)
    with pytest.raises(ParameterError, match="at most 20 m"):
        settings.replace(**{"local_costmap/width": 30.0})
    changed = settings.replace(**{"local_costmap/width": 8.0})
    assert changed.local_costmap.width == 8.0 and settings.local_costmap.width == 6.0
    assert pickle.loads(pickle.dumps(changed)) == changed != settings


def test_a_bad_file_is_named(tmp_path):
    path = tmp_path / "x.yaml"
    for text in ("a: [1", "- 1\n", "\x00"):
        path.write_text(text)
        with pytest.raises(ParameterError, match="x.yaml: ") as error:
            parameters.read_yaml(path)
        assert "\n" not in str(error.value)
    with pytest.raises(ParameterError, match="cannot be read"):
        parameters.read_yaml(tmp_path / "none.yaml")


def test_a_node_ends_with_one_line(capsys):
    with pytest.raises(SystemExit) as end:
        parameters.load_or_exit("move_base", given(controller_patience=-1.0), "/move_base")
    assert end.value.code == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "'controller_patience'" in said
