"""The points of a PLY file, read whole or refused: a file that ends early gives no points that nobody measured."""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control.errors import Error

ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
         "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
         "float32": "f4", "float64": "f8"}
MAX_HEADER = 1000  # lines


class PlyError(Error):
    """A file that is no PLY file, has no points, or is damaged."""


class _Element(NamedTuple):
    """``properties``: (name, type) of each, the type None for a list."""

    name: str
    count: int
    properties: list


def points_of(content):
    """Points (n, 3) [the file's unit] of the ``vertex`` element of a PLY file's bytes. Raises PlyError."""
    order, elements, body = _header(content)
    names = [element.name for element in elements]
    if "vertex" not in names:
        raise PlyError("its PLY header names no vertices")
    before, vertex = elements[:names.index("vertex")], elements[names.index("vertex")]
    fields = [name for name, _ in vertex.properties]
    missing = [name for name in "xyz" if name not in fields]
    if missing:
        raise PlyError("has no field '%s' (has: %s)" % (missing[0], ", ".join(fields) or "none"))
    if any(kind is None for _, kind in vertex.properties):
        raise PlyError("lists among the fields of its vertices are not supported")
    if order == "":
        return _of_text(body, before, vertex, [fields.index(name) for name in "xyz"])
    return _of_bytes(body, order, before, vertex)


def _header(content):
    """Byte order ("" for text), elements (list) and the bytes behind the header."""
    if not content.startswith(b"ply") or not content[3:4].isspace():
        raise PlyError("is no PLY file")
    # old Macs end their lines by a carriage return alone
    end = b"\r" if content[3:4] == b"\r" and content[4:5] != b"\n" else b"\n"
    order, elements, at = None, [], 0
    for _ in range(MAX_HEADER):
        stop = content.find(end, at)
        if stop < 0:
            break
        words = content[at:stop].decode("ascii", "replace").split()
        at = stop + 1
        if words == ["end_header"] and order is not None:
            return order, elements, content[at:]
        if words[:1] == ["format"] and len(words) == 3 and words[1] in ORDERS:
            order = ORDERS[words[1]]
        elif words[:1] == ["element"]:
            if len(words) != 3 or not words[2].isdigit():
                break
            elements.append(_Element(words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            kind = TYPES.get(words[1]) if len(words) == 3 else None
            if not elements or kind is None and words[1:2] != ["list"]:
                break
            elements[-1].properties.append((words[-1], kind))
    raise PlyError("its PLY header is damaged")


def _of_text(body, before, vertex, columns):
    lines = [line for line in body.splitlines() if line.strip()]
    first = sum(element.count for element in before)
    rows = [line.split() for line in lines[first:first + vertex.count]]
    if rows and len(rows[-1]) < len(vertex.properties):
        rows.pop()  # the file ends within a line
    _check_count(len(rows), vertex.count)
    try:
        return np.array([[float(row[column]) for column in columns] for row in rows], dtype=float).reshape(-1, 3)
    except (ValueError, IndexError):
        raise PlyError("one of its points is no three numbers")


def _of_bytes(body, order, before, vertex):
    at = 0
    for element in before:
        if any(kind is None for _, kind in element.properties):
            raise PlyError("lists before its vertices are not supported")
        at += element.count * sum(np.dtype(kind).itemsize for _, kind in element.properties)
    kinds = [order + kind for _, kind in vertex.properties]
    offsets = np.cumsum([0] + [np.dtype(kind).itemsize for kind in kinds])
    _check_count(max(len(body) - at, 0) // int(offsets[-1]), vertex.count)
    # by number: nothing forbids two fields of one name
    table = np.frombuffer(body, np.dtype({
        "names": ["f%d" % k for k in range(len(kinds))], "formats": kinds, "offsets": offsets[:-1].tolist(),
        "itemsize": int(offsets[-1])}), vertex.count, at)
    fields = [name for name, _ in vertex.properties]
    return np.stack([table["f%d" % fields.index(name)].astype(float) for name in "xyz"], axis=-1)


def _check_count(held, count):
    if held < count:
        raise PlyError("%d of the %d points that its header announces can be read" % (held, count))
