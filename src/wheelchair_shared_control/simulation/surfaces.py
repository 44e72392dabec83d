"""The world as coloured triangles, for the eye."""
import numpy as np

_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
# sides and top; nobody looks from below
_TRIANGLES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
                       [1, 5, 7], [1, 7, 3]])
WALL, CLUTTER, MESH, PERSON = (0.66, 0.65, 0.62), (0.62, 0.45, 0.28), (0.70, 0.72, 0.76), (0.85, 0.40, 0.15)


def of_boxes(boxes):
    """Triangles (10 n, 3, 3) [m] of boxes (n, 7)."""
    local = _CORNERS[None] * boxes[:, None, 4:7]
    cos, sin = np.cos(boxes[:, 3])[:, None], np.sin(boxes[:, 3])[:, None]
    corners = np.empty_like(local)
    corners[..., 0] = boxes[:, 0:1] + cos * local[..., 0] - sin * local[..., 1]
    corners[..., 1] = boxes[:, 1:2] + sin * local[..., 0] + cos * local[..., 1]
    corners[..., 2] = boxes[:, 2:3] + local[..., 2]
    return corners[:, _TRIANGLES].reshape(-1, 3, 3)


def shades(triangles, colour):
    """A colour (n, 3) for each of ``triangles`` (n, 3, 3): lightest on top, walls by their heading."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(length > 0.0, length, 1.0)
    return (normals ** 2 @ np.array([0.92, 0.78, 1.0]))[:, None].clip(0.0, 1.0) * np.asarray(colour)


def of_world(world, centre, reach):
    """Named sets [(name, colour, triangles (n, 3, 3) [m])] of what lies within ``reach`` [m] of ``centre`` (2,)."""
    near = np.hypot(world.boxes[:, 0] - centre[0], world.boxes[:, 1] - centre[1]) < reach
    loose = np.array([name.startswith("clutter") for name in world.names[: len(world.boxes)]], dtype=bool)
    sets = [("walls", WALL, of_boxes(world.boxes[near & ~loose])),
            ("clutter", CLUTTER, of_boxes(world.boxes[near & loose]))]
    sets += [("mesh_%d" % index, MESH, np.asarray(vertices)[np.asarray(triangles)])
             for index, (vertices, triangles) in enumerate(world.meshes)]
    return [entry for entry in sets if len(entry[2])]
