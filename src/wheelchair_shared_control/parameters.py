"""Parameters: read once, checked against a table, refused with the key and the limit.

The table of a group stands in ``parameter_tables/<group>.py``, its numbers in ``config/<group>.yaml`` and
nowhere else. A group that needs the chair says ``INCLUDES = ["wheelchair"]`` and finds it nested under
``wheelchair``.
"""
import importlib
import math
import sys
from pathlib import Path
from typing import Any, NamedTuple, Optional, Tuple

import yaml

from wheelchair_shared_control.errors import Error

# libyaml reads ten times faster than the same loader in Python, which every episode would notice
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
PACKAGE = "wheelchair_shared_control"


class ParameterError(Error):
    """A parameter is missing, unknown, of the wrong type or outside its limits."""


class P(NamedTuple):
    """One row of a table: ``kind`` is float, int, bool, str or list; limits are inclusive."""

    name: str
    kind: type
    unit: str
    low: Optional[float]
    high: Optional[float]
    meaning: str
    choices: Tuple[Any, ...] = ()


class Settings:
    """Checked parameters: immutable, nested attributes (``settings.local_costmap.width``)."""

    def __init__(self, group, flat):
        object.__setattr__(self, "_group", group)
        object.__setattr__(self, "_flat", dict(flat))
        nested = {}
        for key, value in flat.items():
            head, _, tail = key.partition("/")
            if tail:
                nested.setdefault(head, {})[tail] = value
            else:
                object.__setattr__(self, head, value)
        for head, values in nested.items():
            object.__setattr__(self, head, Settings(group + "/" + head, values))

    def __setattr__(self, name, value):
        raise AttributeError("settings are read only: use replace()")

    def __delattr__(self, name):
        raise AttributeError("settings are read only: use replace()")

    def __reduce__(self):
        return Settings, (self._group, self._flat)

    def __repr__(self):
        return "Settings(%r, %r)" % (self._group, self._flat)

    def __eq__(self, other):
        return isinstance(other, Settings) and self._flat == other._flat

    def __hash__(self):
        return hash(repr(self))

    def as_dict(self):
        """The parameters as a flat dictionary with '/' in its keys."""
        return dict(self._flat)

    def replace(self, **changes):
        """A checked copy with some keys changed, ``replace(**{"local_costmap/width": 8.0})``."""
        flat = dict(self._flat)
        unknown = set(changes) - set(flat)
        if unknown:
            raise ParameterError("%s: unknown parameter '%s'" % (self._group, sorted(unknown)[0]))
        flat.update(changes)
        return load(self._group, _nest(flat))


def package_file(relative):
    """Path of a file of this package, such as ``config/blender.yaml``, in source, devel or install space."""
    here = Path(__file__).resolve()
    # <package>/src/wheelchair_shared_control/parameters.py, or
    # <prefix>/lib/python3/dist-packages/wheelchair_shared_control/parameters.py
    for root in (here.parents[2], here.parents[4] / "share" / PACKAGE):
        path = root / relative
        if path.exists():
            return path
    raise ParameterError("%s: no such file in package %s" % (relative, PACKAGE))


def table(group):
    """All rows of a group as {name: P}, with the rows of what it includes."""
    module = _module(group)
    rows = {row.name: row for row in module.TABLE}
    for name in getattr(module, "INCLUDES", ()):
        rows.update({name + "/" + key: row for key, row in table(name).items()})
    return rows


def load(group, given=None, source=""):
    """Checked settings of ``group``.

    ``given`` is a nested dictionary (a node's private parameters); without it the numbers of
    ``config/<group>.yaml`` are read. ``source`` names the giver in messages. Raises ParameterError.
    """
    rows = table(group)
    if given is None:
        given = _defaults(group)
        source = source or "config/%s.yaml" % group
    where = source or group
    given_rows = getattr(_module(group), "given_rows", None)  # rows whose names the user chooses
    if given_rows is not None:
        rows.update((row.name, row) for row in given_rows(given))
    # rows of kind dict take their sub-dictionary whole (observation sources have names of their own)
    flat = _flatten(given, {name for name, row in rows.items() if row.kind is dict}, where)
    unknown = [key for key in flat if key not in rows]
    if unknown:
        raise ParameterError("%s: unknown parameter '%s'" % (where, unknown[0]))
    missing = [key for key in rows if key not in flat]
    if missing:
        raise ParameterError("%s: parameter '%s' is missing" % (where, missing[0]))
    settings = Settings(group, {key: _checked(rows[key], flat[key], where, key) for key in rows})
    together = getattr(_module(group), "contradiction", None)  # what only several parameters together can get wrong
    said = together(settings) if together is not None else ""
    if said:
        raise ParameterError("%s: %s" % (where, said))
    return settings


def load_or_exit(group, given, who):
    """As ``load``; a refusal is printed as one line and ends the process with exit code 1."""
    try:
        return load(group, given, who)
    except ParameterError as error:
        print("%s" % error, file=sys.stderr, flush=True)
        sys.exit(1)


def read_yaml(path):
    """Content of a YAML file as a dictionary. Raises ParameterError that names the file."""
    try:
        with open(str(path), encoding="utf-8") as stream:
            content = yaml.load(stream, Loader=LOADER)
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterError("%s: cannot be read: %s" % (path, getattr(error, "strerror", None) or error))
    except yaml.YAMLError as error:
        raise ParameterError("%s: is no YAML: %s" % (path, " ".join(str(error).split())))
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise ParameterError("%s: holds no mapping of parameters" % path)
    return content


def _module(group):
    try:
        return importlib.import_module("%s.parameter_tables.%s" % (PACKAGE, group))
    except ImportError:
        raise ParameterError("no parameter group '%s'" % group)


def _defaults(group):
    module = _module(group)
    values = read_yaml(package_file("config/%s.yaml" % group))
    for name in getattr(module, "INCLUDES", ()):
        values[name] = _defaults(name)
    return values


def _flatten(values, whole, where, prefix=""):
    flat = {}
    for key, value in values.items():
        name = prefix + str(key)
        if isinstance(value, dict) and name not in whole:
            if not value:
                raise ParameterError("%s: parameter '%s' is empty" % (where, name))
            flat.update(_flatten(value, whole, where, name + "/"))
        else:
            flat[name] = value
    return flat


def _nest(flat):
    nested = {}
    for key, value in flat.items():
        *heads, last = key.split("/")
        level = nested
        for head in heads:
            level = level.setdefault(head, {})
        level[last] = value
    return nested


def _checked(row, value, where, key):
    """``value`` in the type of its row; raises ParameterError with key, value and limit."""

    def refuse(limit):
        unit = " " + row.unit if row.unit else ""
        raise ParameterError("%s: parameter '%s' is %r, but must be %s%s" % (where, key, value, limit, unit))

    if row.kind is float:
        # YAML 1.1 reads 1e-3 as a string; ROS users write it all the same.
        if isinstance(value, str):
            try:
                value = float(value)
            except ValueError:
                refuse("a number")
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            refuse("a number")
        value = float(value)
        if not math.isfinite(value):
            refuse("finite")
    elif row.kind is int:
        if isinstance(value, bool) or not isinstance(value, int):
            refuse("a whole number")
    elif row.kind is list and isinstance(value, str):
        # costmap_2d takes a list as text, too: "[[0.7, 0.3], [0.7, -0.3], ...]"
        try:
            value = yaml.load(value or "[]", Loader=LOADER)
        except yaml.YAMLError:
            refuse("a list")
        if not isinstance(value, list):
            refuse("a list")
    elif not isinstance(value, row.kind):
        refuse({bool: "true or false", str: "text", list: "a list", dict: "a mapping"}[row.kind])
    if row.kind in (float, int):
        if row.low is not None and value < row.low:
            refuse("at least %g" % row.low)
        if row.high is not None and value > row.high:
            refuse("at most %g" % row.high)
    if row.choices and value not in row.choices:
        refuse("one of " + ", ".join(str(choice) for choice in row.choices))
    return value
