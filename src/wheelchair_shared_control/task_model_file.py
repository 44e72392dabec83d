"""The task model's file: a NumPy archive of plain numbers and text, checked entry by entry before use.

Nothing in it can be executed (no pickle), and nothing unknown is accepted: another version, a missing or an
extra entry, other names or units, a wrong shape, numbers that are no mixture.
"""
import json
from pathlib import Path

import numpy as np

from wheelchair_shared_control import number_archive, parameters
from wheelchair_shared_control.number_archive import ArchiveError
from wheelchair_shared_control.task_model import NAMES, UNITS, VARIANCES, TaskModel, TaskModelError, Training

FORMAT = "wheelchair_shared_control/task_model"
VERSION = 1
SHIPPED = ("paper", "full")
# entry -> (kinds of dtype, shape); K components, N samples
ENTRIES = {
    "header": ("U", ()),
    "weights": ("f", ("K",)),
    "means": ("f", ("K", 6)),
    "covariances": ("f", ("K", 6, 6)),
    "floors": ("f", (6,)),
    "ranges": ("f", (2, 6)),
    "samples": ("f", ("N", 6)),
    "bag_index": ("iu", ("N",)),
}
HEADER = ("format", "version", "names", "units", "components", "density_quantiles", "provenance")
BAG_TEXTS = ("file", "sha256")  # what a bag's entry must hold
FILE_LIMIT = 50e6  # bytes, packed and unpacked: a model is some 100 kB
COMPONENT_LIMIT = 100


def locate(path):
    """Path of a model: a file, or the name of a shipped set ("paper", "full"). Raises TaskModelError."""
    if str(path) in SHIPPED:
        try:
            return parameters.package_file("config/models/%s.npz" % path)
        except parameters.ParameterError as error:
            raise TaskModelError(str(error))
    return Path(str(path)).expanduser()


def load(path, variance="paper"):
    """``TaskModel`` of a file or of a shipped set. Raises TaskModelError that names the file."""
    path = locate(path)
    try:
        return _model(number_archive.read(path, ENTRIES, FILE_LIMIT, "task model"), variance)
    except (ArchiveError, TaskModelError) as error:
        raise TaskModelError("%s: %s" % (path, error))


def save(path, model):
    """Write ``model`` to ``path``, wholly or not at all; equal models give equal bytes."""
    training = model.training
    if training is None:
        training = Training(np.empty((0, len(NAMES))), np.empty(0, int), np.zeros(len(NAMES)), {})
    samples = np.asarray(training.samples, dtype="<f4").reshape(-1, len(NAMES))
    header = {
        "format": FORMAT,
        "version": VERSION,
        "names": list(NAMES),
        "units": list(UNITS),
        "components": model.components,
        "density_quantiles": {"%g" % level: value for level, value in model.density_quantiles.items()},
        "provenance": training.provenance,
    }
    ranges = np.zeros((2, len(NAMES)))
    if len(samples):
        ranges[:] = samples.min(axis=0), samples.max(axis=0)
    number_archive.write(path, {
        "header": np.array(json.dumps(header, sort_keys=True)),
        "weights": model.weights.astype("<f8"),
        "means": model.means.astype("<f8"),
        "covariances": model.covariances.astype("<f8"),
        "floors": np.asarray(training.floors, dtype="<f8"),
        "ranges": ranges.astype("<f8"),
        "samples": samples,
        "bag_index": np.asarray(training.bag_index, dtype="<i4"),
    })


def _model(arrays, variance):
    header = _header(arrays["header"])
    count = len(arrays["weights"])
    if not 1 <= count <= COMPONENT_LIMIT:
        raise TaskModelError("has %d components: it must be 1 to %d" % (count, COMPONENT_LIMIT))
    if header["components"] != count:
        raise TaskModelError("names %r components and holds %d" % (header["components"], count))
    for name in ("floors", "ranges", "samples"):
        if not np.isfinite(arrays[name]).all():
            raise TaskModelError("entry '%s' is not finite" % name)
    if (arrays["floors"] < 0.0).any():
        raise TaskModelError("a floor is negative")
    if len(arrays["samples"]) != len(arrays["bag_index"]):
        raise TaskModelError("has %d samples of %d bags' indices" % (len(arrays["samples"]), len(arrays["bag_index"])))
    bags = header["provenance"].get("bags", [])
    if not isinstance(bags, list) or not all(isinstance(bag, dict) for bag in bags):
        raise TaskModelError("has a provenance whose bags are no list of entries")
    for bag in bags:
        if not all(isinstance(bag.get(key), str) for key in BAG_TEXTS):
            raise TaskModelError("has a provenance with a bag without %s" % " and ".join(BAG_TEXTS))
    index = arrays["bag_index"]
    if len(index) and not 0 <= index.min() <= index.max() < len(bags):
        raise TaskModelError("has samples of bag %d to %d and names %d bags" % (index.min(), index.max(), len(bags)))
    if variance not in VARIANCES:
        raise TaskModelError("variance '%s' is unknown: it must be one of %s" % (variance, ", ".join(VARIANCES)))
    training = Training(arrays["samples"], arrays["bag_index"], arrays["floors"], header["provenance"])
    return TaskModel(arrays["weights"], arrays["means"], arrays["covariances"], variance, training)


def _header(entry):
    try:
        header = json.loads(str(entry))
    except (ValueError, RecursionError) as error:
        raise TaskModelError("has a damaged header: %s" % error)
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise TaskModelError("is no task model of this package")
    if type(header.get("version")) is not int or header["version"] != VERSION:
        raise TaskModelError("has version %r: this package reads version %d" % (header.get("version"), VERSION))
    for key in HEADER:
        if key not in header:
            raise TaskModelError("has a header without '%s'" % key)
    for key in header:
        if key not in HEADER:
            raise TaskModelError("has a header with unknown '%s'" % key)
    if header["names"] != list(NAMES) or header["units"] != list(UNITS):
        raise TaskModelError(
            "has features %s in %s: they must be %s in %s"
            % (header["names"], header["units"], list(NAMES), list(UNITS))
        )
    if not isinstance(header["provenance"], dict):
        raise TaskModelError("has no readable provenance")
    return header
