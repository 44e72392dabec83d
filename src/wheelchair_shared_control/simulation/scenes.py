"""Scenes: the paper's four, scenes from YAML, and the one way from a description to world, door and start.

The four scenes (paper Fig. 3d; the measures are ours): a wall with a door in it at x = 0, crossed along +x;
a room 6 m deep and 5 m wide before it; beyond the door nothing, or walls along the normal.
"""
from pathlib import Path
from typing import NamedTuple, Optional

import numpy as np

from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control import parameters, se2
from wheelchair_shared_control.simulation import outlines, starts
from wheelchair_shared_control.simulation.world import Door, SceneError, World, box, make

SCENES = ("open", "left_wall", "right_wall", "hallway")
ROOM_LENGTH, ROOM_WIDTH = 6.0, 5.0  # m before the door
EXIT_GAP, EXIT_LENGTH = 0.15, 4.0   # m: exit walls stand this far outside the jamb, and run this far
MESHES = (".obj", ".stl", ".dae", ".ply")
DOOR_KEYS = {"name": None, "x": None, "y": None, "yaw": None, "width": None, "height": 2.0, "thickness": 0.12}
BOX_KEYS = {"name": None, "x": None, "y": None, "z": None, "yaw": 0.0, "length": None, "width": None, "height": None}

# Streams of chance under one seed, so that a policy that asks for more of one does not shift another.
START_STREAM, CLUTTER_STREAM, NOISE_STREAM, USER_STREAM, PERSON_STREAM = range(1, 6)


class Setup(NamedTuple):
    """A world, the ``Door`` to cross (None in a world without doors) and the start pose (3,) of ``base_link``.

    ``start`` is None where the rule finds none: the episode's outcome is then ``no_start``.
    """

    world: World
    door: Optional[Door]
    start: Optional[np.ndarray]


def stream(seed, which):
    """Generator of one of the streams of chance under ``seed``."""
    return np.random.default_rng([int(seed), int(which)])


def setup(description=None, seed=None, wheelchair=None):
    """World, door and start of a flat ``description``: a mapping or settings with keys of config/scene.yaml.

    Keys left out take the numbers of config/scene.yaml; ``seed`` wins over the description's. Equal arguments
    give equal results. Raises SceneError and ParameterError.
    """
    values = parameters.load("scene").as_dict()
    values.update(description.as_dict() if hasattr(description, "as_dict") else (description or {}))
    if seed is not None:
        values["seed"] = int(seed)
    s = parameters.load("scene", values)
    footprint = footprints.from_settings(wheelchair or parameters.load("wheelchair"))
    spans = [_span(key, getattr(s, key)) for key in ("start_distance", "start_heading", "start_offset")]
    if s.map:
        world = load(s.map, wall_height=s.wall_height)
    else:
        world = load(s.scene, door_width=s.door_width, door_height=s.door_height,
                     wall_thickness=s.wall_thickness, wall_height=s.wall_height)
    world = world._replace(doors=_doors_of(world, s))
    door = _chosen(world, s.door)
    shapes = outlines.from_world(world)
    if s.start_pose:
        start = _pose("start_pose", s.start_pose)
        if outlines.clearance(shapes, footprints.corners(footprint, start)) <= 0.0:
            raise SceneError("'start_pose' is %r: the chair would stand in something there" % (s.start_pose,))
    elif door is None:
        start = starts.somewhere(world, stream(s.seed, START_STREAM), footprint, shapes)
    elif s.doors:
        start = starts.draw_real_start(world, door, stream(s.seed, START_STREAM), footprint, shapes)
    else:
        start = starts.draw_start(world, door, stream(s.seed, START_STREAM), *spans, footprint=footprint,
                                  shapes=shapes)
    if s.clutter and door is None:
        raise SceneError("%s: clutter is placed about a door, but there is none" % (s.map or s.scene))
    if s.clutter and start is not None:
        world = add_clutter(world, door, start, stream(s.seed, CLUTTER_STREAM), footprint)
    return Setup(world, door, start)


def build(scene="open", door_width=0.90, clutter=False, rng=None, start=None, door_height=2.0,
          wall_thickness=0.12, wall_height=2.5):
    """One of the paper's four scenes; lengths in metres. Raises SceneError.

    ``clutter`` needs ``rng`` and keeps 0.4 m from the footprint at ``start`` where that is given.
    """
    if scene not in SCENES:
        raise SceneError("unknown scene '%s', must be one of %s" % (scene, ", ".join(SCENES)))
    for name, value in (("door_width", door_width), ("wall_thickness", wall_thickness)):
        if not 0.0 < value < ROOM_WIDTH:
            raise SceneError("%s is %g m, but must be more than 0 and less than %g m" % (name, value, ROOM_WIDTH))
    if not 0.0 < door_height < wall_height:
        raise SceneError("door_height is %g m, but must be less than the wall's %g m" % (door_height, wall_height))
    t, h, half = wall_thickness, wall_height, ROOM_WIDTH / 2.0
    piece = half - door_width / 2.0
    rows = [
        box(0.0, door_width / 2.0 + piece / 2.0, h / 2.0, 0.0, t, piece, h),
        box(0.0, -door_width / 2.0 - piece / 2.0, h / 2.0, 0.0, t, piece, h),
        box(0.0, 0.0, (door_height + h) / 2.0, 0.0, t, door_width, h - door_height),
        box(-ROOM_LENGTH / 2.0 - t / 2.0, half + t / 2.0, h / 2.0, 0.0, ROOM_LENGTH + 2.0 * t, t, h),
        box(-ROOM_LENGTH / 2.0 - t / 2.0, -half - t / 2.0, h / 2.0, 0.0, ROOM_LENGTH + 2.0 * t, t, h),
        box(-ROOM_LENGTH - t, 0.0, h / 2.0, 0.0, t, ROOM_WIDTH, h),
    ]
    names = ["wall_left_of_door", "wall_right_of_door", "lintel", "room_left", "room_right", "room_back"]
    for side, wanted in ((1.0, ("left_wall", "hallway")), (-1.0, ("right_wall", "hallway"))):
        if scene in wanted:
            y = side * (door_width / 2.0 + EXIT_GAP + t / 2.0)
            rows.append(box(t / 2.0 + EXIT_LENGTH / 2.0, y, h / 2.0, 0.0, EXIT_LENGTH, t, h))
            names.append("exit_left" if side > 0 else "exit_right")
    door = Door(np.zeros(3), float(door_width), float(door_height), float(t), "door")
    world = make(rows, names, doors=(door,), name=scene)
    if clutter:
        if rng is None:
            raise SceneError("clutter needs a seed")
        world = add_clutter(world, door, start, rng)
    return world


def load(scene, wall_height=2.5, **measures):
    """A world from one of the four names, a scene or map YAML, an ``.sdf`` or a mesh file. Raises SceneError.

    ``measures`` are those of ``build`` and count for the four scenes only.
    """
    if scene in SCENES:
        return build(scene, wall_height=wall_height, **measures)
    path = Path(scene).expanduser()
    suffix = path.suffix.lower()
    if suffix not in (".yaml", ".yml", ".sdf", ".world") + MESHES:
        raise SceneError("unknown scene '%s', must be one of %s, or a .yaml, .sdf, .obj, .stl, .dae or .ply file"
                         % (scene, ", ".join(SCENES)))
    if not path.is_file():
        # a node's folder is not the shell's: say where a relative name was looked for
        raise SceneError("%s: no such file%s" % (scene, "" if path.is_absolute() else " in %s" % Path.cwd()))
    if suffix in (".sdf", ".world"):
        from wheelchair_shared_control.simulation import sdf
        return sdf.load(path)
    if suffix in MESHES:
        from wheelchair_shared_control.simulation import meshes
        return meshes.load(path)
    try:
        content = parameters.read_yaml(path)
    except parameters.ParameterError as error:
        raise SceneError(str(error))
    if "image" in content:
        from wheelchair_shared_control.simulation import maps
        return maps.load(path, content, wall_height)
    return from_description(content, str(path))


def from_description(content, source):
    """A world from a scene's YAML: ``boxes`` and ``doors``, lists of mappings. Raises SceneError.

    A box: ``name, x, y, z`` (centre; default half its height), ``yaw, length, width, height``. A door:
    ``name, x, y, yaw`` (of the crossing), ``width, height, thickness``. Or ``base: NAME`` of the four scenes
    with ``door_width`` and the like, to which boxes are added.
    """
    base = None
    measures = {key: content[key] for key in ("door_width", "door_height", "wall_thickness", "wall_height")
                if key in content}
    unknown = set(content) - {"name", "base", "boxes", "doors"} - set(measures)
    if unknown:
        raise SceneError("%s: unknown key '%s'" % (source, sorted(map(str, unknown))[0]))
    if measures and "base" not in content:
        raise SceneError("%s: '%s' belongs to a 'base'; without one 'boxes' and 'doors' say it" % (
            source, sorted(measures)[0]))
    try:
        if "base" in content:
            base = build(content["base"], **{key: _number(source, key, value) for key, value in measures.items()})
        rows, names = [], []
        for index, entry in enumerate(_entries(content, "boxes", source)):
            e = _filled_in(entry, BOX_KEYS, "%s: boxes[%d]" % (source, index),
                           {"name": "box_%d" % index, "z": None})
            z = e["height"] / 2.0 if e["z"] is None else e["z"]
            rows.append(box(e["x"], e["y"], z, e["yaw"], e["length"], e["width"], e["height"]))
            names.append(e["name"])
        doors = []
        for index, entry in enumerate(_entries(content, "doors", source)):
            e = _filled_in(entry, DOOR_KEYS, "%s: doors[%d]" % (source, index), {"name": "door_%d" % index})
            doors.append(Door(np.array([e["x"], e["y"], e["yaw"]]), e["width"], e["height"], e["thickness"],
                              e["name"]))
        if base is None and not rows:
            raise SceneError("'boxes' is empty and there is no 'base'")
        world = make(rows, names, doors=tuple(doors), name=str(content.get("name", Path(source).stem)))
    except SceneError as error:
        raise SceneError(str(error) if source in str(error) else "%s: %s" % (source, error))
    if base is not None:
        world = world._replace(boxes=np.vstack((base.boxes, world.boxes)), names=base.names + world.names,
                               doors=base.doors + world.doors)
    return world


def add_clutter(world, door, start, rng, footprint=footprints.Footprint(1.05, 0.65, 0.35)):
    """The world with 3-6 boxes of 0.2-0.6 m more.

    None stands in the door's passage, within 0.4 m of the footprint at ``start``, on the straight way from
    there to the door's axis (a person can drive it), or in another box.
    """
    keep_out = [se2.transform_points(door.pose, np.array([[2.2, half], [-1.5, half], [-1.5, -half], [2.2, -half]]))
                for half in (max(door.width, footprint.width) / 2.0 + 0.15,)]
    margins = [0.0]
    if start is not None:
        entry = se2.transform_points(door.pose, np.array([[-1.5, 0.0]]))[0]
        keep_out += [footprints.corners(footprint, start), np.array([start[:2], entry])]
        margins += [0.4, footprint.circumscribed_radius]
    rows, names, placed = [], [], []
    standing = outlines.near(outlines.from_world(world, 0.0, 1.0), door.pose[:2], 6.0)
    wanted = int(rng.integers(3, 7))
    for _ in range(200 * wanted):
        if len(rows) == wanted:
            break
        size = rng.uniform(0.2, 0.6, size=3)
        where = se2.compose(door.pose, np.array([rng.uniform(-4.0, 3.0), rng.uniform(-2.3, 2.3),
                                                 rng.uniform(-np.pi, np.pi)]))
        row = box(where[0], where[1], size[2] / 2.0, where[2], *size)
        shape = outlines.from_boxes(np.array([row]))[0, :4]
        if any(outlines.polygon_distance(shape, area) <= margin for area, margin in zip(keep_out, margins)):
            continue
        if outlines.clearance(standing, shape) <= 0.02:
            continue
        if any(outlines.polygon_distance(shape, other) <= 0.02 for other in placed):
            continue
        rows.append(row)
        placed.append(shape)
        names.append("clutter_%d" % len(rows))
    count = len(world.boxes)
    return world._replace(boxes=np.vstack((world.boxes, np.array(rows).reshape(-1, 7))),
                          names=world.names[:count] + tuple(names) + world.names[count:])


def _doors_of(world, s):
    if not s.doors:
        return world.doors
    from wheelchair_shared_control.simulation import doors
    annotated = doors.read(s.doors)
    if s.door and s.door not in annotated:
        raise SceneError("%s: no door '%s', must be one of %s" % (s.doors, s.door, ", ".join(annotated)))
    name = s.door or next(iter(annotated))
    return (doors.measure(world, annotated[name], s.side),)


def _chosen(world, name):
    if not name:
        return world.doors[0] if world.doors else None
    for door in world.doors:
        if door.name == name:
            return door
    raise SceneError("%s: no door '%s', must be one of %s"
                     % (world.name, name, ", ".join(door.name for door in world.doors) or "none"))


def _span(key, value):
    if len(value) != 2 or not all(_is_number(v) for v in value) or value[0] > value[1]:
        raise SceneError("'%s' is %r, but must be two finite numbers, low and high" % (key, value))
    return float(value[0]), float(value[1])


def _pose(key, value):
    if len(value) != 3 or not all(_is_number(v) for v in value):
        raise SceneError("'%s' is %r, but must be three finite numbers: x, y, yaw" % (key, value))
    return np.array(value, dtype=float)


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool) and bool(np.isfinite(value))


def _number(source, key, value):
    if not _is_number(value):
        raise SceneError("%s: '%s' is %r, but must be a finite number" % (source, key, value))
    return float(value)


def _entries(content, key, source):
    entries = content.get(key) or []
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise SceneError("%s: '%s' must be a list of mappings" % (source, key))
    return entries


def _filled_in(entry, keys, where, defaults):
    unknown = set(entry) - set(keys)
    if unknown:
        raise SceneError("%s: unknown key '%s'" % (where, sorted(map(str, unknown))[0]))
    values = {}
    for key, default in keys.items():
        if key in entry:
            values[key] = str(entry[key]) if key == "name" else _number(where, key, entry[key])
        elif key in defaults:
            values[key] = defaults[key]
        elif default is not None:
            values[key] = default
        else:
            raise SceneError("%s: key '%s' is missing" % (where, key))
    return values
