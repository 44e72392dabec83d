"""The benchmark: policies x planners x users x scenes x door widths, paired by seed, resumable.

Every finished episode is one line of ``episodes.jsonl``, appended at once; what is there already is not driven
again, unless other code or other files made it. ``episodes.csv`` is that file sorted by key, without a wall-clock
column.
"""
import csv
import fcntl
import io
import itertools
import json
import os
from pathlib import Path

import numpy as np

from wheelchair_shared_control import command_line
from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.experiments import code_version, referee, statistics
from wheelchair_shared_control.experiments.options import SCENES, Options
from wheelchair_shared_control.simulation import doors

KEYS = ("policy", "planner", "user", "scene", "door_width", "door", "side", "seed")
MEASURES = (
    "duration_s", "path_length_m", "min_clearance_m", "clearance_p05_m", "user_share_all", "user_share_approach",
    "user_share_doorway", "user_share_exit", "v_share", "beta", "disagreement", "effort", "reversals", "sparc",
    "ldlj", "guard_active", "guard_stops", "escape_m",
)
COLUMNS = KEYS + ("outcome",) + MEASURES + ("reason",)
STORE = "episodes.jsonl"


class CompareError(Error):
    """A comparison's folder cannot be used."""


def plan(base, policies, planners, users, scenes, widths, seeds, pairs=()):
    """All episodes as a list of (options, seed), each once; ``pairs`` are more (policy, planner) to those combined.

    Doors of a map stand in the place of scenes and widths: each annotated door, from both sides. A scene's file says
    its width itself. Raises CompareError where two names would be one in the table.
    """
    _told_apart("policies", list(policies) + [policy for policy, _ in pairs])
    _told_apart("users", users)
    if base.map is None:
        _told_apart("scenes", scenes)
        places = [
            {"scene": scene, "door_width": width} for scene in scenes
            for width in (widths if scene in SCENES else [Options().door_width])
        ]
    else:
        names = list(doors.read(base.doors)) if base.door is None else [base.door]
        sides = (0, 1) if base.side is None else (base.side,)
        unused = {"scene": Options().scene, "door_width": Options().door_width}
        places = [dict(unused, door=name, side=side) for name, side in itertools.product(names, sides)]
    who = dict.fromkeys(list(itertools.product(policies, planners)) + list(pairs))
    return list(dict.fromkeys(
        (base._replace(policy=policy, planner=planner, user=user, **place), seed)
        for (policy, planner), user, place, seed in itertools.product(who, users, places, seeds)
    ))


def _told_apart(what, names):
    """Refuse two files of one name: their rows would be one policy's, one user's, one scene's."""
    seen = {}
    for name in names:
        other = seen.setdefault(_short(name), name)
        if other != name:
            raise CompareError("--%s: %s and %s would both be '%s' in the table" % (what, other, name, _short(name)))


def key_of(options, seed):
    """What an episode is told by, as text: the key of its row and of its line in the store.

    Files of one's own count by what is in them: an edited policy is another one.
    """
    fields = {name: value for name, value in options._asdict().items() if value is not None}
    files = code_version.of_files(options)
    return json.dumps([fields, int(seed)] + ([files] if files else []), sort_keys=True)


class Store:
    """Finished episodes in a folder; a line is written whole or counts as not written.

    ``rows`` {key: row}. Lines that other code made (``code_version``) are left out and counted in ``stale``, unless
    ``keep_stale``. Raises CompareError where the folder cannot be used, or is used by another run.
    """

    def __init__(self, folder, keep_stale=False):
        self.path = Path(folder) / STORE
        self._keep_stale, self._stale = keep_stale, set()
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = open(str(self.path), "a", encoding="utf-8")
            self._lock()
            self.rows = self._read()
        except OSError as error:
            raise CompareError("%s: cannot be used: %s" % (self.path, error.strerror))

    def _lock(self):
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise CompareError("%s: another run writes to it" % self.path)

    def _read(self):
        rows, text = {}, self.path.read_bytes()
        # a process that was killed leaves at most one unfinished line at the end: cut it off
        whole = text.rfind(b"\n") + 1
        if whole < len(text):
            with open(str(self.path), "r+b") as stream:
                stream.truncate(whole)
        stale = set()
        for number, line in enumerate(text[:whole].decode("utf-8", "replace").splitlines(), 1):
            try:
                entry = json.loads(line)
                key, row, code = entry["key"], entry["row"], entry.get("code")
            except (ValueError, KeyError, TypeError):
                raise CompareError("%s: line %d is no finished episode" % (self.path, number))
            row = dict(dict.fromkeys(COLUMNS), **row)  # columns are added in the course of time
            if code == code_version.digest():
                stale.discard(key)
                rows[key] = row
            elif key not in rows or key in stale:
                stale.add(key)
                if self._keep_stale:
                    rows[key] = row
        self._stale = stale
        return rows

    @property
    def stale(self):
        """How many rows other code made."""
        return len(self._stale)

    def stale_among(self, keys):
        """How many rows of these keys other code made."""
        return len(self._stale.intersection(keys))

    def add(self, key, row):
        """Append a finished episode; it is on the disk when this returns."""
        # through the same text as a row that is read again: both runs then print the same digits
        line = json.dumps({"code": code_version.digest(), "key": key, "row": row}, sort_keys=True)
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
        "scene": _short(options.map or options.scene),
        "door_width": result["door_width_m"],
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


CELL = ("policy", "planner", "user", "scene", "door_width", "door", "side")
OUTCOMES = tuple(outcome for outcome in referee.OUTCOMES if outcome != "no_start")


def summary_csv(rows):
    """CSV text of one line a cell of the comparison (all seeds of a policy, user and place): counts, and means of the
    measures over the episodes that have them."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(CELL + ("n",) + OUTCOMES + ("worst_clearance_m",) + MEASURES)
    cells = {}
    for row in rows:
        if row["outcome"] != "no_start":
            cells.setdefault(tuple(row[name] for name in CELL), []).append(row)
    for cell in sorted(cells, key=lambda cell: tuple(_sortable(value) for value in cell)):
        members = sorted(cells[cell], key=lambda row: row["seed"])
        known = {name: [row[name] for row in members if row[name] is not None] for name in MEASURES}
        worst = min(known["min_clearance_m"], default=None)
        writer.writerow(
            [_text(value) for value in cell] + [len(members)]
            + [sum(row["outcome"] == outcome for row in members) for outcome in OUTCOMES] + [_text(worst)]
            + [_text(float(np.mean(known[name])) if known[name] else None) for name in MEASURES])
    return stream.getvalue()


def table(rows, by=("policy",)):
    """One line a policy (or whatever ``by`` names): rates with Wilson intervals, means with bootstrap intervals."""
    lines = []
    for group in sorted({tuple(row[name] for name in by) for row in rows}, key=lambda g: [_sortable(v) for v in g]):
        members = [row for row in rows if tuple(row[name] for name in by) == group and row["outcome"] != "no_start"]
        line = dict(zip(by, group))
        line["n"] = len(members)
        seeds = [row["seed"] for row in members]
        for outcome in OUTCOMES:
            line[outcome] = statistics.wilson(sum(row["outcome"] == outcome for row in members), len(members))
        for name in MEASURES:
            line[name] = statistics.mean_interval([row[name] for row in members], seeds)
        clearance = [row["min_clearance_m"] for row in members if row["min_clearance_m"] is not None]
        line["worst_clearance_m"] = min(clearance) if clearance else None
        line["least_escape_m"] = min((row["escape_m"] for row in members if row["escape_m"] is not None), default=None)
        line["episodes_clearance_p05_m"] = float(np.percentile(clearance, 5)) if clearance else None
        lines.append(line)
    return lines


# heading, key of a line, how it is written, factor
SAFETY = (
    ("crossed %", "crossed", None, 1.0), ("contact %", "contact", None, 1.0), ("refused %", "refused", None, 1.0),
    ("standstill %", "standstill", None, 1.0), ("timeout %", "timeout", None, 1.0),
    ("least clearance [m]", "worst_clearance_m", "%.3f", 1.0),
    ("clearance, 5th pct. [m]", "episodes_clearance_p05_m", "%.3f", 1.0),
    ("guard active %", "guard_active", "%.1f", 100.0), ("guard stops", "guard_stops", "%.2f", 1.0),
    ("least escape [m]", "least_escape_m", "%.2f", 1.0),
)
CONTROL = (
    ("share", "user_share_all", "%.3f", 1.0), ("approach", "user_share_approach", "%.3f", 1.0),
    ("doorway", "user_share_doorway", "%.3f", 1.0), ("exit", "user_share_exit", "%.3f", 1.0),
    ("speed share", "v_share", "%.3f", 1.0), ("disagreement [rad/s]", "disagreement", "%.3f", 1.0),
)
MOTION = (
    ("time [s]", "duration_s", "%.1f", 1.0), ("path [m]", "path_length_m", "%.2f", 1.0),
    ("stick effort [1/s]", "effort", "%.2f", 1.0), ("reversals", "reversals", "%.1f", 1.0),
    ("LDLJ", "ldlj", "%.2f", 1.0), ("SPARC", "sparc", "%.2f", 1.0),
)


def markdown(lines, by=("policy",), columns=SAFETY):
    """Some columns of the table as Markdown."""
    head = list(by) + ["n"] + [heading for heading, _, _, _ in columns]
    out = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for line in lines:
        cells = [str(line[name]) for name in by] + [str(line["n"])]
        out.append("| " + " | ".join(cells + [_cell(line[key], form, scale) for _, key, form, scale in columns]) + " |")
    return "\n".join(out) + "\n"


def report(rows, by=("policy",)):
    """All tables, and the differences to the first policy, as Markdown."""
    lines = table(rows, by)
    parts = []
    for title, columns in (("Safety", SAFETY), ("Control", CONTROL), ("Motion and the stick", MOTION)):
        parts.append("## %s\n\n%s" % (title, markdown(lines, by, columns)))
    idle = sum(row["outcome"] == "no_start" for row in rows)
    return (
        "%d episodes%s. In brackets 95 %% intervals: Wilson for rates, bootstrap over seeds for means. A share is the "
        "user's part of the turn rate.\n\n" % (len(rows), " (%d without a start: left out)" % idle if idle else "")
        + "\n".join(parts)
    )


def paired_markdown(rows, reference, rivals):
    """Differences of each rival to ``reference``, (policy, planner) pairs, over the same episodes, as Markdown."""
    measures = (("share", "user_share_all"), ("approach", "user_share_approach"), ("doorway", "user_share_doorway"),
                ("exit", "user_share_exit"), ("least clearance [m]", "min_clearance_m"), ("time [s]", "duration_s"))
    head = ["minus %s" % _label(*reference), "pairs"] + [heading for heading, _ in measures] + ["contacts %"]
    out = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for rival in rivals:
        cells, pairs = [], 0
        for _, measure in measures:
            interval, n = paired(rows, rival, reference, measure, np.random.default_rng(0))
            pairs = max(pairs, n)
            cells.append(_mean(interval, "%+.3f"))
        touched = [dict(row, touched=float(row["outcome"] == "contact")) for row in rows]
        interval, _ = paired(touched, rival, reference, "touched", np.random.default_rng(0))
        cells.append(_mean(interval, "%+.1f", 100.0))
        out.append("| " + " | ".join([_label(*rival), str(pairs)] + cells) + " |")
    return "\n".join(out) + "\n"


def _label(policy, planner):
    return policy if planner == "move_base" else "%s, %s" % (policy, planner)


def paired(rows, first, second, measure, rng):
    """Difference of ``measure`` between two (policy, planner) pairs over the episodes that both drove:
    (value, low, high), n."""
    others = [name for name in KEYS if name not in ("policy", "planner")]
    tables = [
        {tuple(row[name] for name in others): row[measure] for row in rows
         if (row["policy"], row["planner"]) == who and row["outcome"] != "no_start"}
        for who in (first, second)
    ]
    common = sorted(set(tables[0]) & set(tables[1]), key=str)
    pairs = np.array(
        [[np.nan if t[key] is None else t[key] for t in tables] for key in common], float
    ).reshape(-1, 2)
    seeds = [key[others.index("seed")] for key in common]
    found = statistics.paired_difference(pairs[:, 0], pairs[:, 1], seeds, rng)
    return found, int(np.isfinite(pairs).all(axis=1).sum())


def write(folder, rows, command="", stale=0):
    """Write ``episodes.csv``, ``summary.csv`` and ``table.md`` into ``folder``; returns the table.

    ``command`` and how many rows are ``stale``, made by other code, are said in the table. Raises OutputError.
    """
    folder = Path(folder)
    by = ("policy", "planner") if len({row["planner"] for row in rows}) > 1 else ("policy",)
    pairs = list(dict.fromkeys((row["policy"], row["planner"]) for row in rows))
    text = "Made by `%s`.\n\n%s" % (command, report(rows, by)) if command else report(rows, by)
    if stale:
        text = "**%d of the %d episodes were driven by other code.**\n\n%s" % (stale, len(rows), text)
    if len(pairs) > 1:
        text += "\n## Differences, episode by episode\n\n" + paired_markdown(rows, pairs[0], pairs[1:])
    for name, heading in (("user", "users"), ("scene", "scenes"), ("door_width", "door widths"), ("door", "doors")):
        if len({row[name] for row in rows}) > 1:
            lines = table(rows, by + (name,))
            text += "\n## By %s\n\n%s" % (heading, markdown(lines, by + (name,), BRIEF))
    command_line.write_atomically(folder / "episodes.csv", to_csv(rows))
    command_line.write_atomically(folder / "summary.csv", summary_csv(rows))
    command_line.write_atomically(folder / "table.md", text)
    return table(rows, by)


BRIEF = (
    ("crossed %", "crossed", None, 1.0), ("contact %", "contact", None, 1.0),
    ("least clearance [m]", "worst_clearance_m", "%.3f", 1.0), ("share", "user_share_all", "%.3f", 1.0),
    ("time [s]", "duration_s", "%.1f", 1.0),
)


def _short(name):
    """A path as its file's name, a name as itself."""
    return Path(name).name if os.sep in str(name) else str(name)


def _sortable(value):
    return (1, value, "") if isinstance(value, (int, float)) else (0, 0, str(value))


def _text(value):
    if value is None:
        return ""
    return "%.9g" % value if isinstance(value, float) else str(value)


def _cell(value, form, scale):
    if form is None:
        return _rate(value)
    if isinstance(value, tuple):
        return _mean(value, form, scale)
    return "-" if value is None else form % (scale * value)


def _rate(rate):
    return "-" if not rate.n else "%.1f (%.1f to %.1f)" % (100 * rate.value, 100 * rate.low, 100 * rate.high)


def _mean(interval, form, scale=1.0):
    if not np.isfinite(interval[0]):
        return "-"
    return (form + " (" + form + " to " + form + ")") % tuple(scale * value for value in interval)
