"""Delays from a user's command to the chair's, by hand."""
import numpy as np
import pytest

from wheelchair_shared_control.experiments import latency


def test_each_cause_waits_for_the_first_effect_after_it():
    #  cause  0.00        0.05   0.10
    #  effect     0.004 0.034  0.07      (the last cause has no effect yet)
    assert latency.delays([0.0, 0.05, 0.10], [0.004, 0.034, 0.07]) == pytest.approx([0.004, 0.02])


def test_the_summary_of_a_regular_stretch():
    user = 0.05 * np.arange(101)
    command = np.sort(np.concatenate((user + 0.003, user + 0.036)))
    figures = latency.summary(user, command)
    assert figures["n"] == 101
    assert figures["median_ms"] == pytest.approx(3.0) and figures["p99_ms"] == pytest.approx(3.0)
    assert figures["user_rate"] == pytest.approx(20.0)
    assert figures["longest_gap_ms"] == pytest.approx(33.0)


@pytest.mark.parametrize("user, command", [([], [0.1]), ([0.0, 0.1], []), ([1.0, 1.1], [0.1, 0.2])])
def test_too_little_says_so(user, command):
    with pytest.raises(latency.LatencyError, match="too few"):
        latency.summary(user, command)
