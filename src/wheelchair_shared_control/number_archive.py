"""NumPy archives (npz) of plain numbers and text: written wholly or not at all, read entry by entry, never as pickle.

What an entry means is its owner's business: ``task_model_file``, ``cases``.
"""
import io
import zipfile
from pathlib import Path

import numpy as np

from wheelchair_shared_control import command_line
from wheelchair_shared_control.errors import Error

FLOAT_SIZES = (4, 8)  # bytes
DATE = (1980, 1, 1, 0, 0, 0)  # of every entry: the same arrays are the same file


class ArchiveError(Error):
    """A file is no such archive; the message does not name it."""


def write(path, arrays):
    """Write ``arrays`` {entry: array} to ``path``; equal arrays give equal bytes. Raises OutputError."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            content = io.BytesIO()
            np.lib.format.write_array(content, np.asarray(array), allow_pickle=False)
            entry = zipfile.ZipInfo(name + ".npy", DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content.getvalue())
    command_line.write_atomically(path, packed.getvalue())


def read(path, entries, limit, what):
    """Arrays {entry: array} of ``path``, which must hold ``entries`` and no others.

    ``entries`` {entry: (kinds of dtype, shape)}; a letter in a shape stands for any length. ``limit``: most bytes,
    packed and unpacked; ``what`` the file should be, in words. Raises ArchiveError.
    """
    path = Path(path)
    try:
        if path.is_dir():
            raise ArchiveError("is a directory, no %s" % what)
        if not path.exists():
            raise ArchiveError("cannot be read: No such file or directory")
        if not path.is_file():
            raise ArchiveError("is no regular file")
        _check_size("is", path.stat().st_size, limit)
        with zipfile.ZipFile(str(path)) as archive:
            _check_size("unpacks to", sum(entry.file_size for entry in archive.infolist()), limit)
            _check_names([entry.filename for entry in archive.infolist()], entries, what)
            return {name: _entry(archive, name, *entries[name]) for name in entries}
    except ArchiveError:
        raise
    except PermissionError as error:
        raise ArchiveError("cannot be read: %s" % error.strerror)
    except (OSError, ValueError, EOFError, RuntimeError, NotImplementedError, zipfile.BadZipFile) as error:
        raise ArchiveError("is no %s: %s" % (what, " ".join(str(error).split()) or "it is damaged"))
    except Exception as error:
        # zlib and the archive's own parsers raise errors of many kinds on damaged bytes
        raise ArchiveError("is damaged: %s" % (" ".join(str(error).split()) or type(error).__name__))


def _check_size(verb, size, limit):
    if size > limit:
        raise ArchiveError("%s %.0f MB: it must be at most %.0f MB" % (verb, size / 1e6, limit / 1e6))


def _check_names(names, entries, what):
    for name in names:
        if name not in [known + ".npy" for known in entries] or names.count(name) > 1:
            raise ArchiveError("is no %s: entry '%s' is unknown or double" % (what, name))
    for name in entries:
        if name + ".npy" not in names:
            raise ArchiveError("is no %s: entry '%s' is missing" % (what, name))


def _entry(archive, name, kinds, shape):
    array = np.lib.format.read_array(io.BytesIO(archive.read(name + ".npy")), allow_pickle=False)
    fits = array.ndim == len(shape) and all(
        isinstance(wanted, str) or wanted == found for wanted, found in zip(shape, array.shape)
    )
    if array.dtype.kind not in kinds or (kinds == "f" and array.dtype.itemsize not in FLOAT_SIZES) or not fits:
        expected = "(%s%s)" % (", ".join(str(length) for length in shape), "," if len(shape) == 1 else "")
        raise ArchiveError("entry '%s' is %s %s, not %s" % (name, array.dtype, array.shape, expected))
    return array
