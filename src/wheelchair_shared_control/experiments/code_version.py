"""Which code, which numbers and which files of one's own an episode's result depends on, as short digests.

A stored result is only valid for what made it. Figures, pages and command lines do not count.
"""
import functools
import hashlib
from pathlib import Path

from wheelchair_shared_control import parameters
from wheelchair_shared_control.errors import Error

# the modules of experiments/ that make a result; the others only show it
EXPERIMENTS = ("episode", "graph", "metrics", "options", "recorder", "referee", "results", "smoothness")
CONFIG = ("*.yaml", "models/*.npz")
# the options that may name a file
FILES = ("policy", "user", "scene", "model", "map", "doors")


@functools.lru_cache(maxsize=None)
def digest(more=()):
    """Twelve hexadecimal digits over the package's modules and config/; ``more`` names modules of experiments/."""
    # this file's, not the package's: in catkin's devel space that is a stand-in which holds the messages alone
    root = Path(__file__).resolve().parents[1]
    config = parameters.package_file("config/wheelchair.yaml").parent
    files = [
        path for path in root.rglob("*.py")
        if path.parent.name != "experiments" or path.stem in EXPERIMENTS + tuple(more)
    ]
    for pattern in CONFIG:
        files += config.glob(pattern)
    names = {_name(path, root, config): path for path in files}
    names["urdf/wheelchair.urdf"] = parameters.package_file("urdf/wheelchair.urdf")  # masses and inertias
    result = hashlib.sha256()
    for name in sorted(names):
        content = names[name].read_bytes()
        result.update(("%s %d\n" % (name, len(content))).encode("utf-8"))
        result.update(content)
    return result.hexdigest()[:12]


def of_files(options):
    """Digests {option: twelve hexadecimal digits} of the files that ``options`` name, as they are at the first call.

    What these files name in turn (a policy's imports, meshes of an SDF) is not looked at, but for a map's image.
    """
    given = {name: getattr(options, name) for name in FILES if getattr(options, name) is not None}
    if ":" in options.policy:
        given["policy"] = options.policy.rpartition(":")[0]
    return {name: _of_file(str(path)) for name, path in given.items() if Path(path).expanduser().is_file()}


@functools.lru_cache(maxsize=None)
def _of_file(name):
    path = Path(name).expanduser()
    try:
        result = hashlib.sha256(path.read_bytes())
    except OSError:  # whoever uses the file says so
        return ""
    if path.suffix.lower() in (".yaml", ".yml"):
        try:
            image = parameters.read_yaml(path).get("image")
        except (Error, AttributeError):  # no mapping: whoever uses the file says so
            image = None
        if isinstance(image, str) and (path.parent / Path(image).expanduser()).is_file():
            result.update((path.parent / Path(image).expanduser()).read_bytes())
    return result.hexdigest()[:12]


def _name(path, root, config):
    base = root if root in path.parents else config
    return "%s/%s" % (base.name, path.relative_to(base).as_posix())
