"""The detector's error table in Markdown, by distance and view angle, with 95 % Wilson intervals."""
import numpy as np

from wheelchair_shared_control.experiments.statistics import wilson

RANGES = ((1.2, 2.0), (2.0, 3.0), (3.0, 4.0))
ANGLES = ((0.0, 20.0), (20.0, 40.0), (40.0, 60.0))


def rate(hits, n):
    """A rate as {"value", "low", "high", "n"}."""
    interval = wilson(hits, n)
    return {"value": hits / n if n else None, "low": interval.low if n else 0.0, "high": interval.high if n else 1.0,
            "n": int(n)}


def summary(results):
    """Summary (dict) of ``detector_study.Result``: all, and by cell of distance and angle."""
    required = [r for r in results if r.required]
    matched, false = sum(r.matched for r in results), sum(len(r.false) for r in results)
    cells = []
    for low, high in RANGES:
        for a, b in ANGLES:
            inside = [r for r in required if low <= r.scene.distance < high
                      and a <= abs(np.degrees(r.scene.angle)) < b]
            cells.append(dict(_errors(inside), distance_m=[low, high], angle_deg=[a, b]))
    kinds = {}
    for r in results:
        entry = kinds.setdefault(r.scene.kind, {"scenes": 0, "missed": 0, "false": 0})
        entry["scenes"] += 1
        entry["missed"] += int(r.required and not r.found)
        entry["false"] += len(r.false)
    return dict(_errors(required), scenes=len(results), without_open_door=sum(not r.scene.openings for r in results),
                precision=rate(matched, matched + false), cells=cells, kinds=kinds)


def _errors(required):
    found = np.array([r.error for r in required if r.found]).reshape(-1, 4)
    place = np.hypot(found[:, 0], found[:, 1])
    turn, width = np.degrees(np.abs(found[:, 2])), np.abs(found[:, 3])

    def of(values, q):
        return float(np.percentile(values, q)) if len(values) else None

    return {
        "recall": rate(len(found), len(required)),
        "place_m": {"median": of(place, 50), "p95": of(place, 95)},
        "turn_deg": {"median": of(turn, 50), "p95": of(turn, 95)},
        "width_m": {"median": of(width, 50), "p95": of(width, 95),
                    "bias": float(np.mean(found[:, 3])) if len(found) else None},
    }


def markdown(document):
    """The table of a ``summary``, with the command that made it told by the caller."""
    lines = [
        "| camera to door | view angle | doors | recall (95 %) | place, median / p95 | direction | width | bias |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for cell in document["cells"]:
        lines.append(_row("%.1f-%.1f m" % tuple(cell["distance_m"]), "%.0f-%.0f°" % tuple(cell["angle_deg"]), cell))
    lines.append(_row("**all**", "0-60°", document))
    precision = document["precision"]
    told = "Precision %.3f (%.3f-%.3f, n = %d doorways told) over %d scenes, %d of them without an open door." % (
        precision["value"] or 0.0, precision["low"], precision["high"], precision["n"], document["scenes"],
        document["without_open_door"])
    lines += ["", told, "", "| kind of scene | scenes | doors missed | false doorways |", "|---|---|---|---|"]
    for kind in sorted(document["kinds"]):
        entry = document["kinds"][kind]
        counts = entry["scenes"], entry["missed"], entry["false"]
        lines.append("| %s | %d | %d | %d |" % ((kind.replace("_", " "),) + counts))
    return "\n".join(lines)


def _row(distance, angle, cell):
    recall = cell["recall"]
    if not recall["n"] or cell["place_m"]["median"] is None:
        return "| %s | %s | %d | | | | | |" % (distance, angle, recall["n"])
    return "| %s | %s | %d | %.3f (%.3f-%.3f) | %.1f / %.1f cm | %.2f / %.2f° | %.1f / %.1f cm | %+.1f cm |" % (
        distance, angle, recall["n"], recall["value"], recall["low"], recall["high"],
        100 * cell["place_m"]["median"], 100 * cell["place_m"]["p95"], cell["turn_deg"]["median"],
        cell["turn_deg"]["p95"], 100 * cell["width_m"]["median"], 100 * cell["width_m"]["p95"],
        100 * cell["width_m"]["bias"])
