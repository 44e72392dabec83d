"""Reading bags: the messages of some topics, in time order, and one clear line where a bag cannot be read.

ROS 1 bags (format 2.0, plain, bz2, lz4) and ROS 2 bags, by the library ``rosbags``; no ROS needed.
"""
import hashlib
import os
from contextlib import contextmanager
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from wheelchair_shared_control.errors import Error

METADATA = "metadata.yaml"  # what makes a directory a ROS 2 bag
# the first bytes of the storages of ROS 2 bags: sqlite3 and mcap
ROSBAG2_MAGICS = (b"SQLite format 3", b"\x89MCAP0")


class BagError(Error):
    """A bag cannot be read, or does not hold what is needed."""


def expand(paths):
    """Paths of bags: files and directories of a ROS 2 bag as they are, of other directories the bags inside.

    Raises BagError where a directory holds none.
    """
    found = []
    for path in map(Path, paths):
        # os.path: a place that must not be looked at is no error yet, the bag's reader will say so
        if not os.path.isdir(path) or os.path.exists(path / METADATA):
            found.append(path)
            continue
        try:
            names = sorted(os.listdir(path))
        except OSError as error:
            raise BagError("%s: cannot be read: %s" % (path, error.strerror))
        inside = [path / name for name in names if name.endswith(".bag") or os.path.exists(path / name / METADATA)]
        if not inside:
            raise BagError("%s: holds no .bag, and no %s of a ROS 2 bag" % (path, METADATA))
        found += inside
    return found


def sha256(path):
    """SHA-256 (hexadecimal) of a bag's bytes, of a ROS 2 bag's files in the order of their names."""
    digest = hashlib.sha256()
    for part in [path] if path.is_file() else sorted(p for p in path.iterdir() if p.is_file()):
        with open(str(part), "rb") as stream:
            for block in iter(lambda: stream.read(1 << 20), b""):
                digest.update(block)
    return digest.hexdigest()


@contextmanager
def open_bag(path):
    """A ``Bag`` for reading, closed at the end. Raises BagError that names the file."""
    path = Path(path)
    try:
        if not path.exists():
            raise BagError("%s: no such file" % path)
        if path.is_dir():
            reader = _Rosbag2(path)
        else:
            _refuse_by_magic(path)
            reader = _Rosbag1(path)
    except BagError:
        raise
    except PermissionError as error:
        raise BagError("%s: cannot be read: %s" % (path, error.strerror))
    except Exception as error:
        # the library meets damage with errors of every kind, bare assertions among them
        raise BagError("%s: %s" % (path, _reason(error)))
    try:
        yield Bag(path, reader)
    finally:
        reader.close()


class Bag:
    """An open bag: ``topics`` {topic without leading slash: message types (set)}, ``duration`` [s]."""

    def __init__(self, path, reader):
        self.path = path
        self._reader = reader
        self.topics = {}
        for connection in reader.connections:
            self.topics.setdefault(plain(connection.topic), set()).add(connection.msgtype)
        self.duration = max(reader.duration, 0) / 1e9 if reader.connections else 0.0

    def messages(self, topics):
        """Yield (topic without leading slash, message type, time of recording [s], message) of ``topics``.

        Raises BagError where the bag is damaged.
        """
        wanted = {plain(topic) for topic in topics}
        connections = [connection for connection in self._reader.connections if plain(connection.topic) in wanted]
        if not connections:
            return
        try:
            for connection, nanoseconds, raw in self._reader.messages(connections):
                message = self._reader.deserialize(raw, connection)
                yield plain(connection.topic), connection.msgtype, nanoseconds / 1e9, message
        except Exception as error:
            if isinstance(error, Error):
                raise
            raise BagError("%s: %s" % (self.path, _reason(error)))


def plain(topic):
    """A topic's name without the leading slash."""
    return topic.lstrip("/")


class _Rosbag1:
    """One file; message types are looked at only when asked for, so that an odd one harms no other."""

    def __init__(self, path):
        self._reader = Reader(path)
        self._reader.open()
        self.connections = self._reader.connections
        self.duration = self._reader.duration
        self._stores = {}

    def messages(self, connections):
        return self._reader.messages(connections=connections)

    def deserialize(self, raw, connection):
        # two publishers may send one type by different definitions (tf does): a store for each connection
        store = self._stores.get(connection.id)
        if store is None:
            store = get_typestore(Stores.EMPTY)
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
            self._stores[connection.id] = store
        return store.deserialize_ros1(raw, connection.msgtype)

    def close(self):
        self._reader.close()


class _Rosbag2:
    """A directory with metadata.yaml."""

    def __init__(self, path):
        if not (path / METADATA).exists():
            raise BagError("%s: is a directory without %s: no ROS 2 bag" % (path, METADATA))
        self._reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        self._reader.open()
        self.connections = self._reader.connections
        self.duration = self._reader.duration

    def messages(self, connections):
        return self._reader.messages(connections=connections)

    def deserialize(self, raw, connection):
        return self._reader.deserialize(raw, connection.msgtype)

    def close(self):
        self._reader.close()


def _refuse_by_magic(path):
    """Say what a file is that the library would only call invalid."""
    if not path.is_file():
        raise BagError("%s: is no regular file" % path)
    try:
        with open(str(path), "rb") as stream:
            magic = stream.read(16)
    except OSError as error:
        raise BagError("%s: cannot be read: %s" % (path, error.strerror))
    if not magic:
        raise BagError("%s: is empty" % path)
    if magic.startswith(ROSBAG2_MAGICS):
        raise BagError("%s: is a part of a ROS 2 bag: name the directory that holds it and its metadata.yaml" % path)
    if not magic.startswith(b"#ROSBAG V") and not magic.startswith(b"#ROSRECORD V"):
        raise BagError("%s: is no bag" % path)
    if not magic.startswith(b"#ROSBAG V2.0"):
        version = magic.split(b"\n")[0].split(b" V")[-1].decode("ascii", "replace")
        raise BagError("%s: has bag format %s: only 2.0 is read ('rosbag fix' converts older bags)" % (path, version))


def _reason(error):
    text = " ".join(str(error).split())
    if "not indexed" in text:
        return "has no index, it was not closed or is cut short: 'rosbag reindex' mends it"
    if "index looks damaged" in text:
        return "is cut short or its index is damaged: 'rosbag reindex' may mend it"
    kind = type(error).__name__
    if kind in ("ReaderError", "AnyReaderError") and text:
        return text
    return "is damaged or not as the library rosbags expects it (%s%s); 'rosbag reindex' may mend a bag of ROS 1" % (
        kind, ": " + text if text else "")
