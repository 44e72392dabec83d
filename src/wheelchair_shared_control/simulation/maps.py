"""A map_server map as a world: occupied pixels become walls, merged into few boxes.

Thresholds, ``negate`` and the modes trinary, scale and raw as in map_server 1.17.
"""
import math
from pathlib import Path

import numpy as np
from numba import njit
from PIL import Image

from wheelchair_shared_control import se2
from wheelchair_shared_control.simulation.world import FloorMap, SceneError, World

MODES = ("trinary", "scale", "raw")
REQUIRED = ("image", "resolution", "origin", "occupied_thresh", "free_thresh", "negate")
LARGEST = 30000  # pixels a side


def load(path, content, wall_height=2.5):
    """The world of a map's YAML ``content`` (mapping) read from ``path``. Raises SceneError."""
    settings = _checked(path, content)
    image = Path(settings["image"]).expanduser()
    if not image.is_absolute():
        image = Path(path).parent / image
    occupied, free = _read(path, image, settings)
    resolution, origin = settings["resolution"], np.array(settings["origin"])
    rectangles = merge(occupied)
    low, high = rectangles[:, :2] * resolution, rectangles[:, 2:] * resolution
    boxes = np.empty((len(rectangles), 7))
    boxes[:, :2] = se2.transform_points(origin, 0.5 * (low + high))
    boxes[:, 2], boxes[:, 6] = wall_height / 2.0, wall_height / 2.0
    boxes[:, 3] = origin[2]
    boxes[:, 4:6] = 0.5 * (high - low)
    names = tuple("wall_%d" % index for index in range(len(boxes)))
    return World(boxes=boxes, names=names, name=Path(path).stem, floor=FloorMap(free, resolution, origin))


def merge(cells):
    """Rectangles (n, 4) [column, row, end column, end row] that cover exactly the true ``cells`` (rows, columns).

    Greedy: each is the larger of widening first and of heightening first from its first free corner.
    """
    return _merge(np.ascontiguousarray(cells, dtype=np.bool_))


def _checked(path, content):
    missing = [key for key in REQUIRED if key not in content]
    if missing:
        raise SceneError("%s: key '%s' is missing" % (path, missing[0]))
    settings = {"image": content["image"], "mode": content.get("mode", "trinary")}
    if not isinstance(settings["image"], str) or not settings["image"]:
        raise SceneError("%s: 'image' is %r, but must be the name of a file" % (path, settings["image"]))
    if settings["mode"] not in MODES:
        raise SceneError("%s: 'mode' is %r, but must be one of %s" % (path, settings["mode"], ", ".join(MODES)))
    for key, low, high in (("resolution", 1e-4, 10.0), ("occupied_thresh", 0.0, 1.0), ("free_thresh", 0.0, 1.0)):
        value = _number(content[key])
        if value is None or not low <= value <= high:
            raise SceneError("%s: '%s' is %r, but must be a number from %g to %g"
                             % (path, key, content[key], low, high))
        settings[key] = value
    if settings["free_thresh"] > settings["occupied_thresh"]:
        raise SceneError("%s: 'free_thresh' is %g, but must be at most 'occupied_thresh', %g"
                         % (path, settings["free_thresh"], settings["occupied_thresh"]))
    if content["negate"] not in (0, 1, True, False):
        raise SceneError("%s: 'negate' is %r, but must be 0 or 1" % (path, content["negate"]))
    settings["negate"] = bool(content["negate"])
    origin = content["origin"]
    origin = [_number(value) for value in origin] if isinstance(origin, list) else []
    if len(origin) != 3 or None in origin:
        raise SceneError("%s: 'origin' is %r, but must be three finite numbers: x, y, yaw" % (path, content["origin"]))
    settings["origin"] = origin
    return settings


def _number(value):
    if isinstance(value, str):  # YAML 1.1 reads 5e-2 as text
        try:
            value = float(value)
        except ValueError:
            return None
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        return None
    return float(value)


def _read(path, image, settings):
    """Occupied and free cells (rows, columns) bool of an image, row 0 at the bottom."""
    if not image.is_file():
        raise SceneError("%s: image %s: no such file" % (path, image))
    largest, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
    try:
        with Image.open(str(image)) as picture:
            if max(picture.size) > LARGEST:
                raise SceneError("%s: image %s has %d x %d pixels, but must have at most %d a side"
                                 % (path, image, picture.size[0], picture.size[1], LARGEST))
            channels, alpha = _channels(picture)
    except SceneError:
        raise
    except Exception as error:  # Pillow raises what its decoders raise: OSError, SyntaxError, ValueError, struct.error
        raise SceneError("%s: image %s cannot be read: %s" % (path, image, " ".join(str(error).split())))
    finally:
        Image.MAX_IMAGE_PIXELS = largest
    if channels.dtype == np.uint8 and channels.ndim == 2:
        # one byte a pixel: every shade is judged once
        occupied, free = _judged(np.arange(256.0), settings)
        pixels = channels[::-1]
        return occupied[pixels], free[pixels]
    if alpha is not None and settings["mode"] == "trinary":
        channels = np.concatenate((channels, alpha[..., None]), axis=-1)  # map_server averages it in
    occupied, free = _judged(channels.mean(axis=-1, dtype=np.float32)[::-1], settings)
    if alpha is not None and settings["mode"] == "scale":
        seen = alpha[::-1] > 0
        occupied, free = occupied & seen, free & seen
    return occupied, free


def _judged(shade, settings):
    """Whether shades 0-255 are occupied, and whether they are free."""
    if settings["mode"] == "raw":
        value = 255.0 - shade if settings["negate"] else shade
        return (value <= 100) & (value / 100.0 > settings["occupied_thresh"]), value / 100.0 < settings["free_thresh"]
    occupancy = shade / 255.0 if settings["negate"] else (255.0 - shade) / 255.0
    return occupancy > settings["occupied_thresh"], occupancy < settings["free_thresh"]


def _channels(picture):
    """Pixels (rows, columns) uint8, or colour channels (rows, columns, k) of 0-255; and alpha or None."""
    if picture.mode.startswith("I") or picture.mode == "F":
        values = np.array(picture, dtype=np.float32)
        return values[..., None] * np.float32(255.0 / (65535.0 if values.max(initial=0.0) > 255.0 else 255.0)), None
    if picture.mode in ("PA", "LA", "RGBA", "La", "RGBa") or "transparency" in picture.info:
        values = np.array(picture.convert("RGBA"))
        return values[..., :3], values[..., 3]
    return np.array(picture.convert("L" if picture.mode in ("1", "L") else "RGB")), None


@njit(cache=True)
def _merge(cells):
    rows, columns = cells.shape
    taken = np.zeros((rows, columns), np.bool_)
    found = []
    for row in range(rows):
        for column in range(columns):
            if not cells[row, column] or taken[row, column]:
                continue
            wide = _grow(cells, taken, row, column, True)
            tall = _grow(cells, taken, row, column, False)
            best = wide if wide[0] * wide[1] >= tall[0] * tall[1] else tall
            taken[row: row + best[1], column: column + best[0]] = True
            found.append((column, row, column + best[0], row + best[1]))
    result = np.empty((len(found), 4), np.int64)
    for i in range(len(found)):
        result[i, 0], result[i, 1], result[i, 2], result[i, 3] = found[i]
    return result


@njit(cache=True)
def _grow(cells, taken, row, column, wide_first):
    """Width and height of a rectangle of free cells that begins at a cell."""
    rows, columns = cells.shape
    width, height = 1, 1
    for turn in range(2):
        if wide_first == (turn == 0):
            while column + width < columns:
                fits = True
                for r in range(row, row + height):
                    if not cells[r, column + width] or taken[r, column + width]:
                        fits = False
                        break
                if not fits:
                    break
                width += 1
        else:
            while row + height < rows:
                fits = True
                for c in range(column, column + width):
                    if not cells[row + height, c] or taken[row + height, c]:
                        fits = False
                        break
                if not fits:
                    break
                height += 1
    return width, height
