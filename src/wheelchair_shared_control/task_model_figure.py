"""A figure of what a task model learned: sigma over the feature space, the samples, and where there are none."""
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np

from wheelchair_shared_control.command_line import OutputError

matplotlib.use("Agg")
import matplotlib.pyplot as plt

STEPS = 81
NAMES = ("distance left $d_l$ [m]", "distance ahead $d_f$ [m]", "distance right $d_r$ [m]", "speed $v$ [m/s]")
BOTH_SIDES = "distance on both sides $d_l = d_r$ [m]"
PACES = (0.3, 0.9)  # quantiles of the speed: the slow and the moderate pace (Goil 2013, IV-C)
MISSING_LEVEL = 0.05
# a sample this near counts as part of a slice: m, m/s
NEAR, NEAR_SPEED = 0.3, 0.1


class Slice(NamedTuple):
    """A plane through the inputs: axis ``x`` across, axes ``ys`` upwards together, ``fixed`` {axis: value}."""

    title: str
    x: int
    ys: tuple
    fixed: dict


def draw(model, path):
    """Draw ``model`` into the image file ``path``. Raises OutputError."""
    samples = model.training.samples.astype(float)
    slices = _slices(samples)
    grids = [_sigmas(model, one, samples) for one in slices]
    top = max(np.max(np.where(seen, sigma, 0.0)) for _, _, sigmas, seen in grids for sigma in sigmas)
    figure, axes = plt.subplots(
        2, len(slices), figsize=(1.5 + 4.0 * len(slices), 8), constrained_layout=True, squeeze=False)
    for column, (one, (xs, ys, sigmas, seen)) in enumerate(zip(slices, grids)):
        dots = samples[_near(one, samples)]
        for row, side in enumerate(("left", "right")):
            axis = axes[row, column]
            image = axis.pcolormesh(xs, ys, sigmas[row], cmap="viridis", vmin=0.0, vmax=top or 1.0, shading="nearest")
            if not seen.all():
                hatch = axis.contourf(xs, ys, np.where(seen, 0.0, 1.0), levels=[0.5, 1.5], colors=["white"], alpha=0.75)
                hatch.set(hatch="////", edgecolor="0.55", linewidth=0.0)
            # many samples lie on the frame: a free side reads exactly max_range
            axis.plot(dots[:, one.x], dots[:, one.ys].mean(axis=1), ".", color="black", markersize=2.0, alpha=0.4,
                      clip_on=False, zorder=3)
            axis.set(xlim=(xs[0], xs[-1]), ylim=(ys[0], ys[-1]), xlabel=NAMES[one.x],
                     ylabel=NAMES[one.ys[0]] if len(one.ys) == 1 else BOTH_SIDES)
            axis.set_title(r"$\sigma_%s$, turning %s; %s" % (side[0], side, one.title), fontsize=10)
    bar = figure.colorbar(image, ax=axes, shrink=0.8)
    bar.set_label(r"learned $\sigma$ [rad/s]")
    figure.suptitle(
        "%d components, %d samples. Dots: samples near the slice; hatched: nothing like it was demonstrated"
        % (model.components, len(samples)), fontsize=12,
    )
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(str(path), dpi=110)
    except (OSError, ValueError) as error:
        raise OutputError("%s: cannot be written: %s" % (path, getattr(error, "strerror", None) or error))
    finally:
        plt.close(figure)


def _slices(samples):
    """The planes to show: left against right at each pace, and both sides against the speed."""
    ahead = round(float(np.median(samples[:, 1])), 2)
    what = "%.1f m free ahead" % ahead
    paces = sorted({round(float(v), 2) for v in np.quantile(samples[:, 3], PACES)})
    if paces[-1] - paces[0] < NEAR_SPEED:
        paces = paces[-1:]
    found = [Slice("$v$ = %.2f m/s, %s" % (v, what), 0, (2,), {1: ahead, 3: v}) for v in paces]
    return found + [Slice(what, 3, (0, 2), {1: ahead})]


def _near(one, samples):
    """Which of ``samples`` (n, 6) lie near the plane (n,)."""
    near = np.ptp(samples[:, one.ys], axis=1) < 2.0 * NEAR
    for axis, value in one.fixed.items():
        near &= np.abs(samples[:, axis] - value) < (NEAR_SPEED if axis == 3 else NEAR)
    return near


def _sigmas(model, one, samples):
    """Axes (n,), (n,), both sigmas (2, n, n) [rad/s], and whether anything like it was seen (n, n)."""
    highest = (2.0, 2.0, 2.0, max(0.6, samples[:, 3].max()))
    xs, ys = np.linspace(0.0, highest[one.x], STEPS), np.linspace(0.0, highest[one.ys[0]], STEPS)
    inputs = np.empty((STEPS, STEPS, 4))
    for axis, value in one.fixed.items():
        inputs[..., axis] = value
    inputs[..., one.x] = xs[None, :]
    for axis in one.ys:
        inputs[..., axis] = ys[:, None]
    found = model.predict_many(inputs.reshape(-1, 4))
    shape = (STEPS, STEPS)
    seen = model.density_rank(found.log_density) >= MISSING_LEVEL
    return xs, ys, (found.sigma_l.reshape(shape), found.sigma_r.reshape(shape)), seen.reshape(shape)
