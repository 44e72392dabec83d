"""How soon a command follows its cause: from the times at which both were heard to delays, rates and gaps."""
import numpy as np

from wheelchair_shared_control.errors import Error


class LatencyError(Error):
    """Nothing was heard from which a delay could be told."""


def delays(causes, effects):
    """Delay (n,) [s] from each of ``causes`` (n,) to the first of ``effects`` (m,) at or after it.

    Both are times in rising order [s]. A cause after the last effect has none and is left out.
    """
    causes, effects = np.asarray(causes, dtype=float), np.asarray(effects, dtype=float)
    if not len(effects):
        return np.empty(0)
    causes = causes[causes <= effects[-1]]
    return effects[np.searchsorted(effects, causes, side="left")] - causes


def summary(causes, effects):
    """Figures of one stretch as a dictionary: delays and gaps [ms], rates [Hz]. Raises LatencyError."""
    late = delays(causes, effects)
    if len(late) < 2 or len(effects) < 2:
        raise LatencyError(
            "heard %d user's commands and %d commands to the chair: too few for a delay" % (len(causes), len(effects))
        )
    gaps = np.diff(effects)
    return {
        "n": len(late),
        "median_ms": 1e3 * float(np.median(late)),
        "p99_ms": 1e3 * float(np.percentile(late, 99)),
        "max_ms": 1e3 * float(late.max()),
        "user_rate": float((len(causes) - 1) / (causes[-1] - causes[0])),
        "command_rate": float((len(effects) - 1) / (effects[-1] - effects[0])),
        "longest_gap_ms": 1e3 * float(gaps.max()),
    }
