"""Cases: what a demonstrated person commanded in a situation, and the file that keeps them.

A situation is (d_l, d_f, d_r, v, goal_distance, goal_bearing), a command (v, w); SI units, angles left positive. The
goal of a demonstration is known in hindsight only: it was driven without assistance. The doorway is where the chair had
least room to both sides, the goal lies 1 m beyond, as the assistance puts it. File: a NumPy archive without pickle.
"""
import json
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import demonstrations, number_archive, parameters, se2
from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.number_archive import ArchiveError

FORMAT, VERSION = "wheelchair_shared_control/cases", 1
SITUATION = ("d_l", "d_f", "d_r", "v", "goal_distance", "goal_bearing")
COMMAND = ("v", "w")
MIRROR = (2, 1, 0, 3, 4, 5)  # left and right change places, and the last number its sign
BEYOND = 1.0  # m, from the door's plane to the goal
NARROW = 0.08  # m: with so much more room to both sides than at the narrowest the chair still is in the doorway
# entry -> (kinds of dtype, shape); N cases
ENTRIES = {"header": ("U", ()), "situations": ("f", ("N", 6)), "commands": ("f", ("N", 2))}
FILE_LIMIT = 20e6  # bytes, packed and unpacked


class CasesError(Error):
    """A file of cases, or a demonstration to make some of, is refused."""


class Cases(NamedTuple):
    """``situations`` (n, 6), ``commands`` (n, 2) float32, ``provenance`` in plain values as of JSON."""

    situations: np.ndarray
    commands: np.ndarray
    provenance: dict


def mirrored(cases):
    """The cases and, after them, the same with left and right exchanged."""
    situations, commands = cases.situations[:, MIRROR].copy(), cases.commands.copy()
    situations[:, 5] *= -1.0
    commands[:, 1] *= -1.0
    return cases._replace(
        situations=np.concatenate((cases.situations, situations)),
        commands=np.concatenate((cases.commands, commands)),
    )


def of_bag(path, settings, footprint, every=1, topics=None):
    """(situations, commands) of a bag: every ``every``-th of its samples up to the goal.

    ``settings``: group ``demonstrations``; ``footprint`` of the chair. Raises CasesError, BagError.
    """
    shown = demonstrations.read(path, settings, topics)
    with demonstrations.bags.open_bag(path) as bag:
        log = demonstrations.read_log(bag, topics or demonstrations.topic_names())
    commands = log.user if log.user is not None else log.sent
    if commands is None or not len(shown.stamps):
        raise CasesError("%s: no samples with a person's command" % path)
    poses = poses_at(log.odometry, shown.stamps)
    door = doorway_of(shown.samples[:, 0] + shown.samples[:, 2], poses, footprint)
    taken = np.flatnonzero(se2.compose(se2.inverse(door), poses)[:, 0] < BEYOND)[::every]
    local = se2.compose(se2.inverse(poses[taken]), se2.compose(door, np.array([BEYOND, 0.0, 0.0])))
    goal = np.column_stack((np.hypot(local[:, 0], local[:, 1]), np.arctan2(local[:, 1], local[:, 0])))
    latest = np.maximum(np.searchsorted(commands.stamps, shown.stamps[taken], side="right") - 1, 0)
    return np.column_stack((shown.samples[taken, :4], goal)), commands.values[latest]


def poses_at(odometry, stamps):
    """Poses (n, 3) at ``stamps`` (n,) by interpolation of rows (stamp, x, y, yaw, ...)."""
    columns = [odometry[:, 1], odometry[:, 2], np.unwrap(odometry[:, 3])]
    return np.column_stack([np.interp(stamps, odometry[:, 0], column) for column in columns])


def doorway_of(room, poses, footprint):
    """Pose (3,) of the doorway that was driven through: middle of the gap, heading of the crossing.

    ``room`` (n,) [m] to both sides together at ``poses`` (n, 3): the middle of the chair is in the plane half way
    between entering and leaving the narrowest part.
    """
    narrow = np.flatnonzero(room <= room.min() + NARROW)
    middle = int(narrow[np.argmin(np.abs(narrow - 0.5 * (narrow[0] + narrow[-1])))])
    x, y, yaw = poses[middle]
    centre = 0.5 * (footprint.front + footprint.rear)
    return np.array([x + centre * np.cos(yaw), y + centre * np.sin(yaw), yaw])


def save(path, cases):
    """Write ``cases`` wholly or not at all; equal cases give equal bytes."""
    header = {
        "format": FORMAT, "version": VERSION, "situation": SITUATION, "command": COMMAND,
        "provenance": cases.provenance,
    }
    number_archive.write(path, {
        "header": np.array(json.dumps(header, sort_keys=True)),
        "situations": np.asarray(cases.situations, "<f4"), "commands": np.asarray(cases.commands, "<f4"),
    })


def load(path):
    """``Cases`` of a file, or of the shipped one ("shipped"). Raises CasesError that names the file."""
    if path == "shipped":
        path = parameters.package_file("config/models/cases.npz")
    try:
        return _checked(number_archive.read(path, ENTRIES, FILE_LIMIT, "file of cases"))
    except (ArchiveError, CasesError) as error:
        raise CasesError("%s: %s" % (path, error))


def _checked(arrays):
    try:
        header = json.loads(str(arrays["header"]))
    except (ValueError, RecursionError) as error:
        raise CasesError("has a damaged header: %s" % error)
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise CasesError("is no file of cases of this package")
    if header.get("version") != VERSION:
        raise CasesError("has version %r: this package reads version %d" % (header.get("version"), VERSION))
    situations, commands = arrays["situations"], arrays["commands"]
    if not len(situations) or len(situations) != len(commands):
        raise CasesError("holds %d situations and %d commands" % (len(situations), len(commands)))
    if not (np.isfinite(situations).all() and np.isfinite(commands).all()):
        raise CasesError("holds numbers that are not finite")
    return Cases(situations, commands, header.get("provenance", {}))
