"""Samples of demonstrations to a task model: mixture fit, choice of K, calibration on bags left out."""
import warnings
from typing import Dict, NamedTuple

import numpy as np
from scipy.special import ndtr
from sklearn.exceptions import ConvergenceWarning
from sklearn.mixture import GaussianMixture
from threadpoolctl import threadpool_limits

from wheelchair_shared_control.task_model import (
    INPUTS,
    MIRROR,
    NAMES,
    TaskModel,
    TaskModelError,
    Training,
)

# What each feature ranges over on a chair: the features' max_range, and speeds.
SCALES = np.array([2.0, 2.0, 2.0, 0.6, 1.0, 1.0])
REGULARISATION = 0.05
AUTO_COMPONENTS = range(1, 9)
# Fewer samples cannot hold a full covariance of six features for each component.
SAMPLES_PER_COMPONENT = 3 * len(NAMES)


class Calibration(NamedTuple):
    """How honest the model's spread is on bags that it was not trained on.

    ``coverage``: share of held-out samples within the central 68.3 % ("1") and 95.4 % ("2") interval of the
    conditional mixture of ``w``; ``within_sigma``: share within mean +- sigma, of ``w``, and of ``w_l``,
    ``w_r`` with the interval's ends cut at zero, where no turn rate of one side can lie below;
    ``log_likelihood``: mean log density of a held-out sample; ``samples``: how many.
    """

    coverage: Dict[str, float]
    within_sigma: Dict[str, float]
    log_likelihood: float
    samples: int


def fit(samples, components, settings, seed, training=None):
    """``TaskModel`` of ``samples`` (n, 6) with ``components`` Gaussians.

    ``settings``: group ``training``. Every component's covariance gets a floor, relative to what each feature
    ranges over (``SCALES``). A person who turns left has ``w_r`` exactly 0, and a free side reads exactly
    ``max_range``: whole components would have no extent there, their density no limit, and a distance of
    1.9 m would be a world apart from 2.0 m. The fit sees the samples in one order and in one handedness, so
    that neither the order of the bags nor a mirrored set changes the outcome. Raises TaskModelError.
    """
    samples = np.asarray(samples, dtype=float)
    if len(samples) < SAMPLES_PER_COMPONENT * components:
        raise TaskModelError(
            "%d samples are too few for %d components: at least %d are needed"
            % (len(samples), components, SAMPLES_PER_COMPONENT * components)
        )
    mirror = _canonical_side(samples)
    if mirror:
        samples = samples[:, MIRROR]
    samples = samples[np.lexsort(samples.T)]
    centre = samples.mean(axis=0)
    floors = floors_of(settings)
    # the library adds one number to all diagonals: in units of the floors it is the floor of each
    scale = floors / REGULARISATION
    mixture = GaussianMixture(
        components,
        covariance_type="full",
        reg_covar=REGULARISATION**2,
        n_init=settings.initialisations,
        max_iter=settings.iterations,
        tol=settings.tolerance,
        init_params="kmeans",
        random_state=seed,
    )
    # six features: threads cost more than they bring, and add in an order of their own
    with warnings.catch_warnings(), threadpool_limits(1):
        # a component more than the data bear converges slowly, and is then as good as it gets
        warnings.simplefilter("ignore", ConvergenceWarning)
        mixture.fit((samples - centre) / scale)
    # largest component first: k-means numbers them by chance
    order = np.argsort(-mixture.weights_, kind="stable")
    means = mixture.means_[order] * scale + centre
    covariances = mixture.covariances_[order] * scale[:, None] * scale[None, :]
    if mirror:
        means, covariances = means[:, MIRROR], covariances[:, MIRROR][:, :, MIRROR]
    return TaskModel(mixture.weights_[order], means, covariances, training=training)


def floors_of(settings):
    """Standard deviation (6,) that is added to every component, in the features' units."""
    return SCALES * np.repeat([settings.input_floor, settings.output_floor], [INPUTS, len(NAMES) - INPUTS])


def train(samples, bag_index, components, settings, seed, provenance, progress=iter):
    """``TaskModel`` of ``samples`` (n, 6) from bags ``bag_index`` (n,), and BIC by K.

    ``components`` is a number, or "auto" for the K with the smallest BIC. ``progress`` wraps the sequence of K.
    Raises TaskModelError.
    """
    training = Training(
        np.asarray(samples, dtype=np.float32), np.asarray(bag_index), floors_of(settings), dict(provenance)
    )
    # the file keeps single precision; train on what can be read back
    samples = training.samples.astype(float)
    counts = [count for count in AUTO_COMPONENTS if count == 1 or len(samples) >= SAMPLES_PER_COMPONENT * count]
    scores = {}
    for count in progress(counts):
        scores[count] = bic(fit(samples, count, in_short(settings), seed), samples)
    chosen = min(scores, key=scores.get) if components == "auto" else int(components)
    model = fit(samples, chosen, settings, seed, training)
    scores[chosen] = bic(model, samples)
    return model, dict(sorted(scores.items()))


def in_short(settings):
    """Settings for the many fits that only judge: fewer starts."""
    return settings.replace(initialisations=min(settings.initialisations, settings.initialisations_in_short))


def bic(model, samples):
    """Bayesian information criterion (Schwarz 1978) of ``model`` on ``samples`` (n, 6); smaller is better.

    Samples follow each other in time and are not independent: BIC then tends to more components.
    """
    size = len(NAMES)
    numbers = model.components * (1 + size + size * (size + 1) // 2) - 1
    return numbers * np.log(len(samples)) - 2.0 * model.joint_log_density(samples).sum()


def calibrate(samples, bag_index, components, settings, seed, progress=iter):
    """``Calibration`` with each bag left out in turn, or None where there is only one bag.

    ``components`` is a number. ``progress`` wraps the sequence of bags. Raises TaskModelError where too few samples
    are left.
    """
    samples, bag_index = np.asarray(samples, dtype=float), np.asarray(bag_index)
    bags = np.unique(bag_index)
    if len(bags) < 2:
        return None
    distribution, log_density = np.empty(len(samples)), np.empty(len(samples))
    within = np.empty((len(samples), 3), bool)
    for bag in progress(bags):
        held = bag_index == bag
        try:
            model = fit(samples[~held], components, in_short(settings), seed)
        except TaskModelError as error:
            raise TaskModelError("leaving out part %d of %d to judge the fit: %s" % (
                np.searchsorted(bags, bag) + 1, len(bags), error))
        distribution[held] = model.signed_distribution(samples[held, :INPUTS], signed(samples[held]))
        log_density[held] = model.joint_log_density(samples[held])
        within[held] = within_sigma(model, samples[held])
    return Calibration(
        central_shares(distribution),
        dict(zip(("w", "w_l", "w_r"), within.mean(axis=0).tolist())),
        float(log_density.mean()),
        len(samples),
    )


def central_shares(distribution):
    """Share of values whose distribution function (n,) lies in the central 1 and 2 sigma interval."""
    shares = {}
    for sigmas in (1, 2):
        tail = ndtr(-float(sigmas))
        shares[str(sigmas)] = float(np.mean((distribution >= tail) & (distribution <= 1.0 - tail)))
    return shares


def within_sigma(model, samples):
    """Whether w, w_l, w_r (n, 3) of ``samples`` (n, 6) lie within mean +- sigma, w_l and w_r censored at 0."""
    weights, means, covariances = model.conditional(samples[:, :INPUTS])
    mean = (weights[:, :, None] * means).sum(axis=1)
    covariance = np.einsum("nk,kij->nij", weights, covariances)
    signed_sigma = np.sqrt(covariance[:, 0, 0] - 2.0 * covariance[:, 0, 1] + covariance[:, 1, 1])
    columns = [np.abs(signed(samples) - (mean[:, 0] - mean[:, 1])) <= signed_sigma]
    for side in range(2):
        sigma = np.sqrt(covariance[:, side, side])
        low, high = np.maximum(mean[:, side] - sigma, 0.0), np.maximum(mean[:, side] + sigma, 0.0)
        turn_rate = samples[:, INPUTS + side]
        columns.append((turn_rate >= low) & (turn_rate <= high))
    return np.column_stack(columns)


def signed(samples):
    """The signed turn rate ``w = w_l - w_r`` (n,) of ``samples`` (n, 6)."""
    return samples[:, INPUTS] - samples[:, INPUTS + 1]


def _canonical_side(samples):
    """Whether to mirror: a set and its mirror image must be seen as one and the same by the fit."""
    for left, right in ((4, 5), (0, 2)):
        difference = samples[:, left].sum() - samples[:, right].sum()
        if difference:
            return bool(difference < 0.0)
    return False
