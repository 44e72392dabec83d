"""The result of an episode as the dictionary that every command prints and stores."""
import numpy as np

from wheelchair_shared_control import blending
from wheelchair_shared_control.experiments import metrics, smoothness
from wheelchair_shared_control.footprint import from_settings
from wheelchair_shared_control.guard import FREE, STOPPED

SAMPLING = 1.0 / 30.0  # s: the log's ticks are brought to this before smoothness is measured


def of_log(seed, verdict, log, wheelchair, extra=None):
    """Result of a driven episode: outcome, times, clearance, shares; ``extra`` fields come last."""
    footprint = from_settings(wheelchair)
    limits = (wheelchair.limits.speed, wheelchair.limits.turn_rate)
    clearance = log.clearance[np.isfinite(log.clearance)]
    started = log.time[0] if len(log.time) else 0.0
    result = {
        "seed": int(seed),
        "outcome": verdict.outcome,
        "reason": verdict.reason,
        "duration_s": float(log.time[-1] - started) if len(log.time) else 0.0,
        "min_clearance_m": float(clearance.min()) if clearance.size else None,
        "user_share": metrics.shares(log, footprint),
        "v_share": metrics.mean_or_none(metrics.speed_share_of_ticks(log)),
        "beta": metrics.mean_or_none(np.where(log.assisted, log.beta, np.nan)),
        "guard_active": metrics.mean_or_none(log.guard != FREE),
        "path_length_m": metrics.path_length(log),
        "clearance_p05_m": float(np.percentile(clearance, 5)) if clearance.size else None,
        "disagreement": metrics.mean_or_none(np.abs(log.user[:, 1] - log.planner[:, 1])[log.assisted]),
        "guard_stops": int(np.count_nonzero(np.diff((log.guard == STOPPED).astype(int)) == 1)),
    }
    result.update(_hand_and_motion(log, limits))
    result.update(extra or {})
    return result


def _hand_and_motion(log, limits):
    """Effort and reversals of the stick, smoothness of the chair; None where there is no value."""
    values = {"effort": None, "reversals": None, "sparc": None, "ldlj": None}
    if len(log.time) > 1 and log.time[-1] > log.time[0]:
        speed = smoothness.resampled(log.time, log.velocity[:, 0], SAMPLING)
        values = {
            "effort": smoothness.effort(log.time, log.user, limits),
            "reversals": smoothness.reversals(log.user[:, 1]),
            "sparc": smoothness.sparc(speed, SAMPLING),
            "ldlj": smoothness.ldlj(speed, SAMPLING),
        }
    return {name: None if value is None or not np.isfinite(value) else value for name, value in values.items()}


def not_driven(seed, verdict, extra=None):
    """Result of an episode that could not begin; ``extra`` fields come last."""
    result = {
        "seed": int(seed), "outcome": verdict.outcome, "reason": verdict.reason, "duration_s": None,
        "min_clearance_m": None, "user_share": {name: None for name in ("all",) + metrics.PHASES},
        "v_share": None, "beta": None, "guard_active": None, "path_length_m": None, "clearance_p05_m": None,
        "disagreement": None, "guard_stops": None, "effort": None, "reversals": None, "sparc": None, "ldlj": None,
    }
    result.update(extra or {})
    return result


def sentence(result):
    """One line for people about one episode."""
    if result["outcome"] == "no_start":
        return "seed %d: no start: %s" % (result["seed"], result["reason"])
    shares = ", ".join(
        "%s %s" % (name, _percent(result["user_share"][name])) for name in ("all",) + metrics.PHASES
    )
    return "seed %d: %s (%s) in %.1f s, smallest clearance %s; user's share: %s" % (
        result["seed"], result["outcome"], result["reason"], result["duration_s"],
        _metres(result["min_clearance_m"]), shares,
    )


def report(result):
    """A few lines for people about one episode."""
    if result["outcome"] == "no_start":
        return sentence(result)
    rows = [
        ("outcome", "%s (%s)" % (result["outcome"], result["reason"])),
        ("contacts", "1" if result["outcome"] == "contact" else "0"),
        ("time", "%.1f s" % result["duration_s"]),
        ("smallest clearance", _metres(result["min_clearance_m"])),
    ] + [
        ("user's share" if name == "all" else "  in the " + name, _percent(result["user_share"][name]))
        for name in ("all",) + metrics.PHASES
    ]
    return "\n".join("%-20s %s" % row for row in rows)


def table(summary):
    """A few lines for people about many episodes."""
    rate = summary["success_rate"]
    lines = [
        "%d episodes: %d crossed, %d with contact, %d refused, %d without a start"
        % (summary["episodes"], summary["successes"], summary["contacts"], summary["refused"], summary["no_start"])
    ]
    if rate["n"]:
        lines.append(
            "crossed %.1f %% (95 %% interval %.1f to %.1f, n = %d)"
            % (100 * rate["value"], 100 * rate["low"], 100 * rate["high"], rate["n"])
        )
        lines.append(
            "smallest clearance %s, 5th percentile %s; guard active in %s of the ticks"
            % (_metres(summary["min_clearance_m"]), _metres(summary["clearance_p05_m"]),
               _percent(summary["guard_active"]))
        )
        lines.append(
            "user's share: "
            + ", ".join("%s %s" % (k, _percent(summary["user_share"][k])) for k in ("all",) + metrics.PHASES)
        )
    return "\n".join(lines)


def _percent(value):
    return "-" if value is None else "%.0f %%" % (100.0 * value)


def _metres(value):
    return "-" if value is None else "%.3f m" % value


def refuse_failed_policy(rows):
    """Raise PolicyError where a policy of somebody's own raised or gave no command: its figures mean nothing."""
    reasons = [row["reason"] for row in rows if any(words in row["reason"] for words in blending.FAILED)]
    if reasons:
        raise blending.PolicyError("the policy failed in %d of %d episodes: %s" % (len(reasons), len(rows), reasons[0]))
