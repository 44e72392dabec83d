"""The paper's figures 4 and 5 drawn from episodes, and the curves of the studies about them.

Narrow and with few words, so that they can be read on a phone.
"""
from typing import NamedTuple

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import FancyArrowPatch, Polygon
from matplotlib.transforms import Affine2D

from wheelchair_shared_control import blending, markers, se2
from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control.costmap import to_grid
from wheelchair_shared_control.experiments import metrics
from wheelchair_shared_control.experiments.figures import PLANNER, SENT, USER, WALL
from wheelchair_shared_control.simulation import outlines

WIDTH, DPI = 5.2, 130  # inches
TRIANGLE, RIVAL = "#7fb0ff", "#2a9d3a"  # the paper's blue triangle, and its green line
COMMANDED, EXECUTED = "0.86", "0.52"  # the paper's light and dark grey
REACH_BEHIND, REACH_AHEAD, REACH_BESIDE = 0.9, 2.3, 1.3  # m about base_link in Fig. 4
# base_link past the door plane [m]: what Fig. 4 samples, where the outline of Fig. 5 is drawn strongly
PLACES = (("approach", -1.25), ("doorway", -0.25), ("exit", 0.75))
FONT = {"font.size": 9, "axes.titlesize": 9, "legend.fontsize": 8, "axes.linewidth": 0.6}


class Sample(NamedTuple):
    """What Fig. 4 shows of a moment: ``pose`` (3,) of odom, the costmap as ``Grid``, the blender's ``State``."""

    place: float
    pose: np.ndarray
    grid: object
    state: object


class Sampler:
    """Keeps the assisted moments nearest to ``PLACES``; ``watch`` is for ``Episode.run``."""

    def __init__(self, door_pose):
        self._door_from_world = se2.inverse(door_pose)
        self.samples = [None] * len(PLACES)

    def watch(self, graph, simulator):
        """Look at one tick."""
        state = graph.state
        if not state.assisting or not np.isfinite(state.sigma):
            return
        x = se2.compose(self._door_from_world, simulator.truth().pose)[0]
        for index, (_, wanted) in enumerate(PLACES):
            best = self.samples[index]
            if best is None or abs(x - wanted) < abs(best.place - wanted):
                self.samples[index] = Sample(x, np.array(graph.odometry.pose), to_grid(graph.snapshot), state)


def variance_triangles(samples, footprint):
    """Fig. 4: at each sample the costmap, the user's velocity as an arrow, and about it sigma as a triangle."""
    with plt.rc_context(FONT):
        figure, panels = plt.subplots(1, len(samples), figsize=(WIDTH, 2.9), dpi=DPI, constrained_layout=True)
        for axes, (name, _), sample in zip(np.atleast_1d(panels), PLACES, samples):
            axes.set(xlim=(-REACH_BESIDE, REACH_BESIDE), ylim=(-REACH_BEHIND, REACH_AHEAD), xticks=[], yticks=[])
            axes.set_aspect("equal")
            axes.set_title(name)
            if sample is None:
                axes.annotate("not assisted", (0.5, 0.5), xycoords="axes fraction", ha="center")
                continue
            _costmap(axes, sample)
            _chair_with_triangle(axes, sample.state, footprint)
            axes.set_xlabel("$s$ = %.2f rad/s\nuser's weight %.0f %%" % (sample.state.sigma,
                            100.0 * sample.state.beta))
    return figure


def _costmap(axes, sample):
    """The grid about the chair, its heading up."""
    grid = sample.grid
    shade = np.full(grid.cells.shape, 1.0)
    inflated = (grid.cells > 0) & (grid.cells < 100)
    shade[inflated] = 0.95 - 0.25 * grid.cells[inflated] / 99.0
    shade[grid.cells == 100] = 0.15
    rows, columns = grid.cells.shape
    extent = (grid.origin[0], grid.origin[0] + columns * grid.resolution,
              grid.origin[1], grid.origin[1] + rows * grid.resolution)
    x, y, yaw = sample.pose
    upright = Affine2D().translate(-x, -y).rotate(np.pi / 2.0 - yaw)
    axes.imshow(shade, origin="lower", extent=extent, cmap="gray", vmin=0.0, vmax=1.0, interpolation="nearest",
                transform=upright + axes.transData)


def _chair_with_triangle(axes, state, footprint):
    def upright(points):
        points = np.asarray(points, float)
        return np.column_stack((-points[:, 1], points[:, 0]))

    axes.add_patch(Polygon(upright(footprints.corners(footprint, np.zeros(3))), closed=True, fill=True,
                           facecolor="#e8eef7", edgecolor=SENT, linewidth=0.9))
    colours = {"user": USER, "planner": PLANNER}
    for shape in markers.shapes(state, footprint):
        if not shape.points:
            continue
        if shape.name == "sigma":
            axes.add_patch(Polygon(upright(shape.points)[:, :2], closed=True, facecolor=TRIANGLE, alpha=0.55,
                                   edgecolor=USER, linewidth=0.6, zorder=3))
        elif shape.name in colours:
            tail, tip = upright(shape.points)
            axes.add_patch(FancyArrowPatch(tail, tip, arrowstyle="-|>", mutation_scale=9, shrinkA=0, shrinkB=0,
                                           color=colours[shape.name], linewidth=1.4, zorder=4))


def stress_views(runs, titles):
    """Fig. 5, left: each run from above, the chair's outline along its track; bold in each phase."""
    with plt.rc_context(FONT):
        figure, panels = plt.subplots(len(runs), 1, figsize=(WIDTH, 2.75 * len(runs)), dpi=DPI, sharex=True,
                                      constrained_layout=True)
        for axes, run, title in zip(np.atleast_1d(panels), runs, titles):
            _from_above(axes, run)
            axes.set_title(title)
            axes.set_ylabel("left of the axis [m]")
        axes.set_xlabel("past the door plane [m]")
    return figure


def _from_above(axes, run):
    to_door = se2.inverse(run.door.pose)
    shapes = outlines.from_world(run.world)
    for corners, count in zip(shapes.vertices, shapes.counts):
        axes.add_patch(Polygon(se2.transform_points(to_door, corners[:count]), closed=True, color=WALL, linewidth=0))
    log = run.log
    axes.plot(log.truth[:, 0], log.truth[:, 1], color=SENT, linewidth=1.0)
    shown = np.unique(np.searchsorted(log.time, np.arange(log.time[0], log.time[-1], 0.8)))
    for pose in log.truth[shown[shown < len(log.time)]]:
        axes.add_patch(Polygon(footprints.corners(run.footprint, pose), closed=True, fill=False, edgecolor=USER,
                               linewidth=0.5, alpha=0.6))
    phase = metrics.phases(log, run.footprint)
    for index in range(len(metrics.PHASES)):
        inside = np.flatnonzero((phase == index) & log.assisted)
        if inside.size:
            # of the approach only the end is stressed
            pose = log.truth[inside[int(inside.size * (0.9 if index == 0 else 0.5))]]
            axes.add_patch(Polygon(footprints.corners(run.footprint, pose), closed=True, facecolor="#dde7f5",
                                   edgecolor=SENT, linewidth=1.2, alpha=0.75, zorder=3))
            # the letters of the paper's figure
            axes.annotate("(%s)" % "abc"[index], pose[:2], ha="center", va="center", zorder=4)
    axes.set_xlim(-2.9, 2.3)
    axes.set_ylim(-1.3, 1.3)
    axes.set_aspect("equal")


def stress_graphs(runs, titles):
    """Fig. 5, right: turn rates over time, from bottom to top (a) approach, (b) doorway, (c) exit; a column a run."""
    with plt.rc_context(FONT):
        figure, panels = plt.subplots(3, len(runs), figsize=(WIDTH, 5.5), dpi=DPI, sharey=True, squeeze=False,
                                      constrained_layout=True)
        for column, (run, title) in enumerate(zip(runs, titles)):
            phase = metrics.phases(run.log, run.footprint)
            for index, name in enumerate(metrics.PHASES):
                axes = panels[2 - index, column]
                _phase(axes, run, phase == index)
                axes.set_title("(%s) %s" % ("abc"[index], name), loc="left")
            panels[0, column].annotate(title, (0.5, 1.17), xycoords="axes fraction", ha="center", fontweight="bold")
            panels[2, column].set_xlabel("time [s]")
        for row in panels:
            row[0].set_ylabel("turn rate [rad/s]")
        handles, labels = panels[1, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncol=2, frameon=False)
    return figure


def _phase(axes, run, inside):
    """One phase of a stress test: light grey is commanded, dark grey executed, green the distance policy."""
    log = run.log
    time = log.time - log.time[0]
    w_user, w_planner, w_blend = log.user[:, 1], log.planner[:, 1], log.blended[:, 1]
    rival = distance_turn_rate(log, run.settings.blender.wheelchair.limits.speed)
    inside = inside & log.assisted
    axes.fill_between(time, w_planner, w_user, where=inside, color=COMMANDED, linewidth=0, label="user's, commanded")
    axes.fill_between(time, w_planner, w_blend, where=inside, color=EXECUTED, linewidth=0, label="user's, executed")
    for values, colour, width, label in (
        (w_user, USER, 1.0, "user"), (w_planner, PLANNER, 1.0, "planner"), (w_blend, SENT, 1.2, "blended"),
        (rival, RIVAL, 1.2, "distance-based blend"),
    ):
        axes.plot(time, np.where(inside, values, np.nan), color=colour, linewidth=width, label=label)
    chosen = np.flatnonzero(inside)
    if chosen.size:
        begin, end = time[chosen[0]], time[chosen[-1]]
        axes.set_xlim(begin, max(end, begin + 0.1))
        turn = np.nanmean(w_user[chosen])
        if abs(turn) > 0.3:
            # the paper's blue arrow: which way the user pushes
            sign = 1.0 if turn > 0.0 else -1.0
            axes.annotate("", (0.5 - 0.12 * sign, 0.92), (0.5 + 0.12 * sign, 0.92), xycoords="axes fraction",
                          arrowprops={"arrowstyle": "-|>", "color": USER, "lw": 1.6})
    else:
        axes.annotate("not reached", (0.5, 0.5), xycoords="axes fraction", ha="center", color="0.4")
        axes.set_xticks([])
    axes.set_ylim(-1.15, 1.35)


def distance_turn_rate(log, speed_limit):
    """Turn rate (n,) that the distance policy (note 3) would have blended in the states of ``log`` [rad/s]."""
    sigma = log.features[:, :3].min(axis=1) * np.minimum(np.abs(log.features[:, 3]) / speed_limit, 1.0)
    beta = blending.user_weight(log.user[:, 1], log.planner[:, 1], sigma)
    return blending.blended_turn_rate(log.user[:, 1], log.planner[:, 1], beta)


def shares_by_phase(groups):
    """The user's share by phase with 95 % intervals: ``groups`` [(label, {phase: (value, low, high)}), ...]."""
    with plt.rc_context(FONT):
        figure, axes = plt.subplots(figsize=(WIDTH, 3.5), dpi=DPI, constrained_layout=True)
        names = ("all",) + metrics.PHASES
        width = 0.8 / max(len(groups), 1)
        colours = plt.get_cmap("viridis")(np.linspace(0.1, 0.85, len(groups)))
        for index, (label, shares) in enumerate(groups):
            x = np.arange(len(names)) + (index - 0.5 * (len(groups) - 1)) * width
            values = np.array([shares[name] for name in names], float)
            axes.bar(x, values[:, 0], width * 0.9, color=colours[index], label=label)
            axes.errorbar(x, values[:, 0], yerr=np.abs(values[:, 1:].T - values[:, 0]), fmt="none", ecolor="0.2",
                          capsize=2, linewidth=0.8)
        axes.set_xticks(np.arange(len(names)))
        axes.set_xticklabels(["whole"] + list(metrics.PHASES))
        axes.set_ylabel("user's share")
        axes.set_ylim(0.0, 1.03)
        figure.legend(loc="outside lower center", frameon=False, ncol=2)
    return figure


def against(x, shares, contacts, label, scale="linear"):
    """Share (n, 3) and contact rate (n, 3) with 95 % intervals over ``x`` (n,)."""
    x, shares, contacts = np.asarray(x, float), np.asarray(shares, float), np.asarray(contacts, float)
    with plt.rc_context(FONT):
        figure, panels = plt.subplots(2, 1, figsize=(WIDTH, 3.6), dpi=DPI, sharex=True, constrained_layout=True)
        for axes, values, colour, name in (
            (panels[0], shares, USER, "user's share"), (panels[1], contacts, "#c0392b", "contact rate"),
        ):
            axes.errorbar(x, values[:, 0], yerr=np.abs(values[:, 1:].T - values[:, 0]), fmt="o-", color=colour,
                          capsize=3, linewidth=1.2, markersize=5)
            axes.set_ylabel(name)
            axes.set_ylim(0.0, max(1.05 * np.nanmax(values), 0.1))
            axes.grid(color="0.92")
        panels[1].set_xscale(scale)
        panels[1].set_xticks(x)
        panels[1].set_xticklabels(["%g" % value for value in x])
        panels[1].minorticks_off()
        panels[1].set_xlabel(label)
    return figure


def components(bic, heldout):
    """BIC over K, and the mean log likelihood of what was held out ({K: value}, may be empty)."""
    with plt.rc_context(FONT):
        count = 2 if heldout else 1
        figure, panels = plt.subplots(count, 1, figsize=(WIDTH, 1.9 * count), dpi=DPI, sharex=True, squeeze=False,
                                      constrained_layout=True)
        for axes, values, name, best in (
            (panels[0, 0], bic, "BIC (less is better)", min),
            (panels[-1, 0], heldout or None, "log likelihood,\nheld out", max),
        ):
            if values is None:
                continue
            axes.plot(list(values), list(values.values()), "o-", color=USER, linewidth=1.2, markersize=5)
            chosen = best(values, key=values.get)
            axes.plot([chosen], [values[chosen]], "o", color=USER, markersize=10, fillstyle="none")
            axes.axvline(3, color="0.6", linewidth=0.8, linestyle="--")
            axes.set_ylabel(name)
            axes.grid(color="0.92")
        axes.set_xlabel("components K (dashed: the paper's 3; circle: the best)")
        axes.set_xticks(list(bic))
    return figure
