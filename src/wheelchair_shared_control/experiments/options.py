"""The options that describe an episode: one table for ``evaluate``, ``compare`` and the demo."""
import argparse
import math
from pathlib import Path
from typing import NamedTuple, Optional, Tuple

from wheelchair_shared_control import blending
from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.parameter_tables.move_base import PLANNERS

SCENES = ("open", "left_wall", "right_wall", "hallway")
USERS = ("goal_directed", "hard_left", "hard_right", "away", "frozen", "tremor", "switch", "random")
POLICIES = ", ".join(blending.POLICIES)
CAMERAS = {"640x480": (640, 480), "160x120": (160, 120)}


class OptionError(Error):
    """An option names something that does not exist, or a number outside its limits."""

    exit_code = 2  # as where argparse refuses


class Options(NamedTuple):
    """What an episode is, apart from its seed. Angles in degrees as on the command line, else SI units."""

    policy: str = "learned_variance"
    planner: str = "move_base"
    user: str = "goal_directed"
    scene: str = "open"
    door_width: float = 0.90
    clutter: bool = False
    person: bool = False
    guard: bool = True
    model: Optional[str] = None
    sigma_scale: Optional[float] = None
    detector: bool = True
    camera: Tuple[int, int] = (640, 480)
    start_distance: Optional[Tuple[float, float]] = None
    start_heading: Optional[Tuple[float, float]] = None
    start_offset: Optional[Tuple[float, float]] = None
    dead_time: Optional[float] = None
    lag: Optional[float] = None
    drift: Optional[float] = None
    map: Optional[str] = None
    doors: Optional[str] = None
    door: Optional[str] = None
    side: Optional[int] = None


def number(low, high, unit=""):
    """An argparse type: a finite number from ``low`` to ``high``."""

    def parse(text):
        try:
            value = float(text)
        except ValueError:
            raise argparse.ArgumentTypeError("'%s' is not a number" % text)
        if not math.isfinite(value) or not low <= value <= high:
            raise argparse.ArgumentTypeError("%s is outside %g to %g%s" % (text, low, high, unit and " " + unit))
        return value

    return parse


def span(low, high, unit=""):
    """An argparse type: ``A`` or ``A:B`` within ``low`` to ``high``, as a pair."""
    one = number(low, high, unit)

    def parse(text):
        parts = text.split(":")
        if len(parts) > 2:
            raise argparse.ArgumentTypeError("'%s' is neither A nor A:B" % text)
        values = tuple(one(part) for part in parts)
        first, last = values[0], values[-1]
        if first > last:
            raise argparse.ArgumentTypeError("'%s': %g is above %g" % (text, first, last))
        return first, last

    return parse


def count(low, high):
    """An argparse type: a whole number from ``low`` to ``high``."""

    def parse(text):
        try:
            value = int(text)
        except ValueError:
            raise argparse.ArgumentTypeError("'%s' is not a whole number" % text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError("%s is outside %d to %d" % (text, low, high))
        return value

    return parse


def numbers(low, high, unit=""):
    """An argparse type: numbers within ``low`` to ``high``, separated by commas."""
    one = number(low, high, unit)

    def parse(text):
        values = [one(part) for part in text.split(",") if part]
        if not values:
            raise argparse.ArgumentTypeError("needs at least one number")
        return values

    return parse


def add_episode_options(parser, without=()):
    """Give ``parser`` the options that describe an episode, ``without`` some (their names without dashes)."""
    defaults = Options()

    def add(name, **details):
        if name[2:] in without:
            parser.set_defaults(**{name[2:].replace("-", "_"): None})
        else:
            parser.add_argument(name, **details)

    add("--policy", default=defaults.policy, help="%s, or path.py:function (default %%(default)s)" % POLICIES)
    add("--planner", default=defaults.planner, help="%s (default %%(default)s)" % ", ".join(PLANNERS))
    add("--user", default=defaults.user, help="%s, or a YAML file (default %%(default)s)" % ", ".join(USERS))
    add("--scene", default=defaults.scene, help="%s, or a YAML file (default %%(default)s)" % ", ".join(SCENES))
    add("--door-width", type=number(0.3, 3.0, "m"), default=defaults.door_width, metavar="M",
        help="clear width of the scene's door (default %(default).2f m)")
    add("--clutter", action="store_true", help="put 3-6 boxes into the room")
    add("--person", action="store_true", help="a person walks across the chair's way")
    add("--guard", choices=("on", "off"), default="on", help="the last check of every command (default on)")
    add("--model", metavar="paper|full|FILE", help="task model (default: the policy's own)")
    add("--sigma-scale", type=number(0.1, 10.0), metavar="X",
        help="factor of the learned deviation (the paper tried 1, 2 and 3, and took 3)")
    add("--detector", choices=("on", "truth"), default="on",
        help="find the doorway in the depth image, or be given the true one (default on)")
    add("--camera", choices=sorted(CAMERAS), default="640x480", help="size of the depth image")
    add("--start-distance", type=span(0.3, 10.0, "m"), metavar="M[:M]", help="base_link before the door plane")
    add("--start-heading", type=span(-180.0, 180.0, "degrees"), metavar="DEG[:DEG]",
        help="heading to the door's normal, left positive")
    add("--start-offset", type=span(-3.0, 3.0, "m"), metavar="M[:M]", help="beside the door's axis, left positive")
    add("--dead-time", type=number(0.0, 2.0, "s"), metavar="S", help="of the plant, and what planner and guard know")
    add("--lag", type=number(0.0, 2.0, "s"), metavar="S", help="of the plant, and what planner and guard know")
    add("--drift", type=number(0.0, 10.0), metavar="X", help="odometry errors times X (0: none)")
    add("--map", metavar="FILE", help="map_server YAML, .sdf, .obj, .stl, .dae or .ply as the world")
    add("--doors", metavar="FILE", help="YAML file of the world's annotated doors")
    add("--door", metavar="NAME", help="name of the door to cross (default: by the seed; compare: every one)")
    add("--side", type=int, choices=(0, 1), help="side of the door to start from (default: by the seed; compare: both)")


def episode_options(args, users=None, scenes=None, planners=None, policies=None):
    """``Options`` of parsed arguments. Raises OptionError where they do not fit together.

    ``users``, ``scenes``, ``planners``, ``policies``: names to check where a command takes several.
    """
    if (args.map is None) != (args.doors is None):
        raise OptionError("--map and --doors go together: the start is drawn before an annotated door")
    for name in ("door", "side"):
        if getattr(args, name) is not None and args.map is None:
            raise OptionError("--%s needs --map and --doors" % name)
    if args.map is not None:
        for name in ("start_distance", "start_heading", "start_offset"):
            if getattr(args, name) is not None:
                raise OptionError(
                    "--%s is for scenes: before a real door the start is drawn by the seed" % name.replace("_", "-")
                )
    for policy in [args.policy] if policies is None else policies:
        if ":" not in policy and policy not in blending.POLICIES:
            raise OptionError("--policy '%s' is unknown: %s, or path.py:function" % (
                policy, ", ".join(sorted(blending.POLICIES))))
    for scene in [args.scene] if scenes is None else scenes:
        _known("--scene", scene, SCENES)
    for user in [args.user] if users is None else users:
        _known("--user", user, USERS)
    for planner in [args.planner] if planners is None else planners:
        _known("--planner", planner, PLANNERS)
    return Options(
        policy=args.policy, planner=args.planner, user=args.user, scene=args.scene, door_width=args.door_width,
        clutter=args.clutter, person=bool(args.person), guard=args.guard == "on", model=args.model,
        sigma_scale=args.sigma_scale,
        detector=args.detector == "on", camera=CAMERAS[args.camera], start_distance=args.start_distance,
        start_heading=args.start_heading, start_offset=args.start_offset, dead_time=args.dead_time, lag=args.lag,
        drift=args.drift, map=args.map, doors=args.doors, door=args.door,
        side=args.side,
    )


def _known(option, value, names):
    """Refuse a value that is neither one of ``names`` nor an existing YAML file."""
    if value in names:
        return
    if value.endswith((".yaml", ".yml")):
        if not Path(value).is_file():
            raise OptionError("%s %s: no such file" % (option, value))
        return
    raise OptionError("%s '%s' is unknown: %s" % (option, value, ", ".join(names)))
