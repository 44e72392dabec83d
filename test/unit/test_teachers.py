"""What the scripted teachers show: doors of several widths, and as much weave as there is room."""
import collections

import numpy as np
import pytest

from wheelchair_shared_control import parameters, teachers

SETTINGS = parameters.load("teachers")


def styles(set_name, seed=3):
    return {
        (scene, index): teachers.style(set_name, scene, index, SETTINGS, np.random.default_rng([seed, index]))
        for scene in teachers.SCENES for index in range(SETTINGS.teachers_per_scene)
    }


def weave_amplitude(set_name, scene, width, x):
    """Largest turn rate [rad/s] of a teacher on the axis at ``x``, whose hand is steady: that of the weave."""
    settings = SETTINGS.replace(**{"hand/noise": 0.0, "aim/slew": 10.0})
    style = teachers.style(set_name, scene, 0, settings, np.random.default_rng(5))
    style = style._replace(door_width=width, steadiness=1.0, turn_first=False)
    teacher = teachers.Teacher(style, settings, np.random.default_rng(6))
    times = np.arange(0.0, 2.0 * settings.weave_period, 0.05)
    return max(abs(teacher.update(now, np.array([x, 0.0, 0.0])).w) for now in times)


def test_the_paper_s_teachers_drive_one_door():
    assert {style.door_width for style in styles("paper").values()} == {0.90}


def test_every_scene_and_pace_of_the_full_set_shows_narrow_middle_and_wide_doors():
    found = collections.defaultdict(collections.Counter)
    for (scene, _), style in styles("full").items():
        found[scene, style.pace][round(style.door_width, 3)] += 1
    assert len(found) == len(teachers.SCENES) * 2
    for widths in found.values():
        assert widths == {0.80: 1, 1.00: 1, 1.20: 1}


def test_widths_follow_the_parameters():
    settings = SETTINGS.replace(**{"full/narrowest": 0.75, "full/widest": 0.85})
    styles = [teachers.style("full", "open", index, settings, np.random.default_rng(1)) for index in range(6)]
    widths = {style.door_width for style in styles}
    assert sorted(widths) == pytest.approx([0.75, 0.80, 0.85])


@pytest.mark.parametrize("width", [0.80, 0.90, 1.20])
def test_the_full_set_weaves_as_the_room_beside_the_chair_allows(width):
    room = 0.5 * (width - SETTINGS.wheelchair.footprint.width)
    expected = SETTINGS.full.slow.weave * room / SETTINGS.weave_room
    assert weave_amplitude("full", "open", width, 0.0) == pytest.approx(expected, rel=0.03)


def test_the_paper_s_set_weaves_the_same_everywhere():
    assert weave_amplitude("paper", "open", 1.20, 0.0) == pytest.approx(SETTINGS.paper.slow.weave, rel=0.03)


def test_between_the_walls_of_a_hallway_there_is_more_room_to_weave_than_between_the_jambs():
    between_jambs = weave_amplitude("full", "hallway", 0.90, 0.0)
    assert weave_amplitude("full", "hallway", 0.90, SETTINGS.hallway_begin + 0.1) > 1.5 * between_jambs


@pytest.mark.parametrize("changes", [
    {"full/narrowest": 1.3},  # above the widest
    {"full/narrowest": 0.7, "wheelchair/footprint/width": 0.72},
    {"paper/widest": 0.85},
])
def test_doors_that_no_teacher_could_drive_are_refused(changes):
    with pytest.raises(parameters.ParameterError, match="narrowest"):
        SETTINGS.replace(**changes)
