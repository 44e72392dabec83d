"""A figure of what a task model learned: sigma over the feature space, the samples, and where there are none."""
import matplotlib
import numpy as np

from wheelchair_shared_control.command_line import OutputError

matplotlib.use("Agg")
import matplotlib.pyplot as plt

STEPS = 81
SLOW, MODERATE = 0.2, 0.45  # m/s, the two paces of the demonstrations (Goil 2013, IV-C)
AHEAD = 2.0  # m, free
MISSING_LEVEL = 0.05


def draw(model, path):
    """Draw ``model`` into the image file ``path``. Raises OutputError."""
    samples = model.training.samples.astype(float)
    middle = np.median(samples[:, [0, 2]])
    slices = [
        ("$v$ = %.2f m/s, free ahead" % v, 0, 2, (None, AHEAD, None, v), np.abs(samples[:, 3] - v) < 0.1)
        for v in (SLOW, MODERATE)
    ] + [
        ("$d_l = d_r$ = %.2f m" % middle, 3, 1, (middle, None, middle, None), np.ones(len(samples), bool)),
    ]
    labels = ("distance left $d_l$ [m]", "distance ahead $d_f$ [m]", "distance right $d_r$ [m]", "speed $v$ [m/s]")
    grids = [_slice(model, x, y, fixed, samples) for _, x, y, fixed, _ in slices]
    top = max(np.max(np.where(seen, sigma, 0.0)) for _, _, sigmas, seen in grids for sigma in sigmas)
    figure, axes = plt.subplots(2, 3, figsize=(13, 8), constrained_layout=True)
    for column, ((title, x, y, _, near), (xs, ys, sigmas, seen)) in enumerate(zip(slices, grids)):
        for row, side in enumerate(("left", "right")):
            axis = axes[row, column]
            image = axis.pcolormesh(xs, ys, sigmas[row], cmap="viridis", vmin=0.0, vmax=top, shading="nearest")
            hatch = axis.contourf(xs, ys, np.where(seen, 0.0, 1.0), levels=[0.5, 1.5], colors=["white"], alpha=0.55)
            hatch.set(hatch="////", edgecolor="0.55", linewidth=0.0)
            axis.plot(samples[near, x], samples[near, y], ".", color="black", markersize=2.0, alpha=0.35)
            axis.set(xlim=(xs[0], xs[-1]), ylim=(ys[0], ys[-1]), xlabel=labels[x], ylabel=labels[y])
            axis.set_title("turning %s; %s" % (side, title), fontsize=10)
    bar = figure.colorbar(image, ax=axes, shrink=0.8)
    bar.set_label(r"learned $\sigma$ [rad/s]")
    figure.suptitle(
        "%d components, %d samples (dots: those near the slice); hatched: nothing like it was demonstrated"
        % (model.components, len(samples)), fontsize=12,
    )
    try:
        figure.savefig(str(path), dpi=110)
    except (OSError, ValueError) as error:
        raise OutputError("%s: cannot be written: %s" % (path, getattr(error, "strerror", None) or error))
    finally:
        plt.close(figure)


def _slice(model, x, y, fixed, samples):
    """Axes (n,), (n,), both sigmas (2, n, n) [rad/s], and whether anything like it was seen (n, n)."""
    highest = (2.0, 2.0, 2.0, max(0.6, samples[:, 3].max()))
    xs, ys = np.linspace(0.0, highest[x], STEPS), np.linspace(0.0, highest[y], STEPS)
    inputs = np.empty((STEPS, STEPS, 4))
    for index, value in enumerate(fixed):
        if value is not None:
            inputs[..., index] = value
    inputs[..., x], inputs[..., y] = xs[None, :], ys[:, None]
    found = model.predict_many(inputs.reshape(-1, 4))
    shape = (STEPS, STEPS)
    seen = model.density_rank(found.log_density) >= MISSING_LEVEL
    return xs, ys, (found.sigma_l.reshape(shape), found.sigma_r.reshape(shape)), seen.reshape(shape)
