"""The benchmark: policies x planners x users x scenes x door widths, paired by seed, resumable.

Every finished episode is one line of ``episodes.jsonl``, appended at once; what is there already is not driven
again. ``episodes.csv`` is that file sorted by key, without a wall-clock column.
"""
import csv
import io
import itertools
import json
import os
from pathlib import Path

import numpy as np

from wheelchair_shared_control import command_line
from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.experiments import statistics

KEYS = ("policy", "planner", "user", "scene", "door_width", "door", "side", "seed")
MEASURES = (
    "duration_s", "path_length_m", "min_clearance_m", "clearance_p05_m", "user_share_all", "user_share_approach",
    "user_share_doorway", "user_share_exit", "v_share", "beta", "disagreement", "effort", "reversals", "sparc",
    "ldlj", "guard_active", "guard_stops",
)
COLUMNS = KEYS + ("outcome",) + MEASURES + ("reason",)
STORE = "episodes.jsonl"


class CompareError(Error):
    """A comparison's folder cannot be used."""


def plan(base, policies, planners, users, scenes, widths, seeds):
    """All episodes as a list of (options, seed), in the order of their keys."""
    return [
        (base._replace(policy=policy, planner=planner, user=user, scene=scene, door_width=width), seed)
        for policy, planner, user, scene, width, seed in itertools.product(
            policies, planners, users, scenes, widths, seeds
        )
    ]


def key_of(options, seed):
    """What an episode is told by, as text: the key of its row and of its line in the store."""
    fields = {name: value for name, value in options._asdict().items() if value is not None}
    return json.dumps([fields, int(seed)], sort_keys=True)


class Store:
    """Finished episodes in a folder; a line is written whole or counts as not written."""

    def __init__(self, folder):
        self.path = Path(folder) / STORE
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.rows = self._read()
            self._file = open(str(self.path), "a", encoding="utf-8")
        except OSError as error:
            raise CompareError("%s: cannot be used: %s" % (self.path, error.strerror))

    def _read(self):
        if not self.path.exists():
            return {}
        rows, text = {}, self.path.read_bytes()
        # a process that was killed leaves at most one unfinished line at the end: cut it off
        whole = text.rfind(b"\n") + 1
        if whole < len(text):
            with open(str(self.path), "r+b") as stream:
                stream.truncate(whole)
        for number, line in enumerate(text[:whole].decode("utf-8").splitlines(), 1):
            try:
                entry = json.loads(line)
                rows[entry["key"]] = entry["row"]
            except (ValueError, KeyError, TypeError):
                raise CompareError("%s: line %d is no finished episode" % (self.path, number))
        return rows

    def add(self, key, row):
        """Append a finished episode; it is on the disk when this returns."""
        # through the same text as a row that is read again: both runs then print the same digits
        line = json.dumps({"key": key, "row": row}, sort_keys=True)
        self._file.write(line + "\n")
        self._file.flush()
        os.fsync(self._file.fileno())
        self.rows[key] = json.loads(line)["row"]

    def close(self):
        """Close the file."""
        self._file.close()


def row_of(options, result):
    """The CSV row of an episode's result: {column: value}, None where it has no value."""
    row = {
        "policy": _short(options.policy), "planner": options.planner, "user": _short(options.user),
        "scene": _short(options.map or options.scene), "door_width": options.door_width,
        "door": result.get("door", ""), "side": result.get("side", ""), "seed": result["seed"],
        "outcome": result["outcome"], "reason": result["reason"],
    }
    row.update({"user_share_" + name: value for name, value in result["user_share"].items()})
    for name in MEASURES:
        row.setdefault(name, result.get(name))
    return row


def to_csv(rows):
    """Rows as CSV text, sorted by key; numbers with nine digits, so that they read the same everywhere."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in sorted(rows, key=lambda row: tuple(_sortable(row[name]) for name in KEYS)):
        writer.writerow([_text(row[name]) for name in COLUMNS])
    return stream.getvalue()


def table(rows, by=("policy",)):
    """One line a policy (or whatever ``by`` names): rates with Wilson intervals, means with bootstrap intervals."""
    lines = []
    for group in sorted({tuple(row[name] for name in by) for row in rows}, key=lambda g: [_sortable(v) for v in g]):
        members = [row for row in rows if tuple(row[name] for name in by) == group and row["outcome"] != "no_start"]
        line = dict(zip(by, group))
        line["n"] = len(members)
        line["crossed"] = statistics.wilson(sum(row["outcome"] == "crossed" for row in members), len(members))
        line["contact"] = statistics.wilson(sum(row["outcome"] == "contact" for row in members), len(members))
        for name in MEASURES:
            line[name] = statistics.mean_interval([row[name] for row in members])
        clearance = [row["min_clearance_m"] for row in members if row["min_clearance_m"] is not None]
        line["worst_clearance_m"] = min(clearance) if clearance else None
        line["episodes_clearance_p05_m"] = float(np.percentile(clearance, 5)) if clearance else None
        lines.append(line)
    return lines


def markdown(lines, by=("policy",)):
    """The table as Markdown."""
    head = list(by) + [
        "n", "crossed %", "contact %", "clearance, 5th pct. [m]", "share", "approach", "doorway", "exit", "speed share",
        "time [s]", "effort [1/s]", "reversals", "SPARC", "guard active %",
    ]
    out = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for line in lines:
        cells = [str(line[name]) for name in by] + [str(line["n"]), _rate(line["crossed"]), _rate(line["contact"])]
        cells.append("-" if line["episodes_clearance_p05_m"] is None else "%.3f" % line["episodes_clearance_p05_m"])
        for name in ("user_share_all", "user_share_approach", "user_share_doorway", "user_share_exit", "v_share"):
            cells.append(_mean(line[name], "%.2f"))
        cells += [_mean(line["duration_s"], "%.1f"), _mean(line["effort"], "%.2f"), _mean(line["reversals"], "%.1f")]
        cells += [_mean(line["sparc"], "%.2f"), _mean(line["guard_active"], "%.1f", 100.0)]
        out.append("| " + " | ".join(cells) + " |")
    return "\n".join(out) + "\n"


def paired(rows, policy, rival, measure, rng):
    """Difference of ``measure`` between two policies over the episodes that both drove: (value, low, high), n."""
    others = [name for name in KEYS if name != "policy"]
    tables = [
        {tuple(row[name] for name in others): row[measure] for row in rows if row["policy"] == name_}
        for name_ in (policy, rival)
    ]
    common = sorted(set(tables[0]) & set(tables[1]), key=str)
    pairs = np.array(
        [[np.nan if t[key] is None else t[key] for t in tables] for key in common], float
    ).reshape(-1, 2)
    return statistics.paired_difference(pairs[:, 0], pairs[:, 1], rng), int(np.isfinite(pairs).all(axis=1).sum())


def write(folder, rows):
    """Write ``episodes.csv`` and ``table.md`` into ``folder``. Raises OutputError."""
    folder = Path(folder)
    command_line.write_atomically(folder / "episodes.csv", to_csv(rows))
    command_line.write_atomically(folder / "table.md", markdown(table(rows)))


def _short(name):
    """A path as its file's name, a name as itself."""
    return Path(name).name if os.sep in str(name) else str(name)


def _sortable(value):
    return (1, value, "") if isinstance(value, (int, float)) else (0, 0, str(value))


def _text(value):
    if value is None:
        return ""
    return "%.9g" % value if isinstance(value, float) else str(value)


def _rate(rate):
    return "-" if not rate.n else "%.1f (%.1f to %.1f)" % (100 * rate.value, 100 * rate.low, 100 * rate.high)


def _mean(interval, form, scale=1.0):
    if not np.isfinite(interval[0]):
        return "-"
    return (form + " (" + form + " to " + form + ")") % tuple(scale * value for value in interval)
