"""Cases: what a demonstrated person commanded in a situation, and the file that keeps them.

A situation is (d_l, d_f, d_r, v, goal_distance, goal_bearing), a command (v, w); SI units, angles left positive. The
goal of a demonstration is known in hindsight only: it was driven without assistance. The doorway is where the chair had
least room to both sides, the goal lies 1 m beyond, as the assistance puts it. File: a NumPy archive without pickle.
"""
import io
import json
import zipfile
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import command_line, demonstrations, parameters, se2
from wheelchair_shared_control.errors import Error

FORMAT, VERSION = "wheelchair_shared_control/cases", 1
SITUATION = ("d_l", "d_f", "d_r", "v", "goal_distance", "goal_bearing")
COMMAND = ("v", "w")
MIRROR = (2, 1, 0, 3, 4, 5)  # left and right change places, and the last number its sign
BEYOND = 1.0  # m, from the door's plane to the goal
NARROW = 0.08  # m: with so much more room to both sides than at the narrowest the chair still is in the doorway
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
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in (
            ("header", np.array(json.dumps(header, sort_keys=True))),
            ("situations", np.asarray(cases.situations, "<f4")), ("commands", np.asarray(cases.commands, "<f4")),
        ):
            content = io.BytesIO()
            np.lib.format.write_array(content, array, allow_pickle=False)
            # a fixed date: the same cases are the same file
            entry = zipfile.ZipInfo(name + ".npy", (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content.getvalue())
    command_line.write_atomically(path, packed.getvalue())


def load(path):
    """``Cases`` of a file, or of the shipped one ("shipped"). Raises CasesError that names the file."""
    if path == "shipped":
        path = parameters.package_file("config/models/cases.npz")
    try:
        return _checked(_read(path))
    except CasesError as error:
        raise CasesError("%s: %s" % (path, error))
    except OSError as error:
        raise CasesError("%s: cannot be read: %s" % (path, error.strerror or error))
    except Exception as error:  # archive and array parsers raise errors of many kinds on damaged bytes
        raise CasesError("%s: is no file of cases: %s" % (path, " ".join(str(error).split()) or "damaged"))


def _read(path):
    with zipfile.ZipFile(str(path)) as archive:
        if sum(entry.file_size for entry in archive.infolist()) > FILE_LIMIT:
            raise CasesError("is larger than %.0f MB" % (FILE_LIMIT / 1e6))
        if sorted(archive.namelist()) != ["commands.npy", "header.npy", "situations.npy"]:
            raise CasesError("is no file of cases: it holds %s" % ", ".join(archive.namelist()))
        return {
            name[:-4]: np.lib.format.read_array(io.BytesIO(archive.read(name)), allow_pickle=False)
            for name in archive.namelist()
        }


def _checked(arrays):
    header = json.loads(str(arrays["header"]))
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise CasesError("is no file of cases of this package")
    if header.get("version") != VERSION:
        raise CasesError("has version %r: this package reads version %d" % (header.get("version"), VERSION))
    situations, commands = arrays["situations"], arrays["commands"]
    if situations.ndim != 2 or situations.shape[1] != 6 or commands.shape != (len(situations), 2):
        raise CasesError("holds situations %s and commands %s" % (situations.shape, commands.shape))
    if not len(situations) or situations.dtype.kind != "f" or commands.dtype.kind != "f":
        raise CasesError("holds no cases")
    if not (np.isfinite(situations).all() and np.isfinite(commands).all()):
        raise CasesError("holds numbers that are not finite")
    return Cases(situations, commands, header.get("provenance", {}))
