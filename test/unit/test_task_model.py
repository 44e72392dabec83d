"""The task model against other code, against integrals, against answers computed by hand."""
import time

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.stats import multivariate_normal

from wheelchair_shared_control.task_model import TaskModel, TaskModelError, refusal

gmr = pytest.importorskip("gmr", reason="the package gmr is the reference")
LARGEST_CONDITION = 1e6


def random_mixture(rng, components=3):
    """Weights, means, covariances of a random mixture, its covariances well conditioned."""
    while True:
        factors = rng.normal(size=(components, 6, 6))
        covariances = factors @ factors.transpose(0, 2, 1) + 0.01 * np.eye(6)
        if np.linalg.cond(covariances).max() < LARGEST_CONDITION:
            return rng.dirichlet(np.full(components, 2.0)), rng.normal(size=(components, 6)), covariances


def one_gaussian(covariance=None, mean=None):
    return TaskModel([1.0], [np.zeros(6) if mean is None else mean], [np.eye(6) if covariance is None else covariance])


def test_one_gaussian_by_hand():
    # w_l = 0.5 v + noise of variance 0.01, v of variance 4: the rest is independent, of variance 1.
    covariance = np.eye(6)
    covariance[3, 3] = 4.0
    covariance[3, 4] = covariance[4, 3] = 0.5 * 4.0
    covariance[4, 4] = 0.25 * 4.0 + 0.01
    prediction = one_gaussian(covariance, [0, 0, 0, 0, 0.1, 0.2]).predict(3.0, -1.0, 7.0, 0.6)
    assert prediction.mean_l == pytest.approx(0.1 + 0.5 * 0.6)
    assert prediction.mean_r == pytest.approx(0.2)
    assert prediction.sigma_l == pytest.approx(0.1)  # the plus of the printed Eq. 5 would give 1.42
    assert prediction.sigma_r == pytest.approx(1.0)
    # -0.5 (9 + 1 + 49 + 0.36 / 4) - 0.5 log 4 - 2 log(2 pi)
    assert prediction.log_density == pytest.approx(-29.545 - np.log(2.0) - 2.0 * np.log(2.0 * np.pi))


def test_paper_and_total_variance_by_hand():
    # two equally likely components, means of w_l 0 and 1, both of variance 0.04:
    # Eq. 7 keeps 0.04; with the spread of the means it is 0.04 + 0.25.
    covariance = np.diag([1.0, 1.0, 1.0, 1.0, 0.04, 0.04])
    means = np.zeros((2, 6))
    means[1, 4] = 1.0
    for variance, expected in (("paper", 0.04), ("total", 0.29)):
        prediction = TaskModel([0.5, 0.5], means, [covariance] * 2, variance).predict(0, 0, 0, 0)
        assert prediction.mean_l == pytest.approx(0.5)
        assert prediction.sigma_l**2 == pytest.approx(expected)
        assert prediction.sigma_r**2 == pytest.approx(0.04)


def test_total_variance_agrees_with_gmr():
    rng = np.random.default_rng(5)
    for _ in range(1000):
        weights, means, covariances = random_mixture(rng)
        x = rng.normal(size=4) * rng.choice([0.3, 1.0, 3.0])
        model = TaskModel(weights, means, covariances, "total")
        found = model.predict(*x)
        expected = gmr.GMM(3, weights, means, covariances).condition(np.arange(4), x).to_mvn()
        np.testing.assert_allclose(found[:2], expected.mean, rtol=1e-9)
        np.testing.assert_allclose(np.square(found[2:4]), np.diag(expected.covariance), rtol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_variances_agree_with_numerical_integration_of_the_joint_density(seed):
    rng = np.random.default_rng(seed)
    weights, means, covariances = random_mixture(rng)
    x = means[0, :4] + 0.3 * rng.normal(size=4)
    grid = np.linspace(-30.0, 30.0, 1201)
    left, right = np.meshgrid(grid, grid, indexing="ij")
    points = np.concatenate((np.broadcast_to(x, left.shape + (4,)), left[..., None], right[..., None]), axis=-1)

    def moments(density):
        mass = density.sum()
        mean = np.array([(density * left).sum(), (density * right).sum()]) / mass
        square = np.array([(density * left**2).sum(), (density * right**2).sum()]) / mass
        return mass * (grid[1] - grid[0]) ** 2, mean, square - mean**2

    parts = [w * multivariate_normal(m, c).pdf(points) for w, m, c in zip(weights, means, covariances)]
    mass, mean, variance = moments(sum(parts))
    total = TaskModel(weights, means, covariances, "total").predict(*x)
    np.testing.assert_allclose(total[:2], mean, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(np.square(total[2:4]), variance, rtol=1e-7)
    assert total.log_density == pytest.approx(np.log(mass), abs=1e-8)
    # Eq. 7: the same integral for each component alone, weighted by its share h_k of the input's density
    single = [moments(part) for part in parts]
    expected = sum(part_mass * part_variance for part_mass, _, part_variance in single) / mass
    np.testing.assert_allclose(np.square(TaskModel(weights, means, covariances).predict(*x)[2:4]), expected, rtol=1e-7)


def test_density_of_the_signed_turn_rate_integrates_the_joint_one():
    # P(w_l - w_r <= 0.2 | x) by quadrature of one correlated Gaussian
    covariance = np.eye(6)
    covariance[4, 5] = covariance[5, 4] = 0.5
    model = one_gaussian(covariance)
    pair = multivariate_normal([0, 0], covariance[4:, 4:])
    expected, _ = dblquad(lambda right, left: pair.pdf([left, right]), -6, 6, lambda left: left - 0.2, lambda left: 6)
    assert model.signed_distribution([[0, 0, 0, 0]], [0.2])[0] == pytest.approx(expected, abs=1e-6)


def test_far_away_inputs_give_finite_numbers():
    rng = np.random.default_rng(6)
    for variance in ("paper", "total"):
        for _ in range(100):
            model = TaskModel(*random_mixture(rng), variance=variance)
            for x in (rng.choice([-1e6, 1e6], 4), [1e6, 0, 0, 0], [1e-300, 0, 0, 1e6]):
                assert np.isfinite(model.predict(*x)).all()
                assert model.predict(*x).sigma_l > 0.0


def test_one_and_many_are_the_same():
    rng = np.random.default_rng(7)
    for variance in ("paper", "total"):
        model = TaskModel(*random_mixture(rng), variance=variance)
        # more than a block of the kernel, and one far away
        inputs = np.vstack((rng.normal(size=(300, 4)) * 3.0, [[1e6, -1e6, 0.0, 1e6]]))
        many = np.column_stack(model.predict_many(inputs))
        np.testing.assert_allclose(many, [model.predict(*x) for x in inputs], rtol=1e-12)
    assert len(model.predict_many(np.empty((0, 4))).mean_l) == 0


def test_a_component_without_weight_has_no_say():
    means, covariances = np.zeros((2, 6)), np.stack([np.eye(6)] * 2)
    means[0, 4] = 9.0
    prediction = TaskModel([0.0, 1.0], means, covariances, "total").predict(0, 0, 0, 0)
    assert prediction[:4] == pytest.approx((0.0, 0.0, 1.0, 1.0))


def test_mirrored_model_mirrors_its_answers():
    model = TaskModel(*random_mixture(np.random.default_rng(8)))
    here, there = model.predict(0.1, 0.2, 0.3, 0.4), model.mirrored().predict(0.3, 0.2, 0.1, 0.4)
    assert there == pytest.approx((here.mean_r, here.mean_l, here.sigma_r, here.sigma_l, here.log_density))


@pytest.mark.parametrize(
    "change, message",
    [
        (dict(weights=[0.5, 0.6]), "sum to 1.1"),
        (dict(weights=[1.5, -0.5]), "positive"),
        (dict(weights=[[0.5, 0.5]]), "shape"),
        (dict(means=np.zeros((2, 5))), "do not fit"),
        (dict(means=np.full((2, 6), np.nan)), "not finite"),
        (dict(covariances=np.stack([np.eye(6), -np.eye(6)])), "not positive definite"),
        (dict(covariances=np.stack([np.eye(6), np.triu(np.ones((6, 6)))])), "not symmetric"),
        (dict(variance="sigma"), "unknown"),
    ],
)
def test_what_is_no_mixture_is_refused(change, message):
    given = dict(weights=[0.5, 0.5], means=np.zeros((2, 6)), covariances=np.stack([np.eye(6)] * 2))
    given.update(change)
    with pytest.raises(TaskModelError, match=message):
        TaskModel(**given)


def test_inputs_that_are_no_numbers_are_refused():
    model = one_gaussian()
    for bad in (np.nan, np.inf, -np.inf):
        for place in range(4):
            x = [1.0] * 4
            x[place] = bad
            with pytest.raises(TaskModelError, match="not finite"):
                model.predict(*x)
            with pytest.raises(TaskModelError, match="not finite"):
                model.predict_many([x])
    with pytest.raises(TaskModelError, match="shape"):
        model.predict_many([1.0, 2.0, 3.0, 4.0])


@pytest.mark.parametrize(
    "x, culprit",
    [
        ((np.nan, 1, 1, 0.3), "d_l"), ((1, -0.01, 1, 0.3), "d_f"), ((1, 1, np.inf, 0.3), "d_r"),
        ((1, 1, 1, np.nan), "v"), ((1, 1, 1, -0.1), "v"), ((1, 1, 1, 99.0), "v"), ((1e6, 1, 1, 0.3), "d_l"),
    ],
)
def test_situations_that_cannot_be_are_named(x, culprit):
    assert refusal(*x).startswith(culprit + " is")


def test_situations_that_can_be_are_not_refused():
    assert refusal(0.0, 2.0, 0.3, 0.0) == "" and refusal(2, 2, 2, 0.6) == ""


def test_a_query_is_quick_enough_to_be_asked_for_in_every_tick():
    # not a measurement (that is scripts/benchmark): only that nothing slow has crept in
    model = one_gaussian()
    model.predict(1, 1, 1, 0.3)
    started = time.perf_counter()
    for _ in range(1000):
        model.predict(1, 1, 1, 0.3)
    assert time.perf_counter() - started < 0.5
