"""The task model: what turn rates the demonstrations showed in a situation, and how freely they varied.

A Gaussian mixture over ``(d_l, d_f, d_r, v, w_l, w_r)`` and its regression on the first four (Goil 2013,
III-C, Eq. 4-7). Distances in metres from the footprint to the nearest occupied cell on the left, in front,
on the right (III-A); ``v`` the forward speed [m/s]; ``w_l = max(w, 0)``, ``w_r = max(-w, 0)`` [rad/s].
"""
import math
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp, ndtr

from wheelchair_shared_control import gmr_kernels
from wheelchair_shared_control.errors import Error

NAMES = ("d_l", "d_f", "d_r", "v", "w_l", "w_r")
UNITS = ("m", "m", "m", "m/s", "rad/s", "rad/s")
INPUTS, OUTPUTS = gmr_kernels.INPUTS, gmr_kernels.OUTPUTS
MIRROR = (2, 1, 0, 3, 5, 4)
VARIANCES = ("paper", "total")
QUANTILE_LEVELS = (0.0, 0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0)
# Beyond these no chair's sensor reads: the input is a fault, not a situation that nobody showed.
DISTANCE_LIMIT, SPEED_LIMIT = 100.0, 10.0
# Squares of larger inputs, whitened, would leave the range of numbers.
INPUT_LIMIT = 1e12


class TaskModelError(Error):
    """A model file, a mixture or an input of the task model is refused."""


class Prediction(NamedTuple):
    """Mean and standard deviation (not scaled) of both turn rates [rad/s]; log density of the input."""

    mean_l: float
    mean_r: float
    sigma_l: float
    sigma_r: float
    log_density: float


class Predictions(NamedTuple):
    """As ``Prediction``, each an array (n,)."""

    mean_l: np.ndarray
    mean_r: np.ndarray
    sigma_l: np.ndarray
    sigma_r: np.ndarray
    log_density: np.ndarray


class Training(NamedTuple):
    """What a model knows about the demonstrations that it was made of.

    ``samples`` (n, 6) float32 in the order of ``NAMES``; ``bag_index`` (n,) says from which of
    ``provenance["bags"]`` each comes; ``floors`` (6,): standard deviation added to every component;
    ``provenance``: what, when, seeds, hashes (plain values as of JSON).
    """

    samples: np.ndarray
    bag_index: np.ndarray
    floors: np.ndarray
    provenance: dict


class TaskModel:
    """A Gaussian mixture and its regression.

    Parameters: ``weights`` (K,), ``means`` (K, 6), ``covariances`` (K, 6, 6) in the order of ``NAMES``;
    ``variance``: "paper" is Eq. 7 of Goil 2013, the weighted mean of the components' conditional
    covariances; "total" adds the spread of their means (law of total variance), as in Calinon's and other
    libraries' regression. Raises TaskModelError for what is no mixture.
    """

    def __init__(self, weights, means, covariances, variance="paper", training=None):
        weights, means, covariances = _checked_mixture(weights, means, covariances)
        if variance not in VARIANCES:
            raise TaskModelError("variance '%s' is unknown: it must be one of %s" % (variance, ", ".join(VARIANCES)))
        self.weights, self.means, self.covariances = weights, means, covariances
        self.variance = variance
        self.training = training
        self._total = variance == "total"
        self._table = gmr_kernels.pack(weights, means, covariances)
        if not np.isfinite(self._table[:, 1:]).all() or (self._table[:, -OUTPUTS:] < 0.0).any():
            raise TaskModelError("a component's covariance is too close to singular to be conditioned")
        self.density_quantiles = {}
        if training is not None and len(training.samples):
            log_densities = self.log_density(training.samples[:, :INPUTS])
            self.density_quantiles = dict(
                zip(QUANTILE_LEVELS, np.quantile(log_densities, QUANTILE_LEVELS).tolist())
            )
            self._sorted_log_densities = np.sort(log_densities)

    @property
    def components(self):
        """K, the number of Gaussians."""
        return len(self.weights)

    @staticmethod
    def load(path, variance="paper"):
        """The model of a file, or of the shipped sets "paper" and "full". Raises TaskModelError."""
        from wheelchair_shared_control import task_model_file

        return task_model_file.load(path, variance)

    def save(self, path):
        """Write the model to ``path`` (npz without pickle), wholly or not at all."""
        from wheelchair_shared_control import task_model_file

        task_model_file.save(path, self)

    # ---- regression ------------------------------------------------------------------------------------

    def predict(self, d_l, d_f, d_r, v):
        """``Prediction`` for one situation. Raises TaskModelError where an input is not a finite number."""
        # written so that NaN fails every comparison
        if not (abs(d_l) < INPUT_LIMIT and abs(d_f) < INPUT_LIMIT and abs(d_r) < INPUT_LIMIT and abs(v) < INPUT_LIMIT):
            raise TaskModelError("input (%g, %g, %g, %g) is not finite" % (d_l, d_f, d_r, v))
        mean_l, mean_r, var_l, var_r, log_density = gmr_kernels.query(
            self._table, self._total, float(d_l), float(d_f), float(d_r), float(v)
        )
        return Prediction(mean_l, mean_r, math.sqrt(var_l), math.sqrt(var_r), log_density)

    def predict_many(self, inputs):
        """``Predictions`` for ``inputs`` (n, 4) of ``d_l, d_f, d_r, v``. Raises TaskModelError."""
        inputs = _checked_inputs(inputs)
        # one row a quantity, so that each is contiguous for the reader
        out = np.empty((5, len(inputs)))
        gmr_kernels.query_many(self._table, self._total, inputs, out)
        return Predictions(*out)

    def log_density(self, inputs):
        """Logarithm (n,) of the density of ``inputs`` (n, 4) under the demonstrations."""
        return self.predict_many(inputs).log_density

    def conditional(self, inputs):
        """The conditional mixture of both outputs for ``inputs`` (n, 4), before it is collapsed (Eq. 4-6).

        Returns weights h (n, K), means (n, K, 2), covariances (K, 2, 2).
        """
        inputs = _checked_inputs(inputs)
        log_weights = np.empty((len(inputs), self.components))
        means = np.empty((len(inputs), self.components, OUTPUTS))
        gmr_kernels.components(self._table, inputs, log_weights, means)
        log_weights -= logsumexp(log_weights, axis=1, keepdims=True)
        xx, xy = self.covariances[:, :INPUTS, :INPUTS], self.covariances[:, :INPUTS, INPUTS:]
        schur = self.covariances[:, INPUTS:, INPUTS:] - np.swapaxes(xy, 1, 2) @ np.linalg.solve(xx, xy)
        return np.exp(log_weights), means, schur

    def signed_distribution(self, inputs, turn_rates):
        """Distribution function (n,) of the signed turn rate ``w = w_l - w_r`` at ``turn_rates`` (n,)."""
        weights, means, covariances = self.conditional(inputs)
        sigma = np.sqrt(covariances[:, 0, 0] - 2.0 * covariances[:, 0, 1] + covariances[:, 1, 1])
        z = (np.asarray(turn_rates, dtype=float)[:, None] - (means[..., 0] - means[..., 1])) / sigma
        return (weights * ndtr(z)).sum(axis=1)

    def joint_log_density(self, samples):
        """Logarithm (n,) of the density of whole ``samples`` (n, 6)."""
        samples = np.asarray(samples, dtype=float)
        terms = np.empty((len(samples), self.components))
        for k in range(self.components):
            lower = np.linalg.cholesky(self.covariances[k])
            z = np.linalg.solve(lower, (samples - self.means[k]).T)
            terms[:, k] = np.log(self.weights[k]) - 0.5 * (z**2).sum(axis=0) - np.log(np.diag(lower)).sum()
        return logsumexp(terms, axis=1) - 0.5 * len(NAMES) * np.log(2.0 * np.pi)

    # ---- have we seen anything like this? --------------------------------------------------------------

    def density_rank(self, log_density):
        """Share of the demonstrated samples, 0 to 1, whose input was less dense than ``log_density``."""
        if not self.density_quantiles:
            raise TaskModelError("the model does not know its demonstrations: it cannot say what they showed")
        found = np.searchsorted(self._sorted_log_densities, log_density, side="left")
        return found / len(self._sorted_log_densities)

    def seen(self, d_l, d_f, d_r, v, level=0.05):
        """Whether anything like this was demonstrated: denser than the ``level`` quantile of the samples."""
        return bool(self.density_rank(self.predict(d_l, d_f, d_r, v).log_density) >= level)

    def mirrored(self):
        """The model of the mirrored demonstrations: left and right exchanged."""
        order = list(MIRROR)
        training = self.training
        if training is not None:
            training = training._replace(samples=training.samples[:, order], floors=training.floors[order])
        return TaskModel(
            self.weights, self.means[:, order], self.covariances[:, order][:, :, order], self.variance, training
        )


def refusal(d_l, d_f, d_r, v):
    """Why this cannot be a situation of a chair (text), or "" where it can."""
    for name, value in zip(NAMES, (d_l, d_f, d_r)):
        if not math.isfinite(value):
            return "%s is %g: it must be a finite distance" % (name, value)
        if value < 0.0 or value > DISTANCE_LIMIT:
            return "%s is %g m: it must be 0 to %g m" % (name, value, DISTANCE_LIMIT)
    if not math.isfinite(v):
        return "v is %g: it must be a finite speed" % v
    if v < 0.0 or v > SPEED_LIMIT:
        return "v is %g m/s: it must be 0 to %g m/s" % (v, SPEED_LIMIT)
    return ""


def _checked_inputs(inputs):
    inputs = np.ascontiguousarray(inputs, dtype=float)
    if inputs.ndim != 2 or inputs.shape[1] != INPUTS:
        raise TaskModelError("inputs have shape %s: it must be (n, %d)" % (inputs.shape, INPUTS))
    if inputs.size and not np.abs(inputs).max() < INPUT_LIMIT:
        raise TaskModelError("an input is not finite")
    return inputs


def _checked_mixture(weights, means, covariances):
    weights = np.array(weights, dtype=float)
    means = np.array(means, dtype=float)
    covariances = np.array(covariances, dtype=float)
    size = len(NAMES)
    if weights.ndim != 1 or not len(weights):
        raise TaskModelError("weights have shape %s: it must be (K,)" % (weights.shape,))
    if means.shape != (len(weights), size) or covariances.shape != (len(weights), size, size):
        raise TaskModelError(
            "means %s and covariances %s do not fit %d components of %d features"
            % (means.shape, covariances.shape, len(weights), size)
        )
    for name, values in (("weights", weights), ("means", means), ("covariances", covariances)):
        if not np.isfinite(values).all():
            raise TaskModelError("%s are not finite" % name)
    if (weights < 0.0).any() or abs(weights.sum() - 1.0) > 1e-6:
        raise TaskModelError("weights sum to %g: they must be positive and sum to 1" % weights.sum())
    scale = np.sqrt(np.abs(np.einsum("kii->ki", covariances)))
    with np.errstate(divide="ignore", invalid="ignore"):
        asymmetry = np.abs(covariances - np.swapaxes(covariances, 1, 2)) / (scale[:, :, None] * scale[:, None, :])
    if not (asymmetry < 1e-6).all():
        raise TaskModelError("a covariance is not symmetric, or has an empty diagonal")
    covariances = 0.5 * (covariances + np.swapaxes(covariances, 1, 2))
    try:
        np.linalg.cholesky(covariances)
    except np.linalg.LinAlgError:
        raise TaskModelError("a covariance is not positive definite")
    return weights / weights.sum(), means, covariances
