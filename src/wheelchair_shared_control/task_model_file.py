"""The task model's file: a NumPy archive of plain numbers and text, checked entry by entry before use.

Nothing in it can be executed (no pickle), and nothing unknown is accepted: another version, a missing or an
extra entry, other names or units, a wrong shape, numbers that are no mixture.
"""
import io
import json
import zipfile
from pathlib import Path

import numpy as np

from wheelchair_shared_control import command_line, parameters
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
FLOAT_SIZES = (4, 8)  # bytes
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
        return _model(_read(path), variance)
    except TaskModelError as error:
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
    arrays = {
        "header": np.array(json.dumps(header, sort_keys=True)),
        "weights": model.weights.astype("<f8"),
        "means": model.means.astype("<f8"),
        "covariances": model.covariances.astype("<f8"),
        "floors": np.asarray(training.floors, dtype="<f8"),
        "ranges": ranges.astype("<f8"),
        "samples": samples,
        "bag_index": np.asarray(training.bag_index, dtype="<i4"),
    }
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            content = io.BytesIO()
            np.lib.format.write_array(content, array, allow_pickle=False)
            # a fixed date: the same model is the same file
            entry = zipfile.ZipInfo(name + ".npy", (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content.getvalue())
    command_line.write_atomically(path, packed.getvalue())


def _read(path):
    """Arrays by entry, of known kinds and shapes."""
    try:
        size = path.stat().st_size
    except OSError as error:
        raise TaskModelError("cannot be read: %s" % (error.strerror or error))
    if path.is_dir():
        raise TaskModelError("is a directory, not a model file")
    if size > FILE_LIMIT:
        raise TaskModelError("is %.0f MB large: a model has at most %.0f MB" % (size / 1e6, FILE_LIMIT / 1e6))
    try:
        with zipfile.ZipFile(str(path)) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
            if unpacked > FILE_LIMIT:
                raise TaskModelError("unpacks to %.0f MB: a model has at most %.0f MB" % (unpacked / 1e6,
                    FILE_LIMIT / 1e6))
            names = [entry.filename for entry in archive.infolist()]
            expected = [name + ".npy" for name in ENTRIES]
            for name in names:
                if name not in expected or names.count(name) > 1:
                    raise TaskModelError("is no task model: entry '%s' is unknown or double" % name)
            for name in expected:
                if name not in names:
                    raise TaskModelError("is no task model: entry '%s' is missing" % name[:-4])
            return {name: _entry(archive, name) for name in ENTRIES}
    except TaskModelError:
        raise
    except PermissionError as error:
        raise TaskModelError("cannot be read: %s" % error.strerror)
    except (OSError, ValueError, EOFError, RuntimeError, NotImplementedError, zipfile.BadZipFile) as error:
        raise TaskModelError("is no task model: %s" % (" ".join(str(error).split()) or "it is damaged"))
    except Exception as error:
        # zlib and the archive's own parsers raise errors of many kinds on damaged bytes
        raise TaskModelError("is damaged: %s" % " ".join(str(error).split()))


def _entry(archive, name):
    kinds, shape = ENTRIES[name]
    with archive.open(name + ".npy") as stream:
        array = np.lib.format.read_array(io.BytesIO(stream.read()), allow_pickle=False)
    fits = array.ndim == len(shape) and all(
        isinstance(wanted, str) or wanted == found for wanted, found in zip(shape, array.shape)
    )
    if array.dtype.kind not in kinds or (kinds == "f" and array.dtype.itemsize not in FLOAT_SIZES) or not fits:
        raise TaskModelError("entry '%s' is %s %s, not %s" % (name, array.dtype, array.shape, shape))
    return array


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
