"""Figures of a crossing: the track over the scene, and who steered (after the paper's Fig. 5)."""
import io
import textwrap

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Polygon
from matplotlib.transforms import Bbox

from wheelchair_shared_control import command_line, se2
from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control.experiments import metrics
from wheelchair_shared_control.simulation import outlines

USER, PLANNER, SENT, WALL = "#3b6fb6", "#d9822b", "#2c2c2c", "#6b6b6b"
PHASE_SHADES = ("#eef3fa", "#fdf3e3", "#eef7ee")


def crossing(log, world, door, footprint, title):
    """Figure with the top view on the left, turn rates, shares and clearance over time on the right."""
    figure = plt.figure(figsize=(11.0, 6.2), dpi=110)
    layout = figure.add_gridspec(3, 2, width_ratios=(1.0, 1.25), height_ratios=(1.5, 1.0, 1.0), hspace=0.18, wspace=0.2)
    top_view(figure.add_subplot(layout[:, 0]), log, world, door, footprint)
    turn = figure.add_subplot(layout[0, 1])
    turn_rates(turn, log, footprint)
    share = figure.add_subplot(layout[1, 1], sharex=turn)
    speeds(share, log, footprint)
    clearances = figure.add_subplot(layout[2, 1], sharex=turn)
    clearance(clearances, log, footprint)
    for axes in (turn, share):
        axes.tick_params(labelbottom=False)
    clearances.set_xlabel("time [s]")
    figure.suptitle("\n".join(textwrap.wrap(title, 130)), x=0.02, ha="left", fontsize=10)
    figure.subplots_adjust(left=0.06, right=0.985, top=0.88, bottom=0.09)
    return figure


def save(figure, path):
    """Write a figure as PNG, wholly or not at all; closes it. Raises OutputError."""
    content = io.BytesIO()
    figure.savefig(content, format="png")
    plt.close(figure)
    command_line.write_atomically(path, content.getvalue())


def pareto(lines):
    """The user's share against clearance, a point a policy, with 95 % intervals; up and right is better."""
    figure, axes = plt.subplots(figsize=(7.6, 5.4), dpi=110)
    labels = []
    for line in lines:
        share, clearance_ = line["user_share_all"], line["min_clearance_m"]
        if not np.isfinite(share[0]) or not np.isfinite(clearance_[0]):
            continue
        touched = line["contact"].value > 0.0
        axes.errorbar(
            clearance_[0], share[0], xerr=[[clearance_[0] - clearance_[1]], [clearance_[2] - clearance_[0]]],
            yerr=[[share[0] - share[1]], [share[2] - share[0]]], fmt="o", markersize=6, capsize=2, linewidth=1.0,
            color="#c0392b" if touched else USER, markerfacecolor="white" if touched else USER,
        )
        planner = line.get("planner", "move_base")
        label = line["policy"] + ("" if planner == "move_base" else ", " + planner)
        if touched:
            label += " (%.1f %% touched)" % (100.0 * line["contact"].value)
        labels.append((label, (clearance_[0], share[0])))
    axes.set_xlabel("smallest clearance of an episode, mean [m]")
    axes.set_ylabel("user's share of the turn rate, mean")
    axes.set_ylim(-0.05, 1.08)
    axes.margins(x=0.2)
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    figure.tight_layout()
    _label_points(figure, axes, labels)
    return figure


def _label_points(figure, axes, labels):
    """Write each label [(text, (x, y)), ...] beside its point where it covers no other label and no point."""
    points = axes.transData.transform([point for _, point in labels]) if labels else []
    taken = [Bbox.from_bounds(x - 5.0, y - 5.0, 10.0, 10.0) for x, y in points]
    renderer = figure.canvas.get_renderer()
    for text, point in labels:
        best = None
        for distance in (7, 16, 26, 38):
            for side in ("left", "right"):  # of the text, at the point
                for height in (distance, -distance, 0):
                    across = 8 if side == "left" else -8
                    leader = {"arrowstyle": "-", "color": "0.7", "lw": 0.6} if distance > 7 else None
                    note = axes.annotate(
                        text, point, xytext=(across, height), textcoords="offset points", fontsize=8, ha=side,
                        va="center", arrowprops=leader,
                    )
                    box = note.get_window_extent(renderer)
                    hits = sum(box.overlaps(other) for other in taken) + 10 * (not _within(box, axes.bbox))
                    if best is None or hits < best[0]:
                        if best is not None:
                            best[1].remove()
                        best = hits, note, box
                    else:
                        note.remove()
                    if hits == 0:
                        break
                if best[0] == 0:
                    break
            if best[0] == 0:
                break
        taken.append(best[2])


def _within(box, frame):
    return box.x0 >= frame.x0 and box.x1 <= frame.x1 and box.y0 >= frame.y0 and box.y1 <= frame.y1


def top_view(axes, log, world, door, footprint, every=0.7):
    """The world around the door from above, in the door's frame, with the footprint each ``every`` seconds."""
    to_door = se2.inverse(door.pose)
    for box in world.boxes:
        if box[2] - box[6] > outlines.HIGH:
            continue  # a lintel: the chair passes under it
        outline = _box_corners(box)
        axes.add_patch(Polygon(se2.transform_points(to_door, outline), closed=True, color=WALL, linewidth=0))
    axes.plot(log.truth[:, 0], log.truth[:, 1], color=SENT, linewidth=1.2)
    next_time = -np.inf
    for time, pose in zip(log.time, log.truth):
        if time >= next_time:
            next_time = time + every
            axes.add_patch(
                Polygon(footprints.corners(footprint, pose), closed=True, fill=False, edgecolor=USER, linewidth=0.8)
            )
    if len(log.truth):
        low, high = log.truth[:, :2].min(axis=0) - 1.0, log.truth[:, :2].max(axis=0) + 1.0
        # auto: the aspect may widen them, without a warning
        axes.set_xlim(min(low[0], -1.5), max(high[0], 1.5), auto=True)
        axes.set_ylim(min(low[1], -1.5), max(high[1], 1.5), auto=True)
    # the scene fills the panel, whatever its shape
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("past the door plane [m]")
    axes.set_ylabel("left of the door's axis [m]")


def turn_rates(axes, log, footprint):
    """Commanded and executed turn rates; light: what the user asked beyond the planner, dark: what was carried out."""
    time = log.time - (log.time[0] if len(log.time) else 0.0)
    _shade_phases(axes, time, metrics.phases(log, footprint), label=True)
    w_user, w_planner, w_blend = log.user[:, 1], log.planner[:, 1], log.blended[:, 1]
    axes.fill_between(time, w_planner, w_user, color="0.84", linewidth=0, label="user's, not executed")
    axes.fill_between(time, w_planner, w_blend, color="0.55", linewidth=0, label="user's, executed")
    axes.plot(time, w_user, color=USER, linewidth=1.0, label="user")
    axes.plot(time, w_planner, color=PLANNER, linewidth=1.0, label="planner")
    axes.plot(time, log.sent[:, 1], color=SENT, linewidth=1.2, label="sent")
    axes.set_ylabel("turn rate [rad/s]")
    axes.set_ylim(-1.15, 1.15)
    axes.legend(ncol=3, fontsize=7, loc="lower right", framealpha=0.9)


def speeds(axes, log, footprint):
    """Speeds of user, planner and chair."""
    time = log.time - (log.time[0] if len(log.time) else 0.0)
    _shade_phases(axes, time, metrics.phases(log, footprint))
    axes.plot(time, log.user[:, 0], color=USER, linewidth=1.0)
    axes.plot(time, log.planner[:, 0], color=PLANNER, linewidth=1.0)
    axes.plot(time, log.sent[:, 0], color=SENT, linewidth=1.2)
    axes.set_ylabel("speed [m/s]")


def clearance(axes, log, footprint):
    """The true clearance, with the user's weight beta."""
    time = log.time - (log.time[0] if len(log.time) else 0.0)
    _shade_phases(axes, time, metrics.phases(log, footprint))
    axes.plot(time, log.clearance, color=SENT, linewidth=1.2, label="clearance [m]")
    axes.plot(time, log.beta, color=USER, linewidth=1.0, label="beta")
    axes.set_ylim(0.0, 1.05)
    axes.set_ylabel("clearance, beta")
    axes.legend(ncol=2, fontsize=7, loc="upper right", framealpha=0.9)


def _shade_phases(axes, time, phase, label=False):
    for index, name in enumerate(metrics.PHASES):
        inside = np.flatnonzero(phase == index)
        if not inside.size:
            continue
        begin, end = time[inside[0]], time[min(inside[-1] + 1, len(time) - 1)]
        axes.axvspan(begin, end, color=PHASE_SHADES[index], linewidth=0)
        if label:
            axes.annotate(
                name, ((begin + end) / 2.0, 1.0), xycoords=("data", "axes fraction"), ha="center", va="bottom",
                fontsize=8, color="0.3",
            )
    if len(time):
        axes.set_xlim(time[0], max(time[-1], time[0] + 1e-3))


def _box_corners(box):
    half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * box[4:6]
    return se2.transform_points((box[0], box[1], box[3]), half)
