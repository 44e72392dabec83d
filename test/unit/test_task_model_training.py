"""Fitting, choosing K, calibration: on samples whose answer is known."""
import numpy as np
import pytest

from wheelchair_shared_control import parameters, training
from wheelchair_shared_control.task_model import MIRROR, TaskModel, TaskModelError

SETTINGS = parameters.load("training").replace(initialisations=2)


def turning_samples(rng, count=600, spread=0.2):
    """Samples whose turn rate depends on the side that is free: left near d_l = 2, right near d_r = 2."""
    d_l, d_f, d_r = rng.uniform(0.1, 2.0, (3, count))
    v = rng.uniform(0.1, 0.5, count)
    w = 0.2 * (d_l - d_r) + spread * rng.normal(size=count)
    return np.column_stack((d_l, d_f, d_r, v, np.maximum(w, 0), np.maximum(-w, 0)))


def test_fit_is_deterministic_and_order_does_not_matter():
    rng = np.random.default_rng(1)
    samples = turning_samples(rng)
    first = training.fit(samples, 3, SETTINGS, seed=4)
    second = training.fit(samples[rng.permutation(len(samples))], 3, SETTINGS, seed=4)
    assert (first.means == second.means).all() and (first.covariances == second.covariances).all()


def test_a_mirrored_set_gives_mirrored_predictions():
    rng = np.random.default_rng(2)
    samples = turning_samples(rng)
    model = training.fit(samples, 3, SETTINGS, seed=4)
    mirrored = training.fit(samples[:, MIRROR], 3, SETTINGS, seed=4)
    inputs = samples[:200, :4]
    here, there = model.predict_many(inputs), mirrored.predict_many(inputs[:, (2, 1, 0, 3)])
    np.testing.assert_allclose(there.sigma_l, here.sigma_r, rtol=1e-6)
    np.testing.assert_allclose(there.sigma_r, here.sigma_l, rtol=1e-6)
    np.testing.assert_allclose(there.mean_l, here.mean_r, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(there.log_density, here.log_density, rtol=1e-6)


def test_samples_that_never_turn_right_keep_a_floor():
    rng = np.random.default_rng(3)
    samples = turning_samples(rng)
    samples[:, 5] = 0.0
    model = training.fit(samples, 3, SETTINGS, seed=4)
    # w_r does not vary at all: what is left is the floor, a share of 1 rad/s
    sigma_r = model.predict_many(samples[:, :4]).sigma_r
    np.testing.assert_allclose(sigma_r, SETTINGS.output_floor * 1.0, rtol=1e-6)


def test_every_component_has_the_floor():
    rng = np.random.default_rng(9)
    model = training.fit(turning_samples(rng), 3, SETTINGS, seed=4)
    smallest = np.sqrt(np.einsum("kii->ki", model.covariances).min(axis=0))
    assert (smallest >= training.floors_of(SETTINGS) * (1 - 1e-9)).all()
    # 5 % of 2 m, 5 % of 0.6 m/s, 2 % of 1 rad/s
    np.testing.assert_allclose(training.floors_of(SETTINGS), [0.1, 0.1, 0.1, 0.03, 0.02, 0.02])


def test_samples_of_a_known_mixture_are_covered_as_they_should_be():
    rng = np.random.default_rng(4)
    # one Gaussian: 68.3 % and 95.4 % of its own samples lie within one and two sigma
    factor = 0.3 * rng.normal(size=(6, 6)) + np.eye(6)
    samples = rng.normal(size=(4000, 6)) @ factor.T
    bag_index = np.repeat(np.arange(8), 500)
    found = training.calibrate(samples, bag_index, 1, SETTINGS, seed=0)
    assert found.samples == 4000
    # 4000 draws: a standard error of 0.7 points
    assert found.coverage["1"] == pytest.approx(0.683, abs=0.03)
    assert found.coverage["2"] == pytest.approx(0.954, abs=0.015)
    assert found.within_sigma["w"] == pytest.approx(0.683, abs=0.03)


def test_each_bag_is_judged_by_a_model_that_has_not_seen_it():
    rng = np.random.default_rng(6)
    samples = turning_samples(rng, count=400, spread=0.02)
    bag_index = np.repeat([0, 1], 200)
    # the second bag turns 2 rad/s more to the left: either half lies far outside of what the other shows
    samples[200:, 4] += 2.0
    apart = training.calibrate(samples, bag_index, 1, SETTINGS, seed=0)
    assert apart.coverage["2"] < 0.01 and apart.samples == 400
    # dealt out evenly, each half shows both
    dealt = training.calibrate(samples, np.arange(400) % 2, 1, SETTINGS, seed=0)
    assert dealt.coverage["2"] > 0.9 and dealt.log_likelihood > apart.log_likelihood


def test_intervals_are_central_ones():
    # of a distribution function the central 68.27 % are 0.1587 to 0.8413, the central 95.45 % 0.0228 to 0.9772
    shares = training.central_shares(np.array([0.01, 0.03, 0.15, 0.16, 0.5, 0.84, 0.85, 0.97, 0.98, 1.0]))
    assert shares == {"1": 0.3, "2": 0.7}


def test_outputs_intervals_are_cut_at_zero():
    # w_l = N(-0.5, 1), w_r = N(3, 1), independent of the input: w_l's interval is -1.5 to 0.5, cut to 0 to 0.5
    model = TaskModel([1.0], [[0, 0, 0, 0, -0.5, 3.0]], [np.eye(6)])
    pairs = [(0.0, 3.0), (0.4, 3.9), (0.6, 4.1), (0.0, 1.9)]
    samples = np.column_stack((np.zeros((4, 4)), pairs))
    # w = w_l - w_r has mean -3.5 and sigma 1.41: from -4.91 to -2.09
    expected = [(True, True, True), (True, True, True), (True, False, False), (False, True, False)]
    np.testing.assert_array_equal(training.within_sigma(model, samples), expected)


def test_too_few_samples_without_a_bag_are_said():
    samples = turning_samples(np.random.default_rng(7), count=60)
    with pytest.raises(TaskModelError, match="leaving out part 1 of 2 to judge the fit: 20 samples are too few"):
        training.calibrate(samples, np.repeat([0, 1], [40, 20]), 3, SETTINGS, seed=0)


def test_the_number_of_components_is_found():
    rng = np.random.default_rng(5)
    samples = np.concatenate([centre + rng.normal(size=(300, 6)) for centre in (0.0, 12.0)])
    model, scores = training.train(samples, np.zeros(600, int), "auto", SETTINGS, 0, {})
    assert model.components == 2
    assert min(scores, key=scores.get) == 2 and len(scores) == 8


def test_too_few_samples_are_refused():
    with pytest.raises(TaskModelError, match="10 samples are too few for 3 components: at least 54"):
        training.fit(np.zeros((10, 6)), 3, SETTINGS, seed=0)


def test_one_bag_cannot_be_left_out():
    assert training.calibrate(np.zeros((100, 6)), np.zeros(100), 1, SETTINGS, 0) is None
