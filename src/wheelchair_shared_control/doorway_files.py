"""Clouds and depth images from files: .pcd .ply .png .npy .npz and bags, as frames for the detector."""
from pathlib import Path
from typing import NamedTuple, Optional

import numpy as np
import open3d as o3d
from PIL import Image

from wheelchair_shared_control import bags, conversions, ply
from wheelchair_shared_control.camera import Camera
from wheelchair_shared_control.errors import Error

CLOUDS, IMAGES, ARRAYS, BAGS = (".pcd", ".ply"), (".png",), (".npy", ".npz"), (".bag", ".db3", ".mcap")
DEPTH_TYPE, INFO_TYPE, CLOUD_TYPE = "Image", "CameraInfo", "PointCloud2"
BAG_PERIOD = 0.5  # s between the frames of a bag that are looked at


class FileError(Error):
    """A file that is no cloud, depth image or bag, or is damaged."""


class Frame(NamedTuple):
    """One observation: ``points`` (n, 3) [m] seen from ``origin`` (3,), or ``depth`` (height, width) [m] with its
    ``camera``; ``stamp`` [s] within a bag, else None."""

    points: Optional[np.ndarray] = None
    origin: tuple = (0.0, 0.0, 0.0)
    depth: Optional[np.ndarray] = None
    camera: Optional[Camera] = None
    stamp: Optional[float] = None


class Reading(NamedTuple):
    """How depth images are to be read: ``intrinsics`` (fx, fy, cx, cy) or None, ``scale`` units per metre or None,
    ``format`` mm, m, sun or None."""

    intrinsics: Optional[tuple] = None
    scale: Optional[float] = None
    format: Optional[str] = None


def read(path, reading=Reading()):
    """Frames (list) of a file; a bag has several. Raises FileError that names the file."""
    path = Path(path)
    try:
        return _frames(path, reading)
    except OSError as error:
        raise FileError("%s: cannot be read: %s" % (path, error.strerror or error))


def _frames(path, reading):
    if not path.exists():
        raise FileError("%s: no such file" % path)
    suffix = path.suffix.lower()
    if path.is_dir() or suffix in BAGS:
        return _bag(path, reading)
    if path.stat().st_size == 0:
        raise FileError("%s: is empty" % path)
    if suffix in CLOUDS:
        return [_cloud(path)]
    if suffix in IMAGES:
        return [_image(path, reading)]
    if suffix in ARRAYS:
        return [_array(path, reading)]
    raise FileError("%s: unknown kind of file, must be one of %s" % (path, " ".join(CLOUDS + IMAGES + ARRAYS + BAGS)))


# ---- clouds ----------------------------------------------------------------------------------------------


def _cloud(path):
    if path.suffix.lower() == ".ply":
        try:
            # the library fills up what it cannot read with whatever lies in memory
            return Frame(points=ply.points_of(path.read_bytes()))
        except ply.PlyError as error:
            raise FileError("%s: %s" % (path, error))
    count, fields, origin = _pcd_header(path)
    missing = [name for name in "xyz" if name not in fields]
    if missing:
        raise FileError("%s: has no field '%s' (has: %s)" % (path, missing[0], ", ".join(fields) or "none"))
    if count == 0:
        return Frame(points=np.empty((0, 3)), origin=origin)
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        try:
            # NaN and infinite points stay: the detector tells how many are valid
            cloud = o3d.io.read_point_cloud(str(path), remove_nan_points=False, remove_infinite_points=False)
        except (RuntimeError, MemoryError) as error:
            raise FileError("%s: cannot be read: %s" % (path, str(error).splitlines()[0]))
    points = np.asarray(cloud.points)
    if len(points) < count:
        raise FileError("%s: %d of the %d points that its header announces can be read" % (path, len(points), count))
    return Frame(points=points, origin=origin)


def _pcd_header(path):
    """Number of points, fields and viewpoint of a PCD file."""
    known = {}
    with open(str(path), "rb") as stream:
        for _ in range(30):
            line = stream.readline(4096)
            words = line.decode("ascii", "replace").split()
            if not line or (words and words[0] == "DATA"):
                break
            if words and not words[0].startswith("#"):
                known[words[0]] = words[1:]
        else:
            words = []
        start = stream.tell()
    if not line or "FIELDS" not in known or not words or words[0] != "DATA":
        raise FileError("%s: is no PCD file" % path)
    try:
        count = int(known["POINTS"][0]) if "POINTS" in known else int(known["WIDTH"][0]) * int(known["HEIGHT"][0])
        viewpoint = [float(word) for word in known.get("VIEWPOINT", ("0", "0", "0"))[:3]]
    except (KeyError, IndexError, ValueError):
        raise FileError("%s: its PCD header is damaged" % path)
    if count < 0 or len(viewpoint) != 3 or not np.isfinite(viewpoint).all():
        raise FileError("%s: its PCD header is damaged" % path)
    if not (set(known.get("SIZE", "4")) <= set("1248") and set(known.get("TYPE", "F")) <= set("IUF")):
        raise FileError("%s: its PCD header is damaged" % path)
    _check_length(path, start, words[1:], count, known)
    return count, known["FIELDS"], tuple(viewpoint)


def _check_length(path, start, kind, count, known):
    """Refuse a PCD file whose data, from byte ``start`` on, end early: the library would fill the rest up."""
    with open(str(path), "rb") as stream:
        stream.seek(start)
        content = stream.read()
    if kind == ["ascii"]:
        held = sum(1 for line in content.splitlines() if line.strip())
    elif kind == ["binary"]:
        try:
            counts = [int(word) for word in known.get("COUNT", ["1"] * len(known["FIELDS"]))]
            size = sum(int(word) * n for word, n in zip(known["SIZE"], counts))
        except (KeyError, ValueError):
            raise FileError("%s: its PCD header is damaged" % path)
        held = len(content) // max(size, 1)
    elif kind == ["binary_compressed"]:
        return  # the library refuses it itself
    else:
        raise FileError("%s: its PCD header is damaged" % path)
    if held < count:
        raise FileError("%s: %d of the %d points that its header announces can be read" % (path, held, count))


# ---- depth images ----------------------------------------------------------------------------------------


def _image(path, reading):
    with open(str(path), "rb") as stream:
        start = stream.read(26)
    if start[:8] != b"\x89PNG\r\n\x1a\n" or len(start) < 26:
        raise FileError("%s: is no PNG file" % path)
    if start[24:26] != b"\x10\x00":
        raise FileError("%s: a depth image has 16 bits and one channel" % path)
    try:
        with Image.open(str(path)) as stream:
            image = np.asarray(stream).astype(np.uint16)
    except Exception as error:  # Pillow raises what its decoders raise: OSError, SyntaxError, ValueError, struct.error
        raise FileError("%s: its data is damaged: %s" % (path, str(error).splitlines()[0] if str(error) else "empty"))
    return _frame_of_depth(image, path, reading)


def _array(path, reading):
    try:
        with open(str(path), "rb") as stream:
            data = np.load(stream, allow_pickle=False)
            if hasattr(data, "files"):
                arrays = [data[name] for name in data.files]
                fitting = [array for array in arrays if array.ndim == 2 or (array.ndim == 3 and array.shape[2] == 3)]
                if not fitting:
                    raise FileError("%s: holds no (n, 3) points and no (height, width) depth" % path)
                data = max(fitting, key=lambda array: array.size)
    except (OSError, ValueError, EOFError, KeyError, SyntaxError, MemoryError) as error:
        raise FileError("%s: is no NumPy array: %s" % (path, (str(error) or "damaged").splitlines()[0]))
    except Exception as error:
        if isinstance(error, Error):
            raise
        # zipfile and zlib have errors of their own
        raise FileError("%s: is no NumPy array: %s" % (path, error))
    if data.dtype.kind not in "fiu":
        raise FileError("%s: its numbers are of type %s" % (path, data.dtype))
    if data.ndim == 3 and data.shape[2] == 3:
        return Frame(points=data.reshape(-1, 3).astype(float))
    if data.ndim != 2:
        raise FileError("%s: has shape %s, must be (n, 3) points or (height, width) depth" % (path, data.shape))
    if data.shape[1] == 3:
        return Frame(points=data.astype(float))
    return _frame_of_depth(data, path, reading)


def _frame_of_depth(image, path, reading):
    depth = metres(image, reading)
    height, width = depth.shape
    if width < 16 or height < 12:
        raise FileError("%s: %d x %d pixels are no depth image" % (path, width, height))
    return Frame(depth=depth, camera=_camera(width, height, reading.intrinsics))


def metres(image, reading):
    """Depth (height, width) float32 [m] of raw numbers; what is 0 becomes NaN."""
    kind = reading.format or ("m" if image.dtype.kind == "f" else "mm")
    raw = image
    if kind == "sun":
        # SUN RGB-D turns the bits of millimetres by three
        raw = image.astype(np.uint16)
        raw = (raw >> 3) | (raw << 13)
    scale = reading.scale or (1.0 if kind == "m" else 1000.0)
    depth = raw.astype(np.float32) / np.float32(scale)
    depth[raw == 0] = np.nan
    return depth


def _camera(width, height, intrinsics):
    if intrinsics is None:
        # a PrimeSense sensor: 525 pixels at a width of 640
        focal = 525.0 * width / 640.0
        intrinsics = (focal, focal, (width - 1) / 2.0, (height - 1) / 2.0)
    return Camera(width, height, *intrinsics)


# ---- bags ------------------------------------------------------------------------------------------------


def _bag(path, reading):
    """Every half second a frame of the depth images, or else of the clouds, of a bag."""
    frames = []
    with bags.open_bag(path) as bag:
        depth, clouds = _depth_topic(bag), _topics(bag, CLOUD_TYPE)
        # what is given on the command line stands in for an uncalibrated camera
        infos = [] if reading.intrinsics is not None else [
            topic for topic in _topics(bag, INFO_TYPE) if depth and _space(topic) == _space(depth)]
        # the first image may lie before the first camera info
        camera, last = _first_camera(bag, path, infos), -np.inf
        wanted = [depth] + infos if depth else clouds[:1]
        for topic, kind, stamp, message in bag.messages(wanted):
            try:
                if kind.endswith(INFO_TYPE):
                    camera = conversions.camera_of(message)
                    continue
                if stamp - last < BAG_PERIOD:
                    continue
                if depth:
                    image = conversions.depth_of(message)
                    height, width = image.shape
                    lens = camera or _camera(width, height, reading.intrinsics)
                    if (lens.width, lens.height) != (width, height):
                        raise FileError("%s: %s is %d x %d, its camera info %d x %d: give --intrinsics" % (
                            path, topic, width, height, lens.width, lens.height))
                    frames.append(Frame(depth=image, camera=lens, stamp=stamp))
                else:
                    frames.append(Frame(points=conversions.points_of(message), stamp=stamp))
            except conversions.ConversionError as error:
                raise FileError("%s: %s: %s" % (path, topic, error))
            last = stamp
    return frames


def _first_camera(bag, path, infos):
    """``Camera`` of the first message of ``infos`` (topics), or None."""
    for topic, _, _, message in bag.messages(infos):
        try:
            return conversions.camera_of(message)
        except conversions.ConversionError as error:
            raise FileError("%s: %s: %s" % (path, topic, error))
    return None


def _space(topic):
    return topic.rpartition("/")[0]


def _depth_topic(bag):
    """The topic of the depth images, or None: of those named after depth the first that holds no colours."""
    named = [topic for topic in _topics(bag, DEPTH_TYPE) if "depth" in topic.lower()]
    for topic in named:
        for _, _, _, message in bag.messages([topic]):
            if message.encoding in conversions.DEPTH_ENCODINGS:
                return topic
            break
    return named[0] if named else None


def _topics(bag, kind):
    """Topics whose type ends in ``kind``."""
    return sorted(topic for topic, types in bag.topics.items() if any(name.split("/")[-1] == kind for name in types))
