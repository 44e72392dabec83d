"""Smoothness and effort, on profiles whose order or value is known."""
import numpy as np
import pytest

from wheelchair_shared_control.experiments import smoothness

DT = 0.005
TIME = np.arange(0.0, 2.0 + DT / 2, DT)
# minimum-jerk reach of 1 m in 2 s (Flash and Hogan 1985)
S = TIME / 2.0
BELL = (30 * S**2 - 60 * S**3 + 30 * S**4) / 2.0


def test_ldlj_of_a_minimum_jerk_reach():
    # (d2v/dt2) of the reach integrates to 720 / T^5; v_peak = 1.875 / T: ldlj = -ln(720 / 1.875^2) = -5.32
    assert smoothness.ldlj(BELL, DT) == pytest.approx(-np.log(720.0 / 1.875**2), abs=0.05)


def test_sparc_of_a_minimum_jerk_reach_is_about_minus_one_point_four():
    # published for this profile: -1.41 (Balasubramanian 2015)
    assert smoothness.sparc(BELL, DT) == pytest.approx(-1.41, abs=0.02)


def test_a_shaking_chair_is_less_smooth():
    shaking = BELL + 0.1 * np.sin(2 * np.pi * 5.0 * TIME)
    assert smoothness.sparc(shaking, DT) < smoothness.sparc(BELL, DT)
    assert smoothness.ldlj(shaking, DT) < smoothness.ldlj(BELL, DT)


def test_a_chair_that_stood_has_no_smoothness():
    assert np.isnan(smoothness.sparc(np.zeros(100), DT)) and np.isnan(smoothness.ldlj(np.zeros(100), DT))


def test_effort_is_the_way_of_the_stick_per_second():
    # from 0 to full and back within 2 s: a way of 2 deflections in 2 s
    stick = np.column_stack((np.zeros(3), [0.0, 1.0, 0.0]))
    assert smoothness.effort(np.array([0.0, 1.0, 2.0]), stick, (0.6, 1.0)) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "turn, expected",
    [([0.0, 0.5, 1.0], 0), ([0.0, 0.5, 0.45, 0.6], 0), ([0.0, 0.5, -0.5], 1), ([0.0, 0.5, -0.5, 0.5, 0.4], 2)],
)
def test_reversals_count_swings_and_not_the_noise_of_a_hand(turn, expected):
    assert smoothness.reversals(turn) == expected
