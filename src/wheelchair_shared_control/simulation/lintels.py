"""Doors of a world of boxes: gaps of door width in a wall, told by the lintel above them."""
import numpy as np

from wheelchair_shared_control.simulation import outlines
from wheelchair_shared_control.simulation.world import Door

LOWEST, HIGHEST = 1.4, 2.7  # m: a lintel's underside
THICKEST = 0.40             # m: what is thicker is no wall
WALL_TOP = 0.80             # m: what ends lower is no wall beside a gap
SAME_PLANE = 0.03           # m
SAME_YAW = np.radians(1.0)


def find(world, narrowest=0.60, widest=1.50):
    """Doors of ``world``: free runs [m] below a lintel, and the gaps between coplanar walls without one.

    Returns (doors, gaps), tuples of ``Door`` named ``door_1`` and ``gap_1`` on; a door of limits ``narrowest``
    to ``widest`` [m] is crossed along the lintel's shorter axis.
    """
    shapes = outlines.from_world(world)
    doors = []
    for row in world.boxes:
        underside = row[2] - row[6]
        if LOWEST <= underside <= HIGHEST and 2.0 * min(row[4:6]) <= THICKEST:
            along, half, thickness = _line(row)
            for low, high in _runs(shapes, row[:2], along, (-half, half), narrowest, widest):
                _add(doors, _door(row[:2], along, low, high, underside, thickness))
    gaps = []
    for line, half, stretches, thickness in _walls(world):
        for (_, end), (begin, _) in zip(stretches[:-1], stretches[1:]):
            for low, high in _runs(shapes, line[0], line[1], (end, begin), narrowest, widest):
                gap = _door(line[0], line[1], low, high, half, thickness)
                if not _stands(doors, gap):
                    _add(gaps, gap)
    return (tuple(door._replace(name="door_%d" % (i + 1)) for i, door in enumerate(doors)),
            tuple(gap._replace(name="gap_%d" % (i + 1)) for i, gap in enumerate(gaps)))


def _line(row):
    """Unit direction (2,) of a box's longer axis, half its length and its thickness [m]."""
    yaw = row[3] if row[4] >= row[5] else row[3] + np.pi / 2.0
    return np.array([np.cos(yaw), np.sin(yaw)]), max(row[4:6]), 2.0 * min(row[4:6])


def _runs(shapes, point, along, span, narrowest, widest):
    """Free runs of door width that lie within ``span`` of a line."""
    reach = max(abs(span[0]), abs(span[1])) + widest
    return [(low, high) for low, high in outlines.free_runs(shapes, point, along, reach)
            if narrowest <= high - low <= widest and low >= span[0] - 0.05 and high <= span[1] + 0.05]


def _door(point, along, low, high, height, thickness):
    middle = np.asarray(point) + 0.5 * (low + high) * along
    # crossed towards +x, or +y where the wall runs along x
    normal = np.array([-along[1], along[0]])
    if normal[0] < -1e-6 or (abs(normal[0]) <= 1e-6 and normal[1] < 0.0):
        normal = -normal
    return Door(np.array([middle[0], middle[1], np.arctan2(normal[1], normal[0])]), float(high - low),
                float(height), float(thickness))


def _stands(doors, door):
    return any(np.hypot(*(other.pose[:2] - door.pose[:2])) < 0.3 for other in doors)


def _add(doors, door):
    if not _stands(doors, door):
        doors.append(door)


def _walls(world):
    """Coplanar walls: ((point, direction), height, merged stretches along it, thickness)."""
    groups = []
    for row in world.boxes:
        along, half, thickness = _line(row)
        if row[2] - row[6] > 0.1 or row[2] + row[6] < WALL_TOP or thickness > THICKEST:
            continue
        for line, members in groups:
            parallel = abs(line[1][0] * along[1] - line[1][1] * along[0]) < np.sin(SAME_YAW)
            away = row[:2] - line[0]
            if parallel and abs(line[1][0] * away[1] - line[1][1] * away[0]) < SAME_PLANE:
                members.append((away @ line[1], half, row[2] + row[6], thickness))
                break
        else:
            groups.append(((row[:2].copy(), along), [(0.0, half, row[2] + row[6], thickness)]))
    for line, members in groups:
        stretches = []
        for low, high in sorted((at - half, at + half) for at, half, _, _ in members):
            if stretches and low <= stretches[-1][1] + 1e-6:
                stretches[-1] = (stretches[-1][0], max(high, stretches[-1][1]))
            else:
                stretches.append((low, high))
        yield line, max(m[2] for m in members), stretches, max(m[3] for m in members)
