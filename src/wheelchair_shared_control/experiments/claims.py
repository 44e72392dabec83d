"""What the paper claims, and whether it holds here: each claim with its measure and its interval.

A difference counts as reproduced where its paired bootstrap interval lies wholly on the claimed side, as not
reproduced where it lies wholly on the other, as undecided where it holds zero or comes of too few pairs. Where a claim
says so ("here: by at least ..."), the size that counts stands in the place of zero.
"""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control.experiments import reproduction as studies
from wheelchair_shared_control.experiments import statistics
from wheelchair_shared_control.task_model import TaskModel

HOLDS, PARTLY, FAILS = "reproduced", "reproduced in part", "not reproduced"
UNDECIDED, UNTESTED = "undecided", "not tested"
PACES = (0.20, 0.45)  # m/s: the slow and the moderate teachers'
WALL_CLOSE, WALL_FAR = 0.3, 1.5  # m beside the chair: the wall of an exit, and open space
NOTICEABLE = 0.01  # a mean share below is none
LEAST_PAIRS = 5  # fewer decide nothing, whatever their interval
MUCH = 0.5  # of the other: a deviation is small beside another
NARROWER = 0.05  # of the slow one: a range that narrows by less does not narrow to speak of


class Claim(NamedTuple):
    """``text`` and ``measured`` in our words, ``source`` the place in the paper, ``verdict`` one of the five above."""

    text: str
    source: str
    verdict: str
    measured: str


def judge(policies, scales, demonstrations, bic):
    """All claims. ``policies``, ``scales``, ``demonstrations``: {name: rows}; ``bic``: {K: value}."""
    paper, rival, alone = policies[studies.PAPER], policies[studies.RIVAL], policies[studies.ALONE]
    stress = [row for row in paper if row["user"] in studies.STRESS]
    return [
        _no_contact(
            "In the stress tests (hard left, hard right, all four scenes, no guard) nothing is touched.",
            "V-A", stress, [row for row in alone if row["user"] in studies.STRESS],
        ),
        _no_contact(
            "The same with our guard behind the blend.", "not in the paper",
            [row for row in policies[studies.GUARDED] if row["user"] in studies.STRESS],
        ),
        _more(
            "Over the whole crossing the user is given more control than by the distance-based blend.", "V-A, V-B",
            paper, rival, "user_share_all",
        ),
        _more(
            "At the exit more control is given than by the distance-based blend.", "V-B, Fig. 5 (c)", paper, rival,
            "user_share_exit",
        ),
        _more(
            "On the approach less control is given than by the distance-based blend (the paper's own limitation).",
            "V-B", rival, paper, "user_share_approach", said="less by",
        ),
        _more(
            "Showing the range of commands on the approach mends that: there the share grows.", "V-B, note 4",
            policies[studies.RANGE], paper, "user_share_approach",
        ),
        _at_all_times(stress),
        _towards_wall(paper),
        _pace(),
        _sides(),
        _scale(scales),
        _few(demonstrations),
        _components(bic),
        Claim(
            "Tuning the distance-based blend is difficult: either too close to obstacles or too restricting.", "V-B",
            UNTESTED, _distance_extremes(rival, paper),
        ),
    ]


def _no_contact(text, source, rows, without=None):
    rate = _rate(rows, "contact")
    measured = "%d contacts in %d runs (95 %% interval %.1f to %.1f %%)" % (
        round(rate.value * rate.n), rate.n, 100 * rate.low, 100 * rate.high
    )
    if without:
        other = _rate(without, "contact")
        measured += "; the same users alone: %d in %d" % (round(other.value * other.n), other.n)
    return Claim(text, source, HOLDS if rate.value == 0.0 else FAILS, measured)


def _more(text, source, first, second, measure, said="more by"):
    (value, low, high), n = difference(first, second, measure)
    return Claim(text, source, _verdict(low, high, n), "%s %.3f (95 %% interval %.3f to %.3f, %d pairs)" % (
        said, value, low, high, n))


def _verdict(low, high, pairs):
    if not np.isfinite(low + high):
        return UNTESTED
    if pairs < LEAST_PAIRS:
        return UNDECIDED
    return HOLDS if low > 0.0 else FAILS if high < 0.0 else UNDECIDED


def _at_all_times(rows):
    """A certain amount of the user's command is in the blend throughout: in every phase of every run."""
    parts, lows = [], []
    for phase in ("approach", "doorway", "exit"):
        value, low, high = mean_interval(rows, "user_share_" + phase)
        lows.append(low)
        parts.append("%s %.3f (%.3f to %.3f)" % (phase, value, low, high))
    there = [low > NOTICEABLE for low in lows]
    return Claim(
        "In the stress tests a part of the user's turn rate (more than %g) is carried out in every phase." % NOTICEABLE,
        "V-A, Fig. 5", HOLDS if all(there) else PARTLY if any(there) else FAILS, "mean share, " + ", ".join(parts),
    )


def _towards_wall(rows):
    """At the exit, pushing towards a wall beside is given less than pushing away from it."""
    sides = {("left_wall", "hard_left"): "to", ("left_wall", "hard_right"): "from",
             ("right_wall", "hard_right"): "to", ("right_wall", "hard_left"): "from"}
    shares = {"to": {}, "from": {}}
    for row in rows:
        which = sides.get((row["scene"], row["user"]))
        if which and row["user_share_exit"] is not None:
            shares[which][(row["scene"], row["seed"])] = row["user_share_exit"]
    common = sorted(set(shares["to"]) & set(shares["from"]))
    value, low, high = statistics.paired_difference(
        [shares["from"][key] for key in common], [shares["to"][key] for key in common], [seed for _, seed in common],
        np.random.default_rng(0),
    )
    return Claim(
        "At an exit with a wall beside it, a hard push towards the wall is given much less than one away from it.",
        "V-A, Fig. 5 (c)", _verdict(low, high, len(common)),
        "share away from the wall minus towards it %.3f (95 %% interval %.3f to %.3f, %d pairs); Eq. 3 takes the "
        "deviation of the side to which the planner turns, so a planner that turns away from the wall frees the push "
        "towards it" % (value, low, high, len(common)),
    )


def _pace():
    """The learned range of turn rates narrows with speed: the same places at both paces, grouped by demonstration."""
    model = TaskModel.load("paper")
    inputs = model.training.samples[:, :4].astype(float)
    spread = []
    for pace in PACES:
        found = model.predict_many(np.column_stack((inputs[:, :3], np.full(len(inputs), pace))))
        spread.append(0.5 * (found.sigma_l + found.sigma_r))
    slow, fast = map(np.mean, spread)
    value, low, high = statistics.paired_difference(
        spread[0], spread[1], model.training.bag_index, np.random.default_rng(0))
    return narrowing(slow, fast, value, low, high)


def narrowing(slow, fast, value, low, high):
    """The claim for mean deviations [rad/s] at both paces and their difference with its interval."""
    verdict = HOLDS if low > NARROWER * slow else FAILS if high < NARROWER * slow else UNDECIDED
    return Claim(
        "The variance narrows as the speed grows (here: by at least %g %%)." % (100 * NARROWER), "III-A, IV-C", verdict,
        "mean sigma over the demonstrated places: %.3f rad/s at %.2f m/s, %.3f rad/s at %.2f m/s, less by %.1f %% "
        "(95 %% interval over the demonstrations %.1f to %.1f %%)" % (
            slow, PACES[0], fast, PACES[1], 100 * value / slow, 100 * low / slow, 100 * high / slow),
    )


def _sides():
    """Beside a wall the deviation towards it is smaller than the one away from it."""
    model = TaskModel.load("paper")
    right = model.predict(WALL_FAR, 2.0, WALL_CLOSE, PACES[0])
    left = model.predict(WALL_CLOSE, 2.0, WALL_FAR, PACES[0])
    ratio = max(right.sigma_r / right.sigma_l, left.sigma_l / left.sigma_r)
    return Claim(
        "Beside a wall, the variance towards it is near zero and the one away from it is large (here: at most half).",
        "III-A", HOLDS if ratio <= MUCH else PARTLY if ratio < 1.0 else FAILS,
        "wall %.1f m on the right: sigma_r %.3f, sigma_l %.3f rad/s; on the left: sigma_l %.3f, sigma_r %.3f" % (
            WALL_CLOSE, right.sigma_r, right.sigma_l, left.sigma_l, left.sigma_r),
    )


def _scale(scales):
    parts, best = [], None
    for scale, rows in sorted(scales.items()):
        share = mean_interval(rows, "user_share_all")[0]
        contact = _rate(rows, "contact")
        parts.append("%g sigma: share %.3f, %d contacts in %d" % (
            scale, share, round(contact.value * contact.n), contact.n))
        if best is None or (contact.value, -share) < best[0]:
            best = ((contact.value, -share), scale)
    verdict = HOLDS if best and best[1] == studies.PAPERS_SCALE else FAILS
    return Claim(
        "Of 1, 2 and 3 sigma, 3 is preferred (here: the fewest contacts, then the largest share).", "IV-C", verdict,
        "; ".join(parts),
    )


def _few(demonstrations):
    numbers = sorted(demonstrations)
    parts = []
    for number in numbers:
        contact = _rate(demonstrations[number], "contact")
        parts.append("%d a scene: share %.3f, %d contacts in %d" % (
            number, mean_interval(demonstrations[number], "user_share_all")[0],
            round(contact.value * contact.n), contact.n))
    if numbers[-1] <= studies.PER_SCENE:
        return Claim("Six demonstrations a scene are enough.", "V", UNTESTED,
                     "needs more than six to compare with (the full run); " + "; ".join(parts))
    most, six = demonstrations[numbers[-1]], demonstrations[studies.PER_SCENE]
    (value, low, high), n = difference(most, six, "user_share_all")
    contacts = _rate(six, "contact").value - _rate(most, "contact").value
    verdict = HOLDS if contacts <= 0.0 and not low > 0.05 else FAILS
    return Claim(
        "Six demonstrations a scene are enough (here: more bring neither fewer contacts nor 0.05 of share).", "V",
        verdict, "%d instead of six: share %+.3f (95 %% interval %.3f to %.3f, %d pairs); %s" % (
            numbers[-1], value, low, high, n, "; ".join(parts)),
    )


def _components(bic):
    values = {int(count): value for count, value in bic.items()}
    best = min(values, key=values.get)
    return Claim(
        "Three components encode the demonstrations (chosen empirically).", "III-C",
        HOLDS if best == 3 else FAILS,
        "BIC is least for K = %d of 1 to %d (K = 3: %+.0f above it); the samples follow each other in time, which "
        "makes BIC ask for more" % (best, max(values), values[3] - values[best]),
    )


def _distance_extremes(rival, paper):
    def least(rows):
        return min(row["min_clearance_m"] for row in rows if row["min_clearance_m"] is not None)

    return "the policy has no number to tune (note 3); smallest clearance %.3f m, the paper's policy %.3f m" % (
        least(rival), least(paper))


def difference(first, second, measure):
    """Paired difference of ``measure`` between two sets of rows: (value, low, high), pairs."""
    tables = [
        {(row["user"], row["scene"], row["seed"]): row[measure] for row in rows if row[measure] is not None}
        for rows in (first, second)
    ]
    common = sorted(set(tables[0]) & set(tables[1]))
    pairs = np.array([[table[key] for table in tables] for key in common], float).reshape(-1, 2)
    seeds = [seed for _, _, seed in common]
    return statistics.paired_difference(pairs[:, 0], pairs[:, 1], seeds, np.random.default_rng(0)), len(common)


def mean_interval(rows, measure):
    """Mean of ``measure`` over rows with its interval over their seeds: (value, low, high)."""
    return statistics.mean_interval([row[measure] for row in rows], [row["seed"] for row in rows])


def _rate(rows, outcome):
    driven = [row for row in rows if row["outcome"] != "no_start"]
    return statistics.wilson(sum(row["outcome"] == outcome for row in driven), len(driven))
