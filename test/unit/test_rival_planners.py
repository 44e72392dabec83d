"""The rival planners: their formulae by hand, and drives in drawn worlds that show what they are like."""
import numpy as np
import pytest
from navigation_scenes import SETTINGS, Drive, door, line, snapshot

from wheelchair_shared_control import parameters
from wheelchair_shared_control.experiments import options
from wheelchair_shared_control.planning import bezier, clearance, planners, potential_field
from wheelchair_shared_control.planning.navigation import ABORTED, SUCCEEDED, Navigator

GOAL = (1.0, 0.0, 0.0)


def drive(name, walls, start, **changes):
    """A Drive whose slot is filled by planner ``name``."""
    settings = SETTINGS.replace(**changes) if changes else SETTINGS
    result = Drive(walls, start, settings)
    result.navigator = planners.make(settings, name)
    return result


def test_every_name_of_the_options_is_a_planner_and_nothing_else_is():
    assert set(planners.TABLE) == set(options.PLANNERS)
    assert all(isinstance(planners.make(SETTINGS, name), Navigator) for name in options.PLANNERS)
    assert type(planners.make(SETTINGS)) is Navigator  # what the node starts without being told
    with pytest.raises(planners.PlannerError, match="must be one of move_base, potential_field, bezier"):
        planners.make(SETTINGS, "teleport")
    with pytest.raises(parameters.ParameterError, match="base_local_planner.*must be one of"):
        SETTINGS.replace(base_local_planner="teleport")


@pytest.mark.parametrize("name", ["potential_field", "bezier"])
def test_a_rival_keeps_the_navigator_s_rules(name):
    one = drive(name, np.zeros((0, 2)), (-1.0, 0.0, 0.0))
    assert one.to(GOAL, limit=30.0).status == SUCCEEDED
    two = drive(name, np.zeros((0, 2)), (-1.0, 0.0, 0.0))
    two.navigator.set_goal(GOAL, 0.0)
    stale = two.tick(stamp=-2.0)
    assert stale.command == (0.0, 0.0) and "costmap is 2.0 s old" in stale.reason


# ---- potential_field ---------------------------------------------------------------------------------------


def test_repulsion_is_khatib_s():
    own = SETTINGS.replace(**{"potential_field/reach": 0.4, "potential_field/repulsion": 0.002}).potential_field
    # (1 / 0.2 - 1 / 0.4) / 0.2^2 = 2.5 / 0.04 = 62.5, times 0.002
    assert potential_field.repulsion(0.2, np.array([0.0, -1.0]), own) == pytest.approx((0.0, -0.125))
    assert not potential_field.repulsion(0.4, np.array([0.0, -1.0]), own).any()


def test_the_goal_attracts_and_a_wall_beside_repels():
    navigator = planners.make(SETTINGS, "potential_field")
    navigator.set_goal((3.0, 0.0, 0.0), 0.0)
    free = clearance.make_field(snapshot(np.zeros((0, 2)), (0.0, 0.0, 0.0), 0.0))
    assert navigator.push(free, np.zeros(3)) == pytest.approx((1.0, 0.0))
    # turned left by 30 degrees: the goal's front edge, 3.70 m ahead, is seen from the own one at (0.606, 0.35)
    along, across = navigator.push(free, np.array([0.0, 0.0, np.pi / 6.0]))
    angle = np.arctan2(-0.35, 3.70 - 0.70 * np.cos(np.pi / 6.0)) - np.pi / 6.0
    assert (along, across) == pytest.approx((np.cos(angle), np.sin(angle)))
    walled = clearance.make_field(snapshot(line(-2.0, 0.5, 3.0, 0.5), (0.0, 0.0, 0.0), 0.0))
    along, across = navigator.push(walled, np.zeros(3))
    assert across < -0.005 and along == pytest.approx(1.0, abs=0.05)  # away from a wall on the left


def test_a_potential_field_stands_in_its_local_minimum_and_gives_up():
    # a wall across the straight way: where attraction and repulsion are equal, there is no way on
    walled = drive("potential_field", line(0.0, -1.5, 0.0, 1.5), (-2.0, 0.0, 0.0), oscillation_timeout=4.0)
    decision = walled.to(GOAL, limit=30.0)
    assert decision.status == ABORTED and "no progress" in decision.reason
    assert walled.least > 0.02 and walled.pose[0] < -0.7


# ---- bezier ------------------------------------------------------------------------------------------------


def test_the_curve_leaves_along_the_heading_and_arrives_along_the_normal():
    poses = bezier.curve((0.0, 0.0, 0.5), (2.0, 1.0, -0.2), 0.35, 0.5)
    assert poses[0] == pytest.approx((0.0, 0.0, 0.5)) and poses[-1] == pytest.approx((2.0, 1.0, -0.2))
    # Mirrored ends: the middle B(1/2) = (P0 + 3 P1 + 3 P2 + P3) / 8 is the top, y = 6 * 0.6 sin 1 / 8
    arch = bezier.curve((0.0, 0.0, 1.0), (2.0, 0.0, -1.0), 0.3, 0.3)
    assert arch[:, 1].max() == pytest.approx(0.45 * np.sin(1.0), abs=0.01)


def test_a_bezier_crosses_the_door_square():
    crossing = drive("bezier", door(0.90), (-2.2, 0.5, 0.2))
    assert crossing.to(GOAL, limit=25.0).status == SUCCEEDED
    assert crossing.least > 0.03
    at_door = min(crossing.poses, key=lambda pose: abs(pose[0]))
    assert abs(at_door[1]) < 0.08 and abs(at_door[2]) < 0.1


def test_a_bezier_gives_up_where_no_curve_is_free():
    walled = drive("bezier", line(0.0, -3.0, 0.0, 3.0), (-2.0, 0.0, 0.0), planner_patience=0.5)
    decision = walled.to(GOAL, limit=20.0)
    assert decision.status == ABORTED and "no curve" in decision.reason and walled.least > 0.2
