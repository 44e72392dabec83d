"""Where the chair starts: drawn by the seed, before a scene's door or a real one."""
import numpy as np

from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control import se2
from wheelchair_shared_control.simulation import outlines
from wheelchair_shared_control.simulation.world import is_free

TRIES = 2000
REAL_DISTANCE = (1.3, 2.8)  # m from the middle of the gap
REAL_MARGIN = 0.10          # m free round the footprint
REAL_HEADING = np.pi / 4.0  # rad to the middle of the gap


def draw_start(world, door, rng, distance=(1.5, 3.0), heading_deg=(-45.0, 45.0), offset=(-0.8, 0.8),
               footprint=footprints.Footprint(1.05, 0.65, 0.35), shapes=None):
    """Pose (3,) of ``base_link`` in the world before ``door``, or None where none is free.

    ``distance`` [m] to the door plane, ``heading_deg`` to the normal and ``offset`` [m] from the axis (both
    left positive) are (low, high) of uniform draws; a draw whose footprint touches the world is repeated.
    """
    shapes = outlines.from_world(world) if shapes is None else shapes
    for _ in range(TRIES):
        d, angle, side = rng.uniform(*distance), np.radians(rng.uniform(*heading_deg)), rng.uniform(*offset)
        pose = se2.compose(door.pose, np.array([-d, side, angle]))
        if outlines.clearance(shapes, footprints.corners(footprint, pose)) > 0.0:
            return pose
    return None


def draw_real_start(world, door, rng, footprint=footprints.Footprint(1.05, 0.65, 0.35), shapes=None):
    """Pose (3,) of ``base_link`` before a door of a real building, or None where no such pose is found.

    1.3-2.8 m from the middle of the gap, footprint free by 0.10 m, the gap's middle in line of sight,
    heading within 45 degrees of it. Unknown floor is not free.
    """
    shapes = outlines.from_world(world) if shapes is None else shapes
    middle = np.asarray(door.pose[:2])
    grown = footprints.grown(footprint, REAL_MARGIN)
    for _ in range(TRIES):
        distance = rng.uniform(*REAL_DISTANCE)
        bearing = rng.uniform(-np.pi / 2.0, np.pi / 2.0)
        turn = rng.uniform(-REAL_HEADING, REAL_HEADING)
        towards = door.pose[2] + bearing
        place = middle - distance * np.array([np.cos(towards), np.sin(towards)])
        pose = np.array([place[0], place[1], se2.wrap_angle(towards + turn)])
        if outlines.clearance(shapes, footprints.corners(footprint, pose)) < REAL_MARGIN:
            continue
        if not outlines.sees(shapes, place, middle):
            continue
        if world.floor is not None and not (
            np.all(is_free(world.floor, _filled(grown, pose, world.floor.resolution / 2.0)))
            and np.all(is_free(world.floor, _line(place, middle, world.floor.resolution / 2.0)))
        ):
            continue
        return pose
    return None


def somewhere(world, rng, footprint=footprints.Footprint(1.05, 0.65, 0.35), shapes=None):
    """A free pose (3,) in a world without doors, or None: the origin, else a draw with room all round."""
    shapes = outlines.from_world(world) if shapes is None else shapes
    grown = footprints.grown(footprint, REAL_MARGIN)
    known = world.floor
    poses = np.zeros((TRIES, 3))
    poses[1:, 2] = rng.uniform(-np.pi, np.pi, TRIES - 1)
    if known is not None:
        places = _free_places(known, rng)
        poses[1:, :2] = places[rng.integers(len(places), size=TRIES - 1)] if len(places) else 0.0
    elif len(shapes.counts):
        corners = shapes.vertices.reshape(-1, 2)
        poses[1:, :2] = rng.uniform(corners.min(axis=0), corners.max(axis=0), (TRIES - 1, 2))
    for pose in poses:
        free = outlines.clearance(shapes, footprints.corners(footprint, pose)) > REAL_MARGIN
        if free and (known is None or np.all(is_free(known, _filled(grown, pose, known.resolution / 2.0)))):
            return pose
    return None


def _free_places(floor, rng):
    """Centres (n, 2) [m] of some free cells; none where no cell is free."""
    rows, columns = (rng.integers(size, size=50 * TRIES) for size in floor.free.shape)
    chosen = floor.free[rows, columns]
    rows, columns = rows[chosen], columns[chosen]
    if len(rows) == 0:  # few cells are free: look at all
        rows, columns = np.nonzero(floor.free)
    return se2.transform_points(floor.origin, (np.column_stack((columns, rows)) + 0.5) * floor.resolution)


def _filled(footprint, pose, step):
    """Points (n, 2) that fill a footprint, at most ``step`` apart."""
    x = np.linspace(footprint.rear, footprint.front, int(np.ceil(footprint.length / step)) + 1)
    y = np.linspace(-footprint.half_width, footprint.half_width, int(np.ceil(footprint.width / step)) + 1)
    return se2.transform_points(pose, np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))


def _line(a, b, step):
    count = int(np.ceil(np.hypot(*(b - a)) / step)) + 1
    return a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)
