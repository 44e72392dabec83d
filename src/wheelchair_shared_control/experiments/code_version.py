"""Which code and which numbers an episode's result depends on, as a short digest.

A stored result is only valid for the code that made it. Figures, pages and command lines do not count.
"""
import functools
import hashlib
from pathlib import Path

import wheelchair_shared_control
from wheelchair_shared_control import parameters

# the modules of experiments/ that make a result; the others only show it
EXPERIMENTS = ("episode", "graph", "metrics", "options", "recorder", "referee", "results", "smoothness")
CONFIG = ("*.yaml", "models/*.npz")


@functools.lru_cache(maxsize=1)
def digest():
    """Twelve hexadecimal digits over the package's modules and config/."""
    root = Path(wheelchair_shared_control.__file__).parent
    config = parameters.package_file("config/wheelchair.yaml").parent
    files = [
        path for path in root.rglob("*.py")
        if path.parent.name != "experiments" or path.stem in EXPERIMENTS
    ]
    for pattern in CONFIG:
        files += config.glob(pattern)
    names = {_name(path, root, config): path for path in files}
    result = hashlib.sha256()
    for name in sorted(names):
        content = names[name].read_bytes()
        result.update(("%s %d\n" % (name, len(content))).encode("utf-8"))
        result.update(content)
    return result.hexdigest()[:12]


def _name(path, root, config):
    base = root if root in path.parents else config
    return "%s/%s" % (base.name, path.relative_to(base).as_posix())
