"""What the detector saw, from above: points, walls, gaps with the reason of their refusal, doorways."""
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from wheelchair_shared_control.errors import Error

POINT, WALL, GAP, DOORWAY = "0.55", "#1f4e9c", "#d9822b", "#1a8a3a"
BAND = (0.10, 2.0)  # m: heights drawn
MAX_POINTS = 20000
MARGIN = 0.5  # m about what is drawn
MAX_PANELS = 24  # of a long bag: more are no picture, and from about 270 on no file


class FigureError(Error):
    """A figure cannot be written where it was asked for."""


def thinned(located):
    """``Located`` with fewer points, still more than are drawn: hundreds of frames of a bag would fill the memory."""
    return located._replace(points=located.points[:: max(1, len(located.points) // (4 * MAX_POINTS))].copy())


def save(path, titled):
    """Draw ``titled``: list of (title, Located), one panel each, to ``path``; of many evenly chosen ones.

    Raises FigureError.
    """
    total = len(titled)
    if total > MAX_PANELS:
        titled = [titled[k] for k in np.linspace(0, total - 1, MAX_PANELS).round().astype(int)]
    panels = max(len(titled), 1)
    columns = min(panels, 3)
    rows = (panels + columns - 1) // columns
    figure, axes = plt.subplots(rows, columns, figsize=(6.5 * columns, 6.5 * rows), squeeze=False)
    for axis in axes.ravel()[len(titled):]:
        axis.set_axis_off()
    for axis, (title, located) in zip(axes.ravel(), titled):
        draw(axis, located.detection, located.points)
        axis.set_title(Path(title).name, fontsize=11)
    if total > len(titled):
        figure.suptitle("%d of %d frames" % (len(titled), total))
    figure.tight_layout()
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(str(path), dpi=110)
    except (OSError, ValueError) as error:
        raise FigureError("%s: cannot be written: %s" % (path, getattr(error, "strerror", None) or error))
    finally:
        plt.close(figure)


def draw(axis, detection, points):
    """One top view: x ahead is up, y left is left, as the sensor looks."""
    points = np.asarray(points, dtype=float).reshape(-1, 3)
    band = points[(points[:, 2] > BAND[0]) & (points[:, 2] < BAND[1])]
    band = band[:: max(1, len(band) // MAX_POINTS)]
    axis.plot(-band[:, 1], band[:, 0], ".", color=POINT, markersize=1.0, alpha=0.5, zorder=1, rasterized=True)
    axis.plot(0.0, 0.0, "^", color="black", markersize=9, zorder=5)
    for wall in detection.walls:
        axis.plot(-wall.ends[:, 1], wall.ends[:, 0], "-", color=WALL, linewidth=2.0, alpha=0.7, zorder=2)
    told = [np.zeros((1, 2))]
    refused = [gap for gap in detection.gaps if gap.reason]
    for number, gap in enumerate(refused, 1):
        told.append(gap.ends)
        axis.plot(-gap.ends[:, 1], gap.ends[:, 0], "--", color=GAP, linewidth=1.8, zorder=3)
        middle = gap.ends.mean(axis=0)
        axis.annotate(str(number), (-middle[1], middle[0]), color="white", fontsize=8, ha="center", va="center",
                      bbox={"boxstyle": "circle,pad=0.2", "fc": GAP, "ec": "none"}, zorder=6)
    for doorway in detection.doorways:
        told.append(doorway.jambs)
        _doorway(axis, doorway)
    lines = ["%d  %s" % (number, gap.reason) for number, gap in enumerate(refused[:8], 1)]
    if len(refused) > 8:
        lines.append("... and %d more" % (len(refused) - 8))
    if not detection.doorways:
        why = "%d gap%s refused" % (len(refused), "s" * (len(refused) > 1)) if refused else detection.reason
        lines.insert(0, "no doorway: " + why)
    if lines:
        # below: within the axes it would hide what it tells of
        axis.annotate("\n".join(lines), (0.0, 0.0), (0.0, -36.0), xycoords="axes fraction",
                      textcoords="offset points", fontsize=8, va="top")
    _frame(axis, band, detection, np.concatenate(told))


def _doorway(axis, doorway):
    x, y, yaw = doorway.pose
    axis.plot(-doorway.jambs[:, 1], doorway.jambs[:, 0], "o-", color=DOORWAY, linewidth=3.0, markersize=6, zorder=4)
    axis.annotate("", (-(y + 0.7 * np.sin(yaw)), x + 0.7 * np.cos(yaw)), (-y, x), zorder=5,
                  arrowprops={"arrowstyle": "-|>", "color": DOORWAY, "lw": 2.0})
    axis.annotate("%.2f m, %.0f %%" % (doorway.width, 100.0 * doorway.confidence),
                  (-(y + 0.95 * np.sin(yaw)), x + 0.95 * np.cos(yaw)), color=DOORWAY, fontsize=10, weight="bold",
                  ha="center", va="center", zorder=6, bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none",
                                                            "alpha": 0.8})


def _frame(axis, band, detection, told):
    """Limits that hold nearly all points, all walls' ends, all gaps, in equal scale."""
    points = [told]
    if len(band):
        points.append(np.percentile(band[:, :2], (1, 99), axis=0))
    points += [wall.ends for wall in detection.walls]
    points = np.concatenate(points)
    low, high = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
    axis.set_xlim(-high[1], -low[1])
    axis.set_ylim(low[0], high[0])
    axis.set_aspect("equal", adjustable="box")
    ticks = axis.get_xticks()
    axis.set_xticks(ticks, ["%g" % (0.0 - tick) for tick in ticks])
    axis.set_xlim(-high[1], -low[1])
    axis.set_xlabel("y [m], left is positive")
    axis.set_ylabel("x [m], ahead")
    axis.grid(color="0.9", linewidth=0.6, zorder=0)
    axis.set_axisbelow(True)
