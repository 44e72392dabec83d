"""An SDF file of boxes as a world: the collisions of its models, nested poses followed, everything at rest.

A tilted box becomes a mesh of twelve triangles, an upright cylinder a few boxes inside it. Meshes are read
where their files are found. What is left out is told in ``World.left_out``; planes, which are floors, and
visuals do not count.
"""
import math
import os
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from wheelchair_shared_control.simulation.world import SceneError, World

_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_TRIANGLES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
                       [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])
UPRIGHT = 1e-3  # rad: what leans less stands
ROUND = np.radians([15.0, 30.0, 45.0, 60.0, 75.0])  # corners of the rectangles that fill a circle


def load(path):
    """The world of an SDF file. Raises SceneError that names the file and the part."""
    path = str(path)
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError, ValueError) as error:
        raise SceneError("%s: is no SDF: %s" % (path, error))
    if root.tag != "sdf":
        raise SceneError("%s: is no SDF: its root is '%s'" % (path, root.tag))
    rows, row_names, meshes, mesh_names = [], [], [], []
    left_out = ["include of %s" % (entry.findtext("uri") or "").strip() for entry in root.iter("include")]
    for name, transform, shape in _collisions(root, path):
        kind = shape.tag
        if kind == "box":
            size = _sizes(shape.findtext("size"), 3, path, "size of collision '%s'" % name)
            row = _upright(transform, size)
            if row is None:
                meshes.append((_moved(_CORNERS * size / 2.0, transform), _TRIANGLES))
                mesh_names.append(name)
            else:
                rows.append(row)
                row_names.append(name)
        elif kind == "cylinder" and abs(transform[2, 2]) >= math.cos(UPRIGHT):
            radius, length = (_sizes(shape.findtext(key), 1, path, "%s of collision '%s'" % (key, name))[0]
                              for key in ("radius", "length"))
            for angle in ROUND:
                rows.append((*transform[:3, 3], 0.0, radius * math.cos(angle), radius * math.sin(angle),
                             length / 2.0))
                row_names.append(name)
        elif kind == "mesh":
            found = _mesh(shape, path, name)
            if found is None:
                left_out.append("%s: %s is not found" % (name, shape.findtext("uri")))
            else:
                meshes.append((_moved(found[0], transform), found[1]))
                mesh_names.append(name)
        elif kind != "plane":
            left_out.append("%s: a %s" % (name, kind))
    if not rows and not meshes:
        raise SceneError("%s: holds no collision of a box" % path)
    model = root.find(".//model")
    title = model.get("name") if model is not None else None
    return World(boxes=np.array(rows, dtype=float).reshape(-1, 7), meshes=tuple(meshes),
                 names=tuple(row_names + mesh_names), name=title or path, left_out=tuple(left_out))


def _collisions(root, path):
    """Name, world_from_shape (4, 4) and geometry's element of every collision."""
    stack = [(model, np.eye(4), "") for model in list(root.findall("model")) + list(root.findall("world/model"))]
    stack.reverse()
    while stack:
        model, parent, prefix = stack.pop()
        frame = parent @ _pose(model, path)
        stack += [(inner, frame, "%s%s/" % (prefix, inner.get("name", "model")))
                  for inner in reversed(model.findall("model"))]
        for link in model.findall("link"):
            from_link = frame @ _pose(link, path)
            for index, collision in enumerate(link.findall("collision")):
                name = "%s%s/%s" % (prefix, link.get("name", "link"), collision.get("name", "collision_%d" % index))
                geometry = collision.find("geometry")
                if geometry is None or len(geometry) == 0:
                    raise SceneError("%s: collision '%s' has no geometry" % (path, name))
                yield name, from_link @ _pose(collision, path), geometry[0]


def _mesh(shape, path, name):
    """Vertices and triangles of a mesh's element, or None where its file is not found."""
    uri = (shape.findtext("uri") or "").strip()
    scale = _numbers(shape.findtext("scale") or "1 1 1", 3, path, "scale of collision '%s'" % name)
    kind, _, rest = uri.rpartition("://")
    folders = [Path(path).parent]
    if kind == "model":
        searched = os.environ.get("GAZEBO_MODEL_PATH", "").split(":")
        folders += [Path(path).parent.parent] + [Path(folder) for folder in searched if folder]
    for folder in folders:
        file = folder / rest
        if rest and file.is_file():
            from wheelchair_shared_control.simulation import meshes
            vertices, triangles = meshes.load(file).meshes[0]
            return vertices * scale, triangles
    return None


def _moved(points, transform):
    return points @ transform[:3, :3].T + transform[:3, 3]


def _sizes(text, count, path, what):
    sizes = _numbers(text, count, path, what)
    if not np.all(sizes > 0.0):
        raise SceneError("%s: %s is %g m, but must be more than 0" % (path, what, sizes.min()))
    return sizes


def _pose(element, path):
    pose = element.find("pose")
    if pose is None or not (pose.text or "").strip():
        return np.eye(4)
    for key in ("frame", "relative_to"):
        if pose.get(key):
            raise SceneError("%s: pose of '%s' is given in frame '%s', but only nested frames are read"
                             % (path, element.get("name", element.tag), pose.get(key)))
    numbers = _numbers(pose.text, 6, path, "pose of '%s'" % element.get("name", element.tag))
    if pose.get("degrees") in ("true", "1"):  # SDF 1.9
        numbers[3:] = np.radians(numbers[3:])
    x, y, z, roll, pitch, yaw = numbers
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    transform = np.eye(4)
    transform[:3, :3] = [[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                         [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                         [-sp, cp * sr, cp * cr]]
    transform[:3, 3] = (x, y, z)
    return transform


def _numbers(text, count, path, what):
    try:
        numbers = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        numbers = np.array([])
    if len(numbers) != count or not np.all(np.isfinite(numbers)):
        raise SceneError("%s: %s is %r, but must be %d finite numbers" % (path, what, (text or "").strip(), count))
    return numbers


def _upright(transform, size):
    """The row of ``World.boxes`` of a box one of whose axes is vertical, or None."""
    vertical = int(np.argmax(np.abs(transform[2, :3])))
    if abs(transform[2, vertical]) < math.cos(UPRIGHT):
        return None
    first, second = [axis for axis in range(3) if axis != vertical]
    yaw = math.atan2(transform[1, first], transform[0, first])
    x, y, z = transform[:3, 3]
    return (x, y, z, yaw, size[first] / 2.0, size[second] / 2.0, size[vertical] / 2.0)
